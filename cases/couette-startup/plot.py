"""Profiles beside the exact ones: python cases/couette-startup/plot.py [RUN]"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "plot"))

import lines
import matplotlib
import numpy as np
import pyvista as pv
import run_data

matplotlib.use("Agg")
import matplotlib.pyplot as plt

VISCOSITY = 0.1


def exact(time, y):
    n = np.arange(1, 400)[:, None]
    terms = 2 * (-1.0) ** n / (n * np.pi) * np.exp(-VISCOSITY * (n * np.pi) ** 2 * time) * np.sin(n * np.pi * y)
    return y + terms.sum(axis=0)


run = run_data.folder("couette-startup")
times = pv.get_reader(str(run / "fluid.pvd")).time_values
fine = np.linspace(0, 1, 201)
figure, axis = plt.subplots(figsize=(5, 6))
for k in range(1, len(times)):
    y, velocity, _ = lines.along(lines.fluid(run, k), 1, (0.0, 0.0, 0.0))
    off = np.abs(velocity[:, 0] - exact(times[k], y)).max()
    print(f"t = {times[k]:.2f} s: largest deviation {off:.1e} of the speed of the plate")
    if k in (1, 2, 4, 10):
        axis.plot(exact(times[k], fine), fine, "k-", label="exact" if k == 1 else None)
        axis.plot(velocity[:, 0], y, "o", ms=4, mfc="none", label=f"t = {times[k]:.1f} s")
axis.set_xlabel("u [m/s]")
axis.set_ylabel("y [m]")
axis.legend()
figure.savefig(run_data.picture(run, "profiles.png"), dpi=150)
