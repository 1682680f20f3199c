"""Angle beside Jeffery's orbit: python cases/shear-jeffery/plot.py [RUN]"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "plot"))

import tomllib

import matplotlib.pyplot as plt
import numpy as np
import run_data

run = run_data.folder("shear-jeffery")
case = tomllib.loads((run / "case.toml").read_text())
fibre, rate = case["fibres"][0], case["ambient"]["flow"]["rate"]
length = np.linalg.norm(np.subtract(fibre["placement"]["end"], fibre["placement"]["start"]))
aspect = length / fibre["diameter"]
equivalent = 1.24 * aspect / np.sqrt(np.log(aspect))
track = run_data.series(run, "fibre_0")
# From the gradient direction towards the flow.
angle = np.unwrap(np.arctan2(track.end_to_end_x, track.end_to_end_y), period=np.pi)
turn = rate * track.time / (equivalent + 1 / equivalent)
exact = np.unwrap(np.arctan2(equivalent * np.sin(turn), np.cos(turn)), period=np.pi)
figure, axis = plt.subplots(figsize=(7, 4))
axis.plot(rate * track.time, angle / np.pi, label="fibreflow")
axis.plot(rate * track.time, exact / np.pi, "k--", label="Jeffery, r of Cox")
axis.set_xlabel("strain")
axis.set_ylabel("angle / π")
axis.legend()
figure.tight_layout()
figure.savefig(run_data.picture(run, "orbit.png"), dpi=150)
print(run_data.summary(run)["errors"])
