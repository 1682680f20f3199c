//! Time integration: position Verlet (drift – kick – drift) on positions and rotations, in equal sub-steps.
//!
//! - Drift: positions move with constant velocity, frames turn as free symmetric tops. Both are exact flows, so the
//!   splitting is symplectic and reversible, and total linear and angular momentum change by the kicks only: internal
//!   forces, which add up to no force and no torque, keep both to round-off.
//! - Kick: velocities change by the forces at the middle of the sub-step.
//!
//! One force evaluation a sub-step and no force carried over, so the state is (x, q, v, ω) and a restart is exact.

use crate::beam::{Motion as EndMotion, Pose, tangent};
use crate::drag::{Added, Hydrodynamics, NodeDrag, PointDrag};
use crate::hydrodynamics::AmbientFlow;
use crate::lanes::Packed;
use crate::system::{Load, Model, Motion, NodeConstants, Scratch};
use crate::{
    Ambient, FibreError, FibreSettings, FibreSystem, FlowFormula, Integrator, Quaternion, Reaction,
    Vector3,
};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The moving state and scratch of a run of consecutive fibres.
pub(crate) struct Batch<'a> {
    /// Local index of the first fibre and of the fibre after the last.
    pub fibres: std::ops::Range<usize>,
    pub position: &'a mut [Vector3],
    pub velocity: &'a mut [Vector3],
    pub orientation: &'a mut [Quaternion],
    pub angular_velocity: &'a mut [Vector3],
    pub load: &'a mut [Load],
    /// This and all below are empty without hydrodynamics.
    pub drag: &'a mut [NodeDrag],
    pub point_drag: &'a mut [PointDrag],
    /// Empty without the inertia of the fluid.
    pub added: &'a mut [Added],
    pub reaction_force: &'a mut [Vector3],
    pub reaction_torque: &'a mut [Vector3],
}

/// Nodes below which a batch is not split over threads.
const GRAIN: usize = 256;

/// Splits at `at`, or at the end of an empty slice.
fn split<T>(slice: &mut [T], at: usize) -> (&mut [T], &mut [T]) {
    let at = at.min(slice.len());
    slice.split_at_mut(at)
}

impl<'a> Batch<'a> {
    pub fn all(
        model: &Model,
        motion: &'a mut Motion,
        scratch: &'a mut Scratch,
        reaction: &'a mut Reaction,
    ) -> Self {
        Self {
            fibres: 0..model.fibres.len(),
            position: &mut motion.position,
            velocity: &mut motion.velocity,
            orientation: &mut motion.orientation,
            angular_velocity: &mut motion.angular_velocity,
            load: &mut scratch.load,
            drag: &mut scratch.drag,
            point_drag: &mut scratch.point_drag,
            added: &mut scratch.added,
            reaction_force: &mut reaction.force,
            reaction_torque: &mut reaction.torque,
        }
    }

    fn split(self, model: &Model, middle: usize) -> (Self, Self) {
        let first = self.fibres.start;
        let n = model.offsets[middle] - model.offsets[first];
        let point = |f: usize| model.points[model.segment_range(f).start];
        let p = point(middle) - point(first);
        let position = split(self.position, n);
        let velocity = split(self.velocity, n);
        let orientation = split(self.orientation, n);
        let angular_velocity = split(self.angular_velocity, n);
        let load = split(self.load, n);
        let drag = split(self.drag, n);
        let point_drag = split(self.point_drag, p);
        let added = split(self.added, n);
        let reaction_force = split(self.reaction_force, p);
        let reaction_torque = split(self.reaction_torque, p);
        let left = Self {
            fibres: first..middle,
            position: position.0,
            velocity: velocity.0,
            orientation: orientation.0,
            angular_velocity: angular_velocity.0,
            load: load.0,
            drag: drag.0,
            point_drag: point_drag.0,
            added: added.0,
            reaction_force: reaction_force.0,
            reaction_torque: reaction_torque.0,
        };
        let right = Self {
            fibres: middle..self.fibres.end,
            position: position.1,
            velocity: velocity.1,
            orientation: orientation.1,
            angular_velocity: angular_velocity.1,
            load: load.1,
            drag: drag.1,
            point_drag: point_drag.1,
            added: added.1,
            reaction_force: reaction_force.1,
            reaction_torque: reaction_torque.1,
        };
        (left, right)
    }

