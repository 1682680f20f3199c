"""Angular velocity and period of a rigid fibre in a shear cell on three meshes and in three directions to them.

    cases/shear-jeffery-two-way/orbit.py PROGRAM OUT    # writes OUT/orbit.csv, OUT/orbit.png, prints a table

Every run is two steps of a fibre at one angle; the period is that of the orbit φ' = −(A s² + B c² + 2C s c) fitted to the
angular velocities, s = sin φ, c = cos φ: T = 2π/√(AB − C²). Jeffery's has A = r²/(r² + 1), B = 1/(r² + 1), C = 0.
"""

import csv
import math
import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

CASE = Path(__file__).with_name("case.toml")
MESHES = {0.5: 1, 1: 2, 2: 4}
DIRECTIONS = [0.0, 22.5, 45.0]
ANGLES = [-8.0, 0.0, 8.0, 45.0, 90.0]
COUPLINGS = {
    "gaussian, undisturbed": ["coupling.correction=undisturbed"],
    "gaussian, as it is": ["coupling.correction=none"],
    "element": ["coupling.kernel=element", "coupling.correction=none"],
}
CENTRE = np.array([1.125, 1.0, 1.125])


def turning(program, out, refine, direction, angle, coupling):
    """Angular velocity in the plane of shear, by the shear rate."""
    a, phi = math.radians(direction), math.radians(angle)
    flow = np.array([math.cos(a), 0.0, math.sin(a)])
    along = math.cos(phi) * flow + math.sin(phi) * np.array([0.0, 1.0, 0.0])
    # Off the nodes, the same place on every mesh.
    middle = CENTRE + np.array([0.031, 0.017, 0.043])
    start, end = (list(middle + s * 0.5 * along) for s in (-1, 1))
    wall = list(map(float, flow))
    sets = [
        f"mesh.cells=[{9 * refine}, {8 * refine}, {9 * refine}]",
        f"fibres.0.placement.start={[float(x) for x in start]}",
        f"fibres.0.placement.end={[float(x) for x in end]}",
        f"fluid.boundaries.y_max.velocity={wall}",
        f"fluid.boundaries.y_min.velocity={[-w for w in wall]}",
        *COUPLINGS[coupling],
    ]
    if coupling == "element":
        text = CASE.read_text().replace("width = 0.5", "#")
    else:
        text = CASE.read_text()
    case = out / "case.toml"
    case.write_text(text)
    command = [program, "run", case, "--out", out / "run"]
    for s in sets:
        command += ["--set", s]
    subprocess.run(command, check=True, capture_output=True)
    name = out / "run" / "series" / "fibre_0.csv"
    with open(name) as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    keys = [k for k in rows[0] if "end_to_end" in k]
    points = [np.array([float(r[k]) for k in keys]) for r in rows[-2:]]
    angles = [math.atan2(p[1], p @ flow) for p in points]
    time = float(rows[-1]["time"]) - float(rows[-2]["time"])
    return (angles[1] - angles[0]) / time


def period(angles, rates):
    s, c = np.sin(np.radians(angles)), np.cos(np.radians(angles))
    basis = np.stack([s * s, c * c, 2 * s * c], 1)
    rates = -np.array(rates)
    weights = 1 / np.abs(rates)
    a, b, m = np.linalg.lstsq(basis * weights[:, None], rates * weights, rcond=None)[0]
    return 2 * math.pi / math.sqrt(a * b - m * m), (a, b, m)


def main(program, out):
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    cox = 1.24 * 16 / math.sqrt(math.log(16))
    jeffery = 2 * math.pi * (cox + 1 / cox)
    rows, found = [], {}
    for coupling in COUPLINGS:
        for ratio, refine in MESHES.items():
            for direction in DIRECTIONS:
                rates = [turning(program, out, refine, direction, a, coupling) for a in ANGLES]
                t, _ = period(ANGLES, rates)
                found[coupling, ratio, direction] = t
                rows.append([coupling, ratio, direction, t, *rates])
                print(f"{coupling:24} ratio {ratio:<4} {direction:5}°: T = {t:.3f}, {t / jeffery:.4f} of Cox's", flush=True)
    with open(out / "orbit.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["coupling", "segment_by_element", "direction", "period", *(f"rate_{a:g}" for a in ANGLES)])
        writer.writerows(rows)
    figure, axis = plt.subplots(figsize=(6, 3.6))
    for k, coupling in enumerate(COUPLINGS):
        values = np.array([[found[coupling, r, d] for d in DIRECTIONS] for r in MESHES]) / jeffery
        spread = values.max() / values.min() - 1
        print(f"{coupling}: spread {100 * spread:.2f} %")
        for d, direction in enumerate(DIRECTIONS):
            axis.plot(list(MESHES), values[:, d], f"C{k}" + "os^"[d] + "-", ms=4, lw=1, label=f"{coupling}" if d == 0 else None)
    axis.axhline(1, color="k", lw=0.6)
    axis.set_xscale("log", base=2)
    axis.set_xlabel("segment length / element size")
    axis.set_ylabel("period / Jeffery's with Cox's $r_e$")
    axis.legend(frameon=False)
    figure.tight_layout()
    figure.savefig(out / "orbit.png", dpi=150)


if __name__ == "__main__":
    main(*sys.argv[1:3])
