"""Viscosity of suspensions of linked fibres (D3): .venv/bin/python cases/suspension-viscosity/validate.py

    [--quick]      short runs of straight and bent fibres: that everything works
    [--out DIR]    default runs/validate/suspension-viscosity
    [--jobs N]     runs at a time, default 1
    [--only NAMES] of rigid, rigid-long, concentration, helix, friction, yield; default: all
    [--tables]     no runs: from the tables in DIR/NAME.csv

Runs the sweeps beside this file (`fibreflow sweep`; goes on where it was stopped), compares with Switzer (2002, 5.3) and writes NAME.csv, summary.txt and
viscosity.png.
"""

import argparse
import pathlib
import shutil
import subprocess
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import matplotlib.ticker
import numpy as np
import pandas as pd

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts" / "bench"))
import harness  # noqa: E402

HERE = pathlib.Path(__file__).resolve().parent
NAMES = ["rigid", "rigid-long", "concentration", "helix", "friction", "yield"]
DIAMETER = 2e-5
# Aspect ratio of the fibres of each sweep.
ASPECT = {"concentration": 35, "rigid-long": 75, "yield": 75}
QUICK = """case = "case.toml"
[set]
"time.end" = 2.0
"fibres.0.placement.count" = 17
[[vary]]
name = "shape"
keys = ["fibres.0.shape", "fibres.0.segments"]
values = [[{ kind = "straight" }, 5], [{ kind = "chain", bend = 0.1, turn = 0.0 }, 4]]
labels = ["straight", "U"]
[results]
columns = ["structure.eta_sp", "structure.alignment"]
from = 1.0
"""


def sweep(file, out, jobs):
    """Runs a sweep and returns its table; members that fail are said, and left out of it."""
    run = subprocess.run([harness.PROGRAM, "sweep", file, "--out", out, "--jobs", str(jobs)], env=harness.environment())
    if run.returncode == 2:
        sys.exit(2)
    return out / "results.csv"


def volume_fraction(nl3, aspect):
    """Of cylinders, without their caps."""
    return nl3 * np.pi / (4 * aspect**2)


def dilute(aspect):
    """Of rods that do not touch, over orbits from directions at random: ⟨p_x²p_y²⟩, and what S 2.104 has beside it as they turn as spheroids of r_e = 0.7 r_p and slip
    across, (1 − B)⟨(p_x² + p_y²)/2 − 2p_x²p_y²⟩ (Jeffery 1922)."""
    ratio = 0.7 * aspect
    z, angle = np.meshgrid(np.linspace(-1, 1, 402)[1:-1], np.linspace(0, 2 * np.pi, 401)[:-1])
    x, y = np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle)
    # In the coordinates x, r_e y, z a direction moves on a circle in x, y by equal angles in equal times.
    radius, phase = np.hypot(x, ratio * y), np.arctan2(ratio * y, x)
    aligned, slip = 0.0, 0.0
    turns = 2000
    for turn in np.linspace(0, np.pi, turns, endpoint=False):
        a, b = radius * np.cos(phase + turn), radius * np.sin(phase + turn) / ratio
        length = a * a + b * b + z * z
        product = (a * b / length) ** 2
        aligned += product.mean() / turns
        slip += np.mean((a * a + b * b) / length / 2 - 2 * product) / turns
    return aligned, 2 / (ratio**2 + 1) * slip


def slender(nl3, aspect, alignment):
    """S 5.12 (its −1 is of η/η₀, not of η_sp)."""
    return nl3 * np.pi / (6 * np.log(2 * aspect)) * alignment


def column(table, name):
    return table[f"structure.{name}"], table[f"structure.{name}_error"].fillna(0.0)


class Report:
    def __init__(self):
        self.lines, self.missed = [], 0

    def say(self, text):
        print(text)
        self.lines.append(text)

    def check(self, text, met):
        self.missed += not met
        self.say(f"{'met   ' if met else 'MISSED'} {text}")


