"""Rigid fibres in shear (C6, Kunhappan 2018, table 6.1): .venv/bin/python cases/shear-rheology/validate.py

    [--members NAME...]   of rp18-cv0.0075 rp18-cv0.015 rp18-cv0.035 rp32-cv0.0075 rp32-cv0.015 rp32-cv0.035; default all
    [--minutes M]         wall time of each run in this call, at most 100; 0 looks at what is there. Default 60
    [--periods P]         of Jeffery's orbit, at most. Default 30
    [--seeds N]           replicates, from other places and directions. Default 1
    [--quick]             rp18-cv0.0075 alone, ten minutes
    [--program PATH]      fibreflow; default target/release/fibreflow
    [--out DIR]           default runs/validate/shear-rheology

A run that was begun goes on from its last checkpoint. Writes members.csv, rheology.png and, of every member, the pdfs and means by period of the orbit; errors are
those of blocks of one run or, where there are more, of the seeds.
"""

import argparse
import pathlib
import subprocess
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import theory

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
DIAMETER, RATE, VISCOSITY = 1.2e-4, 300.0, 13.0
# K table 6.1: fibres; segments, so that the mesh is 3, 4, 3 of them times as many.
COUNTS = {(18, 0.0075): 112, (18, 0.015): 224, (18, 0.035): 520, (32, 0.0075): 352, (32, 0.015): 704, (32, 0.035): 1640}
SEGMENTS = {18: 6, 32: 10}
# K tables 6.3 and 6.2, C_b with Stover's beside it.
MOMENT = {(18, 0.0075): 0.0205, (18, 0.015): 0.0212, (18, 0.035): 0.0215, (32, 0.0075): 0.0118, (32, 0.015): 0.0125, (32, 0.035): 0.0120}
ORBIT = {18: (0.459, 0.450), 32: (0.413, 0.408)}
# Lines of a series before this many periods, or before half of what there is if that is less, are not averaged.
SETTLED, BLOCKS = 2.0, 5


def name(ratio, fraction):
    return f"rp{ratio}-cv{fraction}"


def settings(ratio, fraction, seed, periods):
    length, n = ratio * DIAMETER, SEGMENTS[ratio]
    size = [3 * length, 4 * length, 3 * length]
    wall = RATE * size[1] / 2
    return {
        "fibres.0.placement.count": COUNTS[ratio, fraction],
        "fibres.0.placement.seed": seed,
        "fibres.0.length": length,
        "fibres.0.segments": n,
        "mesh.size": size,
        "mesh.cells": [3 * n, 4 * n, 3 * n],
        "fluid.initial.velocity": [f"{RATE}*(y - {size[1] / 2})", "0", "0"],
        "fluid.boundaries.y_min.velocity": [-wall, 0.0, 0.0],
        "fluid.boundaries.y_max.velocity": [wall, 0.0, 0.0],
        "output.observables.wall_margin": 0.25 * length,
        "time.end": periods * theory.period(ratio, RATE),
    }


def toml(value):
    if isinstance(value, list):
        return "[" + ", ".join(f'"{v}"' if isinstance(v, str) else repr(float(v)) if isinstance(v, float) else repr(v) for v in value) + "]"
    return repr(float(value)) if isinstance(value, float) else repr(value)


def run(program, folder, member, seed, periods, minutes):
    command = [program, "run", HERE / "case.toml", "--out", folder]
    for key, value in {**settings(*member, seed, periods), "output.wall_time_limit": 60.0 * minutes}.items():
        command += ["--set", f"{key}={toml(value)}"]
    if any((folder / "checkpoint").glob("step_*/index.json")):
        command.append("--resume")
    subprocess.run(list(map(str, command)), cwd=ROOT, check=True, stdout=subprocess.DEVNULL)


def mean(series, start):
    """Mean after `start`, its standard error from blocks, and the length of what was averaged."""
    values = series[start:].dropna()
    blocks = [b.mean() for b in np.array_split(values, BLOCKS) if len(b)]
    return values.mean(), np.std(blocks, ddof=1) / np.sqrt(len(blocks)) if len(blocks) > 1 else np.nan


def read(folder, ratio):
    tables = {kind: pd.read_csv(folder / "series" / f"{kind}.csv").set_index("time") for kind in ("orientation", "stress")}
    for table in tables.values():
        table.index /= theory.period(ratio, RATE)
    return tables["orientation"], tables["stress"]


