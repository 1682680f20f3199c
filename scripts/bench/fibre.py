"""Our fibres beside YADE and PyElastica: scripts/bench/fibre [--quick] [--full] [--only PART,PART] [--out DIR]

Error against wall time, one thread: a cantilever under PL²/EI = 5 (static; each code relaxes as its users do), the first mode
over twenty periods, and a stiff fibre that bends in oscillating water: E = 20 and 100 GPa, r_p = 50 and 200, error of the
deflection over five periods (relative L2) against Euler–Bernoulli's modes; points of one code are segments, of the implicit
one lengths of the step. Statics and frequencies are compared with the
theory that each program discretises: with shear for ours (frequency) and PyElastica, without for YADE.

Throughput: segments times sub-steps by second on one and two threads: 1000 fibres of 20 segments, dilute (0.1 %) and at 5 and
15 % with contacts, beside YADE; 10⁴ to 10⁶ segments of ours (`sizes`). Sub-steps differ in length (`substep`).

Results: fibre-curves.csv, fibre-throughput.csv, fibre.png and machine.txt in --out (default runs/bench/fibre). PyElastica
runs only the first part of a flexure, its time is scaled; --full runs all of it.
"""

import argparse
import csv
import io
import os
import pathlib
import shutil
import subprocess
import tempfile

import fibre_scenes as scenes
import harness
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

EXAMPLES = harness.TARGET / "release" / "examples"
HERE = pathlib.Path(__file__).parent
YADE = shutil.which("yade")
PEER_PYTHON = pathlib.Path(os.environ.get("FIBRE_PEER_VENV", "")) / "bin" / "python"
PARTS = ["cantilever", "vibration", "flexure", "throughput", "sizes"]
STIFF = [(20e9, 50), (20e9, 200), (100e9, 50), (100e9, 200)]
PERIODS = 20
KAPPA = 27 / 28