def rods(table, aspect, dilute_line, report):
    """Rigid rods beside the line of rods that do not touch, and what friction does to them."""
    at = table[table.runs > 0].set_index(["friction", "nL3"])
    for (friction, nl3), row in at.iterrows():
        eta, error = row["structure.eta_sp"], row["structure.eta_sp_error"]
        line, own = slender(nl3, aspect, dilute_line), slender(nl3, aspect, row["structure.alignment"])
        report.check(
            f"rigid, r_p = {aspect}, μ = {friction:g}, nL³ = {nl3:g}: η_sp = {eta:.4f} ± {error:.4f}, {eta / line - 1:+.1%} of the dilute line of S 2.104 (10 % asked), "
            f"{eta / own - 1:+.1%} of S 5.12 with the directions found; contacts' part {row['structure.contact_xy'] / eta:.0%}",
            abs(eta / line - 1) < 0.1,
        )


def concentration(tables, report, axes):
    aspect = ASPECT["concentration"]
    alignment, slip = dilute(aspect)
    report.say(f"dilute rods, r_p = {aspect}: ⟨p_x²p_y²⟩ = {alignment:.5f}; slip across adds {slip:.5f}, {slip / alignment:.0%}")
    styles = {"rigid": "o", "straight": "s", "U": "^", "helix": "D"}
    alone = [tables[name].assign(shape=name) for name in ("rigid", "helix") if name in tables]
    whole = pd.concat([tables[name] for name in ("concentration",) if name in tables] + alone)
    for (shape, friction), own in whole.groupby(["shape", "friction"], sort=False):
        own = own[own.runs > 0]
        eta, error = column(own, "eta_sp")
        colour = f"C{list(styles).index(shape)}"
        label = f"{shape}, μ = {friction:g}"
        axes.errorbar(own.nL3, eta, 2 * error, fmt=styles[shape] + "-", mfc=colour if friction else "none", color=colour, ms=4, lw=0.7, label=label)
    nl3 = np.linspace(4, 42, 50)
    axes.plot(nl3, slender(nl3, aspect, alignment), "k:", lw=1, label="S 5.12, dilute")
    axes.plot(nl3, slender(nl3, aspect, alignment + slip), "k--", lw=1, label="S 2.104, dilute")
    axes.set(xscale="log", yscale="log", xlabel="nL³", ylabel="η_sp", title=f"r_p = {aspect}, S^eff = 0.7")
    axes.legend(fontsize=6)
    at = whole[whole.runs > 0].set_index(["shape", "friction", "nL3"])
    rods(whole[whole["shape"] == "rigid"], aspect, alignment + slip, report)
    for shape, own in whole[whole.runs > 0].groupby("shape"):
        if shape != "rigid":
            # S 5.11 has the logarithm of the whole fibre in place of that of a segment.
            other = own["structure.particle_xy"] * np.log(2 * aspect / 5) / np.log(2 * aspect) + own["structure.contact_xy"]
            report.say(f"η_sp of {shape} with ln 2r_p of the fibre (S 5.11) at (nL³, μ): "
                       + ", ".join(f"({n:g}, {m:g}): {e:.4f}" for n, m, e in zip(own.nL3, own.friction, other)))
    for shape, friction, base in [("U", 0.0, ("rigid", 0.0)), ("U", 20.0, ("U", 0.0)), ("rigid", 20.0, ("rigid", 0.0)), ("straight", 20.0, ("straight", 0.0)),
                                  ("straight", 0.0, ("rigid", 0.0)), ("U", 0.0, ("straight", 0.0)), ("helix", 0.0, ("rigid", 0.0)), ("helix", 20.0, ("helix", 0.0))]:
        ratios = [f"{nl3:g}: {at.loc[(shape, friction, nl3), 'structure.eta_sp'] / at.loc[(*base, nl3), 'structure.eta_sp']:.2f}"
                  for nl3 in sorted(whole.nL3.unique()) if {(shape, friction, nl3), (*base, nl3)} <= set(at.index)]
        if ratios:
            report.say(f"η_sp of {shape}, μ = {friction:g} by that of {base[0]}, μ = {base[1]:g}, at nL³ = " + ", ".join(ratios))


