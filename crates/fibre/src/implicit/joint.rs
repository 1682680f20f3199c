//! Fibres that touch, in one implicit step: contacts in the same equations as the beams.
//!
//! Implicit Euler, since the extrapolation of a method of second order bounces off a contact: first order in time, no
//! energy from collisions at any step. Each Newton iteration solves (A + C) δ = r, A the block-tridiagonal matrices of
//! the fibres (made symmetric) and C the stiffness of the contacts (penalty, with friction sticking or sliding as in the
//! last iteration), by conjugate gradients preconditioned with A: as z = A⁻¹r, A p follows from r without a product.
//! A step of the iteration is cut so that no centre line can reach another on its way, and taken back in part where it
//! has gone too far: where the residual at its end points against it by more than half of what it pointed along it at
//! the start (the curvature condition of a line search, which needs no energy and so allows friction). Where the
//! iteration does not end, the sub-step is halved. A leaves out how compression softens a beam, which keeps it positive.

use super::rotation::{rotation_between, turned};
use super::stage::stacked;
use super::{Action, Base, Done, Entry, ImplicitSettings, Workspace};
use crate::contact::ContactSystem;
use crate::integrate::{Batch, Flow};
use crate::system::{Load, Model, Motion, Scratch};
use crate::touching::Axes;
use crate::{FibreError, Reaction, Vector3};
use fibreflow_parallel::Communicator;
use nalgebra::Vector6;
use std::sync::Mutex;

/// Change of a position over the fibre's radius, or of a rotation, that is good enough: the tolerance of the step times
/// how far things have moved in it, within these bounds. A few more iterations then try to get below the lower one,
/// which they do at once where no friction slides.
const CLOSE: [f64; 2] = [1e-6, 1e-3];
const MOST_ITERATIONS: usize = 80;
const POLISHING: usize = 3;
/// Part of the first slope that the last one may reach below zero, and how often a step is taken back for it.
const OVERSHOOT: f64 = 0.5;
const MOST_RETREATS: usize = 6;
/// Largest rotation of one Newton step.
const STRIDE: f64 = 0.4;
/// Conjugate gradients end when the preconditioned norm of the residual has fallen by the square of how much it fell in
/// the last iteration (Eisenstat & Walker 1996), within these bounds.
const REDUCTION: [f64; 2] = [1e-6, 0.1];
const MOST_GRADIENTS: usize = 400;
/// Halvings of a sub-step.
const MOST_HALVINGS: u32 = 12;

/// Work space of the joint solution: of every fibre, and of all nodes.
#[derive(Default)]
pub(crate) struct Joint {
    fibres: Vec<Mutex<Part>>,
    shift: Vec<Vector3>,
    turn: Vec<Vector3>,
    /// Parts of their displacements that segments may make.
    strides: Vec<f64>,
}

/// Vectors of conjugate gradients for one fibre.
#[derive(Default)]
struct Part {
    work: Workspace,
    answer: Vec<Vector6<f64>>,
    residual: Vec<Vector6<f64>>,
    direction: Vec<Vector6<f64>>,
    /// A × direction
    image: Vec<Vector6<f64>>,
    /// (A + C) × direction
    product: Vec<Vector6<f64>>,
    dot: f64,
    /// What was made of the last answer.
    made: Vec<Vector6<f64>>,
    /// Residual at the start of the iteration.
    start: Vec<Vector6<f64>>,
    /// `made` · residual, before and after it was made.
    slopes: [f64; 2],
    /// Largest change of the iteration, and largest way since the start of the sub-step: positions over the radius, rotations.
    sizes: [f64; 2],
}

/// What a step is made of.
pub(crate) struct Parties<'a> {
    pub model: &'a Model,
    pub motion: &'a mut Motion,
    pub scratch: &'a mut Scratch,
    pub reaction: &'a mut Reaction,
    pub contacts: &'a mut ContactSystem,
    pub communicator: &'a Communicator,
    pub flow: Option<Flow<'a>>,
}

