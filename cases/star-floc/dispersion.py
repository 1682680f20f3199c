"""Friction that holds the star floc together against its stiffness (D6, D2 in small): .venv/bin/python cases/star-floc/dispersion.py

    [--quick]     three stiffnesses in shear, coarse bisection
    [--out DIR]   default runs/validate/star-floc-dispersion

For each flow and S^eff bisects the coefficient of friction at which the five fibres are still in one floc at a strain of 100: critical.csv, critical.png.
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


def holds(flow, stiffness, friction, step, out):
    settings = {
        "ambient.flow": FLOWS[flow],
        "fibres.0.youngs_modulus": MODULUS * stiffness,
        "contact.friction": friction,
        "time.step": step,
    }
    try:
        harness.fibreflow(HERE / "dispersion.toml", settings, out=out)
    except harness.Refused as problem:
        print(flow, stiffness, friction, problem)
        return False
    data = pd.read_csv(out / "series" / "structure.csv")
    # A contact may part for a moment.
    return bool(data.largest_floc[data.time > 95].max() > 0.99)


def critical(flow, stiffness, step, ratio, out):
    low, high = 0.02, 200.0
    if not holds(flow, stiffness, high, step, out):
        return float("inf")
    while high / low > ratio:
        middle = np.sqrt(low * high)
        if holds(flow, stiffness, middle, step, out):
            high = middle
        else:
            low = middle
    return np.sqrt(low * high)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--step", type=float, default=1e-2)
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "validate" / "star-floc-dispersion")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    flows = ["shear"] if options.quick else list(FLOWS)
    stiffnesses = [0.05, 1.0, 100.0] if options.quick else [0.02, 0.05, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0]
    rows = []
    for flow in flows:
        for stiffness in stiffnesses:
            found = critical(flow, stiffness, options.step, 2.0 if options.quick else 1.3, options.out / "run")
            rows.append([flow, stiffness, f"{found:.3f}"])
            print(*rows[-1], flush=True)
        own = [(s, float(c)) for f, s, c in rows if f == flow]
        plt.loglog(*zip(*own), "o-", label=flow)
    plt.xlabel("S^eff")
    plt.ylabel("critical coefficient of friction")
    plt.legend()
    plt.savefig(options.out / "critical.png", dpi=120)
    with open(options.out / "critical.csv", "w", newline="") as file:
        csv.writer(file).writerows([["flow", "s_eff", "critical_friction"], *rows])


if __name__ == "__main__":
    main()
