"""Error against spacing on three element types: python cases/taylor-green-2d/plot.py

Runs the case on a table of meshes with the release build that scripts/run leaves.
"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "plot"))

import subprocess
import tempfile

import matplotlib.pyplot as plt
import numpy as np
import run_data

case = pathlib.Path(__file__).with_name("case.toml")
program = run_data.ROOT / "target" / "release" / "fibreflow"
cells = [16, 32, 64]
figure, axis = plt.subplots(figsize=(6, 5))
for element in ("hexahedron", "tetrahedron", "prism"):
    errors = []
    for n in cells:
        with tempfile.TemporaryDirectory() as out:
            thickness = 2 * np.pi / n
            settings = {
                "mesh.element": element,
                "mesh.cells": f"[{n}, {n}, 1]",
                "mesh.size": f"[{2 * np.pi!r}, {2 * np.pi!r}, {thickness!r}]",
                "time.step": repr(0.32 / n),
            }
            arguments = [f"--set={key}={value}" for key, value in settings.items()]
            subprocess.run([program, "run", case, "--out", out, *arguments], check=True, stdout=subprocess.DEVNULL)
            errors.append(run_data.summary(pathlib.Path(out))["errors"]["velocity_l2"])
    order = -np.polyfit(np.log(cells), np.log(errors), 1)[0]
    print(f"{element}: errors {errors}, order {order:.2f}")
    axis.loglog(cells, errors, "o-", label=f"{element}, order {order:.2f}")
axis.loglog(cells, [errors[0] * (cells[0] / n) ** 2 for n in cells], "k--", label="second order")
axis.set_xlabel("cells in a direction")
axis.set_ylabel("L2 error of the velocity, by the amplitude")
axis.legend()
figure.savefig(run_data.picture(run_data.folder("taylor-green-2d"), "order.png"), dpi=150)
