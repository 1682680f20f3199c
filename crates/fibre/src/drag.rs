//! Drag and hydrodynamic torque on the nodes, implicit in every sub-step.
//!
//! At a hydrodynamic point with shape weights N_a, N_b of its segment's nodes and length w, the fibre takes
//!
//! ```text
//! f = w Z (u − N_a v_a − N_b v_b),     Z = ζ⊥(I − tt) + ζ∥ tt
//! T = w [R (Ω − N_a ω_a − N_b ω_b) + T_s]
//! ```
//!
//! and hands N_a f, N_b f to the nodes, which keeps its moment too. u, Ω, T_s and the tensors Z, R are those of the
//! start of the step, so the drag matrix D (block-tridiagonal, symmetric) is factored once for all sub-steps:
//!
//! ```text
//! (M + δt D) v' = M v + δt (F + Σ N w Z u)
//! ```
//!
//! The impulse a point takes is linear in v', so the mean of v' over the sub-steps gives the *actual* mean force on the
//! fluid to round-off. Torque is lumped: node a feels N_a w [R(Ω − ω_a) + T_s], which has the same sum over a segment.

use crate::beam::tangent;
use crate::blocktri::{self, BlockRow};
use crate::hydrodynamics::{DragModel, FluidProperties, Resistance, Section, TorqueModel, spin};
use crate::integrate::Batch;
use crate::points::abscissa;
use crate::system::{Load, Model, NodeConstants};
use crate::{Ambient, Matrix3, Vector3};

/// How the flow acts on fibres.
#[derive(Clone, Copy, Debug)]
pub struct Hydrodynamics {
    /// The fluid.
    pub fluid: FluidProperties,
    /// Drag per length.
    pub drag: DragModel,
    /// Torque per length.
    pub torque: TorqueModel,
    /// Longest part of a segment that has two hydrodynamic points \[m\]: the mesh size, or infinite.
    pub point_spacing: f64,
}

/// Drag on a node in the current step, and means over its sub-steps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NodeDrag {
    /// Row of M + δt D, factored.
    row: BlockRow,
    /// Σ N w Z u at the end of the step \[N\].
    drive: Vector3,
    /// Its change in the step.
    drive_change: Vector3,
    /// Σ N w R \[N·m·s\].
    spin_resistance: Matrix3,
    /// Σ N w (RΩ + T_s) \[N·m\].
    spin_drive: Vector3,
    mean_velocity: Vector3,
    mean_spin: Vector3,
}

impl NodeDrag {
    pub fn zero() -> Self {
        Self {
            row: BlockRow::zero(),
            drive: Vector3::zeros(),
            drive_change: Vector3::zeros(),
            spin_resistance: Matrix3::zeros(),
            spin_drive: Vector3::zeros(),
            mean_velocity: Vector3::zeros(),
            mean_spin: Vector3::zeros(),
        }
    }
}

/// The laws at a point in the current step, times the point's length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PointDrag {
    tangent: Vector3,
    drag: Resistance,
    spin_drag: Resistance,
    /// w T_s
    strain_torque: Vector3,
}

impl PointDrag {
    pub fn zero() -> Self {
        Self {
            tangent: Vector3::zeros(),
            drag: Resistance::default(),
            spin_drag: Resistance::default(),
            strain_torque: Vector3::zeros(),
        }
    }
}

pub(crate) fn tensor(r: &Resistance, t: &Vector3) -> Matrix3 {
    Matrix3::from_diagonal_element(r.normal) + t * t.transpose() * (r.axial - r.normal)
}

fn scaled(r: Resistance, weight: f64) -> Resistance {
    Resistance {
        normal: r.normal * weight,
        axial: r.axial * weight,
    }
}

