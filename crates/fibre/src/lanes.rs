//! Explicit sub-steps of an elastic fibre in vectors: its state is turned into columns, and the loops over segments and
//! nodes take eight entries at once through the same formulae as [`crate::integrate`].

use crate::beam::{Pose, SMALL_TWIST, Strain, arc_tangent, small_arc_tangent, tangent};
use crate::integrate::{Batch, SMALL_TURN, half_turn, small_half_turn, turn};
use crate::system::Model;
use crate::{Quaternion, Vector3};
use std::cell::RefCell;
use std::ops::Range;

mod packed;

use packed::Constants;
pub(crate) use packed::Packed;

/// Entries that are computed at once.
const WIDTH: usize = 8;

type Lane = [f64; WIDTH];

const POSITION: usize = 0;
const VELOCITY: usize = 3;
const ORIENTATION: usize = 6;
const SPIN: usize = 10;
const STATE: usize = 13;
/// Columns of what segments exert: force, start torque, end torque.
const EXERTED: usize = 9;

/// State of one fibre in columns, one entry a node, and what its segments exert: entry i + 1 is that of segment i, so
/// that a node finds the two segments it joins at its own entry and the next. Zero past the end.
#[derive(Default)]
struct Work {
    nodes: usize,
    stride: usize,
    state: Vec<f64>,
    exerted: Vec<f64>,
}

thread_local! {
    static WORK: RefCell<Work> = RefCell::default();
}

#[inline(always)]
fn lane(columns: &[f64], at: usize) -> Lane {
    *columns[at..].first_chunk().expect("columns are padded")
}

#[inline(always)]
fn vector(lanes: &[Lane], l: usize) -> Vector3 {
    Vector3::new(lanes[0][l], lanes[1][l], lanes[2][l])
}

#[inline(always)]
fn quaternion(lanes: &[Lane], l: usize) -> Quaternion {
    let q = nalgebra::Quaternion::new(lanes[0][l], lanes[1][l], lanes[2][l], lanes[3][l]);
    Quaternion::new_unchecked(q)
}

#[inline(always)]
fn set(lanes: &mut [Lane], l: usize, v: &Vector3) {
    for axis in 0..3 {
        lanes[axis][l] = v[axis];
    }
}

#[inline(always)]
fn set_quaternion(lanes: &mut [Lane], l: usize, q: &Quaternion) {
    lanes[0][l] = q.w;
    lanes[1][l] = q.i;
    lanes[2][l] = q.j;
    lanes[3][l] = q.k;
}

impl Work {
    fn fit(&mut self, nodes: usize) {
        if self.nodes != nodes {
            self.nodes = nodes;
            self.stride = nodes.div_ceil(WIDTH) * WIDTH + WIDTH;
            self.state.clear();
            self.state.resize(STATE * self.stride, 0.0);
            self.exerted.clear();
            self.exerted.resize(EXERTED * self.stride, 0.0);
        }
    }

    #[inline(always)]
    fn read<const N: usize>(&self, column: usize, at: usize) -> [Lane; N] {
        std::array::from_fn(|c| lane(&self.state, (column + c) * self.stride + at))
    }

    #[inline(always)]
    fn write(&mut self, column: usize, at: usize, lanes: &[Lane]) {
        for (c, lane) in lanes.iter().enumerate() {
            let first = (column + c) * self.stride + at;
            self.state[first..first + WIDTH].copy_from_slice(lane);
        }
    }

    fn load(&mut self, batch: &Batch) {
        self.fit(batch.position.len());
        let stride = self.stride;
        let mut columns = self.state.chunks_exact_mut(stride);
        let mut next = || columns.next().expect("one column a component");
        let mut vectors = |from: &[Vector3]| {
            let (x, y, z) = (next(), next(), next());
            for (i, v) in from.iter().enumerate() {
                (x[i], y[i], z[i]) = (v.x, v.y, v.z);
            }
        };
        vectors(batch.position);
        vectors(batch.velocity);
        let (w, i, j, k) = (next(), next(), next(), next());
        for (n, q) in batch.orientation.iter().enumerate() {
            (w[n], i[n], j[n], k[n]) = (q.w, q.i, q.j, q.k);
        }
        let (x, y, z) = (next(), next(), next());
        for (i, v) in batch.angular_velocity.iter().enumerate() {
            (x[i], y[i], z[i]) = (v.x, v.y, v.z);
        }
    }

    fn store(&self, batch: &mut Batch) {
        let column = |c: usize| &self.state[c * self.stride..(c + 1) * self.stride];
        let vectors = |to: &mut [Vector3], c: usize| {
            let (x, y, z) = (column(c), column(c + 1), column(c + 2));
            for (i, v) in to.iter_mut().enumerate() {
                *v = Vector3::new(x[i], y[i], z[i]);
            }
        };
        vectors(batch.position, POSITION);
        vectors(batch.velocity, VELOCITY);
        vectors(batch.angular_velocity, SPIN);
        let [w, i, j, k] = [0, 1, 2, 3].map(|c| column(ORIENTATION + c));
        for (n, q) in batch.orientation.iter_mut().enumerate() {
            *q = Quaternion::new_unchecked(nalgebra::Quaternion::new(w[n], i[n], j[n], k[n]));
        }
    }