    /// Runs `work` on every fibre, over threads when there are many nodes. Allocates nothing.
    pub fn for_each(self, model: &Model, work: &(impl Fn(&mut Batch) + Sync)) {
        if self.fibres.len() == 1 {
            let mut one = self;
            work(&mut one);
        } else if !self.fibres.is_empty() {
            let nodes = self.position.len();
            let middle = self.fibres.start + self.fibres.len() / 2;
            let (left, right) = self.split(model, middle);
            if nodes > GRAIN {
                rayon::join(
                    || left.for_each(model, work),
                    || right.for_each(model, work),
                );
            } else {
                left.for_each(model, work);
                right.for_each(model, work);
            }
        }
    }

    /// Moves one fibre's nodes for a time `dt`.
    pub fn drift(&mut self, model: &Model, dt: f64) {
        for (x, v) in self.position.iter_mut().zip(self.velocity.iter()) {
            *x += v * dt;
        }
        let nodes = &model.nodes[model.node_range(self.fibres.start)];
        for ((q, w), node) in self
            .orientation
            .iter_mut()
            .zip(self.angular_velocity.iter_mut())
            .zip(nodes)
        {
            // A held frame keeps its angular velocity as a sphere does.
            let flatness = if node.holds_rotation {
                0.0
            } else {
                1.0 - node.axial_inertia / node.transverse_inertia
            };
            turn(q, w, flatness, dt, half_turn);
        }
    }

    /// Adds the elastic, viscous and given forces on one fibre's nodes to `load`.
    pub fn add_forces(&mut self, model: &Model) {
        let fibre = self.fibres.start;
        let range = model.node_range(fibre);
        let given = model.nodes[range.clone()].iter().zip(&model.loads[range]);
        for (load, (node, given)) in self.load.iter_mut().zip(given) {
            load.force += given.force + node.weight;
            load.torque += given.torque;
        }
        let segments = &model.segments[model.segment_range(fibre)];
        let viscous = model.fibres[fibre].material.retardation > 0.0;
        for (i, segment) in segments.iter().enumerate() {
            let pose = |i: usize| Pose {
                position: &self.position[i],
                orientation: &self.orientation[i],
            };
            let mut f = segment.elastic_force(pose(i), pose(i + 1));
            if viscous {
                let motion = |i: usize| EndMotion {
                    velocity: &self.velocity[i],
                    angular_velocity: &self.angular_velocity[i],
                };
                f += segment.viscous_force(pose(i), pose(i + 1), motion(i), motion(i + 1));
            }
            self.load[i].force -= f.force;
            self.load[i].torque += f.start_torque;
            self.load[i + 1].force += f.force;
            self.load[i + 1].torque += f.end_torque;
        }
    }

    /// Changes one fibre's velocities by `load` over `dt` and clears `load`.
    pub fn kick(&mut self, model: &Model, dt: f64) {
        let nodes = &model.nodes[model.node_range(self.fibres.start)];
        for (i, node) in nodes.iter().enumerate() {
            let load = std::mem::replace(&mut self.load[i], Load::ZERO);
            self.kick_node(i, node, &load.force, &load.torque, dt);
        }
    }

    /// Changes the velocities of a node by a force and a torque over `dt`.
    #[inline(always)]
    pub fn kick_node(
        &mut self,
        i: usize,
        node: &NodeConstants,
        force: &Vector3,
        torque: &Vector3,
        dt: f64,
    ) {
        if !node.holds_translation {
            self.velocity[i] += force * (dt / node.mass);
        }
        if !node.holds_rotation {
            let t = tangent(&self.orientation[i]);
            self.angular_velocity[i] += node.spin_up(&t, torque) * dt;
        }
    }
}

