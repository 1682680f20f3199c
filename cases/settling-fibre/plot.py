"""Depth of the settling fibre against the law in the flow of its periodic images.

    cases/settling-fibre/plot.py RUN    # RUN/pictures/settling.png, prints both velocities
"""

import math
import sys
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

LENGTH, DIAMETER, EDGE, WEIGHT_BY_VOLUME = 4.0, 0.2, 12.0, 0.5


def images(points, force, width):
    """Mean velocity at the points from all images but the fibre itself, as the kernel sees it: Σ over waves − free space."""
    n = np.arange(-14, 15)
    k = 2 * math.pi / EDGE * np.stack(np.meshgrid(n, n, n, indexing="ij"), -1).reshape(-1, 3)
    k = k[(k**2).sum(1) > 0]
    square = (k**2).sum(1)
    phases = np.exp(1j * k @ points.T)
    shape = np.abs(phases.mean(1)) ** 2
    across = 1 - k[:, 1] ** 2 / square
    periodic = (np.exp(-(width**2) * square) * across / square * shape).sum() * force / EDGE**3
    s, free = math.sqrt(2) * width, 0.0
    for p in points:
        rho = np.linalg.norm(points - p, axis=1) / s
        for x in rho:
            if x < 1e-6:
                free += math.sqrt(2 / math.pi) * 4 / 3
            else:
                e = math.sqrt(2 / math.pi) * math.exp(-x * x / 2)
                f = math.erf(x / math.sqrt(2))
                free += f / x + f / x**3 - e / x**2
    return periodic - free * force / (8 * math.pi * s) / len(points) ** 2


def main(run):
    run = Path(run)
    time, height = np.loadtxt(run / "series" / "fibre_0.csv", delimiter=",", skiprows=1, usecols=(1, 3)).T
    weight = WEIGHT_BY_VOLUME * math.pi / 4 * DIAMETER**2 * LENGTH
    drag = 4 * math.pi / (math.log(2 * LENGTH / DIAMETER) + math.log(2) - 0.5)
    along = (np.arange(16) // 2 + np.where(np.arange(16) % 2, 0.7887, 0.2113)) / 8 - 0.5
    points = np.stack([LENGTH * along, 0 * along, 0 * along], 1)
    alone = weight / (drag * LENGTH)
    law = alone + images(points, weight, 1.0)
    found = -(height[-1] - height[1]) / (time[-1] - time[1])
    print(f"law {alone:.6f} m/s, in the flow of the images {law:.6f}, found {found:.6f}: {100 * (found / law - 1):+.2f} %")
    figure, axis = plt.subplots(figsize=(5, 3.4))
    axis.plot(time, height, "o", label="two-way")
    axis.plot(time, height[1] - law * (time - time[1]), "k-", lw=0.8, label="law and images")
    axis.plot(time, height[1] - alone * (time - time[1]), "k:", lw=0.8, label="law alone")
    axis.set(xlabel="time [s]", ylabel="height of the middle [m]")
    axis.legend(frameon=False)
    figure.tight_layout()
    (run / "pictures").mkdir(exist_ok=True)
    figure.savefig(run / "pictures" / "settling.png", dpi=150)


main(sys.argv[1])
