"""Stress of suspensions of straight rigid fibres by theory: .venv/bin/python cases/shear-rheology/theory.py R_P VOLUME_FRACTION MOMENT

Prints the coefficient of each theory and the relative viscosity at ⟨p_x²p_y²⟩ = MOMENT. K is Kunhappan 2018.
"""

import sys

import numpy as np


def cox(ratio):
    """Equivalent aspect ratio of a cylinder (K 6.8)."""
    return 1.24 * ratio / np.sqrt(np.log(ratio))


def period(ratio, rate):
    """Of Jeffery's orbit [s]: 2π(r + 1/r)/γ̇ (K 6.7 has it upside down)."""
    return 2 * np.pi * (cox(ratio) + 1 / cox(ratio)) / rate


def crowding(ratio, fraction):
    """nL³ of a volume fraction."""
    return fraction * 4 / np.pi * ratio**2


def batchelor(ratio, fraction):
    """μ_fibre/μ of dilute cylinders (Batchelor 1971, K 6.2)."""
    epsilon = 1 / np.log(2 * ratio)
    f = (1 + 0.64 * epsilon) / (1 - 1.5 * epsilon) + 1.659 * epsilon**2
    return np.pi / 6 * crowding(ratio, fraction) * epsilon * f


def local(ratio, fraction):
    """μ_fibre/μ of the drag law of the case, ζ∥L³/12 a fibre with ln 2 − 3/2: local drag, nothing of other fibres."""
    return np.pi / 6 * crowding(ratio, fraction) / (np.log(2 * ratio) + np.log(2) - 1.5)


def shaqfeh_fredrickson(ratio, fraction, constant=0.16):
    """μ_fibre/μ of semi-dilute fibres (Shaqfeh & Fredrickson 1990, K 6.3): 0.16 aligned, −0.66 at random."""
    log = np.log(1 / fraction)
    return np.pi / 3 * crowding(ratio, fraction) / (log + np.log(log) + constant)


def viscosity(coefficient, moment):
    """μ_rel (K 6.4a)."""
    return 1 + coefficient * moment


def normal_differences(coefficient, moments):
    """N1, N2 by μγ̇: K 6.4b, c with z and y in their places; `moments` is a mapping of a_xxxy, a_xyyy, a_xyzz."""
    first = coefficient * (moments["a_xxxy"] - moments["a_xyyy"])
    return first, coefficient * (moments["a_xyyy"] - moments["a_xyzz"])


def phase_density(ratio, angle):
    """Density over [0, π) of the angle from the gradient's direction, twice K 6.9."""
    r = cox(ratio)
    return r / np.pi / (r**2 * np.cos(angle) ** 2 + np.sin(angle) ** 2)


if __name__ == "__main__":
    ratio, fraction, moment = map(float, sys.argv[1:4])
    print(f"nL³ = {crowding(ratio, fraction):.3f}, r_e = {cox(ratio):.3f}")
    for name, theory in [("Batchelor, K 6.2", batchelor), ("Shaqfeh & Fredrickson, K 6.3", shaqfeh_fredrickson), ("local drag", local)]:
        coefficient = theory(ratio, fraction)
        print(f"{name}: μ_fibre/μ = {coefficient:.4f}, μ_rel = {viscosity(coefficient, moment):.5f}")
