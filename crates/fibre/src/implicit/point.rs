//! Hydrodynamic points of a fibre in the present iterate: drag and its derivatives.

use super::Action;
use crate::drag::{Hydrodynamics, tensor};
use crate::hydrodynamics::{DragModel, FluidProperties, Resistance, Section, spin};
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
        let section = Section {
            diameter: 2.0 * constants.material.radius,
            fibre_length: constants.length,
        };
        let segments = model.segment_range(self.fibres.start);
        let first = model.points[segments.start];
        for (i, s) in segments.enumerate() {
            let range = model.points[s]..model.points[s + 1];
            let count = range.len();
            let span = self.position[i + 1] - self.position[i];
            let length = span.norm();
            let t = span / length;
            for (k, p) in range.enumerate() {
                let xi = abscissa(k, count);
                let (velocity, gradient) = match flow.formula {
                    Some(formula) => formula(&(self.position[i] + span * xi), moment),
                    None => (
                        flow.ambient.velocity_at(p, moment),
                        flow.ambient.gradient[p],
                    ),
                };
                let slip = velocity - self.velocity[i] * (1.0 - xi) - self.velocity[i + 1] * xi;
                let torque = law.torque.torque(&t, &gradient, &section, &law.fluid);
                let point = Point {
                    xi,
                    weight: model.segments[s].rest_length / count as f64,
                    tangent: t,
                    length,
                    slip,
                    spin: spin(&gradient),
                    steepness: flow.formula.map_or_else(Matrix3::zeros, |_| gradient),
                    angular_velocity: [self.angular_velocity[i], self.angular_velocity[i + 1]],
                    drag: law.drag.resistance(&t, &slip, &section, &law.fluid),
                    spin_drag: Resistance {
                        normal: torque.resistance_normal,
                        axial: torque.resistance_axial,
                    },
                    strain_torque: torque.strain_torque,
                    section,
                };
                visit(i, p - first, &point);
            }
        }
    }
}

/// A hydrodynamic point in the present state.
pub(super) struct Point {
    pub xi: f64,
    pub weight: f64,
    pub tangent: Vector3,
    length: f64,
    slip: Vector3,
    /// Ω of the flow.
    pub spin: Vector3,
    /// Gradient of a flow that is followed in space.
    steepness: Matrix3,
    /// Of the two nodes.
    pub angular_velocity: [Vector3; 2],
    pub drag: Resistance,
    pub spin_drag: Resistance,
    pub strain_torque: Vector3,
    section: Section,
}

/// How the change of the resistances with the normal slip adds to the derivatives of the drag per length.
#[derive(Clone, Copy, Debug, Default)]
struct Slope {
    by_slip: Matrix3,
    by_tangent: Matrix3,
}

impl Point {
    /// Drag of the point's length \[N\].
    pub fn force(&self) -> Vector3 {
        self.drag.force(&self.tangent, &self.slip) * self.weight
    }

    /// Resistance to spin by length.
    pub fn spin_tensor(&self) -> Matrix3 {
        tensor(&self.spin_drag, &self.tangent)
    }

    /// Minus the derivative of the drag by a displacement of the point that ends a stage of `tau`; and its derivative by
    /// the span x_b − x_a of the point's segment.
    pub fn derivatives(
        &self,
        law: &Hydrodynamics,
        nonlinear: bool,
        tau: f64,
    ) -> (Matrix3, Matrix3) {
        let slope = if nonlinear {
            self.slope(law.drag, &law.fluid)
        } else {
            Slope::default()
        };
        let z = tensor(&self.drag, &self.tangent);
        let rate = Matrix3::identity() / tau - self.steepness;
        let by_slip = (z + slope.by_slip) * rate * self.weight;
        (by_slip, self.by_span(&slope) * self.weight)
    }

    fn slope(&self, drag: DragModel, fluid: &FluidProperties) -> Slope {
        // Relative change of the normal slip in the difference quotient: a matrix for Newton needs no more digits.
        const CHANGE: f64 = 1e-4;
        let t = &self.tangent;
        let along = t.dot(&self.slip);
        let normal = self.slip - t * along;
        let square = normal.norm_squared();
        if square == 0.0 {
            return Slope::default();
        }
        let faster = self.slip + normal * CHANGE;
        let changed = drag.resistance(t, &faster, &self.section, fluid);
        let by_speed = normal * (changed.normal - self.drag.normal)
            + t * (along * (changed.axial - self.drag.axial));
        let by_slip = by_speed * normal.transpose() / (CHANGE * square);
        Slope {
            by_slip,
            by_tangent: by_slip * -along,
        }
    }

    /// Derivative of the drag per length by the span x_b − x_a through the tangent.
    fn by_span(&self, slope: &Slope) -> Matrix3 {
        let (t, s) = (&self.tangent, &self.slip);
        let across = (Matrix3::identity() - t * t.transpose()) / self.length;
        let turning = Matrix3::from_diagonal_element(t.dot(s)) + t * s.transpose();
        (turning * (self.drag.axial - self.drag.normal) + slope.by_tangent) * across
    }
}
