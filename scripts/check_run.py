"""Checks what a run has left: summary, VTK files as pyvista and meshio see them, pictures.

    python scripts/check_run.py RUN_DIRECTORY --steps N [--pictures]
"""

import argparse
import json
import math
import pathlib

import meshio
import numpy as np
import pyvista as pv

KEYS = (
    "steps", "simulated_time", "wall_seconds", "ranks", "threads", "fluid.nodes", "fluid.seconds_per_node_step",
    "fluid.poisson_iterations_mean", "fluid.divergence_max", "fibres.count", "fibres.segments",
    "fibres.seconds_per_segment_step", "coupling.momentum_defect_relative",
)


def check_summary(run, steps):
    summary = json.loads((run / "summary.json").read_text())
    for key in KEYS:
        value = summary
        for part in key.split("."):
            value = value[part]
        assert value is None or math.isfinite(value), f"{key} = {value}"
    assert summary["steps"] == steps, summary["steps"]
    defect = summary["coupling"]["momentum_defect_relative"]
    assert defect is None or defect < 1e-10, f"momentum defect {defect}"
    return summary


def last(run, name):
    reader = pv.get_reader(str(run / f"{name}.pvd"))
    reader.set_active_time_value(reader.time_values[-1])
    return [part for part in reader.read() if part.n_points]


def check_fluid(run, summary):
    """Pieces read by meshio hold the same cells and values as the whole that pyvista reads."""
    (whole,) = last(run, "fluid")
    assert whole.n_cells == summary["fluid"]["elements"], (whole.n_cells, summary["fluid"]["elements"])
    for name in ("velocity", "pressure", "body_force"):
        assert np.isfinite(whole[name]).all(), name
    pieces = sorted((run / "fluid").glob("*.vtu"))
    step = pieces[-1].name.rsplit("_", 1)[0]
    meshes = [meshio.read(p) for p in pieces if p.name.startswith(step)]
    assert sum(len(block.data) for mesh in meshes for block in mesh.cells) == whole.n_cells
    largest = max(np.abs(mesh.point_data["velocity"]).max() for mesh in meshes)
    assert largest == np.abs(whole["velocity"]).max()


def check_fibres(run, summary):
    parts = last(run, "fibres")
    count, segments = summary["fibres"]["count"], summary["fibres"]["segments"]
    assert sum(part.n_lines for part in parts) == count
    assert sum(part.n_points for part in parts) == segments + count
    for part in parts:
        for name in ("radius", "velocity", "curvature"):
            assert np.isfinite(part[name]).all(), name
    assert len({fibre for part in parts for fibre in part.cell_data["fibre"]}) == count


def check_pictures(run):
    pictures = sorted((run / "pictures").glob("*.png"))
    assert pictures, "no pictures"
    for path in pictures:
        colours = np.unique(pv.read(path)["PNGImage"], axis=0)
        assert len(colours) > 200, f"{path} shows next to nothing: {len(colours)} colours"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=pathlib.Path)
    parser.add_argument("--steps", type=int, required=True)
    parser.add_argument("--pictures", action="store_true")
    options = parser.parse_args()
    summary = check_summary(options.run, options.steps)
    for name in ("case.toml", "manifest.json", "run.log"):
        assert (options.run / name).stat().st_size > 0, name
    if summary["fluid"]["nodes"]:
        check_fluid(options.run, summary)
    if summary["fibres"]["count"]:
        check_fibres(options.run, summary)
    if options.pictures:
        check_pictures(options.run)


if __name__ == "__main__":
    main()
