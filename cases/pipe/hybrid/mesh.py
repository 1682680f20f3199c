"""Hybrid mesh of the pipe: rings of hexahedra on the wall, tetrahedra in the middle, pyramids between (needs `pip install gmsh meshio`).

    python mesh.py [--around 64] [--along 80] [--layers 16] [--out hybrid.vtu]

Radius 1, axis x. Surfaces by the array `patch`: 1 wall, 2 and 3 the ends, which are periodic copies.

Pyramids are made here, one inwards on each quadrilateral of the innermost ring, and Gmsh fills what is left between their triangles:
its own pyramids leave tetrahedra that overlap.
"""

import argparse
import math
import pathlib

import gmsh
import meshio
import numpy as np

HERE = pathlib.Path(__file__).parent


def rings(options):
    """Nodes (ring, station, angle), numbered in this order; hexahedra; quadrilaterals of the wall, of the innermost ring, of the ends."""
    around, along, layers = options.around, options.along, options.layers
    steps = options.ratio ** np.arange(layers)
    radii = options.core + (1 - options.core) * np.concatenate([[0], np.cumsum(steps)]) / steps.sum()
    angle = 2 * math.pi * np.arange(around) / around
    r, x, t = np.meshgrid(radii, options.length * np.arange(along + 1) / along, angle, indexing="ij")
    points = np.stack([x, r * np.cos(t), r * np.sin(t)], axis=-1).reshape(-1, 3)
    index = np.arange(points.shape[0]).reshape(layers + 1, along + 1, around)
    turned = np.roll(index, -1, axis=2)
    inner = np.stack([index[:-1, :-1], turned[:-1, :-1], turned[:-1, 1:], index[:-1, 1:]], axis=-1)
    outer = np.stack([index[1:, :-1], turned[1:, :-1], turned[1:, 1:], index[1:, 1:]], axis=-1)
    ends = [np.stack([index[:-1, k], index[1:, k], turned[1:, k], turned[:-1, k]], axis=-1).reshape(-1, 4) for k in (0, -1)]
    return points, np.concatenate([inner, outer], axis=-1).reshape(-1, 8), outer[-1].reshape(-1, 4), inner[0].reshape(-1, 4), ends, index[0]


def disc(circle, size):
    """Inner points and triangles of the disc in a closed polygon; triangles count the points of the polygon first."""
    gmsh.model.add("disc")
    geo = gmsh.model.geo
    corners = [geo.addPoint(*p, size) for p in circle]
    lines = [geo.addLine(a, b) for a, b in zip(corners, corners[1:] + corners[:1])]
    surface = geo.addPlaneSurface([geo.addCurveLoop(lines)])
    for line in lines:
        geo.mesh.setTransfiniteCurve(line, 2)
    geo.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(2)
    tags, where, _ = gmsh.model.mesh.getNodes(2, surface)
    number = {gmsh.model.mesh.getNodes(0, c)[0][0]: k for k, c in enumerate(corners)} | {tag: len(circle) + k for k, tag in enumerate(tags)}
    triangles = np.array([number[tag] for tag in gmsh.model.mesh.getElementsByType(2, surface)[1]]).reshape(-1, 3)
    gmsh.model.remove()
    return where.reshape(-1, 3), triangles


def fill(points, triangles, size):
    """Points inside a closed surface and the tetrahedra there; these count the points given first."""
    gmsh.model.add("core")
    surface = gmsh.model.addDiscreteEntity(2)
    used = np.unique(triangles)
    gmsh.model.mesh.addNodes(2, surface, used + 1, points[used].ravel())
    gmsh.model.mesh.addElementsByType(surface, 2, [], triangles.ravel() + 1)
    geo = gmsh.model.geo
    volume = geo.addVolume([geo.addSurfaceLoop([surface])])
    geo.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.Algorithm3D", 10)
    gmsh.option.setNumber("Mesh.Renumber", 0)
    gmsh.model.mesh.generate(3)
    tags, where, _ = gmsh.model.mesh.getNodes(3, volume)
    number = {tag: tag - 1 for tag in used + 1} | {tag: len(points) + k for k, tag in enumerate(tags)}
    tetrahedra = np.array([number[tag] for tag in gmsh.model.mesh.getElementsByType(4, volume)[1]]).reshape(-1, 4)
    gmsh.model.remove()
    return where.reshape(-1, 3), tetrahedra


def build(options):
    points, hexahedra, wall, quads, ends, circles = rings(options)
    size = 2 * math.pi * options.core / options.around
    # Apices inside the innermost ring, one a quadrilateral.
    middle = points[quads].mean(axis=1)
    inwards = 0.5 * size / np.linalg.norm(middle[:, 1:], axis=1)
    apices = middle - inwards[:, None] * np.stack([0 * middle[:, 0], middle[:, 1], middle[:, 2]], axis=-1)
    apex = len(points) + np.arange(len(quads))
    points = np.concatenate([points, apices])
    pyramids = np.concatenate([quads[:, ::-1], apex[:, None]], axis=1)
    sides = np.concatenate([np.stack([quads[:, k], quads[:, (k + 1) % 4], apex], axis=1) for k in range(4)])
    # The disc at x = 0 and its copy at the other end.
    inside, triangles = disc(points[circles[0]], size)
    discs = []
    for station, x in [(0, 0.0), (-1, options.length)]:
        number = np.concatenate([circles[station], len(points) + np.arange(len(inside))])
        discs.append(number[triangles])
        points = np.concatenate([points, inside + [x, 0, 0]])
    new, tetrahedra = fill(points, np.concatenate([sides, *discs]), size)
    points = np.concatenate([points, new])
    cells = [("hexahedron", hexahedra), ("pyramid", pyramids), ("tetra", tetrahedra), ("quad", wall)]
    patch = [0, 0, 0, 1]
    for k in range(2):
        cells += [("quad", ends[k]), ("triangle", discs[k])]
        patch += [2 + k, 2 + k]
    return meshio.Mesh(points, cells, cell_data={"patch": [np.full(len(c), p) for (_, c), p in zip(cells, patch)]})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--around", type=int, default=64, help="cells around")
    parser.add_argument("--along", type=int, default=80)
    parser.add_argument("--layers", type=int, default=16, help="rings of hexahedra")
    parser.add_argument("--ratio", type=float, default=0.85, help="thickness of a ring by that of the one inside it")
    parser.add_argument("--core", type=float, default=0.6, help="radius of the part of tetrahedra")
    parser.add_argument("--length", type=float, default=10.0)
    parser.add_argument("--out", type=pathlib.Path, default=HERE / "hybrid.vtu")
    options = parser.parse_args()
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    mesh = build(options)
    gmsh.finalize()
    mesh.write(options.out)
    print(options.out, len(mesh.points), "points", {c.type: len(c.data) for c in mesh.cells if c.type in ("hexahedron", "pyramid", "tetra")})


main()
