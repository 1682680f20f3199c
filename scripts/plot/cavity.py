"""Runs of lid-driven cavities: continuation from mesh to mesh, centrelines against reference values."""

import csv
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "bench"))

import harness
import lines
import numpy as np


def reference(path):
    """Columns of a CSV file, as arrays."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


def grid_lines(n, tanh):
    """Node coordinates of one direction of the unit box."""
    s = np.linspace(0.0, 1.0, n + 1)
    return 0.5 * (1 + np.tanh(tanh * (2 * s - 1)) / np.tanh(tanh)) if tanh else s


def interpolated(data, axes, path):
    """Writes the velocity of a run on a tensor grid, interpolated to the nodes of another, for `fluid.initial`."""
    points = np.asarray(data.points, float)
    old = [np.unique(np.round(points[:, c], 9)) for c in range(3)]
    index = tuple(np.searchsorted(old[c], points[:, c] - 1e-7) for c in range(3))
    field = np.zeros([len(a) for a in old] + [3])
    field[index] = data["velocity"]
    for c in range(3):
        field = np.moveaxis(field, c, 0)
        if len(old[c]) > 3:
            shape = field.shape[1:]
            flat = field.reshape(len(old[c]), -1)
            columns = [lines.interpolate(old[c], flat[:, k], axes[c]) for k in range(flat.shape[1])]
            field = np.stack(columns, axis=1).reshape(len(axes[c]), *shape)
        else:
            # One element thick: the same on both sides.
            field = np.repeat(field[:1], len(axes[c]), axis=0)
        field = np.moveaxis(field, 0, c)
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    np.savetxt(path, np.column_stack([nodes, field.reshape(-1, 3)]), "%.12g", ",", header="x,y,z,u,v,w", comments="")


class Chain:
    """Runs on finer and finer meshes, each from the end of the one before: a short way to the steady state."""

    def __init__(self, case, common, axes_of, folder):
        self.case, self.common, self.axes_of, self.folder = case, common, axes_of, pathlib.Path(folder)
        self.data = None

    def run(self, n, settings, ranks=1):
        """Fluid at the end of a run on mesh n, its summary, and how fast the energy still changed at the end [1/s]."""
        settings = self.common | settings
        start = self.folder / "start.csv"
        if self.data is not None:
            interpolated(self.data, self.axes_of(n), start)
            settings = settings | {"fluid.initial": f'{{ kind = "file", file = "{start}" }}'}
        with tempfile.TemporaryDirectory() as out:
            summary = harness.fibreflow(self.case, settings, ranks=ranks, out=out)
            self.data = lines.fluid(pathlib.Path(out))
            series = reference(pathlib.Path(out) / "series" / "fluid.csv")
        late = slice(-min(20, len(series["time"])), None)
        slope = np.polyfit(series["time"][late], series["kinetic_energy"][late], 1)[0]
        return self.data, summary, abs(slope) / series["kinetic_energy"][-1]


def deviation(data, axis, through, component, at, wanted):
    """Velocity on a centreline minus reference values."""
    x, velocity, _ = lines.along(data, axis, through)
    return lines.interpolate(x, velocity[:, component], at) - wanted
