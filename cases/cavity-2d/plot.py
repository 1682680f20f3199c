"""Centrelines of a run beside the references: python cases/cavity-2d/plot.py [RUN]"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "plot"))

import lines
import matplotlib
import run_data
import tomllib

matplotlib.use("Agg")
import validate

run = run_data.folder("cavity-2d")
with open(run / "case.toml", "rb") as file:
    case = tomllib.load(file)
reynolds = round(case["fluid"]["density"] / case["fluid"]["viscosity"])
data = lines.fluid(run)
element = case["mesh"].get("element", "hexahedron")
validate.draw_profiles({(reynolds, element): data}, run_data.picture(run, "profiles.png"))
validate.draw_fields({(reynolds, element): data}, run_data.picture(run, "fields.png"))
for name, off in zip("uv", validate.deviations(data, reynolds)):
    print(f"{name}: {abs(off).max():.2e} of the speed of the lid off the reference")
