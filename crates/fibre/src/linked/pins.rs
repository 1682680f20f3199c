//! Pins are put back into their planes after a step.

use super::fibre::Joint;
use super::system::{Chain, Segment};
use crate::{Quaternion, Vector3};

/// Rounds after which the planes are taken as they are; each leaves the square of what there was.
const ROUNDS: usize = 4;
/// Distance from a plane, as the sine of an angle, that is round-off.
const NONE: f64 = 1e-14;

/// Turns the segments so that each pin lies in its plane, z·x = 0 for the body z axis of the segment before and the axis of that after: by
/// torques of the pins alone, which are opposite on its two segments (Newton's method; of a fibre, one tridiagonal system).
pub(super) fn fit(chain: &Chain, segments: &mut [Segment]) {
    if chain.joint == Joint::Ball {
        return;
    }
    let joints = segments.len() - 1;
    for _ in 0..ROUNDS {
        let locked = |j: usize| -> (f64, Vector3) {
            let hinge = segments[j].frame * Vector3::z();
            let axis = segments[j + 1].frame * Vector3::x();
            (hinge.dot(&axis), hinge.cross(&axis))
        };
        if (0..joints).all(|j| locked(j).0.abs() <= NONE) {
            return;
        }
        // Turned by its own mobility, which scales out: by torques e_j λ_j of the joint after it, −e_j λ_j of that before.
        let turn = |s: usize, torque: &Vector3| {
            let axis = segments[s].frame * Vector3::x();
            chain.mobility.spin(&axis, torque) / chain.mobility.torque[1]
        };
        let mut rows: Vec<[f64; 2]> = Vec::with_capacity(joints);
        let mut before: Option<(Vector3, [f64; 2])> = None;
        for j in 0..joints {
            let (strayed, e) = locked(j);
            let mut own = e.dot(&(turn(j, &e) + turn(j + 1, &e)));
            let mut right = -strayed;
            if let Some((e_before, [above, x])) = &before {
                let beside = -e.dot(&turn(j, e_before));
                own -= beside * beside * above;
                right -= beside * x;
            }
            // Inverse pivot, and its answer so far: y_j / pivot.
            let row = [1.0 / own, right / own];
            rows.push(row);
            before = Some((e, row));
        }
        let mut turns = vec![Vector3::zeros(); joints + 1];
        let mut below = 0.0;
        for j in (0..joints).rev() {
            let (_, e) = locked(j);
            let mut x = rows[j][1];
            if j + 1 < joints {
                let (_, after) = locked(j + 1);
                x += rows[j][0] * after.dot(&turn(j + 1, &e)) * below;
            }
            turns[j] += turn(j, &(e * x));
            turns[j + 1] -= turn(j + 1, &(e * x));
            below = x;
        }
        for (s, turned) in segments.iter_mut().zip(&turns) {
            let moved = Quaternion::new(*turned) * s.frame;
            s.frame = Quaternion::new_normalize(moved.into_inner());
        }
    }
}
