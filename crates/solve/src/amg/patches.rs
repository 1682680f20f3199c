//! Rows that are smoothed together: a smoother that visits one row at a time hardly moves what a sliver ties.

use super::clusters::LARGEST;
use super::level::SWEEP;
use crate::{PairMatrix, SolveError};
use faer::linalg::solvers::{Llt, Solve};
use faer::{Mat, Side};
use std::collections::HashMap;
use std::ops::Range;

/// What a sweep through a block does next; rows count from the block's first.
#[derive(Clone, Debug)]
pub(super) enum Step {
    /// One row after another.
    Rows(Range<usize>),
    /// Rows together.
    Patch(Patch),
}

/// Rows of a block, and the inverse of their part of the scaled matrix.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    /// In order.
    rows: Vec<u32>,
    /// Row-major.
    inverse: Vec<f32>,
}

/// Where rows are visited that are not visited at their own place.
pub(super) type Places = HashMap<u32, u32>;

/// The steps of every Gauss–Seidel block; rows of a patch are visited at the place of the first. `inverse_roots`: D^(−½).
pub(super) fn steps(
    matrix: &PairMatrix,
    inverse_roots: &[f64],
    tied: &[Vec<u32>],
) -> Result<(Vec<Vec<Step>>, Places), SolveError> {
    let owned = matrix.owned();
    let block = |i: &u32| *i as usize / SWEEP;
    let pieces = tied
        .iter()
        .flat_map(|rows| rows.chunk_by(|i, j| block(i) == block(j)));
    let mut pieces: Vec<&[u32]> = pieces.filter(|rows| rows.len() > 1).collect();
    pieces.sort_unstable_by_key(|rows| rows[0]);
    let mut places = Places::new();
    for rows in &pieces {
        places.extend(rows.iter().map(|&i| (i, rows[0])));
    }
    let mut next = pieces.into_iter().peekable();
    let mut blocks = Vec::new();
    for first in (0..owned).step_by(SWEEP) {
        let end = (first + SWEEP).min(owned);
        let (mut steps, mut start) = (Vec::new(), first);
        for i in first..end {
            if places.contains_key(&(i as u32)) {
                steps.push(Step::Rows(start - first..i - first));
                start = i + 1;
            }
            if let Some(rows) = next.next_if(|rows| rows[0] as usize == i) {
                steps.push(Step::Patch(Patch::new(matrix, inverse_roots, rows, first)?));
            }
        }
        steps.push(Step::Rows(start - first..end - first));
        blocks.push(steps);
    }
    Ok((blocks, places))
}

impl Patch {
    fn new(
        matrix: &PairMatrix,
        inverse_roots: &[f64],
        rows: &[u32],
        first: usize,
    ) -> Result<Self, SolveError> {
        let size = rows.len();
        let mut block = Mat::<f64>::zeros(size, size);
        for (k, &i) in rows.iter().enumerate() {
            let i = i as usize;
            let scale = |j: usize| inverse_roots[i] * inverse_roots[j];
            // As in rows that are visited alone: D may exceed the diagonal.
            block[(k, k)] = 1.0;
            for (j, w) in matrix.row(i) {
                if let Ok(l) = rows.binary_search(&(j as u32)) {
                    block[(k, l)] -= w * scale(j);
                }
            }
        }
        let failed = |_| SolveError::Coarsest { unknowns: size };
        let factor = Llt::new(block.as_ref(), Side::Lower).map_err(failed)?;
        let columns = factor.solve(&Mat::<f64>::identity(size, size));
        let entries = (0..size).flat_map(|k| (0..size).map(move |l| (l, k)));
        Ok(Self {
            rows: rows.iter().map(|&i| i - first as u32).collect(),
            inverse: entries.map(|at| columns[at] as f32).collect(),
        })
    }

    /// x on its rows; `sum` gives right-hand side and couplings to rows outside.
    pub(super) fn solve(&self, x: &mut [f32], mut sum: impl FnMut(usize, &[f32]) -> f32) {
        let size = self.rows.len();
        let mut sums = [0.0; LARGEST];
        for (value, &row) in sums.iter_mut().zip(&self.rows) {
            *value = sum(row as usize, x);
        }
        for (&row, inverse) in self.rows.iter().zip(self.inverse.chunks_exact(size)) {
            let products = inverse.iter().zip(&sums);
            x[row as usize] = products.map(|(a, b)| a * b).sum();
        }
    }
}