    /// What the segments exert at the present positions.
    fn strain(&mut self, constants: &[Constants]) {
        for (block, constants) in constants.iter().enumerate() {
            let at = block * WIDTH;
            let ends = [at, at + 1].map(|at| (self.read(POSITION, at), self.read(ORIENTATION, at)));
            let lanes = exert(constants, &ends);
            for (c, lane) in lanes.iter().enumerate() {
                let first = c * self.stride + at + 1;
                self.exerted[first..first + WIDTH].copy_from_slice(lane);
            }
        }
        let (nodes, stride) = (self.nodes, self.stride);
        for column in self.exerted.chunks_exact_mut(stride) {
            column[nodes..].fill(0.0);
        }
    }

    /// Kicks by what is exerted and given over `step`, then drifts for `drift`.
    fn move_on(&mut self, constants: &[Constants], step: f64, drift: f64) {
        for (block, c) in constants.iter().enumerate() {
            let at = block * WIDTH;
            let exerted: [[Lane; EXERTED]; 2] = [at, at + 1].map(|at| {
                std::array::from_fn(|column| lane(&self.exerted, column * self.stride + at))
            });
            let mut position: [Lane; 3] = self.read(POSITION, at);
            let mut velocity: [Lane; 3] = self.read(VELOCITY, at);
            let mut orientation: [Lane; 4] = self.read(ORIENTATION, at);
            let mut spin: [Lane; 3] = self.read(SPIN, at);
            let [before, after] = &exerted;
            for l in 0..WIDTH {
                let force =
                    vector(&c.force, l) + vector(&before[0..3], l) - vector(&after[0..3], l);
                let torque =
                    vector(&c.torque, l) + vector(&before[6..9], l) + vector(&after[3..6], l);
                let t = tangent(&quaternion(&orientation, l));
                let v = vector(&velocity, l) + force * (step * c.mobility[l]);
                let turning = torque * c.across[l] + t * (c.along[l] * torque.dot(&t));
                let w = vector(&spin, l) + turning * step;
                let x = vector(&position, l) + v * drift;
                set(&mut position, l, &x);
                set(&mut velocity, l, &v);
                set(&mut spin, l, &w);
            }
            // The parts of the rotation are about as fast as the whole.
            let fastest = (0..WIDTH).map(|l| vector(&spin, l).norm_squared());
            let angle = 0.25 * drift * drift * fastest.fold(0.0, f64::max);
            if angle < SMALL_TURN {
                turn_all(
                    &mut orientation,
                    &mut spin,
                    &c.flatness,
                    drift,
                    small_half_turn,
                );
            } else {
                turn_all(&mut orientation, &mut spin, &c.flatness, drift, half_turn);
            }
            self.write(POSITION, at, &position);
            self.write(VELOCITY, at, &velocity);
            self.write(ORIENTATION, at, &orientation);
            self.write(SPIN, at, &spin);
        }
    }
}

/// Force, start torque and end torque of eight segments between two ends.
#[inline(always)]
fn exert(constants: &Constants, ends: &[([Lane; 3], [Lane; 4]); 2]) -> [Lane; EXERTED] {
    let [start, end] = ends;
    let mut chord = [[0.0; WIDTH]; 3];
    let mut tangents = [[0.0; WIDTH]; 6];
    let [mut length, mut inverse_length, mut half_twist] = [[0.0; WIDTH]; 3];
    for l in 0..WIDTH {
        let [p, q] = [start, end].map(|(x, q)| (vector(x, l), quaternion(q, l)));
        let pose = |(position, orientation)| Pose {
            position,
            orientation,
        };
        let e = Strain::new(
            &constants.segment(l),
            pose((&p.0, &p.1)),
            pose((&q.0, &q.1)),
        );
        set(&mut chord, l, &e.chord);
        set(&mut tangents[0..3], l, &e.start_tangent);
        set(&mut tangents[3..6], l, &e.end_tangent);
        length[l] = e.length;
        inverse_length[l] = e.inverse_length;
        half_twist[l] = e.half_twist;
    }
    let strains = Strains {
        chord,
        tangents,
        length,
        inverse_length,
        half_twist,
    };
    // What is no number, past the end of the fibre, may go either way.
    if half_twist.iter().any(|y| y * y >= SMALL_TWIST) {
        strains.forces(constants, arc_tangent)
    } else {
        strains.forces(constants, small_arc_tangent)
    }
}

struct Strains {
    chord: [Lane; 3],
    tangents: [Lane; 6],
    length: Lane,
    inverse_length: Lane,
    half_twist: Lane,
}

