//! Generalised conjugate residuals, truncated: for systems that are not symmetric, with any preconditioner.

use crate::rows;
use fibreflow_parallel::{Communicator, block_sums};
use fibreflow_solve::SolveError;

/// Largest number of directions kept.
const MOST: usize = 96;

/// Directions handled in one pass over the fields.
const BATCH: usize = 4;

type Field = Vec<[f64; 4]>;

/// Room for the directions, kept between solves.
#[derive(Default)]
pub(super) struct Krylov {
    /// z, total length, and K z scaled by the weights, owned, normalised.
    directions: Vec<(Field, Field)>,
    scaled: Vec<[f64; 4]>,
}

/// When to stop.
#[derive(Clone, Copy)]
pub(super) struct Target {
    pub residual: f64,
    pub max_iterations: usize,
    /// Directions kept. A solve that takes fewer iterations is the full method.
    pub kept: usize,
}

impl Krylov {
    /// Adds to `x` what brings the weighted norm of `residual` below the target; `residual` is owned and kept up to date.
    /// Eisenstat, Elman & Schultz 1983. Returns the iterations. Collective.
    pub fn solve(
        &mut self,
        mut operator: impl FnMut(&mut [[f64; 4]], &mut [[f64; 4]]),
        mut precondition: impl FnMut(&[[f64; 4]], &mut [[f64; 4]]) -> Result<(), SolveError>,
        weights: &[[f64; 4]],
        (x, residual): (&mut [[f64; 4]], &mut [[f64; 4]]),
        target: Target,
        communicator: &Communicator,
    ) -> Result<usize, SolveError> {
        let owned = residual.len();
        self.scaled.resize(owned, [0.0; 4]);
        rows::each(&mut self.scaled, |i, s| {
            *s = std::array::from_fn(|c| weights[i][c] * residual[i][c]);
        });
        let most = target.kept.min(MOST);
        let initial = norm(&self.scaled, communicator);
        let mut left = initial;
        let mut iterations = 0;
        while left > target.residual {
            if iterations == target.max_iterations {
                return Err(SolveError::NotConverged {
                    iterations,
                    residual: left,
                    target: target.residual,
                    initial_residual: initial,
                });
            }
            let slot = iterations % most;
            if slot == self.directions.len() {
                let room = (vec![[0.0; 4]; x.len()], vec![[0.0; 4]; owned]);
                self.directions.push(room);
            }
            let (mut z, mut q) = std::mem::take(&mut self.directions[slot]);
            let kept = iterations.min(most);
            let mut list = [0; MOST];
            let others = (0..kept).filter(|k| *k != slot);
            let count = list.iter_mut().zip(others).map(|(l, k)| *l = k).count();
            precondition(residual, &mut z)?;
            operator(&mut z, &mut q);
            rows::each(&mut q, |i, q| {
                (0..4).for_each(|c| q[c] *= weights[i][c]);
            });
            self.orthogonalise(&list[..count], &mut z, &mut q, communicator);
            let size = norm(&q, communicator);
            if !(size > 0.0 && size.is_finite()) {
                self.directions[slot] = (z, q);
                return Err(SolveError::NotFinite {
                    iteration: iterations + 1,
                });
            }
            let inverse = 1.0 / size;
            rows::each(&mut z, |_, z| (0..4).for_each(|c| z[c] *= inverse));
            rows::each(&mut q, |_, q| (0..4).for_each(|c| q[c] *= inverse));
            let step = product(&q, &self.scaled, communicator);
            rows::each(x, |i, x| (0..4).for_each(|c| x[c] += step * z[i][c]));
            rows::each_pair(&mut self.scaled, residual, rows::sum, |i, s, r| {
                for c in 0..4 {
                    s[c] -= step * q[i][c];
                    r[c] = s[c] / weights[i][c];
                }
                0.0
            });
            left = norm(&self.scaled, communicator);
            self.directions[slot] = (z, q);
            iterations += 1;
        }
        Ok(iterations)
    }

    /// Makes (z, q) orthogonal to the directions listed, by blocks of classical Gram–Schmidt.
    fn orthogonalise(
        &self,
        list: &[usize],
        z: &mut [[f64; 4]],
        q: &mut [[f64; 4]],
        communicator: &Communicator,
    ) {
        for batch in list.chunks(BATCH) {
            let images: [&[[f64; 4]]; BATCH] = std::array::from_fn(|k| {
                batch.get(k).map_or(&[][..], |&d| &self.directions[d].1[..])
            });
            let steps: [&[[f64; 4]]; BATCH] = std::array::from_fn(|k| {
                batch.get(k).map_or(&[][..], |&d| &self.directions[d].0[..])
            });
            let q_read = &*q;
            let mut sums = block_sums::<BATCH>(q_read.len(), |range| {
                std::array::from_fn(|k| match images[k] {
                    [] => 0.0,
                    image => dot(&image[range.clone()], &q_read[range.clone()]),
                })
            });
            communicator.sum_slice(&mut sums);
            let used = batch.len();
            rows::each(q, |i, q| {
                for k in 0..used {
                    (0..4).for_each(|c| q[c] -= sums[k] * images[k][i][c]);
                }
            });
            rows::each(z, |i, z| {
                for k in 0..used {
                    (0..4).for_each(|c| z[c] -= sums[k] * steps[k][i][c]);
                }
            });
        }
    }
}

fn dot(a: &[[f64; 4]], b: &[[f64; 4]]) -> f64 {
    let mut sums = [0.0; 4];
    for (a, b) in a.iter().zip(b) {
        (0..4).for_each(|c| sums[c] += a[c] * b[c]);
    }
    sums.iter().sum()
}

fn product(a: &[[f64; 4]], b: &[[f64; 4]], communicator: &Communicator) -> f64 {
    let [sum] = block_sums(a.len(), |range| [dot(&a[range.clone()], &b[range])]);
    communicator.sum(sum)
}

fn norm(a: &[[f64; 4]], communicator: &Communicator) -> f64 {
    product(a, a, communicator).sqrt()
}

/// √Σ (weight · value)² over all ranks.
pub(super) fn weighted_norm(
    values: &[[f64; 4]],
    weights: &[[f64; 4]],
    communicator: &Communicator,
) -> f64 {
    let [sum] = block_sums(values.len(), |range| {
        let pairs = values[range.clone()].iter().zip(&weights[range]);
        [pairs
            .map(|(v, w)| (0..4).map(|c| (v[c] * w[c]).powi(2)).sum::<f64>())
            .sum()]
    });
    communicator.sum(sum).sqrt()
}
