//! Implicit time integration of single fibres: as large a step as the flow takes, however stiff the fibre.
//!
//! The two-stage, second-order, L-stable, stiffly accurate SDIRK method (Alexander 1977, γ = 1 − 1/√2). Each stage is an
//! implicit Euler step of length τ = γh from a base state,
//!
//! ```text
//! x = x_b + τ v,   q = exp(τ ω) q_b,   m v = m v_b + τ F(x, q, v, ω),   J(q) ω = π_b + τ T(x, q, v, ω)
//! ```
//!
//! the first from the start of the step, the second from where (1 − γ)h of the first stage's rates lead. The last stage
//! is the answer, nothing else is carried over: the state is (x, q, v, ω) as for the explicit integrator, a jump of the
//! load does no harm, and m → 0 and EI → ∞ are regular limits. With the exact tangent of the beam and of the drag a stage
//! is solved by Newton's method in positions and rotations, or by one such step (`linear`); the matrix is
//! block-tridiagonal, 6×6 a node.

mod blocks;
mod chain;
mod inertia;
mod joint;
mod low_rank;
mod point;
mod rigid;
mod rotation;
mod stage;
#[cfg(test)]
mod tests;

pub(crate) use chain::for_hinges;
pub(crate) use joint::{Joint, Parties};
pub(crate) use rigid::Body;

use crate::integrate::{Batch, Flow};
use crate::system::{Load, Model};
use crate::{Quaternion, Vector3};
use blocks::Row;
use low_rank::LowRank;
use nalgebra::{Matrix3, Vector6};
use std::cell::RefCell;

/// How fibres advance in time.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Integrator {
    /// Position Verlet in sub-steps below the critical one.
    #[default]
    Explicit,
    /// SDIRK in few sub-steps.
    Implicit(ImplicitSettings),
    /// Implicit for a fibre that would need more than [`Integrator::WORTH`] explicit sub-steps.
    Auto(ImplicitSettings),
}

impl Integrator {
    /// Explicit sub-steps that cost as much as an implicit step.
    pub const WORTH: usize = 60;

    /// The implicit settings, where a step that takes `explicit` explicit sub-steps is to be implicit. `only` is for fibres
    /// that have no other integrator.
    pub(crate) fn implicit(&self, explicit: usize, only: bool) -> Option<&ImplicitSettings> {
        match self {
            Self::Explicit if only => Some(&ImplicitSettings::DEFAULT),
            Self::Auto(settings) if only => Some(settings),
            Self::Explicit => None,
            Self::Implicit(settings) => Some(settings),
            Self::Auto(settings) => (explicit > Self::WORTH).then_some(settings),
        }
    }
}

/// Settings of the implicit integrator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImplicitSettings {
    /// One linear solve a stage instead of Newton's iteration.
    pub linear: bool,
    /// Largest estimated error of a position in a sub-step, over how far the fibre moves in the step; infinite for one
    /// sub-step a step.
    pub tolerance: f64,
}

impl ImplicitSettings {
    const DEFAULT: Self = Self {
        linear: false,
        tolerance: 1e-3,
    };
}

impl Default for ImplicitSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// γ = 1 − 1/√2
const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;
/// Error of a position over the fibre's length that is never worth a sub-step.
const LEAST_ERROR: f64 = 1e-10;
/// Times that the number of sub-steps follows the estimated error in one step.
const MOST_REFINEMENTS: usize = 4;
/// Sub-steps beyond which a fibre is given up.
const MOST_SUB_STEPS: usize = 1 << 14;

/// Where a stage starts from.
#[derive(Clone, Copy, Debug)]
struct Base {
    position: Vector3,
    velocity: Vector3,
    orientation: Quaternion,
    /// Angular momentum of the node.
    spin: Vector3,
}

/// State of a node at the start of a sub-step.
#[derive(Clone, Copy, Debug)]
struct Entry {
    position: Vector3,
    velocity: Vector3,
    orientation: Quaternion,
    angular_velocity: Vector3,
}

