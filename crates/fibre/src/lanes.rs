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

    /// Takes the places of a fibre's nodes.
    fn load_poses(&mut self, batch: &Batch) {
        self.fit(batch.position.len());
        self.load_vectors(POSITION, batch.position);
        let mut columns = self.state[ORIENTATION * self.stride..].chunks_exact_mut(self.stride);
        let [w, i, j, k] = std::array::from_fn(|_| columns.next().expect("a component"));
        for (n, q) in batch.orientation.iter().enumerate() {
            (w[n], i[n], j[n], k[n]) = (q.w, q.i, q.j, q.k);
        }
    }

    fn load_vectors(&mut self, column: usize, from: &[Vector3]) {
        let mut columns = self.state[column * self.stride..].chunks_exact_mut(self.stride);
        let [x, y, z] = std::array::from_fn(|_| columns.next().expect("a component"));
        for (i, v) in from.iter().enumerate() {
            (x[i], y[i], z[i]) = (v.x, v.y, v.z);
        }
    }

    fn column(&self, c: usize) -> &[f64] {
        &self.state[c * self.stride..(c + 1) * self.stride]
    }

    fn store_vectors(&self, column: usize, to: &mut [Vector3]) {
        let [x, y, z] = [0, 1, 2].map(|c| self.column(column + c));
        for (i, v) in to.iter_mut().enumerate() {
            *v = Vector3::new(x[i], y[i], z[i]);
        }
    }

    fn store_orientations(&self, to: &mut [Quaternion]) {
        let [w, i, j, k] = [0, 1, 2, 3].map(|c| self.column(ORIENTATION + c));
        for (n, q) in to.iter_mut().enumerate() {
            *q = Quaternion::new_unchecked(nalgebra::Quaternion::new(w[n], i[n], j[n], k[n]));
        }
    }

    /// What the segments before and after a node exert on it: force and torque.
    #[inline(always)]
    fn on_node(&self, i: usize) -> [Vector3; 2] {
        let at = |column: usize, entry: usize| {
            Vector3::from_fn(|axis, _| self.exerted[(column + axis) * self.stride + entry])
        };
        [at(0, i) - at(0, i + 1), at(6, i) + at(3, i + 1)]
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
            turn_block(&mut orientation, &mut spin, &c.flatness, drift);
            self.write(POSITION, at, &position);
            self.write(VELOCITY, at, &velocity);
            self.write(ORIENTATION, at, &orientation);
            self.write(SPIN, at, &spin);
        }
    }

    /// Turns all frames for `drift`.
    fn turn(&mut self, constants: &[Constants], drift: f64) {
        for (block, c) in constants.iter().enumerate() {
            let at = block * WIDTH;
            let mut orientation: [Lane; 4] = self.read(ORIENTATION, at);
            let mut spin: [Lane; 3] = self.read(SPIN, at);
            turn_block(&mut orientation, &mut spin, &c.flatness, drift);
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
fn turn_block(orientation: &mut [Lane; 4], spin: &mut [Lane; 3], flatness: &Lane, drift: f64) {
    // The parts of the rotation are about as fast as the whole.
    let fastest = (0..WIDTH).map(|l| vector(spin, l).norm_squared());
    let angle = 0.25 * drift * drift * fastest.fold(0.0, f64::max);
    if angle < SMALL_TURN {
        turn_all(orientation, spin, flatness, drift, small_half_turn);
    } else {
        turn_all(orientation, spin, flatness, drift, half_turn);
    }
}

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
            work.load_poses(self);
            work.load_vectors(VELOCITY, self.velocity);
            work.load_vectors(SPIN, self.angular_velocity);
            for k in range {
                work.strain(constants);
                work.move_on(constants, step, if k + 1 < n { step } else { 0.5 * step });
            }
            work.store_vectors(POSITION, self.position);
            work.store_vectors(VELOCITY, self.velocity);
            work.store_orientations(self.orientation);
            work.store_vectors(SPIN, self.angular_velocity);
        });
    }

    /// [`Batch::sub_step`] of an elastic fibre with drag: what segments exert and how frames turn in lanes, the chain of
    /// nodes that drag ties together one by one.
    pub fn sub_step_in_lanes(&mut self, model: &Model, k: usize, n: usize, step: f64) {
        let constants = model.packed.of(self.fibres.start);
        let range = model.node_range(self.fibres.start);
        let drift = if k + 1 < n { step } else { 0.5 * step };
        WORK.with_borrow_mut(|work| {
            work.load_poses(self);
            work.strain(constants);
            let given = model.nodes[range.clone()].iter().zip(&model.loads[range]);
            for (i, (load, (node, given))) in self.load.iter_mut().zip(given).enumerate() {
                let [force, torque] = work.on_node(i);
                load.force += given.force + node.weight + force;
                load.torque += given.torque + torque;
            }
            let share = 1.0 / n as f64;
            self.kick_with_drag(model, step, share, (k as f64 + 0.5) * share);
            for (x, v) in self.position.iter_mut().zip(self.velocity.iter()) {
                *x += v * drift;
            }
            work.load_vectors(SPIN, self.angular_velocity);
            work.turn(constants, drift);
            work.store_orientations(self.orientation);
            work.store_vectors(SPIN, self.angular_velocity);
        });
    }

    /// Whether [`Batch::leap`] knows all that acts on the fibre.
    pub fn leaps(&self, model: &Model, in_flow: bool) -> bool {
        !in_flow && self.packed(model)
    }

    /// Whether lanes know all that acts inside the fibre.
    pub fn packed(&self, model: &Model) -> bool {
        let fibre = &model.fibres[self.fibres.start];
        let material = &fibre.material;
        let elastic = material.retardation == 0.0 && material.bending_ratio == 1.0;
        elastic && !fibre.only_implicit() && !model.packed.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hydrodynamics::{DragModel, FluidProperties, TorqueModel};
    use crate::integrate::Flow;
    use crate::{Ambient, Fibre, FibreSettings, FibreSystem, Hydrodynamics, Material, Matrix3};
    use crate::{Points, Support};
    use fibreflow_parallel::Communicator;

    /// Two helices, one held and loaded, with more nodes than lanes; `spin` decides which branches they take.
    fn helices(spin: f64, drag: bool) -> FibreSystem {
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
        let law = Hydrodynamics {
            fluid: FluidProperties {
                density: 1000.0,
                viscosity: 1.0,
            },
            drag: DragModel::default(),
            torque: TorqueModel::default(),
            point_spacing: f64::INFINITY,
        };
        let settings = FibreSettings {
            gravity: Vector3::z() * -9.0,
            hydrodynamics: drag.then_some(law),
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

    /// A shear that turns the fibres and drags them along.
    fn shear(s: &FibreSystem) -> Ambient {
        let gradient = Matrix3::new(0.0, 30.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        let mut points = Points::default();
        s.points(&mut points);
        Ambient {
            velocity: points.position.iter().map(|x| gradient * x).collect(),
            gradient: vec![gradient; points.position.len()],
            ..Ambient::default()
        }
    }

    #[test]
    fn lanes_do_what_single_nodes_do() {
        for (spin, drag) in [(1.0, false), (400.0, false), (1.0, true), (400.0, true)] {
            let n = 20;
            let run = |in_lanes: bool| {
                let mut s = helices(spin, drag);
                let step = 0.2 * s.critical_step();
                let ambient = shear(&s);
                let given = drag.then_some((&ambient, None));
                let flow = Flow::new(given, &s.settings, n as f64 * step).expect("a law");
                if in_lanes {
                    s.model.packed = Packed::new(&s.model);
                }
                let model = &s.model;
                let all = Batch::all(model, &mut s.motion, &mut s.scratch, &mut s.reaction);
                all.for_each(model, &|fibre| {
                    assert_eq!(fibre.packed(model), in_lanes);
                    fibre.begin(model, flow, step);
                    if in_lanes && !drag {
                        fibre.leap(model, 0..n / 2, n, step);
                        fibre.leap(model, n / 2..n, n, step);
                    } else {
                        (0..n).for_each(|k| fibre.sub_step(model, drag, k, n, step));
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
