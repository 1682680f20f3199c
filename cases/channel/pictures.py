"""Pictures of a channel run: .venv/bin/python cases/channel/pictures.py RUN_DIR

streaks.png: streamwise velocity in the plane y⁺ ≈ 10 over the lower wall, less its mean, by u_tau. vortices.png: surfaces of the
Q-criterion, coloured by the distance from the nearer wall, the lower half alone.
"""

import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pyvista as pv

NU = 1 / 180
Y_PLUS = 10
# Q h²/u_tau².
LEVEL = 250


def main(run):
    run = pathlib.Path(run)
    reader = pv.get_reader(str(run / "fluid.pvd"))
    reader.set_active_time_value(reader.time_values[-1])
    grid = reader.read().combine()
    out = run / "pictures"
    out.mkdir(exist_ok=True)
    heights = np.unique(np.round(grid.points[:, 1], 9))
    y = heights[np.abs(heights / NU - Y_PLUS).argmin()]
    at = np.abs(grid.points[:, 1] - y) < 1e-8
    x, z, u = grid.points[at, 0], grid.points[at, 2], grid["velocity"][at, 0]
    figure, axis = plt.subplots(figsize=(9, 4.2))
    colours = axis.tripcolor(x / NU, z / NU, u - u.mean(), cmap="RdBu_r", shading="gouraud", vmin=-8, vmax=8)
    figure.colorbar(colours, label="u'⁺")
    axis.set_aspect("equal")
    axis.set_xlabel("x⁺")
    axis.set_ylabel("z⁺")
    axis.set_title(f"y⁺ = {y / NU:.1f}")
    figure.tight_layout()
    figure.savefig(out / "streaks.png", dpi=120)

    half = grid.clip("y", origin=(0, 1, 0), invert=True)
    half = half.compute_derivative(scalars="velocity", gradient=False, qcriterion=True)
    vortices = half.contour([LEVEL], scalars="qcriterion")
    vortices["distance"] = vortices.points[:, 1] / NU
    plotter = pv.Plotter(off_screen=True, window_size=(1400, 800))
    plotter.add_mesh(vortices, scalars="distance", cmap="viridis", scalar_bar_args={"title": "y+"})
    plotter.add_mesh(grid.slice("y", origin=(0, 1e-6, 0)), color="lightgrey")
    plotter.camera_position = [(-4, 5, 8), (3.2, 0.2, 1.5), (0, 1, 0)]
    plotter.camera.zoom(1.7)
    plotter.screenshot(out / "vortices.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
