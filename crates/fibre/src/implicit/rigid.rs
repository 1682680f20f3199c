//! Rigid fibres: six unknowns instead of six a node, with the stages of the implicit integrator.
//!
//! The body is that of the nodes: their masses at their places, with their own rotary inertia. Its state is read off the
//! nodes (mass centre, mean velocity, frame and angular velocity of the first node) and written back to all of them, so
//! that everything else sees a fibre like any other, and no shape error gathers.

use super::point::{Gathered, Point};
use super::rotation::{rotation_between, turned};
use super::stage::QUADRATURE;
use super::{Action, Done, GAMMA, Refinement};
use crate::beam::{Segment, tangent};
use crate::integrate::Batch;
use crate::linear_slip::LinearSlip;
use crate::system::{Model, NodeConstants};
use crate::{Matrix3, Quaternion, Vector3};
use nalgebra::{Matrix6, Vector6};

/// A fibre as a rigid body.
#[derive(Clone, Debug)]
pub(crate) struct Body {
    /// Mass \[kg\].
    mass: f64,
    /// Inertia about the mass centre in the frame of the first node \[kg·m²\].
    inertia: Matrix3,
    /// Nodes about the mass centre and their frames, in the frame of the first node.
    nodes: Vec<(Vector3, Quaternion)>,
    /// Straight, and as thick everywhere.
    uniform: bool,
}

/// Newton's iteration ends when the angle and the place over the fibre's length change by less. The last change is made and
/// leaves about its square, which a flow forgets, but not a free body.
const CLOSE: f64 = 1e-6;
const CLOSE_WHEN_FREE: f64 = 1e-12;
/// Nodes of a straight fibre off the line from end to end, over its length.
const OFF: f64 = 1e-9;
const MOST_ITERATIONS: usize = 30;

/// Motion of the body.
#[derive(Clone, Copy, Debug)]
struct State {
    centre: Vector3,
    velocity: Vector3,
    frame: Quaternion,
    spin: Vector3,
}

impl Body {
    /// The stress-free shape of a chain of segments.
    pub fn new(segments: &[Segment], constants: &[NodeConstants]) -> Self {
        let mut nodes = vec![(Vector3::zeros(), Quaternion::identity())];
        for segment in segments {
            let (x, q) = nodes[nodes.len() - 1];
            let frame = q * segment.start_frame;
            let end = x + frame * Vector3::new(segment.rest_length, 0.0, 0.0);
            nodes.push((end, frame * segment.end_frame.inverse()));
        }
        let mass: f64 = constants.iter().map(|node| node.mass).sum();
        let weighted = nodes.iter().zip(constants).map(|((x, _), n)| x * n.mass);
        let centre = weighted.sum::<Vector3>() / mass;
        let mut inertia = Matrix3::zeros();
        for ((x, q), node) in nodes.iter_mut().zip(constants) {
            *x -= centre;
            let t = tangent(q);
            inertia += (Matrix3::from_diagonal_element(x.norm_squared()) - *x * x.transpose())
                * node.mass
                + Matrix3::from_diagonal_element(node.transverse_inertia)
                + t * t.transpose() * (node.axial_inertia - node.transverse_inertia);
        }
        let thick = |s: &Segment| s.radius == segments[0].radius;
        Self {
            mass,
            inertia,
            uniform: segments.iter().all(thick) && straight(&nodes),
            nodes,
        }
    }

    fn inertia_in(&self, frame: &Quaternion) -> Matrix3 {
        let r = frame.to_rotation_matrix();
        r.matrix() * self.inertia * r.matrix().transpose()
    }
}

fn straight(nodes: &[(Vector3, Quaternion)]) -> bool {
    let span = nodes[nodes.len() - 1].0 - nodes[0].0;
    let off = |(x, _): &(Vector3, Quaternion)| (x - nodes[0].0).cross(&span).norm();
    nodes
        .iter()
        .all(|node| off(node) <= OFF * span.norm_squared())
}

