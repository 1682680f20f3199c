// A 2 x 1 slab of 3 x 2 hexahedra, one element thick in z and periodic there: a two-dimensional flow.
// Patches: left, right, walls.
SetFactory("Built-in");
Point(1) = {0, 0, 0, 1};
Point(2) = {2, 0, 0, 1};
Point(3) = {2, 1, 0, 1};
Point(4) = {0, 1, 0, 1};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
Transfinite Curve {1, 3} = 4;
Transfinite Curve {2, 4} = 3;
Transfinite Surface {1};
Recombine Surface {1};
slab[] = Extrude {0, 0, 0.25} { Surface{1}; Layers{1}; Recombine; };
Periodic Surface {slab[0]} = {1} Translate {0, 0, 0.25};
Physical Volume("fluid", 1) = {slab[1]};
Physical Surface("left", 1) = {slab[5]};
Physical Surface("right", 2) = {slab[3]};
Physical Surface("walls", 3) = {slab[2], slab[4]};
