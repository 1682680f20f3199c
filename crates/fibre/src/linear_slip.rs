//! Drag of the part of the slip that is linear along a straight fibre.
//!
//! Local slender-body drag gives 0.6 to 0.8 of the resistance of a straight fibre to rotation (Batchelor 1970), because a force that
//! is linear along the fibre disturbs the flow less than a constant one. With σ the length from the middle, w the lengths of the
//! points, s their slips and M = Σ w σ s, I = Σ w σ², the linear part of the slip is σM/I. It gets the force
//!
//! ```text
//! Δf_p = w_p σ_p C M,   C = χ [Δ⊥ (I − ee) + Δ∥ ee]/I,   Δ = (resistance to linear slip) − Σ w σ² ζ/I
//! ```
//!
//! beside the local one: linear in the slip, symmetric, of rank three a fibre, without a net force as Σ w σ = 0. Δ is not
//! below 0; e is the direction from end to end, and χ takes it away from a fibre that is bent: by a smooth step in
//! (end to end)/length.

use crate::hydrodynamics::{Resistance, larger};
use crate::points::abscissa;
use crate::system::Model;
use crate::{Matrix3, Vector3};

/// End-to-end distances by length between which χ rises from 0 to 1.
const BENT: f64 = 0.8;
const STRAIGHT: f64 = 0.95;

/// Sums over the points of a fibre.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinearSlip {
    /// M = Σ w σ s \[m³/s\].
    pub moment: Vector3,
    /// I \[m³\].
    spread: f64,
    /// Σ w σ² ζ.
    local: Resistance,
    /// Σ w σ² of what is left of ζ where the flow gives way.
    left: f64,
}

/// C and what it was made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinearDrag {
    /// C \[N·s/m⁴\].
    pub tensor: Matrix3,
    /// χ Δ/I.
    resistance: Resistance,
    /// From end to end \[m\].
    span: Vector3,
}

impl LinearSlip {
    pub fn zero() -> Self {
        Self {
            moment: Vector3::zeros(),
            spread: 0.0,
            local: Resistance::default(),
            left: 0.0,
        }
    }

    /// Adds a point of local resistance ζ, of which `left` is left: `lever` is w σ, `arm` σ.
    pub fn add(&mut self, lever: f64, arm: f64, slip: &Vector3, local: &Resistance, left: f64) {
        let weight = lever * arm;
        self.moment += slip * lever;
        self.spread += weight;
        self.local.normal += weight * local.normal;
        self.local.axial += weight * local.axial;
        self.left += weight * left;
    }

    /// C for a fibre of this length whose ends are `span` apart.
    pub fn drag(&self, linear: &Resistance, span: &Vector3, length: f64) -> LinearDrag {
        let rise = (span.norm() / length - BENT) / (STRAIGHT - BENT);
        let y = rise.clamp(0.0, 1.0);
        let share = y * y * (3.0 - 2.0 * y) / self.spread;
        let left = self.left / self.spread;
        let excess = |linear: f64, local: f64| {
            let (linear, local) = (left * linear, local / self.spread);
            share * (larger(local, linear).0 - local)
        };
        let resistance = Resistance {
            normal: excess(linear.normal, self.local.normal),
            axial: excess(linear.axial, self.local.axial),
        };
        LinearDrag {
            tensor: resistance.tensor(&span.normalize()),
            resistance,
            span: *span,
        }
    }
}

impl LinearDrag {
    /// Derivative of C M by the span, at constant M.
    pub fn by_span(&self, moment: &Vector3) -> Matrix3 {
        let length = self.span.norm();
        let e = self.span / length;
        let across = (Matrix3::identity() - e * e.transpose()) / length;
        self.resistance.turning(&e, moment) * across
    }
}

/// Calls `visit(segment, point, ξ, w, σ)` for the points of a fibre, both counted from 0.
#[inline(always)]
pub(crate) fn for_arms(
    model: &Model,
    fibre: usize,
    mut visit: impl FnMut(usize, usize, f64, f64, f64),
) {
    let segments = model.segment_range(fibre);
    let first = model.points[segments.start];
    let mut start = -0.5 * model.fibres[fibre].length;
    for (i, s) in segments.enumerate() {
        let range = model.points[s]..model.points[s + 1];
        let (count, length) = (range.len(), model.segments[s].rest_length);
        for (k, p) in range.enumerate() {
            let xi = abscissa(k, count);
            let weight = length / count as f64;
            visit(i, p - first, xi, weight, start + length * xi);
        }
        start += length;
    }
}
