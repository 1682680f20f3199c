"""Shared by the benches: run a case, ask for bandwidth and machine, write tables.

Options that a build does not know yet are refused by `fibreflow` with exit code 2; the benches then say so and go on.
"""

import argparse
import csv
import datetime
import json
import os
import pathlib
import platform
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
# FIBREFLOW in the environment is another build of the program.
PROGRAM = pathlib.Path(os.environ.get("FIBREFLOW", TARGET / "release" / "fibreflow"))
STREAM = TARGET / "release" / "examples" / "stream"
# Set by the scripts where the build has no MPI: ranks then become threads.
EMBEDDED = os.environ.get("FIBREFLOW_EMBEDDED") == "1"
# Waiting ranks give way, so that a busy machine does not multiply times; kept the same for all programs that are compared.
MPI_FLAGS = os.environ.get("MPI_FLAGS", "--oversubscribe --bind-to none --mca mpi_yield_when_idle 1").split()


def environment(threads=1):
    own = {
        "RAYON_NUM_THREADS": str(threads),
        "OMP_NUM_THREADS": "1",
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_btl_vader_eager_limit": "65536",
    }
    return os.environ | own


def launch(ranks, command):
    """Command line of a program on so many ranks."""
    if ranks == 1 or EMBEDDED:
        return command
    return ["mpirun", *MPI_FLAGS, "-n", str(ranks), *command]


class Refused(Exception):
    """The build does not know an option, or the case is not valid."""


def fibreflow(case, settings, ranks=1, steps=None, out=None):
    """Runs a case; settings are `--set` keys with TOML values. Returns summary.json as a dictionary."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(out or folder)
        command = [str(PROGRAM), "run", str(case), "--out", str(out)]
        command += ["--steps", str(steps)] if steps else []
        command += [f"--set={key}={value}" for key, value in settings.items()]
        run = subprocess.run(
            launch(ranks, command),
            env=environment(ranks if EMBEDDED else 1),
            capture_output=True,
            text=True,
        )
        if run.returncode != 0:
            lines = [line for line in (run.stderr + run.stdout).splitlines() if line.strip()]
            what = next((line for line in lines if "rror" in line), lines[-1] if lines else "no message")
            raise Refused(what.strip())
        return json.loads((out / "summary.json").read_text())


def hard_cases(about, cases, run, line, name):
    """Command line of a script of hard cases: `run(case, steps)` gives a row, `line` formats it. Writes name.csv; returns the exit code."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(cases))
    parser.add_argument("--steps", type=int, default=10000)
    parser.add_argument("--quick", action="store_true", help="300 steps")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "validate" / name)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for case in options.names or cases:
        row = run(case, 300 if options.quick else options.steps)
        rows.append(row)
        write_csv(options.out / f"{name}.csv", rows)
        stop = "{case}: stopped after {steps} steps: {stopped}"
        print("  " + (stop if row["stopped"] else line).format(**row), flush=True)
    (options.out / "machine.txt").write_text(machine({}) + "\n")
    stopped = [row["case"] for row in rows if row["stopped"]]
    if stopped:
        print(f"stopped: {', '.join(stopped)}")
    return 1 if stopped else 0


def attempt(label, function, *arguments, **named):
    """The function's answer, or None with a line that says why there is none."""
    try:
        return function(*arguments, **named)
    except Refused as refusal:
        print(f"  {label}: not run: {refusal}", flush=True)
        return None


def stream(threads=2):
    """STREAM triad by number of threads [GB/s]; empty where the example is not built."""
    if not STREAM.exists():
        return {}
    lines = subprocess.run([STREAM, str(threads)], capture_output=True, text=True, check=True).stdout.splitlines()
    return {int(row["threads"]): float(row["gb_per_s"]) for row in csv.DictReader(lines)}


def machine(bandwidth):
    """One line: what the figures were measured on."""
    model = platform.processor() or platform.machine()
    for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            model = line.split(":", 1)[1].strip()
            break
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout.strip()
    triad = ", ".join(f"{rate:.1f} GB/s on {threads}" for threads, rate in bandwidth.items()) or "not measured"
    load = os.getloadavg()[0]
    quiet = "" if load < 0.5 else " (not quiet: times are provisional)"
    return (
        f"{datetime.date.today()}, {model}, {os.cpu_count()} cores, STREAM triad {triad}, "
        f"load average at the end {load:.1f}{quiet}, version {commit or 'unknown'}"
    )


def write_csv(path, rows):
    """Rows are dictionaries; columns in the order of first appearance."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def table(rows, columns):
    """Prints rows as a table; columns are (key, heading, format)."""
    cells = [[heading for _, heading, _ in columns]]
    for row in rows:
        values = (row.get(key) for key, _, _ in columns)
        cells.append(["" if v is None else format(v, f) for v, (_, _, f) in zip(values, columns)])
    widths = [max(len(line[k]) for line in cells) for k in range(len(columns))]
    for k, line in enumerate(cells):
        print("  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip())
        if k == 0:
            print("  ".join("-" * width for width in widths))