/// Work space of a thread, as large as its longest fibre.
#[derive(Default)]
struct Workspace {
    rows: Vec<Row>,
    rhs: Vec<Vector6<f64>>,
    base: Vec<Base>,
    /// State before the step, and before the sub-step.
    first: Vec<Entry>,
    entry: Vec<Entry>,
    /// Velocities of the first stage.
    middle: Vec<[Vector3; 2]>,
    /// Inertia and lumped drag of position and rotation in the matrix, for the error estimate.
    slow: Vec<[Matrix3<f64>; 2]>,
    low_rank: LowRank,
    /// Rows hold the positions of two nodes each, in place of position and rotation of one.
    paired: bool,
}

thread_local! {
    static WORKSPACE: RefCell<Workspace> = RefCell::default();
}

/// What a fibre took.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Done {
    pub sub_steps: usize,
    /// Newton's iteration found an answer.
    pub converged: bool,
}

/// How the number of equal sub-steps of a step follows their estimated error.
struct Refinement {
    sub_steps: usize,
    times: usize,
}

impl Refinement {
    fn start() -> Self {
        Self {
            sub_steps: 1,
            times: 0,
        }
    }

    /// What came of the step, given the largest error of a sub-step (none without an answer) and its limit; `None` when it
    /// is to be done again in more sub-steps.
    fn judge(&mut self, error: Option<f64>, limit: f64) -> Option<Done> {
        let n = self.sub_steps;
        let wanted = match error {
            Some(error) if error > limit && self.times < MOST_REFINEMENTS => {
                self.times += 1;
                // The error of a sub-step is of third order where it is resolved.
                let ratio = (error / limit).cbrt();
                (1.1 * n as f64 * ratio).ceil() as usize
            }
            Some(_) => n,
            None => 2 * n,
        };
        self.sub_steps = wanted.min(MOST_SUB_STEPS);
        let last = self.sub_steps == n;
        last.then_some(Done {
            sub_steps: n,
            converged: error.is_some(),
        })
    }
}

/// What acts on one fibre in a step.
#[derive(Clone, Copy)]
struct Action<'a> {
    model: &'a Model,
    flow: Option<Flow<'a>>,
    settings: &'a ImplicitSettings,
    /// The matrix is made symmetric, for conjugate gradients over fibres that touch.
    symmetric: bool,
}

