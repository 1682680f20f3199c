//! One level: its matrix, its Chebyshev smoother, its transfer to the next one.

use super::aggregate::{NONE, members};
use crate::vectors::{BLOCK, Partials, dot};
use crate::{PairMatrix, SolveError};
use fibreflow_parallel::Halo;
use rayon::prelude::*;

/// Steps of the power iteration for the upper end of the spectrum, and what its answer is multiplied by.
const POWER_STEPS: usize = 12;
const SAFETY: f64 = 1.1;

/// A level with its work fields.
#[derive(Clone, Debug)]
pub(super) struct Level {
    pub(super) matrix: PairMatrix,
    /// 1/d.
    inverse: Vec<f64>,
    /// Upper end of the spectrum of D⁻¹A.
    largest: f64,
    /// Aggregate of every owned row.
    aggregates: Vec<u32>,
    /// Owned rows of every aggregate, compressed.
    starts: Vec<u32>,
    members: Vec<u32>,
    /// Right-hand side, owned.
    pub(super) rhs: Vec<f64>,
    /// Answer, total.
    pub(super) x: Vec<f64>,
    /// Answer of the smoothing step before, total; the two change places.
    previous: Vec<f64>,
    /// b − A x, owned.
    residual: Vec<f64>,
    /// First direction of the inner iteration and its image, owned.
    direction: Vec<f64>,
    image: Vec<f64>,
    partials: Partials<5>,
}

impl Level {
    pub(super) fn new(matrix: PairMatrix, aggregates: Vec<u32>, count: usize) -> Self {
        let (owned, total) = (matrix.owned(), matrix.halo().total());
        // A row of zeros is left alone.
        let inverse = |&d: &f64| if d > 0.0 { d.recip() } else { 0.0 };
        let (starts, members) = members(&aggregates, count);
        let inverse: Vec<f64> = matrix.diagonal().iter().map(inverse).collect();
        Self {
            largest: largest_eigenvalue(&matrix, &inverse),
            inverse,
            aggregates,
            starts,
            members,
            rhs: vec![0.0; owned],
            x: vec![0.0; total],
            previous: vec![0.0; total],
            residual: vec![0.0; owned],
            direction: vec![0.0; owned],
            image: vec![0.0; owned],
            partials: Partials::default(),
            matrix,
        }
    }

    /// Chebyshev smoothing of A x = b over the upper part of the spectrum, λ_max/`reach` and above.
    ///
    /// Three-term form: x⁺ = x + a (x − x⁻) + c D⁻¹(b − A x), one pass over the rows a step.
    pub(super) fn smooth(&mut self, degree: usize, reach: f64, from_zero: bool) {
        let (low, high) = (self.largest / reach, self.largest);
        let (centre, half) = (0.5 * (high + low), 0.5 * (high - low));
        let sigma = centre / half;
        let mut rho = sigma.recip();
        if from_zero {
            let (x, rhs) = (&mut self.x[..self.rhs.len()], &self.rhs);
            x.par_chunks_mut(BLOCK)
                .zip(rhs.par_chunks(BLOCK))
                .zip(self.inverse.par_chunks(BLOCK))
                .for_each(|((x, b), inverse)| {
                    for ((x, b), f) in x.iter_mut().zip(b).zip(inverse) {
                        *x = b * f / centre;
                    }
                });
            if degree > 1 {
                self.previous.fill(0.0);
            }
        } else {
            let (rhs, inverse) = (&self.rhs, &self.inverse);
            let update = |i: usize, x: f64, neighbours: f64, _: f64| {
                x + ((rhs[i] + neighbours) * inverse[i] - x) / centre
            };
            self.matrix.gather(&mut self.x, &mut self.previous, update);
            std::mem::swap(&mut self.x, &mut self.previous);
        }
        for _ in 1..degree {
            let next = (2.0 * sigma - rho).recip();
            self.step(next * rho, 2.0 * next / half);
            rho = next;
        }
    }

    /// x⁺ = x + inertia (x − x⁻) + factor D⁻¹(b − A x).
    fn step(&mut self, inertia: f64, factor: f64) {
        let (rhs, inverse) = (&self.rhs, &self.inverse);
        let update = |i: usize, x: f64, neighbours: f64, previous: f64| {
            let correction = (rhs[i] + neighbours) * inverse[i] - x;
            x + inertia * (x - previous) + factor * correction
        };
        self.matrix.gather(&mut self.x, &mut self.previous, update);
        std::mem::swap(&mut self.x, &mut self.previous);
    }

