"""Energies and driving force over time: python cases/quickstart/plot.py [RUN]"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "plot"))

import matplotlib.pyplot as plt
import run_data

run = run_data.folder("quickstart")
fluid, fibres = run_data.series(run, "fluid"), run_data.series(run, "fibres")
figure, axes = plt.subplots(3, 1, sharex=True, figsize=(7, 8))
axes[0].plot(fluid.time, fluid.kinetic_energy)
axes[0].set_ylabel("kinetic energy of the fluid [J]")
axes[1].plot(fluid.time[1:], fluid.driving_force_x[1:])
axes[1].set_ylabel("driving force [N/m³]")
axes[2].plot(fibres.time, fibres.bending_energy, label="bending energy [J]")
axes[2].legend()
curvature = axes[2].twinx()
curvature.plot(fibres.time, fibres.mean_curvature, "C1")
curvature.set_ylabel("mean curvature [1/m]", color="C1")
axes[2].set_xlabel("time [s]")
figure.tight_layout()
figure.savefig(run_data.picture(run, "history.png"), dpi=150)
