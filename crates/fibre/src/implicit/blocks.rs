//! Direct solution of block-tridiagonal systems with 6×6 blocks (three of position, three of rotation a node) in O(N).

use crate::Matrix3;
use crate::beam::SegmentStiffness;
use nalgebra::{Matrix6, Vector6};

/// One block row; [`factor`] replaces `diagonal` by the inverse pivot and `upper` by inverse pivot × upper.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub lower: Matrix6<f64>,
    pub diagonal: Matrix6<f64>,
    pub upper: Matrix6<f64>,
}

impl Row {
    pub const ZERO: Self = Self {
        lower: Matrix6::from_array_storage(nalgebra::ArrayStorage([[0.0; 6]; 6])),
        diagonal: Matrix6::from_array_storage(nalgebra::ArrayStorage([[0.0; 6]; 6])),
        upper: Matrix6::from_array_storage(nalgebra::ArrayStorage([[0.0; 6]; 6])),
    };
}

/// Inverse in place by Gauss–Jordan without pivoting; the pivots are those of a nearly symmetric, positive matrix.
fn invert(m: &mut Matrix6<f64>) {
    for k in 0..6 {
        let pivot = 1.0 / m[(k, k)];
        m[(k, k)] = 1.0;
        for j in 0..6 {
            m[(k, j)] *= pivot;
        }
        for i in 0..6 {
            if i != k {
                let factor = m[(i, k)];
                m[(i, k)] = 0.0;
                for j in 0..6 {
                    m[(i, j)] -= factor * m[(k, j)];
                }
            }
        }
    }
}

/// Factors in place.
pub(super) fn factor(rows: &mut [Row]) {
    let mut above = Matrix6::zeros();
    for row in rows {
        row.diagonal -= row.lower * above;
        invert(&mut row.diagonal);
        row.upper = row.diagonal * row.upper;
        above = row.upper;
    }
}

/// Replaces the right-hand side by the answer.
pub(super) fn solve(rows: &[Row], x: &mut [Vector6<f64>]) {
    let mut above = Vector6::zeros();
    for (row, x) in rows.iter().zip(x.iter_mut()) {
        *x = row.diagonal * (*x - row.lower * above);
        above = *x;
    }
    let mut below = Vector6::zeros();
    for (row, x) in rows.iter().zip(x.iter_mut()).rev() {
        *x -= row.upper * below;
        below = *x;
    }
}

pub(super) fn add(block: &mut Matrix6<f64>, row: usize, column: usize, part: &Matrix3) {
    let mut view = block.fixed_view_mut::<3, 3>(row, column);
    view += part;
}

/// Adds a segment's tangent to the rows of its two nodes.
pub(super) fn add_stiffness(rows: &mut [Row], k: &SegmentStiffness, factor: f64) {
    let (dd, da, db) = (k.dd * factor, k.da * factor, k.db * factor);
    let (ad, bd) = (da.transpose(), db.transpose());
    let (aa, ab, bb) = (k.aa * factor, k.ab * factor, k.bb * factor);
    let [first, second] = rows else { return };
    for (block, parts) in [
        (&mut first.diagonal, [dd, -da, -ad, aa]),
        (&mut first.upper, [-dd, -db, ad, ab]),
        (&mut second.lower, [-dd, da, -bd, ab.transpose()]),
        (&mut second.diagonal, [dd, db, bd, bb]),
    ] {
        add(block, 0, 0, &parts[0]);
        add(block, 0, 3, &parts[1]);
        add(block, 3, 0, &parts[2]);
        add(block, 3, 3, &parts[3]);
    }
}

/// Leaves out the small part that is not symmetric: of drag, of gyroscopic terms, and of rotations out of equilibrium.
pub(super) fn symmetrise(rows: &mut [Row]) {
    for i in 0..rows.len() {
        let diagonal = rows[i].diagonal;
        rows[i].diagonal = (diagonal + diagonal.transpose()) * 0.5;
        if i + 1 < rows.len() {
            let upper = (rows[i].upper + rows[i + 1].lower.transpose()) * 0.5;
            rows[i].upper = upper;
            rows[i + 1].lower = upper.transpose();
        }
    }
}

/// Keeps three unknowns of a node as they are.
pub(super) fn hold(row: &mut Row, rhs: &mut Vector6<f64>, first: usize) {
    rhs.fixed_rows_mut::<3>(first).fill(0.0);
    for block in [&mut row.lower, &mut row.diagonal, &mut row.upper] {
        block.fixed_rows_mut::<3>(first).fill(0.0);
    }
    let mut diagonal = row.diagonal.fixed_view_mut::<3, 3>(first, first);
    diagonal.fill_with_identity();
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    #[test]
    fn the_answer_satisfies_the_system() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut number = || rng.random_range(-1.0..1.0);
        for n in [1, 2, 7] {
            let rows: Vec<Row> = (0..n)
                .map(|_| Row {
                    lower: Matrix6::from_fn(|_, _| number()),
                    diagonal: Matrix6::from_fn(|_, _| number()) + Matrix6::identity() * 16.0,
                    upper: Matrix6::from_fn(|_, _| number()),
                })
                .collect();
            let rhs: Vec<Vector6<f64>> =
                (0..n).map(|_| Vector6::from_fn(|_, _| number())).collect();
            let (mut factored, mut x) = (rows.clone(), rhs.clone());
            factor(&mut factored);
            solve(&factored, &mut x);
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