    /// Sums of the residual over the aggregates.
    pub(super) fn restrict(&mut self, coarse: &mut [f64]) {
        let (rhs, diagonal) = (&self.rhs, self.matrix.diagonal());
        let residual =
            |i: usize, x: f64, neighbours: f64, _: f64| rhs[i] - (diagonal[i] * x - neighbours);
        self.matrix
            .gather(&mut self.x, &mut self.residual, residual);
        let (starts, members, residual) = (&self.starts, &self.members, &self.residual);
        coarse
            .par_chunks_mut(BLOCK)
            .enumerate()
            .for_each(|(block, sums)| {
                for (group, sum) in (block * BLOCK..).zip(sums) {
                    let rows = &members[starts[group] as usize..starts[group + 1] as usize];
                    *sum = rows.iter().map(|&i| residual[i as usize]).sum();
                }
            });
    }

    /// x += the aggregates' corrections.
    pub(super) fn prolong(&mut self, coarse: &[f64]) {
        let x = &mut self.x[..self.aggregates.len()];
        x.par_chunks_mut(BLOCK)
            .zip(self.aggregates.par_chunks(BLOCK))
            .for_each(|(x, aggregates)| {
                for (x, &group) in x.iter_mut().zip(aggregates) {
                    if group != NONE {
                        *x += coarse[group as usize];
                    }
                }
            });
    }

    /// After a first cycle on A x = b: the best multiple of x. True when that is good enough; otherwise the residual
    /// is left in `rhs` for a second cycle, see [`Level::combine`].
    pub(super) fn first_direction(&mut self) -> Option<First> {
        self.matrix.multiply(&mut self.x, &mut self.image);
        let owned = self.rhs.len();
        let communicator = self.matrix.halo().communicator();
        let parts = self.x[..owned]
            .par_chunks(BLOCK)
            .zip(self.image.par_chunks(BLOCK))
            .zip(self.rhs.par_chunks(BLOCK))
            .map(|((c, v), b)| [dot(c, v), dot(c, b), dot(b, b), dot(b, v), dot(v, v)]);
        let mut sums = self.partials.sum(parts);
        communicator.sum_slice(&mut sums);
        let [cv, cb, bb, bv, vv] = sums;
        let length = if cv > 0.0 { cb / cv } else { 0.0 };
        let left = bb - 2.0 * length * bv + length * length * vv;
        if cv <= 0.0 || left <= GOOD_ENOUGH * bb {
            self.x[..owned].iter_mut().for_each(|x| *x *= length);
            return None;
        }
        self.direction.copy_from_slice(&self.x[..owned]);
        let image = &self.image;
        self.rhs
            .iter_mut()
            .zip(image)
            .for_each(|(b, v)| *b -= length * v);
        Some(First { cv, cb })
    }

    /// Minimises the energy over the directions of both cycles (Notay's K-cycle).
    pub(super) fn combine(&mut self, first: First) {
        self.matrix.multiply(&mut self.x, &mut self.residual);
        let owned = self.rhs.len();
        let parts = self.x[..owned]
            .par_chunks(BLOCK)
            .zip(self.image.par_chunks(BLOCK))
            .zip(self.residual.par_chunks(BLOCK))
            .zip(self.rhs.par_chunks(BLOCK))
            .map(|(((c, v1), v2), b)| [dot(c, v1), dot(c, v2), dot(c, b), 0.0, 0.0]);
        let mut sums = self.partials.sum(parts);
        self.matrix.halo().communicator().sum_slice(&mut sums[..3]);
        let [mixed, second, cb, ..] = sums;
        let schur = second - mixed * mixed / first.cv;
        let length = if schur > 0.0 { cb / schur } else { 0.0 };
        let start = (first.cb - mixed * length) / first.cv;
        self.x[..owned]
            .iter_mut()
            .zip(&self.direction)
            .for_each(|(x, c)| *x = start * c + length * *x);
    }
}

/// Square of the residual reduction that spares the second inner iteration.
const GOOD_ENOUGH: f64 = 0.0625;

/// Products of the first inner direction c with its image and with the right-hand side.
#[derive(Clone, Copy, Debug)]
pub(super) struct First {
    cv: f64,
    cb: f64,
}

