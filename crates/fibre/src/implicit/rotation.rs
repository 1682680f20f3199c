//! Finite rotations of frames.

use crate::integrate::half_turn;
use crate::{Quaternion, Vector3};

/// exp(θ) q
#[inline(always)]
pub(super) fn turned(q: &Quaternion, angle: &Vector3) -> Quaternion {
    let square = 0.25 * angle.norm_squared();
    let (cosine, sinc) = half_turn(square);
    let p = angle * (0.5 * sinc);
    let turn = nalgebra::Quaternion::new(cosine, p.x, p.y, p.z);
    let product = turn * q.as_ref();
    // One Newton step for 1/√norm², which is 1 up to round-off.
    let scale = 1.5 - 0.5 * product.norm_squared();
    Quaternion::new_unchecked(product * scale)
}

/// θ of exp(θ) from = to, shorter than π.
pub(super) fn rotation_between(from: &Quaternion, to: &Quaternion) -> Vector3 {
    let turn = to.as_ref() * from.as_ref().conjugate();
    let sine = turn.vector().norm();
    // φ/2 over its sine, by the arc sine's series for small angles.
    let square = sine * sine;
    let ratio = if square < 1e-3 {
        1.0 + square
            * (1.0 / 6.0 + square * (3.0 / 40.0 + square * (5.0 / 112.0 + square * 35.0 / 1152.0)))
    } else {
        sine.atan2(turn.w.abs()) / sine
    };
    turn.vector() * (2.0 * ratio * turn.w.signum())
}
