"""Draws a run: velocity on a slice, fibres as tubes coloured by curvature.

    python scripts/plot/scene.py RUN_DIRECTORY [--all]
"""

import argparse
import os
import pathlib

if not os.environ.get("DISPLAY"):
    # Without a screen VTK would try X first and complain.
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

import numpy as np  # noqa: E402
import pyvista as pv  # noqa: E402

BAR = {"vertical": True, "position_y": 0.3, "height": 0.4, "color": "black"}


def time_values(path):
    """Reader of a collection and its times; (None, []) when the run wrote none."""
    if not path.exists():
        return None, []
    reader = pv.get_reader(str(path))
    return reader, list(reader.time_values)


def at_time(reader, time):
    """The data set at a time, its pieces joined."""
    reader.set_active_time_value(time)
    parts = [part for part in reader.read() if part.n_points]
    return pv.merge(parts) if len(parts) > 1 else parts[0]


def add_fluid(plotter, fluid):
    """Speed on a slice near the back of the thinnest extent, and the outline of the domain."""
    fluid["speed [m/s]"] = np.linalg.norm(fluid["velocity"], axis=1)
    low, high = np.array(fluid.bounds).reshape(3, 2).T
    normal = np.zeros(3)
    normal[np.argmin(high - low)] = 1.0
    # Behind the fibres, and off the planes along which cells meet.
    plane = fluid.slice(normal=normal, origin=low + 0.02001 * (high - low))
    plotter.add_mesh(plane, scalars="speed [m/s]", cmap="Blues_r", lighting=False,
                     scalar_bar_args={**BAR, "position_x": 0.9})
    plotter.add_mesh(fluid.outline(), color="dimgray", line_width=2)
    return high - low


def add_fibres(plotter, fibres, extent):
    """Fibres as tubes of their own radius, thickened where they would not be seen."""
    shown = max(float(fibres["radius"].max()), 0.002 * float(np.linalg.norm(extent)))
    fibres["curvature [1/m]"] = fibres["curvature"]
    top = float(np.percentile(fibres["curvature"], 97)) or 1.0
    plotter.add_mesh(fibres.tube(radius=shown, n_sides=12), scalars="curvature [1/m]", cmap="plasma",
                     clim=[0.0, top], smooth_shading=True, scalar_bar_args={**BAR, "position_x": 0.03})


def draw(fluid, fibres, time, path):
    """One picture."""
    plotter = pv.Plotter(off_screen=True, window_size=(1400, 900))
    plotter.set_background("white")
    source = fluid if fluid is not None else fibres
    extent = np.ptp(np.array(source.bounds).reshape(3, 2), axis=1)
    if fluid is not None:
        extent = add_fluid(plotter, fluid)
    if fibres is not None and fibres.n_points:
        add_fibres(plotter, fibres, extent)
    plotter.add_text(f"t = {time:.4g} s", font_size=12, color="black")
    thin = int(np.argmin(extent))
    if extent[thin] < 0.05 * extent.max():
        plotter.view_vector(np.eye(3)[thin], viewup=np.eye(3)[1 if thin == 2 else 2])
    else:
        # Towards the slice, a little from the side and from above.
        direction = np.roll((0.35, 0.3, 1.0), thin - 2)
        plotter.view_vector(direction, viewup=np.roll((0.0, 1.0, 0.0), thin - 2))
    plotter.camera.zoom(1.25)
    plotter.screenshot(str(path))
    plotter.close()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=pathlib.Path)
    parser.add_argument("--all", action="store_true", help="every output time, not only first and last")
    options = parser.parse_args()
    fluid, fluid_times = time_values(options.run / "fluid.pvd")
    fibres, fibre_times = time_values(options.run / "fibres.pvd")
    times = sorted(set(fluid_times) | set(fibre_times))
    if not times:
        raise SystemExit(f"{options.run} holds neither fluid.pvd nor fibres.pvd with an entry")
    chosen = times if options.all else sorted({times[0], times[-1]})
    folder = options.run / "pictures"
    folder.mkdir(exist_ok=True)
    for number, time in enumerate(chosen):
        data = [at_time(r, time) if time in t else None for r, t in ((fluid, fluid_times), (fibres, fibre_times))]
        last = time == times[-1]
        path = folder / ("end.png" if last else f"scene_{number:04d}.png" if options.all else "start.png")
        draw(*data, time, path)
        print(path)


if __name__ == "__main__":
    main()
