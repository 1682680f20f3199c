//! Groups of a rank's rows by repeated matching along the strongest couplings.

use crate::{PairMatrix, merge::NONE};

/// Couplings between groups, summed over their rows.
struct Graph {
    offsets: Vec<usize>,
    entries: Vec<(u32, f64)>,
}

/// Group of every owned row, and the number of groups, about `nodes` rows each; rows without couplings have none.
///
/// Every round pairs each group with the free neighbour it is bound to most. Couplings of pairs add up across and halve
/// along, so that groups get as long in every direction as its couplings are strong. Couplings to other ranks do not
/// count. Sequential in row order: the same for any number of threads.
pub(super) fn groups(matrix: &PairMatrix, nodes: usize) -> (Vec<u32>, usize) {
    let owned = matrix.owned();
    let coupled = |i: usize| matrix.row(i).any(|(_, w)| w != 0.0);
    let (mut groups, mut count) = (vec![NONE; owned], 0);
    for (_, group) in groups.iter_mut().enumerate().filter(|(i, _)| coupled(*i)) {
        *group = count;
        count += 1;
    }
    let members = count as usize;
    let mut graph = Graph::of_rows(matrix, &groups, members);
    while graph.len() * nodes > members {
        let (pairs, left) = graph.matched();
        // Half as many is the aim; fewer than a tenth gone: what is left are groups without neighbours.
        if left * 10 > graph.len() * 9 {
            break;
        }
        let grouped = groups.iter_mut().filter(|g| **g != NONE);
        grouped.for_each(|group| *group = pairs[*group as usize]);
        graph = graph.merged(&pairs, left);
    }
    (groups, graph.len())
}

impl Graph {
    fn of_rows(matrix: &PairMatrix, groups: &[u32], count: usize) -> Self {
        let mut graph = Self::with_capacity(count, matrix.entries_stored());
        for i in (0..matrix.owned()).filter(|&i| groups[i] != NONE) {
            let own = matrix.row(i).filter(|&(j, _)| j < groups.len());
            graph.entries.extend(own.map(|(j, w)| (groups[j], w)));
            graph.offsets.push(graph.entries.len());
        }
        graph
    }

    fn with_capacity(rows: usize, entries: usize) -> Self {
        let mut offsets = Vec::with_capacity(rows + 1);
        offsets.push(0);
        Self {
            offsets,
            entries: Vec::with_capacity(entries),
        }
    }

    fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    fn row(&self, i: usize) -> &[(u32, f64)] {
        &self.entries[self.offsets[i]..self.offsets[i + 1]]
    }

    /// New number of every group, and how many there are: a group and its strongest free neighbour share one.
    fn matched(&self) -> (Vec<u32>, usize) {
        let (mut pairs, mut count) = (vec![NONE; self.len()], 0);
        for i in 0..self.len() {
            if pairs[i] != NONE {
                continue;
            }
            pairs[i] = count;
            let free = self.row(i).iter().filter(|e| pairs[e.0 as usize] == NONE);
            // The first of equals, so that ties depend on the order of the rows alone.
            let strongest = free.fold((NONE, 0.0), |best, &e| if e.1 > best.1 { e } else { best });
            if strongest.0 != NONE {
                pairs[strongest.0 as usize] = count;
            }
            count += 1;
        }
        (pairs, count as usize)
    }

    /// The graph of the new groups.
    fn merged(&self, pairs: &[u32], count: usize) -> Self {
        let mut members = vec![[NONE; 2]; count];
        for (old, &new) in pairs.iter().enumerate() {
            let slots = &mut members[new as usize];
            slots[usize::from(slots[0] != NONE)] = old as u32;
        }
        let mut merged = Self::with_capacity(count, self.entries.len());
        let mut place = vec![usize::MAX; count];
        for (new, old) in members.iter().enumerate() {
            let first = merged.entries.len();
            for &old in old.iter().filter(|o| **o != NONE) {
                for &(other, w) in self.row(old as usize) {
                    let other = pairs[other as usize];
                    if other as usize == new {
                        continue;
                    }
                    let place = &mut place[other as usize];
                    match merged.entries.get_mut(*place) {
                        Some(entry) if *place >= first => entry.1 += w,
                        _ => {
                            *place = merged.entries.len();
                            merged.entries.push((other, w));
                        }
                    }
                }
            }
            merged.offsets.push(merged.entries.len());
        }
        merged
    }
}
