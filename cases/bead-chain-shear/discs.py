"""Orbit of a rigid chain of N touching discs in plane shear, unbounded Stokes flow: .venv/bin/python cases/bead-chain-shear/discs.py

The chain has two mirror planes, so that it turns by Jeffery's dθ/dt = −γ̇ (e² cos²θ + sin²θ)/(e² + 1), θ from the normal of the walls, with e² the ratio of its rates across
and along the flow, and γ̇T = 2π(e + 1/e) exactly. Both rates come from a boundary integral: single layers on the circles, of no net force and torque, with Kress's
logarithmic weights on the circle itself. Writes discs.csv.
"""

import pathlib

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent


def kress(points):
    """Weights by difference of index of ∫ ln(4 sin²((t − s)/2)) f(s) ds on a circle (Kress, Linear Integral Equations, 12.3), even number of points."""
    half = points // 2
    t = 2 * np.pi * np.arange(points) / points
    m = np.arange(1, half)[:, None]
    return -2 * np.pi / half * (np.cos(m * t) / m).sum(axis=0) - np.pi / half**2 * np.cos(half * t)


def rate(count, along, points):
    """Spin by γ̇ of a chain of discs of unit radius along x (or y) in u = (y, 0)."""
    angle = 2 * np.pi * (np.arange(points) + 0.5) / points
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    centres = np.zeros((count, 2))
    centres[:, 0 if along else 1] = 2.0 * np.arange(count) - (count - 1)
    x = (centres[:, None, :] + ring).reshape(-1, 2)
    total, weight = len(x), 2 * np.pi / points
    away = x[:, None, :] - x[None, :, :]
    square = (away**2).sum(axis=2)
    same = np.repeat(np.arange(count), points)
    own = same[:, None] == same[None, :]
    safe = np.where(own, 1.0, square)
    # ln r² with the weights of the trapezoidal rule, or Kress's on the same circle, where r² = 4 sin²(…/2).
    logarithm = weight * np.log(safe)
    difference = np.abs(np.arange(total)[:, None] - np.arange(total)[None, :]) % points
    logarithm[own] = kress(points)[difference[own]]
    tangent = np.column_stack([-x[:, 1], x[:, 0]]) - np.column_stack([-centres[same][:, 1], centres[same][:, 0]])
    matrix = np.zeros((2 * total + 3, 2 * total + 3))
    for a in range(2):
        for b in range(2):
            ratio = away[:, :, a] * away[:, :, b] / np.where(square > 0, square, 1.0)
            np.fill_diagonal(ratio, tangent[:, a] * tangent[:, b])
            matrix[a : 2 * total : 2, b : 2 * total : 2] = weight * ratio - (0.5 * logarithm if a == b else 0.0)
    # Rigid motion of all of it, and no net force and torque.
    rigid = np.zeros((2 * total, 3))
    rigid[0::2, 0] = rigid[1::2, 1] = 1.0
    rigid[0::2, 2], rigid[1::2, 2] = -x[:, 1], x[:, 0]
    matrix[: 2 * total, 2 * total :] = -rigid
    matrix[2 * total :, : 2 * total] = rigid.T
    right = np.zeros(2 * total + 3)
    right[0 : 2 * total : 2] = -x[:, 1]
    # A uniform pressure inside a disc does nothing: the layer is known up to its normal on every circle.
    return np.linalg.lstsq(matrix, right, rcond=1e-11)[0][-1] if total < 300 else solve(matrix, right, x - centres[same], same)[-1]


def solve(matrix, right, normals, same):
    """With the net pressure of every circle set to zero."""
    size = len(right)
    for k in range(same[-1] + 1):
        normal = np.zeros(size)
        normal[0 : size - 3 : 2], normal[1 : size - 3 : 2] = (normals * (same == k)[:, None]).T
        matrix += np.outer(normal, normal) / len(normals)
    return np.linalg.solve(matrix, right)


def aspect(count, points):
    return np.sqrt(rate(count, False, points) / rate(count, True, points))


def main():
    with open(HERE / "discs.csv", "w") as file:
        file.write("beads,e,gammaT\n")
        for count in range(1, 11):
            e = aspect(count, 96)
            file.write(f"{count},{e:.5f},{2 * np.pi * (e + 1 / e):.5f}\n")
            print(count, e, 2 * np.pi * (e + 1 / e))


if __name__ == "__main__":
    main()