impl Joint {
    /// Whether there is no work space yet.
    pub fn is_empty(&self) -> bool {
        self.fibres.is_empty()
    }

    /// Fits the work space to the model.
    pub fn resize(&mut self, model: &Model) {
        let nodes = model.nodes.len();
        self.shift.resize(nodes, Vector3::zeros());
        self.turn.resize(nodes, Vector3::zeros());
        self.fibres.clear();
        for f in 0..model.fibres.len() {
            let nodes = model.node_range(f).len();
            let mut part = Part::default();
            part.work.resize(nodes, false);
            for vector in [
                &mut part.answer,
                &mut part.residual,
                &mut part.direction,
                &mut part.image,
                &mut part.product,
                &mut part.made,
                &mut part.start,
            ] {
                vector.resize(nodes, Vector6::zeros());
            }
            self.fibres.push(Mutex::new(part));
        }
    }

    /// Advances all fibres of all ranks by `dt`. Collective.
    pub fn advance(
        &mut self,
        parties: &mut Parties,
        axes: &Axes,
        dt: f64,
        settings: &ImplicitSettings,
    ) -> Result<Done, FibreError> {
        parties.reaction.force.fill(Vector3::zeros());
        parties.reaction.torque.fill(Vector3::zeros());
        let (mut passed, mut h, mut sub_steps, mut halvings) = (0.0, dt, 0, 0);
        let begin = parties.contacts.time();
        while passed < dt * (1.0 - 1e-12) {
            h = h.min(dt - passed);
            parties.contacts.set_time(begin + passed + h);
            let moment = (passed + h) / dt;
            if self.sub_step(parties, axes, h, moment, h / dt, settings)? {
                passed += h;
                sub_steps += 1;
            } else if halvings < MOST_HALVINGS {
                halvings += 1;
                h *= 0.5;
            } else {
                return Ok(Done {
                    sub_steps,
                    converged: false,
                });
            }
        }
        Ok(Done {
            sub_steps,
            converged: true,
        })
    }

    /// Whether an answer was found; if not, the motion is that of before.
    fn sub_step(
        &mut self,
        parties: &mut Parties,
        axes: &Axes,
        h: f64,
        moment: f64,
        share: f64,
        settings: &ImplicitSettings,
    ) -> Result<bool, FibreError> {
        let action = Action {
            model: parties.model,
            flow: parties.flow,
            settings,
            symmetric: true,
        };
        self.for_each(parties, &|fibre, part| fibre.begin_joint(&action, part, h));
        // A first guess: on with the velocities of before.
        self.gather(parties.model, |part| &part.answer);
        parties.contacts.update(&axes.moving(parties.motion))?;
        parties.contacts.settle(&axes.moving(parties.motion));
        let part = self.stride(parties, axes);
        self.for_each(parties, &|fibre, own| fibre.guess(own, h, part));
        let (mut retreats, mut polished, mut last_norm) = (0, 0, None::<f64>);
        for iteration in 0..MOST_ITERATIONS {
            parties.contacts.update(&axes.moving(parties.motion))?;
            self.displacements(parties);
            let segments = axes.moving(parties.motion);
            parties
                .contacts
                .linearise(&segments, &self.shift, &self.turn, h);
            let contacts = &*parties.contacts;
            let scene = (parties.model, contacts);
            for_each(
                &self.fibres,
                (
                    parties.model,
                    parties.motion,
                    parties.scratch,
                    parties.reaction,
                ),
                &|fibre, part| fibre.begin_iteration(&action, part, scene.1, h, moment),
            );
            let slopes = [0, 1].map(|k| self.reduce(|part| part.slopes[k], add));
            let [first, last] = slopes.map(|slope| parties.communicator.sum(slope));
            if iteration > 0 && retreats < MOST_RETREATS && last < -OVERSHOOT * first {
                // To where the slope would vanish if it fell evenly.
                let back = (last / (last - first)).clamp(0.1, 0.9);
                self.for_each(parties, &|fibre, own| fibre.retreat(&action, own, h, back));
                retreats += 1;
                continue;
            }
            retreats = 0;
            self.for_each(parties, &|_, part| part.begin_solve());
            let square = parties.communicator.sum(self.reduce(|part| part.dot, add));
            let fallen = last_norm.map_or(1.0, |last| square / last);
            last_norm = Some(square);
            let reduction = fallen.clamp(REDUCTION[0], REDUCTION[1]);
            if !self.solve(parties, axes, square, reduction) {
                break;
            }
            self.gather(parties.model, |part| &part.answer);
            let segments = axes.moving(parties.motion);
            let contacts = &mut *parties.contacts;
            contacts.strides(&segments, &self.shift, &self.turn, &mut self.strides);
            let strides = &self.strides;
            self.for_each(parties, &|fibre, own| {
                fibre.end_iteration(&action, own, h, strides);
            });
            let [size, moved] = [0, 1].map(|k| self.reduce(|part| part.sizes[k], f64::max));
            let [size, moved] = [size, moved].map(|x| parties.communicator.max(x));
            if !size.is_finite() {
                break;
            }
            let enough = (settings.tolerance * moved).clamp(CLOSE[0], CLOSE[1]);
            polished += usize::from(size < enough || polished > 0);
            if size < CLOSE[0] || size < enough && polished > POLISHING {
                // The contacts of the last iteration are those of this answer up to its last change.
                self.for_each(parties, &|fibre, part| {
                    fibre.exchange(&action, share, moment);
                    fibre.exchange_inertia(&action, &part.work.base, h, share, moment);
                });
                parties.contacts.commit(h);
                if parties.contacts.counts_crossings() {
                    let segments = axes.moving(parties.motion);
                    parties.contacts.settle(&segments);
                    parties.contacts.count_crossings(&segments, h);
                }
                return Ok(true);
            }
        }
        self.for_each(parties, &|fibre, part| {
            fibre.load_entries(&part.work.first);
        });
        Ok(false)
    }

