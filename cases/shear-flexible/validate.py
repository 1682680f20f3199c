"""Shapes of a fibre in simple shear as it gets softer (C3): .venv/bin/python cases/shear-flexible/validate.py

    [--quick]     strain 60 instead of 120: the stiff do not turn over
    [--out DIR]   default runs/validate/shear-flexible

Six bending numbers, those of K figure 4.5 and 10. Writes shapes.csv, shapes.png.
"""

import argparse
import pathlib
import sys
import tempfile
import xml.etree.ElementTree as tree

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "bench"))

import harness
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pyvista

HERE = pathlib.Path(__file__).resolve().parent
NUMBERS = [10, 0.8, 0.04, 0.0075, 8.5e-4, 1.1e-4]
RATIO, VISCOSITY, RATE = 50.0, 1.0, 10.0


def modulus(number):
    """E of K 4.17: BR = E (ln 2r_p − 1.5)/(2 μ γ̇ r_p⁴)."""
    return 2 * VISCOSITY * RATE * RATIO**4 * number / (np.log(2 * RATIO) - 1.5)


def frames(number, end):
    """(strain, nodes by the fibre's length) of all pictures."""
    settings = {"fibres.0.youngs_modulus": repr(float(modulus(number))), "time.end": repr(end)}
    with tempfile.TemporaryDirectory() as folder:
        harness.fibreflow(HERE / "case.toml", settings, out=folder)
        out = []
        for entry in tree.parse(pathlib.Path(folder) / "fibres.pvd").iter("DataSet"):
            points = np.asarray(pyvista.read(pathlib.Path(folder) / entry.get("file")).points)[:, :2]
            out.append((RATE * float(entry.get("timestep")), points))
    length = np.sum(np.linalg.norm(np.diff(out[0][1], axis=0), axis=1))
    return [(strain, points / length) for strain, points in out]


def measures(points):
    """End-to-end distance, angle turned from end to end, angle turned without sign [rad], whether it bends both ways (S)."""
    chord = np.diff(points, axis=0)
    turn = np.diff(np.unwrap(np.arctan2(chord[:, 1], chord[:, 0])))
    left, right = turn[turn > 0].sum(), -turn[turn < 0].sum()
    return np.linalg.norm(points[-1] - points[0]), abs(turn.sum()), left + right, min(left, right)


def regime(ends, net, total, both):
    """What a fibre did, from the least of `ends` and the largest of the others over time.

    rigid: never bends by more than 0.3 rad. springy: bends one way, and is straight again between turns. s-turn: bends both ways at once by more
    than 45° each. coil: rolled up, turned by more than one and a half circles, its ends closer than a fifth of its length.
    """
    if total.max() < 0.3:
        return "rigid"
    if total.max() > 3 * np.pi and ends.min() < 0.2:
        return "coil"
    if both.max() > np.pi / 4:
        return "s-turn"
    return "springy"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--out", type=pathlib.Path, default=harness.ROOT / "runs" / "validate" / "shear-flexible")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows, seen = [], []
    figure, axes = plt.subplots(1, len(NUMBERS), figsize=(15, 4.5))
    for axis, number in zip(axes, NUMBERS):
        series = frames(number, 6.0 if options.quick else 12.0)
        found = np.array([measures(points) for _, points in series]).T
        kind = regime(*found)
        seen.append(kind)
        normal = 4 * np.pi / (np.log(2 * RATIO) + np.log(2) - 0.5)
        load = normal * VISCOSITY * RATE * RATIO**4 * 64 / (np.pi * modulus(number))
        rows.append({
            "bending_number": number, "load": f"{load:.4g}", "least_end_to_end": f"{found[0].min():.3f}", "largest_turn_rad": f"{found[2].max():.2f}",
            "largest_turn_both_ways_rad": f"{found[3].max():.2f}", "end_to_end_after_strain_half": f"{np.median(found[0][len(series) // 2:]):.3f}", "regime": kind,
        })
        print(rows[-1], flush=True)
        # Eight pictures of the first time round: by equal turns of the chord.
        chord = np.unwrap([np.arctan2(*(p[-1] - p[0])[::-1]) for _, p in series], period=2 * np.pi)
        turned = np.abs(chord - chord[0])
        bent = np.argmax(found[2] > 0.5 * found[2].max())
        if kind in ("rigid", "springy"):
            picks = [int(np.argmax(turned >= a)) for a in np.linspace(0, 0.95 * np.pi, 8)]
        else:
            picks = np.linspace(max(bent - 35, 0), min(bent + 30, len(series) - 1), 8).astype(int)
        for k, pick in enumerate(picks):
            strain, points = series[pick]
            middle = points.mean(axis=0)
            x, y = (points - middle).T
            axis.plot(x, y - 0.75 * k, color=plt.cm.viridis(k / 8), lw=1.5)
            axis.text(0.55, -0.75 * k, f"{strain:.1f}", fontsize=6, va="center")
        axis.set_title(f"BR = {number:g}\n{kind}", fontsize=9)
        axis.set_aspect("equal")
        axis.set_xlim(-0.7, 0.8)
        axis.axis("off")
    figure.suptitle("shapes about their middle, with the strain γ̇t; flow to the right above, to the left below", fontsize=9)
    figure.tight_layout()
    figure.savefig(options.out / "shapes.png", dpi=110)
    harness.write_csv(options.out / "shapes.csv", rows)
    order = ["rigid", "springy", "s-turn", "coil"]
    places = [order.index(kind) for kind in seen]
    if places != sorted(places) or set(places) != {0, 1, 2, 3}:
        print("missed: not rigid, springy, s-turn, coil in this order:", seen)
        sys.exit(1)


main()