def friction(table, report, axes):
    for nl3, own in table[table.runs > 0].groupby("nL3"):
        eta, error = column(own, "eta_sp")
        axes.errorbar(own.friction.clip(lower=0.2), eta, 2 * error, fmt="^-", ms=4, lw=0.7, label=f"nL³ = {nl3:g}")
        report.say(f"U, r_p = 75, nL³ = {nl3:g}, η_sp by μ: " + ", ".join(f"{m:g}: {e:.3f} ± {d:.3f}" for m, e, d in zip(own.friction, eta, error)))
    axes.set(xscale="log", xlabel="μ (0 drawn at 0.2)", ylabel="η_sp", title="U, r_p = 75, S^eff = 0.05")
    axes.legend(fontsize=6)


def fits(rate, stress):
    """Yield stress by Bingham (a straight line by least squares, as S has it: the same for the whole stress, of which the fluid's part goes with the rate), and of the
    fibres' part by Casson and Herschel–Bulkley to relative errors, with the exponent of the last."""
    bingham = np.polyfit(rate, stress, 1)[1]
    root = np.polyfit(np.sqrt(rate), np.sqrt(stress), 1, w=1 / np.sqrt(stress))[1]
    best = (np.inf, np.nan, np.nan)
    for power in np.linspace(0.3, 1.2, 91):
        matrix = np.stack([np.ones_like(rate), rate**power], axis=1) / stress[:, None]
        answer, *_ = np.linalg.lstsq(matrix, np.ones_like(rate), rcond=None)
        left = np.sum((matrix @ answer - 1) ** 2)
        if answer[0] >= 0 and left < best[0]:
            best = (left, answer[0], power)
    return bingham, root * abs(root), best[1], best[2]


