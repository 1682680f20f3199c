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

/// The places of pairs of points.
#[derive(Default)]
pub(crate) struct Pairs {
    /// Middles \[m\].
    pub places: Vec<Vector3<f64>>,
    /// From a middle to the second of its points \[m\].
    pub arms: Vec<Vector3<f64>>,
}

impl Pairs {
    /// # Errors
    /// [`CouplingError::Length`] for an odd number of points.
    pub fn join(&mut self, points: &[Vector3<f64>]) -> Result<(), CouplingError> {
        let (pairs, rest) = points.as_chunks::<2>();
        if !rest.is_empty() {
            return Err(CouplingError::Length {
                what: "points in pairs",
                found: points.len(),
                expected: points.len() + 1,
            });
        }
        self.places.clear();
        self.places.extend(pairs.iter().map(|[a, b]| 0.5 * (a + b)));
        self.arms.clear();
        self.arms.extend(pairs.iter().map(|[a, b]| 0.5 * (b - a)));
        Ok(())
    }
}
