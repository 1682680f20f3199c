"""Profiles and wall stress beside the exact ones: python cases/oscillating-wall/plot.py [RUN]"""

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

OMEGA, VISCOSITY, AREA = 2 * np.pi, 1000 * np.pi / 200, 0.125 * 0.0625
KAPPA = np.sqrt(OMEGA / 2 / (VISCOSITY / 1000))


def exact(time, y):
    """Re exp(iωt) sinh((1 + i)κ(1 − y))/sinh((1 + i)κ)."""
    root = (1 + 1j) * KAPPA
    return (np.exp(1j * OMEGA * time) * np.sinh(root * (1 - y)) / np.sinh(root)).real


def stress(time):
    """Force of the fluid on the wall by its area, μ ∂u/∂y = −μκ√2 cos(ωt + π/4)."""
    return -VISCOSITY * KAPPA * np.sqrt(2) * np.cos(OMEGA * time + np.pi / 4)


run = run_data.folder("oscillating-wall")
times = pv.get_reader(str(run / "fluid.pvd")).time_values
fine = np.linspace(0, 1, 401)
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 5))
worst = 0.0
for k, time in enumerate(times):
    y, velocity, _ = lines.along(lines.fluid(run, k), 1, (0.0, 0.0, 0.0))
    worst = max(worst, np.abs(velocity[:, 0] - exact(time, y)).max())
    if time >= times[-1] - 1 + 1e-9:
        left.plot(exact(time, fine), fine, "k-", lw=1)
        left.plot(velocity[:, 0], y, "o", ms=3, mfc="none", label=f"t = {time:.3f} s")
print(f"largest deviation of the velocity: {worst:.1e} of the speed of the wall")
left.set(xlabel="u [m/s]", ylabel="y [m]", ylim=(0, 0.6))
left.legend(fontsize=8)
loads = run_data.series(run, "loads")
# Forces are means over a step.
end = loads["time"].to_numpy()
middle = end - 0.5 * np.diff(end, prepend=0.0)
found = loads["y_min_viscous_x"].to_numpy() / AREA
off = np.abs(found - stress(middle)).max() / np.abs(stress(middle)).max()
print(f"largest deviation of the stress on the wall: {off:.1e} of its amplitude")
right.plot(fine * 2, stress(fine * 2), "k-", lw=1, label="exact")
right.plot(middle[::4], found[::4], "o", ms=3, mfc="none", label="fibreflow")
right.set(xlabel="t [s]", ylabel="stress on the wall [Pa]")
right.legend()
figure.tight_layout()
figure.savefig(run_data.picture(run, "profiles.png"), dpi=150)
