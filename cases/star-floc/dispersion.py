"""Friction that holds the star floc together against its stiffness (D6, D2 in small): .venv/bin/python cases/star-floc/dispersion.py

    [--quick]          three stiffnesses in shear, coarse bisection
    [--flows NAMES]    of shear, uniaxial, planar; default all
    [--stiffness S …]  S^eff
    [--ratio R]        bisects μ to this factor, default 1.3
    [--effects NAMES]  in shear, also with kinetic friction (same, tenfold) or attraction (S 3.3.4, 3.3.5), by brackets of the same width
    [--out DIR]        default runs/validate/star-floc-dispersion

For each flow and S^eff bisects the coefficient of friction at which the five fibres are still in one floc at a strain of 100: critical.csv, critical.png,
and effects.csv.
"""

import argparse
import csv
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts" / "bench"))
import harness  # noqa: E402

HERE = pathlib.Path(__file__).resolve().parent
MODULUS = 9961472.0 / 0.04972116652911792
# The same √(2E:E) in all (S 4.8–4.10).
FLOWS = {
    "shear": '{ kind = "shear", rate = 1.0 }',
    "uniaxial": '{ kind = "extension", rate = 0.5773502691896258 }',
    "planar": '{ kind = "planar-extension", rate = 0.5 }',
}
# 9/150 of the repulsion, exp(−35 h²/b²) (S 3.3.5).
ATTRACTION = {"contact.repulsion.attraction": 9 / 150 * 2.2619467105846515e-06, "contact.repulsion.attraction_width": 1e-5 / np.sqrt(35)}
# Settings beside μ.
EFFECTS = {
    "none": lambda friction: {},
    "same": lambda friction: {"contact.sliding_friction": friction},
    "tenfold": lambda friction: {"contact.sliding_friction": 10 * friction},
    "attraction": lambda friction: ATTRACTION,
}
def holds(flow, effect, stiffness, friction, step, out):
    settings = EFFECTS[effect](friction) | {
        "ambient.flow": FLOWS[flow],
        "fibres.0.youngs_modulus": MODULUS * stiffness,
        "contact.friction": friction,
        "time.step": step,
    }
    try:
        harness.fibreflow(HERE / "dispersion.toml", settings, out=out)
    except harness.Refused as problem:
        print(flow, effect, stiffness, friction, problem)
        return False
    data = pd.read_csv(out / "series" / "structure.csv")
    # A contact may part for a moment.
    return bool(data.largest_floc[data.time > 95].max() > 0.99)


def critical(flow, stiffness, step, ratio, out):
    """Bracket of the critical μ."""
    low, high = 0.02, 200.0
    if not holds(flow, "none", stiffness, high, step, out):
        return high, float("inf")
    while high / low > ratio:
        middle = np.sqrt(low * high)
        if holds(flow, "none", stiffness, middle, step, out):
            high = middle
        else:
            low = middle
    return low, high


def moved(low, high, effect, stiffness, step, out):
    """The bracket with an effect in shear, by steps of its own width from that without."""
    factor = high / low
    while low > 0.01 and holds("shear", effect, stiffness, low, step, out):
        low, high = low / factor, low
    while high < 1e3 and not holds("shear", effect, stiffness, high, step, out):
        low, high = high, high * factor
    return low, high


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--step", type=float, default=1e-2)
    parser.add_argument("--flows", nargs="*", choices=FLOWS, default=list(FLOWS))
    parser.add_argument("--stiffness", nargs="*", type=float, default=[0.02, 0.05, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0])
    parser.add_argument("--ratio", type=float, default=1.3)
    parser.add_argument("--effects", nargs="*", choices=list(EFFECTS)[1:], default=[])
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "validate" / "star-floc-dispersion")
    options = parser.parse_args()
    if options.quick:
        options.flows, options.stiffness, options.ratio = ["shear"], [0.05, 1.0, 100.0], 2.0
    options.out.mkdir(parents=True, exist_ok=True)
    rows, tests = [], []
    for flow in options.flows:
        own = []
        for stiffness in options.stiffness:
            low, high = critical(flow, stiffness, options.step, options.ratio, options.out / "run")
            own.append(np.sqrt(low * high))
            rows.append([flow, stiffness, f"{low:.3f}", f"{high:.3f}"])
            print(*rows[-1], flush=True)
            with open(options.out / "critical.csv", "w", newline="") as file:
                csv.writer(file).writerows([["flow", "s_eff", "breaks", "holds"], *rows])
            for effect in options.effects if flow == "shear" and np.isfinite(high) else []:
                found = moved(low, high, effect, stiffness, options.step, options.out / "run")
                tests.append([effect, stiffness, *(f"{friction:.3f}" for friction in found)])
                print(*tests[-1], flush=True)
                with open(options.out / "effects.csv", "w", newline="") as file:
                    csv.writer(file).writerows([["effect", "s_eff", "breaks", "holds"], *tests])
        spread = np.sqrt(options.ratio)
        error = [np.multiply(own, 1 - 1 / spread), np.multiply(own, spread - 1)]
        plt.errorbar(options.stiffness, own, yerr=error, fmt="o-", capsize=2, label=flow)
    plt.loglog()
    plt.xlabel("S^eff")
    plt.ylabel("critical coefficient of friction")
    plt.legend()
    plt.savefig(options.out / "critical.png", dpi=120)


if __name__ == "__main__":
    main()
