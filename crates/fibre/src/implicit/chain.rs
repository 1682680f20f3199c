//! Fibres without twist: three unknowns a node instead of six, in the stages of the implicit integrator.
//!
//! The energy is that of stretched segments and of the hinges between them ([`crate::beam::Hinge`]). Torques act as couples of
//! forces at the ends of a segment, T × t/l; about the tangent they have nothing to turn. A hinge ties three nodes, so two
//! nodes make one row of the block-tridiagonal solver of the full beams. Frames follow the tangents from where they were.

use super::blocks::{Row, add, hold};
use super::low_rank::place;
use super::point::Point;
use super::rotation::turned;
use super::stage::{CLOSE, MOST_ITERATIONS, QUADRATURE};
use super::{Action, Workspace};
use crate::beam::{Hinge, HingeStiffness, tangent};
use crate::integrate::Batch;
use crate::linear_slip::LinearSlip;
use crate::system::Model;
use crate::{FibreSystem, Matrix3, Quaternion, Vector3};

/// Largest displacement of one Newton step over the length of a segment.
const STRIDE: f64 = 0.4;

impl Workspace {
    pub(super) fn push(&mut self, node: usize, force: &Vector3) {
        let (row, first) = place(node, self.paired);
        let mut view = self.rhs[row].fixed_rows_mut::<3>(first);
        view += force;
    }

    /// Adds minus the derivative of the force on node `i` by the position of node `j`.
    pub(super) fn tie(&mut self, i: usize, j: usize, part: &Matrix3) {
        let ((row, a), (column, b)) = (place(i, self.paired), place(j, self.paired));
        let row = if column > row {
            &mut self.rows[row].upper
        } else if column < row {
            &mut self.rows[row].lower
        } else {
            &mut self.rows[row].diagonal
        };
        add(row, a, b, part);
    }

    /// Adds the forces of a gradient by the span of the segment from node `i`, and their derivative by it.
    fn add_span(&mut self, i: usize, gradient: &Vector3, second: &Matrix3) {
        self.push(i, gradient);
        self.push(i + 1, &-gradient);
        for (a, b, sign) in [(0, 0, 1.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 1.0)] {
            self.tie(i + a, i + b, &(second * sign));
        }
    }

    /// Adds a hinge between the segments that end and start at node `i`.
    fn add_hinge(&mut self, i: usize, k: &HingeStiffness, factor: f64) {
        let [first, second] = &k.gradient;
        self.push(i - 1, first);
        self.push(i, &(second - first));
        self.push(i + 1, &-second);
        // By the nodes: d₁ = x_i − x_{i−1}, d₂ = x_{i+1} − x_i.
        let signs = [[-1.0, 0.0], [1.0, -1.0], [0.0, 1.0]];
        let [own, mutual, other] = &k.second;
        for (a, left) in signs.iter().enumerate() {
            for (b, right) in signs.iter().enumerate() {
                let part = own * (left[0] * right[0])
                    + mutual * (left[0] * right[1])
                    + mutual.transpose() * (left[1] * right[0])
                    + other * (left[1] * right[1]);
                self.tie(i + a - 1, i + b - 1, &(part * factor));
            }
        }
    }
}

