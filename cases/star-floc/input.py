"""Writes star.csv, the star floc of Switzer (2002, app. D.4) for case.toml: .venv/bin/python cases/star-floc/input.py

The paper shears along x with the gradient along z and has the axis of a segment along the body's z; here the gradient is along y and the
axis along the body's x. Lengths are multiplied by the radius.
"""

import pathlib

import numpy as np
import pandas as pd

HERE = pathlib.Path(__file__).resolve().parent
RADIUS, HALF = 1e-5, 8.0


def product(a, b):
    w, v, x, u = a[..., :1], a[..., 1:], b[..., :1], b[..., 1:]
    return np.concatenate([w * x - np.sum(v * u, axis=-1, keepdims=True), w * u + x * v + np.cross(v, u)], axis=-1)


def turned(q):
    """Frames in space (x, z, -y) with the axis along the body's x."""
    half = np.sqrt(0.5)
    space, body = np.array([half, -half, 0, 0]), np.array([half, 0, -half, 0])
    return product(product(np.broadcast_to(space, q.shape), q), np.broadcast_to(body, q.shape))


def axes(q):
    w, x, y, z = q.T
    return np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=-1)


def main():
    frames = pd.read_csv(HERE / "reference" / "euler_parameters_in.csv")
    centres = pd.read_csv(HERE / "reference" / "centers_of_mass_in.csv")[["rcmx", "rcmy", "rcmz"]].to_numpy()
    q = turned(frames[["q0", "q1", "q2", "q3"]].to_numpy())
    lines = []
    for fibre, centre in enumerate(centres):
        own = q[frames.m.to_numpy() == fibre + 1]
        steps = 2 * HALF * axes(own)
        middles = np.cumsum(steps, axis=0) - 0.5 * steps
        middles += np.array([centre[0], centre[2], -centre[1]]) - middles.mean(axis=0)
        lines += [f"{fibre}," + ",".join(f"{x:.17g}" for x in [*(RADIUS * r), *p]) for r, p in zip(middles, own)]
    (HERE / "star.csv").write_text("fibre,x,y,z,q0,q1,q2,q3\n" + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
