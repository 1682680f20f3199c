// A box of 2 x 1 x 1 of tetrahedra, periodic in x and y, so that the vertical edges are copies of copies.
// Patches: bottom, top. The group "ends" lies on periodic surfaces and is therefore no patch.
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 2, 1, 1};
Mesh.MeshSizeMin = 0.4;
Mesh.MeshSizeMax = 0.4;
Periodic Surface {2} = {1} Translate {2, 0, 0};
Periodic Surface {4} = {3} Translate {0, 1, 0};
Physical Volume("fluid", 1) = {1};
Physical Surface("bottom", 1) = {5};
Physical Surface("top", 2) = {6};
Physical Surface("ends", 3) = {1, 2};