def measure(member, directions, stress):
    ratio, fraction = member
    end = directions.index[-1]
    start = min(SETTLED, 0.5 * end)
    (moment, moment_error), (orbit, orbit_error) = mean(directions.a_xxyy, start), mean(directions.orbit_mean, start)
    coefficient = {"batchelor": theory.batchelor(*member), "sf": theory.shaqfeh_fredrickson(*member), "local": theory.local(*member)}
    scale = VISCOSITY * RATE
    row = {
        "r_p": ratio, "c_v": fraction, "nL3": theory.crowding(*member), "periods": end, "averaged_from": start,
        "px2py2": moment, "px2py2_error": moment_error, "px2py2_K": MOMENT[member], "px2py2_koch": 0.371 / ratio,
        "C_b": orbit, "C_b_error": orbit_error, "C_b_K": ORBIT[ratio][0], "C_b_stover": ORBIT[ratio][1],
    }
    for column in ("mu_rel", "mu_rel_particle", "mu_rel_wall", "mu_rel_whole"):
        row[column], row[column + "_error"] = mean(stress[column], start)
    for theory_name, c in coefficient.items():
        row["mu_rel_" + theory_name] = theory.viscosity(c, moment)
    means = {m: mean(directions[m], start)[0] for m in ("a_xxxy", "a_xyyy", "a_xyzz")}
    row["N1"], row["N1_error"] = (v / scale for v in mean(stress.n1, start))
    row["N2"], row["N2_error"] = (v / scale for v in mean(stress.n2, start))
    row["N1_sf"], row["N2_sf"] = theory.normal_differences(coefficient["sf"], means)
    return row


def over_seeds(tables):
    """Mean of tables line by line, as far as the shortest goes."""
    lines = min(map(len, tables))
    return sum(table.iloc[:lines] for table in tables) / len(tables)


def by_period(tables):
    """Means over each period of the orbit, with standard errors over seeds."""
    means = pd.concat([table[["a_xxyy", "orbit_mean"]].groupby(np.ceil(table.index)).mean() for table in tables], keys=range(len(tables)))
    seeds = means.groupby(level=1)
    errors = seeds.std() / np.sqrt(seeds.count())
    columns = {"px2py2": seeds.mean().a_xxyy, "px2py2_error": errors.a_xxyy, "C_b": seeds.mean().orbit_mean, "C_b_error": errors.orbit_mean, "seeds": seeds.count().a_xxyy}
    return pd.DataFrame(columns).rename_axis("period")


def densities(directions, start):
    """Bin centres and mean densities of φ over [0, π) and of C_b."""
    late = directions[start:]
    result = []
    for kind, high in [("phase", np.pi), ("orbit", 1.0)]:
        columns = [c for c in late.columns if c.startswith(kind + "_") and c[len(kind) + 1 :].isdigit()]
        means = late[columns].mean().to_numpy()
        if kind == "orbit":
            means = means.reshape(-1, 3).mean(axis=1)
        width = high / len(means)
        result.append((width * (np.arange(len(means)) + 0.5), means))
    return result


