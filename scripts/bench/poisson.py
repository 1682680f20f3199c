"""Pressure solvers on the same matrices: scripts/bench/poisson [--quick] [--full] [--only CASE,CASE] [--ranks N]

Pure Neumann problems (walls across y, periodic otherwise), random right-hand side, from zero to a residual of 1e-8 of it;
conjugate gradients everywhere, stopped on the unpreconditioned residual, one thread a rank. Ours: `amg`, `deflation`,
`jacobi`, and `direct` where the mesh is a tensor product. Theirs: PETSc GAMG and hypre BoomerAMG at their defaults and at
what their manuals recommend in three dimensions; the faster of a peer's settings in set-up plus solve is marked. Set-up and
solve are the best of three. Results: poisson.csv and machine.txt in --out (default runs/bench/poisson).
"""

import argparse
import csv
import io
import pathlib
import subprocess
import tempfile

import harness

PROGRAM = harness.TARGET / "release" / "examples" / "poisson"
PEER = pathlib.Path(__file__).with_name("poisson_petsc.py")
PYTHON = "/usr/bin/python3"
TOLERANCE = "1e-8"
QUICK = ["uniform-32", "ratio-1000-32", "tetrahedra-40"]
USUAL = [
    "uniform-64",
    "tanh-20-96",
    "tanh-50-96",
    "ratio-1000-64",
    "tetrahedra-67",
    "tetrahedra-slivers-67",
    "tetrahedra-flat-20-67",
]
FULL = [*USUAL, "tanh-20-128", "tanh-50-128", "tetrahedra-flat-100-67", "hexahedra-jittered-48"]
# Jacobi takes thousands of iterations on the stretched ones.
METHODS = {"quick": "amg,direct,deflation,jacobi", "usual": "amg,direct,deflation", "full": "amg,direct,deflation,jacobi"}
HYPRE = ["-pc_type", "hypre", "-pc_hypre_type", "boomeramg"]
PEERS = {
    "gamg": ["-pc_type", "gamg"],
    "gamg, threshold 0.02, jacobi": ["-pc_type", "gamg", "-pc_gamg_threshold", "0.02", "-mg_levels_pc_type", "jacobi"],
    "boomeramg, threshold 0.25": [*HYPRE, "-pc_hypre_boomeramg_strong_threshold", "0.25"],
    "boomeramg, threshold 0.5": [*HYPRE, "-pc_hypre_boomeramg_strong_threshold", "0.5"],
    "boomeramg, 0.5, HMIS, ext+i, 4 a row": [
        *HYPRE,
        "-pc_hypre_boomeramg_strong_threshold", "0.5",
        "-pc_hypre_boomeramg_coarsen_type", "HMIS",
        "-pc_hypre_boomeramg_interp_type", "ext+i",
        "-pc_hypre_boomeramg_P_max", "4",
    ],
    "boomeramg, 0.5, one aggressive level": [
        *HYPRE,
        "-pc_hypre_boomeramg_strong_threshold", "0.5",
        "-pc_hypre_boomeramg_coarsen_type", "HMIS",
        "-pc_hypre_boomeramg_interp_type", "ext+i",
        "-pc_hypre_boomeramg_P_max", "4",
        "-pc_hypre_boomeramg_agg_nl", "1",
    ],
}  # fmt: skip


def output(ranks, command):
    run = subprocess.run(
        harness.launch(ranks, [str(part) for part in command]),
        env=harness.environment(ranks if harness.EMBEDDED else 1) | {"OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )
    if run.returncode != 0:
        raise harness.Refused(((run.stderr + run.stdout).strip().splitlines() or ["no message"])[-1])
    return run.stdout


def ours(case, methods, ranks):
    text = output(ranks, [PROGRAM, case, "--methods", methods, "--tolerance", TOLERANCE])
    for row in csv.DictReader(io.StringIO(text)):
        yield {
            "case": case,
            "ranks": ranks,
            "solver": f"ours, {row['method']}",
            "unknowns": int(row["unknowns"]),
            "iterations": int(row["iterations"]),
            "set_up": float(row["set_up"]),
            "solve": float(row["solve"]),
            "residual": float(row["residual"]),
        }


def theirs(case, matrix, unknowns, ranks):
    for name, settings in PEERS.items():
        try:
            line = output(ranks, [PYTHON, PEER, matrix, TOLERANCE, *settings]).strip().splitlines()[-1]
        except harness.Refused as refusal:
            print(f"  {case}, {name}: not run: {refusal}", flush=True)
            continue
        iterations, set_up, solve, residual, reason = line.split(",")
        yield {
            "case": case,
            "ranks": ranks,
            "solver": name,
            "unknowns": unknowns,
            "iterations": int(iterations),
            "set_up": float(set_up),
            "solve": float(solve),
            "residual": float(residual),
            "converged": int(reason) > 0,
        }


def peers_present():
    probe = subprocess.run([PYTHON, PEER, "--version"], capture_output=True, text=True)
    return probe.returncode == 0 and probe.stdout.strip()


def measure(case, methods, ranks, peers):
    """Rows of a case, the matrix in a file of its own between us and them."""
    with tempfile.TemporaryDirectory() as folder:
        rows = list(ours(case, methods, ranks))
        if peers:
            matrix = pathlib.Path(folder) / "matrix.bin"
            output(1, [PROGRAM, case, "--methods", "none", "--write", matrix])
            rows += theirs(case, matrix, rows[0]["unknowns"], ranks)
    for row in rows:
        row["us_per_unknown"] = 1e6 * (row["set_up"] + row["solve"]) / row["unknowns"]
        row["solve_us_per_unknown"] = 1e6 * row["solve"] / row["unknowns"]
    for peer in ("gamg", "boomeramg"):
        of_peer = [row for row in rows if row["solver"].startswith(peer) and row.get("converged")]
        if of_peer:
            min(of_peer, key=lambda row: row["us_per_unknown"])["best"] = "*"
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three small cases: seconds")
    parser.add_argument("--full", action="store_true", help="128³ and flat tetrahedra, Jacobi too")
    parser.add_argument("--only", help="names of cases, with commas between")
    parser.add_argument("--ranks", type=int, default=1)
    parser.add_argument("--out", type=pathlib.Path, default=harness.ROOT / "runs" / "bench" / "poisson")
    options = parser.parse_args()
    kind = "quick" if options.quick else "full" if options.full else "usual"
    cases = options.only.split(",") if options.only else {"quick": QUICK, "usual": USUAL, "full": FULL}[kind]
    peers = peers_present()
    if not peers:
        print("PETSc (python3-petsc4py-real) is not installed: ours alone")
    bandwidth = harness.stream()
    rows = []
    for case in cases:
        found = harness.attempt(case, measure, case, METHODS[kind], options.ranks, peers)
        rows += found or []
        print(f"  {case} done", flush=True)
        harness.write_csv(options.out / "poisson.csv", rows)
    print()
    harness.table(rows, [("case", "case", ""), ("unknowns", "unknowns", "d"), ("solver", "solver", ""), ("best", "", ""),
                         ("iterations", "iterations", "d"), ("set_up", "set-up s", ".3f"), ("solve", "solve s", ".3f"),
                         ("solve_us_per_unknown", "solve µs", ".2f"), ("us_per_unknown", "both µs", ".2f"),
                         ("residual", "residual", ".1e")])  # fmt: skip
    line = harness.machine(bandwidth) + (f", {peers}" if peers else "")
    (options.out / "machine.txt").write_text(line + "\n")
    print(f"\n{line}\nresults in {options.out}")


if __name__ == "__main__":
    main()
