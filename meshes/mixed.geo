// A column of unit cross-section with all four element types: hexahedra below, tetrahedra with pyramids on the
// quadrilaterals in the middle, prisms on top. Patches: bottom, top, sides.
SetFactory("Built-in");
n = 2;
Point(1) = {0, 0, 0, 0.5};
Point(2) = {1, 0, 0, 0.5};
Point(3) = {1, 1, 0, 0.5};
Point(4) = {0, 1, 0, 0.5};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
Transfinite Curve {1:4} = n + 1;
Transfinite Surface {1};
Recombine Surface {1};
hexahedra[] = Extrude {0, 0, 1} { Surface{1}; Layers{n}; Recombine; };
middle[] = Extrude {0, 0, 1} { Surface{hexahedra[0]}; };
prisms[] = Extrude {0, 0, 0.5} { Surface{middle[0]}; Layers{1}; Recombine; };
Physical Volume("fluid", 1) = {hexahedra[1], middle[1], prisms[1]};
Physical Surface("bottom", 11) = {1};
Physical Surface("top", 12) = {prisms[0]};
Physical Surface("sides", 13) = {hexahedra[2], hexahedra[3], hexahedra[4], hexahedra[5], middle[2], middle[3],
    middle[4], middle[5], prisms[2], prisms[3], prisms[4], prisms[5]};