impl Batch<'_> {
    /// Solves for the state that `work.base` leads to in `tau`.
    pub(super) fn solve_chain(
        &mut self,
        action: &Action,
        work: &mut Workspace,
        tau: f64,
        moment: f64,
    ) -> Option<()> {
        let fibre = self.fibres.start;
        let nodes = &action.model.nodes[action.model.node_range(fibre)];
        let scale = (nodes.len() - 1) as f64 / action.model.fibres[fibre].length;
        for (i, node) in nodes.iter().enumerate() {
            let base = &work.base[i];
            self.position[i] = base.position + self.velocity[i] * tau;
            if node.holds_rotation {
                self.orientation[i] = turned(&base.orientation, &(self.angular_velocity[i] * tau));
            }
        }
        for _ in 0..MOST_ITERATIONS {
            self.assemble_chain(action, work, tau, moment);
            work.factor();
            work.solve();
            let change = |work: &Workspace, i: usize| {
                let (row, first) = place(i, true);
                Vector3::from(work.rhs[row].fixed_rows::<3>(first))
            };
            let moves = (0..nodes.len()).map(|i| change(work, i).norm_squared());
            let size = moves.sum::<f64>().sqrt();
            if !size.is_finite() {
                return None;
            }
            let largest = (0..nodes.len()).map(|i| change(work, i).norm());
            let size = largest.fold(0.0, f64::max) * scale;
            let part = (STRIDE / size).min(1.0);
            for (i, node) in nodes.iter().enumerate() {
                if !node.holds_translation {
                    let step = change(work, i) * part;
                    self.position[i] += step;
                    self.velocity[i] += step / tau;
                }
            }
            if size < CLOSE || action.settings.linear && part == 1.0 {
                return Some(());
            }
        }
        None
    }

    /// Residual forces in `work.rhs`, and minus their derivatives in `work.rows`.
    fn assemble_chain(&mut self, action: &Action, work: &mut Workspace, tau: f64, moment: f64) {
        let model = action.model;
        let fibre = self.fibres.start;
        let range = model.node_range(fibre);
        let count = range.len();
        work.rows.fill(Row::ZERO);
        work.rhs.fill(nalgebra::Vector6::zeros());
        if count % 2 == 1 {
            // Nobody sits in the second half of the last row.
            add(
                &mut work.rows[count / 2].diagonal,
                3,
                3,
                &Matrix3::identity(),
            );
        }
        for (i, n) in range.clone().enumerate() {
            let (node, given, load) = (&model.nodes[n], &model.loads[n], &self.load[i]);
            let inertia = (self.velocity[i] - work.base[i].velocity) * (node.mass / tau);
            work.push(i, &(given.force + node.weight + load.force - inertia));
            let slow = Matrix3::from_diagonal_element(node.mass / (tau * tau));
            work.tie(i, i, &slow);
            work.slow[i] = [slow, Matrix3::zeros()];
            let torque = given.torque + load.torque;
            if torque != Vector3::zeros() {
                self.add_couple(work, i, &torque);
            }
        }
        self.add_chain(action, work, tau);
        self.add_chain_drag(action, work, tau, moment);
        self.add_inertia(action, work, tau, moment);
        for (i, node) in model.nodes[range].iter().enumerate() {
            if node.holds_translation {
                let (row, first) = place(i, true);
                hold(&mut work.rows[row], &mut work.rhs[row], first);
                work.low_rank.share[i] = 0.0;
                work.low_rank.response[i] = Matrix3::zeros();
            }
        }
    }

    /// A torque on a node: in halves on the segments that meet there.
    fn add_couple(&self, work: &mut Workspace, node: usize, torque: &Vector3) {
        let last = self.position.len() - 1;
        let segments = node.saturating_sub(1)..(node + 1).min(last);
        let share = 1.0 / segments.len() as f64;
        for i in segments {
            let span = self.position[i + 1] - self.position[i];
            let pull = torque.cross(&span) * (share / span.norm_squared());
            work.push(i, &-pull);
            work.push(i + 1, &pull);
        }
    }

    /// Stretching and bending, elastic and viscous.
    fn add_chain(&self, action: &Action, work: &mut Workspace, tau: f64) {
        let model = action.model;
        let fibre = self.fibres.start;
        let segments = &model.segments[model.segment_range(fibre)];
        let retardation = model.fibres[fibre].material.retardation;
        for (i, segment) in segments.iter().enumerate() {
            let span = self.position[i + 1] - self.position[i];
            let length = span.norm();
            let t = span / length;
            let along = t * t.transpose();
            let tension = segment.axial * (length - segment.rest_length);
            let across = (Matrix3::identity() - along) * (tension / length);
            work.add_span(i, &(t * tension), &(along * segment.axial + across));
            if retardation > 0.0 {
                let damping = retardation * segment.axial;
                let rate = t.dot(&(self.velocity[i + 1] - self.velocity[i]));
                work.add_span(i, &(t * (damping * rate)), &(along * (damping / tau)));
            }
        }
        let rate = |i: usize| self.velocity[i + 1] - self.velocity[i];
        for_hinges(
            model,
            fibre,
            self.position,
            self.orientation,
            |at, hinge| {
                let elastic = hinge.stiffness();
                let viscous = (retardation > 0.0).then(|| {
                    let rates = at.rates(rate, self.angular_velocity, self.orientation);
                    hinge.damping(retardation, rates)
                });
                let parts = [(Some(elastic), 1.0), (viscous, 1.0 / tau)];
                for (k, factor) in parts.iter().filter_map(|(k, f)| k.map(|k| (k, *f))) {
                    match at {
                        At::Joint(i) => work.add_hinge(i, &k, factor),
                        At::Clamp { segment, .. } => {
                            work.add_span(segment, &k.gradient[1], &(k.second[2] * factor));
                        }
                    }
                }
            },
        );
    }

    fn add_chain_drag(&self, action: &Action, work: &mut Workspace, tau: f64, moment: f64) {
        work.low_rank.clear();
        let linear = self.linear_part(action);
        let mut linear_slip = LinearSlip::zero();
        self.for_points::<true>(action, moment, |i, _, point: &Point| {
            let shares = [1.0 - point.xi, point.xi];
            let force = point.force();
            let span = self.position[i + 1] - self.position[i];
            let length = span.norm();
            let relative = point.spin - point.angular_velocity[0];
            let torque = (point.spin_tensor() * relative + point.strain_torque) * point.weight;
            let t = &point.tangent;
            let couple = torque.cross(t) / length;
            // −∂(couple)/∂(relative displacement of the ends), from the torque against the segment's own rotation.
            let resists = (Matrix3::identity() - t * t.transpose())
                * (point.spin_drag.normal * point.weight / (length * length * tau));
            let gradient = -couple;
            work.add_span(i, &gradient, &resists);
            let z = point.drag.resistance.tensor(t);
            let (by_slip, by_span) = point.derivatives(tau);
            for (end, share) in shares.into_iter().enumerate() {
                work.push(i + end, &(force * share));
                work.slow[i + end][0] += z * (point.weight * share / tau);
                for (other, sign) in [(0, 1.0), (1, -1.0)] {
                    let part = by_slip * (share * shares[other]) + by_span * (share * sign);
                    work.tie(i + end, i + other, &part);
                }
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
            let response = point.rate(tau) * lever;
            for (end, share) in shares.into_iter().enumerate() {
                work.low_rank.share[i + end] += lever * share;
                work.low_rank.response[i + end] -= response * share;
            }
        });
        if let Some(linear) = linear {
            let drag = self.linear_drag(action, &linear, &linear_slip);
            self.add_linear_drag(action, work, &drag, &linear_slip.moment);
        }
    }

    /// Largest estimated error of a position \[m\], as [`Batch::implicit_step`] takes it.
    pub(super) fn chain_error(&self, action: &Action, work: &mut Workspace, h: f64) -> f64 {
        if action.settings.tolerance == f64::INFINITY {
            return 0.0;
        }
        let model = action.model;
        work.rhs.fill(nalgebra::Vector6::zeros());
        for (i, n) in model.node_range(self.fibres.start).enumerate() {
            if model.nodes[n].holds_translation {
                continue;
            }
            let [first, middle, last] = QUADRATURE.map(|weight| weight * h);
            let moved = work.entry[i].velocity * first
                + work.middle[i][0] * middle
                + self.velocity[i] * last;
            let stiff = work.slow[i][0] * moved;
            work.push(i, &stiff);
        }
        work.solve();
        let errors = (0..self.position.len()).map(|i| {
            let (row, first) = place(i, true);
            work.rhs[row].fixed_rows::<3>(first).norm()
        });
        errors.fold(0.0, f64::max)
    }

    /// Turns the frames from the `entry` of the sub-step to the tangents of now.
    pub(super) fn follow(&mut self, model: &Model, work: &Workspace) {
        let nodes = &model.nodes[model.node_range(self.fibres.start)];
        let last = nodes.len() - 1;
        for (i, node) in nodes.iter().enumerate() {
            if node.holds_rotation {
                continue;
            }
            let (mut direction, mut spin, mut count) = (Vector3::zeros(), Vector3::zeros(), 0.0);
            for s in i.saturating_sub(1)..(i + 1).min(last) {
                let span = self.position[s + 1] - self.position[s];
                let length = span.norm();
                direction += span / length;
                spin += span.cross(&(self.velocity[s + 1] - self.velocity[s])) / (length * length);
                count += 1.0;
            }
            let before = work.entry[i].orientation;
            let turn = Quaternion::rotation_between(&tangent(&before), &direction);
            self.orientation[i] = turn.unwrap_or_else(Quaternion::identity) * before;
            self.orientation[i].renormalize();
            self.angular_velocity[i] = spin / count;
        }
    }
}

