//! Inertia of the displaced fluid in a stage: [`crate::drag`]'s force with dv/dt = (v − v_b)/τ.

use super::{Action, Base, Workspace};
use crate::drag::displaced;
use crate::integrate::Batch;
use crate::linear_slip::for_arms;
use crate::{Matrix3, Vector3};

/// The force at a point of segment `segment` and minus its derivatives.
struct InertiaAt {
    segment: usize,
    /// Counted from the fibre's first.
    point: usize,
    xi: f64,
    force: Vector3,
    by_place: Matrix3,
    /// With the sign of the derivative.
    by_span: Matrix3,
}

impl Batch<'_> {
    fn for_inertia(
        &self,
        action: &Action,
        base: &[Base],
        tau: f64,
        moment: f64,
        mut visit: impl FnMut(InertiaAt),
    ) {
        let Some(flow) = action.flow.filter(|flow| flow.inertia) else {
            return;
        };
        let (model, fibre) = (action.model, self.fibres.start);
        let start = model.segment_range(fibre).start;
        let first = model.points[start];
        for_arms(model, fibre, |i, p, xi, weight, _| {
            let span = self.position[i + 1] - self.position[i];
            let length = span.norm();
            let t = span / length;
            let across = Matrix3::identity() - t * t.transpose();
            let (flowing, gradient) = match flow.formula {
                Some(formula) => {
                    let x = self.position[i] + span * xi;
                    let (u, gradient) = formula(&x, moment);
                    let change = formula(&x, 1.0).0 - formula(&x, 0.0).0;
                    (gradient * u + change / flow.dt, gradient)
                }
                None => {
                    let own = flow.ambient.acceleration(first + p, moment, flow.dt);
                    (own, Matrix3::zeros())
                }
            };
            let gained = |i: usize| (self.velocity[i] - base[i].velocity) / tau;
            let relative = flowing - gained(i) * (1.0 - xi) - gained(i + 1) * xi;
            let mass = weight * displaced(model, start + i, &flow);
            let turned =
                Matrix3::from_diagonal_element(t.dot(&relative)) + t * relative.transpose();
            visit(InertiaAt {
                segment: i,
                point: p,
                xi,
                force: (flowing + across * relative) * mass,
                by_place: (across / (tau * tau)
                    - (Matrix3::identity() + across) * gradient * gradient)
                    * mass,
                by_span: turned * across * (-mass / length),
            });
        });
    }

    /// Adds the forces to the residual and their derivatives to the matrix.
    pub(super) fn add_inertia(&self, action: &Action, work: &mut Workspace, tau: f64, moment: f64) {
        let base = std::mem::take(&mut work.base);
        self.for_inertia(action, &base, tau, moment, |at| {
            let shares = [1.0 - at.xi, at.xi];
            for (end, share) in shares.into_iter().enumerate() {
                let node = at.segment + end;
                work.push(node, &(at.force * share));
                work.slow[node][0] += at.by_place * share;
                for (other, sign) in [(0, 1.0), (1, -1.0)] {
                    let part = (at.by_place * shares[other] + at.by_span * sign) * share;
                    work.tie(node, at.segment + other, &part);
                }
            }
        });
        work.base = base;
    }

    /// Adds `share` of the force on the fluid in the present state of a stage of `tau` from `base`.
    pub(super) fn exchange_inertia(
        &mut self,
        action: &Action,
        base: &[Base],
        tau: f64,
        share: f64,
        moment: f64,
    ) {
        let mut force = std::mem::take(&mut self.reaction_force);
        self.for_inertia(action, base, tau, moment, |at| {
            force[at.point] -= at.force * share;
        });
        self.reaction_force = std::mem::take(&mut force);
    }
}
