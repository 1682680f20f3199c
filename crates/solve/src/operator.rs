//! What conjugate gradients asks of an operator and of a preconditioner.

use crate::{PairMatrix, Value, vectors::BLOCK};
use fibreflow_parallel::Halo;
use rayon::prelude::*;

/// A symmetric linear operator on node fields.
pub trait LinearOperator<T: Value> {
    /// Exchange of the fields it acts on.
    fn halo(&self) -> &Halo;

    /// y = A x on owned rows. `x` has total length and its halo entries are brought up to date; of `y` (owned length
    /// or longer) the owned entries are written. Collective.
    fn apply(&self, x: &mut [T], y: &mut [T]);
}

/// An approximate inverse, symmetric and positive definite.
pub trait Preconditioner<T: Value> {
    /// z ≈ A⁻¹ r on owned entries; both slices have owned length. Collective.
    fn apply(&mut self, r: &[T], z: &mut [T]);

    /// Norm of the residuals that come next, over all ranks: what works in single precision divides by it.
    fn normalise(&mut self, _norm: f64) {}

    /// Adds to the initial guess `x` what the preconditioner needs to start from, given its residual `r`; true when `x`
    /// was changed. Collective.
    fn improve(&mut self, _r: &[T], _x: &mut [T]) -> bool {
        false
    }

    /// True when the map r → z is not linear, so that conjugate gradients must use its flexible form.
    fn is_variable(&self) -> bool {
        false
    }
}

/// Division by the diagonal.
#[derive(Clone, Debug)]
pub struct Jacobi {
    inverse: Vec<f64>,
}

impl Jacobi {
    /// From a matrix.
    pub fn new(matrix: &PairMatrix) -> Self {
        Self::from_diagonal(matrix.diagonal().iter().copied())
    }

    /// From the diagonal entries of the owned rows.
    pub fn from_diagonal(diagonal: impl Iterator<Item = f64>) -> Self {
        Self {
            inverse: diagonal.map(f64::recip).collect(),
        }
    }

    /// Takes a new diagonal of the same length, without allocating.
    pub fn update(&mut self, diagonal: impl Iterator<Item = f64>) {
        self.inverse
            .iter_mut()
            .zip(diagonal)
            .for_each(|(inverse, d)| *inverse = d.recip());
    }
}

impl<T: Value> Preconditioner<T> for Jacobi {
    fn apply(&mut self, r: &[T], z: &mut [T]) {
        z.par_chunks_mut(BLOCK)
            .zip(r.par_chunks(BLOCK))
            .zip(self.inverse.par_chunks(BLOCK))
            .for_each(|((z, r), inverse)| {
                for ((z, r), &f) in z.iter_mut().zip(r).zip(inverse) {
                    *z = r.scaled(f);
                }
            });
    }
}
