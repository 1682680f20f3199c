"""Dispersion of a floc in linear flows (D2): .venv/bin/python cases/floc-dispersion/validate.py

    [--quick]         strain 2
    [--strain S]      default 30
    [--floc RUN]      run of cases/flocculation that has the floc; default: one is made, to a strain of 200
    [--out DIR]       default runs/validate/floc-dispersion

The largest floc of a sheared suspension, alone in shear, uniaxial and planar extension of the same √(2E:E), and in shear with softer fibres and less friction.
Writes dispersion.csv and dispersion.png: the share of the floc's fibres in its largest fragment.
"""

import argparse
import csv
import pathlib
import shutil
import subprocess
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import pandas as pd

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts" / "bench"))
import harness  # noqa: E402

HERE = pathlib.Path(__file__).resolve().parent
EXTENSION = {"ambient.flow": '{ kind = "extension", rate = 0.5773502691896258 }'}
PLANAR = {"ambient.flow": '{ kind = "planar-extension", rate = 0.5 }'}
MEMBERS = {
    "shear": {},
    "shear, S^eff = 0.0005": {"fibres.0.youngs_modulus": 322288.759761},
    "shear, μ = 1": {"contact.friction": 1.0},
    "uniaxial": EXTENSION,
    "planar": PLANAR,
}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--strain", type=float, default=30.0)
    parser.add_argument("--floc", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "validate" / "floc-dispersion")
    options = parser.parse_args()
    strain = 2.0 if options.quick else options.strain
    options.out.mkdir(parents=True, exist_ok=True)
    run = options.floc
    if run is None:
        run = options.out / "flocculation"
        harness.fibreflow(ROOT / "cases" / "flocculation" / "case.toml", {"time.end": 5.0 if options.quick else 200.0}, out=run)
    shutil.copy(HERE / "case.toml", options.out / "case.toml")
    subprocess.run([harness.PROGRAM, "post", "extract-floc", run, options.out / "floc.csv"], check=True)
    rows = []
    for name, settings in MEMBERS.items():
        folder = options.out / name.replace(" ", "_").replace(",", "").replace("^", "").replace("=", "")
        harness.fibreflow(options.out / "case.toml", {"time.end": strain} | settings, out=folder)
        data = pd.read_csv(folder / "series" / "structure.csv")
        plt.plot(data.time, data.largest_floc, label=name)
        at = [data.largest_floc[(data.time - strain * part).abs().idxmin()] for part in (0.25, 0.5, 1.0)]
        rows.append([name, *(f"{x:.3f}" for x in at)])
        print(*rows[-1], flush=True)
    plt.xlabel("strain")
    plt.ylabel("fibres in the largest fragment")
    plt.legend(fontsize=7)
    plt.savefig(options.out / "dispersion.png", dpi=120)
    with open(options.out / "dispersion.csv", "w", newline="") as file:
        csv.writer(file).writerows([["member", *(f"strain {strain * p:g}" for p in (0.25, 0.5, 1))], *rows])


if __name__ == "__main__":
    main()