impl NodeConstants {
    /// Angular acceleration by a torque, both about space axes, of a node with tangent `t`.
    #[inline(always)]
    fn spin_up(&self, t: &Vector3, torque: &Vector3) -> Vector3 {
        let across = 1.0 / self.transverse_inertia;
        torque * across + t * ((1.0 / self.axial_inertia - across) * torque.dot(t))
    }
}

/// Free motion of a symmetric top: the frame precesses about the fixed angular momentum with π/J⊥ and spins about its
/// own tangent with σ = (1 − J∥/J⊥) ω·t; ω = π/J⊥ + σt. `flatness` is 1 − J∥/J⊥, `half_turn` as [`half_turn`].
#[inline(always)]
pub(crate) fn turn(
    q: &mut Quaternion,
    w: &mut Vector3,
    flatness: f64,
    dt: f64,
    half_turn: impl Fn(f64) -> (f64, f64),
) {
    let t = tangent(q);
    let spin = flatness * w.dot(&t);
    let precession = *w - t * spin;
    let (cosine, sinc) = half_turn(0.25 * dt * dt * precession.norm_squared());
    let p = precession * (0.5 * dt * sinc);
    let (spin_cosine, spin_sinc) = half_turn((0.5 * dt * spin).powi(2));
    let s = 0.5 * dt * spin * spin_sinc;
    // (cosine, p) ∘ q ∘ (spin_cosine, s e_x)
    let (a, b, c, d) = (q.w, q.i, q.j, q.k);
    let left = [
        cosine * a - p.x * b - p.y * c - p.z * d,
        cosine * b + p.x * a + p.y * d - p.z * c,
        cosine * c - p.x * d + p.y * a + p.z * b,
        cosine * d + p.x * c - p.y * b + p.z * a,
    ];
    let turned = [
        left[0] * spin_cosine - left[1] * s,
        left[1] * spin_cosine + left[0] * s,
        left[2] * spin_cosine + left[3] * s,
        left[3] * spin_cosine - left[2] * s,
    ];
    let norm2 = turned.iter().map(|x| x * x).sum::<f64>();
    // One Newton step for 1/√norm2, which is 1 up to round-off.
    let scale = 1.5 - 0.5 * norm2;
    *q = Quaternion::new_unchecked(nalgebra::Quaternion::new(
        turned[0] * scale,
        turned[1] * scale,
        turned[2] * scale,
        turned[3] * scale,
    ));
    *w = precession + tangent(q) * spin;
}

/// Squares below which [`small_half_turn`] is exact to round-off.
pub(crate) const SMALL_TURN: f64 = 4e-3;

/// (cos φ, sin φ / φ) from φ².
#[inline(always)]
pub(crate) fn half_turn(z: f64) -> (f64, f64) {
    if z < SMALL_TURN {
        small_half_turn(z)
    } else {
        let angle = z.sqrt();
        let (sine, cosine) = angle.sin_cos();
        (cosine, sine / angle)
    }
}

#[inline(always)]
pub(crate) fn small_half_turn(z: f64) -> (f64, f64) {
    let cosine = 1.0 - z * (0.5 - z * (1.0 / 24.0 - z * (1.0 / 720.0 - z / 40320.0)));
    let sinc = 1.0 - z * (1.0 / 6.0 - z * (1.0 / 120.0 - z * (1.0 / 5040.0 - z / 362_880.0)));
    (cosine, sinc)
}

/// Number and length of equal sub-steps of at most `limit`.
pub(crate) fn sub_steps(dt: f64, limit: f64) -> (usize, f64) {
    let n = (dt / limit).ceil().max(1.0) as usize;
    (n, dt / n as f64)
}

/// The flow at the points, and the formula that it comes from.
pub(crate) type Given<'a> = (&'a Ambient, Option<FlowFormula<'a>>);

