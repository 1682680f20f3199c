//! Hydrodynamic points of a fibre in the present iterate: drag and its derivatives.

use super::Action;
use crate::hydrodynamics::{DragResponse, Resistance, Section, TorqueLaw, spin};
use crate::integrate::Batch;
use crate::points::abscissa;
use crate::{Matrix3, Vector3};

impl Batch<'_> {
    /// Calls `visit(segment, point, …)` for the hydrodynamic points of the fibre, in the flow at `moment` of the step.
    pub(super) fn for_points(
        &self,
        action: &Action,
        moment: f64,
        mut visit: impl FnMut(usize, usize, &Point),
    ) {
        let Some(flow) = action.flow else { return };
        let law = flow.law;
        let model = action.model;
        let constants = &model.fibres[self.fibres.start];
        let mut section = Section::middle(2.0 * constants.material.radius, constants.length);
        let segments = model.segment_range(self.fibres.start);
        let first = model.points[segments.start];
        let mut along = -0.5 * constants.length;
        for (i, s) in segments.enumerate() {
            let range = model.points[s]..model.points[s + 1];
            let count = range.len();
            section.diameter = 2.0 * model.segments[s].radius;
            let span = self.position[i + 1] - self.position[i];
            let length = span.norm();
            let t = span / length;
            section.segment_length = model.segments[s].rest_length;
            let relative = self.velocity[i + 1] - self.velocity[i];
            for (k, p) in range.enumerate() {
                let xi = abscissa(k, count);
                let (velocity, gradient) = match flow.formula {
                    Some(formula) => formula(&(self.position[i] + span * xi), moment),
                    None => (
                        flow.ambient.velocity_at(p, moment),
                        flow.ambient.gradient[p],
                    ),
                };
                let arm = along + section.segment_length * xi;
                section.place = 2.0 * arm / constants.length;
                let slip = velocity - self.velocity[i] * (1.0 - xi) - self.velocity[i + 1] * xi;
                let rotation = spin(&gradient);
                let angular_velocity = if constants.twist_free {
                    // About its tangent it spins with the fluid.
                    [t.cross(&relative) / length + t * t.dot(&rotation); 2]
                } else {
                    [self.angular_velocity[i], self.angular_velocity[i + 1]]
                };
                let torque = law.torque.torque(&t, &gradient, &section, &law.fluid);
                let weight = section.segment_length / count as f64;
                let drag = law.drag.response(&t, &slip, &section, &law.fluid);
                let (drag, left) = flow.ambient.yielded_response(p, drag, weight, &t, &slip);
                let point = Point {
                    xi,
                    weight,
                    arm,
                    tangent: t,
                    length,
                    slip,
                    spin: rotation,
                    gradient,
                    steepness: flow.formula.map_or_else(Matrix3::zeros, |_| gradient),
                    angular_velocity,
                    drag,
                    left,
                    spin_drag: Resistance {
                        normal: torque.resistance_normal,
                        axial: torque.resistance_axial,
                    },
                    strain_torque: torque.strain_torque,
                    torque,
                };
                visit(i, p - first, &point);
            }
            along += section.segment_length;
        }
    }
}

/// A hydrodynamic point in the present state.
pub(super) struct Point {
    pub xi: f64,
    pub weight: f64,
    /// σ, length from the fibre's middle.
    pub arm: f64,
    pub tangent: Vector3,
    length: f64,
    pub slip: Vector3,
    /// Ω of the flow.
    pub spin: Vector3,
    gradient: Matrix3,
    /// Gradient of a flow that is followed in space.
    pub steepness: Matrix3,
    /// Of the two nodes.
    pub angular_velocity: [Vector3; 2],
    pub drag: DragResponse,
    /// What is left of the law's drag across where the flow gives way.
    pub left: f64,
    pub spin_drag: Resistance,
    pub strain_torque: Vector3,
    torque: TorqueLaw,
}

impl Point {
    /// Drag of the point's length \[N\].
    pub fn force(&self) -> Vector3 {
        let r = &self.drag.resistance;
        r.force(&self.tangent, &self.slip) * self.weight
    }

    /// Resistance to spin by length.
    pub fn spin_tensor(&self) -> Matrix3 {
        self.spin_drag.tensor(&self.tangent)
    }

    /// Change of the slip by a displacement of the point that ends a stage of `tau`, with the sign turned.
    pub fn rate(&self, tau: f64) -> Matrix3 {
        Matrix3::identity() / tau - self.steepness
    }

    /// Minus the derivative of the drag by a displacement of the point that ends a stage of `tau`; and its derivative by
    /// the span x_b − x_a of the point's segment.
    pub fn derivatives(&self, tau: f64) -> (Matrix3, Matrix3) {
        let by_slip = self.drag.by_slip * self.rate(tau) * self.weight;
        (by_slip, self.drag.by_tangent * self.turning() * self.weight)
    }

    /// Derivative of the torque of the point's length, at this spin of the fibre, by the span.
    pub fn torque_by_span(&self, angular_velocity: &Vector3) -> Matrix3 {
        let t = &self.tangent;
        let by_tangent = self.torque.by_tangent(t, &self.gradient, angular_velocity);
        by_tangent * self.turning() * self.weight
    }

    /// Derivative of the tangent by the span.
    fn turning(&self) -> Matrix3 {
        let t = &self.tangent;
        (Matrix3::identity() - t * t.transpose()) / self.length
    }
}
