//! Direct solution of block-tridiagonal systems with small blocks (Thomas), one a fibre, in O(N).

use crate::Matrix3;
use nalgebra::SMatrix;

/// One block row; [`factor_with`] replaces `diagonal` by the inverse pivot and `upper` by inverse pivot × upper.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BlockRow<const N: usize = 3> {
    pub lower: SMatrix<f64, N, N>,
    pub diagonal: SMatrix<f64, N, N>,
    pub upper: SMatrix<f64, N, N>,
}

impl<const N: usize> BlockRow<N> {
    pub fn zero() -> Self {
        Self {
            lower: SMatrix::zeros(),
            diagonal: SMatrix::zeros(),
            upper: SMatrix::zeros(),
        }
    }
}

/// Inverse by cofactors: the blocks are well-conditioned (mass plus a drag tensor of ratio 2).
#[inline(always)]
pub(crate) fn inverse(m: &Matrix3) -> Matrix3 {
    let (a, b, c) = (m.column(0), m.column(1), m.column(2));
    let (bc, ca, ab) = (b.cross(&c), c.cross(&a), a.cross(&b));
    let scale = 1.0 / a.dot(&bc);
    Matrix3::new(
        bc.x, bc.y, bc.z, //
        ca.x, ca.y, ca.z, //
        ab.x, ab.y, ab.z,
    ) * scale
}

/// Factors in place the rows that `row` finds in `entries`, given a way to invert a block. Without pivoting: the matrix must
/// be block-dominant or positive definite. The answer of A x = b is then, from the first row down,
/// y = diagonal (b − lower y_above), and from the last row up, x = y − upper x_below.
#[inline(always)]
pub(crate) fn factor_with<T, const N: usize>(
    entries: &mut [T],
    row: impl Fn(&mut T) -> &mut BlockRow<N>,
    inverse: impl Fn(&SMatrix<f64, N, N>) -> SMatrix<f64, N, N>,
) {
    let mut above = SMatrix::zeros();
    for entry in entries {
        let row = row(entry);
        row.diagonal = inverse(&(row.diagonal - row.lower * above));
        row.upper = row.diagonal * row.upper;
        above = row.upper;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vector3;
    use rand::{Rng, SeedableRng};

    #[test]
    fn the_answer_satisfies_the_system() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut block = || Matrix3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        for n in [1, 2, 7] {
            let rows: Vec<BlockRow> = (0..n)
                .map(|_| BlockRow {
                    lower: block(),
                    diagonal: block() + Matrix3::identity() * 8.0,
                    upper: block(),
                })
                .collect();
            let rhs: Vec<Vector3> = (0..n).map(|_| block().column(0).into()).collect();
            let mut x = rhs.clone();
            let mut factored = rows.clone();
            factor_with(&mut factored, |row| row, inverse);
            let mut above = Vector3::zeros();
            for (x, row) in x.iter_mut().zip(&factored) {
                *x = row.diagonal * (*x - row.lower * above);
                above = *x;
            }
            for i in (0..n - 1).rev() {
                x[i] = x[i] - factored[i].upper * x[i + 1];
            }
            for i in 0..n {
                let mut left = rows[i].diagonal * x[i];
                if i > 0 {
                    left += rows[i].lower * x[i - 1];
                }
                if i + 1 < n {
                    left += rows[i].upper * x[i + 1];
                }
                assert!((left - rhs[i]).norm() < 1e-14);
            }
        }
    }
}