/// The law and the flow at the points, for a step.
#[derive(Clone, Copy)]
pub(crate) struct Flow<'a> {
    pub law: &'a Hydrodynamics,
    pub ambient: &'a Ambient,
    /// What `ambient` was taken from.
    pub formula: Option<FlowFormula<'a>>,
    /// Whether the inertia of the displaced fluid acts.
    pub inertia: bool,
    /// Length of the step \[s\].
    pub dt: f64,
}

impl<'a> Flow<'a> {
    pub fn new(
        given: Option<Given<'a>>,
        settings: &'a FibreSettings,
        dt: f64,
    ) -> Result<Option<Self>, FibreError> {
        match (given, &settings.hydrodynamics) {
            (None, _) => Ok(None),
            (Some((ambient, formula)), Some(law)) => Ok(Some(Self {
                law,
                ambient,
                formula,
                inertia: settings.fluid_inertia,
                dt,
            })),
            (Some(_), None) => Err(FibreError::NoHydrodynamics),
        }
    }
}

impl Batch<'_> {
    /// One fibre through a whole step, `n` sub-steps of `step`, when nothing ties it to other fibres.
    fn advance_alone(&mut self, model: &Model, flow: Option<Flow>, n: usize, step: f64) {
        self.begin(model, flow, step);
        if self.leaps(model, flow.is_some()) {
            self.leap(model, 0..n, n, step);
        } else {
            for k in 0..n {
                self.sub_step(model, flow.is_some(), k, n, step);
            }
        }
        self.end(model, flow);
    }

    pub fn begin(&mut self, model: &Model, flow: Option<Flow>, step: f64) {
        if let Some(flow) = flow {
            self.prepare_drag(model, &flow, step);
        }
        self.drift(model, 0.5 * step);
    }

    /// Sub-step `k` of `n` from the middle of its first drift on, with that of the next one.
    pub fn sub_step(&mut self, model: &Model, drag: bool, k: usize, n: usize, step: f64) {
        if drag && self.packed(model) {
            return self.sub_step_in_lanes(model, k, n, step);
        }
        self.add_forces(model);
        if drag {
            let share = 1.0 / n as f64;
            self.kick_with_drag(model, step, share, (k as f64 + 0.5) * share);
        } else {
            self.kick(model, step);
        }
        self.drift(model, if k + 1 < n { step } else { 0.5 * step });
    }

    pub fn end(&mut self, model: &Model, flow: Option<Flow>) {
        if let Some(flow) = flow {
            self.react(model, &flow);
        }
    }
}

impl FibreSystem {
    /// Advances all fibres by `dt` \[s\] under internal and given forces only, each in its own number of equal
    /// sub-steps below the critical one.
    ///
    /// # Errors
    /// [`FibreError::NonFinite`], on the rank that holds the fibre only; [`FibreError::Contact`], on every rank.
    pub fn advance_free(&mut self, dt: f64) -> Result<(), FibreError> {
        self.run(None, dt)
    }

    /// Advances all fibres by `dt` \[s\] in the flow given at their points (those of [`FibreSystem::points`] now). Returns the mean force and torque on the fluid at the points; times `dt` that is
    /// to round-off what the fibres took. Collective when the settings have contacts.
    ///
    /// # Errors
    /// As [`FibreSystem::advance_free`], [`FibreError::AmbientSize`], and [`FibreError::NoHydrodynamics`] when the settings
    /// name no law.
    pub fn advance(&mut self, ambient: &Ambient, dt: f64) -> Result<&Reaction, FibreError> {
        let points = self.point_count();
        let change = Some(ambient.change.len()).filter(|&given| given > 0);
        let sharing = if ambient.paired { 2 } else { 1 };
        let given = [ambient.velocity.len(), sharing * ambient.gradient.len()];
        for given in given.into_iter().chain(change) {
            if given != points {
                return Err(FibreError::AmbientSize { points, given });
            }
        }
        self.run(Some((ambient, None)), dt)?;
        Ok(&self.reaction)
    }

