"""Profiles and wall stress beside the exact ones: python cases/womersley/plot.py [RUN]"""

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

OMEGA, AREA = 2 * np.pi, 0.125 * 0.0625
VISCOSITY = OMEGA / 50
ROOT = np.sqrt(1j * OMEGA / VISCOSITY)


def exact(time, y):
    """Re G/(iωρ) (1 − cosh(λy)/cosh(λ)) exp(iωt), λ = √(iω/ν) (Womersley 1955, between planes); G = ρ = 1."""
    return (np.exp(1j * OMEGA * time) / (1j * OMEGA) * (1 - np.cosh(ROOT * y) / np.cosh(ROOT))).real


def stress(time):
    """Force of the fluid on a wall by its area: Re G μλ/(iωρ) tanh(λ) exp(iωt)."""
    return (np.exp(1j * OMEGA * time) / (1j * OMEGA) * VISCOSITY * ROOT * np.tanh(ROOT)).real


run = run_data.folder("womersley")
times = pv.get_reader(str(run / "fluid.pvd")).time_values
fine = np.linspace(-1, 1, 401)
largest = max(np.abs(exact(t, fine)).max() for t in np.linspace(0, 1, 101))
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 5))
worst = 0.0
for k, time in enumerate(times):
    y, velocity, _ = lines.along(lines.fluid(run, k), 1, (0.0, 0.0, 0.0))
    worst = max(worst, np.abs(velocity[:, 0] - exact(time, y)).max())
    if time >= times[-1] - 1 + 1e-9:
        left.plot(exact(time, fine), fine, "k-", lw=1)
        left.plot(velocity[:, 0], y, "o", ms=3, mfc="none", label=f"t = {time:.3f} s")
print(f"largest deviation of the velocity: {worst / largest:.1e} of the largest velocity")
left.set(xlabel="u [m/s]", ylabel="y [m]")
left.legend(fontsize=8, ncol=4, loc="upper center", bbox_to_anchor=(0.5, -0.12))
loads = run_data.series(run, "loads")
# Forces are means over a step.
end = loads["time"].to_numpy()
middle = end - 0.5 * np.diff(end, prepend=0.0)
found = loads["y_min_viscous_x"].to_numpy() / AREA
off = np.abs(found - stress(middle)).max() / np.abs(stress(middle)).max()
print(f"largest deviation of the stress on a wall: {off:.1e} of its amplitude")
period = np.linspace(0, 2, 401)
right.plot(period, stress(period), "k-", lw=1, label="exact")
right.plot(middle[::4], found[::4], "o", ms=3, mfc="none", label="fibreflow")
right.set(xlabel="t [s]", ylabel="stress on a wall [Pa]")
right.legend()
figure.tight_layout()
figure.savefig(run_data.picture(run, "profiles.png"), dpi=150)
