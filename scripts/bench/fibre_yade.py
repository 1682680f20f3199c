"""YADE's share of scripts/bench/fibre: yade -n -x -jN fibre_yade.py WHAT arguments; the last line is a CSV row, heading before it.

A fibre is a chain of GridNode and GridConnection. `avoidGranularRatcheting` is off: on, it changes the shear stiffness.

    cantilever N            tip load PL²/EI = 5, relaxed under Cundall damping
    vibration N             first mode for 20 periods
    flexure E RATIO N PART  oscillating cross flow; PART of the history of five periods
    throughput SCENE N STEPS free|contact
"""

import math
import sys
import time

import fibre_scenes as scenes
import numpy as np
from yade import utils
from yade.gridpfacet import gridConnection, gridNode
from yade.minieigenHP import Vector3
from yade.wrapper import *  # noqa: F403

SAFETY = 0.8
PERIODS = 20


def materials(fibre, contact_modulus):
    common = {"poisson": scenes.POISSON, "density": fibre.density, "frictionAngle": math.atan(0.3)}
    O.materials.append(CohFrictMat(young=fibre.modulus, normalCohesion=1e30, shearCohesion=1e30, momentRotationLaw=True,
                                   label="beam", **common))  # fmt: skip
    O.materials.append(FrictMat(young=contact_modulus, label="skin", **common))


def engines(fibre, damping=0.0, contacts=False):
    geometry = [Ig2_GridNode_GridNode_GridNodeGeom6D(avoidGranularRatcheting=False)]
    physics = [Ip2_CohFrictMat_CohFrictMat_CohFrictPhys(setCohesionNow=True, setCohesionOnNewContacts=False)]
    laws = [Law2_ScGeom6D_CohFrictPhys_CohesionMoment(label="beam_law")]
    bounds = []
    if contacts:
        geometry.append(Ig2_GridConnection_GridConnection_GridCoGridCoGeom())
        physics.append(Ip2_FrictMat_FrictMat_FrictPhys())
        laws.append(Law2_GridCoGridCoGeom_FrictPhys_CundallStrack())
        bounds = [Bo1_GridConnection_Aabb()]
    # gridConnection creates interactions, so the engines come first.
    O.engines = [
        ForceResetter(),
        InsertionSortCollider(bounds, verletDist=0.25 * fibre.diameter, allowBiggerThanPeriod=True, label="collider"),
        InteractionLoop(geometry, physics, laws),
        NewtonIntegrator(damping=damping, gravity=(0, 0, 0), label="newton"),
    ]


def chain(points, fibre):
    radius = 0.5 * fibre.diameter
    nodes = [O.bodies.append(gridNode(Vector3(*p), radius, material="beam")) for p in points]
    for pair in zip(nodes[:-1], nodes[1:]):
        O.bodies.append(gridConnection(*pair, radius, material="skin"))
    return nodes


def clamped(fibre, n, damping=0.0):
    materials(fibre, 1e6)
    engines(fibre, damping)
    nodes = chain([(fibre.length * i / n, 0, 0) for i in range(n + 1)], fibre)
    O.bodies[nodes[0]].state.blockedDOFs = "xyzXYZ"
    O.dt = SAFETY * critical_step(fibre, n)
    return nodes


