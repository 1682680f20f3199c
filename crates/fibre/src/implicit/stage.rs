//! One sub-step of one fibre: two stages, their equations and their solution.

use super::blocks::{Row, add, add_stiffness, hold, symmetrise};
use super::rotation::{rotation_between, turned};
use super::{Action, Base, GAMMA, Workspace};
use crate::beam::{Motion as EndMotion, Pose, tangent};
use crate::hydrodynamics::Resistance;
use crate::integrate::Batch;
use crate::linear_slip::{LinearDrag, LinearSlip, for_arms};
use crate::system::NodeConstants;
use crate::{Matrix3, Quaternion, Vector3};
use nalgebra::Vector6;

/// Change of a position over the segment length, or of a rotation, at which Newton's iteration stops. The last change is
/// made, so that the error left is about its square.
pub(super) const CLOSE: f64 = 1e-6;
/// Largest rotation of one Newton step.
const STRIDE: f64 = 0.4;
pub(super) const MOST_ITERATIONS: usize = 20;
/// What the third-order quadrature of the velocities at 0, γ and 1 has more than the step.
pub(super) const QUADRATURE: [f64; 3] = {
    let middle = 1.0 / (6.0 * GAMMA * (1.0 - GAMMA));
    let last = (1.0 / 3.0 - 0.5 * GAMMA) / (1.0 - GAMMA);
    [1.0 - middle - last, middle - 1.0 + GAMMA, last - GAMMA]
};

