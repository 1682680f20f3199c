"""Profile and torques beside the exact ones: python cases/taylor-couette/plot.py [RUN]"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "plot"))

import lines
import matplotlib
import numpy as np
import run_data

matplotlib.use("Agg")
import matplotlib.pyplot as plt

INNER, OUTER, HEIGHT, RATE, VISCOSITY = 1.0, 2.0, 0.1, 1.0, 0.5
B = RATE * INNER**2 * OUTER**2 / (OUTER**2 - INNER**2)
TORQUE = 4 * np.pi * VISCOSITY * B * HEIGHT


def exact(r):
    """A r + B/r, with no slip on both cylinders."""
    return B / r - B / OUTER**2 * r


run = run_data.folder("taylor-couette")
data = lines.fluid(run)
points, velocity = np.asarray(data.points, float), np.asarray(data["velocity"], float)
radius = np.hypot(points[:, 0], points[:, 1])
around = (points[:, 0] * velocity[:, 1] - points[:, 1] * velocity[:, 0]) / radius
off = np.abs(around - exact(radius)).max()
print(f"largest deviation of the velocity: {off / (RATE * INNER):.1e} of the speed of the inner cylinder")
loads = run_data.series(run, "loads")
for patch, sign in (("inner", -1), ("outer", 1)):
    found = loads[f"{patch}_torque_z"].iloc[-1] * sign
    print(f"torque on the {patch} cylinder: {found:.6f} N·m, exact {TORQUE:.6f}, off by {found / TORQUE - 1:.1e}")
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5))
fine = np.linspace(INNER, OUTER, 201)
left.plot(fine, exact(fine), "k-", label="exact")
left.plot(radius, around, "o", ms=3, mfc="none", label="fibreflow, all nodes")
left.set(xlabel="r [m]", ylabel="velocity around the axis [m/s]")
left.legend()
right.axhline(TORQUE, color="k", label="exact, steady")
right.plot(loads["time"], -loads["inner_torque_z"], label="−inner")
right.plot(loads["time"], loads["outer_torque_z"], label="outer")
right.set(xlabel="t [s]", ylabel="torque [N·m]", ylim=(0, 2 * TORQUE))
right.legend()
figure.tight_layout()
figure.savefig(run_data.picture(run, "profile.png"), dpi=150)
