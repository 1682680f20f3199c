"""Pictures of a pipe run: .venv/bin/python cases/pipe/pictures.py RUN_DIR [--out DIR]

section.png : axial velocity by the bulk velocity across the pipe in the middle and along it, with the edges of the mesh across.
vortices.png: where Q is --level root mean squares of it (`output.vortices = true`), coloured by the axial velocity.
"""

import argparse
import pathlib

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import matplotlib.tri as tri
import numpy as np
import pyvista as pv


def triangles(surface):
    flat = surface.triangulate()
    return flat.points, flat.faces.reshape(-1, 4)[:, 1:]


def vortices(grid, level, path):
    q = grid.point_data["q_criterion"]
    surface = grid.contour([level * np.sqrt(np.mean(q**2))], scalars="q_criterion")
    plotter = pv.Plotter(off_screen=True, window_size=(1500, 560))
    plotter.set_background("white")
    plotter.add_mesh(surface, scalars=surface.point_data["velocity"][:, 0], cmap="viridis", clim=(0, 1.4), scalar_bar_args={"title": "u / U_b", "color": "black", "position_x": 0.3, "n_labels": 2})
    plotter.add_mesh(grid.outline(), color="black", line_width=1)
    plotter.view_xy()
    plotter.camera.elevation, plotter.camera.azimuth = 20, -25
    plotter.reset_camera()
    plotter.camera.zoom(1.5)
    plotter.screenshot(path)
    print(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, help="folder; default RUN_DIR/pictures")
    parser.add_argument("--level", type=float, default=1.0)
    options = parser.parse_args()
    reader = pv.get_reader(str(options.run / "fluid.pvd"))
    reader.set_active_time_value(reader.time_values[-1])
    grid = reader.read().combine()
    low, high = np.array(grid.bounds[0::2]), np.array(grid.bounds[1::2])
    middle = 0.5 * (low + high)
    plot, (across, along) = plt.subplots(1, 2, figsize=(15, 4.2), gridspec_kw={"width_ratios": [1, 3]}, layout="constrained")
    for axes, normal, (a, b) in [(across, "x", (1, 2)), (along, "z", (0, 1))]:
        # Beside the planes of nodes, which are the faces of two layers of elements.
        cut = grid.slice(normal=normal, origin=middle + 1e-3)
        points, cells = triangles(cut)
        u = cut.triangulate().point_data["velocity"][:, 0]
        mesh = tri.Triangulation(points[:, a], points[:, b], cells)
        image = axes.tripcolor(mesh, u, shading="gouraud", cmap="viridis", vmin=0, vmax=1.4)
        axes.set_aspect("equal")
        axes.set_xlabel("xyz"[a])
        axes.set_ylabel("xyz"[b])
        if normal == "x":
            edges = cut.extract_all_edges()
            lines = edges.lines.reshape(-1, 3)[:, 1:]
            for pair in edges.points[lines]:
                axes.plot(pair[:, a], pair[:, b], "k-", lw=0.15)
    plot.colorbar(image, ax=along, label="u / U_b", shrink=0.8)
    out = options.out or options.run / "pictures"
    out.mkdir(exist_ok=True)
    plot.savefig(out / "section.png", dpi=110)
    print(out / "section.png")
    if "q_criterion" in grid.point_data:
        vortices(grid, options.level, out / "vortices.png")


main()
