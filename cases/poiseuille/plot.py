"""Profile beside the exact one: python cases/poiseuille/plot.py [RUN]"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "plot"))

import matplotlib.pyplot as plt
import numpy as np
import pyvista as pv
import run_data

run = run_data.folder("poiseuille")
reader = pv.get_reader(str(run / "fluid.pvd"))
reader.set_active_time_value(reader.time_values[-1])
fluid = reader.read()[0]
y = np.linspace(-1, 1, 201)
figure, axis = plt.subplots(figsize=(5, 6))
axis.plot((1 - y**2) / (2 * 0.5), y, "k-", label="exact")
axis.plot(fluid["velocity"][:, 0], fluid.points[:, 1], "o", mfc="none", label="fibreflow")
axis.set_xlabel("u [m/s]")
axis.set_ylabel("y [m]")
axis.legend()
figure.savefig(run_data.picture(run, "profile.png"), dpi=150)
print(run_data.summary(run)["errors"])
