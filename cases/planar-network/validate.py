"""Strength of planar networks (D4): .venv/bin/python cases/planar-network/validate.py

    [--quick]        one network, a stretch of 0.02
    [--stretch X]    Δx/L at the end, default 0.6
    [--seeds N]      replicates, default 2
    [--networks N…]  shape and length: straight, slight, curled, short, long; default all
    [--width W]      width of the networks in fibre lengths, default 2 as in the text: 200 fibres of aspect ratio 75; others in proportion
    [--done]         evaluates what has been run and runs nothing
    [--out DIR]      default runs/validate/planar-network

Networks of Switzer (2002, chapter 6) are pressed together, relaxed and pulled apart: fibres of other shape and length, and the network of slightly bent fibres
also with other stiffness and friction in the pull. Runs that are there already are used again. Writes network.csv, network.png.
"""

import argparse
import math
import pathlib
import shutil
import subprocess
import sys
import time

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts" / "bench"))
import harness  # noqa: E402

HERE = pathlib.Path(__file__).resolve().parent
RADIUS, MODULUS, FRACTION, STIFFNESS = 1e-5, 32228875.9761, 0.05, 0.05
# Bend of a joint whose fibre has a radius of curvature of 60 b, that of the text's networks of other lengths.
CURVED = {r_p: 4.0 * math.atan(r_p / 5.0 / 120.0) for r_p in (50, 75, 100)}
# Aspect ratio and bend of each joint; S^eff = 0.05 at r_p = 75 is the same EI at the other lengths.
NETWORKS = {
    "straight": (75, 0.0),
    "slight": (75, 0.1),
    "curled": (75, CURVED[75]),
    "short": (50, CURVED[50]),
    "long": (100, CURVED[100]),
}
# What the network of slightly bent fibres is pulled with: S^eff, μ.
PULLS = [(0.005, 20.0), (0.025, 20.0), (0.5, 20.0), (5.0, 20.0), (0.05, 1.0), (0.05, 5.0), (0.05, 10.0)]
# The text: contacts a fibre at r_p = 50, 75, 100.
CONTACTS = {"short": 2.5, "curled": 2.7, "long": 3.2}
INTERVAL = 0.02


def shape(bend):
    return f'{{ kind = "chain", bend = {bend}, turn = 0.0 }}'


def repulsion(r_p, rate):
    strength = 150 * 6 * math.pi * (r_p / 5 * RADIUS) * RADIUS * rate
    return f"{{ strength = {strength}, decay = 5e-7, range = 6.6e-6, contact_gap = 3.3e-6 }}"


def once(out, case, settings):
    """Runs a case unless it is there; seconds that it took."""
    done = out / "seconds"
    if not done.exists():
        start = time.time()
        harness.fibreflow(case, settings, out=out)
        done.write_text(f"{time.time() - start:.0f}")
    return float(done.read_text())


def pulled(out, stiffness, friction):
    return out / f"S{stiffness:g}_mu{friction:g}"


def wanted(run, options):
    """Whether a run is there or is to be done."""
    return not options.done or (run / "seconds").exists()


def form(name, seed, options):
    """Presses a network together; its folder, height [m] and contacts a fibre, counted once."""
    r_p, bend = NETWORKS[name]
    length, count = 2 * RADIUS * r_p, round(100 * options.width * r_p / 75)
    out = options.out / f"{name}{seed}"
    # The weight of the text is that of a piston two fibre lengths wide.
    mass = 1e5 * 6 * math.pi * r_p / 5 * RADIUS * options.width / 2
    settings = {
        "ambient.domain.size": [2 * length, options.width * length, 4 * length],
        "fibres.0.placement.count": count,
        "fibres.0.placement.seed": seed,
        "fibres.0.shape": shape(bend),
        "fibres.0.length": length,
        "contact.repulsion": repulsion(r_p, 1.0),
        "piston.mass": mass,
        "piston.weight": mass * RADIUS,
        "output.vtk": "{ every = 100000 }",
    }
    once(out, HERE / "case.toml", settings)
    piston = pd.read_csv(out / "series" / "piston.csv").iloc[-1]
    height = float(4 * length - piston.travelled)
    fraction = count * math.pi * RADIUS**2 * length / (2 * options.width * length**2 * height)
    if abs(fraction / FRACTION - 1) > 1e-9:
        raise SystemExit(f"{out}: the piston has not arrived, volume fraction {fraction:.4f}")
    shutil.copy(HERE / "pull.toml", out / "pull.toml")
    subprocess.run([harness.PROGRAM, "post", "extract-fibres", out, out / "network.csv"], check=True, capture_output=True)
    contacts = pd.read_csv(out / "series" / "fibres.csv").contacts.to_numpy()[-1] / count
    return out, height, contacts


