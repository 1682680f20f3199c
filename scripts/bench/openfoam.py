"""Ours beside OpenFOAM's pimpleFoam on the same case: scripts/bench/openfoam [--quick] [--full] [--only tgv|channel]

(a) `tgv`: drifting 2D Taylor–Green vortices, error against N at equal Δt (CFL 0.2 of the mesh spacing).
    Equal: box, viscosity, end time, number of unknowns, Δt. Their cell centres lie half a spacing from our nodes.
    Theirs: backward in time, Gauss linear, two outer iterations of two correctors, to 1e-8.
(b) `channel`: wall-stretched channel 2π × 2 × π, Re_τ = 180, tanh 2, Δt = 0.002: time by unknown and step on 1 and 2 ranks.
    Equal: box, number of cells in each direction, spacing function (our nodes are the corners of their cells), viscosity,
    driving force, Δt, start (our field after some steps, interpolated to their cell centres). Theirs: backward, Gauss linear,
    two correctors, GAMG to 1e-6, and the cheaper setting relTol 0.05 on the first corrector.

Times are wall times of the solver loop, without set-up and output (theirs after five steps); (a) lists theirs as processor time.
Without OpenFOAM (`apt-get install --no-install-recommends openfoam`) only ours is run, beside figures measured before.
Results: table on the screen; openfoam-*.csv, openfoam.png and machine.txt in --out (default runs/bench/openfoam).
"""

import argparse
import pathlib
import shutil
import tempfile

import foam
import harness
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

VISCOSITY, END = 0.01, 2.0
# Measured before with OpenFOAM 1912 (Debian), pimpleFoam: relative L2 error with drift (1, 1), by N.
KNOWN_ERROR = {16: 7.895e-2, 32: 1.962e-2, 64: 4.789e-3, 128: 1.180e-3}
# The same build on the 64³ channel, developed flow, one rank of a quiet two-core AVX2 machine [µs by unknown and step].
KNOWN_COST = {"pimpleFoam, GAMG 1e-6": 4.9, "pimpleFoam, GAMG 1e-6, relTol 0.05": 3.7}
RMS = np.sqrt(0.5) * np.exp(-2 * VISCOSITY * END)
CASE = harness.ROOT / "cases" / "taylor-green-2d" / "case.toml"
CHANNEL = pathlib.Path(__file__).with_name("channel.toml")

# What of ours is compared: label, settings. A build that lacks an option refuses it, and the row is left out.
VORTEX_VARIANTS = [
    ("hexahedra, second order", {}),
    ("hexahedra, fourth order", {"fluid.order": "4"}),
    ("jittered tetrahedra", {"mesh.element": '"tetrahedron"', "mesh.jitter": "0.2", "mesh.seed": "3"}),
]
# Steps that are run and not counted.
WARM_UP = 5
CHANNEL_VARIANTS = [
    ("hexahedra, defaults", {}),
    ("direct, lattice kernels", {"fluid.poisson.preconditioner": '"direct"'}),
    ("direct, fourth order", {"fluid.poisson.preconditioner": '"direct"', "fluid.order": "4"}),
    ("amg, treated as general", {"fluid.poisson.preconditioner": '"amg"', "fluid.kernels": '"rows"'}),
    ("tetrahedra", {"mesh.element": '"tetrahedron"'}),
]


def vortex_steps(n):
    return int(np.ceil(END * 3 / (0.2 * 2 * np.pi / n)))


def our_vortices(n, settings):
    h = 2 * np.pi / n
    steps = vortex_steps(n)
    common = {
        "mesh.cells": f"[{n}, {n}, 1]",
        "mesh.size": f"[{2 * np.pi!r}, {2 * np.pi!r}, {h!r}]",
        "time.step": repr(END / steps),
        "output.vtk.interval": repr(END),
        "output.series.every": "1000000",
    }
    summary = harness.fibreflow(CASE, common | settings)
    return {
        "steps": summary["steps"],
        "unknowns": summary["fluid"]["nodes"],
        "error_l2": summary["errors"]["velocity_l2"] / RMS,
        "error_max": summary["errors"]["velocity_max"],
        "seconds": summary["timings"]["fluid"],
    }


