"""Profiles of a run along grid lines."""

import numpy as np
import pyvista as pv


def fluid(run, index=-1):
    """Fluid at an output time (the last)."""
    reader = pv.get_reader(str(run / "fluid.pvd"))
    reader.set_active_time_value(reader.time_values[index])
    parts = [part for part in reader.read() if part.n_points]
    return pv.merge(parts) if len(parts) > 1 else parts[0]


def along(data, axis, through):
    """Coordinate, velocity (n, 3) and pressure at the nodes of the line along `axis` (0–2) through a point.

    The line has to be one of grid nodes; nodes that several pieces share count once.
    """
    points = np.asarray(data.points, float)
    others = [c for c in range(3) if c != axis]
    reach = 1e-6 * np.ptp(points, axis=0).max()
    on = np.all(np.abs(points[:, others] - np.asarray(through)[others]) < reach, axis=1)
    if not on.any():
        raise ValueError(f"no nodes on the line through {through}")
    at, first = np.unique(np.round(points[on, axis] / reach).astype(int), return_index=True)
    return points[on, axis][first], np.asarray(data["velocity"], float)[on][first], np.asarray(data["pressure"], float)[on][first]


def interpolate(x, values, at):
    """Cubic interpolation through the four nearest nodes: its error is below that of a second-order solution."""
    start = np.clip(np.searchsorted(x, at) - 2, 0, len(x) - 4)
    nodes = start[:, None] + np.arange(4)
    result = np.zeros(len(at))
    for k in range(4):
        weight = np.ones(len(at))
        for m in range(4):
            if m != k:
                weight *= (at - x[nodes[:, m]]) / (x[nodes[:, k]] - x[nodes[:, m]])
        result += weight * values[nodes[:, k]]
    return result
