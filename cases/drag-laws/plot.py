"""Laws of drag and their slopes: .venv/bin/python cases/drag-laws/plot.py [OUT.png]"""

import io
import os
import pathlib
import subprocess
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
out = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "runs" / "drag-laws" / "laws.png")

command = ["cargo", "run", "--release", "-q", "-p", "fibreflow-fibre", "--example", "drag_laws"]
text = subprocess.run(command, cwd=ROOT, env=os.environ, check=True, capture_output=True, text=True).stdout
laws = pd.read_csv(io.StringIO(text))
table = pd.read_csv(HERE / "table_4_4_cn_vs_re.csv")

names = [c[3:] for c in laws.columns if c.startswith("cn_")]
x = np.log(laws.re)
worst = 0.0
figure, (top, middle, bottom) = plt.subplots(3, 1, figsize=(7, 9), sharex=True, height_ratios=[2, 1, 1])
styles = {"cylinder": ("k", "-"), "slender20": ("C0", ":"), "slender200": ("C1", ":"), "auto20": ("C0", "-"), "auto200": ("C1", "-")}
labels = {"cylinder": "infinite cylinder", "slender20": "slender body, $r_p$ = 20", "slender200": "slender body, $r_p$ = 200",
          "auto20": "auto, $r_p$ = 20", "auto200": "auto, $r_p$ = 200"}
for name in names:
    colour, style = styles[name]
    top.loglog(laws.re, laws[f"cn_{name}"], color=colour, ls=style, label=labels[name])
    middle.semilogx(laws.re, laws[f"slope_{name}"], color=colour, ls=style)
    # Trapezoidal rule: what the slopes at two neighbours say of the values between.
    for coefficient, slope in [("cn", "slope"), ("cl", "axial_slope")]:
        force = np.log(laws[f"{coefficient}_{name}"]) + 2 * x
        mean = 0.5 * (laws[f"{slope}_{name}"][1:].to_numpy() + laws[f"{slope}_{name}"][:-1].to_numpy())
        gap = np.abs(np.diff(force) / np.diff(x) - mean)
        worst = max(worst, gap.max())
        if coefficient == "cn":
            bottom.loglog(laws.re[1:], gap, color=colour, ls=style)
top.loglog(table.Re, table.Cn_model_tomotika, "ko", mfc="none", label="table 4.4, model")
top.loglog(table.Re, table.Cn_2d_simulation, "rx", label="table 4.4, two-dimensional simulation")
for axis in (top, middle, bottom):
    for join in (1e-2, 0.1, 100):
        axis.axvline(join, color="0.85", zorder=0)
top.set_ylabel("$C_n$")
top.legend(fontsize=8)
middle.set_ylabel("d ln f / d ln Re")
bottom.set_ylabel("difference − slope")
bottom.set_xlabel("Re")
figure.tight_layout()
out.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(out, dpi=120)
near = table[table.Re <= 0.1]
model = np.exp(np.interp(np.log(near.Re), x, np.log(laws.cn_cylinder)))
print(f"table 4.4, model, Re ≤ 0.1: largest deviation {np.max(np.abs(model / near.Cn_model_tomotika - 1)):.2%}")
print(f"largest gap between differences and analytic slopes: {worst:.1e}")
if worst > 1e-3:
    sys.exit("the slopes are not those of the values")
