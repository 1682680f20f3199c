"""Scenes of scripts/bench/fibre, the same for every program: constants, references, errors. Needs numpy alone.

Static and free: a fibre of 1 cm, L/d = 40, E = 100 MPa, 1000 kg/m³ (`SOFT`). Flexure: 24 µm thick, clamped across an
oscillating flow of water (`stiff`), with the added mass of a cylinder; the flow's period is twenty steps of 0.1 ms.
"""

import dataclasses
import math

import numpy as np

POISSON = 0.3
VISCOSITY = 1e-3
FLOW_PERIOD = 2e-3
FLOW_SPEED = 0.05
PERIODS = 5
DURATION = PERIODS * FLOW_PERIOD
# Deflections are compared at the ends of a fluid's steps; explicit programs see the flow anew after REFRESH.
SAMPLE = 1e-4
REFRESH = 2e-6
ROOT = 1.8751040687119611
# Timoshenko's first frequency below Euler–Bernoulli's at L/d = 40 (ν = 0.3).
TIMOSHENKO = 3.569e-4


@dataclasses.dataclass(frozen=True)
class Fibre:
    length: float
    diameter: float
    modulus: float
    density: float

    @property
    def area(self):
        return math.pi * self.diameter**2 / 4

    @property
    def second_moment(self):
        return math.pi * self.diameter**4 / 64

    @property
    def bending(self):
        return self.modulus * self.second_moment

    @property
    def shear_modulus(self):
        return self.modulus / (2 * (1 + POISSON))

    @property
    def line_density(self):
        return self.density * self.area

    @property
    def period(self):
        """Of the first mode, Euler–Bernoulli."""
        return 2 * math.pi / (ROOT**2 * math.sqrt(self.bending / (self.line_density * self.length**4)))

    @property
    def drag(self):
        """Across the fibre, by length: Batchelor's slender body [N·s/m²]."""
        return 4 * math.pi * VISCOSITY / (math.log(2 * self.length / self.diameter) + math.log(2) - 0.5)


SOFT = Fibre(1e-2, 2.5e-4, 1e8, 1000.0)


def stiff(modulus, ratio):
    # 1300 kg/m³, and the displaced water as added mass.
    return Fibre(24e-6 * ratio, 24e-6, modulus, 2300.0)


def flow(time):
    """Velocity and acceleration of the fluid."""
    rate = 2 * math.pi / FLOW_PERIOD
    return FLOW_SPEED * math.sin(rate * time), FLOW_SPEED * rate * math.cos(rate * time)


def roots(count):
    """Of cosh k cos k = −1."""
    found = []
    for n in range(count):
        k = (n + 0.5) * math.pi
        for _ in range(50):
            value = math.cos(k) + 1 / math.cosh(k)
            k -= value / (-math.sin(k) - math.sinh(k) / math.cosh(k) ** 2)
        found.append(k)
    found[0] = ROOT
    return found


def shape(k, x):
    """Mode of a clamped-free beam and its slope; ∫φ² = 1, φ(1) = ±2."""
    s = (math.cosh(k) + math.cos(k)) / (math.sinh(k) + math.sin(k))
    value = math.cosh(k * x) - math.cos(k * x) - s * (math.sinh(k * x) - math.sin(k * x))
    slope = k * (math.sinh(k * x) + math.sin(k * x) - s * (math.cosh(k * x) - math.cos(k * x)))
    return value, slope


def mode_motion(fibre, x, amplitude=0.01):
    """Velocity and angular velocity of a first mode that swings by `amplitude` lengths, when it passes the middle."""
    value, slope = shape(ROOT, x)
    peak = amplitude * 2 * math.pi / fibre.period / shape(ROOT, 1.0)[0]
    return peak * fibre.length * value, peak * slope