def their_vortices(n, folder):
    h = 2 * np.pi / n
    steps = vortex_steps(n)
    case = folder / f"tgv-{n}"
    sides = foam.cyclic("x") + foam.cyclic("y") + "flat { type empty; faces (<z_min> <z_max>); }"
    foam.control(case, END / steps, steps, VISCOSITY, 1e-8, 0.0, outer=2, correctors=2, pressure="PCG" if n < 128 else "GAMG")
    foam.block(case, (0, 0, 0), (2 * np.pi, 2 * np.pi, h), (n, n, 1), sides)
    x = (np.arange(n) + 0.5) * h
    y, x = (a.ravel() for a in np.meshgrid(x, x, indexing="ij"))
    boundary = '"[xy]_.*" { type cyclic; } flat { type empty; }'
    start = np.column_stack([1 + np.sin(x) * np.cos(y), 1 - np.cos(x) * np.sin(y), 0 * x])
    foam.vectors(case, "U", "[0 1 -1 0 0 0 0]", start, boundary)
    foam.write(case, "0/p", "volScalarField", f"dimensions [0 2 -2 0 0 0 0];\ninternalField uniform 0;\nboundaryField {{ {boundary} }}")
    run = foam.solve(case)
    found = foam.read_vectors(foam.last_time(case) / "U")
    decay = np.exp(-2 * VISCOSITY * END)
    x, y = x - END, y - END
    exact = np.column_stack([1 + decay * np.sin(x) * np.cos(y), 1 - decay * np.cos(x) * np.sin(y), 0 * x])
    error = np.linalg.norm(found - exact, axis=1)
    return {
        "steps": run["steps"],
        "unknowns": n * n,
        "error_l2": np.sqrt(np.mean(error**2)) / RMS,
        "error_max": error.max(),
        "seconds": run["cpu"],
    }


def vortices(options, folder):
    rows = []

    def add(label, n, found):
        if found:
            rows.append({"case": label, "n": n} | found)
            print(f"  {label}, N = {n}: {found['error_l2']:.3e}, {found['seconds']:.2f} s", flush=True)

    for label, settings in VORTEX_VARIANTS:
        for n in options.sizes:
            found = harness.attempt(label, our_vortices, n, settings)
            if found is None:
                break
            add(label, n, found)
    for n in options.sizes:
        if foam.installed() and n <= options.foam_largest:
            add("pimpleFoam", n, harness.attempt("pimpleFoam", their_vortices, n, folder))
        elif n in KNOWN_ERROR:
            rows.append({"case": "pimpleFoam, measured before", "n": n, "error_l2": KNOWN_ERROR[n]})
    theirs = {row["n"]: row["error_l2"] for row in rows if row["case"].startswith("pimpleFoam")}
    for row in rows:
        row["error_by_theirs"] = row["error_l2"] / theirs[row["n"]] if row["n"] in theirs else None
    return rows


def our_start(n, steps, folder):
    """Velocity of our channel after some steps, on its nodes (x, y, z, component), and the lists of coordinates."""
    import pyvista

    out = folder / f"start-{n}"
    harness.fibreflow(CHANNEL, {"mesh.cells": f"[{n}, {n}, {n}]"}, steps=steps, out=out)
    reader = pyvista.get_reader(str(out / "fluid.pvd"))
    reader.set_active_time_value(reader.time_values[-1])
    field = reader.read()[0]
    points, velocity = np.asarray(field.points, float), np.asarray(field["velocity"], float)
    axes = [np.unique(np.round(points[:, c], 9)) for c in range(3)]
    index = [np.searchsorted(axes[c], points[:, c] - 1e-7) for c in range(3)]
    grid = np.zeros([len(a) for a in axes] + [3])
    grid[tuple(index)] = velocity
    shutil.rmtree(out)
    return axes, grid


def write_start(path, axes, grid):
    """The field as a table for `fluid.initial.kind = "file"`."""
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    np.savetxt(path, np.column_stack([nodes, grid.reshape(-1, 3)]), "%.9g", ",", header="x,y,z,u,v,w", comments="")


def our_channel(n, ranks, steps, settings, start):
    common = {"mesh.cells": f"[{n}, {n}, {n}]"}
    if start:
        common["fluid.initial"] = f'{{ kind = "file", file = "{start}" }}'
    # The first steps carry the start (pressure that belongs to the field, no history), as theirs do: not counted.
    first, all_steps = (harness.fibreflow(CHANNEL, common | settings, ranks=ranks, steps=n) for n in (WARM_UP, WARM_UP + steps))
    seconds = all_steps["timings"]["fluid"] - first["timings"]["fluid"]
    nodes = all_steps["fluid"]["nodes"]
    return {
        "steps": steps,
        "unknowns": nodes,
        "us_per_unknown_step": seconds / steps / nodes * 1e6,
        "poisson_iterations": all_steps["fluid"]["poisson_iterations_mean"],
    }


