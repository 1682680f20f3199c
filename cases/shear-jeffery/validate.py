"""Orbits of rigid fibres over aspect ratios, segments and laws (C2, one-way): .venv/bin/python cases/shear-jeffery/validate.py

    [--quick]     aspect ratios 10 and 50, up to 16 segments
    [--out DIR]   default runs/validate/shear-jeffery

Runs `cargo run --release -p fibreflow-fibre --example orbits`. Writes periods.csv, torques.csv, orbits.png.
"""

import argparse
import csv
import io
import os
import pathlib
import subprocess
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

ROOT = pathlib.Path(__file__).resolve().parents[2]
# ln 2 - 1/2 across; C_r, and the C_s that is Jeffery's at an aspect ratio of 50.
NORMAL, SPIN = np.log(2) - 0.5, 0.35


def orbits(*arguments):
    command = ["cargo", "run", "--release", "-q", "-p", "fibreflow-fibre", "--example", "orbits", "--", *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, env=os.environ, check=True, capture_output=True, text=True).stdout


def cox(ratio):
    return 1.24 * ratio / np.sqrt(np.log(ratio))


def drag_moment(ratio):
    """A = ζ⊥L²/(12 μ d²) of local drag."""
    return 4 * np.pi / (np.log(2 * ratio) + NORMAL) * ratio**2 / 12


