//! Smoothed-aggregation multigrid in single precision, built from the matrix alone.
//!
//! Aggregates grow along strong couplings, so that stretched cells are coarsened along their short side first;
//! interpolation is smoothed along the same couplings (Vaněk, Mandel & Brezina 1996) and the coarse matrices are
//! Galerkin products, so that they stay symmetric and their rows' sums exact.
//!
//! Negative couplings (obtuse tetrahedra) stay in the matrices of every level; they never join rows and do not smooth
//! the interpolation.
//!
//! Aggregates stay on their rank, but interpolation is smoothed across ranks. Levels of few unknowns a rank are held
//! whole by every rank: there aggregates know no ranks, and the work is cheaper than the messages.

mod aggregate;
mod clusters;
mod coarsest;
mod gathered;
mod hierarchy;
mod level;
mod patches;
pub(crate) mod transfer;

use crate::{PairMatrix, Preconditioner, SolveError, vectors::BLOCK};
use clusters::Clusters;
use hierarchy::Node;
use level::SWEEP;
use rayon::prelude::*;

/// How the hierarchy is built and used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmgSettings {
    /// A coupling is strong from this fraction of the geometric mean of the largest ones of its two rows.
    pub strength: f64,
    /// Damping ω of the smoothing of the interpolation, below 1.
    pub omega: f64,
    /// Unknowns of all ranks that are solved directly.
    pub coarsest: usize,
}

impl Default for AmgSettings {
    fn default() -> Self {
        Self {
            strength: 0.25,
            omega: 2.0 / 3.0,
            coarsest: 200,
        }
    }
}

/// Sizes of the levels.
#[derive(Clone, Debug, Default)]
struct Census {
    unknowns: Vec<usize>,
    entries: Vec<f64>,
}

/// The preconditioner.
#[derive(Clone, Debug)]
pub struct Amg {
    finest: Node,
    /// Row at every place of the finest level, its own inverse; none where they are the same.
    order: Option<Vec<u32>>,
    /// (D̄/D)^½ with D̄ the mean of the diagonal D, owned.
    scale: Vec<f32>,
    mean: f64,
    /// Norm of the residuals to come.
    norm: f64,
    census: Census,
}

impl Amg {
    /// Builds the levels. Collective.
    ///
    /// # Errors
    /// [`SolveError::Coarsest`] when the coarsest matrix is not positive definite (a mesh in several pieces without
    /// Dirichlet nodes) or when coarsening stalls above 1500 unknowns.
    pub fn new(matrix: &PairMatrix, settings: AmgSettings) -> Result<Self, SolveError> {
        let matrix = matrix.without_lifted();
        let clusters = Clusters::find(&matrix);
        let order = clusters.and_then(|clusters| clusters::order(&matrix, &clusters, SWEEP));
        let matrix = match &order {
            Some(order) => matrix.reordered(order)?,
            None => matrix,
        };
        let mut census = Census::default();
        let finest = Node::new(&matrix, matrix.is_singular(), &settings, &mut census)?;
        let roots = finest.roots();
        let mut sums = [roots.iter().map(|r| r * r).sum(), roots.len() as f64];
        matrix.halo().communicator().sum_slice(&mut sums);
        let mean = sums[0] / sums[1].max(1.0);
        let scale = |&root: &f64| (mean.sqrt() * level::reciprocal(root)) as f32;
        Ok(Self {
            scale: roots.iter().map(scale).collect(),
            mean,
            norm: 1.0,
            order,
            finest,
            census,
        })
    }

    /// Unknowns of all ranks, level by level.
    pub fn unknowns(&self) -> &[usize] {
        &self.census.unknowns
    }

    /// Stored couplings of all levels over those of the finest.
    pub fn operator_complexity(&self) -> f64 {
        let entries = &self.census.entries;
        entries.iter().sum::<f64>() / entries[0].max(1.0)
    }
}

impl Preconditioner<f64> for Amg {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        let (scale, inverse) = (&self.scale, self.norm.recip());
        let factor = self.norm / self.mean;
        if let Some(order) = &self.order {
            let row = |i: usize| (r[order[i] as usize] * inverse) as f32 * scale[i];
            self.finest.solve(row);
            let answer = self.finest.answer();
            let places = order.par_chunks(BLOCK);
            z.par_chunks_mut(BLOCK).zip(places).for_each(|(z, places)| {
                for (z, &place) in z.iter_mut().zip(places) {
                    let place = place as usize;
                    *z = factor * f64::from(answer[place] * scale[place]);
                }
            });
            return;
        }
        self.finest.solve(|i| (r[i] * inverse) as f32 * scale[i]);
        z.par_chunks_mut(BLOCK)
            .zip(self.finest.answer().par_chunks(BLOCK))
            .zip(scale.par_chunks(BLOCK))
            .for_each(|((z, x), scale)| {
                for ((z, &x), &s) in z.iter_mut().zip(x).zip(scale) {
                    *z = factor * f64::from(x * s);
                }
            });
    }

    fn normalise(&mut self, norm: f64) {
        if norm.is_normal() {
            self.norm = norm;
        }
    }
}
