"""The two printed steps of the star floc (B7) from the program: .venv/bin/python cases/star-floc/validate.py

    [--out DIR]   default runs/validate/star-floc

Compares centres of mass, axes of the segments and joint forces with the print, and fails beyond its digits. Writes floc.png.
"""

import argparse
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pyvista

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts" / "bench"))
import harness  # noqa: E402

HERE = pathlib.Path(__file__).resolve().parent
RADIUS, HALF, SEGMENTS = 1e-5, 8.0, 7
FORCE = 6 * np.pi * HALF * RADIUS * RADIUS
# Largest difference from the print that its digits allow.
LIMITS = {"centres of mass": 1e-6, "axes": 2.5e-6, "joint forces": 5e-6}


def to_paper(v):
    """From (x, y, z) with the gradient along y to the paper's, along z."""
    return np.stack([v[..., 0], -v[..., 2], v[..., 1]], axis=-1)


def axes(table):
    w, x, y, z = table[["q0", "q1", "q2", "q3"]].to_numpy().T
    return np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 2 * (w * w + z * z) - 1], axis=-1)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true", help="the same")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "validate" / "star-floc")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    harness.fibreflow(HERE / "case.toml", {}, out=options.out)
    printed = {name: pd.read_csv(HERE / "reference" / f"{name}.csv") for name in ("center_mass_out", "euler_param_out", "inextensibility_forces_out")}
    worst = dict.fromkeys(LIMITS, 0.0)
    for step in (1, 2):
        mesh = pyvista.read(options.out / "fibres" / f"fibres_{step:08d}_0000.vtp")
        nodes = to_paper(np.asarray(mesh.points, dtype=float)).reshape(-1, SEGMENTS + 1, 3) / RADIUS
        forces = to_paper(np.asarray(mesh["joint_force"])).reshape(-1, SEGMENTS + 1, 3)[:, :-1] / FORCE
        at = {name: table[np.isclose(table.strain, 1e-4 * step)] for name, table in printed.items()}
        # A fibre is drawn in the period of its middle.
        centres = 0.5 * (nodes[:, 1:] + nodes[:, :-1]).mean(axis=1)
        off = centres - at["center_mass_out"][["rcmx", "rcmy", "rcmz"]].to_numpy()
        off -= 200 * np.round(off / 200)
        found = (nodes[:, 1:] - nodes[:, :-1]) / (2 * HALF)
        differences = {
            "centres of mass": off,
            "axes": found.reshape(-1, 3) - axes(at["euler_param_out"]),
            "joint forces": forces.reshape(-1, 3) - at["inextensibility_forces_out"][["Xx", "Xy", "Xz"]].to_numpy(),
        }
        for name, difference in differences.items():
            worst[name] = max(worst[name], np.abs(difference).max())
    for name, value in worst.items():
        print(f"{name}: {value:.2e} from the print, {LIMITS[name]:.1e} allowed")

    plot = plt.figure(figsize=(5, 5)).add_subplot(projection="3d")
    home = nodes - 200 * np.round(nodes.mean(axis=1, keepdims=True) / 200)
    for fibre in home:
        plot.plot(*fibre.T, marker="o", markersize=3)
    plot.set(xlabel="x/b", ylabel="y/b", zlabel="z/b", title="star floc")
    plt.savefig(options.out / "floc.png", dpi=120)
    sys.exit(any(worst[name] > limit for name, limit in LIMITS.items()))


if __name__ == "__main__":
    main()
