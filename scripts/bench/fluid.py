"""Error against wall time of the fluid: scripts/bench/fluid [--quick] [--full]

Drifting 2D Taylor–Green vortices (ν = 0.01, t = 2) on every kind of mesh, order and pressure solver that the build has, N
nodes in a direction and three time steps each; one rank. What lies on the lower left is worth using. Wall time is that of
the solver loop. Results: fluid.csv, fluid.png (error against time; the best of each kind joined) and machine.txt in --out
(default runs/bench/fluid).
"""

import argparse
import pathlib

import harness
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

CASE = harness.ROOT / "cases" / "taylor-green-2d" / "case.toml"
END = 2.0
JITTER = {"mesh.jitter": "0.2", "mesh.seed": "3"}
MESHES = [
    ("hexahedra", {}),
    ("jittered hexahedra", JITTER),
    ("jittered tetrahedra", {"mesh.element": '"tetrahedron"'} | JITTER),
    ("jittered prisms", {"mesh.element": '"prism"'} | JITTER),
]
ORDERS = [("second order", {}), ("fourth order", {"fluid.order": "4"})]
SOLVERS = [
    ("amg", {"fluid.poisson.preconditioner": '"amg"'}),
    ("direct", {"fluid.poisson.preconditioner": '"direct"'}),
    ("jacobi", {"fluid.poisson.preconditioner": '"jacobi"'}),
]
# Δt by the spacing [s/m]; the largest Courant number Σ|u_c|Δt/h is about 3.4 times that.
STEPS = (0.08, 0.16, 0.32)


def run(n, step, settings):
    h = 2 * np.pi / n
    count = int(np.ceil(END / (step * h)))
    common = {
        "mesh.cells": f"[{n}, {n}, 1]",
        "mesh.size": f"[{2 * np.pi!r}, {2 * np.pi!r}, {h!r}]",
        "time.step": repr(END / count),
        "output.vtk.interval": repr(END),
        "output.series.every": "1000000",
    }
    summary = harness.fibreflow(CASE, common | settings)
    return {
        "nodes": summary["fluid"]["nodes"],
        "steps": summary["steps"],
        "error_l2": summary["errors"]["velocity_l2"],
        "error_max": summary["errors"]["velocity_max"],
        "seconds": summary["timings"]["fluid"],
        "us_per_node_step": summary["fluid"]["seconds_per_node_step"] * 1e6,
        "poisson_iterations": summary["fluid"]["poisson_iterations_mean"],
    }


def lower_envelope(points):
    """Of (time, error) those that nothing faster beats, by time."""
    best, front = np.inf, []
    for seconds, error in sorted(points):
        if error < best:
            best = error
            front.append((seconds, error))
    return front


def draw(rows, path):
    figure, axis = plt.subplots(figsize=(8, 6))
    kinds = list(dict.fromkeys((row["mesh"], row["order"], row["solver"]) for row in rows))
    colours = {mesh: f"C{k}" for k, (mesh, _) in enumerate(MESHES)}
    styles = {"amg": "-", "direct": "--", "jacobi": ":"}
    for mesh, order, solver in kinds:
        points = [(r["seconds"], r["error_l2"]) for r in rows if (r["mesh"], r["order"], r["solver"]) == (mesh, order, solver)]
        marker = "o" if order == "second order" else "s"
        axis.loglog(*zip(*points), marker, ms=3, color=colours[mesh], alpha=0.4)
        axis.loglog(*zip(*lower_envelope(points)), styles[solver] + marker, ms=5, color=colours[mesh],
                    mfc="none" if order == "fourth order" else None, label=f"{mesh}, {order}, {solver}")
    axis.set(xlabel="wall time [s]", ylabel="L2 error of the velocity, by the amplitude",
             title="Drifting Taylor–Green vortices, one rank")
    axis.grid(True, which="major", alpha=0.3)
    axis.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="N to 32, one time step: seconds")
    parser.add_argument("--full", action="store_true", help="N = 128 on all meshes, Jacobi too")
    parser.add_argument("--out", type=pathlib.Path, default=harness.ROOT / "runs" / "bench" / "fluid")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    bandwidth = harness.stream()
    rows, refused = [], set()
    for mesh, of_mesh in MESHES:
        for order, of_order in ORDERS:
            if order == "fourth order" and mesh != "hexahedra":
                continue
            for solver, of_solver in SOLVERS:
                if (solver == "direct" and mesh != "hexahedra") or (solver == "jacobi" and not options.full):
                    continue
                largest = 32 if options.quick else 128 if options.full or mesh == "hexahedra" else 64
                for n in (16, 32, 64, 128):
                    for step in STEPS[1:2] if options.quick else STEPS:
                        if n > largest or (mesh, order, solver) in refused:
                            continue
                        label = f"{mesh}, {order}, {solver}"
                        found = harness.attempt(label, run, n, step, of_mesh | of_order | of_solver)
                        if found is None:
                            refused.add((mesh, order, solver))
                            continue
                        rows.append({"mesh": mesh, "order": order, "solver": solver, "n": n, "step_by_spacing": step} | found)
                        print(f"  {label}, N = {n}, Δt = {step} h: {found['error_l2']:.2e} in {found['seconds']:.2f} s", flush=True)
    harness.write_csv(options.out / "fluid.csv", rows)
    draw(rows, options.out / "fluid.png")
    print()
    middle = [row for row in rows if row["step_by_spacing"] == STEPS[1]]
    harness.table(middle, [("mesh", "mesh", ""), ("order", "order", ""), ("solver", "solver", ""), ("n", "N", "d"),
                           ("error_l2", "L2", ".2e"), ("seconds", "s", ".2f"), ("us_per_node_step", "µs by node·step", ".2f"),
                           ("poisson_iterations", "pressure iterations", ".1f")])
    line = harness.machine(bandwidth)
    (options.out / "machine.txt").write_text(line + "\n")
    print(f"\n{line}\nresults in {options.out}")


if __name__ == "__main__":
    main()