def critical_step(fibre, n):
    """2/ω of the assembled straight chain: bending with the rotary inertia of spheres, stretching, torsion."""
    h = fibre.length / n
    mass = np.full(n + 1, fibre.line_density * h)
    mass[[0, -1]] *= 0.5
    inertia = 0.4 * mass * (0.5 * fibre.diameter) ** 2
    bend = fibre.bending / h**3 * np.array(
        [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h],
         [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h * h, -6 * h, 4 * h * h]])  # fmt: skip
    stiffness = np.zeros((2 * n + 2, 2 * n + 2))
    spring = np.zeros((n + 1, n + 1))
    for e in range(n):
        stiffness[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += bend
        spring[e : e + 2, e : e + 2] += np.array([[1, -1], [-1, 1]]) / h
    both = np.empty(2 * n + 2)
    both[0::2], both[1::2] = mass, inertia
    torsion = 2 * fibre.shear_modulus * fibre.second_moment
    pairs = [(stiffness, both), (spring * fibre.modulus * fibre.area, mass), (spring * torsion, inertia)]
    fastest = max(np.linalg.eigvalsh(k / np.sqrt(np.outer(m, m)))[-1] for k, m in pairs)
    return 2 / math.sqrt(fastest)


def timed(steps):
    """Wall time and number of steps done: one run, since each call polls every 40 ms."""
    before, start = O.iter, time.perf_counter()
    O.run(int(steps), True)
    return time.perf_counter() - start, O.iter - before


def cantilever(n):
    fibre = scenes.SOFT
    tip = clamped(fibre, n, damping=0.4)[-1]
    load = 5 * fibre.bending / fibre.length**2
    state = {"k": 0, "last": Vector3(0, 0, 0)}

    def control():
        state["k"] += 1
        if state["k"] <= 20:
            O.forces.setPermF(tip, Vector3(0, load * state["k"] / 20, 0))
        elif state["k"] % 5 == 0:
            at = Vector3(O.bodies[tip].state.pos)
            if (at - state["last"]).norm() < 1e-7 * fibre.length:
                O.pause()
            state["last"] = at

    globals()["control"] = control
    O.engines = O.engines + [PyRunner(iterPeriod=int(0.05 * fibre.period / O.dt), initRun=True, command="control()")]
    seconds, steps = timed(21 * fibre.period / O.dt)
    x, y, _ = O.bodies[tip].state.pos / fibre.length
    return {"n": n, "seconds": seconds, "steps": steps, "x": x, "y": y}


def vibration(n):
    fibre = scenes.SOFT
    nodes = clamped(fibre, n)
    for i, node in enumerate(nodes[1:], 1):
        velocity, spin = scenes.mode_motion(fibre, i / n)
        O.bodies[node].state.vel = Vector3(0, velocity, 0)
        O.bodies[node].state.angVel = Vector3(0, 0, spin)
    tip, bonds = O.bodies[nodes[-1]].state, list(O.interactions)
    record = []

    def sample():
        p = [(b.phys.normalForce.squaredNorm() / b.phys.kn + b.phys.shearForce.squaredNorm() / b.phys.ks
              + b.phys.moment_bending.squaredNorm() / b.phys.kr + b.phys.moment_twist.squaredNorm() / b.phys.ktw)
             for b in bonds]  # fmt: skip
        record.append((O.time, tip.pos[1], utils.kineticEnergy() + 0.5 * sum(p)))

    globals()["sample"] = sample
    stride = max(1, int(fibre.period / 200 / O.dt))
    O.engines = O.engines + [PyRunner(iterPeriod=stride, command="sample()")]
    seconds, steps = timed((PERIODS + 0.6) * fibre.period / O.dt)
    return {"n": n, "seconds": seconds, "steps": steps} | scenes.frequency_and_drift(fibre, record, PERIODS)


def flexure(modulus, ratio, n, part):
    """In the frame of the fluid: the clamp moves against it, and its acceleration acts on all masses."""
    fibre = scenes.stiff(modulus, ratio)
    nodes = clamped(fibre, n)
    for ids, share in ((nodes[1:-1], 1.0), (nodes[-1:], 0.5)):
        drag = share * fibre.drag * fibre.length / n
        O.engines = O.engines[:-1] + [LinearDragEngine(nu=drag / (3 * math.pi * fibre.diameter), ids=ids)] + O.engines[-1:]
    foot, tip = O.bodies[nodes[0]].state, O.bodies[nodes[-1]].state
    every = max(1, int(scenes.REFRESH / O.dt))
    O.dt = scenes.REFRESH / every
    start = scenes.flow(0.0)[0]
    for node in nodes:
        O.bodies[node].state.vel = Vector3(0, -start, 0)
    history = []
    samples = round(scenes.SAMPLE / scenes.REFRESH)

    def follow():
        velocity, acceleration = scenes.flow(O.time + 0.5 * scenes.REFRESH)
        foot.vel = Vector3(0, -velocity, 0)
        newton.gravity = Vector3(0, -acceleration, 0)
        if (O.iter // every) % samples == 0:
            history.append((O.time, tip.pos[1] - foot.pos[1]))

    globals()["follow"] = follow
    runner = PyRunner(iterPeriod=every, initRun=True, command="follow()")
    O.engines = [runner] + O.engines
    seconds, steps = timed(part * scenes.DURATION / O.dt + 1)
    return {"n": n, "seconds": seconds / part, "steps": steps, "part": part, "error": scenes.history_error(fibre, history)}


def throughput(path, n, steps, kind):
    fibre = scenes.SOFT
    edge, rods = scenes.read_suspension(path)
    O.periodic = True
    O.cell.setBox(edge, edge, edge)
    materials(fibre, 1e6)
    engines(fibre, contacts=True)
    contact = kind == "contact"
    fibres = []
    for rod in rods:
        points = [rod[:3] + rod[3:6] * fibre.length * (k / n - 0.5) for k in range(n + 1)]
        fibres.append(chain(points, fibre))
    O.dt = 0.5 * critical_step(fibre, n)

    def touching():
        real = [i for i in O.interactions if i.isReal and isinstance(i.phys, FrictPhys) and not isinstance(i.phys, CohFrictPhys)]
        deep = [i.geom.penetrationDepth for i in real if i.phys.normalForce.norm() > 0]
        return len(deep), max(deep, default=0.0)

    def still():
        for ids in fibres:
            for node in ids:
                O.bodies[node].state.vel = O.bodies[node].state.angVel = Vector3(0, 0, 0)

    if contact:
        newton.damping = 0.8
        for _ in range(10):
            O.run(100, True)
            still()
        newton.damping = 0.0
    for ids, rod in zip(fibres, rods):
        for node in ids:
            O.bodies[node].state.vel = Vector3(*rod[6:9])
    O.run(50, True)
    first, depth = touching()
    searches = collider.numAction
    seconds, done = timed(steps)
    last, later = touching()
    return {"fibres": len(rods), "segments": n * len(rods), "threads": O.numThreads, "substep": O.dt, "substeps": done,
            "seconds": seconds, "segment_substeps_per_s": n * len(rods) * done / seconds, "contacts_start": first,
            "contacts_end": last, "max_overlap": max(depth, later) / fibre.diameter,
            "candidates": len(O.interactions) - n * len(rods), "searches": collider.numAction - searches}  # fmt: skip


def main():
    what, *rest = sys.argv[1:]
    if what == "throughput":
        row = throughput(rest[0], int(rest[1]), int(rest[2]), rest[3])
    elif what == "flexure":
        row = flexure(float(rest[0]), float(rest[1]), int(rest[2]), float(rest[3]))
    else:
        row = {"cantilever": cantilever, "vibration": vibration}[what](int(rest[0]))
    print(",".join(row))
    print(",".join(str(value) for value in row.values()), flush=True)


main()
