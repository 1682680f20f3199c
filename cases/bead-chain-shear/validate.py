"""Orbit of stiff chains of beads in shear (E3): .venv/bin/python cases/bead-chain-shear/validate.py

The period is held against that of rigid chains of touching discs (discs.csv, from discs.py) and shown beside Jeffery's with L's e_c, which is that of round
cylinders in three dimensions. Writes periods.csv and periods.png.
"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "bench"))

import matplotlib
import members
import numpy as np
import pandas as pd

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HERE = pathlib.Path(__file__).resolve().parent
RATE, RADIUS, MODULUS = 0.01, 6.0, 7957.747154594767
MEMBERS = {f"N{n}": n for n in range(2, 10)}


def orbit(folder, count):
    """Angle of the chain from the direction across the flow, growing, by time."""
    beads, last = members.series(folder, "beads"), count - 1
    x, y = (beads[f"bead_{last}_{c}"] - beads[f"bead_0_{c}"] for c in "xy")
    return pd.Series(np.unwrap(np.arctan2(x, y)), index=beads.index)


def main():
    options = members.options(__doc__, "bead-chain-shear", MEMBERS, ["N2"])
    table = pd.read_csv(HERE / "jeffery.csv").set_index("aspect_ratio_e_p")
    discs = pd.read_csv(HERE / "discs.csv").set_index("beads")
    rows, missed = [], []
    for label in options.members:
        count = MEMBERS[label]
        start = 90.0 - RADIUS * (count - 1)
        chain = f"[{{ start = [90.0, {start}, 0.0], direction = [0.0, 1.0, 0.0], count = {count}, youngs_modulus = {MODULUS} }}]"
        reference = table.loc[count]
        end = 0.65 * reference.gammaT_with_e_p / RATE
        folder = members.run(options, HERE / "case.toml", label, {"beads.chains": chain, "time.end": end, "output.vtk.interval": end})
        beads = members.series(folder, "beads")
        if beads is None:
            missed.append(f"{label}: not run")
            continue
        angle = orbit(folder, count)
        if angle.iloc[-1] < np.pi:
            missed.append(f"{label}: turned by {np.degrees(angle.iloc[-1]):.0f}° only")
            continue
        half = np.interp(np.pi, angle, angle.index)
        period = 2 * half * RATE
        rows.append(
            {
                "beads": count,
                "period": period,
                "discs": discs.gammaT[count],
                "by_discs": period / discs.gammaT[count],
                "jeffery_L": reference.gammaT_with_e_c,
                "by_jeffery_L": period / reference.gammaT_with_e_c,
                "by_jeffery": period / reference.gammaT_with_e_p,
                "seconds_a_step": members.summary(folder)["wall_seconds"] / members.summary(folder)["steps"],
            }
        )
        if abs(rows[-1]["by_discs"] - 1) > 0.05:
            missed.append(f"{label}: period {period:.2f}, rigid touching discs {discs.gammaT[count]:.2f}")
    if rows:
        found = pd.DataFrame(rows)
        found.to_csv(options.out / "periods.csv", index=False, float_format="%.5g")
        print(found.to_string(index=False))
        plot, axis = plt.subplots(figsize=(5.6, 4.2))
        axis.plot(discs.index, discs.gammaT, "k-", label="touching discs, unbounded")
        axis.plot(table.index, table.gammaT_with_e_c, "k--", label="Jeffery, e = 1.14 N^0.844 (L)")
        axis.plot(table.index, table.gammaT_with_e_p, "k:", label="Jeffery, e = N")
        axis.plot(found.beads, found.period, "o", label="fibreflow")
        axis.set_xlabel("beads")
        axis.set_ylabel("γ̇T")
        axis.legend()
        plot.tight_layout()
        plot.savefig(options.out / "periods.png", dpi=110)
    for line in missed:
        print("missed:", line)
    sys.exit(bool(missed))


main()
