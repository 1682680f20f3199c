//! An approximate inverse of the pressure operator that is the same on any number of ranks.

use crate::operators::Operators;
use crate::rows::{self, largest};
use fibreflow_mesh::LocalMesh;

/// Chebyshev polynomial in D⁻¹A for the upper part of its spectrum: short waves. Without sums over nodes and without
/// aggregates it gives the same bits on any number of ranks, which a multigrid cycle does not.
///
/// x_(k+1) = x_k + ρ_(k+1) ρ_k (x_k − x_(k−1)) + (2 ρ_(k+1)/δ) D⁻¹(b − A x_k), one pass each; δ is half the width of the
/// part of the spectrum that is inverted (Saad 2003, algorithm 12.1).
#[derive(Clone, Debug)]
pub(crate) struct Polynomial {
    middle: f64,
    half: f64,
    /// Owned: 1/D, zero where the pressure is given.
    inverse: Vec<f64>,
    /// Owned: b.
    pub rhs: Vec<f64>,
    /// Total: x_k and x_(k−1).
    pub x: Vec<f64>,
    before: Vec<f64>,
}

impl Polynomial {
    /// Products with A plus one, and the part of the spectrum that is inverted: from its upper end over REACH on.
    const DEGREE: usize = 4;
    const REACH: f64 = 10.0;

    /// `fixed` marks nodes of given pressure. Collective.
    pub fn new(mesh: &LocalMesh, operators: &Operators, fixed: &[bool]) -> Self {
        let diagonal = operators.weight_sums(|w| w);
        let sizes = operators.weight_sums(f64::abs);
        // Gershgorin: 1 + Σ|w|/d on free rows, 2 when no weight is negative.
        let bounds = diagonal.iter().zip(&sizes).zip(fixed);
        let bound = bounds.map(|((d, size), &fixed)| if fixed { 1.0 } else { 1.0 + size / d });
        let upper = mesh.halo.communicator().max(bound.fold(1.0, largest));
        let lower = upper / Self::REACH;
        let rows = diagonal.iter().zip(fixed);
        Self {
            middle: 0.5 * (upper + lower),
            half: 0.5 * (upper - lower),
            inverse: rows
                .map(|(d, &fixed)| if fixed { 0.0 } else { d.recip() })
                .collect(),
            rhs: vec![0.0; mesh.owned()],
            x: vec![0.0; mesh.total()],
            before: vec![0.0; mesh.total()],
        }
    }

    /// x ≈ A⁻¹ b on owned entries, with error 1/T_DEGREE on the part that is inverted. Collective.
    pub fn apply(&mut self, operators: &Operators) {
        let Self {
            middle,
            half,
            inverse,
            rhs,
            x,
            before,
        } = self;
        let owned = rhs.len();
        let first = middle.recip();
        rows::each(&mut x[..owned], |i, x| *x = first * inverse[i] * rhs[i]);
        let mut ratio = *half / *middle;
        for k in 1..Self::DEGREE {
            let next = 1.0 / (2.0 * *middle / *half - ratio);
            let (keep, add) = (next * ratio, 2.0 * next / *half);
            // Before the first x there is none.
            let kept = if k == 1 { 0.0 } else { keep };
            let step = |own: f64, laplacian: f64, [inverse, rhs]: [f64; 2], old: f64| {
                own + keep * own - kept * old + add * inverse * (rhs + laplacian)
            };
            operators.laplacian(x, [inverse, rhs], &mut before[..owned], step);
            std::mem::swap(x, before);
            ratio = next;
        }
    }
}
