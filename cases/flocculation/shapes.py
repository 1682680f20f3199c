"""Figure of the sweep shapes.toml: .venv/bin/python cases/flocculation/shapes.py SWEEP-FOLDER [--out FILE.png]

Contacts a fibre (of both fibres), the share of the fibres in the largest floc and g(r < 0.1 L) against the curvature b/R_U of S 3.9, and the map of S Fig. 3.7(a):
filled where more than a quarter of the fibres are in one floc. Averages from a strain of 60 on with errors from blocks. Prints the table.
"""

import argparse
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from validate import near  # noqa: E402

# Half a segment by the radius of a fibre: r_p = 75, five segments.
HALF_SEGMENT = 15.0
FLOC = 0.25


def curvature(bend):
    """b/R_U (S 3.9)."""
    half = 0.5 * np.asarray(bend, float)
    return 2 * np.sin(half) / (1 + np.cos(half)) / HALF_SEGMENT


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sweep", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("shapes.png"))
    options = parser.parse_args()
    found = pd.read_csv(options.sweep / "results.csv")
    found = found[found.runs > 0].rename(columns=lambda name: name.removeprefix("structure."))
    found["near"], found["near_error"] = near(found)
    found["curvature"] = curvature(found.bend)
    columns = [("contacts_per_fibre", "contacts a fibre"), ("largest_floc", "largest floc"), ("near", "g(r < 0.1 L)")]
    print(found[["nL3", "bend", "curvature", *(c for name, _ in columns for c in (name, name + "_error"))]].round(4).to_string(index=False))
    figure, axes = plt.subplots(1, 4, figsize=(15, 4))
    for nl3, own in found.groupby("nL3"):
        for axis, (name, label) in zip(axes, columns):
            axis.errorbar(own.curvature, own[name], own[name + "_error"], fmt="o-", ms=4, capsize=2, label=f"nL³ = {nl3:g}")
            axis.set_ylabel(label)
    floc = found.largest_floc > FLOC
    axes[3].plot(found.curvature[floc], found.nL3[floc], "ko", label="one floc of a quarter and more")
    axes[3].plot(found.curvature[~floc], found.nL3[~floc], "ko", mfc="none", label="homogeneous")
    axes[3].set_ylabel("nL³")
    axes[3].set_ylim(0, 1.4 * found.nL3.max())
    for axis in axes:
        axis.set_xlabel("b/R_U")
        axis.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(options.out, dpi=100)


if __name__ == "__main__":
    main()