def pull(name, out, height, stiffness, friction, options):
    """Pulls a network apart; its curve of Δx/L and T/ηu_pL by two fibre lengths of width, averaged as in the text, its scatter in between, and seconds."""
    r_p, bend = NETWORKS[name]
    length = 2 * RADIUS * r_p
    rate = STIFFNESS / stiffness
    speed, run = RADIUS * rate, pulled(out, stiffness, friction)
    wall = '{{ kind = "plane", point = [0.0, 0.0, {}], normal = [0.0, 0.0, {}] }}'
    settings = {
        "time.end": options.stretch * length / (2 * speed),
        "time.step": options.step / rate,
        "ambient.domain.origin": [-4 * length, 0.0, 0.0],
        "ambient.domain.size": [10 * length, options.width * length, height],
        "fibres.0.shape": shape(bend),
        "fibres.0.length": length,
        "contact.friction": friction,
        "contact.repulsion": repulsion(r_p, rate),
        "contact.walls": f"[{wall.format(0.0, 1.0)}, {wall.format(height, -1.0)}]",
        "grips.planes": [0.0, 2 * length],
        "grips.speed": speed,
    }
    seconds = once(run, out / "pull.toml", settings)
    data = pd.read_csv(run / "series" / "grips.csv").iloc[1:]
    data = data[data.elongation <= options.stretch * length * (1 + 1e-9)]
    stretch, tension = data.elongation.to_numpy() / length, data.tension.to_numpy() / (speed * length) * 2 / options.width
    bins = np.minimum((stretch / INTERVAL).astype(int), max(0, round(options.stretch / INTERVAL) - 1))
    mean = np.array([tension[bins == k].mean() for k in range(bins.max() + 1)])
    at = (np.arange(len(mean)) + 0.5) * INTERVAL
    return at, mean, tension - mean[bins], seconds


