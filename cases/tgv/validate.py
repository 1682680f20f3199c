"""Taylor–Green vortex at Re 1600 (F5) beside the spectral solution: .venv/bin/python cases/tgv/validate.py

A member that was begun goes on from its last checkpoint. Writes members.csv, dissipation.csv and dissipation.png.
"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "bench"))

import matplotlib
import members
import numpy as np
import pandas as pd

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HERE = pathlib.Path(__file__).resolve().parent
# Nodes in a direction, order in space.
MEMBERS = {f"n{n}-order{order}": (n, order) for n in (64, 128) for order in (2, 4)}
VOLUME, VISCOSITY = (2 * np.pi) ** 3, 1 / 1600
# By the maximum of the reference.
ALLOWED = {(128, 4): 0.045}


def measure(folder, reference):
    """−dK/dt, ε and 2ν·enstrophy at the times of the turbulence series, and the row of the table."""
    fluid, turbulence = members.series(folder, "fluid"), members.series(folder, "turbulence")
    energy = fluid.kinetic_energy / VOLUME
    decay = pd.Series(-np.gradient(energy, energy.index, edge_order=2), energy.index)
    curve = pd.DataFrame({
        "minus_dKdt": np.interp(turbulence.index, decay.index, decay),
        "dissipation": turbulence.dissipation,
        "enstrophy_2nu": 2 * VISCOSITY * turbulence.enstrophy,
        "kinetic_energy": turbulence.kinetic_energy,
    })
    end = curve.index[-1]
    highest = reference.minus_dEdt.max()
    wanted = np.interp(decay.index, reference.index, reference.minus_dEdt)
    off = (decay - wanted) / highest
    cost = members.summary(folder).get("fluid", {}).get("seconds_per_node_step")
    row = {
        "t_end": end, "steps": int(fluid.step.iloc[-1]),
        "off_max": off.abs().max(), "off_at": off.abs().idxmax(), "off_rms": np.sqrt(np.trapezoid(off**2, off.index) / end),
        "peak": decay.max(), "peak_at": decay.idxmax(), "peak_reference": highest, "peak_at_reference": reference.minus_dEdt.idxmax(),
        "dissipation_off_max": ((curve.dissipation - np.interp(curve.index, reference.index, reference.minus_dEdt)) / highest).abs().max(),
        "enstrophy_off_max": ((curve.enstrophy_2nu - np.interp(curve.index, reference.index, 2 * VISCOSITY * reference.enstrophy)) / highest).abs().max(),
        "not_viscous_max": ((curve.minus_dKdt - curve.dissipation) / highest).abs().max(),
        "ns_per_node_step": cost and 1e9 * cost,
    }
    return curve, row


def figure(found, reference, path):
    plot, (left, middle, right) = plt.subplots(1, 3, figsize=(15, 4.6))
    for axis in (left, right):
        axis.plot(reference.index, reference.minus_dEdt, "k", lw=1.2, label="spectral 512³")
    for k, (label, (curve, row)) in enumerate(found.items()):
        left.plot(curve.index, curve.minus_dKdt, color=f"C{k}", label=label)
        middle.plot(curve.index, 100 * (curve.minus_dKdt - np.interp(curve.index, reference.index, reference.minus_dEdt)) / reference.minus_dEdt.max(), color=f"C{k}", label=label)
        right.plot(curve.index, curve.dissipation, color=f"C{k}", label=f"{label}, ε")
        right.plot(curve.index, curve.enstrophy_2nu, ":", color=f"C{k}", label=f"{label}, 2ν·enstrophy")
    for axis, y in [(left, "−dK/dt"), (middle, "off the spectral −dK/dt, % of its maximum"), (right, "ε, 2ν·enstrophy")]:
        axis.set_xlabel("t U/L")
        axis.set_ylabel(y)
        axis.legend(fontsize=7)
    plot.tight_layout()
    plot.savefig(path, dpi=100)


def main():
    options = members.options(__doc__, "tgv", MEMBERS, ["n64-order4"])
    reference = pd.read_csv(HERE / "reference" / "spectral_re1600_512.csv").set_index("t")
    found, missed = {}, []
    for label in options.members:
        n, order = MEMBERS[label]
        folder = members.run(options, HERE / "case.toml", label, {"mesh.cells": [n, n, n], "fluid.order": order})
        if members.series(folder, "turbulence") is None:
            missed.append(f"{label}: not run")
            continue
        curve, row = measure(folder, reference)
        found[label] = curve, row
        if row["t_end"] < 10:
            missed.append(f"{label}: has come to t = {row['t_end']:.2f} only")
        if not row["off_max"] <= ALLOWED.get((n, order), np.inf):
            missed.append(f"{label}: −dK/dt off by {100 * row['off_max']:.2f} % of the maximum")
    if found:
        table = pd.DataFrame({label: row for label, (_, row) in found.items()}).T
        table.index.name = "member"
        table.to_csv(options.out / "members.csv", float_format="%.6g")
        curves = pd.concat({label: curve for label, (curve, _) in found.items()}, names=["member", "t"])
        curves.to_csv(options.out / "dissipation.csv", float_format="%.6g")
        print(table.T.to_string())
        figure(found, reference, options.out / "dissipation.png")
    for line in missed:
        print("missed:", line)
    sys.exit(bool(missed))


main()
