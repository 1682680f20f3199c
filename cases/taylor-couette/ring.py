"""Writes ring.msh, the gap between two cylinders in Gmsh format 4.1: python ring.py AROUND ACROSS > ring.msh"""

import sys

import numpy as np

RADII, HEIGHT = (1.0, 2.0), 0.1

around, across = (int(n) for n in sys.argv[1:3])
radii = np.linspace(*RADII, across + 1)
angles = 2 * np.pi * np.arange(around) / around


def node(angle, radius, layer):
    return 1 + (layer * (across + 1) + radius) * around + angle % around


points = [(r * np.cos(a), r * np.sin(a), z) for z in (0.0, HEIGHT) for r in radii for a in angles]
sides = {"inner": [], "outer": [], "z_min": [], "z_max": []}
cells = []
for i in range(around):
    for name, j in (("inner", 0), ("outer", across)):
        sides[name].append([node(i, j, 0), node(i + 1, j, 0), node(i + 1, j, 1), node(i, j, 1)])
    for j in range(across):
        # Outwards, around, up: right-handed.
        floor, roof = ([node(i, j, k), node(i, j + 1, k), node(i + 1, j + 1, k), node(i + 1, j, k)] for k in (0, 1))
        sides["z_min"].append(floor)
        sides["z_max"].append(roof)
        cells.append(floor + roof)

box = f"{-RADII[1]} {-RADII[1]} 0 {RADII[1]} {RADII[1]} {HEIGHT}"
print("$MeshFormat\n4.1 0 8\n$EndMeshFormat")
print("$PhysicalNames", len(sides) + 1, sep="\n")
for tag, name in enumerate(sides, 1):
    print(f'2 {tag} "{name}"')
print(f'3 {len(sides) + 1} "fluid"\n$EndPhysicalNames')
print(f"$Entities\n0 0 {len(sides)} 1")
for tag in range(1, len(sides) + 1):
    print(f"{tag} {box} 1 {tag} 0")
print(f"1 {box} 1 {len(sides) + 1} 0\n$EndEntities")
print(f"$Nodes\n1 {len(points)} 1 {len(points)}\n3 1 0 {len(points)}")
print(*range(1, len(points) + 1), sep="\n")
for point in points:
    print(" ".join(f"{x:.17g}" for x in point))
print("$EndNodes")
total = sum(map(len, sides.values())) + len(cells)
print(f"$Elements\n{len(sides) + 1} {total} 1 {total}")
number = 0
for tag, (kind, members) in enumerate([(3, m) for m in sides.values()] + [(5, cells)], 1):
    dimension, entity = (3, 1) if kind == 5 else (2, tag)
    print(f"{dimension} {entity} {kind} {len(members)}")
    for nodes in members:
        number += 1
        print(number, *nodes)
print("$EndElements")
