"""Hard cases of the flow solver, each alone: .venv/bin/python cases/hard-fluid/validate.py [NAME…] [--steps N] [--out DIR]

Prints and writes hard-fluid.csv: energies, divergence, largest speed, cost; for a run that stopped, its message.
"""

import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "plot"))

import cavity
import harness
import lines
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
WALLS = 'y_min = { kind = "wall" }, y_max = { kind = "wall" }'
REST = {"fluid.initial": '{ kind = "rest" }', "fluid.forcing": '{ kind = "none" }'}
OPEN = {"mesh.periodic": "[false, false, true]", "mesh.stretching": '["uniform", "uniform", "uniform"]',
        "mesh.size": "[4.0, 1.0, 0.25]", "mesh.cells": "[32, 12, 2]"}
CASES = {
    "courant-1": {},
    "courant-1.5": {"time.cfl": "1.5"},
    "slivers": {
        "mesh.element": '"tetrahedron"', "mesh.jitter": "0.2", "mesh.size": "[1.0, 0.1, 1.0]", "mesh.cells": "[4, 40, 4]",
        "mesh.stretching": '["uniform", "uniform", "uniform"]', "fluid.viscosity": "1e-4"},
    "spacing-1000": {
        "mesh.size": "[1.0, 2.0, 1.0]", "mesh.cells": "[4, 96, 4]", "mesh.stretching": '["uniform", { tanh = 4.15 }, "uniform"]'},
    "impulsive-inlet": REST | OPEN | {
        "mesh.element": '"tetrahedron"', "mesh.jitter": "0.2", "fluid.viscosity": "1e-3",
        "fluid.boundaries": '{ x_min = { kind = "inlet", velocity = [1, 0, 0] }, x_max = { kind = "outlet" }, ' + WALLS + " }"},
    "impulsive-lid": REST | {
        "mesh.element": '"prism"', "mesh.size": "[1.0, 1.0, 0.03125]", "mesh.cells": "[32, 32, 1]",
        "mesh.stretching": '["uniform", "uniform", "uniform"]', "mesh.periodic": "[false, false, true]",
        "fluid.viscosity": "1e-4",
        "fluid.boundaries": '{ x_min = { kind = "wall" }, x_max = { kind = "wall" }, y_min = { kind = "wall" }, '
                            'y_max = { kind = "moving-wall", velocity = [1, 0, 0] } }'},
    "backflow": REST | OPEN | {
        "fluid.viscosity": "1e-3",
        "fluid.boundaries": '{ x_min = { kind = "outlet", pressure = 4.0, factor = { kind = "formula", value = "sin(pi*t)" } }, '
                            'x_max = { kind = "outlet" }, ' + WALLS + " }"},
    "backflow-convective": REST | OPEN | {
        "fluid.viscosity": "1e-3",
        "fluid.boundaries": '{ x_min = { kind = "inlet", velocity = [1, 0, 0], factor = { kind = "formula", value = "cos(pi*t)" } }, '
                            'x_max = { kind = "convective-outlet" }, ' + WALLS + " }"},
}


def run(name, steps):
    """One row; a run that stops is a row with its message."""
    with tempfile.TemporaryDirectory() as out:
        try:
            summary = harness.fibreflow(HERE / "case.toml", CASES[name], steps=steps, out=out)
        except harness.Refused as stop:
            series = pathlib.Path(out) / "series" / "fluid.csv"
            done = len(cavity.reference(series)["time"]) if series.exists() else 0
            return {"case": name, "steps": done, "stopped": str(stop)}
        series = cavity.reference(pathlib.Path(out) / "series" / "fluid.csv")
        velocity = np.asarray(lines.fluid(pathlib.Path(out))["velocity"])
    energy = series["kinetic_energy"]
    return {
        "case": name, "steps": summary["steps"], "stopped": "", "time": series["time"][-1],
        "energy_start": energy[0], "energy_largest": energy.max(), "energy_end": energy[-1],
        "divergence_largest": series["divergence_max"].max(), "speed_end": np.linalg.norm(velocity, axis=1).max(),
        "courant_largest": series["cfl"].max(), "poisson_iterations": series["poisson_iterations"].mean(),
        "us_per_node_step": summary["fluid"]["seconds_per_node_step"] * 1e6, "seconds": summary["wall_seconds"],
    }


LINE = (
    "{case}: {steps} steps, energy {energy_start:.3e} -> {energy_end:.3e}, at most {energy_largest:.3e}, "
    "divergence {divergence_largest:.1e}/s, speed {speed_end:.2f}, {seconds:.0f} s"
)

if __name__ == "__main__":
    sys.exit(harness.hard_cases(__doc__, CASES, run, LINE, "hard-fluid"))
