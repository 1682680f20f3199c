//! A fibre's step with bending and twist implicit and its joints held: the linear system of scheme B.
//!
//! Unknowns of a segment are its spin, times half its length, and the force in the joint before it, by 6πμℓ. Velocities are
//! eliminated. In the order of the segments the matrix is block tridiagonal with 6×6 blocks, and quasi-definite, so that blocks
//! need no pivoting among each other.

use super::fibre::Joint;
use super::joints::Strain;
use super::system::{Chain, Of, Segment};
use crate::blocktri::{BlockRow, factor_with};
use crate::{Matrix3, Vector3};
use nalgebra::{SMatrix, SVector};

/// Row of one segment, factored.
pub(super) type Row = BlockRow<6>;
/// Spin times half-length and joint force by 6πμℓ \[m/s\].
pub(super) type Unknown = SVector<f64, 6>;

/// A pin resists what is locked by this times the fluid's resistance to turning within a step.
const LOCK: f64 = 1e2;

/// Torque on the second segment of a joint now \[N·m\], and by how much it falls with the rotation between the two \[N·m\].
fn joint(chain: &Chain, before: &Segment, after: &Segment, step: f64) -> (Vector3, Matrix3) {
    let mut torque = Strain::of(before, after).torque(chain, after);
    let axis = after.frame * Vector3::x();
    let [y, z] = [Vector3::y(), Vector3::z()].map(|e| after.frame * e);
    let dyad = |e: &Vector3, k: f64| e * e.transpose() * k;
    let [about_y, about_z] = chain.bending;
    let mut stiffness = dyad(&axis, chain.twisting) + dyad(&y, about_y) + dyad(&z, about_z);
    if chain.joint == Joint::Pin {
        let hinge = before.frame * Vector3::z();
        let across = hinge.cross(&axis);
        let e = across.normalize();
        let lock = LOCK / (chain.mobility.torque[1] * step);
        // A turn of the second segment by −e takes it out of the plane.
        torque += e * (lock * hinge.dot(&axis).atan2(across.norm()));
        stiffness += dyad(&e, lock);
    }
    (torque, stiffness)
}

/// A segment in a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Work {
    /// Frame at the start of the step; axis and centre in its middle.
    pub segment: Segment,
    pub row: Row,
    /// Velocity without joints \[m/s\], and torque, that of the flow on a segment that does not turn included \[N·m\].
    pub load: [Vector3; 2],
    /// Velocity and spin \[m/s, 1/s\].
    pub moves: [Vector3; 2],
    /// Force in the joint before it \[N\].
    pub joint_force: Vector3,
}

impl Work {
    pub fn new(segment: Segment) -> Self {
        let zero = Vector3::zeros();
        Self {
            segment,
            row: Row::zero(),
            load: [zero; 2],
            moves: [zero; 2],
            joint_force: zero,
        }
    }
}

impl Of for Work {
    fn chain(&self) -> u32 {
        self.segment.chain
    }
}

/// Factors the rows of a chain in a step, and adds the torques of its joints at the start to the loads.
pub(super) fn assemble(chain: &Chain, work: &mut [Work], step: f64) {
    let m = &chain.mobility;
    let scale = 1.0 / (m.stokes * chain.half_length * chain.half_length);
    let answer = |s: &Segment| {
        let [along, across] = m.force.map(|x| x * m.stokes);
        Matrix3::identity() * across + s.axis * s.axis.transpose() * (along - across)
    };
    let resistance = |s: &Segment| {
        let [about, across] = m.torque.map(|x| scale / x);
        Matrix3::identity() * across + s.axis * s.axis.transpose() * (about - across)
    };
    let (mut stiff_before, mut before) = (Matrix3::zeros(), Matrix3::zeros());
    for i in 0..work.len() {
        let s = work[i].segment;
        let (own, lever) = (answer(&s), s.axis.cross_matrix());
        let mut row = Row::zero();
        let mut turning = resistance(&s) + stiff_before;
        if i > 0 {
            set(&mut row.lower, 0, 0, &-stiff_before);
            set(
                &mut row.lower,
                3,
                0,
                &work[i - 1].segment.axis.cross_matrix().transpose(),
            );
            set(&mut row.lower, 3, 3, &-before);
            set(&mut row.diagonal, 0, 3, &-lever);
            set(&mut row.diagonal, 3, 0, &lever.transpose());
            set(&mut row.diagonal, 3, 3, &(before + own));
        } else {
            set(&mut row.diagonal, 3, 3, &Matrix3::identity());
        }
        stiff_before = Matrix3::zeros();
        if let Some(next) = work.get(i + 1) {
            let (torque, stiffness) = joint(chain, &s, &next.segment, step);
            work[i].load[1] -= torque;
            work[i + 1].load[1] += torque;
            stiff_before = stiffness * (step * scale);
            turning += stiff_before;
            set(&mut row.upper, 0, 0, &-stiff_before);
            set(&mut row.upper, 0, 3, &-lever);
            if i > 0 {
                set(&mut row.upper, 3, 3, &-own);
            }
        }
        set(&mut row.diagonal, 0, 0, &turning);
        work[i].row = row;
        before = own;
    }
    factor_with(
        work,
        |work| &mut work.row,
        |m| m.try_inverse().unwrap_or_else(SMatrix::zeros),
    );
}

fn set(block: &mut SMatrix<f64, 6, 6>, row: usize, column: usize, part: &Matrix3) {
    block.fixed_view_mut::<3, 3>(row, column).copy_from(part);
}

/// From velocities without the joints and torques (`motion`) to velocities and spins with the joints; joint forces are in the
/// last three of the `unknowns` then, by 6πμℓ.
pub(super) fn solve(
    chain: &Chain,
    work: &[Work],
    motion: &mut [[Vector3; 2]],
    unknowns: &mut [Unknown],
) {
    let m = &chain.mobility;
    let scale = 1.0 / (m.stokes * chain.half_length);
    let mut above = Unknown::zeros();
    for i in 0..work.len() {
        let [velocity, torque] = motion[i];
        let mut right = Unknown::zeros();
        right.fixed_rows_mut::<3>(0).copy_from(&(torque * scale));
        if i > 0 {
            let parting = motion[i - 1][0] - velocity;
            right.fixed_rows_mut::<3>(3).copy_from(&-parting);
        }
        let row = &work[i].row;
        above = row.diagonal * (right - row.lower * above);
        unknowns[i] = above;
    }
    let (mut below, mut ahead) = (Unknown::zeros(), Vector3::zeros());
    for i in (0..work.len()).rev() {
        let x = unknowns[i] - work[i].row.upper * below;
        (unknowns[i], below) = (x, x);
        let force: Vector3 = x.fixed_rows::<3>(3) * m.stokes;
        let spin: Vector3 = x.fixed_rows::<3>(0) / chain.half_length;
        let held = m.velocity(&work[i].segment.axis, &(ahead - force));
        motion[i] = [motion[i][0] + held, spin];
        ahead = force;
    }
}
