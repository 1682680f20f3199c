//! The last level: small enough for its inverse.

use super::level::reciprocal;
use crate::{PairMatrix, SolveError};
use faer::{
    Mat, Side,
    linalg::solvers::{Llt, Solve},
};

/// Pivot over diagonal entry below which a matrix counts as singular.
const SMALLEST_PIVOT: f64 = 1e-13;

/// Dense inverse of a matrix on one rank, in scaled variables: D^½ A⁻¹ D^½.
#[derive(Clone, Debug)]
pub(super) struct Coarsest {
    /// D^½.
    pub(super) roots: Vec<f64>,
    /// Row-major.
    inverse: Vec<f32>,
    pub(super) rhs: Vec<f32>,
    pub(super) x: Vec<f32>,
}

impl Coarsest {
    /// Factors the matrix. With constants in the null space s·11ᵀ/n is added, which leaves the answer to right-hand
    /// sides of mean zero untouched and gives it mean zero.
    pub(super) fn new(matrix: &PairMatrix, singular: bool) -> Result<Self, SolveError> {
        let size = matrix.owned();
        let mut dense = Mat::<f64>::zeros(size, size);
        for i in 0..size {
            dense[(i, i)] = matrix.diagonal()[i];
            for (j, w) in matrix.row(i) {
                dense[(i, j)] -= w;
            }
        }
        if singular {
            let scale = matrix.diagonal().iter().sum::<f64>() / size as f64;
            let added = scale / size as f64;
            dense.col_iter_mut().for_each(|column| {
                column.iter_mut().for_each(|value| *value += added);
            });
        }
        let failed = SolveError::Coarsest { unknowns: size };
        let factor = Llt::new(dense.as_ref(), Side::Lower).map_err(|_| failed.clone())?;
        let lower = factor.L();
        // A second null vector survives as a pivot of round-off size.
        if (0..size).any(|i| lower[(i, i)] * lower[(i, i)] < SMALLEST_PIVOT * dense[(i, i)]) {
            return Err(failed);
        }
        let columns = factor.solve(&Mat::<f64>::identity(size, size));
        let roots: Vec<f64> = matrix.diagonal().iter().map(|d| d.sqrt()).collect();
        let mut inverse = Vec::with_capacity(size * size);
        for i in 0..size {
            inverse.extend((0..size).map(|j| (roots[i] * columns[(j, i)] * roots[j]) as f32));
        }
        debug_assert!(roots.iter().all(|&r| reciprocal(r) > 0.0));
        Ok(Self {
            roots,
            inverse,
            rhs: vec![0.0; size],
            x: vec![0.0; size],
        })
    }

    /// `x` from `rhs`.
    pub(super) fn solve(&mut self) {
        let size = self.rhs.len();
        for (i, x) in self.x.iter_mut().enumerate() {
            *x = dot(&self.inverse[i * size..(i + 1) * size], &self.rhs);
        }
    }
}

/// a·b in eight lanes.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let (a_lanes, a_rest) = a.as_chunks::<8>();
    let (b_lanes, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0f32; 8];
    for (x, y) in a_lanes.iter().zip(b_lanes) {
        for k in 0..8 {
            sums[k] = x[k].mul_add(y[k], sums[k]);
        }
    }
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    sums.iter().sum::<f32>() + rest
}
