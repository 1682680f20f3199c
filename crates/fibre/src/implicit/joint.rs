//! Fibres that touch, in one implicit step: contacts in the same equations as the beams.
//!
//! Implicit Euler, since the extrapolation of a method of second order bounces off a contact: first order in time, no
//! energy from collisions at any step. Each Newton iteration solves (A + C) δ = r, A the block-tridiagonal matrices of
//! the fibres (made symmetric) and C the stiffness of the contacts (penalty, with friction sticking or sliding as in the
//! last iteration), by conjugate gradients preconditioned with A: as z = A⁻¹r, A p follows from r without a product.
//! A step of the iteration is cut so that no centre line can reach another on its way; where the iteration does not
//! end, the sub-step is halved. A leaves out how compression softens a beam, which keeps it positive.

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

/// Change of a position over the fibre's radius, or of a rotation, at which Newton's iteration stops.
const CLOSE: f64 = 1e-5;
const MOST_ITERATIONS: usize = 60;
/// An iteration that shrinks the change by less than this is relaxed, down to the least part of a change.
const SLOW: f64 = 1.0;
const LEAST_RELAXATION: f64 = 0.25;
/// Largest rotation of one Newton step.
const STRIDE: f64 = 0.4;
/// Conjugate gradients end when the preconditioned norm of the residual has fallen by this.
const REDUCTION: f64 = 1e-4;
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
    size: f64,
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
            part.work.resize(nodes);
            for vector in [
                &mut part.answer,
                &mut part.residual,
                &mut part.direction,
                &mut part.image,
                &mut part.product,
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
        let (mut last, mut relaxed) = (f64::INFINITY, 1.0_f64);
        for _ in 0..MOST_ITERATIONS {
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
            if !self.solve(parties, axes) {
                break;
            }
            self.gather(parties.model, |part| &part.answer);
            let segments = axes.moving(parties.motion);
            let contacts = &mut *parties.contacts;
            contacts.strides(&segments, &self.shift, &self.turn, &mut self.strides);
            let strides = &self.strides;
            self.for_each(parties, &|fibre, own| {
                fibre.end_iteration(&action, own, h, strides, relaxed);
            });
            let size = self.reduce(|part| part.size, f64::max);
            let size = parties.communicator.max(size);
            if size.is_nan() || size == f64::INFINITY {
                break;
            }
            // Contacts that come and go in turn are damped.
            relaxed = if size > SLOW * last {
                (0.5 * relaxed).max(LEAST_RELAXATION)
            } else {
                (1.5 * relaxed).min(1.0)
            };
            last = size;
            if size < CLOSE {
                // The contacts of the last iteration are those of this answer up to its last change.
                self.for_each(parties, &|fibre, _| fibre.exchange(&action, share, moment));
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

    /// (A + C) answer = residual. Whether the matrix is positive, as it must be for an answer that goes downhill.
    fn solve(&mut self, parties: &mut Parties, axes: &Axes) -> bool {
        let mut rz = parties.communicator.sum(self.reduce(|part| part.dot, add));
        let enough = rz * REDUCTION * REDUCTION;
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

    /// Equations of one fibre with its contact loads, and the first direction.
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
        part.work.factor();
        part.residual.copy_from_slice(&part.work.rhs);
        part.answer.fill(Vector6::zeros());
        part.precondition();
        part.direction.copy_from_slice(&part.work.rhs);
        part.image.copy_from_slice(&part.residual);
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

    /// Moves by as much of `answer` as the `strides` of the segments allow; `size` tells how far it all was.
    fn end_iteration(
        &mut self,
        action: &Action,
        part: &mut Part,
        h: f64,
        strides: &[f64],
        relaxed: f64,
    ) {
        let fibre = self.fibres.start;
        let radius = action.model.fibres[fibre].material.radius;
        let own = &strides[action.model.segment_range(fibre)];
        let mut fraction = own.iter().copied().fold(relaxed, f64::min);
        part.size = part.answer.iter().fold(0.0, |size, change| {
            let moved = change.fixed_rows::<3>(0).norm() / radius;
            let turned = change.fixed_rows::<3>(3).norm();
            fraction = fraction.min(STRIDE / turned.max(STRIDE));
            let both = moved.max(turned);
            // Written so that a NaN stays.
            if both > size || both.is_nan() {
                both
            } else {
                size
            }
        });
        part.work.rhs.copy_from_slice(&part.answer);
        let nodes = &action.model.nodes[action.model.node_range(fibre)];
        self.change(nodes, &part.work, h, fraction);
    }
}