impl Batch<'_> {
    /// Evaluates the laws at one fibre's points with the present slip and factors M + δt D for sub-steps of `step`.
    /// `ambient` is that of all points of the rank.
    pub fn prepare_drag(
        &mut self,
        model: &Model,
        law: &Hydrodynamics,
        ambient: &Ambient,
        step: f64,
    ) {
        let fibre = self.fibres.start;
        let constants = &model.fibres[fibre];
        let section = Section {
            diameter: 2.0 * constants.material.radius,
            fibre_length: constants.length,
        };
        let nodes = &model.nodes[model.node_range(fibre)];
        for (drag, node) in self.drag.iter_mut().zip(nodes) {
            *drag = NodeDrag::zero();
            drag.row.diagonal = Matrix3::from_diagonal_element(node.mass);
        }
        let segments = model.segment_range(fibre);
        let first = model.points[segments.start];
        for (i, s) in segments.enumerate() {
            let range = model.points[s]..model.points[s + 1];
            let count = range.len();
            let weight = model.segments[s].rest_length / count as f64;
            let t = (self.position[i + 1] - self.position[i]).normalize();
            for (k, p) in range.enumerate() {
                let xi = abscissa(k, count);
                let u = ambient.velocity[p];
                let gradient = &ambient.gradient[p];
                let slip = ambient.velocity_at(p, 0.5)
                    - self.velocity[i] * (1.0 - xi)
                    - self.velocity[i + 1] * xi;
                let torque = law.torque.torque(&t, gradient, &section, &law.fluid);
                let point = PointDrag {
                    tangent: t,
                    drag: scaled(law.drag.resistance(&t, &slip, &section, &law.fluid), weight),
                    spin_drag: Resistance {
                        normal: torque.resistance_normal * weight,
                        axial: torque.resistance_axial * weight,
                    },
                    strain_torque: torque.strain_torque * weight,
                };
                self.point_drag[p - first] = point;
                let z = tensor(&point.drag, &t);
                let r = tensor(&point.spin_drag, &t);
                let zu = z * u;
                let change = ambient.change.get(p).map_or(Vector3::zeros(), |c| z * c);
                let turning = r * spin(gradient) + point.strain_torque;
                for (node, share) in [(i, 1.0 - xi), (i + 1, xi)] {
                    let drag = &mut self.drag[node];
                    drag.row.diagonal += z * (step * share * share);
                    drag.drive += zu * share;
                    drag.drive_change += change * share;
                    drag.spin_resistance += r * share;
                    drag.spin_drive += turning * share;
                }
                let mutual = z * (step * xi * (1.0 - xi));
                self.drag[i].row.upper += mutual;
                self.drag[i + 1].row.lower += mutual;
            }
        }
        for (drag, node) in self.drag.iter_mut().zip(nodes) {
            if node.holds_translation {
                drag.row = BlockRow {
                    diagonal: Matrix3::identity(),
                    ..BlockRow::zero()
                };
            }
        }
        blocktri::factor(self.drag, |drag| &mut drag.row);
    }

    /// Changes one fibre's velocities by `load` and drag over `step`, adds `share` of the new ones to the means and
    /// clears `load`; `moment` is the middle of the sub-step as a fraction of the step.
    pub fn kick_with_drag(&mut self, model: &Model, step: f64, share: f64, moment: f64) {
        let nodes = &model.nodes[model.node_range(self.fibres.start)];
        let mut above = Vector3::zeros();
        for (i, node) in nodes.iter().enumerate() {
            let load = std::mem::replace(&mut self.load[i], Load::ZERO);
            let drag = &mut self.drag[i];
            let t = tangent(&self.orientation[i]);
            let w = &mut self.angular_velocity[i];
            if !node.holds_rotation {
                *w = drag.turned(node, &t, w, &load.torque, step);
            }
            drag.mean_spin += *w * share;
            let v = &mut self.velocity[i];
            let impulse = if node.holds_translation {
                *v
            } else {
                let drive = drag.drive + drag.drive_change * (moment - 1.0);
                *v * node.mass + (load.force + drive) * step
            };
            above = drag.row.diagonal * (impulse - drag.row.lower * above);
            *v = above;
        }
        let mut below = Vector3::zeros();
        for (v, drag) in self.velocity.iter_mut().zip(self.drag.iter_mut()).rev() {
            *v -= drag.row.upper * below;
            below = *v;
            drag.mean_velocity += below * share;
        }
    }

    /// Mean force and torque of one fibre on the fluid at its points.
    pub fn react(&mut self, model: &Model, ambient: &Ambient) {
        let segments = model.segment_range(self.fibres.start);
        let first = model.points[segments.start];
        for (i, s) in segments.enumerate() {
            let range = model.points[s]..model.points[s + 1];
            let count = range.len();
            let (a, b) = (&self.drag[i], &self.drag[i + 1]);
            for (k, p) in range.enumerate() {
                let xi = abscissa(k, count);
                let point = &self.point_drag[p - first];
                let t = &point.tangent;
                // The mean of a uniform change is that in the middle.
                let slip = ambient.velocity_at(p, 0.5)
                    - a.mean_velocity * (1.0 - xi)
                    - b.mean_velocity * xi;
                let turn = spin(&ambient.gradient[p]) - a.mean_spin * (1.0 - xi) - b.mean_spin * xi;
                self.reaction_force[p - first] = -point.drag.force(t, &slip);
                self.reaction_torque[p - first] =
                    -(point.spin_drag.force(t, &turn) + point.strain_torque);
            }
        }
    }
}

impl NodeDrag {
    /// ω' of (J + δt R) ω' = J ω + δt (T + Σ N w (RΩ + T_s)).
    #[inline(always)]
    fn turned(
        &self,
        node: &NodeConstants,
        t: &Vector3,
        w: &Vector3,
        torque: &Vector3,
        step: f64,
    ) -> Vector3 {
        let across = node.transverse_inertia;
        let excess = node.axial_inertia - across;
        let momentum = w * across + t * (excess * w.dot(t));
        let matrix = Matrix3::from_diagonal_element(across)
            + t * t.transpose() * excess
            + self.spin_resistance * step;
        blocktri::inverse(&matrix) * (momentum + (torque + self.spin_drive) * step)
    }
}