impl Batch<'_> {
    /// One fibre through a whole step `dt`, in as many equal sub-steps as its error asks for.
    pub fn advance_implicit(
        &mut self,
        model: &Model,
        flow: Option<Flow>,
        dt: f64,
        settings: &ImplicitSettings,
    ) -> Done {
        let action = Action {
            model,
            flow,
            settings,
            symmetric: false,
        };
        WORKSPACE.with_borrow_mut(|work| {
            let constants = &model.fibres[self.fibres.start];
            work.resize(self.position.len(), constants.twist_free);
            self.store(&mut work.first);
            let done = match &constants.body {
                Some(body) => self.sub_cycle_rigid(&action, body, dt),
                None => self.sub_cycle(&action, work, dt),
            };
            self.close_momentum(&action, &work.first, dt);
            done
        })
    }

    /// A rigid or twist-free fibre through sub-step `k` of `n` of length `step`, under the loads in `load` too, which are
    /// cleared. Whether an answer was found.
    pub fn sub_step_implicit(
        &mut self,
        model: &Model,
        flow: Option<Flow>,
        step: f64,
        (k, n): (usize, usize),
    ) -> bool {
        let action = Action {
            model,
            flow,
            settings: &ImplicitSettings {
                linear: false,
                tolerance: f64::INFINITY,
            },
            symmetric: false,
        };
        if k == 0 {
            self.reaction_force.fill(Vector3::zeros());
            self.reaction_torque.fill(Vector3::zeros());
        }
        let constants = &model.fibres[self.fibres.start];
        let found = match &constants.body {
            Some(body) => self.rigid_step(&action, body, step, (k, n)).is_some(),
            None => WORKSPACE.with_borrow_mut(|work| {
                work.resize(self.position.len(), constants.twist_free);
                self.implicit_step(&action, work, step, (k, n)).is_some()
            }),
        };
        self.load.fill(Load::ZERO);
        found
    }

    fn sub_cycle(&mut self, action: &Action, work: &mut Workspace, dt: f64) -> Done {
        let mut refinement = Refinement::start();
        loop {
            let n = refinement.sub_steps;
            self.reaction_force.fill(Vector3::zeros());
            self.reaction_torque.fill(Vector3::zeros());
            let error = self.sub_steps(action, work, dt, n);
            let limit = action.settings.tolerance * self.largest_move(&work.first)
                + LEAST_ERROR * action.model.fibres[self.fibres.start].length;
            if let Some(done) = refinement.judge(error, limit) {
                return done;
            }
            self.load_entries(&work.first);
        }
    }

    /// `n` sub-steps; the largest error estimate, or none where no answer is found.
    fn sub_steps(
        &mut self,
        action: &Action,
        work: &mut Workspace,
        dt: f64,
        n: usize,
    ) -> Option<f64> {
        let h = dt / n as f64;
        let mut largest = 0.0_f64;
        for k in 0..n {
            largest = largest.max(self.implicit_step(action, work, h, (k, n))?);
        }
        Some(largest)
    }

    /// Largest distance of a node from where it was \[m\].
    fn largest_move(&self, first: &[Entry]) -> f64 {
        let pairs = self.position.iter().zip(first);
        let square = pairs.map(|(x, entry)| (x - entry.position).norm_squared());
        square.fold(0.0, f64::max).sqrt()
    }

    fn store(&self, entries: &mut [Entry]) {
        for (i, entry) in entries.iter_mut().enumerate() {
            *entry = Entry {
                position: self.position[i],
                velocity: self.velocity[i],
                orientation: self.orientation[i],
                angular_velocity: self.angular_velocity[i],
            };
        }
    }

    fn load_entries(&mut self, entries: &[Entry]) {
        for (i, entry) in entries.iter().enumerate() {
            self.position[i] = entry.position;
            self.velocity[i] = entry.velocity;
            self.orientation[i] = entry.orientation;
            self.angular_velocity[i] = entry.angular_velocity;
        }
    }

    /// Gives the fluid exactly the momentum that a free fibre took: what is left between the two is the round-off of
    /// stiff internal forces and the tolerance of Newton's iteration.
    fn close_momentum(&mut self, action: &Action, first: &[Entry], dt: f64) {
        let (model, fibre) = (action.model, self.fibres.start);
        let range = model.node_range(fibre);
        let nodes = &model.nodes[range.clone()];
        if action.flow.is_none() || nodes.iter().any(|node| node.holds_translation) {
            return;
        }
        let mut gap: Vector3 = self.reaction_force.iter().sum();
        for (i, node) in nodes.iter().enumerate() {
            let given = model.loads[range.start + i].force + node.weight;
            gap += (self.velocity[i] - first[i].velocity) * (node.mass / dt) - given;
        }
        let segments = model.segment_range(fibre);
        let start = model.points[segments.start];
        let length = model.fibres[fibre].length;
        for s in segments {
            let range = model.points[s] - start..model.points[s + 1] - start;
            let share = model.segments[s].rest_length / (length * range.len() as f64);
            for force in &mut self.reaction_force[range] {
                *force -= gap * share;
            }
        }
    }
}

impl Workspace {
    /// Fits the work space to a fibre, with or without rotations.
    fn resize(&mut self, nodes: usize, twist_free: bool) {
        let entry = Entry {
            position: Vector3::zeros(),
            velocity: Vector3::zeros(),
            orientation: Quaternion::identity(),
            angular_velocity: Vector3::zeros(),
        };
        let base = Base {
            position: Vector3::zeros(),
            velocity: Vector3::zeros(),
            orientation: Quaternion::identity(),
            spin: Vector3::zeros(),
        };
        self.paired = twist_free;
        let rows = if twist_free { nodes.div_ceil(2) } else { nodes };
        self.rows.resize(rows, Row::ZERO);
        self.rhs.resize(rows, Vector6::zeros());
        self.base.resize(nodes, base);
        self.first.resize(nodes, entry);
        self.entry.resize(nodes, entry);
        self.middle.resize(nodes, [Vector3::zeros(); 2]);
        self.slow.resize(nodes, [Matrix3::zeros(); 2]);
        self.low_rank.resize(nodes);
    }
}
