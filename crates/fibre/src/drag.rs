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
//! fluid to round-off. Where the law has another resistance to a linear slip ([`crate::linear_slip`]), b bᵀ ⊗ C is added
//! to D, with b_a = Σ N_a w σ: Sherman and Morrison's formula for three columns. Torque is lumped: node a feels N_a w [R(Ω − ω_a) + T_s], which has the same sum over a segment.

mod inertia;

pub(crate) use inertia::{Added, displaced};

use crate::beam::tangent;
use crate::blocktri;
use crate::hydrodynamics::{DragModel, FluidProperties, Resistance, Section, TorqueModel, spin};
use crate::integrate::{Batch, Flow};
use crate::linear_slip::{LinearSlip, for_arms};
use crate::points::abscissa;
use crate::symmetric::Symmetric;
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
    /// Pivot of M + δt D, inverted; before that its block on the diagonal.
    pivot: Symmetric,
    /// Its block of this node and the next.
    next: Symmetric,
    /// Σ N w Z u at the end of the step \[N\].
    drive: Vector3,
    /// Its change in the step.
    drive_change: Vector3,
    /// Σ N w R \[N·m·s\].
    spin_resistance: Symmetric,
    /// Σ N w (RΩ + T_s) \[N·m\].
    spin_drive: Vector3,
    mean_velocity: Vector3,
    mean_spin: Vector3,
    /// b, zero where D has no part of rank three.
    lever: f64,
    /// What M' changes the new velocity by, M' = Σ b v' without it.
    by_lever: Matrix3,
}

