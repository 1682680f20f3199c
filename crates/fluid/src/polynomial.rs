//! An approximate inverse of the pressure operator that is the same on any number of ranks.

use crate::rows;
use fibreflow_mesh::DualGeometry;
use fibreflow_parallel::block_max;
use fibreflow_solve::PairMatrix;

/// Chebyshev polynomial in D⁻¹A for the upper part of its spectrum: short waves. Without sums over nodes and without
/// aggregates it gives the same bits on any number of ranks, which a multigrid cycle does not.
#[derive(Clone, Debug)]
pub(crate) struct Polynomial {
    /// Bound of the spectrum of D⁻¹A.
    upper: f64,
    /// Owned: 1/D, and the residual.
    inverse: Vec<f64>,
    residual: Vec<f64>,
    /// Total: the newest increment; owned: A times it.
    increment: Vec<f64>,
    image: Vec<f64>,
}

impl Polynomial {
    /// Products with A, and the part of the spectrum that is inverted: from upper/REACH on.
    const DEGREE: usize = 4;
    const REACH: f64 = 10.0;

    /// Collective.
    pub fn new(matrix: &PairMatrix, geometry: &DualGeometry) -> Self {
        let (owned, total) = (matrix.owned(), matrix.halo().total());
        let diagonal = matrix.diagonal();
        // Gershgorin: 1 + Σ|w|/d on free rows, 2 when no weight is negative.
        let bound = |i: usize| {
            let weights = geometry.faces[geometry.row(i)].iter().map(|s| s[3].abs());
            if matrix.fixed()[i] {
                1.0
            } else {
                1.0 + weights.sum::<f64>() / diagonal[i]
            }
        };
        let local = block_max(owned, |range| range.map(bound).fold(1.0, f64::max));
        Self {
            upper: matrix.halo().communicator().max(local),
            inverse: diagonal.iter().map(|d| d.recip()).collect(),
            residual: vec![0.0; owned],
            increment: vec![0.0; total],
            image: vec![0.0; owned],
        }
    }

    /// x ≈ A⁻¹ rhs on owned entries, with error 1/T_DEGREE on the part that is inverted. Collective.
    pub fn apply(&mut self, matrix: &PairMatrix, rhs: &[f64], x: &mut [f64]) {
        let lower = self.upper / Self::REACH;
        let (middle, half) = (0.5 * (self.upper + lower), 0.5 * (self.upper - lower));
        let (inverse, residual, increment) =
            (&self.inverse, &mut self.residual, &mut self.increment);
        let owned = residual.len();
        residual.copy_from_slice(rhs);
        rows::each(&mut increment[..owned], |i, d| {
            *d = inverse[i] * rhs[i] / middle;
        });
        x[..owned].copy_from_slice(&increment[..owned]);
        let mut ratio = half / middle;
        for _ in 1..Self::DEGREE {
            matrix.multiply(increment, &mut self.image);
            let next = 1.0 / (2.0 * middle / half - ratio);
            let (keep, add) = (next * ratio, 2.0 * next / half);
            let image = &self.image;
            rows::each_pair(residual, &mut increment[..owned], |i, r, d| {
                *r -= image[i];
                *d = keep * *d + add * inverse[i] * *r;
            });
            ratio = next;
            let increment = &*increment;
            rows::each(&mut x[..owned], |i, x| *x += increment[i]);
        }
    }
}