impl Batch<'_> {
    /// Advances one fibre by `h`, sub-step k of n, and adds its share of the mean reaction. The estimated error of the positions over the
    /// fibre's length; none where a stage has no answer.
    pub(super) fn implicit_step(
        &mut self,
        action: &Action,
        work: &mut Workspace,
        h: f64,
        step: (usize, usize),
    ) -> Option<f64> {
        let (k, n) = step;
        let moment = |part: f64| (k as f64 + part) / n as f64;
        let share = 1.0 / n as f64;
        let tau = GAMMA * h;
        let range = action.model.node_range(self.fibres.start);
        let nodes = &action.model.nodes[range];
        self.store(&mut work.entry);
        for (i, node) in nodes.iter().enumerate() {
            let q = self.orientation[i];
            work.base[i] = Base {
                position: self.position[i],
                velocity: self.velocity[i],
                orientation: q,
                spin: node.spin(&q, &self.angular_velocity[i]),
            };
        }
        self.solve_stage(action, work, tau, moment(GAMMA))?;
        let part = share * (1.0 - GAMMA);
        self.exchange(action, part, moment(GAMMA));
        self.exchange_inertia(action, &work.base, tau, part, moment(GAMMA));
        let (onward, rest) = ((1.0 - GAMMA) / GAMMA, (1.0 - GAMMA) * h);
        for (i, node) in nodes.iter().enumerate() {
            let (v, w) = (self.velocity[i], self.angular_velocity[i]);
            let base = &mut work.base[i];
            let spin = node.spin(&self.orientation[i], &w);
            work.middle[i] = [v, w];
            base.position += v * rest;
            base.velocity += (v - base.velocity) * onward;
            base.orientation = turned(&base.orientation, &(w * rest));
            base.spin += (spin - base.spin) * onward;
        }
        self.solve_stage(action, work, tau, moment(1.0))?;
        let part = share * GAMMA;
        self.exchange(action, part, moment(1.0));
        self.exchange_inertia(action, &work.base, tau, part, moment(1.0));
        if work.paired {
            self.follow(action.model, work);
            return Some(self.chain_error(action, work, h));
        }
        Some(self.error(action, work, h))
    }

    /// Solves for the state that `work.base` leads to in `tau`.
    ///
    /// The matrix is new in every iteration: an old one, a little turned, takes stiff stretching for rigid rotation.
    fn solve_stage(
        &mut self,
        action: &Action,
        work: &mut Workspace,
        tau: f64,
        moment: f64,
    ) -> Option<()> {
        if work.paired {
            return self.solve_chain(action, work, tau, moment);
        }
        let fibre = self.fibres.start;
        let nodes = &action.model.nodes[action.model.node_range(fibre)];
        let scale = (nodes.len() - 1) as f64 / action.model.fibres[fibre].length;
        for (i, base) in work.base.iter().enumerate() {
            self.position[i] = base.position + self.velocity[i] * tau;
            self.orientation[i] = turned(&base.orientation, &(self.angular_velocity[i] * tau));
        }
        for _ in 0..MOST_ITERATIONS {
            self.assemble(action, work, tau, moment);
            work.factor();
            work.solve();
            let (mut moved, mut turned) = (0.0_f64, 0.0_f64);
            for change in &work.rhs {
                moved = moved.max(change.fixed_rows::<3>(0).norm() * scale);
                turned = turned.max(change.fixed_rows::<3>(3).norm());
            }
            let size = moved.max(turned);
            if !work.rhs.iter().all(|change| change.sum().is_finite()) {
                return None;
            }
            let part = (STRIDE / turned).min(1.0);
            self.change(nodes, work, tau, part);
            if size < CLOSE || action.settings.linear && part == 1.0 {
                return Some(());
            }
        }
        None
    }

    /// Moves the nodes by `part` of `work.rhs`.
    pub(super) fn change(
        &mut self,
        nodes: &[NodeConstants],
        work: &Workspace,
        tau: f64,
        part: f64,
    ) {
        for (i, node) in nodes.iter().enumerate() {
            let change = work.rhs[i] * part;
            if !node.holds_translation {
                let step: Vector3 = change.fixed_rows::<3>(0).into();
                self.position[i] += step;
                self.velocity[i] += step / tau;
            }
            if !node.holds_rotation {
                let q = turned(&self.orientation[i], &change.fixed_rows::<3>(3).into());
                self.orientation[i] = q;
                self.angular_velocity[i] = rotation_between(&work.base[i].orientation, &q) / tau;
            }
        }
    }

    /// Residual forces and torques in `work.rhs`, and minus their derivatives in `work.rows`.
    pub(super) fn assemble(
        &mut self,
        action: &Action,
        work: &mut Workspace,
        tau: f64,
        moment: f64,
    ) {
        let model = action.model;
        let fibre = self.fibres.start;
        let range = model.node_range(fibre);
        for (i, n) in range.enumerate() {
            let (node, given, base) = (&model.nodes[n], &model.loads[n], &work.base[i]);
            let momentum = node.spin(&self.orientation[i], &self.angular_velocity[i]);
            let inertia = (self.velocity[i] - base.velocity) * (node.mass / tau);
            let load = &self.load[i];
            work.rhs[i] = stacked(
                &(given.force + node.weight + load.force - inertia),
                &(given.torque + load.torque - (momentum - base.spin) / tau),
            );
            let turning = node.spin_change(&self.orientation[i], &self.angular_velocity[i], tau);
            let slow = [
                Matrix3::from_diagonal_element(node.mass / (tau * tau)),
                turning / tau,
            ];
            work.rows[i] = Row::ZERO;
            add(&mut work.rows[i].diagonal, 0, 0, &slow[0]);
            add(&mut work.rows[i].diagonal, 3, 3, &slow[1]);
            work.slow[i] = slow;
        }
        self.add_segments(action, work, tau);
        self.add_drag(action, work, tau, moment);
        self.add_inertia(action, work, tau, moment);
        if action.symmetric {
            symmetrise(&mut work.rows);
        }
        for (i, node) in model.nodes[model.node_range(fibre)].iter().enumerate() {
            for (held, first) in [(node.holds_translation, 0), (node.holds_rotation, 3)] {
                if held {
                    hold(&mut work.rows[i], &mut work.rhs[i], first);
                }
            }
            if node.holds_translation {
                work.low_rank.share[i] = 0.0;
                work.low_rank.response[i] = Matrix3::zeros();
            }
        }
    }

    fn add_segments(&mut self, action: &Action, work: &mut Workspace, tau: f64) {
        let model = action.model;
        let fibre = self.fibres.start;
        let viscous = model.fibres[fibre].material.retardation > 0.0;
        for (i, segment) in model.segments[model.segment_range(fibre)]
            .iter()
            .enumerate()
        {
            let pose = |i: usize| Pose {
                position: &self.position[i],
                orientation: &self.orientation[i],
            };
            let (start, end) = (pose(i), pose(i + 1));
            let (mut force, mut stiffness) = segment.elastic_stiffness(start, end);
            if action.symmetric {
                stiffness.dd -= segment.compression(start, end);
            }
            add_stiffness(&mut work.rows[i..i + 2], &stiffness, 1.0);
            if viscous {
                let motion = |i: usize| EndMotion {
                    velocity: &self.velocity[i],
                    angular_velocity: &self.angular_velocity[i],
                };
                force += segment.viscous_force(start, end, motion(i), motion(i + 1));
                let damping = segment.damping(start, end);
                add_stiffness(&mut work.rows[i..i + 2], &damping, 1.0 / tau);
            }
            work.rhs[i] += stacked(&-force.force, &force.start_torque);
            work.rhs[i + 1] += stacked(&force.force, &force.end_torque);
        }
    }

    /// Drag and hydrodynamic torque with the laws of the present state.
    fn add_drag(&mut self, action: &Action, work: &mut Workspace, tau: f64, moment: f64) {
        work.low_rank.clear();
        let linear = self.linear_part(action);
        let mut linear_slip = LinearSlip::zero();
        self.for_points::<true>(action, moment, |i, _, point| {
            let shares = [1.0 - point.xi, point.xi];
            let force = point.force();
            let turning = point.spin_tensor();
            for (end, share) in shares.into_iter().enumerate() {
                let relative = point.spin - point.angular_velocity[end];
                let torque = (turning * relative + point.strain_torque) * (point.weight * share);
                work.rhs[i + end] += stacked(&(force * share), &torque);
            }
            let z = point.drag.resistance.tensor(&point.tangent);
            let (by_slip, by_span) = point.derivatives(tau);
            let spin_drag = turning * (point.weight / tau);
            for (end, share) in shares.into_iter().enumerate() {
                let row = &mut work.rows[i + end];
                let slow = &mut work.slow[i + end];
                slow[0] += z * (point.weight * share / tau);
                slow[1] += spin_drag * share;
                add(&mut row.diagonal, 3, 3, &(spin_drag * share));
                let onto = |other: usize| {
                    let sign = if other == 0 { 1.0 } else { -1.0 };
                    by_slip * (share * shares[other]) + by_span * (share * sign)
                };
                let twisting = point.torque_by_span(&point.angular_velocity[end]) * share;
                let (first, second) = if end == 0 {
                    (&mut row.diagonal, &mut row.upper)
                } else {
                    (&mut row.lower, &mut row.diagonal)
                };
                add(first, 0, 0, &onto(0));
                add(second, 0, 0, &onto(1));
                add(first, 3, 0, &twisting);
                add(second, 3, 0, &-twisting);
            }
            if linear.is_none() {
                return;
            }
            let lever = point.weight * point.arm;
            linear_slip.add(
                lever,
                point.arm,
                &point.slip,
                &point.drag.resistance,
                point.left,
            );
            let low = &mut work.low_rank;
            let response = if action.symmetric {
                Matrix3::from_diagonal_element(lever / tau)
            } else {
                point.rate(tau) * lever
            };
            for (end, share) in shares.into_iter().enumerate() {
                low.share[i + end] += lever * share;
                low.response[i + end] -= response * share;
            }
        });
        if let Some(linear) = linear {
            let drag = self.linear_drag(action, &linear, &linear_slip);
            self.add_linear_drag(action, work, &drag, &linear_slip.moment);
        }
    }

    /// What the law has for the linear part of the slip.
    pub(super) fn linear_part(&self, action: &Action) -> Option<Resistance> {
        let law = action.flow?.law;
        let constants = &action.model.fibres[self.fibres.start];
        let ratio = constants.length / (2.0 * constants.material.radius);
        law.drag.linear_part(ratio, law.fluid.viscosity)
    }

    /// The tensor that acts on the linear part of the slip.
    pub(super) fn linear_drag(
        &self,
        action: &Action,
        linear: &Resistance,
        slip: &LinearSlip,
    ) -> LinearDrag {
        let last = self.position.len() - 1;
        let span = self.position[last] - self.position[0];
        slip.drag(linear, &span, action.model.fibres[self.fibres.start].length)
    }

    /// Force C M on the shares of the nodes; `work.low_rank.response` is ∂M/∂x before and ∂(C M)/∂x after.
    pub(super) fn add_linear_drag(
        &self,
        action: &Action,
        work: &mut Workspace,
        drag: &LinearDrag,
        moment: &Vector3,
    ) {
        work.low_rank.active = true;
        let pull = drag.tensor * moment;
        for i in 0..work.low_rank.share.len() {
            work.push(i, &(pull * work.low_rank.share[i]));
            work.low_rank.response[i] = drag.tensor * work.low_rank.response[i];
        }
        let low = &mut work.low_rank;
        if !action.symmetric {
            let by_span = drag.by_span(moment);
            let last = low.response.len() - 1;
            low.response[0] -= by_span;
            low.response[last] += by_span;
        }
    }

    /// Adds `share` of the force and torque on the fluid in the present state.
    pub(super) fn exchange(&mut self, action: &Action, share: f64, moment: f64) {
        if action.flow.is_none() {
            return;
        }
        let force = std::mem::take(&mut self.reaction_force);
        let torque = std::mem::take(&mut self.reaction_torque);
        let linear = self.linear_part(action);
        let mut linear_slip = LinearSlip::zero();
        self.for_points::<false>(action, moment, |_, p, point| {
            let weight = share * point.weight;
            let [a, b] = point.angular_velocity;
            let relative = point.spin - a * (1.0 - point.xi) - b * point.xi;
            force[p] -= point.force() * share;
            torque[p] -=
                (point.spin_drag.force(&point.tangent, &relative) + point.strain_torque) * weight;
            if linear.is_some() {
                let lever = point.weight * point.arm;
                linear_slip.add(
                    lever,
                    point.arm,
                    &point.slip,
                    &point.drag.resistance,
                    point.left,
                );
            }
        });
        if let Some(linear) = linear {
            let drag = self.linear_drag(action, &linear, &linear_slip);
            let pull = drag.tensor * linear_slip.moment * share;
            for_arms(action.model, self.fibres.start, |_, p, _, weight, arm| {
                force[p] -= pull * (weight * arm);
            });
        }
        self.reaction_force = force;
        self.reaction_torque = torque;
    }

    /// Largest estimated error of a position \[m\]: the difference to the third-order quadrature of
    /// the velocities at 0, γ and 1, without its stiff part as A⁻¹ (inertia + drag) takes it away (Shampine 1984).
    fn error(&self, action: &Action, work: &mut Workspace, h: f64) -> f64 {
        let model = action.model;
        let fibre = self.fibres.start;
        if action.settings.tolerance == f64::INFINITY {
            return 0.0;
        }
        let weights = QUADRATURE.map(|weight| weight * h);
        let nodes = &model.nodes[model.node_range(fibre)];
        for (i, node) in nodes.iter().enumerate() {
            let (entry, [v, w]) = (&work.entry[i], &work.middle[i]);
            let moved =
                entry.velocity * weights[0] + v * weights[1] + self.velocity[i] * weights[2];
            let turned = entry.angular_velocity * weights[0]
                + w * weights[1]
                + self.angular_velocity[i] * weights[2];
            let [inertia, rotary] = &work.slow[i];
            let free = |held: bool, v: Vector3| if held { Vector3::zeros() } else { v };
            work.rhs[i] = stacked(
                &free(node.holds_translation, inertia * moved),
                &free(node.holds_rotation, rotary * turned),
            );
        }
        work.solve();
        work.rhs.iter().fold(0.0_f64, |largest, change| {
            largest.max(change.fixed_rows::<3>(0).norm())
        })
    }
}

impl NodeConstants {
    /// Angular momentum of the node's own rotation.
    #[inline(always)]
    pub(super) fn spin(&self, q: &Quaternion, w: &Vector3) -> Vector3 {
        let t = tangent(q);
        let excess = self.axial_inertia - self.transverse_inertia;
        w * self.transverse_inertia + t * (excess * w.dot(&t))
    }

    /// Derivative of the angular momentum by a rotation that ends the stage, up to (τω)².
    ///
    /// exp(δ) exp(τω) = exp(τω + (I − ½[τω×])δ), and the tangent turns by δ × t.
    fn spin_change(&self, q: &Quaternion, w: &Vector3, tau: f64) -> Matrix3 {
        let t = tangent(q);
        let excess = self.axial_inertia - self.transverse_inertia;
        let inertia =
            Matrix3::from_diagonal_element(self.transverse_inertia) + t * t.transpose() * excess;
        let rate = Matrix3::identity() / tau - w.cross_matrix() * 0.5;
        let tilt = Matrix3::from_diagonal_element(t.dot(w)) + t * w.transpose();
        inertia * rate - tilt * t.cross_matrix() * excess
    }
}

pub(super) fn stacked(force: &Vector3, torque: &Vector3) -> Vector6<f64> {
    Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z)
}