def figure(found, path):
    plot, axes = plt.subplots(2, 3, figsize=(14, 8))
    for k, (member, (directions, stress, row)) in enumerate(found.items()):
        colour, label = f"C{k}", f"$r_p$ = {member[0]}, $c_v$ = {member[1]}"
        smooth = lambda series: series.rolling(max(len(series) // 40, 1), center=True, min_periods=1).mean()
        axes[0, 0].plot(smooth(directions.a_xxyy), color=colour, label=label)
        axes[0, 0].axhline(MOMENT[member], color=colour, ls=":", lw=1)
        axes[0, 1].plot(smooth(directions.orbit_mean), color=colour, label=label)
        axes[0, 1].axhline(ORBIT[member[0]][0], color="k", ls=":", lw=1)
        for column, style in [("mu_rel", "-"), ("mu_rel_particle", "--"), ("mu_rel_wall", "-.")]:
            axes[0, 2].plot(smooth(stress[column]) - 1, style, color=colour, lw=1)
        coefficient = theory.shaqfeh_fredrickson(*member)
        axes[0, 2].plot(coefficient * smooth(directions.a_xxyy), ":", color=colour, lw=1.5)
        (angle, phases), (orbit, orbits) = densities(directions, row["averaged_from"])
        axes[1, 0].plot(angle / np.pi, phases, "o-", ms=3, color=colour, lw=0.8)
        axes[1, 1].plot(orbit, orbits, "o-", ms=3, color=colour, lw=0.8)
        for offset, (name_, marker) in enumerate([("mu_rel", "o"), ("mu_rel_particle", "s"), ("mu_rel_wall", "^"), ("mu_rel_whole", "v")]):
            axes[1, 2].errorbar(row["nL3"] * (1 + 0.03 * offset), row[name_] - 1, row[name_ + "_error"], fmt=marker, color=colour, mfc="none")
        for name_, marker in [("mu_rel_sf", "_"), ("mu_rel_batchelor", "x"), ("mu_rel_local", "+")]:
            axes[1, 2].plot(row["nL3"], row[name_] - 1, marker, color="k", ms=9)
    for marker, what in [("o", "all"), ("s", "no contacts"), ("^", "walls"), ("v", "all, near walls too"), ("_", "K 6.3"), ("x", "K 6.2"), ("+", "local drag")]:
        axes[1, 2].plot([], [], marker, color="k", mfc="none", label=what)
    axes[1, 2].legend(fontsize=7)
    directions = np.random.default_rng(1).normal(size=(200000, 3))
    for ratio in sorted({m[0] for m in found}):
        orbit = np.hypot(directions[:, 1], directions[:, 0] / theory.cox(ratio)) / np.abs(directions[:, 2])
        random, edges = np.histogram(orbit / (1 + orbit), bins=40, range=(0, 1), density=True)
        axes[1, 1].plot(0.5 * (edges[1:] + edges[:-1]), random, "k-", lw=0.8, label=f"at random, $r_p$ = {ratio}")
        fine = np.linspace(0, np.pi, 2000)
        axes[1, 0].plot(fine / np.pi, theory.phase_density(ratio, fine), "k-", lw=0.8, label=f"Jeffery, K 6.9, $r_p$ = {ratio}")
    for axis, x, y in [
        (axes[0, 0], "t/τ", "⟨p$_x$²p$_y$²⟩ (dotted: K table 6.3)"),
        (axes[0, 1], "t/τ", "⟨C$_b$⟩ (dotted: K table 6.2)"),
        (axes[0, 2], "t/τ", "μ$_{rel}$ − 1 (dashed: no contacts, -·: walls, ···: K 6.3)"),
        (axes[1, 0], "φ/π from the gradient", "density"),
        (axes[1, 1], "C$_b$", "density"),
        (axes[1, 2], "nL³", "μ$_{rel}$ − 1"),
    ]:
        axis.set_xlabel(x)
        axis.set_ylabel(y)
    axes[0, 0].legend(fontsize=7)
    axes[0, 0].set_ylim(0, 0.04)
    # Walls that start have what they need to set the fluid in motion.
    axes[0, 2].set_ylim(0, 1.5 * max(row["mu_rel"] - 1 for *_, row in found.values()))
    axes[1, 0].set_yscale("log")
    axes[1, 0].legend(fontsize=7)
    axes[1, 1].legend(fontsize=7)
    axes[1, 2].set_xscale("log")
    axes[1, 2].set_xlim(2, 80)
    axes[1, 2].set_ylim(5e-3, 0.5)
    axes[1, 2].set_xticks([2, 5, 10, 20, 50], [2, 5, 10, 20, 50])
    axes[1, 2].minorticks_off()
    axes[1, 2].set_yscale("log")
    plot.tight_layout()
    plot.savefig(path, dpi=100)


def main():
    every = {name(*member): member for member in COUNTS}
    parser = argparse.ArgumentParser()
    parser.add_argument("--members", nargs="+", default=list(every), choices=list(every))
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--periods", type=float, default=30)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "target" / "release" / "fibreflow")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "validate" / "shear-rheology")
    options = parser.parse_args()
    if options.quick:
        options.members, options.minutes = options.members[:1], min(options.minutes, 10)
    options.out.mkdir(parents=True, exist_ok=True)
    found, missed = {}, []
    for label in options.members:
        member = every[label]
        folders = [options.out / (label if seed == 1 else f"{label}-seed{seed}") for seed in range(1, options.seeds + 1)]
        for seed, folder in enumerate(folders, 1):
            if options.minutes > 0:
                run(options.program, folder, member, seed, options.periods, min(options.minutes, 100))
        runs = [read(folder, member[0]) for folder in folders if (folder / "series" / "stress.csv").exists()]
        if not runs:
            missed.append(f"{label}: not run")
            continue
        directions, stress = (over_seeds(tables) for tables in zip(*runs))
        row = measure(member, directions, stress)
        if len(runs) > 1:
            rows = pd.DataFrame([measure(member, *own) for own in runs])
            row |= {column: rows[column.removesuffix("_error")].std() / np.sqrt(len(rows)) for column in row if column.endswith("_error")}
        row["seeds"] = len(runs)
        by_period([own for own, _ in runs]).to_csv(options.out / f"{label}-periods.csv", float_format="%.5g")
        found[member] = directions, stress, row
        (angle, phases), (orbit, orbits) = densities(directions, row["averaged_from"])
        pdfs = {"phi": angle, "phi_density": phases, "phi_jeffery": theory.phase_density(member[0], angle), "C_b": orbit, "C_b_density": orbits}
        pdfs = pd.concat([pd.Series(values, name=column) for column, values in pdfs.items()], axis=1)
        pdfs.to_csv(options.out / f"{label}-pdf.csv", index=False, float_format="%.5g")
        for what, value, wanted, allowed in [
            ("⟨p_x²p_y²⟩", row["px2py2"], row["px2py2_K"], 0.05),
            ("⟨C_b⟩", row["C_b"], row["C_b_K"], 0.05),
            ("μ_rel", row["mu_rel"], row["mu_rel_sf"], 0.1),
            ("μ_rel − 1", row["mu_rel"] - 1, row["mu_rel_sf"] - 1, 0.1),
            ("μ_rel − 1 at walls by that of all fibres", row["mu_rel_wall"] - 1, row["mu_rel_whole"] - 1, 0.05),
        ]:
            if not abs(value / wanted - 1) <= allowed:
                missed.append(f"{label}, {what}: {value:.5g}, wanted {wanted:.5g} within {100 * allowed:.0f} %")
    if found:
        table = pd.DataFrame([row for *_, row in found.values()])
        table.to_csv(options.out / "members.csv", index=False, float_format="%.7g")
        print(table.T.to_string())
        figure(found, options.out / "rheology.png")
    for line in missed:
        print("missed:", line)
    sys.exit(bool(missed))


main()
