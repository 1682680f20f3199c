"""Figure of the sweep effects.toml: .venv/bin/python cases/flocculation/effects.py SWEEP-FOLDER [--out FILE.png]

Contacts a fibre (of both fibres), the share of the fibres in the largest floc, and g(r < 0.1 L), which is 1 where fibres know nothing of each other; averages
from a strain of 60 on with errors from blocks. Prints the table.
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


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sweep", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("effects.png"))
    options = parser.parse_args()
    found = pd.read_csv(options.sweep / "results.csv")
    found.columns = [name.removeprefix("structure.") for name in found.columns]
    found["near"], found["near_error"] = near(found)
    columns = [("contacts_per_fibre", "contacts a fibre"), ("largest_floc", "largest floc"), ("near", "g(r < 0.1 L)"), ("eta_sp", "η_sp")]
    print(found[["member", *(c for name, _ in columns for c in (name, name + "_error"))]].round(3).to_string(index=False))
    figure, axes = plt.subplots(1, len(columns), figsize=(15, 5), sharey=True)
    places = np.arange(len(found))
    for axis, (name, label) in zip(axes, columns):
        colours = np.where(found.member.str.contains("helix"), "C1", "C0")
        axis.barh(places, found[name], xerr=found[name + "_error"], color=colours, capsize=2)
        axis.set_xlabel(label)
    axes[2].axvline(1.0, color="k", lw=0.8, ls=":")
    axes[0].set_yticks(places, found.member, fontsize=8)
    axes[0].invert_yaxis()
    figure.tight_layout()
    figure.savefig(options.out, dpi=100)


if __name__ == "__main__":
    main()
