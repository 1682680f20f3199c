"""Velocity on lines through the force beside the sum over Fourier modes: python cases/stokes-point-force/plot.py [RUN]"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "plot"))

import lines
import matplotlib
import numpy as np
import run_data

matplotlib.use("Agg")
import matplotlib.pyplot as plt

VISCOSITY, WIDTH, CENTRE = 1.0, 0.125, 0.5


def modes():
    """Wave vectors of the box (n, 3) without zero, and the transform of the Gaussian at each."""
    reach = int(np.ceil(6 / (2 * np.pi * WIDTH)))
    n = np.arange(-reach, reach + 1)
    k = 2 * np.pi * np.stack(np.meshgrid(n, n, n, indexing="ij"), axis=-1).reshape(-1, 3)
    k = k[(k != 0).any(axis=1)]
    return k, np.exp(-0.5 * (k**2).sum(axis=1) * WIDTH**2)


def exact(points):
    """u_x = Σ ĝ (1 − k_x²/k²)/(μ k²) cos k·r of a unit force along x (Hasimoto 1959, smeared)."""
    k, kernel = modes()
    square = (k**2).sum(axis=1)
    weight = kernel * (1 - k[:, 0] ** 2 / square) / (VISCOSITY * square)
    return np.cos((points - CENTRE) @ k.T) @ weight


def mobility():
    """μ U/F with U averaged by the Gaussian: Σ ⅔ ĝ²/k²."""
    k, kernel = modes()
    return (2 / 3 * kernel**2 / (k**2).sum(axis=1)).sum()


def kernel_mean(data):
    """Velocity along the force, averaged by the Gaussian over the nodes (all of one volume, copies at the far sides not)."""
    points = np.asarray(data.points, float)
    inside = (points < 1 - 1e-9).all(axis=1)
    apart = points[inside] - CENTRE
    weight = np.exp(-0.5 * (apart**2).sum(axis=1) / WIDTH**2)
    return (weight * np.asarray(data["velocity"], float)[inside, 0]).sum() / weight.sum()


run = run_data.folder("stokes-point-force")
data = lines.fluid(run).clean()
found, wanted = kernel_mean(data), mobility()
radius = WIDTH * np.sqrt(np.pi)
phi = 4 / 3 * np.pi * radius**3
hasimoto = 1 - 1.7601 * phi ** (1 / 3) + phi
print(f"mobility {found:.6f}, modes {wanted:.6f}: off by {found / wanted - 1:.2e}")
print(f"by that of a sphere of radius σ√π alone: {found * 6 * np.pi * radius:.4f}, Hasimoto's series {hasimoto:.4f}")

figure, axis = plt.subplots(figsize=(7, 5))
fine = np.linspace(0, 1, 201)
worst = 0.0
for direction, name in ((0, "along the force"), (1, "across")):
    place = np.full((len(fine), 3), CENTRE)
    place[:, direction] = fine
    axis.plot(fine, exact(place), "k-", lw=1)
    x, velocity, _ = lines.along(data, direction, (CENTRE,) * 3)
    nodes = np.full((len(x), 3), CENTRE)
    nodes[:, direction] = x
    worst = max(worst, np.abs(velocity[:, 0] - exact(nodes)).max() / exact(np.full((1, 3), CENTRE))[0])
    axis.plot(x, velocity[:, 0], "o", mfc="none", label=name)
print(f"largest deviation on these lines: {worst:.2e} of the largest velocity")
axis.plot([], [], "k-", lw=1, label="Fourier modes")
axis.set(xlabel="distance [m]", ylabel="velocity along the force [m/s]")
axis.legend()
figure.savefig(run_data.picture(run, "velocity.png"), dpi=150)
