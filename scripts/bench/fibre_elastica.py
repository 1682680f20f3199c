"""PyElastica's share of scripts/bench/fibre: fibre_elastica.py WHAT arguments; prints a heading and a CSV row.

A Cosserat rod with shear under PositionVerlet at 0.8 of the highest director mode's step, however coarse the rod. The
clamp fixes the first director, which sits in the middle of the first element: rods start half an element behind the clamp,
without which they are first order.

    cantilever N | vibration N PERIODS | flexure E RATIO N PART | throughput RODS N STEPS
"""

import logging
import math
import sys
import time

logging.disable(logging.WARNING)

import elastica as ea  # noqa: E402
import fibre_scenes as scenes  # noqa: E402
import numpy as np  # noqa: E402
from numba import njit  # noqa: E402

KAPPA = 27 / 28
SAFETY = 0.8
STEPPER = ea.PositionVerlet()


class Simulator(ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping):
    pass


def critical_step(fibre, ds):
    bending = 4 * fibre.modulus / (fibre.density * ds**2)
    shear = 16 * KAPPA * fibre.shear_modulus / (fibre.density * fibre.diameter**2)
    return 2 / math.sqrt(bending + shear)


def clamped(fibre, n):
    """Simulator, rod and step of a rod along x with n elements and the clamp at x = 0."""
    simulator, ds = Simulator(), fibre.length / (n - 0.5)
    rod = ea.CosseratRod.straight_rod(
        n, np.array([-ds / 2, 0, 0]), np.array([1.0, 0, 0]), np.array([0.0, 0, 1]), n * ds, fibre.diameter / 2, fibre.density,
        youngs_modulus=fibre.modulus, shear_modulus=fibre.shear_modulus)  # fmt: skip
    simulator.append(rod)
    simulator.constrain(rod).using(ea.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,))
    return simulator, rod, SAFETY * critical_step(fibre, ds)


def march(simulator, step, steps, t=0.0):
    for _ in range(steps):
        t = STEPPER.step(simulator, t, step)
    return t


def warm_up():
    simulator, _, step = clamped(scenes.SOFT, 8)
    simulator.finalize()
    march(simulator, step, 20)


def cantilever(n):
    fibre = scenes.SOFT
    simulator, rod, step = clamped(fibre, n)
    load = np.array([0.0, 5 * fibre.bending / fibre.length**2, 0.0])
    simulator.add_forcing_to(rod).using(ea.EndpointForces, np.zeros(3), load, ramp_up_time=fibre.period)
    damping = 4 * math.pi / fibre.period
    simulator.dampen(rod).using(ea.AnalyticalLinearDamper, uniform_damping_constant=damping, time_step=step)
    simulator.finalize()
    chunk = int(fibre.period / 4 / step)
    t, last, start = 0.0, np.zeros(3), time.perf_counter()
    for k in range(80):
        t = march(simulator, step, chunk, t)
        tip = rod.position_collection[:, -1].copy()
        if k > 5 and np.linalg.norm(tip - last) < 1e-7 * fibre.length:
            break
        last = tip
    seconds = time.perf_counter() - start
    x, y, _ = tip / fibre.length
    return {"n": n, "seconds": seconds, "steps": (k + 1) * chunk, "x": x, "y": y}


def vibration(n, periods):
    """Energy is not compared: velocities and directors are known at different times."""
    fibre = scenes.SOFT
    simulator, rod, step = clamped(fibre, n)
    simulator.finalize()
    for i, x in enumerate(rod.position_collection[0] / fibre.length):
        rod.velocity_collection[1, i] = scenes.mode_motion(fibre, max(x, 0.0))[0]
    chunk = max(1, int(fibre.period / 200 / step))
    record, t, start = [], 0.0, time.perf_counter()
    count = int((periods + 0.6) * fibre.period / step / chunk)
    for _ in range(count):
        t = march(simulator, step, chunk, t)
        record.append((t, rod.position_collection[1, -1], 1.0))
    seconds = time.perf_counter() - start
    found = scenes.frequency_and_drift(fibre, record, periods, scenes.TIMOSHENKO)
    return {"n": n, "seconds": seconds * 20 / periods, "steps": count * chunk, "error": found["error"]}


@njit(cache=True)
def add_drag(force, velocity, drag, flow):
    count = force.shape[1]
    for i in range(count):
        share = 0.5 if i in (0, count - 1) else 1.0
        for axis in range(3):
            slip = (flow if axis == 1 else 0.0) - velocity[axis, i]
            force[axis, i] += share * drag * slip


class CrossFlow(ea.NoForces):
    def __init__(self, drag):
        super().__init__()
        self.drag = drag

    def apply_forces(self, system, time=0.0):
        add_drag(system.external_forces, system.velocity_collection, self.drag, scenes.flow(time)[0])


def flexure(modulus, ratio, n, part):
    fibre = scenes.stiff(modulus, ratio)
    simulator, rod, step = clamped(fibre, n)
    simulator.add_forcing_to(rod).using(CrossFlow, fibre.drag * fibre.length / (n - 0.5))
    simulator.finalize()
    march(simulator, 1e-6 * step, 5)
    chunk = math.ceil(scenes.SAMPLE / step)
    step = scenes.SAMPLE / chunk
    history, t, start = [], 0.0, time.perf_counter()
    for _ in range(max(1, round(part * scenes.DURATION / scenes.SAMPLE))):
        t = march(simulator, step, chunk, t)
        history.append((t, rod.position_collection[1, -1]))
    seconds = time.perf_counter() - start
    done = len(history) * scenes.SAMPLE / scenes.DURATION
    row = {"n": n, "seconds": seconds / done, "steps": len(history) * chunk, "part": done}
    return row | ({"error": scenes.history_error(fibre, history)} if part == 1 else {})


def throughput(rods, n, steps):
    fibre, rng, simulator = scenes.SOFT, np.random.default_rng(1), Simulator()
    for _ in range(rods):
        u = rng.normal(size=3)
        u /= np.linalg.norm(u)
        w = np.cross(u, rng.normal(size=3))
        rod = ea.CosseratRod.straight_rod(
            n, rng.random(3) * 8 * fibre.length, u, w / np.linalg.norm(w), fibre.length, fibre.diameter / 2, fibre.density,
            youngs_modulus=fibre.modulus, shear_modulus=fibre.shear_modulus)  # fmt: skip
        rod.velocity_collection[:] = 0.1 * rng.normal(size=(3, 1))
        simulator.append(rod)
    simulator.finalize()
    step = 0.5 * critical_step(fibre, fibre.length / n)
    t = march(simulator, step, 20)
    start = time.perf_counter()
    march(simulator, step, steps, t)
    seconds = time.perf_counter() - start
    return {"fibres": rods, "segments": rods * n, "threads": 1, "substep": step, "substeps": steps, "seconds": seconds,
            "segment_substeps_per_s": rods * n * steps / seconds}  # fmt: skip


def main():
    what, *rest = sys.argv[1:]
    if what == "--version":
        from elastica.version import VERSION

        print(f"PyElastica {VERSION}")
        return
    warm_up()
    if what == "flexure":
        row = flexure(float(rest[0]), float(rest[1]), int(rest[2]), float(rest[3]))
    else:
        row = {"cantilever": cantilever, "vibration": vibration, "throughput": throughput}[what](*map(int, rest))
    print(",".join(row))
    print(",".join(str(value) for value in row.values()))


main()
