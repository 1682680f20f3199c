"""Errors of drag on towed segments by Reynolds number.

    cases/towed-segment/plot.py towed.csv[,more.csv] FIGURE    # prints the table of docs/validation.md
"""

import csv
import sys
from collections import defaultdict

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

NAMES = {
    ("gaussian", "true"): "Gaussian, undisturbed",
    ("gaussian", "false"): "Gaussian, as it is",
    ("element", "false"): "element",
}


def main(path, figure_path):
    rows = []
    for one in path.split(","):
        with open(one) as file:
            rows += list(csv.DictReader(file))
    groups = defaultdict(list)
    for r in rows:
        groups[r["walls"], NAMES[r["kernel"], r["corrected"]], float(r["reynolds"])].append(r)
    figure, axes = plt.subplots(1, 2, figsize=(8, 3.4), sharey=True)
    print("| where | coupling | Re_d | tows | worst error | mean excess | spread of the excess |")
    print("|---|---|---|---|---|---|---|")
    for axis, walls in zip(axes, ("false", "true")):
        for k, name in enumerate(NAMES.values()):
            numbers = sorted(n for w, c, n in groups if (w, c) == (walls, name))
            worst = []
            for number in numbers:
                group = groups[walls, name, number]
                errors = np.array([float(r["error"]) for r in group])
                excess = np.array([float(r["excess"]) for r in group])
                worst.append(errors.max())
                print(f"| {'wall' if walls == 'true' else 'bulk'} | {name} | {number:g} | {len(group)} | {100 * errors.max():.2f} % | {100 * excess.mean():+.2f} % | {100 * (excess.max() - excess.min()):.2f} % |")
                axis.plot(number * np.exp(0.25 * (k - 1) + np.linspace(-0.1, 0.1, len(errors))), 100 * errors, f"C{k}.", ms=3)
            if not numbers:
                continue
            axis.plot(numbers, 100 * np.array(worst), f"C{k}-", lw=0.8, label=name)
        axis.axhline(2 if walls == "false" else 5, color="k", lw=0.6, ls=":")
        axis.set(xscale="log", yscale="log", xlabel="$Re_d$", title="bulk" if walls == "false" else "one length from a wall")
    axes[0].set_ylabel("error of the drag [%]")
    axes[0].legend(frameon=False, fontsize=8)
    figure.tight_layout()
    figure.savefig(figure_path, dpi=150)


main(*sys.argv[1:3])