def frequency_and_drift(fibre, record, periods, slower=0.0):
    """Of (time, deflection, energy): relative error of the frequency, change of the mean energy from first to last period.

    The frequency of theory is `slower` than Euler–Bernoulli's.
    """
    t, y, e = (np.array(column) for column in zip(*record))
    up = np.flatnonzero((y[:-1] < 0) & (y[1:] >= 0))
    crossings = t[up] - y[up] * (t[up + 1] - t[up]) / (y[up + 1] - y[up])
    period = (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    mean = [e[(t >= k * period) & (t < (k + 1) * period)].mean() for k in (0, periods - 1)]
    return {"error": abs(fibre.period / period / (1 - slower) - 1), "drift": mean[1] / mean[0] - 1}


def elastica(fibre, load=5.0, kappa=None):
    """Tip (x, y)/L of the extensible rod under PL²/EI = `load`, by shooting (Runge–Kutta); shearable with a factor κ."""
    line = fibre.bending / fibre.length**2
    stretching = load * line / (fibre.modulus * fibre.area)
    shearing = load * line / (kappa * fibre.shear_modulus * fibre.area) if kappa else 0.0

    def rate(y):
        c, s = math.cos(y[0]), math.sin(y[0])
        stretch, shear = 1 + stretching * s, shearing * c
        x = stretch * c - shear * s
        return np.array([y[1], -load * x, x, stretch * s + shear * c])

    def shoot(slope, steps=1000):
        h = 1.0 / steps
        y = np.array([0.0, slope, 0.0, 0.0])
        for _ in range(steps):
            a = rate(y)
            b = rate(y + 0.5 * h * a)
            c = rate(y + 0.5 * h * b)
            y = y + h / 6 * (a + 2 * b + 2 * c + rate(y + h * c))
        return y

    low, high = 0.0, load
    for _ in range(45):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if shoot(middle)[1] < 0 else (low, middle)
    return shoot(low)[2:]


def deflection(fibre, times, modes=8):
    """Tip deflection of Euler–Bernoulli's beam in the flow, at rest at first: linear, by modes."""
    rate = 2 * math.pi / FLOW_PERIOD
    damping = 0.5 * fibre.drag / fibre.line_density
    t = np.asarray(times)
    total = np.zeros(len(t))
    x = (np.arange(4000) + 0.5) / 4000
    for k in roots(modes):
        forcing = fibre.drag / fibre.line_density * FLOW_SPEED * np.mean([shape(k, s)[0] for s in x])
        own2 = k**4 * fibre.bending / (fibre.line_density * fibre.length**4)
        # q'' + 2 damping q' + own² q = forcing sin(rate t): the forced swing and what cancels it at the start.
        gain = forcing / complex(own2 - rate**2, 2 * damping * rate)
        swing = (gain * np.exp(1j * rate * t)).imag
        fast = np.sqrt(complex(own2 - damping**2))
        at, slope = gain.imag, (gain * 1j * rate).imag
        free = np.exp(-damping * t) * (-at * np.cos(fast * t) - (slope + damping * at) / fast * np.sin(fast * t)).real
        total += shape(k, 1.0)[0] * (swing + free)
    return total


def history_error(fibre, history):
    """Relative L2-in-time error of (time, deflection) over the samples."""
    t, y = (np.array(column) for column in zip(*history))
    exact = deflection(fibre, t)
    return float(np.linalg.norm(y - exact) / np.linalg.norm(exact))


def write_suspension(path, fibres, fraction, seed, gap=0.0):
    """Straight fibres at random in a periodic cube of this volume fraction: centre, direction, velocity.

    With a `gap`, centre lines keep that many diameters apart; without, they may overlap.
    """
    rng = np.random.default_rng(seed)
    f = SOFT
    edge = (fibres * f.area * f.length / fraction) ** (1 / 3)
    centres, directions = np.empty((fibres, 3)), np.empty((fibres, 3))
    count = 0
    while count < fibres:
        c, u = rng.random(3) * edge, rng.normal(size=3)
        u /= np.linalg.norm(u)
        if gap > 0 and count and distances(c, u, centres[:count], directions[:count], edge).min() < gap * f.diameter:
            continue
        centres[count], directions[count] = c, u
        count += 1
    velocity = 0.1 * rng.normal(size=(fibres, 3))
    velocity -= velocity.mean(0)
    with open(path, "w") as file:
        file.write(f"# box={edge!r}\n")
        np.savetxt(file, np.hstack([centres, directions, velocity]), delimiter=",", fmt="%.10e")


def distances(c, u, centres, directions, edge):
    """Between one centre line and many."""
    w = centres - c
    w -= edge * np.round(w / edge)
    b, d1, d2 = directions @ u, w @ u, np.einsum("ij,ij->i", w, directions)
    half = 0.5 * SOFT.length
    s = np.clip((d1 - b * d2) / np.maximum(1 - b * b, 1e-12), -half, half)
    for _ in range(2):
        t = np.clip(b * s - d2, -half, half)
        s = np.clip(d1 + b * t, -half, half)
    return np.linalg.norm(w + t[:, None] * directions - s[:, None] * u, axis=1)


def read_suspension(path):
    with open(path) as file:
        edge = float(file.readline().split("box=")[1].split()[0])
        return edge, np.loadtxt(file, delimiter=",")