    /// Advances all fibres by `dt` \[s\] in a steady flow given by a formula.
    ///
    /// # Errors
    /// As [`FibreSystem::advance`].
    pub fn advance_in_flow(
        &mut self,
        flow: &AmbientFlow,
        dt: f64,
    ) -> Result<&Reaction, FibreError> {
        self.advance_in(&|x, _| flow.at(x), dt)
    }

    /// Advances all fibres by `dt` \[s\] in a flow given by a formula, which may change in the step. The implicit
    /// integrator evaluates it where and when its stages are, the explicit one where the points are now.
    ///
    /// # Errors
    /// As [`FibreSystem::advance`].
    pub fn advance_in(&mut self, flow: FlowFormula, dt: f64) -> Result<&Reaction, FibreError> {
        let mut points = std::mem::take(&mut self.points);
        let mut ambient = std::mem::take(&mut self.ambient);
        self.points(&mut points);
        ambient.velocity.clear();
        ambient.gradient.clear();
        ambient.change.clear();
        for x in &points.position {
            let ((first, _), (last, gradient)) = (flow(x, 0.0), flow(x, 1.0));
            ambient.velocity.push(last);
            ambient.gradient.push(gradient);
            ambient.change.push(last - first);
        }
        let result = self.run(Some((&ambient, Some(flow))), dt);
        self.points = points;
        self.ambient = ambient;
        result.map(|()| &self.reaction)
    }

    fn run(&mut self, given: Option<Given>, dt: f64) -> Result<(), FibreError> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(FibreError::Setting {
                setting: "time step",
                value: dt,
                requirement: "positive and finite",
            });
        }
        let implicit = matches!(self.settings.integrator, Integrator::Implicit(_));
        if !implicit && self.model.packed.is_empty() {
            self.model.packed = Packed::new(&self.model);
        }
        if self.settings.budget {
            self.open_accounts();
        }
        let result = match self.touching.take() {
            None => self.run_apart(given, dt),
            Some(mut touching) => {
                let result = self.run_together(&mut touching, given, dt);
                self.touching = Some(touching);
                result
            }
        };
        // Names the fibre when contacts only say that something is not finite.
        self.check_finite()?;
        if self.settings.budget {
            self.close_accounts(given.map(|(ambient, _)| ambient), dt);
        }
        result
    }

    /// One step of every fibre for itself, through all its sub-steps while it is in cache.
    fn run_apart(&mut self, given: Option<Given>, dt: f64) -> Result<(), FibreError> {
        let flow = Flow::new(given, &self.settings, dt)?;
        let (model, settings) = (&self.model, &self.settings);
        let (most, total) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let given_up = AtomicUsize::new(usize::MAX);
        let all = Batch::all(
            model,
            &mut self.motion,
            &mut self.scratch,
            &mut self.reaction,
        );
        all.for_each(model, &|fibre| {
            let local = fibre.fibres.start;
            let critical = model.fibres[local].critical_step;
            let (explicit, step) = sub_steps(dt, settings.step_safety * critical);
            let only = model.fibres[local].only_implicit();
            let n = match settings.integrator.implicit(explicit, only) {
                None => {
                    fibre.advance_alone(model, flow, explicit, step);
                    explicit
                }
                Some(implicit) => {
                    let done = fibre.advance_implicit(model, flow, dt, implicit);
                    if !done.converged {
                        given_up.fetch_min(local, Ordering::Relaxed);
                    }
                    done.sub_steps
                }
            };
            most.fetch_max(n, Ordering::Relaxed);
            let segments = fibre.position.len() - 1;
            total.fetch_add(n * segments, Ordering::Relaxed);
        });
        self.work = (most.into_inner(), total.into_inner());
        self.given_up(given_up.into_inner())
    }

    /// An error that names the fibre, if `local` is one.
    pub(crate) fn given_up(&self, local: usize) -> Result<(), FibreError> {
        if local >= self.fibres() {
            return Ok(());
        }
        Err(FibreError::NoConvergence {
            fibre: self.id(local),
            position: self.centre(local),
        })
    }
}
