"""Centrelines against reference values over meshes, elements and Reynolds numbers: .venv/bin/python cases/cavity-2d/validate.py

    [--quick]       32 and 64 cells, Re 100 and 1000
    [--set K=V]…    further settings of the case, as of `fibreflow run`
    [--out DIR]     default runs/validate/cavity-2d

Each mesh starts from the steady flow of the one before. Writes cavity-2d.csv, profiles.png, fields.png.
"""

import argparse
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "plot"))

import cavity
import harness
import lines
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HERE = pathlib.Path(__file__).resolve().parent
# Simulated time on the first mesh and on each further one [s]: what is left of the transient is in the table.
TIMES = {100: (20.0, 8.0), 400: (40.0, 15.0), 1000: (80.0, 30.0)}


def wanted(reynolds):
    """(coordinate, value) on both centrelines, ends left out."""
    if reynolds == 1000:
        tables = [cavity.reference(HERE / "reference" / f"botella_peyret_1998_re1000_{c}.csv") for c in "uv"]
        pairs = [(tables[0]["y"], tables[0]["u"]), (tables[1]["x"], tables[1]["v"])]
    else:
        tables = [cavity.reference(HERE / "reference" / f"finite_differences_{c}.csv") for c in "uv"]
        pairs = [(tables[0]["y"], tables[0][f"u_Re{reynolds}"]), (tables[1]["x"], tables[1][f"v_Re{reynolds}"])]
    return [(x[1:-1], value[1:-1]) for x, value in pairs]


def deviations(data, reynolds):
    """Velocity on the two centrelines minus the reference."""
    (y, u), (x, v) = wanted(reynolds)
    centre = (0.5, 0.5, 0.0)
    return [cavity.deviation(data, 1, centre, 0, y, u), cavity.deviation(data, 0, centre, 1, x, v)]


def chain(reynolds, element, stretching, sizes, extra, folder):
    """One row for each mesh, and the last field."""
    common = {
        "fluid.viscosity": repr(1.0 / reynolds),
        "mesh.element": f'"{element}"',
        "output.series.every": "1",
    }
    if stretching:
        common["mesh.stretching"] = f'[{{ tanh = {stretching} }}, {{ tanh = {stretching} }}, "uniform"]'
    runs = cavity.Chain(
        HERE / "case.toml", common | extra,
        lambda n: [cavity.grid_lines(n, stretching)] * 2 + [np.array([0.0, 1.0 / n])], folder)
    rows, data = [], None
    for k, n in enumerate(sizes):
        settings = {
            "mesh.cells": f"[{n}, {n}, 1]",
            "mesh.size": f"[1.0, 1.0, {1.0 / n!r}]",
            "time.end": repr(TIMES[reynolds][min(k, 1)]),
        }
        data, summary, change = runs.run(n, settings)
        off = deviations(data, reynolds)
        pressure = np.asarray(data["pressure"])
        rows.append({
            "reynolds": reynolds, "element": element, "tanh": stretching, "cells": n,
            "u_off": np.abs(off[0]).max(), "v_off": np.abs(off[1]).max(),
            "rms_off": np.sqrt(np.mean(np.concatenate(off) ** 2)),
            "pressure_min": pressure.min(), "pressure_max": pressure.max(),
            "energy_change_per_s": change, "steps": summary["steps"], "seconds": summary["wall_seconds"],
            "us_per_node_step": summary["fluid"]["seconds_per_node_step"] * 1e6,
        })
        print("  Re {reynolds}, {element}, tanh {tanh}, {cells}²: u {u_off:.2e}, v {v_off:.2e}, rms {rms_off:.2e}, "
              "energy changes {energy_change_per_s:.1e} a second, {seconds:.0f} s".format(**rows[-1]), flush=True)
    orders = [np.log(a["rms_off"] / b["rms_off"]) / np.log(b["cells"] / a["cells"]) for a, b in zip(rows, rows[1:])]
    for row, order in zip(rows[1:], orders):
        row["order"] = order
    print("  order of the rms: " + ", ".join(f"{order:.2f}" for order in orders), flush=True)
    return rows, data


