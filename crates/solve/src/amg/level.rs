//! One level in single precision: its matrix, its smoother, its transfer to the next one.
//!
//! The matrix is scaled to D^(−½) A D^(−½) = I − W, so that its entries stay near one whatever the cells' shapes, and a
//! row needs no diagonal. The smoother is Gauss–Seidel inside fixed blocks of rows, Jacobi between them: forwards
//! before the coarse correction, backwards after it, which keeps the cycle symmetric. Started from zero, the forward
//! sweep reads the lower couplings only, and the residual it leaves is the sum of the others: together one pass. Rows of a
//! patch are visited together, at the place of the first, and leave no residual to each other.

use super::patches::{Step, steps};
use super::transfer::Rows;
use crate::{PairMatrix, SolveError};
use fibreflow_parallel::Halo;
use rayon::prelude::*;

/// Rows of a Gauss–Seidel block; a constant of the program, never of the machine.
pub(super) const SWEEP: usize = 1 << 14;

/// A coupling.
#[derive(Clone, Copy, Debug)]
struct Entry {
    column: u32,
    weight: f32,
}

/// Where a row's couplings are: those to rows before it in its block, then others, then those to later rows.
#[derive(Clone, Copy, Debug)]
struct Span {
    start: u32,
    middle: u32,
    upper: u32,
}

/// Compressed rows in single precision.
#[derive(Clone, Debug)]
pub(super) struct Compact {
    offsets: Vec<u32>,
    entries: Vec<Entry>,
}

impl Compact {
    /// left_i · value · right_j, for the first `rows` rows.
    pub(super) fn scaled(rows: usize, from: &Rows, left: &[f64], right: &[f64]) -> Self {
        let entry = |i: usize, &(j, value): &(u32, f64)| Entry {
            column: j,
            weight: (left[i] * value * right[j as usize]) as f32,
        };
        Self {
            offsets: from.offsets[..=rows].to_vec(),
            entries: (0..rows)
                .flat_map(|i| from.row(i).iter().map(move |e| entry(i, e)))
                .collect(),
        }
    }

    #[inline(always)]
    pub(super) fn product(&self, i: usize, x: &[f32]) -> f32 {
        let entries = &self.entries[self.offsets[i] as usize..self.offsets[i + 1] as usize];
        sum(entries, x, 0)
    }
}

/// Σ w x over entries whose columns count from `first`.
#[inline(always)]
fn sum(entries: &[Entry], x: &[f32], first: usize) -> f32 {
    let terms = entries.iter();
    terms.fold(0.0, |s, e| {
        e.weight.mul_add(x[e.column as usize - first], s)
    })
}

/// A level with its work fields; right-hand side and answer are in scaled variables, D^(−½) b and D^½ x.
#[derive(Clone, Debug)]
pub(super) struct Level {
    pub(super) halo: Halo,
    /// Length owned + 1; the last holds the end.
    spans: Vec<Span>,
    entries: Vec<Entry>,
    /// One a Gauss–Seidel block.
    steps: Vec<Vec<Step>>,
    /// Scaled P on owned rows, and Pᵀ on owned rows of the next level.
    prolongation: Compact,
    pub(super) restriction: Compact,
    /// Exchange of the next level, and its answer with halo entries; unused on one rank.
    coarse_halo: Halo,
    correction: Vec<f32>,
    rhs: Vec<f32>,
    /// Answer, total; the two change places.
    pub(super) x: Vec<f32>,
    next: Vec<f32>,
    /// b − A x, total.
    pub(super) residual: Vec<f32>,
}

/// D^½ of owned and halo rows. D is the diagonal; where negative couplings make those that leave a block larger than
/// that, D is their sum: the smoother needs no more to be convergent. Collective.
pub(super) fn roots(matrix: &PairMatrix) -> Vec<f64> {
    let owned = matrix.owned();
    let root = |i: usize| {
        let inside = block_of(i, owned);
        let outer = matrix.row(i).filter(|(j, _)| !inside.contains(j));
        let outer: f64 = outer.map(|(_, w)| w.abs()).sum();
        matrix.diagonal()[i].max(outer).sqrt()
    };
    let mut roots: Vec<f64> = (0..owned).map(root).collect();
    roots.resize(matrix.halo().total(), 0.0);
    matrix.halo().update(&mut roots);
    roots
}

/// 1/x, zero for zero: a row of zeros is left alone.
pub(super) fn reciprocal(x: f64) -> f64 {
    if x > 0.0 { x.recip() } else { 0.0 }
}

fn block_of(i: usize, owned: usize) -> std::ops::Range<usize> {
    let start = i / SWEEP * SWEEP;
    start..(start + SWEEP).min(owned)
}

