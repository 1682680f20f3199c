"""A drop wrapped by fibres of several stiffnesses (E5): .venv/bin/python cases/droplet-wrapping/validate.py

Members go on from their last checkpoint; those called `half` are on 128 × 100 cells of 2Δ, at a sixth of the cost. Writes wrapping.csv and wrapping.png; its pictures show the last state of each member.
"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "bench"))

import matplotlib
import members
import numpy as np
import pandas as pd
import pyvista as pv

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HERE = pathlib.Path(__file__).resolve().parent
RADIUS, BEADS = 6.0, 18
STIFFNESSES = (10, 20, 40, 100, 200, 400, 700, 1000)
MEMBERS = {f"Ec{ec}_{psi_0:+.1f}": (ec, psi_0, {}) for psi_0 in (0.0, -0.2, 0.2) for ec in STIFFNESSES}
MEMBERS |= {f"{name}_half": (ec, psi_0, {"mesh.cells": "[128, 100, 1]"}) for name, (ec, psi_0, _) in MEMBERS.items()}


def beads(row):
    return np.array([[row[f"bead_{k}_x"], row[f"bead_{k}_y"]] for k in range(BEADS)])


def last_state(folder):
    return pv.read(sorted((folder / "fluid").glob("*.pvtu"))[-1])


def measure(folder, ec, psi_0):
    history, phase = members.series(folder, "beads"), members.series(folder, "phase")
    end, bend = history.iloc[-1], history.chain_0_radius
    # L 45; the plane is one Δ deep.
    radius = np.sqrt(phase.in_drops.iloc[-1] / np.pi)
    ends = beads(end)[[0, -1]]
    total = phase.free_energy + history.elastic_energy
    return {
        "Ec": ec,
        "psi_0": psi_0,
        "time": history.index[-1],
        "R_c": end.chain_0_radius,
        "R_drop": radius,
        "ratio": end.chain_0_radius / radius,
        "change_in_last_tenth": abs(bend.iloc[-1] / bend.iloc[-max(2, len(bend) // 10)] - 1),
        "wrapped": end.chain_0_wetted,
        "gap_of_ends": np.linalg.norm(ends[0] - ends[1]) / (2 * RADIUS),
        "largest_rise_of_energy": total.diff().max() / total.iloc[0],
        "amount_drift": np.abs(phase.order_parameter - phase.order_parameter.iloc[0]).max() / (256 * 200),
        "ns_per_node_step": 1e9 * members.summary(folder)["fluid"]["seconds_per_node_step"],
    }


def figure(found, folders, path):
    shown = list(folders)[:6]
    plot, panels = plt.subplots(1, len(shown) + 1, figsize=(4.2 * (len(shown) + 1), 3.6))
    for axis, label in zip(panels, shown):
        fluid = last_state(folders[label])
        plane = np.abs(fluid.points[:, 2]) < 1e-9
        x, y = fluid.points[plane, 0], fluid.points[plane, 1]
        axis.tricontourf(x, y, fluid["order_parameter"][plane], levels=np.linspace(-1.1, 1.1, 23), cmap="coolwarm")
        axis.set_aspect("equal")
        axis.set_title(f"{label}, t = {found.loc[label, 'time']:.0f}", fontsize=9)
        for centre in beads(members.series(folders[label], "beads").iloc[-1]):
            axis.add_patch(plt.Circle(centre, RADIUS, fill=False, linewidth=0.6))
    for psi_0, rows in found.groupby("psi_0"):
        panels[-1].plot(rows.Ec, rows.ratio, "o-", label=f"ψ_0 = {psi_0}")
    panels[-1].set_xlabel("Ec")
    panels[-1].set_ylabel("R_c / R_drop")
    panels[-1].legend()
    plot.tight_layout()
    plot.savefig(path, dpi=90)


def main():
    options = members.options(__doc__, "droplet-wrapping", MEMBERS, ["Ec40_+0.0"])
    rows, folders, missed = {}, {}, []
    for label in options.members:
        ec, psi_0, mesh = MEMBERS[label]
        chain = f"[{{ start = [26.0, 60.0, 0.0], count = {BEADS}, psi_0 = {psi_0} }}]"
        folder = members.run(options, HERE / "case.toml", label, mesh | {"beads.chains": chain, "dimensionless.elastocapillary": ec})
        if not list((folder / "fluid").glob("*.pvtu")) or not members.summary(folder):
            missed.append(f"{label}: not run")
            continue
        folders[label] = folder
        rows[label] = measure(folder, ec, psi_0)
        if not members.ended(folder):
            missed.append(f"{label}: not at its end")
        if rows[label]["largest_rise_of_energy"] > 1e-9:
            missed.append(f"{label}: the energy rises by {rows[label]['largest_rise_of_energy']:.1e}")
    if rows:
        found = pd.DataFrame(rows).T
        found.index.name = "member"
        found.to_csv(options.out / "wrapping.csv", float_format="%.6g")
        print(found.T.to_string())
        for psi_0, part in found.groupby("psi_0"):
            if len(part) > 2:
                slope, start = np.polyfit(part.Ec, part.ratio, 1)
                rest = part.ratio - start - slope * part.Ec
                print(f"ψ_0 = {psi_0}: R_c/R_drop = {start:.3f} + {slope:.5f} Ec, R² = {1 - rest.var() / part.ratio.var():.4f}")
        figure(found, folders, options.out / "wrapping.png")
    for line in missed:
        print("missed:", line)
    sys.exit(bool(missed))


main()
