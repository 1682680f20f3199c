"""Turbulent pipe at Re_b 5300 (F7) beside El Khoury et al. (2013): .venv/bin/python cases/pipe/validate.py

    --members coarse medium default fine: 32 × (10, 11), 64 × (14, 15), 96 × (20, 20), 128 × (24, 24) cells along, in the core, in layers
    --members coarse-moving medium-moving: the first two on meshes that move with 0.8 U_b
    --members hybrid                    : 32 cells around and along, 10 layers of hexahedra, tetrahedra inside (hybrid/mesh.py, with gmsh)

Averaged from 120 R/U_b. A member that was begun goes on from its last checkpoint. Writes members.csv, profiles-NAME.csv in wall units of
the measured friction, pipe.png.
"""

import json
import pathlib
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "bench"))

import matplotlib
import members
import numpy as np
import pandas as pd

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HERE = pathlib.Path(__file__).resolve().parent
MEMBERS = {"coarse": (32, 10, 11), "medium": (64, 14, 15), "default": (96, 20, 20), "fine": (128, 24, 24), "hybrid": None}
# The same on meshes that move with 0.8 U_b.
MOVING = [0.8, 0.0, 0.0]
MEMBERS |= {name + "-moving": MEMBERS[name] for name in ("coarse", "medium")}
NU = 2 / 5300
DNS = pd.read_csv(HERE / "reference" / "elkhoury2013_retau180.csv").sort_values("y_plus")
RMS = {"u": ("uu", "uz_rms_plus"), "v": ("vv", "ur_rms_plus"), "w": ("ww", "ut_rms_plus")}
FRICTION = 0.0683223


def profile(folder):
    """Wall units of the measured friction, from the wall to the axis."""
    summary = json.loads((folder / "statistics.json").read_text())
    u_tau = summary["friction_velocity"]
    table = pd.read_csv(folder / "profiles" / "statistics.csv").iloc[::-1]
    wall = {"y_plus": (summary["half_width"] - table.position) * u_tau / NU, "U_plus": table.u / u_tau, "U_plus_error": table.u_error / u_tau}
    for name, (square, _) in RMS.items():
        wall[name + "_rms"] = np.sqrt(table[square].clip(lower=0)) / u_tau
    wall["uv"] = table.uv / u_tau**2
    wall["total_stress"], wall["stress_line"] = table.total_stress / u_tau**2, table.stress_line / u_tau**2
    return summary, pd.DataFrame(wall).reset_index(drop=True)


def hybrid(out):
    """The mesh of this member, made if it is not there."""
    path = (out / "hybrid.vtu").resolve()
    if not path.exists():
        make = [sys.executable, HERE / "hybrid" / "mesh.py", "--around", "32", "--along", "32", "--layers", "10", "--out", path]
        subprocess.run(list(map(str, make)), check=True)
    return path


def measure(name, summary, wall, run):
    far, fluid = wall[wall.y_plus > 5], run.get("fluid", {})
    wanted = np.interp(far.y_plus, DNS.y_plus, DNS["Uz_plus"])
    return {
        "member": name, "nodes": fluid.get("nodes"), "averaged": summary["averaging_time"], "u_tau": summary["friction_velocity"],
        "u_tau_percent": 100 * (summary["friction_velocity"] / FRICTION - 1),
        "u_tau_sampling_percent": 50 * abs(summary["wall_stress_error"] / summary["wall_stress"]),
        "U_worst_percent": 100 * np.abs(far.U_plus / wanted - 1).max(), "U_centre_percent": 100 * (wall.U_plus.iloc[-1] / DNS.Uz_plus.iloc[-1] - 1),
        "u_peak_percent": 100 * (wall.u_rms.max() / DNS.uz_rms_plus.max() - 1), "stress_residual_percent": 100 * summary["stress_residual"],
        "us_per_node_step": 1e6 * fluid.get("seconds_per_node_step", float("nan")), "poisson_iterations": fluid.get("poisson_iterations_mean"),
    }


def figure(found, path):
    plot, (mean, rms, stress) = plt.subplots(1, 3, figsize=(15, 4.5))
    mean.semilogx(DNS.y_plus[1:], DNS.Uz_plus[1:], "k-", lw=1, label="El Khoury et al. 2013")
    stress.plot(DNS.y_plus, DNS.uzur_plus, "k-", lw=1)
    for _, column in RMS.values():
        rms.plot(DNS.y_plus, DNS[column], "k-", lw=1)
    for k, (name, wall) in enumerate(found.items()):
        style = dict(color=f"C{k}", ms=3, lw=0.9)
        mean.errorbar(wall.y_plus[1:], wall.U_plus[1:], wall.U_plus_error[1:], fmt="o-", label=name, **style)
        for component in RMS:
            rms.plot(wall.y_plus, wall[component + "_rms"], "o-", **style)
        stress.plot(wall.y_plus, wall.uv, "o-", **style)
        stress.plot(wall.y_plus, -wall.total_stress, "--", **style)
    for axis, label in [(mean, "U⁺"), (rms, "u'⁺, w'⁺, v'⁺ (axial, around, radial)"), (stress, "⟨u'v'⟩⁺, − total stress (dashed)")]:
        axis.set_xlabel("y⁺")
        axis.set_ylabel(label)
    mean.legend()
    plot.tight_layout()
    plot.savefig(path, dpi=110)


def main():
    options = members.options(__doc__, "pipe", MEMBERS, ["coarse"])
    found, rows, missed = {}, [], []
    for name in options.members:
        case, settings = HERE / "case.toml", {"output.statistics.from": 120}
        if name == "hybrid":
            case = HERE / "hybrid" / "case.toml"
            settings |= {"mesh.file": json.dumps(str(hybrid(options.out)))}
        else:
            cells, core, layers = MEMBERS[name]
            settings |= {"mesh.cells": cells, "mesh.core": core, "mesh.layers": layers}
        if name.endswith("-moving"):
            # By the Courant number alone a step would be three viscous units of time.
            settings |= {"fluid.frame_velocity": MOVING, "time.cfl": 0.3}
        folder = members.run(options, case, name, settings)
        if not (folder / "statistics.json").exists():
            print(f"{name}: no averages yet")
            continue
        summary, found[name] = profile(folder)
        found[name].to_csv(options.out / f"profiles-{name}.csv", index=False, float_format="%.6g")
        row = measure(name, summary, found[name], members.summary(folder))
        rows.append(row)
        for column, bound in [("U_worst_percent", 2), ("u_peak_percent", 3)]:
            if name == "fine" and abs(row[column]) > bound:
                missed.append(f"{name}, {column}: {row[column]:.2f}, wanted {bound}")
    if not rows:
        return 1
    table = pd.DataFrame(rows)
    table.to_csv(options.out / "members.csv", index=False, float_format="%.5g")
    print(table.set_index("member").T.to_string())
    figure(found, options.out / "pipe.png")
    print("\n".join(f"missed: {line}" for line in missed))
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
