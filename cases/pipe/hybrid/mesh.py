"""Hybrid mesh of the pipe: rings of hexahedra on the wall, prisms in the middle (needs `pip install gmsh`).

    python mesh.py [--around 64] [--along 80] [--layers 16] [--out hybrid.msh]

Radius 1, axis x, periodic along x; the wall is the patch `wall`.
"""

import argparse
import math
import pathlib

import gmsh

HERE = pathlib.Path(__file__).parent


def section(geo, x, radius):
    """Four quarter circles of a radius around the axis."""
    centre = geo.addPoint(x, 0, 0)
    points = [geo.addPoint(x, radius * math.cos(a), radius * math.sin(a)) for a in (math.pi * (0.5 * k - 0.25) for k in range(4))]
    return points, [geo.addCircleArc(points[k], centre, points[(k + 1) % 4]) for k in range(4)]


def build(options):
    geo = gmsh.model.geo
    inner_points, inner = section(geo, 0, options.core)
    outer_points, outer = section(geo, 0, 1)
    spokes = [geo.addLine(a, b) for a, b in zip(inner_points, outer_points)]
    quarter = options.around // 4
    for arc in inner + outer:
        geo.mesh.setTransfiniteCurve(arc, quarter + 1)
    for spoke in spokes:
        geo.mesh.setTransfiniteCurve(spoke, options.layers + 1, "Progression", options.ratio)
    sections = []
    for k in range(4):
        loop = geo.addCurveLoop([spokes[k], outer[k], -spokes[(k + 1) % 4], -inner[k]])
        sections.append(geo.addPlaneSurface([loop]))
        geo.mesh.setTransfiniteSurface(sections[-1])
        geo.mesh.setRecombine(2, sections[-1])
    sections.append(geo.addPlaneSurface([geo.addCurveLoop(inner)]))
    made = [geo.extrude([(2, s)], options.length, 0, 0, numElements=[options.along], recombine=True) for s in sections]
    # Lateral surfaces in the order of the curves: spoke, outer arc, spoke, inner arc.
    walls = [m[3][1] for m in made[:4]]
    geo.synchronize()
    along_x = [1, 0, 0, options.length, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    gmsh.model.mesh.setPeriodic(2, [m[0][1] for m in made], sections, along_x)
    gmsh.model.addPhysicalGroup(2, walls, name="wall")
    gmsh.model.addPhysicalGroup(3, [m[1][1] for m in made], name="fluid")
    size = 2 * math.pi * options.core / options.around
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--around", type=int, default=64, help="cells around, a multiple of four")
    parser.add_argument("--along", type=int, default=80)
    parser.add_argument("--layers", type=int, default=16, help="rings of hexahedra")
    parser.add_argument("--ratio", type=float, default=0.85, help="thickness of a ring by that of the one inside it")
    parser.add_argument("--core", type=float, default=0.6, help="radius of the part of prisms")
    parser.add_argument("--length", type=float, default=10.0)
    parser.add_argument("--out", type=pathlib.Path, default=HERE / "hybrid.msh")
    options = parser.parse_args()
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    build(options)
    gmsh.model.mesh.generate(3)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.write(str(options.out))
    gmsh.finalize()


main()
