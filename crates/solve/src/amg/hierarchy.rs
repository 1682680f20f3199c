//! Levels, one inside the other, and the V-cycle through them.

use super::aggregate::{Strength, aggregate};
use super::clusters::Clusters;
use super::coarsest::Coarsest;
use super::gathered::Gathered;
use super::level::{Compact, Level, roots};
use super::transfer::Transfer;
use super::{AmgSettings, Census};
use crate::{PairMatrix, SolveError, merge::Merged};

/// Largest matrix that is still solved directly when coarsening comes to a halt.
const DIRECT_LIMIT: usize = 1500;

/// Unknowns a rank below which a level is gathered, and of all ranks at most.
const FEW: usize = 1000;
const GATHER_LIMIT: usize = 16_384;

/// As before, when coarsening comes to a halt because strong couplings lead to other ranks.
const STALLED_LIMIT: usize = 65_536;

/// A level and what lies below it.
#[derive(Clone, Debug)]
pub(super) enum Node {
    Coarsened {
        level: Box<Level>,
        roots: Vec<f64>,
        coarser: Box<Node>,
    },
    Gathered(Gathered),
    Coarsest(Coarsest),
}

impl Node {
    /// Collective.
    pub(super) fn new(
        matrix: &PairMatrix,
        singular: bool,
        settings: &AmgSettings,
        census: &mut Census,
    ) -> Result<Self, SolveError> {
        let communicator = matrix.halo().communicator();
        let (size, ranks) = (communicator.sum_count(matrix.owned()), communicator.size());
        let gather = |census: &mut Census| {
            let build = |whole: PairMatrix| Self::new(&whole, singular, settings, census);
            Ok(Self::Gathered(Gathered::new(matrix, build)?))
        };
        if ranks > 1 && size <= (FEW * ranks).min(GATHER_LIMIT).max(settings.coarsest) {
            return gather(census);
        }
        census.unknowns.push(size);
        let entries = communicator.sum_count(matrix.entries_stored());
        census.entries.push(entries as f64);
        if size <= settings.coarsest {
            return Ok(Self::Coarsest(Coarsest::new(matrix, singular)?));
        }
        // Coarse levels have no slivers.
        let finest = census.unknowns.len() == 1;
        let clusters = finest.then(|| Clusters::find(matrix)).flatten();
        let merged = clusters
            .as_ref()
            .map(|c| Merged::new(matrix, &c.groups, c.count));
        let merged = merged.transpose()?;
        let seen = merged.as_ref().map_or(matrix, |m| &m.matrix);
        let strength = Strength::new(seen, settings.strength);
        let (aggregates, count) = aggregate(seen, &strength);
        if communicator.sum_count(count) * 5 > size * 4 {
            if ranks > 1 && size <= STALLED_LIMIT {
                census.unknowns.pop();
                census.entries.pop();
                return gather(census);
            }
            if size <= DIRECT_LIMIT {
                return Ok(Self::Coarsest(Coarsest::new(matrix, singular)?));
            }
            return Err(SolveError::Coarsest { unknowns: size });
        }
        let mut transfer = Transfer::new(seen, &strength, &aggregates, count, settings.omega)?;
        if let Some(merged) = &merged {
            transfer.prolongation = transfer.prolongation.repeated(&merged.groups);
            transfer.restriction = transfer.prolongation.transposed(count);
        }
        let coarser = Self::new(&transfer.coarse, singular, settings, census)?;
        let roots = roots(matrix);
        let mut coarse_roots = coarser.roots().to_vec();
        coarse_roots.resize(transfer.coarse.halo().total(), 0.0);
        transfer.coarse.halo().update(&mut coarse_roots);
        let (prolongation, restriction) = (&transfer.prolongation, &transfer.restriction);
        let coarse_halo = transfer.coarse.halo().clone();
        let level = Level::new(
            matrix,
            clusters.as_ref().map_or(&[], |c| &c.tied),
            &roots,
            prolongation,
            restriction,
            &coarse_roots,
            coarse_halo,
        )?;
        Ok(Self::Coarsened {
            level: Box::new(level),
            roots: roots[..matrix.owned()].to_vec(),
            coarser: Box::new(coarser),
        })
    }

    /// D^½ of the owned rows: the level's variables are D^(−½) b and D^½ x.
    pub(super) fn roots(&self) -> &[f64] {
        match self {
            Self::Coarsened { roots, .. } => roots,
            Self::Gathered(gathered) => &gathered.roots,
            Self::Coarsest(coarsest) => &coarsest.roots,
        }
    }

    /// Answer on the owned rows.
    pub(super) fn answer(&self) -> &[f32] {
        match self {
            Self::Coarsened { level, roots, .. } => &level.x[..roots.len()],
            Self::Gathered(gathered) => &gathered.x,
            Self::Coarsest(coarsest) => &coarsest.x,
        }
    }

    /// One V-cycle from zero on the right-hand side `b`. Collective.
    pub(super) fn solve(&mut self, b: impl Fn(usize) -> f32 + Sync) {
        match self {
            Self::Coarsened { level, coarser, .. } => {
                level.descend(b);
                coarser.correct(&level.restriction, &level.residual);
                level.ascend(coarser.answer());
            }
            Self::Gathered(gathered) => {
                let rhs = gathered.gathering.own().iter_mut().enumerate();
                rhs.for_each(|(i, rhs)| *rhs = b(i));
                gathered.solve();
            }
            Self::Coarsest(coarsest) => {
                let rhs = coarsest.rhs.iter_mut().enumerate();
                rhs.for_each(|(i, rhs)| *rhs = b(i));
                coarsest.solve();
            }
        }
    }

    /// As [`Node::solve`] on a restricted residual; cuts the recursion of types.
    fn correct(&mut self, restriction: &Compact, residual: &[f32]) {
        self.solve(|i| restriction.product(i, residual));
    }
}