impl Strains {
    #[inline(always)]
    fn forces(&self, constants: &Constants, arc_tangent: impl Fn(f64) -> f64) -> [Lane; EXERTED] {
        let mut lanes = [[0.0; WIDTH]; EXERTED];
        for l in 0..WIDTH {
            let e = Strain {
                chord: vector(&self.chord, l),
                length: self.length[l],
                inverse_length: self.inverse_length[l],
                start_tangent: vector(&self.tangents[0..3], l),
                end_tangent: vector(&self.tangents[3..6], l),
                half_twist: self.half_twist[l],
            };
            let f = e.force(&constants.segment(l), 2.0 * arc_tangent(e.half_twist));
            set(&mut lanes[0..3], l, &f.force);
            set(&mut lanes[3..6], l, &f.start_torque);
            set(&mut lanes[6..9], l, &f.end_torque);
        }
        lanes
    }
}

/// Eight frames through a drift.
#[inline(always)]
fn turn_all(
    orientation: &mut [Lane; 4],
    spin: &mut [Lane; 3],
    flatness: &Lane,
    drift: f64,
    half_turn: impl Fn(f64) -> (f64, f64),
) {
    for l in 0..WIDTH {
        let (mut q, mut w) = (quaternion(orientation, l), vector(spin, l));
        turn(&mut q, &mut w, flatness[l], drift, &half_turn);
        set_quaternion(orientation, l, &q);
        set(spin, l, &w);
    }
}

impl Batch<'_> {
    /// Sub-steps `range` of `n` of one elastic fibre without drag, each from the middle of its first drift on.
    pub fn leap(&mut self, model: &Model, range: Range<usize>, n: usize, step: f64) {
        let constants = model.packed.of(self.fibres.start);
        WORK.with_borrow_mut(|work| {
            work.load(self);
            for k in range {
                work.strain(constants);
                work.move_on(constants, step, if k + 1 < n { step } else { 0.5 * step });
            }
            work.store(self);
        });
    }

    /// Whether [`Batch::leap`] knows all that acts on the fibre.
    pub fn leaps(&self, model: &Model, in_flow: bool) -> bool {
        let fibre = &model.fibres[self.fibres.start];
        let material = &fibre.material;
        let elastic = material.retardation == 0.0 && material.bending_ratio == 1.0;
        !in_flow && elastic && !fibre.only_implicit() && !model.packed.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Fibre, FibreSettings, FibreSystem, Material, Support};
    use fibreflow_parallel::Communicator;

    /// Two helices, one held and loaded, with more nodes than lanes; `spin` decides which branches they take.
    fn helices(spin: f64) -> FibreSystem {
        let node = |i: u32| {
            let a = 0.2 * f64::from(i);
            Vector3::new(a.cos(), a.sin(), 0.3 * a)
        };
        let fibre = |id: u64, nodes: u32| {
            let material = Material::new(0.05, 1e6, 0.3, 1000.0);
            Fibre::new(id, material, (0..nodes).map(node).collect())
        };
        let mut held = fibre(0, 11);
        held.supports = vec![Support::clamp(0)];
        let settings = FibreSettings {
            gravity: Vector3::z() * -9.0,
            ..FibreSettings::default()
        };
        let fibres = vec![held, fibre(1, 24)];
        let mut s = FibreSystem::new(Communicator::single(), settings, fibres).expect("valid");
        s.add_load(0, 10, Vector3::x(), Vector3::y())
            .expect("a node");
        for (i, w) in s.angular_velocities_mut().iter_mut().enumerate() {
            *w = Vector3::new((i as f64).sin(), (i as f64).cos(), 0.3) * spin;
        }
        s
    }

    #[test]
    fn lanes_do_what_single_nodes_do() {
        for spin in [1.0, 400.0] {
            let n = 20;
            let run = |in_lanes: bool| {
                let mut s = helices(spin);
                let step = 0.2 * s.critical_step();
                s.model.packed = Packed::new(&s.model);
                let model = &s.model;
                let all = Batch::all(model, &mut s.motion, &mut s.scratch, &mut s.reaction);
                all.for_each(model, &|fibre| {
                    fibre.begin(model, None, step);
                    if in_lanes {
                        fibre.leap(model, 0..n / 2, n, step);
                        fibre.leap(model, n / 2..n, n, step);
                    } else {
                        (0..n).for_each(|k| fibre.sub_step(model, false, k, n, step));
                    }
                });
                s.motion
            };
            let (one, other) = (run(false), run(true));
            let fastest = one.velocity.iter().map(Vector3::norm).fold(0.0, f64::max);
            for i in 0..one.position.len() {
                let moved = (one.position[i] - other.position[i]).norm();
                let slower = (one.velocity[i] - other.velocity[i]).norm();
                let turned = one.orientation[i].angle_to(&other.orientation[i]);
                assert!(moved < 1e-12 && slower < 1e-11 * fastest && turned < 1e-7);
            }
        }
    }
}
