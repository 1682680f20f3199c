//! Aggregates by repeated pairwise matching along the strongest couplings of a rank's own rows.

use crate::PairMatrix;

/// Aggregate index of a row that the coarse level does not see.
pub(super) const NONE: u32 = u32::MAX;

/// A row whose shift exceeds this multiple of its couplings is left to the smoother.
const DOMINANT: f64 = 4.0;

/// Whether couplings to other ranks count among the strong ones of a row, though they cannot be aggregated along.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Abroad {
    /// A row whose strong neighbours are foreign is not merged with one that it hardly feels.
    Heed,
    /// Such rows are merged all the same, so that coarsening goes on.
    Ignore,
}

/// Couplings between the rows (later: aggregates) of one rank; no self-couplings, no duplicates.
struct Graph {
    offsets: Vec<u32>,
    columns: Vec<u32>,
    weights: Vec<f64>,
    /// Strongest coupling of every row to another rank.
    abroad: Vec<f64>,
}

/// Aggregate of every owned row, and the number of aggregates.
///
/// Each of `pairings` rounds about doubles the size. A row pairs with its strongest free neighbour when that coupling
/// is at least `strength` times its strongest one, so that on stretched cells aggregates grow along the short side
/// first. Sequential in row order: the same for any number of threads.
pub(super) fn aggregate(
    matrix: &PairMatrix,
    pairings: usize,
    strength: f64,
    abroad: Abroad,
) -> (Vec<u32>, usize) {
    let owned = matrix.owned();
    let mut aggregates = vec![NONE; owned];
    let mut count = 0;
    for (i, aggregate) in aggregates.iter_mut().enumerate() {
        let coupled: f64 = matrix.row(i).map(|(_, w)| w.abs()).sum();
        if coupled > 0.0 && matrix.shift()[i] <= DOMINANT * coupled {
            *aggregate = count as u32;
            count += 1;
        }
    }
    let own = |(j, w): (usize, f64)| (j < owned).then_some((j as u32, w));
    let rows = |i: usize| matrix.row(i).filter_map(own);
    let heed = abroad == Abroad::Heed;
    let abroad = |i: usize| {
        let foreign = matrix.row(i).filter(|&(j, _)| heed && j >= owned);
        foreign.fold(0.0, |s: f64, (_, w)| s.max(w))
    };
    let mut graph = collapse(rows, abroad, &aggregates, count);
    for _ in 0..pairings {
        let (pairs, pair_count) = pair(&graph, strength);
        for aggregate in aggregates.iter_mut().filter(|a| **a != NONE) {
            *aggregate = pairs[*aggregate as usize];
        }
        let rows = |i: usize| graph.row(i);
        graph = collapse(rows, |i| graph.abroad[i], &pairs, pair_count);
        count = pair_count;
    }
    (aggregates, count)
}

impl Graph {
    fn row(&self, i: usize) -> impl Iterator<Item = (u32, f64)> {
        let entries = self.offsets[i] as usize..self.offsets[i + 1] as usize;
        let columns = self.columns[entries.clone()].iter().copied();
        columns.zip(self.weights[entries].iter().copied())
    }

    fn len(&self) -> usize {
        self.offsets.len() - 1
    }
}

/// Matching in row order along strong couplings; pairs are numbered by their first row.
///
/// A row whose strong neighbours are all taken makes the pair of the strongest a triple, or stays alone when that is
/// one already: lone rows would slow the coarsening down.
fn pair(graph: &Graph, strength: f64) -> (Vec<u32>, usize) {
    let mut pairs = vec![NONE; graph.len()];
    let mut sizes: Vec<u8> = Vec::with_capacity(graph.len() / 2);
    for i in 0..graph.len() {
        if pairs[i] != NONE {
            continue;
        }
        let strongest = graph
            .row(i)
            .fold(graph.abroad[i], |s: f64, (_, w)| s.max(w));
        // The first of equals, so that ties do not depend on anything but the order of the rows.
        let best = |accepted: &dyn Fn(u32) -> bool| {
            let strong = |w: f64| w > 0.0 && w >= strength * strongest;
            let candidates = graph
                .row(i)
                .filter(|&(j, w)| strong(w) && accepted(pairs[j as usize]));
            let larger =
                |best: (u32, f64), entry: (u32, f64)| if entry.1 > best.1 { entry } else { best };
            let (column, _) = candidates.fold((NONE, 0.0), larger);
            (column != NONE).then_some(column as usize)
        };
        if let Some(free) = best(&|pair| pair == NONE) {
            (pairs[i], pairs[free]) = (sizes.len() as u32, sizes.len() as u32);
            sizes.push(2);
        } else if let Some(taken) = best(&|pair| sizes[pair as usize] < 3) {
            pairs[i] = pairs[taken];
            sizes[pairs[i] as usize] += 1;
        } else {
            pairs[i] = sizes.len() as u32;
            sizes.push(1);
        }
    }
    (pairs, sizes.len())
}

/// Couplings between groups of rows: sums over the members; `abroad`: the largest of them.
fn collapse<R>(
    row: impl Fn(usize) -> R,
    abroad: impl Fn(usize) -> f64,
    groups: &[u32],
    count: usize,
) -> Graph
where
    R: Iterator<Item = (u32, f64)>,
{
    let (starts, members) = members(groups, count);
    let mut graph = Graph {
        offsets: vec![0],
        columns: Vec::new(),
        weights: Vec::new(),
        abroad: vec![0.0; count],
    };
    let mut place = vec![0u32; count];
    for group in 0..count {
        let first = graph.columns.len();
        for &i in &members[starts[group] as usize..starts[group + 1] as usize] {
            graph.abroad[group] = graph.abroad[group].max(abroad(i as usize));
            for (j, w) in row(i as usize) {
                let other = groups[j as usize];
                if other == NONE || other as usize == group {
                    continue;
                }
                let at = place[other as usize] as usize;
                // A stale place points before this row's entries or at another column.
                if at >= first && graph.columns.get(at) == Some(&other) {
                    graph.weights[at] += w;
                } else {
                    place[other as usize] = graph.columns.len() as u32;
                    graph.columns.push(other);
                    graph.weights.push(w);
                }
            }
        }
        graph.offsets.push(graph.columns.len() as u32);
    }
    graph
}

/// Rows of every group in compressed form, in row order.
pub(super) fn members(groups: &[u32], count: usize) -> (Vec<u32>, Vec<u32>) {
    let mut starts = vec![0u32; count + 1];
    for &group in groups.iter().filter(|g| **g != NONE) {
        starts[group as usize + 1] += 1;
    }
    for group in 0..count {
        starts[group + 1] += starts[group];
    }
    let mut next = starts.clone();
    let mut members = vec![0; starts[count] as usize];
    for (row, &group) in groups.iter().enumerate().filter(|(_, g)| **g != NONE) {
        members[next[group as usize] as usize] = row as u32;
        next[group as usize] += 1;
    }
    (starts, members)
}
