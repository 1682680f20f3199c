//! Rows that a sliver ties together.
//!
//! A tetrahedron of height ε couples its four nodes by κ (g·u)² with κ ~ 1/ε and Σ g = 0: far more than they are coupled
//! to others, and for positive and negative weights alike. Interpolation that is not constant on the four gives coarse
//! functions of that energy, and a smoother that visits one row at a time hardly moves what is left. So such rows share an
//! aggregate and its interpolation (they are one row when aggregates are sought), and are smoothed together.

use crate::PairMatrix;

/// A row is stiff whose largest coupling exceeds the median of its neighbours' largest ones by this factor.
const STIFF: f64 = 2.5;

/// Stiff rows are tied by couplings from this fraction of the largest one of either.
const TIED: f64 = 0.25;

/// Rows of a cluster at most.
pub(super) const LARGEST: usize = 16;

/// Clusters of a rank's own rows.
pub(super) struct Clusters {
    /// Cluster or single of every owned row.
    pub(super) groups: Vec<u32>,
    pub(super) count: usize,
    /// Clusters of two and more rows, each in order, by their first row.
    pub(super) tied: Vec<Vec<u32>>,
}

impl Clusters {
    /// None where no rank has any. Collective.
    pub(super) fn find(matrix: &PairMatrix) -> Option<Self> {
        let owned = matrix.owned();
        let row = |i: usize| matrix.row(i).fold(0.0, |s: f64, (_, w)| s.max(w.abs()));
        let mut largest: Vec<f64> = (0..owned).map(row).collect();
        largest.resize(matrix.halo().total(), 0.0);
        matrix.halo().update(&mut largest);
        let mut near = Vec::new();
        let mut stiff = |i: usize| {
            near.clear();
            near.extend(matrix.row(i).map(|(j, _)| largest[j]));
            let middle = near.len() / 2;
            // Its interpolation is not sent to other ranks.
            let inner = matrix.row(i).all(|(j, _)| j < owned);
            inner
                && near.len() > 2
                && largest[i] > STIFF * *near.select_nth_unstable_by(middle, f64::total_cmp).1
        };
        let stiff: Vec<bool> = (0..owned).map(&mut stiff).collect();
        let mut sets = Sets::new(owned);
        for i in (0..owned).filter(|&i| stiff[i]) {
            for (j, w) in matrix.row(i) {
                let limit = TIED * largest[i].min(largest[j]);
                if j < i && stiff[j] && w.abs() >= limit {
                    sets.join(i, j);
                }
            }
        }
        let tied = sets.large();
        if !matrix.halo().communicator().any(!tied.is_empty()) {
            return None;
        }
        let (mut groups, mut count) = (vec![u32::MAX; owned], 0);
        for i in 0..owned {
            let first = sets.first(i);
            if first == i {
                groups[i] = count;
                count += 1;
            } else {
                groups[i] = groups[first];
            }
        }
        Some(Self {
            groups,
            count: count as usize,
            tied,
        })
    }
}

/// An order of the rows, its own inverse, in which no cluster is cut by blocks of `block` rows; none where that is so
/// already. Rows that other ranks know stay where they are.
pub(super) fn order(matrix: &PairMatrix, clusters: &Clusters, block: usize) -> Option<Vec<u32>> {
    let owned = matrix.owned();
    let mut taken: Vec<bool> = (0..owned)
        .map(|i| matrix.row(i).any(|(j, _)| j >= owned))
        .collect();
    clusters
        .tied
        .iter()
        .flatten()
        .for_each(|&i| taken[i as usize] = true);
    let mut order: Vec<u32> = (0..owned as u32).collect();
    let ends = (0..owned)
        .step_by(block)
        .map(|first| (first + block).min(owned));
    // Rows of a block before this one may be free.
    let mut free: Vec<usize> = ends.collect();
    let mut changed = false;
    for rows in &clusters.tied {
        let home = rows[0] as usize / block;
        for &row in rows.iter().filter(|&&i| i as usize / block != home) {
            let found = (home * block..free[home]).rev().find(|&i| !taken[i]);
            free[home] = found.unwrap_or(home * block);
            if let Some(other) = found {
                order.swap(row as usize, other);
                changed = true;
            }
        }
    }
    changed.then_some(order)
}

/// Disjoint sets, named by their first member.
struct Sets {
    parents: Vec<u32>,
    sizes: Vec<u32>,
}

impl Sets {
    fn new(length: usize) -> Self {
        Self {
            parents: (0..length as u32).collect(),
            sizes: vec![1; length],
        }
    }

    fn first(&self, mut i: usize) -> usize {
        while self.parents[i] as usize != i {
            i = self.parents[i] as usize;
        }
        i
    }

    fn join(&mut self, i: usize, j: usize) {
        let (i, j) = (self.first(i), self.first(j));
        let (low, high) = (i.min(j), i.max(j));
        let size = self.sizes[low] + self.sizes[high];
        if low != high && size as usize <= LARGEST {
            self.parents[high] = low as u32;
            self.sizes[low] = size;
        }
    }

    /// Sets of more than one member.
    fn large(&self) -> Vec<Vec<u32>> {
        let tied = (0..self.parents.len()).filter(|&i| self.sizes[self.first(i)] > 1);
        let mut members: Vec<(u32, u32)> = tied.map(|i| (self.first(i) as u32, i as u32)).collect();
        members.sort_unstable();
        let sets = members.chunk_by(|a, b| a.0 == b.0);
        sets.map(|set| set.iter().map(|m| m.1).collect()).collect()
    }
}
