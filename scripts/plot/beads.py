"""Two fluids and beads of a run: .venv/bin/python scripts/plot/beads.py RUN PICTURE [--times T ...]

In a mesh one element thick ψ in colour, where there are two fluids, and beads as circles at some times; in three dimensions the interface ψ = 0 and
beads. Times are the nearest at which the fluid was written.
"""

import argparse
import pathlib
import re

import matplotlib
import numpy as np
import pandas as pd
import pyvista as pv

matplotlib.use("Agg")
import matplotlib.pyplot as plt


def radius(run):
    return float(re.search(r"\[beads\][^\[]*?\nradius = ([\d.e+-]+)", (run / "case.toml").read_text(), re.S).group(1))


def centres(run, time):
    series = pd.read_csv(run / "series" / "beads.csv")
    row = series.iloc[(series.time - time).abs().argmin()]
    count = sum(1 for name in series if re.fullmatch(r"bead_\d+_x", name))
    return np.array([[row[f"bead_{k}_{c}"] for c in "xyz"] for k in range(count)])


def snapshots(run, wanted):
    """Meshes and times nearest to those wanted, or four over the run."""
    reader = pv.get_reader(str(run / "fluid.pvd"))
    times = np.array(reader.time_values)
    if not wanted:
        wanted = np.linspace(times[0], times[-1], 4)
    for index in sorted({int(np.abs(times - t).argmin()) for t in wanted}):
        reader.set_active_time_value(times[index])
        data = reader.read()
        yield times[index], data.combine() if isinstance(data, pv.MultiBlock) else data


def plane(axis, fluid, beads, size, title):
    low = np.isclose(fluid.points[:, 2], fluid.points[:, 2].min())
    x, y = fluid.points[low, 0], fluid.points[low, 1]
    if "order_parameter" in fluid.array_names:
        axis.tricontourf(x, y, fluid["order_parameter"][low], levels=np.linspace(-1.1, 1.1, 23), cmap="coolwarm")
    else:
        # Positions are unwrapped: the chain may have left the box.
        axis.set_xlim(beads[:, 0].mean() + 0.5 * np.array([-1, 1]) * np.ptp(y))
        axis.set_ylim(y.min(), y.max())
    for bead in beads:
        axis.add_patch(plt.Circle(bead[:2], size, fill=False, linewidth=0.7))
    axis.set_aspect("equal")
    axis.set_title(title, fontsize=9)


def space(plotter, fluid, beads, size, title):
    grid = fluid.clean()
    plotter.add_mesh(grid.contour([0.0], scalars="order_parameter"), color="steelblue", opacity=0.6, smooth_shading=True)
    for bead in beads:
        plotter.add_mesh(pv.Sphere(radius=size, center=bead), color="gold", smooth_shading=True)
    plotter.add_mesh(grid.outline(), color="grey")
    plotter.add_text(title, font_size=9, color="black")
    plotter.view_vector((0.35, 0.3, 1.0), viewup=(0, 1, 0))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=pathlib.Path)
    parser.add_argument("picture", type=pathlib.Path)
    parser.add_argument("--times", nargs="+", type=float)
    options = parser.parse_args()
    found = list(snapshots(options.run, options.times))
    size = radius(options.run)
    depth = np.unique(np.round(found[0][1].points[:, 2], 9))
    options.picture.parent.mkdir(parents=True, exist_ok=True)
    if len(depth) <= 2:
        plot, axes = plt.subplots(1, len(found), figsize=(4 * len(found), 3.6), squeeze=False)
        for axis, (time, fluid) in zip(axes[0], found):
            plane(axis, fluid, centres(options.run, time), size, f"t = {time:.0f}")
        plot.tight_layout()
        plot.savefig(options.picture, dpi=90)
        return
    plotter = pv.Plotter(off_screen=True, shape=(1, len(found)), window_size=(480 * len(found), 440))
    for k, (time, fluid) in enumerate(found):
        plotter.subplot(0, k)
        space(plotter, fluid, centres(options.run, time), size, f"t = {time:.0f}")
    plotter.screenshot(str(options.picture))


main()
