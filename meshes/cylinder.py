"""Cylinder in a channel: rings of hexahedra around the cylinder, quadrilaterals beyond, extruded (needs `pip install gmsh`).

    python cylinder.py [--diameter 0.1] [--length 2.2] [--height 0.41] [--centre 0.2 0.2] [--depth 0.41] [--size 0.02]
        [--around 64] [--layers 10] [--first 0.002] [--along 1] [--out cylinder.msh]

The channel of Schäfer & Turek (1996) as it stands. Flow along x; patches `inlet`, `outlet`, `bottom`, `top`, `cylinder`; across, z is
periodic, or between the patches `z_min` and `z_max` with --sides.
"""

import argparse
import math
import pathlib

import gmsh


def ratio(first, count, thickness):
    """Ratio of the cells of a row of given first cell, number and length, by bisection."""
    low, high = 1e-3, 1e3
    for _ in range(200):
        middle = math.sqrt(low * high)
        length = first * sum(middle**k for k in range(count))
        low, high = (middle, high) if length < thickness else (low, middle)
    return middle


def build(options):
    geo = gmsh.model.geo
    (x, y), radius = options.centre, 0.5 * options.diameter
    outer = 2 * radius
    centre = geo.addPoint(x, y, 0)
    angles = [math.pi * (0.5 * k + 0.25) for k in range(4)]

    def circle(r):
        points = [geo.addPoint(x + r * math.cos(a), y + r * math.sin(a), 0) for a in angles]
        return points, [geo.addCircleArc(points[k], centre, points[(k + 1) % 4]) for k in range(4)]

    (near, wall), (far, edge) = circle(radius), circle(outer)
    spokes = [geo.addLine(a, b) for a, b in zip(near, far)]
    for arc in wall + edge:
        geo.mesh.setTransfiniteCurve(arc, options.around // 4 + 1)
    growth = ratio(options.first, options.layers, outer - radius)
    for spoke in spokes:
        geo.mesh.setTransfiniteCurve(spoke, options.layers + 1, "Progression", growth)
    rings = []
    for k in range(4):
        loop = geo.addCurveLoop([spokes[k], edge[k], -spokes[(k + 1) % 4], -wall[k]])
        rings.append(geo.addPlaneSurface([loop]))
        geo.mesh.setTransfiniteSurface(rings[-1])
    length, height = options.length, options.height
    corners = [geo.addPoint(a, b, 0, options.size) for a, b in ((0, 0), (length, 0), (length, height), (0, height))]
    sides = [geo.addLine(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    rest = geo.addPlaneSurface([geo.addCurveLoop(sides), geo.addCurveLoop(edge)])
    for surface in rings + [rest]:
        geo.mesh.setRecombine(2, surface)
    made = [
        geo.extrude([(2, surface)], 0, 0, options.depth, numElements=[options.along], recombine=True) for surface in rings + [rest]
    ]
    geo.synchronize()
    backs = [m[0][1] for m in made]
    group = gmsh.model.addPhysicalGroup
    group(3, [m[1][1] for m in made], name="fluid")
    # Lateral surfaces follow the curves: spoke, edge, spoke, wall; bottom, outlet, top, inlet.
    group(2, [m[5][1] for m in made[:4]], name="cylinder")
    for name, k in (("bottom", 2), ("outlet", 3), ("top", 4), ("inlet", 5)):
        group(2, [made[4][k][1]], name=name)
    if options.sides:
        group(2, rings + [rest], name="z_min")
        group(2, backs, name="z_max")
    else:
        along_z = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, options.depth, 0, 0, 0, 1]
        gmsh.model.mesh.setPeriodic(2, backs, rings + [rest], along_z)
    gmsh.option.setNumber("Mesh.MeshSizeMax", options.size)
    gmsh.option.setNumber("Mesh.Algorithm", 8)
    gmsh.option.setNumber("Mesh.RecombinationAlgorithm", 1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--diameter", type=float, default=0.1)
    parser.add_argument("--length", type=float, default=2.2)
    parser.add_argument("--height", type=float, default=0.41)
    parser.add_argument("--centre", type=float, nargs=2, default=(0.2, 0.2))
    parser.add_argument("--depth", type=float, default=0.41)
    parser.add_argument("--size", type=float, default=0.02, help="cells away from the cylinder")
    parser.add_argument("--around", type=int, default=64, help="cells around, a multiple of four")
    parser.add_argument("--layers", type=int, default=10, help="rings within a diameter around the axis")
    parser.add_argument("--first", type=float, default=0.002, help="height of the first ring")
    parser.add_argument("--along", type=int, default=1, help="cells along the cylinder")
    parser.add_argument("--sides", action="store_true")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("cylinder.msh"))
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
