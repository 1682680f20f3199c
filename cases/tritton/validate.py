"""Deflection of clamped fibres in an air stream (C4): .venv/bin/python cases/tritton/validate.py

    [--quick]     8 and 16 segments
    [--out DIR]   default runs/validate/tritton

All six rows of table 5.2 with 8 to 64 segments, beside the beam with the same drag law, experiment and Kunhappan's simulation. Writes
tritton.csv, segments.csv, tritton.png.
"""

import argparse
import csv
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "bench"))

import harness
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

HERE = pathlib.Path(__file__).resolve().parent
DENSITY, VISCOSITY = 1.205, 1.81e-5


def tomotika(re):
    """K 4.21a with the factor 1/Re that it lacks."""
    s = 2.0022 - np.log(re)
    return 8 * np.pi / (re * s) * (1 - (s * s - s / 2 + 5 / 16) / (32 * s) * re**2)


def normal_coefficient(re):
    """K 4.21–4.23 with the errata."""
    if re < 0.1:
        return tomotika(re)
    if re < 100:
        return 2 * np.exp(np.polyval([3.5015e-3, 3.3287e-2, -6.722e-1, 1.6911], np.log(re)))
    return 4 / np.sqrt(re) + 1


def axial_coefficient(re):
    """The same, above 0.1."""
    if re < 100:
        return 2 * np.exp(np.polyval([7.4966e-4, 1.4884e-2, -6.8479e-1, 1.1552], np.log(re)))
    return 4 / np.sqrt(re)


def beam(fibre, speed, points=2001):
    """Tip deflection of an inextensible Euler–Bernoulli beam at any deflection, drag by the local angle: θ' = M/EI by
    successive substitution, M(s) the moment of the drag beyond s."""
    length, diameter = fibre.l_f_cm * 1e-2, fibre.d_f_cm * 1e-2
    bending = fibre.E_GPa * 1e9 * np.pi * diameter**4 / 64
    s = np.linspace(0, length, points)
    ds = s[1]
    unit = 0.5 * DENSITY * diameter

    def integral(f):
        return np.concatenate([[0], np.cumsum(0.5 * (f[1:] + f[:-1]) * ds)])

    angle = np.zeros(points)
    for _ in range(200):
        # Clamped along y, stream along x: tangent (sin, cos), normal (cos, −sin).
        sine, cosine = np.sin(angle), np.cos(angle)
        across, along = speed * cosine, speed * sine
        re = DENSITY * diameter * across / VISCOSITY
        normal = unit * across**2 * np.array([normal_coefficient(r) for r in re])
        axial = unit * across * along * np.array([axial_coefficient(r) for r in re])
        force_x, force_y = normal * cosine + axial * sine, -normal * sine + axial * cosine
        x, y = integral(sine), integral(cosine)

        def beyond(f):
            total = integral(f)
            return total[-1] - total

        # Turning towards x.
        moment = beyond(force_x * y) - y * beyond(force_x) - (beyond(force_y * x) - x * beyond(force_y))
        new = integral(moment / bending)
        change = np.max(np.abs(new - angle))
        angle = new
        if change < 1e-12:
            break
    return integral(np.sin(angle))[-1], length - integral(np.cos(angle))[-1]


def small_deflection(fibre, speed, re):
    """K 5.1 with F = ½ρU²d C_n, and Tomotika's law to Re = 1, as the table was made."""
    diameter = fibre.d_f_cm * 1e-2
    force = 0.5 * DENSITY * speed**2 * diameter * (tomotika(re) if re < 1 else normal_coefficient(re))
    return 8 * force * (fibre.l_f_cm * 1e-2) ** 4 / (np.pi * fibre.E_GPa * 1e9 * diameter**4)