def their_channel(n, ranks, steps, relative, axes, grid, folder):
    case = folder / f"channel-{n}-{ranks}-{relative}"
    sides = foam.cyclic("x") + foam.cyclic("z") + "wall { type wall; faces (<y_min> <y_max>); }"
    foam.control(case, 0.002, steps, 1 / 180, 1e-6, relative, outer=1, correctors=2, ranks=ranks)
    foam.block(case, (0, -1, 0), (2 * np.pi, 1, np.pi), (n, n, n), sides)
    foam.move_points(case, lambda x: np.column_stack([x[:, 0], np.tanh(2 * x[:, 1]) / np.tanh(2), x[:, 2]]))
    mean = 0.5 * (grid[:-1] + grid[1:])
    mean = 0.5 * (mean[:, :-1] + mean[:, 1:])
    mean = 0.5 * (mean[:, :, :-1] + mean[:, :, 1:])
    boundary = '"[xz]_.*" {{ type cyclic; }} wall {{ type {}; }}'
    start = mean.transpose(2, 1, 0, 3).reshape(-1, 3)
    foam.vectors(case, "U", "[0 1 -1 0 0 0 0]", start, boundary.format("noSlip"))
    zero = "dimensions [0 2 -2 0 0 0 0];\ninternalField uniform 0;\nboundaryField { %s }" % boundary.format("zeroGradient")
    foam.write(case, "0/p", "volScalarField", zero)
    foam.write(case, "constant/fvOptions", "dictionary", """force { type vectorSemiImplicitSource; active yes;
vectorSemiImplicitSourceCoeffs { selectionMode all; volumeMode specific; injectionRateSuSp { U ((1 0 0) 0); } } }""")
    run = foam.solve(case, ranks)
    return {
        "steps": run["steps"],
        "unknowns": n**3,
        "us_per_unknown_step": run["wall_per_step"] / n**3 * 1e6,
        "cpu_us_per_unknown_step": run["cpu_per_step"] / n**3 * 1e6 if ranks == 1 else None,
        "poisson_iterations": run["poisson_iterations"],
    }