impl FibreSystem {
    /// Power that is lost in the material of a local twist-free fibre \[W\].
    pub(crate) fn chain_viscous_power(&self, fibre: usize) -> f64 {
        let model = &self.model;
        let nodes = model.node_range(fibre);
        let retardation = model.fibres[fibre].material.retardation;
        let position = &self.motion.position[nodes.clone()];
        let velocity = &self.motion.velocity[nodes.clone()];
        let spin = &self.motion.angular_velocity[nodes.clone()];
        let orientation = &self.motion.orientation[nodes];
        let rate = |i: usize| velocity[i + 1] - velocity[i];
        let mut power = 0.0;
        for (i, segment) in model.segments[model.segment_range(fibre)]
            .iter()
            .enumerate()
        {
            let t = (position[i + 1] - position[i]).normalize();
            power += retardation * segment.axial * t.dot(&rate(i)).powi(2);
        }
        for_hinges(model, fibre, position, orientation, |at, hinge| {
            let rates = at.rates(rate, spin, orientation);
            let k = hinge.damping(retardation, rates);
            power += k.gradient[0].dot(&rates[0]) + k.gradient[1].dot(&rates[1]);
        });
        power
    }
}

impl At {
    /// The inner node between two segments.
    pub fn joint(self) -> Option<usize> {
        match self {
            Self::Joint(node) => Some(node),
            Self::Clamp { .. } => None,
        }
    }

