"""Centrelines of the cube against Albensoeder & Kuhlmann: .venv/bin/python cases/cavity-3d/validate.py [--quick] [--set K=V]… [--out DIR]

Each mesh starts from the flow of the one before. Writes cavity-3d.csv and profiles.png (default runs/validate/cavity-3d).
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
STRETCHING = 1.5
CENTRE = (0.5, 0.5, 0.5)


def ratio(n):
    """Of neighbouring spacings across: fine at the wall z = 0, 5.5 times as coarse at the plane of symmetry, as x and y."""
    return 5.5 ** (2.0 / n)


def axes(n):
    line = cavity.grid_lines(n, STRETCHING)
    steps = ratio(n) ** np.arange(n // 2)
    return [line, line, 0.5 * np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="16³ and 32³")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--times", type=float, nargs=2, default=(40.0, 15.0), help="on the first mesh, on further ones [s]")
    parser.add_argument("--out", type=pathlib.Path, default=harness.ROOT / "runs" / "validate" / "cavity-3d")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    tables = [cavity.reference(HERE / "reference" / f"albensoeder_kuhlmann_2005_re1000_{c}.csv") for c in "uv"]
    points = [(tables[0]["y"][1:-1], tables[0]["u"][1:-1]), (tables[1]["x"][1:-1], tables[1]["v"][1:-1])]
    extra = dict(setting.split("=", 1) for setting in options.set)
    figure, panels = plt.subplots(1, 2, figsize=(10, 4.5))
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        chain = cavity.Chain(HERE / "case.toml", {"output.series.every": "1"} | extra, axes, folder)
        for k, n in enumerate([16, 32] if options.quick else [16, 32, 64]):
            stretching = f'[{{ tanh = {STRETCHING} }}, {{ tanh = {STRETCHING} }}, {{ geometric = {ratio(n)!r} }}]'
            settings = {"mesh.stretching": stretching, "mesh.cells": f"[{n}, {n}, {n // 2}]",
                        "time.end": repr(options.times[min(k, 1)])}
            data, summary, change = chain.run(n, settings, ranks=2)
            off = [cavity.deviation(data, 1 - c, CENTRE, c, *points[c]) for c in (0, 1)]
            rows.append({
                "cells": n, "u_off": np.abs(off[0]).max(), "v_off": np.abs(off[1]).max(),
                "rms_off": np.sqrt(np.mean(np.concatenate(off) ** 2)), "energy_change_per_s": change,
                "steps": summary["steps"], "seconds": summary["wall_seconds"],
                "us_per_node_step": summary["fluid"]["seconds_per_node_step"] * 1e6,
            })
            print("  {cells}³: u {u_off:.2e}, v {v_off:.2e}, rms {rms_off:.2e}, energy changes {energy_change_per_s:.1e} "
                  "a second, {seconds:.0f} s".format(**rows[-1]), flush=True)
            harness.write_csv(options.out / "cavity-3d.csv", rows)
            for c in (0, 1):
                x, velocity, _ = lines.along(data, 1 - c, CENTRE)
                panels[c].plot(x, velocity[:, c], label=f"fibreflow, {n}³")
    for c, (name, at) in enumerate((("u", "y"), ("v", "x"))):
        panels[c].plot(*points[c], "ko", mfc="none", label="Albensoeder & Kuhlmann 2005")
        panels[c].set(xlabel=at, ylabel=name)
    panels[0].legend()
    figure.tight_layout()
    figure.savefig(options.out / "profiles.png", dpi=110)
    (options.out / "machine.txt").write_text(harness.machine({}) + "\n")
    print(f"results in {options.out}")


if __name__ == "__main__":
    main()
