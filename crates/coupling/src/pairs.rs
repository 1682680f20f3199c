//! Two Gauss points of a segment as one place in the flow: half as many places to find, sample and push.
//!
//! Points 2k and 2k + 1 lie on both sides of the middle x at x ∓ a. They take u(x) ∓ a·∇u and the gradient of the middle, and
//! give it their forces f₁, f₂ as F = f₁ + f₂ and as a moment a (f₂ − f₁), which nodes get as its exact adjoint:
//!
//! f_i = N_i F + ½ T × ∇N_i + (f₂ − f₁) a·∇N_i,
//!
//! so that force, torque, stresslet and power are those of the two. Where the flow is linear around a segment nothing
//! changes.

use crate::CouplingError;
use nalgebra::Vector3;

/// What is placed in the flow: points by themselves, or the middles of pairs of them.
#[derive(Clone, Copy)]
pub(crate) struct Places<'a> {
    points: &'a [Vector3<f64>],
    paired: bool,
}

impl<'a> Places<'a> {
    /// # Errors
    /// [`CouplingError::Length`] for an odd number of points in pairs.
    pub fn new(points: &'a [Vector3<f64>], paired: bool) -> Result<Self, CouplingError> {
        if paired && !points.len().is_multiple_of(2) {
            return Err(CouplingError::Length {
                what: "points in pairs",
                found: points.len(),
                expected: points.len() + 1,
            });
        }
        Ok(Self { points, paired })
    }

    /// The points themselves.
    pub fn points(&self) -> usize {
        self.points.len()
    }

    pub fn paired(&self) -> bool {
        self.paired
    }

    pub fn len(&self) -> usize {
        self.points.len() / self.sharing()
    }

    /// The point, or the first of the two, of a place.
    pub fn first(&self, k: usize) -> usize {
        k * self.sharing()
    }

    /// Where a place is \[m\].
    #[inline(always)]
    pub fn at(&self, k: usize) -> Vector3<f64> {
        if self.paired {
            0.5 * (self.points[2 * k] + self.points[2 * k + 1])
        } else {
            self.points[k]
        }
    }

    /// From the middle of a pair to its second point \[m\].
    #[inline(always)]
    pub fn arm(&self, k: usize) -> Option<Vector3<f64>> {
        self.paired
            .then(|| 0.5 * (self.points[2 * k + 1] - self.points[2 * k]))
    }

    pub fn split_at(&self, k: usize) -> (Self, Self) {
        let (first, second) = self.points.split_at(self.first(k));
        let of = |points| Self { points, ..*self };
        (of(first), of(second))
    }

    /// Points that share a place.
    fn sharing(&self) -> usize {
        if self.paired { 2 } else { 1 }
    }
}