def run(fibre, speed, segments, law):
    speed = float(speed)
    settings = {
        "ambient.flow.velocity": f"[{speed!r}, 0.0, 0.0]",
        "fibres.0.placement.end": f"[0.0, {float(fibre.l_f_cm) * 1e-2!r}, 0.0]",
        "fibres.0.diameter": repr(float(fibre.d_f_cm) * 1e-2),
        "fibres.0.youngs_modulus": repr(float(fibre.E_GPa) * 1e9),
        "fibres.0.segments": str(segments),
        "hydrodynamics.drag": f'"{law}"',
    }
    with tempfile.TemporaryDirectory() as folder:
        harness.fibreflow(HERE / "case.toml", settings, out=folder)
        tip = pd.read_csv(pathlib.Path(folder) / "series" / "fibre_0.csv").end_to_end_x
    # Still.
    assert abs(tip.iloc[-1] / tip.iloc[-3] - 1) < 1e-6, (fibre.name, segments, list(tip[-4:]))
    return tip.iloc[-1]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--out", type=pathlib.Path, default=harness.ROOT / "runs" / "validate" / "tritton")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    segments = [8, 16] if options.quick else [8, 16, 32, 64]
    fibres = pd.read_csv(HERE / "reference" / "table_5_1_tritton_fibres.csv").set_index("fibre")
    table = pd.read_csv(HERE / "reference" / "table_5_2_tritton_deflection.csv")
    rows, by_segments, missed = [], [], []
    for entry in table.itertuples():
        fibre = fibres.loc[entry.fibre]
        diameter = fibre.d_f_cm * 1e-2
        speed = entry.Re * VISCOSITY / (DENSITY * diameter)
        exact = beam(fibre, speed)[0] * 100
        found = {}
        for law in ("infinite-cylinder", "prolate-spheroid"):
            for n in segments:
                found[law, n] = run(fibre, speed, n, law) * 100
                by_segments.append([entry.fibre, entry.Re, law, n, found[law, n], found[law, n] / exact - 1])
        ours = found["infinite-cylinder", segments[-1]]
        worst = max(abs(found["infinite-cylinder", n] / exact - 1) for n in segments)
        spread = [found["prolate-spheroid", n] for n in (segments[0], segments[-1])]
        row = {
            "fibre": entry.fibre, "Re": entry.Re, "ours_cm": ours, "beam_cm": exact, "small_deflection_cm": small_deflection(fibre, speed, entry.Re) * 100,
            "analytical_table_cm": entry.h_analytical_cm, "experiment_cm": entry.h_exp_cm, "kunhappan_cm": entry.h_sim_cm,
            "ours_by_beam": ours / exact - 1, "worst_of_all_segments": worst, "ours_by_experiment": ours / entry.h_exp_cm - 1,
            "kunhappan_by_experiment": entry.h_sim_cm / entry.h_exp_cm - 1,
            f"spheroid_{segments[0]}_cm": spread[0], f"spheroid_{segments[-1]}_cm": spread[1],
        }
        rows.append(row)
        print(", ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in row.items()), flush=True)
        if worst > 0.02:
            missed.append(f"{entry.fibre} at Re {entry.Re}: {worst:.2%} from the beam")
        if abs(row["small_deflection_cm"] / entry.h_analytical_cm - 1) > 0.025:
            missed.append(f"{entry.fibre} at Re {entry.Re}: K 5.1 gives {row['small_deflection_cm']:.4f}, the table {entry.h_analytical_cm}")
    harness.write_csv(options.out / "tritton.csv", [{k: f"{v:.5g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows])
    with open(options.out / "segments.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["fibre", "Re", "law", "segments", "tip_cm", "by_beam"])
        writer.writerows([*row[:4], f"{row[4]:.6f}", f"{row[5]:.5f}"] for row in by_segments)

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4))
    data = pd.DataFrame(rows)
    place = np.arange(len(data))
    for k, (name, label) in enumerate([("ours_cm", f"fibreflow, {segments[-1]} segments"), ("beam_cm", "beam, same law"), ("kunhappan_cm", "Kunhappan's simulation"),
                                       (f"spheroid_{segments[0]}_cm", f"spheroids, {segments[0]} segments"), (f"spheroid_{segments[-1]}_cm", f"spheroids, {segments[-1]}")]):
        left.plot(place, data[name] / data.experiment_cm, "osD^v"[k], mfc="none", label=label)
    left.axhline(1, color="k", lw=0.8)
    left.set_xticks(place, [f"{r.fibre}\nRe {r.Re:g}" for r in data.itertuples()], fontsize=7)
    left.set_ylabel("deflection by experiment")
    left.legend(fontsize=7)
    table = pd.DataFrame(by_segments, columns=["fibre", "Re", "law", "segments", "tip", "off"])
    for k, entry in enumerate(data.itertuples()):
        for law, style in (("infinite-cylinder", "o-"), ("prolate-spheroid", "^:")):
            part = table[(table.fibre == entry.fibre) & (table.Re == entry.Re) & (table.law == law)]
            right.semilogx(part.segments, part.tip / entry.beam_cm, style, color=f"C{k}", mfc="none",
                           label=f"{entry.fibre}, Re {entry.Re:g}" if law[0] == "i" else None)
    right.set_xticks(segments, segments)
    right.minorticks_off()
    right.set_xlabel("segments (dotted: spheroids)")
    right.set_ylabel("deflection by the beam's")
    right.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(options.out / "tritton.png", dpi=110)
    for line in missed:
        print("missed:", line)
    sys.exit(bool(missed))


if __name__ == "__main__":
    main()