def draw_profiles(fields, path):
    """u(y), v(x) on the centrelines with all references; `fields` maps (Re, element) to the finest field."""
    numbers = sorted({key[0] for key in fields})
    figure, axes = plt.subplots(2, len(numbers), figsize=(4.5 * len(numbers), 8), squeeze=False)
    ghia = [cavity.reference(HERE / "reference" / f"ghia_1982_{c}.csv") for c in "uv"]
    for column, reynolds in enumerate(numbers):
        for row, (name, coordinate) in enumerate((("u", "y"), ("v", "x"))):
            axis = axes[row, column]
            for (number, element), data in fields.items():
                if number == reynolds:
                    x, velocity, _ = lines.along(data, 1 - row, (0.5, 0.5, 0.0))
                    axis.plot(x, velocity[:, row], label=f"fibreflow, {element}")
            x, value = wanted(reynolds)[row]
            source = "Botella & Peyret 1998" if reynolds == 1000 else "finite differences, extrapolated"
            axis.plot(x, value, "ko", mfc="none", label=source)
            axis.plot(ghia[row][coordinate], ghia[row][f"{name}_Re{reynolds}"], "r+", label="Ghia et al. 1982")
            axis.set(xlabel=coordinate, ylabel=name, title=f"Re {reynolds}")
    axes[0, 0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def draw_fields(fields, path):
    """Speed and pressure of the finest meshes."""
    figure, axes = plt.subplots(2, len(fields), figsize=(4 * len(fields), 7.5), squeeze=False)
    for column, ((reynolds, element), data) in enumerate(fields.items()):
        flat = np.abs(data.points[:, 2]) < 1e-9
        x, y = data.points[flat, 0], data.points[flat, 1]
        speed = np.linalg.norm(np.asarray(data["velocity"])[flat], axis=1)
        pressure = np.asarray(data["pressure"])[flat]
        pressure = pressure - pressure[np.argmin((x - 0.5) ** 2 + (y - 0.5) ** 2)]
        # Corners are singular: the scale is that of the rest.
        for axis, value, levels in ((axes[0, column], speed, np.linspace(0, 1, 21)),
                                    (axes[1, column], pressure, np.linspace(-0.12, 0.12, 25))):
            shown = axis.tricontourf(x, y, value, levels=levels, extend="both", cmap="viridis")
            axis.set_aspect("equal")
            figure.colorbar(shown, ax=axis, shrink=0.8)
        axes[0, column].set_title(f"speed, Re {reynolds}, {element}", fontsize=9)
        axes[1, column].set_title("pressure", fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=80)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--reynolds", type=int, nargs="*", help="100, 400, 1000")
    parser.add_argument("--elements", nargs="*", default=["hexahedron", "prism"])
    parser.add_argument("--sizes", type=int, nargs="*", default=[32, 64, 128])
    parser.add_argument("--tanh", type=float, default=0.0, help="stretching towards the walls; 0 is uniform")
    parser.add_argument("--out", type=pathlib.Path, default=harness.ROOT / "runs" / "validate" / "cavity-2d")
    options = parser.parse_args()
    numbers = options.reynolds or ([100, 1000] if options.quick else [100, 400, 1000])
    sizes = [n for n in options.sizes if n <= 64] if options.quick else options.sizes
    extra = dict(setting.split("=", 1) for setting in options.set)
    options.out.mkdir(parents=True, exist_ok=True)
    rows, fields = [], {}
    for reynolds in numbers:
        for element in options.elements:
            with tempfile.TemporaryDirectory() as folder:
                found, fields[reynolds, element] = chain(reynolds, element, options.tanh, sizes, extra, folder)
            rows += found
            harness.write_csv(options.out / "cavity-2d.csv", rows)
    draw_profiles(fields, options.out / "profiles.png")
    draw_fields(fields, options.out / "fields.png")
    (options.out / "machine.txt").write_text(harness.machine({}) + "\n")
    finest = [row for row in rows if row["cells"] == max(sizes)]
    worst = max(max(row["u_off"], row["v_off"]) for row in finest)
    print(f"largest deviation on {max(sizes)}²: {100 * worst:.3f} % of the speed of the lid; results in {options.out}")
    return 0 if worst < 0.005 or max(sizes) < 128 else 1


if __name__ == "__main__":
    sys.exit(main())