def yield_stress(table, report, thinning, flow, scaling):
    aspect = ASPECT["yield"]
    rng = np.random.default_rng(1)
    fractions, found = [], []
    for nl3, own in table[table.runs > 0].groupby("nL3"):
        rate = 1 / own.stiffness.to_numpy()
        eta, error = (c.to_numpy() for c in column(own, "eta_sp"))
        normal, _ = column(own, "n1")
        thinning.errorbar(rate, eta, 2 * error, fmt="o-", ms=4, lw=0.7, label=f"nL³ = {nl3:g}")
        # S^eff μγ̇ L⁴ = EI: stresses by μγ̇ become stresses by EI/L⁴. Errors of few replicates scatter: their root mean square, relative, is that of all.
        stress = eta * rate
        if len(rate) < 3:
            report.say(f"U, r_p = 75, nL³ = {nl3:g}: η_sp at S^eff " + ", ".join(f"{1 / r:g}: {e:.3f} ± {d:.3f}" for r, e, d in zip(rate, eta, error)) + "; too few for a fit")
            continue
        drawn = fits(rate, stress)
        common = np.sqrt(np.mean((error / eta) ** 2))
        samples = np.array([fits(rate, stress * (1 + common * rng.normal(size=len(rate))))[0] for _ in range(300)])
        spread = samples.std()
        points = flow.errorbar(rate, stress, 2 * error * rate, fmt="o", ms=4, label=f"nL³ = {nl3:g}")
        line = np.polyfit(rate, stress, 1)
        flow.plot([0, rate.max()], np.polyval(line, [0, rate.max()]), lw=0.7, color=points[0].get_color())
        fraction = volume_fraction(nl3, aspect)
        fractions.append(fraction)
        found.append([drawn[0], spread, drawn[1]])
        report.say(
            f"U, r_p = 75, nL³ = {nl3:g}, Φ = {fraction:.5f}: σ₀L⁴/EI = {drawn[0]:.3f} ± {spread:.3f} (Bingham), {drawn[1]:.3f} (Casson), "
            f"{drawn[2]:.3f} (Herschel–Bulkley, n = {drawn[3]:.2f}); "
            f"N1/μγ̇ " + ", ".join(f"{s:g}: {n:.3f}" for s, n in zip(own.stiffness, normal))
        )
        falls = eta[np.argmin(rate)] > eta[np.argmax(rate)]
        report.check(f"shear thinning at nL³ = {nl3:g}: η_sp {eta[np.argmin(rate)]:.3f} → {eta[np.argmax(rate)]:.3f} from 1/S^eff = {rate.min():g} to {rate.max():g}", falls)
    fractions, found = np.array(fractions), np.array(found)
    good = found[:, 0] > found[:, 1]
    if good.sum() >= 2:
        scale = lambda values: np.polyfit(np.log(fractions[good]), np.log(values), 1)[0]
        power = scale(found[good, 0])
        samples = found[good, 0] * np.exp(rng.normal(size=(300, good.sum())) * found[good, 1] / found[good, 0])
        spread = np.std([scale(s) for s in samples])
        report.check(f"σ₀ ∝ Φ^({power:.2f} ± {spread:.2f}) by {good.sum()} concentrations (S: 2.75 ± 0.8)", abs(power - 2.75) < 0.8)
        scaling.plot(fractions, found[good, 0][-1] * (fractions / fractions[good][-1]) ** 2.75, "k--", lw=0.7, label="Φ^2.75")
    else:
        report.check("a yield stress beyond its error at two concentrations and more", False)
    scaling.errorbar(fractions, found[:, 0], 2 * found[:, 1], fmt="o", ms=4, label="Bingham")
    scaling.plot(fractions, found[:, 2], "x", label="Casson")
    thinning.set(xscale="log", yscale="log", xlabel="1/S^eff", ylabel="η_sp", title="U, r_p = 75, μ = 20")
    flow.set(xlabel="1/S^eff", ylabel="fibres' part of σ_xy L⁴/EI", title="the same; Bingham")
    scaling.set(xscale="log", yscale="log", xlabel="Φ", ylabel="σ₀ L⁴/EI")
    for axes in (thinning, flow, scaling):
        axes.legend(fontsize=6)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--tables", action="store_true")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", nargs="*", choices=NAMES, default=NAMES)
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "validate" / "suspension-viscosity")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    if options.quick:
        shutil.copy(HERE / "case.toml", options.out / "case.toml")
        (options.out / "quick.toml").write_text(QUICK)
        table = pd.read_csv(sweep(options.out / "quick.toml", options.out / "quick", options.jobs))
        print(table.to_string(index=False))
        complete = (table.runs == 1).all() and (table["structure.eta_sp"] > 0).all()
        sys.exit(not complete)
    tables = {}
    for name in options.only:
        if not options.tables:
            shutil.copy(sweep(HERE / f"{name}.toml", options.out / name, options.jobs), options.out / f"{name}.csv")
        if (options.out / f"{name}.csv").exists():
            tables[name] = pd.read_csv(options.out / f"{name}.csv")
    figure, axes = plt.subplots(2, 3, figsize=(13, 8))
    report = Report()
    if {"rigid", "concentration", "helix"} & set(tables):
        concentration(tables, report, axes[0, 0])
    if "rigid-long" in tables:
        aspect = ASPECT["rigid-long"]
        rods(tables["rigid-long"], aspect, sum(dilute(aspect)), report)
    if "friction" in tables:
        friction(tables["friction"], report, axes[0, 1])
    if "yield" in tables:
        yield_stress(tables["yield"], report, axes[0, 2], axes[1, 0], axes[1, 1])
    for panel in axes.flat:
        if not panel.has_data():
            panel.axis("off")
        for axis in (panel.xaxis, panel.yaxis):
            if axis.get_scale() == "log":
                axis.set_major_formatter("{x:g}")
                axis.set_minor_formatter(matplotlib.ticker.LogFormatter(labelOnlyBase=False, minor_thresholds=(1.2, 0.4)))
    figure.tight_layout()
    figure.savefig(options.out / "viscosity.png", dpi=110)
    (options.out / "summary.txt").write_text("\n".join(report.lines) + "\n")
    sys.exit(report.missed > 0)


if __name__ == "__main__":
    main()