impl Batch<'_> {
    /// A rigid fibre through a whole step `dt`, in as many equal sub-steps as its error asks for.
    pub(super) fn sub_cycle_rigid(&mut self, action: &Action, body: &Body, dt: f64) -> Done {
        let first = self.body_state(action.model, body);
        let mut refinement = Refinement::start();
        loop {
            let n = refinement.sub_steps;
            self.reaction_force.fill(Vector3::zeros());
            self.reaction_torque.fill(Vector3::zeros());
            let mut error = Some(0.0_f64);
            for k in 0..n {
                let estimate = self.rigid_step(action, body, dt / n as f64, (k, n));
                error = error.zip(estimate).map(|(a, b)| a.max(b));
            }
            let last = self.body_state(action.model, body);
            let turn = rotation_between(&first.frame, &last.frame).norm();
            let length = action.model.fibres[self.fibres.start].length;
            let moved = (last.centre - first.centre).norm() + 0.5 * length * turn;
            let limit = action.settings.tolerance * moved + f64::EPSILON * length;
            if let Some(done) = refinement.judge(error, limit) {
                return done;
            }
            self.place_body(body, &first);
        }
    }

    fn body_state(&self, model: &Model, body: &Body) -> State {
        let nodes = &model.nodes[model.node_range(self.fibres.start)];
        let (mut centre, mut velocity) = (Vector3::zeros(), Vector3::zeros());
        for (i, node) in nodes.iter().enumerate() {
            centre += self.position[i] * node.mass;
            velocity += self.velocity[i] * node.mass;
        }
        State {
            centre: centre / body.mass,
            velocity: velocity / body.mass,
            frame: self.orientation[0],
            spin: self.angular_velocity[0],
        }
    }

    /// Puts the nodes where the body has them.
    fn place_body(&mut self, body: &Body, state: &State) {
        for (i, (x, q)) in body.nodes.iter().enumerate() {
            let arm = state.frame * x;
            self.position[i] = state.centre + arm;
            self.velocity[i] = state.velocity + state.spin.cross(&arm);
            self.orientation[i] = state.frame * q;
            self.angular_velocity[i] = state.spin;
        }
    }

    /// Advances by `h`, sub-step k of n, and adds its share of the mean reaction; loads of this sub-step are those in
    /// `load`. The estimated error of a position \[m\]; none where a stage has no answer.
    pub(super) fn rigid_step(
        &mut self,
        action: &Action,
        body: &Body,
        h: f64,
        (k, n): (usize, usize),
    ) -> Option<f64> {
        let moment = |part: f64| (k as f64 + part) / n as f64;
        let share = 1.0 / n as f64;
        let start = self.body_state(action.model, body);
        let momentum = body.inertia_in(&start.frame) * start.spin;
        let (middle_moment, last_moment) = (moment(GAMMA), moment(1.0));
        let gather = |fibre: &Self, moment: f64| {
            let gathered = || fibre.gathered(action, moment);
            body.uniform.then(gathered).flatten()
        };
        let gathered = gather(self, middle_moment);
        let flow = (gathered.as_ref(), middle_moment);
        let middle = self.rigid_stage(action, body, &start, &momentum, h, flow)?;
        self.exchange_body(action, share * (1.0 - GAMMA), flow);
        let (onward, rest) = ((1.0 - GAMMA) / GAMMA, (1.0 - GAMMA) * h);
        let gained = body.inertia_in(&middle.frame) * middle.spin - momentum;
        let base = State {
            centre: start.centre + middle.velocity * rest,
            velocity: start.velocity + (middle.velocity - start.velocity) * onward,
            frame: turned(&start.frame, &(middle.spin * rest)),
            spin: middle.spin,
        };
        let momentum = momentum + gained * onward;
        let gathered = gather(self, last_moment);
        let flow = (gathered.as_ref(), last_moment);
        let end = self.rigid_stage(action, body, &base, &momentum, h, flow)?;
        self.exchange_body(action, share * GAMMA, flow);
        // Against the third-order quadrature of the velocities at 0, γ and 1.
        let [first, second, last] = QUADRATURE;
        let missed =
            |a: Vector3, b: Vector3, c: Vector3| (a * first + b * second + c * last).norm() * h;
        let length = action.model.fibres[self.fibres.start].length;
        let turned = missed(start.spin, middle.spin, end.spin) * 0.5 * length;
        Some(missed(start.velocity, middle.velocity, end.velocity) + turned)
    }

    fn exchange_body(
        &mut self,
        action: &Action,
        share: f64,
        (gathered, moment): (Option<&Gathered>, f64),
    ) {
        match gathered {
            Some(gathered) => self.exchange_gathered(action, gathered, share, moment),
            None => self.exchange(action, share, moment),
        }
    }

    /// Implicit Euler step of γh from `base` with this angular momentum.
    fn rigid_stage(
        &mut self,
        action: &Action,
        body: &Body,
        base: &State,
        momentum: &Vector3,
        h: f64,
        (gathered, moment): (Option<&Gathered>, f64),
    ) -> Option<State> {
        let tau = GAMMA * h;
        let mut state = State {
            centre: base.centre + base.velocity * tau,
            frame: turned(&base.frame, &(base.spin * tau)),
            ..*base
        };
        let length = action.model.fibres[self.fibres.start].length;
        let close = action.flow.map_or(CLOSE_WHEN_FREE, |_| CLOSE);
        for _ in 0..MOST_ITERATIONS {
            self.place_body(body, &state);
            let inertia = body.inertia_in(&state.frame);
            let (mut matrix, mut rhs) = self.rigid_loads(action, &state, gathered, tau, moment);
            let inertial = [
                (state.velocity - base.velocity) * (body.mass / tau),
                (inertia * state.spin - momentum) / tau,
            ];
            for c in 0..3 {
                rhs[c] -= inertial[0][c];
                rhs[3 + c] -= inertial[1][c];
                matrix[(c, c)] += body.mass / (tau * tau);
            }
            let mut turning = matrix.fixed_view_mut::<3, 3>(3, 3);
            // δ(Jω) = J δω + δθ × Jω − J(δθ × ω), δω = (I/τ − ½[ω×]) δθ.
            let w = state.spin.cross_matrix();
            let rate = Matrix3::identity() / tau + w * 0.5;
            turning += (inertia * rate - (inertia * state.spin).cross_matrix()) / tau;
            let change = matrix.lu().solve(&rhs)?;
            if !change.sum().is_finite() {
                return None;
            }
            let (step, turn) = (
                Vector3::from(change.fixed_rows::<3>(0)),
                Vector3::from(change.fixed_rows::<3>(3)),
            );
            state.centre += step;
            state.velocity += step / tau;
            state.frame = turned(&state.frame, &turn);
            state.spin = rotation_between(&base.frame, &state.frame) / tau;
            if step.norm() / length + turn.norm() < close || action.settings.linear {
                self.place_body(body, &state);
                return Some(state);
            }
        }
        None
    }

    /// Force and torque about the centre of given loads and drag, and minus their derivatives by place and rotation.
    fn rigid_loads(
        &self,
        action: &Action,
        state: &State,
        gathered: Option<&Gathered>,
        tau: f64,
        moment: f64,
    ) -> (Matrix6<f64>, Vector6<f64>) {
        let (mut matrix, mut rhs) = (Matrix6::zeros(), Vector6::zeros());
        let mut push = |arm: &Vector3, force: &Vector3, torque: &Vector3| {
            let torque = torque + arm.cross(force);
            for c in 0..3 {
                rhs[c] += force[c];
                rhs[3 + c] += torque[c];
            }
        };
        let range = action.model.node_range(self.fibres.start);
        for (i, n) in range.enumerate() {
            let (node, given, load) = (
                &action.model.nodes[n],
                &action.model.loads[n],
                &self.load[i],
            );
            let arm = self.position[i] - state.centre;
            push(
                &arm,
                &(given.force + node.weight + load.force),
                &(given.torque + load.torque),
            );
        }
        let linear = self.linear_part(action);
        let mut linear_slip = LinearSlip::zero();
        // A = Σ w σ arm, Σ w σ δs by place and by rotation.
        let mut lever_arm = Vector3::zeros();
        let (mut by_place, mut by_rotation) = (Matrix3::zeros(), Matrix3::zeros());
        self.for_body_points(action, gathered, moment, |point: &Point| {
            let (span, arm) = (&point.span, point.position - state.centre);
            let force = point.force();
            let turning = point.spin_tensor() * point.weight;
            let torque = turning * (point.spin - state.spin) + point.strain_torque * point.weight;
            push(&arm, &force, &torque);
            let (by_slip, by_span) = point.derivatives(tau);
            let by_spin = point.torque_by_span(&state.spin) * span.cross_matrix();
            let lever = arm.cross_matrix();
            // δf = −(by_slip/τ)(δx − arm × δθ) − by_span (span × δθ), δ(arm) = −arm × δθ.
            let by_turn = -by_slip * lever + by_span * span.cross_matrix();
            let parts = [
                (0, 0, by_slip),
                (0, 3, by_turn),
                (3, 0, lever * by_slip),
                (
                    3,
                    3,
                    lever * by_turn - force.cross_matrix() * lever + turning / tau + by_spin,
                ),
            ];
            for (row, column, part) in parts {
                let mut view = matrix.fixed_view_mut::<3, 3>(row, column);
                view += part;
            }
            if linear.is_none() {
                return;
            }
            let weight = point.weight * point.arm;
            linear_slip.add(
                weight,
                point.arm,
                &point.slip,
                &point.drag.resistance,
                point.left,
            );
            let rate = point.rate(tau) * weight;
            lever_arm += arm * weight;
            by_place -= rate;
            by_rotation += rate * lever;
        });
        if let Some(linear) = linear {
            let drag = self.linear_drag(action, &linear, &linear_slip);
            let last = self.position.len() - 1;
            let span = self.position[last] - self.position[0];
            let slip = &linear_slip.moment;
            let pull = drag.tensor * slip;
            let arm = lever_arm.cross_matrix();
            let by_rotation = drag.tensor * by_rotation - drag.by_span(slip) * span.cross_matrix();
            let torque = lever_arm.cross(&pull);
            for c in 0..3 {
                rhs[3 + c] += torque[c];
            }
            let mut view = matrix.fixed_view_mut::<3, 3>(3, 0);
            view -= arm * drag.tensor * by_place;
            let mut view = matrix.fixed_view_mut::<3, 3>(3, 3);
            view -= arm * by_rotation + pull.cross_matrix() * arm;
        }
        (matrix, rhs)
    }
}