    /// Part of `answer` that is made: no centre line meets another, and nothing turns far.
    fn stride(&mut self, parties: &mut Parties, axes: &Axes) -> f64 {
        let turned = self.turn.iter().fold(0.0, |a: f64, b| a.max(b.norm()));
        let turned = parties.communicator.max(turned);
        let segments = axes.moving(parties.motion);
        let free = parties.contacts.stride(&segments, &self.shift, &self.turn);
        free.min(STRIDE / turned.max(STRIDE))
    }

    /// (A + C) answer = residual, of the `square` of the preconditioned norm, to this `reduction` of the norm. Whether the matrix is positive, as it must be for an answer that goes downhill.
    fn solve(&mut self, parties: &mut Parties, axes: &Axes, square: f64, reduction: f64) -> bool {
        let mut rz = square;
        let enough = rz * reduction * reduction;
        for _ in 0..MOST_GRADIENTS {
            if rz <= enough {
                return rz >= 0.0;
            }
            self.gather(parties.model, |part| &part.direction);
            let segments = axes.moving(parties.motion);
            parties.contacts.change(&segments, &self.shift, &self.turn);
            let contacts = &*parties.contacts;
            for_each(
                &self.fibres,
                (
                    parties.model,
                    parties.motion,
                    parties.scratch,
                    parties.reaction,
                ),
                &|fibre, part| fibre.multiply(parties.model, part, contacts),
            );
            let curvature = parties.communicator.sum(self.reduce(|part| part.dot, add));
            if curvature.is_nan() || curvature <= 0.0 {
                return false;
            }
            let length = rz / curvature;
            self.for_each(parties, &|_, part| part.descend(length));
            let next = parties.communicator.sum(self.reduce(|part| part.dot, add));
            let ratio = next / rz;
            rz = next;
            self.for_each(parties, &|_, part| part.turn(ratio));
        }
        true
    }