def output(command, threads=1, **more):
    own = {"RAYON_NUM_THREADS": str(threads), "OMP_NUM_THREADS": str(threads), "NUMBA_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    run = subprocess.run([str(word) for word in command], env=os.environ | own | more, capture_output=True, text=True)
    if run.returncode != 0:
        raise harness.Refused(((run.stderr + run.stdout).strip().splitlines() or ["no message"])[-1])
    return run.stdout


def row_of(text):
    """The last two lines as heading and numbers."""
    row = next(csv.DictReader(io.StringIO("\n".join(text.strip().splitlines()[-2:]))))
    return {key: float(value) for key, value in row.items() if value}


def yade(*words, threads=1):
    command = [YADE, "-n", "-x", f"-j{threads}", HERE / "fibre_yade.py", *words]
    return row_of(output(command, threads, PYTHONPATH=str(HERE)))


def pyelastica(*words):
    return row_of(output([PEER_PYTHON, HERE / "fibre_elastica.py", *words]))


def beams(scene, integrator, segments, *numbers):
    """Wall time, sub-steps and history of our example."""
    lines = output([EXAMPLES / "beams", scene, integrator, segments, *map(repr, numbers)]).splitlines()
    seconds, substeps = map(float, lines[1].split(","))
    history = [tuple(map(float, line.split(","))) for line in lines[2:]]
    return {"n": segments, "seconds": seconds, "steps": substeps}, history


def cantilever(options):
    bare, sheared = scenes.elastica(scenes.SOFT), scenes.elastica(scenes.SOFT, kappa=KAPPA)

    def ours(integrator):
        def run(n):
            row, [(x, y, _)] = beams("cantilever", integrator, n, 5.0)
            return row | {"x": x, "y": y}

        return run

    counts = (8, 16, 32, 64)
    peers = [("ours, explicit", ours("explicit"), bare, counts), ("ours, implicit", ours("implicit"), bare, counts),
             ("ours, without twist", ours("twist-free"), bare, counts)]  # fmt: skip
    if YADE:
        peers.append(("YADE", lambda n: yade("cantilever", n), bare, (8, 16, 32, 64)))
    if PEER_PYTHON.exists():
        peers.append(("PyElastica", lambda n: pyelastica("cantilever", n), sheared, (10, 20)))
    for code, function, (x, y), counts in peers:
        for n in counts[:2] if options.quick else counts:
            found = harness.attempt(f"{code}, {n}", function, n)
            if found:
                error = abs(found["y"] / y - 1)
                yield {"case": "cantilever", "code": code, "error": error, "tip_error": float(np.hypot(found["x"] - x, found["y"] - y))} | found


def vibration(options):
    def ours(integrator, steps):
        def run(n):
            step = scenes.SOFT.period / steps
            row, history = beams("vibration", integrator, n, step, (PERIODS + 0.6) * scenes.SOFT.period)
            return row | scenes.frequency_and_drift(scenes.SOFT, history, PERIODS, scenes.TIMOSHENKO)

        return run

    peers = [("ours, explicit", ours("explicit", 200), (8, 16, 32, 64)), ("ours, implicit, T/200", ours("implicit", 200), (8, 16, 32)),
             ("ours, implicit, T/800", ours("implicit", 800), (8, 16, 32))]  # fmt: skip
    if YADE:
        peers.append(("YADE", lambda n: yade("vibration", n), (8, 16, 32)))
    if PEER_PYTHON.exists():
        peers.append(("PyElastica", lambda n: pyelastica("vibration", n, 3), (10, 20, 40)))
    for code, function, counts in peers:
        for n in counts[:2] if options.quick else counts:
            found = harness.attempt(f"{code}, {n}", function, n)
            if found:
                yield {"case": "vibration", "code": code} | found


def flexure(options):
    for modulus, ratio in STIFF[1:2] if options.quick else STIFF:
        fibre = scenes.stiff(modulus, ratio)

        def ours(integrator, step):
            def run(n):
                row, history = beams("flexure", integrator, n, step, scenes.SAMPLE, scenes.DURATION, modulus, float(ratio))
                return row | {"error": scenes.history_error(fibre, [line[:2] for line in history])}

            return run

        # The implicit ones by the length of their steps instead of that of their segments.
        steps = (1e-4, 5e-5, 2e-5, 1e-5)
        # The flow is linear within a step: a fifth of the fluid's keeps that error out.
        peers = [("ours, explicit", ours("explicit", scenes.SAMPLE / 5), (8, 16, 32))]
        for step in steps[:1] if options.quick else steps:
            peers.append(("ours, implicit", ours("implicit", step), (32,)))
        peers.append(("ours, implicit, error control", ours("1e-3", scenes.SAMPLE), (32,)))
        peers.append(("ours, without twist, error control", ours("twist-free:1e-3", scenes.SAMPLE), (32,)))
        if YADE:
            peers.append(("YADE", lambda n: yade("flexure", modulus, ratio, n, 1.0), (8, 16, 32)))
        if PEER_PYTHON.exists():
            part = 1.0 if options.full else 0.01
            peers.append(("PyElastica", lambda n: pyelastica("flexure", modulus, ratio, n, part), (32,)))
        for code, function, counts in peers:
            for n in counts[:1] if options.quick else counts:
                found = harness.attempt(f"{code}, {n}", function, n)
                if found:
                    yield {"case": f"flexure, {modulus / 1e9:.0f} GPa, r_p = {ratio}", "code": code} | found


CURVES = {"cantilever": cantilever, "vibration": vibration, "flexure": flexure}


def throughput(options, parts, folder):
    """Rows of ours and theirs; scenes are written once."""

    def scene(fibres, fraction):
        path = folder / f"{fibres}-{fraction}.csv"
        if not path.exists():
            # Seeds and the gap of the dilute scene as they have always been.
            dilute = fraction < 0.01
            scenes.write_suspension(path, fibres, fraction, 1 if dilute else 2, 1.1 if dilute else 0.0)
        return path

    def ours(fibres, fraction, kind, threads, substeps):
        return row_of(output([EXAMPLES / "throughput", scene(fibres, fraction), 20, substeps, kind], threads))

    def theirs(fibres, fraction, kind, threads, substeps):
        return yade("throughput", scene(fibres, fraction), 20, substeps, kind, threads=threads)

    scale = 10 if options.quick else 1
    runs = []
    if "throughput" in parts:
        for threads in (1, 2):
            for fraction, kind in ((0.001, "free"), (0.001, "contact"), (0.05, "contact"), (0.15, "contact")):
                runs.append(("ours", ours, 1000, fraction, kind, threads, 2000 // scale))
            if YADE:
                for fraction, kind in ((0.001, "free"), (0.05, "contact"), (0.15, "contact"))[: 3 if options.full else 2]:
                    runs.append(("YADE", theirs, 1000, fraction, kind, threads, 300 // scale))
    if "sizes" in parts:
        for fibres, substeps in ((500, 2000), (5000, 400), (50000, 100)):
            for fraction, kind in ((0.05, "free"), (0.05, "contact"), (0.15, "contact")):
                runs += [("ours", ours, fibres, fraction, kind, threads, substeps // scale) for threads in (1, 2)]
    for code, function, fibres, fraction, kind, threads, substeps in runs:
        label = f"{code}, {fibres} fibres, {100 * fraction} %, {kind}, {threads} threads"
        found = harness.attempt(label, function, fibres, fraction, kind, threads, substeps)
        if found:
            print(f"  {label}: {found['segment_substeps_per_s'] / 1e6:.2f} M/s", flush=True)
            yield {"code": code, "fraction": fraction, "kind": kind} | found
    if PEER_PYTHON.exists() and "throughput" in parts:
        for rods in (100, 1000):
            found = harness.attempt(f"PyElastica, {rods}", pyelastica, "throughput", rods, 20, 200 // scale)
            if found:
                yield {"code": "PyElastica", "kind": "free"} | found


def draw(rows, path):
    cases = list(dict.fromkeys(row["case"] for row in rows))
    figure, axes = plt.subplots(2, (len(cases) + 1) // 2, figsize=(4 * ((len(cases) + 1) // 2), 7), squeeze=False)
    codes = list(dict.fromkeys(row["code"] for row in rows))
    for case, axis in zip(cases, axes.flat):
        for code in codes:
            points = [(r["seconds"], r["error"]) for r in rows if (r["case"], r["code"]) == (case, code) and "error" in r]
            if points:
                axis.loglog(*zip(*sorted(points)), "o-", ms=4, color=f"C{codes.index(code)}", label=code)
        axis.set(title=case, xlabel="wall time [s]", ylabel="relative error")
        axis.grid(True, which="major", alpha=0.3)
        axis.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="coarse fibres and a tenth of the steps: a minute")
    parser.add_argument("--full", action="store_true", help="whole histories by PyElastica, 15 % by YADE")
    parser.add_argument("--only", help=f"of {', '.join(PARTS)}, with commas between")
    parser.add_argument("--out", type=pathlib.Path, default=harness.ROOT / "runs" / "bench" / "fibre")
    options = parser.parse_args()
    parts = options.only.split(",") if options.only else PARTS
    options.out.mkdir(parents=True, exist_ok=True)
    if not YADE:
        print("YADE is not installed (Debian: apt-get install yade): without it")
    if not PEER_PYTHON.exists():
        print("PyElastica is not installed: without it")
    bandwidth = harness.stream()
    rows = []
    for part in [part for part in PARTS if part in parts and part in CURVES]:
        print(part, flush=True)
        for row in CURVES[part](options):
            error = f"{row['error']:.2e}" if "error" in row else "not known"
            print(f"  {row['case']}, {row['code']}, {row['n']:.0f} segments: error {error}, {row['seconds']:.3g} s", flush=True)
            rows.append(row)
        harness.write_csv(options.out / "fibre-curves.csv", rows)
    if rows:
        draw(rows, options.out / "fibre.png")
    if {"throughput", "sizes"} & set(parts):
        print("throughput", flush=True)
        with tempfile.TemporaryDirectory() as folder:
            speeds = list(throughput(options, parts, pathlib.Path(folder)))
        harness.write_csv(options.out / ("fibre-throughput.csv" if "throughput" in parts else "fibre-sizes.csv"), speeds)
        for row in speeds:
            row["millions"] = row["segment_substeps_per_s"] / 1e6
        print()
        harness.table(speeds, [("code", "code", ""), ("kind", "", ""), ("fraction", "fraction", ".3f"), ("segments", "segments", ".0f"),
                               ("threads", "threads", ".0f"), ("millions", "M segment·sub-steps/s", ".2f"), ("substep", "sub-step s", ".2e"),
                               ("contacts_start", "contacts", ".0f"), ("contacts_end", "at the end", ".0f"),
                               ("max_overlap", "overlap/d", ".2f")])  # fmt: skip
    line = harness.machine(bandwidth)
    (options.out / "machine.txt").write_text(line + "\n")
    print(f"\n{line}\nresults in {options.out}")


if __name__ == "__main__":
    main()
