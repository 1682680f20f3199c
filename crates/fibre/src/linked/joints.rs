//! Joints: torques that resist bending and twist, and the forces that hold segments together.

use crate::blocktri::{BlockRow, factor_with, inverse};
use crate::linked::fibre::Joint;
use crate::linked::system::{Chain, Segment};
use crate::{Quaternion, Vector3};
use nalgebra::{SMatrix, SVector};

/// Bending and twist of a joint, as vectors of rotation that would undo them \[rad\].
#[derive(Clone, Copy, Debug)]
pub(super) struct Strain {
    /// Turns the segment's axis to where it is without load: across the axis.
    pub bend: Vector3,
    /// Turns it about the joint's direction.
    pub twist: Vector3,
}

impl Strain {
    /// Of the joint between two segments (S 2.25–2.32): bending by the axis without load; twist by the body y axes, seen
    /// along the line of centres.
    pub fn of(before: &Segment, after: &Segment) -> Self {
        let rest: Quaternion = before.frame * after.equilibrium;
        let along = rest * Vector3::x();
        let [first, axis] = [before, after].map(|s| s.frame * Vector3::x());
        let line = (first + axis).normalize();
        let across = |x: Vector3| x - line * line.dot(&x);
        Self {
            bend: angle(&axis, &along),
            twist: angle(
                &across(after.frame * Vector3::y()),
                &across(rest * Vector3::y()),
            ),
        }
    }

    /// Energy of the joint \[J\] (S 2.34).
    pub fn energy(&self, chain: &Chain, after: &Segment) -> f64 {
        let [about_y, about_z] = self.parts(after);
        let bend = chain.bending[0] * about_y.powi(2) + chain.bending[1] * about_z.powi(2);
        0.5 * (bend + chain.twisting * self.twist.norm_squared())
    }

    /// Torque on the second segment \[N·m\], −Y of S 2.33; the first one feels the opposite.
    pub fn torque(&self, chain: &Chain, after: &Segment) -> Vector3 {
        let [y, z] = chain.bending;
        let twist = self.twist * chain.twisting;
        if y == z {
            return self.bend * y + twist;
        }
        // The two parts of S 2.35–2.38, as components of one rotation: alike in all directions where stiffnesses are.
        let [about_y, about_z] = self.parts(after);
        let bend = Vector3::new(0.0, y * about_y, z * about_z);
        after.frame * bend + twist
    }

    fn parts(&self, after: &Segment) -> [f64; 2] {
        let body = after.frame.inverse_transform_vector(&self.bend);
        [body.y, body.z]
    }
}

/// Rotation that takes the direction of `a` to that of `b` by the shorter way.
fn angle(a: &Vector3, b: &Vector3) -> Vector3 {
    let cross = a.cross(b);
    let sine = cross.norm();
    if sine == 0.0 {
        return Vector3::zeros();
    }
    cross * (sine.atan2(a.dot(b)) / sine)
}

/// What the joints of a fibre are solved for in: rows of its own joints, answers, by joint.
#[derive(Clone, Debug, Default)]
pub(super) struct Workspace {
    ball: Vec<(BlockRow<3>, SVector<f64, 3>)>,
    pin: Vec<(BlockRow<4>, SVector<f64, 4>)>,
}

/// Forces in the joints of a chain whose segments move with the free velocities and spins that they hold (S 2.90), and the
/// motion with them.
pub(super) fn hold(chain: &Chain, segments: &mut [Segment], work: &mut Workspace) {
    match chain.joint {
        Joint::Ball => balls(chain, segments, work),
        Joint::Pin => pins(chain, segments, work),
    }
    push(chain, segments);
}

/// Adds what the joint forces and pins do to the motion of the segments.
pub(super) fn push(chain: &Chain, segments: &mut [Segment]) {
    let count = segments.len();
    for i in 0..count {
        let next = segments.get(i + 1).map(|s| (s.joint_force, s.pin_torque));
        let (ahead, turning) = next.unwrap_or_default();
        let s = &mut segments[i];
        let lever = s.axis * chain.half_length;
        let force = ahead - s.joint_force;
        let torque = lever.cross(&(ahead + s.joint_force)) + turning - s.pin_torque;
        s.velocity += chain.mobility.velocity(&s.axis, &force);
        s.spin += chain.mobility.spin(&s.axis, &torque);
    }
}

/// How fast the two sides of the joint after segment `i` part.
#[inline(always)]
fn parting(chain: &Chain, segments: &[Segment], i: usize) -> Vector3 {
    let (a, b) = (&segments[i], &segments[i + 1]);
    let turning = a.spin.cross(&a.axis) + b.spin.cross(&b.axis);
    a.velocity - b.velocity + turning * chain.half_length
}

/// Answers of segment i to forces in the joints at its ends: by the joint's own, and by the other one's.
#[inline(always)]
fn answers(chain: &Chain, axis: &Vector3) -> [SMatrix<f64, 3, 3>; 2] {
    let [along, across] = chain.mobility.force;
    let lever = chain.half_length.powi(2) * chain.mobility.torque[1];
    let dyad = axis * axis.transpose();
    let one = SMatrix::<f64, 3, 3>::identity();
    [
        one * (across + lever) + dyad * (along - across - lever),
        one * (lever - across) + dyad * (across - along - lever),
    ]
}

