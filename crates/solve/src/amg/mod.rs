//! Aggregation-based algebraic multigrid, built from the matrix alone.
//!
//! Aggregates grow along strong couplings, so that stretched cells are coarsened along their short side first; the
//! coarse matrices are sums (Galerkin with piecewise constants), which keeps them symmetric and their rows' sums exact.
//! Plain aggregation needs more than a V-cycle: coarse levels run two steps of flexible conjugate gradients (K-cycle;
//! Notay 2010, Notay & Vassilevski 2008). Measured to a residual of 1e-8 on 48³ nodes (uniform, stretched, jittered
//! and flat tetrahedra) it takes 45–65 % of the iterations of a V-cycle and 45–87 % of its time; aggregates of eight
//! with one smoothing step beat aggregates of four, or more steps, on all but the most stretched of these.
//!
//! Negative couplings (obtuse tetrahedra) stay in every level: sums over aggregates cancel most of them, where lumping
//! them to the diagonal doubled the iterations on flat tetrahedra. They never join rows.
//!
//! Aggregates stay on their rank; the coarsest level is solved directly on all of them. Rows whose strong couplings
//! lead to other ranks are carried there unmerged: with them merged along weak ones, a mesh stretched 1:1000 took
//! 85 and 176 iterations on two and three ranks instead of 51 on one; so it takes 52 and 59.

mod aggregate;
mod coarsest;
mod level;

use crate::{PairMatrix, Preconditioner, SolveError};
use aggregate::{Abroad, aggregate};
use coarsest::Coarsest;
use level::Level;

/// How the hierarchy is built and used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmgSettings {
    /// A coupling is strong from this fraction of the strongest in its row.
    pub strength: f64,
    /// Rounds of pairwise matching a level: aggregates of up to 2^pairings.
    pub pairings: usize,
    /// Chebyshev steps before and after the coarse correction.
    pub degree: usize,
    /// The smoother acts on the spectrum of D⁻¹A from λ_max/reach to λ_max.
    pub reach: f64,
    /// Unknowns of all ranks that are solved directly.
    pub coarsest: usize,
}

impl Default for AmgSettings {
    fn default() -> Self {
        Self {
            strength: 0.25,
            pairings: 3,
            degree: 1,
            reach: 6.0,
            coarsest: 300,
        }
    }
}

/// Largest matrix that is still solved directly when coarsening comes to a halt.
const DIRECT_LIMIT: usize = 1500;

/// The preconditioner.
#[derive(Clone, Debug)]
pub struct Amg {
    levels: Vec<Level>,
    coarsest: Coarsest,
    /// Right-hand side and answer of the coarsest level.
    rhs: Vec<f64>,
    x: Vec<f64>,
    settings: AmgSettings,
    unknowns: Vec<usize>,
    complexity: f64,
}

impl Amg {
    /// Builds the levels. Collective.
    ///
    /// # Errors
    /// [`SolveError::Coarsest`] when the coarsest matrix is not positive definite (a mesh in several pieces without
    /// Dirichlet nodes) or when coarsening stalls above 1500 unknowns.
    pub fn new(matrix: &PairMatrix, settings: AmgSettings) -> Result<Self, SolveError> {
        let communicator = matrix.halo().communicator().clone();
        let mut current = matrix.without_lifted();
        let singular = current.is_singular();
        let (mut levels, mut unknowns, mut entries) = (Vec::new(), Vec::new(), Vec::new());
        loop {
            let size = communicator.sum_count(current.owned());
            unknowns.push(size);
            entries.push(communicator.sum_count(current.entries_stored()) as f64);
            if size <= settings.coarsest {
                break;
            }
            let stalled = |count: usize| communicator.sum_count(count) * 5 > size * 4;
            let group = |abroad| aggregate(&current, settings.pairings, settings.strength, abroad);
            let (mut aggregates, mut count) = group(Abroad::Heed);
            if stalled(count) {
                if size <= DIRECT_LIMIT {
                    break;
                }
                (aggregates, count) = group(Abroad::Ignore);
                if stalled(count) {
                    return Err(SolveError::Coarsest { unknowns: size });
                }
            }
            let coarse = level::galerkin(&current, &aggregates, count)?;
            levels.push(Level::new(current, aggregates, count));
            current = coarse;
        }
        let coarsest = Coarsest::new(&current, singular)?;
        Ok(Self {
            levels,
            coarsest,
            rhs: vec![0.0; current.owned()],
            x: vec![0.0; current.owned()],
            settings,
            complexity: entries.iter().sum::<f64>() / entries[0].max(1.0),
            unknowns,
        })
    }

    /// Unknowns of all ranks, level by level.
    pub fn unknowns(&self) -> &[usize] {
        &self.unknowns
    }

    /// Stored couplings of all levels over those of the finest.
    pub fn operator_complexity(&self) -> f64 {
        self.complexity
    }
}

/// One cycle on the first of `levels`, from zero: its `x` from its `rhs`.
fn cycle(
    levels: &mut [Level],
    coarsest: &mut Coarsest,
    rhs: &mut [f64],
    x: &mut [f64],
    settings: &AmgSettings,
) {
    let Some((level, coarser)) = levels.split_first_mut() else {
        coarsest.solve(rhs, x);
        return;
    };
    level.smooth(settings.degree, settings.reach, true);
    if coarser.is_empty() {
        level.restrict(rhs);
        coarsest.solve(rhs, x);
        level.prolong(x);
    } else {
        level.restrict(&mut coarser[0].rhs);
        cycle(coarser, coarsest, rhs, x, settings);
        if let Some(first) = coarser[0].first_direction() {
            cycle(coarser, coarsest, rhs, x, settings);
            coarser[0].combine(first);
        }
        level.prolong(&coarser[0].x);
    }
    level.smooth(settings.degree, settings.reach, false);
}

impl Preconditioner<f64> for Amg {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        let Self {
            levels,
            coarsest,
            rhs,
            x,
            settings,
            ..
        } = self;
        match levels.first_mut() {
            None => coarsest.solve(r, z),
            Some(level) => {
                level.rhs.copy_from_slice(r);
                cycle(levels, coarsest, rhs, x, settings);
                z.copy_from_slice(&levels[0].x[..z.len()]);
            }
        }
    }

    fn is_variable(&self) -> bool {
        self.levels.len() > 1
    }
}
