"""Start of a fine channel from a developed coarse one: .venv/bin/python cases/channel/start.py COARSE_RUN NX NY NZ OUT.csv

Trilinear interpolation of the last velocity field of a run of case.toml onto NX × NY × NZ cells of its box; the program makes it
solenoidal. Used as `fluid.initial = { kind = "file", file = "OUT.csv" }`.
"""

import pathlib
import sys

import numpy as np
import pyvista as pv

BETA = 2.0


def lines(cells, size):
    """Coordinates of the nodes; periodic directions with the repeated end."""
    x, z = (size[c] * np.arange(cells[c] + 1) / cells[c] for c in (0, 2))
    s = np.arange(cells[1] + 1) / cells[1]
    y = 0.5 * size[1] * (1 + np.tanh(BETA * (2 * s - 1)) / np.tanh(BETA))
    return x, y, z


def interpolated(field, at, wanted, axis):
    """The field at other coordinates along an axis, linearly."""
    k = np.clip(np.searchsorted(at, wanted, side="right") - 1, 0, len(at) - 2)
    w = (wanted - at[k]) / (at[k + 1] - at[k])
    w = w.reshape([-1 if c == axis else 1 for c in range(field.ndim)])
    return (1 - w) * field.take(k, axis) + w * field.take(k + 1, axis)


def main(run, nx, ny, nz, out):
    collection = pv.get_reader(str(pathlib.Path(run) / "fluid.pvd"))
    collection.set_active_time_value(collection.time_values[-1])
    grid = collection.read().combine()
    # Points of periodic images are there twice; every place once, in order.
    found = np.round(grid.points, 9)
    coordinates = [np.unique(found[:, c]) for c in range(3)]
    field = np.full([len(c) for c in coordinates] + [3], np.nan)
    at = tuple(np.searchsorted(coordinates[c], found[:, c]) for c in range(3))
    field[at] = grid["velocity"]
    if np.isnan(field).any():
        sys.exit("the coarse mesh is no box of planes")
    x, y, z = lines([int(n) for n in (nx, ny, nz)], [c[-1] for c in coordinates])
    wanted = x[:-1], y, z[:-1]
    u = field
    for c in range(3):
        u = interpolated(u, coordinates[c], wanted[c], c)
    u[:, [0, -1]] = 0
    points = np.stack(np.meshgrid(*wanted, indexing="ij"), -1).reshape(-1, 3)
    u = u.reshape(-1, 3)
    np.savetxt(out, np.hstack([points, u]), delimiter=",", header="x,y,z,u,v,w", comments="", fmt="%.15g")


if __name__ == "__main__":
    main(*sys.argv[1:])