/// Upper end of the spectrum of D⁻¹A: power iteration, at most the bound of Gershgorin (exact on a 7-point stencil).
fn largest_eigenvalue(matrix: &PairMatrix, inverse: &[f64]) -> f64 {
    let communicator = matrix.halo().communicator();
    let bound = (0..matrix.owned()).map(|i| {
        let couplings: f64 = matrix.row(i).map(|(_, w)| w.abs()).sum();
        (matrix.diagonal()[i] + couplings) * inverse[i]
    });
    let bound = communicator.max(bound.fold(1.0, f64::max));
    if bound <= 2.0 + 1e-9 {
        return bound;
    }
    let rank = communicator.rank() as u64;
    let mut x: Vec<f64> = (0..matrix.halo().total() as u64)
        .map(|i| noise(i ^ (rank << 40)))
        .collect();
    let mut y = vec![0.0; matrix.owned()];
    let mut estimate = 1.0;
    for _ in 0..POWER_STEPS {
        matrix.gather(&mut x, &mut y, |i, x, neighbours, _| {
            x - inverse[i] * neighbours
        });
        // Rayleigh quotient in the D inner product, in which D⁻¹A is symmetric.
        let weighted = |a: &[f64], b: &[f64]| -> f64 {
            let terms = a.iter().zip(b).zip(matrix.diagonal());
            terms.map(|((a, b), d)| a * b * d).sum()
        };
        let mut sums = [
            weighted(&y, &y),
            weighted(&x[..y.len()], &y),
            weighted(&x[..y.len()], &x[..y.len()]),
        ];
        communicator.sum_slice(&mut sums);
        let [yy, xy, xx] = sums;
        if yy.is_nan() || yy <= 0.0 {
            return bound;
        }
        estimate = (xy / xx).max(yy / xy);
        let scale = yy.sqrt().recip();
        x.iter_mut().zip(&y).for_each(|(x, y)| *x = y * scale);
    }
    bound.min(SAFETY * estimate)
}

/// Reproducible numbers in −1…1.
fn noise(index: u64) -> f64 {
    let mixed = index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 11) as f64 / (1u64 << 52) as f64
        - 1.0
}

/// PᵀAP for the piecewise-constant P of the aggregates: couplings and shifts are summed, so that rows without shift
/// keep their zero sum. Collective.
pub(super) fn galerkin(
    fine: &PairMatrix,
    aggregates: &[u32],
    count: usize,
) -> Result<PairMatrix, SolveError> {
    let halo = fine.halo();
    let (owned, rank) = (halo.owned(), halo.communicator().rank() as u32);
    let mut names: Vec<[u32; 2]> = aggregates.iter().map(|&a| [rank, a]).collect();
    names.resize(halo.total(), [0, NONE]);
    halo.update(&mut names);
    let foreign = names[owned..].iter().filter(|name| name[1] != NONE);
    let mut owners: Vec<(u32, u32)> = foreign.map(|&[rank, index]| (rank, index)).collect();
    owners.sort_unstable();
    owners.dedup();
    let coarse_index = |j: usize| match names[j] {
        [_, NONE] => None,
        [_, index] if j < owned => Some(index as usize),
        [rank, index] => owners.binary_search(&(rank, index)).ok().map(|k| count + k),
    };
    let coarse_halo = Halo::new(halo.communicator(), count, &owners);

    let (starts, members) = members(aggregates, count);
    let (mut offsets, mut entries) = (vec![0], Vec::<(u32, f64)>::new());
    let mut shift = vec![0.0; count];
    let mut place = vec![0usize; coarse_halo.total()];
    for group in 0..count {
        let first = entries.len();
        for &i in &members[starts[group] as usize..starts[group + 1] as usize] {
            shift[group] += fine.shift()[i as usize];
            for (j, w) in fine.row(i as usize) {
                let Some(other) = coarse_index(j) else {
                    shift[group] += w;
                    continue;
                };
                if other == group {
                    continue;
                }
                let at = place[other];
                // A stale place points before this row's entries or at another column.
                match entries.get_mut(at) {
                    Some(entry) if at >= first && entry.0 == other as u32 => entry.1 += w,
                    _ => {
                        place[other] = entries.len();
                        entries.push((other as u32, w));
                    }
                }
            }
        }
        offsets.push(entries.len());
    }
    let rows = |i: usize| entries[offsets[i]..offsets[i + 1]].iter().copied();
    let fixed = vec![false; coarse_halo.total()];
    PairMatrix::from_rows(&coarse_halo, rows, &fixed, Some(&shift))
}
