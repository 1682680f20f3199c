"""Decaying isotropic turbulence on 32³ with and without eddy viscosities, beside 64³ without: .venv/bin/python cases/decaying/validate.py

A member that was begun goes on from its last checkpoint. Writes members.csv, energy.csv, spectra.csv and decaying.png.
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
# Nodes in a direction, model.
MEMBERS = {"n64-none": (64, None), "n32-none": (32, None)} | {f"n32-{m}": (32, m) for m in ("smagorinsky", "wale", "sigma")}
# Whole shells of the coarse mesh; the shortest waves among them.
RESOLVED, SHORT = 15, 10
TIMES = (1.0, 2.0, 4.0)


def band(spectrum, low=1, high=RESOLVED):
    """Energy between two wave numbers; shells are 1/m wide."""
    k = spectrum.columns.astype(float)
    return spectrum.loc[:, (k > low - 0.5) & (k < high + 0.5)].sum(axis=1)


def measure(folder, nodes, reference):
    turbulence, spectrum = members.series(folder, "turbulence"), members.series(folder, "spectrum").drop(columns="step")
    row = {"t_end": turbulence.index[-1]}
    for t in TIMES:
        if t > row["t_end"] or t not in reference.index:
            continue
        row[f"K_by_resolved_K_{t:g}"] = band(spectrum)[t] / band(reference)[t]
        row[f"short_by_reference_{t:g}"] = band(spectrum, SHORT)[t] / band(reference, SHORT)[t]
    total = turbulence.dissipation + turbulence.eddy_dissipation
    row["eddy_share_of_dissipation"] = np.trapezoid(turbulence.eddy_dissipation, turbulence.index) / np.trapezoid(total, turbulence.index)
    row["k_max_eta_least"] = 0.5 * nodes * turbulence.kolmogorov_length.min()
    cost = members.summary(folder).get("fluid", {}).get("seconds_per_node_step")
    row["ns_per_node_step"] = cost and 1e9 * cost
    return turbulence, spectrum, row


def figure(found, path):
    plot, panels = plt.subplots(1, 3, figsize=(15, 4.6))
    for k, (label, (turbulence, spectrum, _)) in enumerate(found.items()):
        style = {"color": "k" if label == "n64-none" else f"C{k}", "label": label}
        energy = band(spectrum)
        panels[0].plot(energy.index, energy, **style)
        total = turbulence.dissipation + turbulence.eddy_dissipation
        panels[1].plot(turbulence.index, total, **style)
        for t in (1.0, 4.0):
            if t in spectrum.index:
                panels[2].loglog(spectrum.columns.astype(float), spectrum.loc[t], **style)
                style["label"] = None
    panels[0].set_yscale("log")
    panels[2].set_ylim(1e-8, 1)
    panels[2].set_xlim(1, 32)
    for axis, x, y in zip(panels, ["t", "t", "k"], [f"K of k ≤ {RESOLVED}", "dissipation, viscous and of the model", "E at t = 1 and 4"]):
        axis.set_xlabel(x)
        axis.set_ylabel(y)
    panels[0].legend(fontsize=7)
    plot.tight_layout()
    plot.savefig(path, dpi=100)


def main():
    options = members.options(__doc__, "decaying", MEMBERS, list(MEMBERS))
    found, missed, folders = {}, [], {}
    for label in options.members:
        n, model = MEMBERS[label]
        settings = {"mesh.cells": [n, n, n]}
        settings |= {"fluid.turbulence.model": model} if model else {}
        folders[label] = members.run(options, HERE / "case.toml", label, settings)
    reference = members.series(options.out / "runs" / "n64-none", "spectrum")
    for label, folder in folders.items():
        if reference is None or members.series(folder, "turbulence") is None:
            missed.append(f"{label}: not run, or its reference is not")
            continue
        found[label] = measure(folder, MEMBERS[label][0], reference.drop(columns="step"))
    if found:
        table = pd.DataFrame({label: row for label, (_, _, row) in found.items()}).T
        table.index.name = "member"
        table.to_csv(options.out / "members.csv", float_format="%.6g")
        energies = pd.concat({label: t.drop(columns="step") for label, (t, _, _) in found.items()}, names=["member"])
        energies.to_csv(options.out / "energy.csv", float_format="%.6g")
        spectra = pd.concat({label: s for label, (_, s, _) in found.items()}, names=["member"])
        spectra.to_csv(options.out / "spectra.csv", float_format="%.5g")
        print(table.T.to_string())
        figure(found, options.out / "decaying.png")
        # With a model both the energy and its short waves are nearer to the fine mesh than without.
        plain = found.get("n32-none")
        for label, (_, _, row) in found.items():
            if plain is None or MEMBERS[label][1] is None:
                continue
            for t in TIMES:
                key = f"short_by_reference_{t:g}"
                if not abs(np.log(row.get(key, np.nan))) < abs(np.log(plain[2].get(key, np.nan))):
                    missed.append(f"{label}: short waves at t = {t:g} by those of 64³ {row.get(key):.3g}, without a model {plain[2].get(key):.3g}")
    for line in missed:
        print("missed:", line)
    sys.exit(bool(missed))


main()
