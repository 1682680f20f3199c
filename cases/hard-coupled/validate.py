"""Hard cases of fluid and fibres, each alone: .venv/bin/python cases/hard-coupled/validate.py [NAME…] [--steps N] [--out DIR]

Prints and writes hard-coupled.csv: kinetic energies of fluid and fibres, segments, momentum that is missing between them, crossings,
overlap, cost; for a run that stopped, its message.
"""

import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "bench"))

import harness
import numpy as np
import pandas as pd

HERE = pathlib.Path(__file__).resolve().parent
WALLS = "{ y_min = { kind = 'wall' }, y_max = { kind = 'moving-wall', velocity = [1, 0, 0], factor = { kind = 'formula', value = '%s' } } }"
CREEPING = {
    "fluid.viscosity": "10.0", "fluid.inertia": '"linear"', "fluid.forcing": '{ kind = "none" }', "fluid.initial": '{ kind = "rest" }',
    "fluid.boundaries": WALLS % "1", "time.max_step": "2e-3", "fluid.poisson.tolerance": "1e-5", "coupling.tolerance": "1e-4"}
# Settings, and the number of ranks.
CASES = {
    "courant-1": ({}, 1),
    "density-1e-3": ({"fibres.0.density": "1.0", "contact.stiffness": "0.02"}, 1),
    "density-10": ({"fibres.0.density": "1e4"}, 1),
    "100-GPa": ({"fibres.0.youngs_modulus": "1e11", "fibres.0.density": "7800.0", "fibres.0.kinematics": '"auto"', "mechanics.shear_rate": "1e3"}, 1),
    "100-GPa-flexible": ({"fibres.0.youngs_modulus": "1e11", "fibres.0.density": "7800.0", "mechanics.integrator": '"implicit"', "contact": None}, 1),
    "limp": ({"fibres.0.youngs_modulus": "10.0"}, 1),
    "slip-jump": ({
        "fluid.viscosity": "1e-2", "fluid.forcing": '{ kind = "none" }', "fluid.initial": '{ kind = "rest" }',
        "fluid.boundaries": WALLS % "tanh(1e4*sin(20*pi*t))", "fibres.0.density": "1e4"}, 1),
    "slip-jump-light": ({
        "fluid.viscosity": "1e-2", "fluid.forcing": '{ kind = "none" }', "fluid.initial": '{ kind = "rest" }',
        "fluid.boundaries": WALLS % "tanh(1e4*sin(20*pi*t))", "fibres.0.density": "1.0",
        "contact.stiffness": "0.02"}, 1),
    "walls": ({"fibres.0.density": "8e3", "gravity.acceleration": "[0, -9.81, 0]"}, 1),
    "ranks": ({}, 4),
    "slivers": ({
        "mesh.element": '"tetrahedron"', "mesh.jitter": "0.2", "mesh.size": "[0.02, 0.01, 0.02]", "mesh.cells": "[6, 60, 6]",
        "mesh.stretching": '["uniform", "uniform", "uniform"]'}, 1),
    "dense-creeping": (CREEPING | {
        "mesh.size": "[0.012, 0.012, 0.012]", "mesh.cells": "[12, 12, 12]", "fibres.0.placement.count": "50",
        "fibres.0.kinematics": '"rigid"', "fibres.0.density": "1e6", "contact.stiffness": "200.0",
        "contact.friction": "0"}, 1),
    "gaussian": ({"coupling.kernel": '"gaussian"', "coupling.width": "2.5e-3", "mesh.size": "[0.03, 0.02, 0.03]", "fibres.0.placement.count": "10"}, 1),
}


def run(name, steps):
    """One row; a run that stops is a row with its message."""
    settings, ranks = CASES[name]
    settings = dict(settings)
    with tempfile.TemporaryDirectory() as out:
        out = pathlib.Path(out)
        case = HERE / "case.toml"
        if "contact" in settings:
            text = case.read_text()
            case = out / "case.toml"
            case.write_text(text[: text.index("[contact]")] + text[text.index("[output]") :])
            del settings["contact"]
        try:
            summary = harness.fibreflow(case, settings, ranks=ranks, steps=steps, out=out / "out")
        except harness.Refused as stop:
            series = out / "out" / "series" / "fluid.csv"
            done = len(pd.read_csv(series)) if series.exists() else 0
            return {"case": name, "steps": done, "stopped": str(stop)}
        fluid, fibres = (pd.read_csv(out / "out" / "series" / f"{kind}.csv") for kind in ("fluid", "fibres"))
    speeds = np.sqrt(fluid.bulk_velocity_x**2 + fluid.bulk_velocity_y**2 + fluid.bulk_velocity_z**2)
    crossings = int(fibres.crossings.iloc[-1]) if "crossings" in fibres else None
    return {
        "case": name, "steps": summary["steps"], "stopped": "", "time": fluid.time.iloc[-1], "step": fluid.dt.mean(),
        "courant_largest": fluid.cfl.max(), "fluid_energy_start": fluid.kinetic_energy.iloc[0],
        "fluid_energy_largest": fluid.kinetic_energy.max(), "fluid_energy_end": fluid.kinetic_energy.iloc[-1],
        "fibre_energy_largest": fibres.kinetic_energy.max(), "fibre_energy_end": fibres.kinetic_energy.iloc[-1],
        "bulk_speed_largest": speeds.max(), "segments": summary["fibres"]["segments"],
        "momentum_missing": summary["coupling"]["momentum_defect_relative"], "rounds": summary["coupling"]["rounds_mean"],
        "loose_steps": summary["coupling"]["loose_steps"], "sub_steps": summary["fibres"]["substeps_mean"],
        "crossings": crossings, "overlap_largest": fibres.max_overlap.max() if "max_overlap" in fibres else None,
        "outside_points": int(fluid.outside_points.max()), "seconds": summary["wall_seconds"],
    }


LINE = (
    "{case}: {steps} steps, energy of the fluid {fluid_energy_start:.2e} -> {fluid_energy_end:.2e}, at most {fluid_energy_largest:.2e}, of fibres "
    "{fibre_energy_end:.1e}, at most {fibre_energy_largest:.1e} J; {segments} segments, momentum missing {momentum_missing:.0e}, "
    "crossings {crossings}, {seconds:.0f} s"
)

if __name__ == "__main__":
    sys.exit(harness.hard_cases(__doc__, CASES, run, LINE, "hard-coupled"))
