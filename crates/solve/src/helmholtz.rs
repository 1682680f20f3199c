//! The operator of implicit viscous steps, re-scaled at no cost when the time step changes.

use crate::{LinearOperator, PairMatrix, Value};
use fibreflow_parallel::Halo;

/// (M + c A) x on free rows, x on fixed rows: `mass` is M (diagonal), `coefficient` is c, A the pair matrix.
///
/// For Crank–Nicolson with dual volumes V: M = V, c = ½ α ν Δt, and the right-hand side is V times the explicit part.
#[derive(Clone, Copy, Debug)]
pub struct Helmholtz<'a> {
    /// A, without shift.
    pub matrix: &'a PairMatrix,
    /// Diagonal of M for the owned rows (longer is allowed).
    pub mass: &'a [f64],
    /// c ≥ 0.
    pub coefficient: f64,
}

impl Helmholtz<'_> {
    /// Diagonal of the owned rows, for [`crate::Jacobi::update`].
    pub fn diagonal(&self) -> impl Iterator<Item = f64> {
        let rows = self.matrix.diagonal().iter().zip(self.matrix.fixed());
        rows.zip(self.mass).map(
            |((&d, &fixed), &m)| {
                if fixed { 1.0 } else { m + self.coefficient * d }
            },
        )
    }

    /// Brings Dirichlet values into the right-hand side, see [`PairMatrix::lift`].
    pub fn lift<T: Value>(&self, values: &[T], rhs: &mut [T]) {
        self.matrix.lift_scaled(self.coefficient, values, rhs);
    }
}

impl<T: Value> LinearOperator<T> for Helmholtz<'_> {
    fn halo(&self) -> &Halo {
        self.matrix.halo()
    }

    fn apply(&self, x: &mut [T], y: &mut [T]) {
        let (diagonal, fixed) = (self.matrix.diagonal(), self.matrix.fixed());
        self.matrix.gather(x, y, |i, own, neighbours, _| {
            if fixed[i] {
                own
            } else {
                own.scaled(self.mass[i] + self.coefficient * diagonal[i])
                    .plus(-self.coefficient, neighbours)
            }
        });
    }
}
