"""Friction that holds a floc together in a flow (D2): .venv/bin/python cases/floc-dispersion/critical.py

    [--quick]          strain 0.5, coarse
    [--strain S]       default 300
    [--flows NAMES]    of uniaxial, planar, shear
    [--stiffness S …]  S^eff, default 0.05 0.5
    [--ratio R]        bisects μ to this factor, default 1.5
    [--recoil]         lets the floc of the first stiffness recoil after extension, in place of the bisection
    [--out DIR]        default runs/validate/floc-dispersion-critical

A floc holds if a quarter of its fibres are in its largest fragment at the strain (Switzer 2002, 4.3.2). Each run goes on from the largest fragment of the one
before (`fibreflow post extract-floc`), as fibres that have left go off exponentially in extension. Writes critical.csv and critical.png, or recoil.csv.
"""

import argparse
import csv
import pathlib
import shutil
import subprocess
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.ticker import NullFormatter

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts" / "bench"))
import harness  # noqa: E402

HERE = pathlib.Path(__file__).resolve().parent
# The same √(2E:E) in all (S 4.8–4.10).
FLOWS = {
    "uniaxial": '{ kind = "extension", rate = 0.5773502691896258 }',
    "planar": '{ kind = "planar-extension", rate = 0.5 }',
    "shear": '{ kind = "shear", rate = 1.0 }',
    "rest": '{ kind = "quiescent" }',
}
MODULUS = 32228875.9761 / 0.05
PIECE, SHARE = 5.0, 0.25
# Bisection goes no further down.
LEAST = 0.05


def floc(folder):
    """Fibres of a floc, and its length along x and width across [m]."""
    data = pd.read_csv(folder / "floc.csv")
    return data.fibre.nunique(), np.ptp(data.x), max(np.ptp(data.y), np.ptp(data.z))


def piece(flow, stiffness, friction, strain, folder):
    """Runs from the floc in `folder`, leaves its largest fragment there; elastic energy of the joints at the start and the end [J]."""
    settings = {
        "time.end": strain,
        "ambient.flow": FLOWS[flow],
        "fibres.0.youngs_modulus": MODULUS * stiffness,
        "contact.friction": friction,
        "output.observables.every": 100,
    }
    harness.fibreflow(folder / "case.toml", settings, out=folder / "run")
    subprocess.run([harness.PROGRAM, "post", "extract-floc", folder / "run", folder / "floc.csv"], check=True, stdout=subprocess.DEVNULL, env=harness.environment())
    energy = pd.read_csv(folder / "run" / "series" / "fibres.csv").elastic_energy
    return energy.iloc[0], energy.iloc[-1]


def begin(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("case.toml", "floc.csv"):
        shutil.copy(HERE / name, folder / name)
    return floc(folder)[0]


def holds(flow, stiffness, friction, strain, out):
    """The share of fibres in the largest fragment at the strain, or where it falls below a quarter, and that strain."""
    folder = out / "run"
    first, at = begin(folder), 0.0
    while at < strain:
        piece(flow, stiffness, friction, min(PIECE, strain - at), folder)
        at = min(at + PIECE, strain)
        share = floc(folder)[0] / first
        if share < SHARE:
            break
    print(f"{flow}, S^eff = {stiffness:g}, μ = {friction:.3g}: {share:.0%} at strain {at:g}", flush=True)
    return share >= SHARE, share, at


def critical(flow, stiffness, options):
    """Bracket of the critical μ, and all that was tried; S's largest is 20."""
    low, high, tried = 0.0, 20.0, []

    def test(friction):
        held, share, at = holds(flow, stiffness, friction, options.strain, options.out)
        tried.append(f"{friction:.3g}: {share:.2f} at {at:g}")
        return held

    if not test(high):
        return high, float("inf"), tried
    while low == 0.0 or high / low > options.ratio:
        middle = np.sqrt(low * high) if low > 0.0 else high / 4.0
        if middle < LEAST:
            break
        if test(middle):
            high = middle
        else:
            low = middle
    return low, high, tried


def recoil(options):
    """Stretched to a strain of 5 in uniaxial extension, then left alone."""
    folder, stiffness = options.out / "recoil", options.stiffness[0]
    begin(folder)
    rows = [["state", "fibres", "length_m", "width_m", "elastic_energy_J"]]

    def note(state, energy):
        rows.append([state, *floc(folder), energy])
        print(*rows[-1], flush=True)

    begun, energy = piece("uniaxial", stiffness, 20.0, 0.5 if options.quick else 5.0, folder)
    rows.append(["as it was", *floc(HERE), begun])
    note("stretched", energy)
    for k in range(1 if options.quick else 4):
        _, energy = piece("rest", stiffness, 20.0, 0.5 if options.quick else 5.0, folder)
        note(f"{5 * (k + 1)} s at rest", energy)
    with open(options.out / "recoil.csv", "w", newline="") as file:
        csv.writer(file).writerows(rows)


def figure(table, path):
    """Brackets of the critical μ; an arrow where the floc does not hold at the largest μ either."""
    plot, axis = plt.subplots(figsize=(5, 4))
    for k, (flow, rows) in enumerate(table.sort_values("s_eff").groupby("flow", sort=False)):
        shift, low, high = 1.06**k, rows.holds_not, rows.holds
        found = np.isfinite(high)
        middle = np.sqrt(low * high.where(found, low))
        error = [middle - low, high.where(found, 1.5 * low) - middle]
        axis.errorbar(shift * rows.s_eff, middle, error, lolims=~found, fmt="o-", capsize=3, color=f"C{k}", label=flow)
    axis.loglog()
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set_xlabel("S^eff")
    axis.set_ylabel("critical coefficient of friction")
    axis.legend()
    plot.tight_layout()
    plot.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--recoil", action="store_true")
    parser.add_argument("--strain", type=float, default=300.0)
    parser.add_argument("--ratio", type=float, default=1.5)
    parser.add_argument("--flows", nargs="*", choices=list(FLOWS)[:3], default=list(FLOWS)[:3])
    parser.add_argument("--stiffness", nargs="*", type=float, default=[0.05, 0.5])
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "validate" / "floc-dispersion-critical")
    options = parser.parse_args()
    if options.quick:
        options.strain, options.ratio, options.flows, options.stiffness = 0.5, 100.0, ["uniaxial"], [0.05]
    options.out.mkdir(parents=True, exist_ok=True)
    if options.recoil:
        recoil(options)
        return
    rows = [["flow", "s_eff", "strain", "holds_not", "holds", "tried"]]
    for flow in options.flows:
        for stiffness in options.stiffness:
            low, high, tried = critical(flow, stiffness, options)
            rows.append([flow, stiffness, options.strain, f"{low:.3g}", f"{high:.3g}", "; ".join(tried)])
            print(*rows[-1], flush=True)
            with open(options.out / "critical.csv", "w", newline="") as file:
                csv.writer(file).writerows(rows)
    figure(pd.read_csv(options.out / "critical.csv"), options.out / "critical.png")


if __name__ == "__main__":
    main()
