"""Pressure of a drop at rest under refinement (E1): .venv/bin/python cases/static-drop/validate.py

R = 20 in a closed square of 64: the mesh refined at a fixed width ξ, and with the width at a fixed ξ/Δ. Writes pressure.csv.
"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "bench"))

import members
import numpy as np
import pandas as pd
import pyvista as pv

HERE = pathlib.Path(__file__).resolve().parent
SIDE, RADIUS = 64.0, 20.0
# Cells and ξ.
MEMBERS = {f"{n}_{width:g}": (n, width) for n, width in [(32, 2.0), (64, 2.0), (128, 2.0), (32, 4.0), (128, 1.0)]}


def settings(cells, width):
    half = 0.5 * SIDE
    return {
        "mesh.size": [SIDE, SIDE, 1.0],
        "mesh.cells": [cells, cells, 1],
        "phase.interface_width": width,
        "phase.initial": f'"tanh(({RADIUS} - sqrt((x - {half})^2 + (y - {half})^2)) / {np.sqrt(2) * width})"',
        # The slowest mode of the drop relaxes in about 35 ξ²/D.
        "time.end": 120 * width**2,
        "output.vtk.interval": 120 * width**2,
    }


def measure(folder, cells, width):
    fluid = pv.read(sorted((folder / "fluid").glob("*.pvtu"))[-1])
    plane = np.isclose(fluid.points[:, 2], 0.0)
    x, psi, pressure = fluid.points[plane], fluid["order_parameter"][plane], fluid["mechanical_pressure"][plane]
    nodes = np.where(np.isclose(x[:, :2], 0.0) | np.isclose(x[:, :2], SIDE), 0.5, 1.0).prod(axis=1)
    volumes = nodes * (SIDE / cells) ** 2
    middle = np.argmin(np.hypot(*(x[:, :2] - 0.5 * SIDE).T))
    corner = np.argmin(x[:, 0] + x[:, 1])
    # The sharp drop that holds as much.
    area = (volumes * (psi - psi[corner])).sum() / (psi[middle] - psi[corner])
    radius = np.sqrt(area / np.pi)
    tension = np.sqrt(8) / 3 * width / 0.1
    return {
        "cells": cells,
        "xi": width,
        "xi_by_spacing": width * cells / SIDE,
        "R": radius,
        "pressure_R_by_sigma": (pressure[middle] - pressure[corner]) * radius / tension,
        "fastest": np.linalg.norm(fluid["velocity"], axis=1).max() * 100.0 / tension,
    }


def main():
    options = members.options(__doc__, "static-drop", MEMBERS, ["32_2", "32_4"])
    rows, missed = {}, []
    for label in options.members:
        folder = members.run(options, HERE / "case.toml", label, settings(*MEMBERS[label]))
        if not members.ended(folder):
            missed.append(f"{label}: not at its end")
            continue
        rows[label] = measure(folder, *MEMBERS[label])
        allowed = 0.01 if rows[label]["xi_by_spacing"] >= 2 and rows[label]["xi"] <= 2 else 0.1
        if abs(rows[label]["pressure_R_by_sigma"] - 1) > allowed:
            missed.append(f"{label}: Δp R/σ = {rows[label]['pressure_R_by_sigma']:.4f}")
    if rows:
        found = pd.DataFrame(rows).T
        found.to_csv(options.out / "pressure.csv", float_format="%.6g", index_label="member")
        print(found.to_string())
    for line in missed:
        print("missed:", line)
    sys.exit(bool(missed))


main()