def one_constant(ratio, calibrated=50.0):
    """Period by Jeffery's of a rigid fibre whose C_s is that of an aspect ratio of 50: the balance of drag moment, spin and strain."""
    r2 = cox(calibrated) ** 2
    strain = (2 * drag_moment(calibrated) + SPIN * (1 - r2)) / (1 + r2)
    aligned = 0.5 * (SPIN + strain) / (drag_moment(ratio) + SPIN)
    r = np.sqrt(1 / aligned - 1)
    return (r + 1 / r) / (cox(ratio) + 1 / cox(ratio))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "validate" / "shear-jeffery")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    ratios = [10, 50] if options.quick else [10, 20, 50, 100, 200]
    segments = [4, 8, 16] if options.quick else [4, 8, 16, 32, 64]
    missed = []

    jobs = [(r, n, "split", "rigid") for r in ratios for n in segments]
    jobs += [(r, 8, model, "rigid") for r in ratios for model in ("batchelor", "ends", "k-torque")]
    jobs += [(r, n, "split", "flexible") for r in ratios[:3] for n in (4, 16)]
    jobs += [(r, n, model, "rigid") for model in ("cox", "bretherton") for r in ratios for n in segments]
    rows = []
    for ratio, n, model, kind in jobs:
        line = orbits("table", ratio, n, model, kind).strip().split(",")
        print(",".join(line), flush=True)
        rows.append([model, ratio, n, kind, float(line[4]), float(line[5]), float(line[6])])
    for ratio in ratios:
        rows.append(["one constant", ratio, "", "exact", "", round(one_constant(ratio), 6), ""])
    names = ["model", "r_p", "segments", "kinematics", "orbits", "period_over_jeffery", "orbit_constant_drift"]
    with open(options.out / "periods.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(rows)
    for model, ratio, n, kind, _, period, _ in rows:
        if model in ("split", "batchelor", "ends") and abs(period - 1) > 0.02:
            missed.append(f"period of {model}, r_p {ratio}, {n} segments, {kind}: {period}")
    for ratio in ratios:
        found = [row[5] for row in rows if row[0] == "split" and row[1] == ratio and row[3] == "rigid"]
        if max(found) / min(found) > 1.01:
            missed.append(f"period at r_p {ratio} depends on the segments: {found}")

    torques = []
    for ratio in ratios:
        for model, n in [("split", 4), ("split", 64), ("batchelor", 8)] + [("cox", k) for k in segments]:
            table = pd.read_csv(io.StringIO(orbits("torque", ratio, n, model)))
            r = cox(ratio)
            flow = np.radians(table.angle)
            # By the value across the flow; that value by Batchelor's and by Jeffery's, of the spheroid of Cox's aspect ratio.
            jeffery = (r**2 * np.sin(flow) ** 2 + np.cos(flow) ** 2) / r**2
            normal = np.log(2 * ratio) + np.log(2)
            batchelor = np.pi / 3 / (normal - 11 / 6)
            e = np.sqrt(1 - 1 / r**2)
            spheroid = np.pi * 4 / 3 * e**3 * (2 - e**2) / (-2 * e + (1 + e**2) * np.log((1 + e) / (1 - e))) * r**2 / (r**2 + 1)
            across = table.torque.iloc[-1]
            deviation = np.max(np.abs(table.torque / across - jeffery))
            torques.append([model, ratio, n, deviation, across / batchelor, across / spheroid])
            if model == "split":
                # At rest the law's own torque over the thickness is a part, of order (d/L)².
                if deviation > 0.02 or abs(across / batchelor - 1) > 0.02:
                    missed.append(f"torque of {model}, r_p {ratio}, {n} segments")
    torques = pd.DataFrame(torques, columns=["model", "r_p", "segments", "largest_deviation_of_ten_angles", "torque_90_over_batchelor",
                                             "torque_90_over_spheroid_of_cox"])
    torques.to_csv(options.out / "torques.csv", index=False, float_format="%.5f")
    print(torques.to_string(index=False))

    figure, axes = plt.subplots(2, 2, figsize=(11, 7))
    shown = 50
    trace = pd.read_csv(io.StringIO(orbits("trace", shown, 8, "split")))
    period = 2 * np.pi * (cox(shown) + 1 / cox(shown))
    for axis, name, label in [(axes[0, 0], "phi", "φ / π"), (axes[0, 1], "theta", "θ / π")]:
        for suffix, style, who in [("", "-", "fibreflow, split, 8 segments"), ("_jeffery", "k--", "Jeffery, $r_e$ of Cox")]:
            value = trace[name + suffix] / np.pi
            if name == "phi":
                value = np.unwrap(value, period=2)
            axis.plot(trace.strain / period, value, style, lw=1, label=who)
        axis.set_xlabel("orbits")
        axis.set_ylabel(label)
    axes[0, 0].legend(fontsize=8)
    axes[0, 0].set_title(f"$r_p$ = {shown}, ten orbits", fontsize=9)
    table = pd.DataFrame(rows, columns=names)
    for ratio in ratios:
        for model, style in [("split", "o-"), ("cox", "s--")]:
            part = table[(table.model == model) & (table.r_p == ratio) & (table.kinematics == "rigid")]
            # A spheroid of a segment shorter than √e diameters has no meaning.
            part = part[(model == "split") | (ratio / part.segments.astype(float) > np.exp(0.5))]
            axes[1, 0].semilogx(part.segments, part.period_over_jeffery, style, color=f"C{ratios.index(ratio)}",
                                mfc="none", label=f"{model}, $r_p$ = {ratio}")
    axes[1, 0].set_xlabel("segments")
    axes[1, 0].set_ylabel("period by Jeffery's")
    axes[1, 0].set_xticks(segments, segments)
    axes[1, 0].minorticks_off()
    axes[1, 0].legend(fontsize=6, ncol=2)
    for model, n, style in [("split", 64, "o"), ("cox", 4, "s"), ("cox", 16, "x")]:
        part = pd.read_csv(io.StringIO(orbits("torque", shown, n, model)))
        scale = np.pi / 3 / (np.log(2 * shown) + np.log(2) - 11 / 6)
        axes[1, 1].plot(part.angle, part.torque / scale, style, mfc="none", label=f"{model}, {n} segments")
    angle = np.linspace(0, np.pi / 2)
    axes[1, 1].plot(np.degrees(angle), np.sin(angle) ** 2 + np.cos(angle) ** 2 / cox(shown) ** 2, "k-", lw=1, label="Jeffery by angle, Batchelor at 90°")
    axes[1, 1].set_xlabel("angle to the flow [°]")
    axes[1, 1].set_ylabel("torque by Batchelor's")
    axes[1, 1].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(options.out / "orbits.png", dpi=110)
    for line in missed:
        print("missed:", line)
    sys.exit(bool(missed))


main()