    /// Puts a vector of the fibres into `shift` and `turn`.
    fn gather(&mut self, model: &Model, vector: impl Fn(&Part) -> &Vec<Vector6<f64>>) {
        for (f, part) in self.fibres.iter_mut().enumerate() {
            let part = part.get_mut().unwrap_or_else(|e| e.into_inner());
            for (i, x) in model.node_range(f).zip(vector(part)) {
                self.shift[i] = x.fixed_rows::<3>(0).into();
                self.turn[i] = x.fixed_rows::<3>(3).into();
            }
        }
    }

    /// Displacements since the start of the sub-step in `shift` and `turn`.
    fn displacements(&mut self, parties: &Parties) {
        for (f, part) in self.fibres.iter_mut().enumerate() {
            let part = part.get_mut().unwrap_or_else(|e| e.into_inner());
            for (i, first) in parties.model.node_range(f).zip(&part.work.first) {
                self.shift[i] = parties.motion.position[i] - first.position;
                let q = &parties.motion.orientation[i];
                self.turn[i] = rotation_between(&first.orientation, q);
            }
        }
    }

    fn reduce(&mut self, value: impl Fn(&Part) -> f64, join: impl Fn(f64, f64) -> f64) -> f64 {
        let parts = self.fibres.iter_mut();
        let values = parts.map(|part| value(part.get_mut().unwrap_or_else(|e| e.into_inner())));
        values.fold(0.0, join)
    }

    fn for_each(&self, parties: &mut Parties, work: &(impl Fn(&mut Batch, &mut Part) + Sync)) {
        for_each(
            &self.fibres,
            (
                parties.model,
                parties.motion,
                parties.scratch,
                parties.reaction,
            ),
            work,
        );
    }
}

fn add(a: f64, b: f64) -> f64 {
    a + b
}

/// Runs `work` on every fibre with its part, over threads.
fn for_each(
    parts: &[Mutex<Part>],
    (model, motion, scratch, reaction): (&Model, &mut Motion, &mut Scratch, &mut Reaction),
    work: &(impl Fn(&mut Batch, &mut Part) + Sync),
) {
    Batch::all(model, motion, scratch, reaction).for_each(model, &|fibre| {
        // Each fibre is worked on by one thread: nobody waits.
        let mut part = parts[fibre.fibres.start]
            .lock()
            .unwrap_or_else(|e| e.into_inner());
        work(fibre, &mut part);
    });
}