impl NodeDrag {
    pub fn zero() -> Self {
        Self {
            pivot: Symmetric::default(),
            next: Symmetric::default(),
            drive: Vector3::zeros(),
            drive_change: Vector3::zeros(),
            spin_resistance: Symmetric::default(),
            spin_drive: Vector3::zeros(),
            mean_velocity: Vector3::zeros(),
            mean_spin: Vector3::zeros(),
            lever: 0.0,
            by_lever: Matrix3::zeros(),
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
    /// w σ, and w σ C.
    lever: f64,
    by_moment: Matrix3,
}

impl PointDrag {
    pub fn zero() -> Self {
        Self {
            tangent: Vector3::zeros(),
            drag: Resistance::default(),
            spin_drag: Resistance::default(),
            strain_torque: Vector3::zeros(),
            lever: 0.0,
            by_moment: Matrix3::zeros(),
        }
    }
}

fn scaled(r: Resistance, weight: f64) -> Resistance {
    Resistance {
        normal: r.normal * weight,
        axial: r.axial * weight,
    }
}

impl Batch<'_> {
    /// Evaluates the laws at one fibre's points with the present slip and factors M + δt D for sub-steps of `step`.
    pub fn prepare_drag(&mut self, model: &Model, flow: &Flow, step: f64) {
        let Flow { law, ambient, .. } = *flow;
        let fibre = self.fibres.start;
        let constants = &model.fibres[fibre];
        let mut section = Section::middle(2.0 * constants.material.radius, constants.length);
        let linear = law
            .drag
            .linear_part(section.aspect_ratio(), law.fluid.viscosity);
        let mut linear_slip = LinearSlip::zero();
        let nodes = &model.nodes[model.node_range(fibre)];
        for (drag, node) in self.drag.iter_mut().zip(nodes) {
            *drag = NodeDrag::zero();
            drag.pivot = Symmetric::unit(node.mass);
        }
        let segments = model.segment_range(fibre);
        let first = model.points[segments.start];
        let mut along = -0.5 * constants.length;
        for (i, s) in segments.enumerate() {
            let range = model.points[s]..model.points[s + 1];
            let count = range.len();
            section.diameter = 2.0 * model.segments[s].radius;
            section.segment_length = model.segments[s].rest_length;
            let weight = section.segment_length / count as f64;
            let t = (self.position[i + 1] - self.position[i]).normalize();
            for (k, p) in range.enumerate() {
                let xi = abscissa(k, count);
                let u = ambient.velocity[p];
                let gradient = ambient.gradient_at(p);
                let slip = ambient.velocity_at(p, 0.5)
                    - self.velocity[i] * (1.0 - xi)
                    - self.velocity[i + 1] * xi;
                let arm = along + section.segment_length * xi;
                section.place = 2.0 * arm / constants.length;
                let torque = law.torque.torque(&t, gradient, &section, &law.fluid);
                let local = law.drag.resistance(&t, &slip, &section, &law.fluid);
                let (local, left) = ambient.yielded(p, local, weight);
                if linear.is_some() {
                    linear_slip.add(weight * arm, arm, &slip, &local, left);
                }
                let point = PointDrag {
                    tangent: t,
                    drag: scaled(local, weight),
                    spin_drag: Resistance {
                        normal: torque.resistance_normal * weight,
                        axial: torque.resistance_axial * weight,
                    },
                    strain_torque: torque.strain_torque * weight,
                    ..PointDrag::zero()
                };
                self.point_drag[p - first] = point;
                let z = point.drag.tensor(&t);
                let r = point.spin_drag.tensor(&t);
                let zu = z * u;
                let change = ambient.change.get(p).map_or(Vector3::zeros(), |c| z * c);
                let turning = r * spin(gradient) + point.strain_torque;
                for (node, share) in [(i, 1.0 - xi), (i + 1, xi)] {
                    let drag = &mut self.drag[node];
                    drag.pivot.add(&z, step * share * share);
                    drag.drive += zu * share;
                    drag.drive_change += change * share;
                    drag.spin_resistance.add(&r, share);
                    drag.spin_drive += turning * share;
                }
                self.drag[i].next.add(&z, step * xi * (1.0 - xi));
            }
            along += section.segment_length;
        }
        if flow.inertia {
            self.prepare_inertia(model, flow);
        }
        // Thomas: a held node takes nothing from the one before.
        let mut taken = Matrix3::zeros();
        for (drag, node) in self.drag.iter_mut().zip(nodes) {
            if node.holds_translation {
                taken = Matrix3::zeros();
                continue;
            }
            drag.pivot.add(&taken, -1.0);
            drag.pivot = drag.pivot.inverse();
            let next = drag.next.matrix();
            taken = next * drag.pivot.matrix() * next;
        }
        if let Some(linear) = linear {
            self.prepare_linear_slip(model, &linear, &linear_slip, ambient, step);
        }
    }

    /// Adds the part of rank three to drag and drive, and solves for its columns.
    fn prepare_linear_slip(
        &mut self,
        model: &Model,
        linear: &Resistance,
        slip: &LinearSlip,
        ambient: &Ambient,
        step: f64,
    ) {
        let fibre = self.fibres.start;
        let last = self.position.len() - 1;
        let span = self.position[last] - self.position[0];
        let c = slip.drag(linear, &span, model.fibres[fibre].length).tensor;
        let first = model.points[model.segment_range(fibre).start];
        let (mut drive, mut change) = (Vector3::zeros(), Vector3::zeros());
        for_arms(model, fibre, |i, p, xi, weight, arm| {
            let lever = weight * arm;
            let point = &mut self.point_drag[p];
            point.lever = lever;
            point.by_moment = c * lever;
            self.drag[i].lever += lever * (1.0 - xi);
            self.drag[i + 1].lever += lever * xi;
            drive += ambient.velocity[first + p] * lever;
            change += ambient
                .change
                .get(first + p)
                .map_or(Vector3::zeros(), |c| c * lever);
        });
        let nodes = &model.nodes[model.node_range(fibre)];
        let mut passed = Matrix3::zeros();
        for (drag, node) in self.drag.iter_mut().zip(nodes) {
            drag.by_lever = Matrix3::zeros();
            if !node.holds_translation {
                drag.drive += c * drive * drag.lever;
                drag.drive_change += c * change * drag.lever;
                let own = Matrix3::from_diagonal_element(drag.lever);
                drag.by_lever = drag.pivot.matrix() * (own - passed);
            }
            passed = drag.next.matrix() * drag.by_lever;
        }
        let (mut below, mut taken) = (Matrix3::zeros(), Matrix3::zeros());
        for (drag, node) in self.drag.iter_mut().zip(nodes).rev() {
            if !node.holds_translation {
                drag.by_lever -= drag.pivot.matrix() * drag.next.matrix() * below;
            }
            below = drag.by_lever;
            taken += below * drag.lever;
        }
        let damped = Matrix3::identity() + c * taken * step;
        let answer = blocktri::inverse(&damped) * c * step;
        for drag in self.drag.iter_mut() {
            drag.by_lever = -drag.by_lever * answer;
        }
    }

    /// Changes one fibre's velocities by `load` and drag over `step`, adds `share` of the new ones to the means and
    /// clears `load`; `moment` is the middle of the sub-step as a fraction of the step.
    pub fn kick_with_drag(&mut self, model: &Model, step: f64, share: f64, moment: f64) {
        let nodes = &model.nodes[model.node_range(self.fibres.start)];
        let (mut passed, mut carried) = (Vector3::zeros(), Vector3::zeros());
        for (i, node) in nodes.iter().enumerate() {
            let load = std::mem::replace(&mut self.load[i], Load::ZERO);
            let drag = &mut self.drag[i];
            let t = tangent(&self.orientation[i]);
            let w = &mut self.angular_velocity[i];
            if !node.holds_rotation {
                *w = drag.turned(node, &t, w, &load.torque, step);
            }
            drag.mean_spin += *w * share;
            let after = self.velocity.get(i + 1).copied();
            let v = &mut self.velocity[i];
            let before = *v;
            if !node.holds_translation {
                let drive = drag.drive + drag.drive_change * (moment - 1.0);
                let mut impulse = before * node.mass + (load.force + drive) * step - passed;
                if let Some(added) = self.added.get(i) {
                    let next = added.next.times(&after.unwrap_or_default());
                    impulse += added.own.times(&before) + carried + next;
                }
                *v = drag.pivot.times(&impulse);
            }
            if let Some(added) = self.added.get(i) {
                carried = added.next.times(&before);
            }
            passed = drag.next.times(v);
        }
        let (mut below, mut moment) = (Vector3::zeros(), Vector3::zeros());
        let rows = self.velocity.iter_mut().zip(self.drag.iter_mut());
        for ((v, drag), node) in rows.zip(nodes).rev() {
            if !node.holds_translation {
                *v -= drag.pivot.times(&drag.next.times(&below));
            }
            below = *v;
            drag.mean_velocity += below * share;
            moment += below * drag.lever;
        }
        if self.drag[0].lever != 0.0 {
            for (v, drag) in self.velocity.iter_mut().zip(self.drag.iter_mut()) {
                let change = drag.by_lever * moment;
                *v += change;
                drag.mean_velocity += change * share;
            }
        }
    }

    /// Mean slip at a point of segment `i`.
    fn mean_slip(&self, i: usize, point: usize, xi: f64, ambient: &Ambient) -> Vector3 {
        // The mean of a uniform change is that in the middle.
        ambient.velocity_at(point, 0.5)
            - self.drag[i].mean_velocity * (1.0 - xi)
            - self.drag[i + 1].mean_velocity * xi
    }

    /// Mean force and torque of one fibre on the fluid at its points.
    pub fn react(&mut self, model: &Model, flow: &Flow) {
        let ambient = flow.ambient;
        let segments = model.segment_range(self.fibres.start);
        let first = model.points[segments.start];
        let mut moment = Vector3::zeros();
        for_arms(model, self.fibres.start, |i, p, xi, _, _| {
            let lever = self.point_drag[p].lever;
            if lever != 0.0 {
                moment += self.mean_slip(i, first + p, xi, ambient) * lever;
            }
        });
        for (i, s) in segments.enumerate() {
            let range = model.points[s]..model.points[s + 1];
            let count = range.len();
            let (a, b) = (&self.drag[i], &self.drag[i + 1]);
            for (k, p) in range.enumerate() {
                let xi = abscissa(k, count);
                let point = &self.point_drag[p - first];
                let t = &point.tangent;
                let slip = self.mean_slip(i, p, xi, ambient);
                let turn =
                    spin(ambient.gradient_at(p)) - a.mean_spin * (1.0 - xi) - b.mean_spin * xi;
                self.reaction_force[p - first] =
                    -(point.drag.force(t, &slip) + point.by_moment * moment);
                self.reaction_torque[p - first] =
                    -(point.spin_drag.force(t, &turn) + point.strain_torque);
            }
        }
        if flow.inertia {
            self.react_inertia(model, flow);
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
        let matrix = self.spin_resistance.combined(step, across, t, excess);
        let impulse = momentum + (torque + self.spin_drive) * step;
        matrix.inverse().times(&impulse)
    }
}
