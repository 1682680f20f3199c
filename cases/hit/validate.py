"""Isotropic turbulence with linear forcing (F8): .venv/bin/python cases/hit/validate.py

A member that was begun goes on from its last checkpoint. Writes members.csv, series.csv, spectra.csv and hit.png.
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
RATE, BOX, DENSITY = 10.8, 0.23, 1000.0
TURNOVER = 1 / (2 * RATE)
# With the force of the velocity of the moment (Rosales & Meneveau), and of constant power (Carroll & Blanquart): K₀ of the former's mean.
# On half as many nodes ν is 2^(4/3) times as large, for the same k_max η.
MEMBERS = {
    "n64-linear": (64, 5e-4, {}),
    "n64-constant-power": (64, 5e-4, {"fluid.forcing.energy": 2.9}),
    "n32-linear": (32, 1.26e-3, {}),
}
# Turnover times that are not averaged, and blocks of the sampling error.
SETTLED, BLOCKS = 10, 6


def error(values):
    blocks = [b.mean() for b in np.array_split(values, BLOCKS)]
    return np.std(blocks, ddof=1) / np.sqrt(len(blocks))


def measure(folder, nodes):
    turbulence, spectrum = members.series(folder, "turbulence"), members.series(folder, "spectrum")
    end = turbulence.index[-1] / TURNOVER
    start = min(SETTLED, 0.5 * end) * TURNOVER
    late = turbulence[start:]
    # Steps differ in length: means over time.
    span = late.index[-1] - late.index[0]
    mean = {c: np.trapezoid(late[c], late.index) / span for c in late.columns}
    gain = (late.kinetic_energy.iloc[-1] - late.kinetic_energy.iloc[0]) / span
    first, second = late[: len(late) // 2], late[len(late) // 2 :]
    row = {"turnovers": end, "averaged_from": start / TURNOVER}
    for name in ("kinetic_energy", "dissipation", "power", "taylor_reynolds", "kolmogorov_length", "taylor_length", "large_eddy_length", "skewness"):
        row[name], row[name + "_error"] = mean[name], error(late[name])
    row["power_by_dissipation"] = mean["power"] / mean["dissipation"]
    row["budget"] = (mean["power"] - gain) / mean["dissipation"]
    row["halves_K"] = second.kinetic_energy.mean() / first.kinetic_energy.mean()
    row["k_max_eta"] = np.pi * nodes / BOX * mean["kolmogorov_length"]
    row["large_eddy_by_box"] = mean["large_eddy_length"] / BOX
    cost = members.summary(folder).get("fluid", {}).get("seconds_per_node_step")
    row["ns_per_node_step"] = cost and 1e9 * cost
    return turbulence, spectrum[start:].drop(columns="step").mean(), row


def figure(found, path):
    plot, (left, middle, right) = plt.subplots(1, 3, figsize=(15, 4.6))
    for k, (label, (turbulence, spectrum, row)) in enumerate(found.items()):
        t = turbulence.index / TURNOVER
        left.plot(t, turbulence.kinetic_energy, color=f"C{k}", label=f"{label}, K [m²/s²]")
        middle.plot(t, turbulence.dissipation, color=f"C{k}", label=f"{label}, ε")
        middle.plot(t, turbulence.power, ":", color=f"C{k}", label=f"{label}, power")
        k_eta = spectrum.index.astype(float) * row["kolmogorov_length"]
        scale = (row["dissipation"] * MEMBERS[label][1] ** 5) ** 0.25
        right.loglog(k_eta, spectrum / scale, "o-", ms=3, color=f"C{k}", label=f"{label}, Re$_λ$ = {row['taylor_reynolds']:.0f}")
    k_eta = np.geomspace(0.05, 1.5, 100)
    right.loglog(k_eta, 1.6 * k_eta ** (-5 / 3) * np.exp(-5.2 * ((k_eta**4 + 0.4**4) ** 0.25 - 0.4)), "k--", lw=1, label="Pope's model, C = 1.6, β = 5.2, c$_η$ = 0.4")
    right.set_ylim(1e-6, 1e3)
    for axis, x, y in [(left, "t/τ", "K"), (middle, "t/τ", "ε, power [m²/s³]"), (right, "kη", "E/(εν⁵)$^{1/4}$")]:
        axis.set_xlabel(x)
        axis.set_ylabel(y)
        axis.legend(fontsize=7)
    plot.tight_layout()
    plot.savefig(path, dpi=100)


def main():
    options = members.options(__doc__, "hit", MEMBERS, ["n32-linear"])
    found, missed = {}, []
    for label in options.members:
        nodes, viscosity, settings = MEMBERS[label]
        settings = {"mesh.cells": [nodes] * 3, "fluid.viscosity": DENSITY * viscosity} | settings
        folder = members.run(options, HERE / "case.toml", label, settings)
        if members.series(folder, "turbulence") is None:
            missed.append(f"{label}: not run")
            continue
        found[label] = turbulence, spectrum, row = measure(folder, nodes)
        for what, value, low, high in [
            ("mean power by mean dissipation", row["power_by_dissipation"], 0.98, 1.02),
            ("the same less what K gained", row["budget"], 0.98, 1.02),
            ("k_max η", row["k_max_eta"], 1.0, np.inf),
            ("turnover times", row["turnovers"], 2 * SETTLED, np.inf),
        ]:
            if not low <= value <= high:
                missed.append(f"{label}, {what}: {value:.4g}, wanted {low:.4g} to {high:.4g}")
    if found:
        table = pd.DataFrame({label: row for label, (_, _, row) in found.items()}).T
        table.index.name = "member"
        table.to_csv(options.out / "members.csv", float_format="%.6g")
        thinned = {label: turbulence[:: max(len(turbulence) // 400, 1)] for label, (turbulence, _, _) in found.items()}
        pd.concat(thinned, names=["member"]).to_csv(options.out / "series.csv", float_format="%.6g")
        spectra = pd.DataFrame({label: spectrum for label, (_, spectrum, _) in found.items()})
        spectra.index.name = "wave_number"
        spectra.to_csv(options.out / "spectra.csv", float_format="%.6g")
        print(table.T.to_string())
        figure(found, options.out / "hit.png")
    for line in missed:
        print("missed:", line)
    sys.exit(bool(missed))


main()