    /// Rates of the hinge's two chords \[m/s\], with those of all chords.
    fn rates(
        self,
        rate: impl Fn(usize) -> Vector3,
        spin: &[Vector3],
        orientation: &[Quaternion],
    ) -> [Vector3; 2] {
        match self {
            Self::Joint(i) => [rate(i - 1), rate(i)],
            Self::Clamp { node, segment } => [
                spin[node].cross(&tangent(&orientation[node])),
                rate(segment),
            ],
        }
    }
}

/// Where a hinge is.
#[derive(Clone, Copy, Debug)]
pub(crate) enum At {
    /// At an inner node, between the segments before and after it.
    Joint(usize),
    /// Between a held frame and a segment.
    Clamp {
        /// The node that holds.
        node: usize,
        /// The segment from or to it.
        segment: usize,
    },
}

/// Visits the hinges of a twist-free fibre, nodes and segments counted from its own first.
pub(crate) fn for_hinges(
    model: &Model,
    fibre: usize,
    position: &[Vector3],
    orientation: &[Quaternion],
    mut visit: impl FnMut(At, Hinge),
) {
    let segments = &model.segments[model.segment_range(fibre)];
    let nodes = &model.nodes[model.node_range(fibre)];
    let chord = |s: usize| position[s + 1] - position[s];
    for (node, constants) in nodes.iter().enumerate() {
        let (before, after) = (node.checked_sub(1), (node < segments.len()).then_some(node));
        if constants.holds_rotation {
            let e = tangent(&orientation[node]);
            for segment in [before, after].into_iter().flatten() {
                let hinge = Hinge::clamp(&segments[segment], e, chord(segment));
                visit(At::Clamp { node, segment }, hinge);
            }
        } else if let (Some(a), Some(b)) = (before, after) {
            let hinge = Hinge::between([&segments[a], &segments[b]], [chord(a), chord(b)]);
            visit(At::Joint(node), hinge);
        }
    }
}