def strength(at, curves):
    """Largest tension of the mean curve and where; its error and that of the slope to half of it, from the replicates."""
    mean = curves.mean(axis=0)
    peak = mean.argmax()
    tops = curves.max(axis=1)
    rise = lambda c: at[np.argmax(c >= 0.5 * c.max())] / c[np.argmax(c >= 0.5 * c.max())]  # noqa: E731
    error = tops.std(ddof=1) / math.sqrt(len(tops)) if len(tops) > 1 else math.nan
    return tops.mean(), error, at[peak], np.mean([1.0 / rise(c) for c in curves])


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--stretch", type=float, default=0.6)
    parser.add_argument("--step", type=float, default=1e-2, help="u_pΔt/b")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--width", type=float, default=2.0)
    parser.add_argument("--done", action="store_true")
    parser.add_argument("--networks", nargs="*", choices=NETWORKS, default=list(NETWORKS))
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "validate" / "planar-network")
    options = parser.parse_args()
    if options.quick:
        options.stretch, options.seeds, options.networks = 0.02, 1, ["straight"]
    options.out.mkdir(parents=True, exist_ok=True)
    rows, curves, seconds = [], {}, 0.0
    for name in options.networks:
        pulls = [(STIFFNESS, 20.0)] + (PULLS if name == "slight" else [])
        r_p = NETWORKS[name][0]
        formed = [form(name, seed, options) for seed in range(1, options.seeds + 1) if wanted(options.out / f"{name}{seed}", options)]
        if not formed:
            continue
        contacts = np.array([c for _, _, c in formed])
        for stiffness, friction in pulls:
            there = [(out, height) for out, height, _ in formed if wanted(pulled(out, stiffness, friction), options)]
            found = [pull(name, out, height, stiffness, friction, options) for out, height in there]
            if not found:
                continue
            at, set_of = found[0][0], np.array([mean for _, mean, _, _ in found])
            top, error, where, slope = strength(at, set_of)
            scatter = np.mean([np.std(rest) for _, _, rest, _ in found])
            seconds += sum(s for *_, s in found)
            curves[name, stiffness, friction] = (at, set_of)
            # T/E_Y b², with E_Y I = S^eff ηγ̇L⁴ and L = r_p d.
            by_modulus = (2 * r_p) / (4 * stiffness * (r_p / 75) ** -4 / math.pi * (2 * r_p) ** 4)
            row = {
                "network": name,
                "r_p": r_p,
                "bend": round(NETWORKS[name][1], 4),
                "S_eff": stiffness * (75 / r_p) ** 4,
                "friction": friction,
                "width": options.width,
                "stretch": round(at[-1] + 0.5 * INTERVAL, 3),
                "seeds": len(found),
                "contacts": contacts.mean(),
                "strength": top,
                "error": error,
                "at": where,
                "strength_by_EYb2": top * by_modulus,
                "slope": slope,
                "scatter": scatter,
                "seconds": np.mean([s for *_, s in found]),
            }
            rows.append(row)
            print(", ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in row.items()), flush=True)
            harness.write_csv(options.out / "network.csv", rows)
    draw(curves, options.out / "network.png")
    sys.exit(0 if options.quick else judge(rows))


def draw(curves, path):
    figure, axes = plt.subplots(2, 2, figsize=(10, 7), sharex=True)
    panels = [
        ("shape", [k for k in curves if k[1:] == (STIFFNESS, 20.0) and k[0] in ("straight", "slight", "curled")], lambda k: f"θ = {NETWORKS[k[0]][1]:.2g}"),
        ("length", [k for k in curves if k[0] in ("short", "curled", "long")], lambda k: f"$r_p$ = {NETWORKS[k[0]][0]}"),
        ("stiffness", sorted(k for k in curves if k[0] == "slight" and k[2] == 20.0), lambda k: f"$S^{{eff}}$ = {k[1]:g}"),
        ("friction", sorted(k for k in curves if k[0] == "slight" and k[1] == STIFFNESS), lambda k: f"μ = {k[2]:g}"),
    ]
    for axis, (title, members, label) in zip(axes.flat, panels):
        for key in members:
            at, curve = curves[key]
            mean = curve.mean(axis=0)
            # Length is compared by T/E_Y b², in which EI is the same for all.
            scale = (NETWORKS[key[0]][0] / 75) if title == "length" else 1.0
            (line,) = axis.plot(at, scale * mean, label=label(key))
            if len(curve) > 1:
                axis.fill_between(at, scale * curve.min(axis=0), scale * curve.max(axis=0), color=line.get_color(), alpha=0.2)
        axis.set_visible(bool(members))
        axis.set_ylim(bottom=0.0)
        axis.set(title=title, ylabel="$T/ηu_pL$" if title != "length" else "$T/ηu_p·150b$")
        if members:
            axis.legend(fontsize=7)
    for axis in axes[1]:
        axis.set(xlabel="Δx/L")
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def judge(rows):
    """1 if a statement of the text is missed."""
    by = {(r["network"], r["S_eff"] if r["r_p"] == 75 else STIFFNESS, r["friction"]): r["strength"] for r in rows}
    scaled = {r["network"]: r["strength"] * r["r_p"] for r in rows if r["friction"] == 20.0}
    get = lambda *keys: [by[k] for k in keys if k in by]  # noqa: E731
    rising = {
        "stiffness": get(*(("slight", s, 20.0) for s in (0.005, 0.025, 0.05, 0.5))),
        "friction": get(*(("slight", STIFFNESS, mu) for mu in (1.0, 5.0, 10.0, 20.0))),
        "straightness": get(*((n, STIFFNESS, 20.0) for n in ("curled", "slight", "straight"))),
        "length": [scaled[n] for n in ("short", "curled", "long") if n in scaled],
    }
    missed = 0
    for what, values in rising.items():
        if any(b <= a for a, b in zip(values, values[1:])):
            missed = 1
            print(f"missed: strength does not rise with {what}: {[f'{v:.0f}' for v in values]}")
    return missed


if __name__ == "__main__":
    main()