impl Level {
    /// `roots`: D^½ of local rows here and on the next level. `tied`: rows that are smoothed together where they lie in
    /// the same block.
    ///
    /// # Errors
    /// [`SolveError::Coarsest`] when tied rows are not positive definite.
    pub(super) fn new(
        matrix: &PairMatrix,
        tied: &[Vec<u32>],
        roots: &[f64],
        prolongation: &Rows,
        restriction: &Rows,
        coarse_roots: &[f64],
        coarse_halo: Halo,
    ) -> Result<Self, SolveError> {
        let (owned, total) = (matrix.owned(), matrix.halo().total());
        let inverse: Vec<f64> = roots.iter().map(|&r| reciprocal(r)).collect();
        let coarse: Vec<f64> = coarse_roots.iter().map(|&r| reciprocal(r)).collect();
        let (steps, places) = steps(matrix, &inverse, tied)?;
        let place = |j: usize| places.get(&(j as u32)).map_or(j, |&p| p as usize);
        let mut level = Self {
            steps,
            halo: matrix.halo().clone(),
            spans: Vec::with_capacity(owned + 1),
            entries: Vec::with_capacity(matrix.entries_stored()),
            prolongation: Compact::scaled(owned, prolongation, roots, &coarse),
            restriction: Compact::scaled(restriction.len(), restriction, &coarse, roots),
            correction: vec![0.0; coarse_halo.total()],
            coarse_halo,
            rhs: vec![0.0; owned],
            x: vec![0.0; total],
            next: vec![0.0; total],
            residual: vec![0.0; total],
        };
        for i in 0..owned {
            let block = block_of(i, owned);
            let start = level.entries.len() as u32;
            let mut ends = [start; 3];
            let parts: [&dyn Fn(usize) -> bool; 3] = [
                &|j| block.contains(&j) && place(j) < place(i),
                &|j| !block.contains(&j),
                &|j| block.contains(&j) && place(j) > place(i),
            ];
            for (part, end) in parts.iter().zip(&mut ends) {
                let row = matrix.row(i).filter(|&(j, _)| part(j));
                level.entries.extend(row.map(|(j, w)| Entry {
                    column: j as u32,
                    weight: (w * inverse[i] * inverse[j]) as f32,
                }));
                *end = level.entries.len() as u32;
            }
            level.spans.push(Span {
                start,
                middle: ends[0],
                upper: ends[1],
            });
        }
        let end = level.entries.len() as u32;
        level.spans.push(Span {
            start: end,
            middle: end,
            upper: end,
        });
        Ok(level)
    }

    /// Smooths from zero; the residual stays for the restriction. `b(i)` gives the right-hand side. Collective.
    pub(super) fn descend(&mut self, b: impl Fn(usize) -> f32 + Sync) {
        let (spans, entries) = (&self.spans, &self.entries);
        let x = &mut self.x[..self.rhs.len()];
        x.par_chunks_mut(SWEEP)
            .zip(self.rhs.par_chunks_mut(SWEEP))
            .zip(&self.steps)
            .enumerate()
            .for_each(|(block, ((x, rhs), steps))| {
                let first = block * SWEEP;
                let spans = &spans[first..];
                let row = |k: usize, x: &[f32], rhs: &mut [f32]| {
                    let span = spans[k];
                    let lower = &entries[span.start as usize..span.middle as usize];
                    rhs[k] = b(first + k);
                    rhs[k] + sum(lower, x, first)
                };
                for step in steps {
                    match step {
                        Step::Rows(rows) => rows.clone().for_each(|k| x[k] = row(k, x, rhs)),
                        Step::Patch(patch) => patch.solve(x, |k, x| row(k, x, rhs)),
                    }
                }
            });
        self.halo.update(&mut self.x);
        let x = &self.x;
        self.residual[..self.rhs.len()]
            .par_chunks_mut(SWEEP)
            .enumerate()
            .for_each(|(block, residual)| {
                let spans = spans[block * SWEEP..].windows(2);
                for (residual, span) in residual.iter_mut().zip(spans) {
                    let rest = &entries[span[0].middle as usize..span[1].start as usize];
                    *residual = sum(rest, x, 0);
                }
            });
        self.halo.update(&mut self.residual);
    }

    /// Adds the correction of the next level and smooths; the answer is left in `x`, its halo entries stale.
    /// Collective.
    pub(super) fn ascend(&mut self, coarse: &[f32]) {
        let owned = self.rhs.len();
        let prolongation = &self.prolongation;
        let coarse = if self.coarse_halo.communicator().size() == 1 {
            coarse
        } else {
            self.correction[..coarse.len()].copy_from_slice(coarse);
            self.coarse_halo.update(&mut self.correction);
            &self.correction
        };
        self.x[..owned]
            .par_chunks_mut(SWEEP)
            .enumerate()
            .for_each(|(block, x)| {
                for (i, x) in (block * SWEEP..).zip(x) {
                    *x += prolongation.product(i, coarse);
                }
            });
        self.halo.update(&mut self.x);
        let (spans, entries, x, rhs) = (&self.spans, &self.entries, &self.x, &self.rhs);
        self.next[..owned]
            .par_chunks_mut(SWEEP)
            .zip(&self.steps)
            .enumerate()
            .for_each(|(block, (next, steps))| {
                let first = block * SWEEP;
                let (spans, rhs) = (&spans[first..], &rhs[first..]);
                let row = |k: usize, next: &[f32]| {
                    let span = spans[k];
                    let old = &entries[span.start as usize..span.upper as usize];
                    let new = &entries[span.upper as usize..spans[k + 1].start as usize];
                    rhs[k] + sum(old, x, 0) + sum(new, next, first)
                };
                for step in steps.iter().rev() {
                    match step {
                        Step::Rows(rows) => rows.clone().rev().for_each(|k| next[k] = row(k, next)),
                        Step::Patch(patch) => patch.solve(next, row),
                    }
                }
            });
        std::mem::swap(&mut self.x, &mut self.next);
    }
}
