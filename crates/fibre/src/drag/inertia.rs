//! Inertia of the fluid that a fibre displaces, in the explicit integrator.
//!
//! With ρA the mass of fluid displaced by length, P = I − tt and Du/Dt the acceleration of the flow, a point takes
//!
//! ```text
//! f = w ρA [Du/Dt + P (Du/Dt − dv/dt)]
//! ```
//!
//! the pressure gradient of the undisturbed flow, and the added mass of a cylinder (coefficient 1 across, 0 along). P is that of the
//! start of the step; that the added momentum turns with the fibre (dP/dt v) is left out. Σ N_a N_b w ρA P joins the mass in
//! the matrix of the drag, so it is implicit, and the impulse of a step is known to round-off.

use crate::integrate::{Batch, Flow};
use crate::linear_slip::for_arms;
use crate::points::Ambient;
use crate::symmetric::Symmetric;
use crate::system::Model;
use crate::{Matrix3, Vector3};

/// Added mass of a node in the current step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Added {
    /// With itself and with the next node \[kg\].
    pub own: Symmetric,
    pub next: Symmetric,
    /// Velocity at the start of the step \[m/s\].
    pub start: Vector3,
}

impl Added {
    pub fn zero() -> Self {
        Self {
            own: Symmetric::default(),
            next: Symmetric::default(),
            start: Vector3::zeros(),
        }
    }
}

impl Ambient {
    /// Du/Dt at a point in a step of length `dt` \[m/s²\].
    pub(crate) fn acceleration(&self, point: usize, moment: f64, dt: f64) -> Vector3 {
        let steady = self.gradient_at(point) * self.velocity_at(point, moment);
        let change = self.change.get(point);
        let travel = self.travel.get(point).copied().unwrap_or_default();
        change.map_or(steady, |change| steady + (change - travel) / dt)
    }
}

/// ρA of a segment \[kg/m\].
pub(crate) fn displaced(model: &Model, segment: usize, flow: &Flow) -> f64 {
    let radius = model.segments[segment].radius;
    flow.law.fluid.density * std::f64::consts::PI * radius * radius
}

impl Batch<'_> {
    /// Adds the fluid's inertia to the rows and drives of the nodes.
    pub(super) fn prepare_inertia(&mut self, model: &Model, flow: &Flow) {
        let fibre = self.fibres.start;
        let start = model.segment_range(fibre).start;
        let first = model.points[start];
        for (added, v) in self.added.iter_mut().zip(self.velocity.iter()) {
            *added = Added {
                start: *v,
                ..Added::zero()
            };
        }
        for_arms(model, fibre, |i, p, xi, weight, _| {
            let t = self.point_drag[p].tangent;
            let line = displaced(model, start + i, flow);
            let across = (Matrix3::identity() - t * t.transpose()) * (weight * line);
            let acceleration = flow.ambient.acceleration(first + p, 0.5, flow.dt);
            let drive = across * acceleration + acceleration * (weight * line);
            for (node, share) in [(i, 1.0 - xi), (i + 1, xi)] {
                self.drag[node].pivot.add(&across, share * share);
                self.drag[node].drive += drive * share;
                self.added[node].own.add(&across, share * share);
            }
            self.drag[i].next.add(&across, xi * (1.0 - xi));
            self.added[i].next.add(&across, xi * (1.0 - xi));
        });
    }

    /// Takes what the fluid's inertia gave the fibre from the reaction.
    pub(super) fn react_inertia(&mut self, model: &Model, flow: &Flow) {
        let fibre = self.fibres.start;
        let start = model.segment_range(fibre).start;
        let first = model.points[start];
        for_arms(model, fibre, |i, p, xi, weight, _| {
            let t = self.point_drag[p].tangent;
            let line = displaced(model, start + i, flow);
            let gained = |i: usize| self.velocity[i] - self.added[i].start;
            let own = (gained(i) * (1.0 - xi) + gained(i + 1) * xi) / flow.dt;
            let acceleration = flow.ambient.acceleration(first + p, 0.5, flow.dt);
            let relative = acceleration - own;
            let across = relative - t * t.dot(&relative);
            self.reaction_force[p] -= (acceleration + across) * (weight * line);
        });
    }
}