def channel(options, folder):
    n, rows = options.channel, []

    def add(label, cells, ranks, found):
        if found:
            rows.append({"case": label, "cells": cells, "ranks": ranks} | found)
            print(f"  {label}, {cells}³, {ranks} ranks: {found['us_per_unknown_step']:.2f} µs", flush=True)

    print(f"  start: {options.start_steps} steps of ours on {n}³", flush=True)
    axes, grid = our_start(n, options.start_steps, folder)
    start = folder / f"start-{n}.csv"
    write_start(start, axes, grid)
    for cells in [n] + options.ours_only:
        for label, settings in CHANNEL_VARIANTS:
            if cells != n and not label.startswith("direct, lattice"):
                continue
            for ranks in (1, 2):
                steps = max(4, options.steps * n**3 // cells**3)
                found = harness.attempt(label, our_channel, cells, ranks, steps, settings, start if cells == n else None)
                if found is None:
                    break
                add(label, cells, ranks, found)
    for label, relative in zip(KNOWN_COST, (0.0, 0.05)):
        for ranks in (1, 2):
            if foam.installed():
                run = harness.attempt(label, their_channel, n, ranks, options.foam_steps, relative, axes, grid, folder)
                add(label, n, ranks, run)
            elif n == 64:
                rows.append({"case": label + ", measured before", "cells": n, "ranks": ranks,
                             "us_per_unknown_step": KNOWN_COST[label] / ranks})
    theirs = {row["ranks"]: row["us_per_unknown_step"] for row in rows if row["case"].startswith("pimpleFoam, GAMG 1e-6")
              and "relTol" not in row["case"]}
    for row in rows:
        if row["ranks"] in theirs:
            row["theirs_by_this"] = theirs[row["ranks"]] / row["us_per_unknown_step"]
        one = next((r for r in rows if (r["case"], r["cells"], r["ranks"]) == (row["case"], row["cells"], 1)), None)
        if row["ranks"] == 2 and one:
            row["efficiency"] = one["us_per_unknown_step"] / (2 * row["us_per_unknown_step"])
    return rows


def draw(vortex_rows, channel_rows, path):
    panels = [rows for rows in (vortex_rows, channel_rows) if rows]
    figure, axes = plt.subplots(1, len(panels), figsize=(6.5 * len(panels), 5), squeeze=False)
    axes = list(axes[0])
    if vortex_rows:
        axis = axes.pop(0)
        for label in dict.fromkeys(row["case"] for row in vortex_rows):
            found = [(row["n"], row["error_l2"]) for row in vortex_rows if row["case"] == label]
            style = "s--" if label.startswith("pimpleFoam") else "o-"
            axis.loglog(*zip(*found), style, label=label, mfc="none" if "before" in label else None)
        axis.set_xlabel("N")
        axis.set_xticks([16, 32, 64, 128], ["16", "32", "64", "128"])
        axis.minorticks_off()
        axis.set_ylabel("relative L2 error of the velocity")
        axis.set_title("Drifting Taylor–Green vortices, equal Δt")
        axis.legend()
    if channel_rows:
        axis = axes.pop(0)
        names = [f"{row['case']}\n{row['cells']}³, {row['ranks']} rank{'s' * (row['ranks'] > 1)}" for row in channel_rows]
        values = [row["us_per_unknown_step"] for row in channel_rows]
        colours = ["0.6" if row["case"].startswith("pimple") else "C0" for row in channel_rows]
        bars = axis.barh(names, values, color=colours)
        axis.bar_label(bars, [f"{value:.2f}" for value in values], padding=3)
        axis.invert_yaxis()
        axis.tick_params(axis="y", labelsize=7)
        axis.set_xlabel("µs by unknown and step")
        axis.set_title("Wall-stretched channel")
        axis.margins(x=0.15)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="N to 32, channel 32³: a minute or two")
    parser.add_argument("--full", action="store_true", help="theirs at N = 128 too, ours on 128³, more steps")
    parser.add_argument("--only", choices=("tgv", "channel"))
    parser.add_argument("--out", type=pathlib.Path, default=harness.ROOT / "runs" / "bench" / "openfoam")
    options = parser.parse_args()
    options.sizes = [16, 32] if options.quick else [16, 32, 64, 128]
    options.foam_largest = 128 if options.full else 64
    options.channel = 32 if options.quick else 64
    options.ours_only = [128] if options.full else []
    options.steps = 40 if options.full else 24
    options.foam_steps = 30 if options.full else 14
    options.start_steps = 100 if options.full else 30
    options.out.mkdir(parents=True, exist_ok=True)
    if not foam.installed():
        print("OpenFOAM is not installed (Debian: apt-get install --no-install-recommends openfoam): ours alone is run")
    bandwidth = harness.stream()
    vortex_rows, channel_rows = [], []
    with tempfile.TemporaryDirectory() as folder:
        if options.only != "channel":
            print("Taylor–Green vortices on a drift", flush=True)
            vortex_rows = vortices(options, pathlib.Path(folder))
        if options.only != "tgv":
            print("channel", flush=True)
            channel_rows = channel(options, pathlib.Path(folder))
    line = harness.machine(bandwidth)
    print()
    if vortex_rows:
        harness.write_csv(options.out / "openfoam-tgv.csv", vortex_rows)
        harness.table(vortex_rows, [("case", "Taylor–Green", ""), ("n", "N", "d"), ("error_l2", "relative L2", ".3e"),
                                    ("error_by_theirs", "by theirs", ".3f"), ("seconds", "s", ".2f")])
        print()
    if channel_rows:
        harness.write_csv(options.out / "openfoam-channel.csv", channel_rows)
        harness.table(channel_rows, [("case", "channel", ""), ("cells", "cells", "d"), ("ranks", "ranks", "d"),
                                     ("us_per_unknown_step", "µs by unknown·step", ".2f"),
                                     ("poisson_iterations", "pressure iterations", ".1f"),
                                     ("theirs_by_this", "theirs / this", ".1f"), ("efficiency", "efficiency", ".2f")])
        print()
    draw(vortex_rows, channel_rows, options.out / "openfoam.png")
    (options.out / "machine.txt").write_text(line + "\n")
    print(line)
    print(f"results in {options.out}")


if __name__ == "__main__":
    main()