fn dot(a: &[Vector6<f64>], b: &[Vector6<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

impl Part {
    /// One step along the direction; `dot` is r·A⁻¹r after it, A⁻¹r stands in `work.rhs`.
    fn descend(&mut self, length: f64) {
        for i in 0..self.answer.len() {
            self.answer[i] += self.direction[i] * length;
            self.residual[i] -= self.product[i] * length;
        }
        self.precondition();
    }

    /// Factors the matrix and takes the first direction.
    fn begin_solve(&mut self) {
        self.work.factor();
        self.answer.fill(Vector6::zeros());
        self.start.copy_from_slice(&self.residual);
        self.precondition();
        self.direction.copy_from_slice(&self.work.rhs);
        self.image.copy_from_slice(&self.residual);
    }

    fn precondition(&mut self) {
        self.work.rhs.copy_from_slice(&self.residual);
        self.work.solve();
        self.dot = dot(&self.residual, &self.work.rhs);
    }

    /// The next direction.
    fn turn(&mut self, ratio: f64) {
        for i in 0..self.direction.len() {
            self.direction[i] = self.work.rhs[i] + self.direction[i] * ratio;
            self.image[i] = self.residual[i] + self.image[i] * ratio;
        }
    }
}

impl Batch<'_> {
    /// Remembers the state and puts the displacement with the present velocities into `answer`.
    fn begin_joint(&mut self, action: &Action, part: &mut Part, h: f64) {
        let range = action.model.node_range(self.fibres.start);
        self.store(&mut part.work.first);
        for (i, node) in action.model.nodes[range].iter().enumerate() {
            let Entry {
                position,
                velocity,
                orientation,
                angular_velocity,
            } = part.work.first[i];
            part.work.base[i] = Base {
                position,
                velocity,
                orientation,
                spin: node.spin(&orientation, &angular_velocity),
            };
            part.answer[i] = stacked(&(velocity * h), &(angular_velocity * h));
        }
    }

    /// Goes `fraction` of `answer`.
    fn guess(&mut self, part: &mut Part, h: f64, fraction: f64) {
        for (i, base) in part.work.base.iter().enumerate() {
            let change = part.answer[i] * fraction;
            let step: Vector3 = change.fixed_rows::<3>(0).into();
            let angle: Vector3 = change.fixed_rows::<3>(3).into();
            self.position[i] = base.position + step;
            self.velocity[i] = step / h;
            self.orientation[i] = turned(&base.orientation, &angle);
            self.angular_velocity[i] = angle / h;
        }
    }

    /// Equations of one fibre with its contact loads.
    fn begin_iteration(
        &mut self,
        action: &Action,
        part: &mut Part,
        contacts: &ContactSystem,
        h: f64,
        moment: f64,
    ) {
        self.add_contacts(action.model, contacts);
        self.assemble(action, &mut part.work, h, moment);
        self.load.fill(Load::ZERO);
        part.residual.copy_from_slice(&part.work.rhs);
        part.slopes[1] = dot(&part.residual, &part.made);
    }

    /// Takes back a part of what was made.
    fn retreat(&mut self, action: &Action, part: &mut Part, h: f64, back: f64) {
        let nodes = &action.model.nodes[action.model.node_range(self.fibres.start)];
        part.work.rhs.copy_from_slice(&part.made);
        self.change(nodes, &part.work, h, -back);
        for made in &mut part.made {
            *made *= 1.0 - back;
        }
        part.slopes[0] *= 1.0 - back;
    }

    /// `product` of the direction; `dot` is direction·product.
    fn multiply(&mut self, model: &Model, part: &mut Part, contacts: &ContactSystem) {
        self.add_contacts(model, contacts);
        let nodes = &model.nodes[model.node_range(self.fibres.start)];
        for (i, node) in nodes.iter().enumerate() {
            let load = std::mem::replace(&mut self.load[i], Load::ZERO);
            let free = |held: bool, v: Vector3| if held { Vector3::zeros() } else { v };
            part.product[i] = part.image[i]
                - stacked(
                    &free(node.holds_translation, load.force),
                    &free(node.holds_rotation, load.torque),
                );
        }
        part.dot = dot(&part.direction, &part.product);
    }

    /// Moves by as much of `answer` as the `strides` of the segments allow.
    fn end_iteration(&mut self, action: &Action, part: &mut Part, h: f64, strides: &[f64]) {
        let fibre = self.fibres.start;
        let range = action.model.segment_range(fibre);
        let radii = action.model.segments[range.clone()]
            .iter()
            .map(|s| s.radius);
        let radius = radii.fold(f64::INFINITY, f64::min);
        let size = |shift: Vector3, turn: f64| (shift.norm() / radius).max(turn);
        let own = &strides[range];
        let mut fraction = own.iter().copied().fold(1.0, f64::min);
        part.sizes = [0.0; 2];
        for (i, change) in part.answer.iter().enumerate() {
            let turned = change.fixed_rows::<3>(3).norm();
            fraction = fraction.min(STRIDE / turned.max(STRIDE));
            let first = &part.work.first[i];
            let way = rotation_between(&first.orientation, &self.orientation[i]).norm();
            let both = [
                size(change.fixed_rows::<3>(0).into(), turned),
                size(self.position[i] - first.position, way),
            ];
            for (largest, value) in part.sizes.iter_mut().zip(both) {
                // Written so that a NaN stays.
                if value > *largest || value.is_nan() {
                    *largest = value;
                }
            }
        }
        for (made, change) in part.made.iter_mut().zip(&part.answer) {
            *made = change * fraction;
        }
        part.slopes[0] = dot(&part.start, &part.made);
        part.work.rhs.copy_from_slice(&part.made);
        let nodes = &action.model.nodes[action.model.node_range(fibre)];
        self.change(nodes, &part.work, h, 1.0);
    }
}