fn balls(chain: &Chain, segments: &mut [Segment], work: &mut Workspace) {
    work.ball.clear();
    let [mut own, mut other] = answers(chain, &segments[0].axis);
    for i in 0..segments.len() - 1 {
        let [next_own, next_other] = answers(chain, &segments[i + 1].axis);
        let row = BlockRow {
            lower: other,
            diagonal: own + next_own,
            upper: next_other,
        };
        work.ball.push((row, -parting(chain, segments, i)));
        (own, other) = (next_own, next_other);
    }
    solve(&mut work.ball, inverse);
    for (segment, (_, x)) in segments[1..].iter_mut().zip(&work.ball) {
        segment.joint_force = *x;
    }
}

/// Direction about which the pin before a segment does not turn: across the hinge (the body z axis of the segment before)
/// and the segment (S 2.40).
fn locked(before: &Segment, after: &Segment) -> Vector3 {
    let hinge = before.frame * Vector3::z();
    hinge.cross(&after.axis).normalize()
}

fn pins(chain: &Chain, segments: &mut [Segment], work: &mut Workspace) {
    work.pin.clear();
    let (l, mobility) = (chain.half_length, chain.mobility);
    // Torques are measured in units of force times half a segment.
    let swing = |s: &Segment, e: &Vector3| mobility.spin(&s.axis, &(e * l));
    let mut before: Option<Vector3> = None;
    for i in 0..segments.len() - 1 {
        let (a, b) = (&segments[i], &segments[i + 1]);
        let e = locked(a, b);
        let [own_a, other_a] = answers(chain, &a.axis);
        let [own_b, other_b] = answers(chain, &b.axis);
        let (turn_a, turn_b) = (swing(a, &e), swing(b, &e));
        let mut row = BlockRow::<4>::zero();
        row.diagonal
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(own_a + own_b));
        let mixed = (turn_a.cross(&a.axis) - turn_b.cross(&b.axis)) * l;
        row.diagonal.fixed_view_mut::<3, 1>(0, 3).copy_from(&mixed);
        row.diagonal
            .fixed_view_mut::<1, 3>(3, 0)
            .copy_from(&mixed.transpose());
        row.diagonal[(3, 3)] = e.dot(&(turn_a + turn_b)) * l;
        if let Some(earlier) = before {
            let low = beside(a, &other_a, &swing(a, &earlier), &turn_a, &earlier, l);
            row.lower = low;
        }
        if let Some(after) = segments.get(i + 2) {
            let later = locked(b, after);
            let up = beside(b, &other_b, &turn_b, &swing(b, &later), &e, l).transpose();
            row.upper = up;
        }
        // e·(ω_a − ω_b) turns the segment out of the plane at the rate |hinge × axis|; what is second order in a step is taken back after it.
        let rate = e.dot(&(a.spin - b.spin)) * l;
        let right = -parting(chain, segments, i);
        work.pin.push((
            row,
            SVector::<f64, 4>::new(right.x, right.y, right.z, -rate),
        ));
        before = Some(e);
    }
    solve(&mut work.pin, |m| {
        m.try_inverse().unwrap_or_else(SMatrix::zeros)
    });
    let mut earlier = segments[0];
    for (segment, (_, x)) in segments[1..].iter_mut().zip(&work.pin) {
        let e = locked(&earlier, segment);
        segment.joint_force = x.fixed_rows::<3>(0).into_owned();
        segment.pin_torque = e * (x[3] * l);
        earlier = *segment;
    }
}

/// Block of the joint after segment `s` by the unknowns of the joint before it: `turn_before` and `turn_after` are the spins by
/// the two pins' torques, `e_before` the direction of the first.
fn beside(
    s: &Segment,
    other: &SMatrix<f64, 3, 3>,
    turn_before: &Vector3,
    turn_after: &Vector3,
    e_before: &Vector3,
    l: f64,
) -> SMatrix<f64, 4, 4> {
    let mut block = SMatrix::<f64, 4, 4>::zeros();
    block.fixed_view_mut::<3, 3>(0, 0).copy_from(other);
    block
        .fixed_view_mut::<3, 1>(0, 3)
        .copy_from(&(turn_before.cross(&s.axis) * -l));
    block
        .fixed_view_mut::<1, 3>(3, 0)
        .copy_from(&(turn_after.cross(&s.axis) * l).transpose());
    block[(3, 3)] = -e_before.dot(turn_after) * l;
    block
}

/// Solves in place: right-hand sides become answers.
#[inline(always)]
fn solve<const N: usize>(
    rows: &mut [(BlockRow<N>, SVector<f64, N>)],
    inverse: impl Fn(&SMatrix<f64, N, N>) -> SMatrix<f64, N, N>,
) {
    factor_with(rows, |(row, _)| row, inverse);
    let mut above = SVector::<f64, N>::zeros();
    for (row, x) in rows.iter_mut() {
        *x = row.diagonal * (*x - row.lower * above);
        above = *x;
    }
    let mut below = SVector::<f64, N>::zeros();
    for (row, x) in rows.iter_mut().rev() {
        *x -= row.upper * below;
        below = *x;
    }
}
