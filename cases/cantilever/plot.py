"""Tip deflection over time: python cases/cantilever/plot.py [RUN]"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "plot"))

import tomllib

import matplotlib.pyplot as plt
import numpy as np
import run_data

run = run_data.folder("cantilever")
fibre = tomllib.loads((run / "case.toml").read_text())["fibres"][0]
length = np.linalg.norm(np.subtract(fibre["placement"]["end"], fibre["placement"]["start"]))
stiffness = fibre["youngs_modulus"] * np.pi * fibre["diameter"] ** 4 / 64
exact = -np.linalg.norm(fibre["point_loads"][0]["force"]) * length**3 / (3 * stiffness)
tip = run_data.series(run, "fibre_0")
figure, axis = plt.subplots(figsize=(7, 4))
axis.plot(tip.time, tip.end_z / length, label="fibreflow")
axis.axhline(exact / length, color="k", linestyle="--", label="Euler–Bernoulli, static")
axis.set_xlabel("time [s]")
axis.set_ylabel("tip deflection by length")
axis.legend()
figure.tight_layout()
figure.savefig(run_data.picture(run, "tip.png"), dpi=150)
print(run_data.summary(run)["errors"])
