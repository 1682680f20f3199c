//! Tensor-product meshes on ranks: lexicographic order of nodes, and blocks of complete lines.

use crate::{ElementKind, LocalMesh, Mesh, TensorGrid};

/// Fewest nodes of a direction that is chosen as the fastest for being periodic, or as the one to be cut.
const MANY: usize = 8;

/// How much dearer a cut across the middle direction is, where that has walls: solves along lines want it whole.
const WALL_CUT: f64 = 4.0;

/// The grid of a mesh on one rank; None when it is no tensor product.
pub(crate) fn grid(mesh: &mut Mesh) -> Option<TensorGrid> {
    if mesh
        .elements
        .kinds
        .iter()
        .any(|&k| k != ElementKind::Hexahedron)
    {
        return None;
    }
    let local = LocalMesh::single(std::mem::take(mesh));
    let grid = TensorGrid::detect(&local);
    *mesh = Mesh {
        nodes: local.nodes,
        elements: local.elements,
        boundary: local.boundary,
        patches: local.patches,
        periods: local.periods,
    };
    grid
}

/// Nodes in lexicographic order. Fastest runs a long periodic direction, else the longest: kernels run along it without
/// looking for ends. Slowest runs a periodic one of the rest, because ranks cut it first.
pub(crate) fn lexicographic(grid: &TensorGrid) -> Vec<u32> {
    let counts = grid.counts();
    let runs = |c: &usize| (grid.periods[*c].is_some() && counts[*c] >= MANY, counts[*c]);
    let best = |a: usize, b: usize| if runs(&b) > runs(&a) { b } else { a };
    let fast = best(best(0, 1), 2);
    let [a, b] = [[1, 2], [0, 2], [0, 1]][fast];
    let axes = if runs(&a) > runs(&b) {
        [fast, b, a]
    } else {
        [fast, a, b]
    };
    let mut order = vec![0; grid.indices.len()];
    for (node, &at) in grid.indices.iter().enumerate() {
        let [i, j, k] = axes.map(|c| at[c] as usize);
        order[i + counts[axes[0]] * (j + counts[axes[1]] * k)] = node as u32;
    }
    order
}

/// A mesh in lexicographic order, cut across its two slower directions.
pub(crate) struct Blocks {
    /// Nodes along the fastest, middle and slowest direction.
    counts: [usize; 3],
    periodic: [bool; 3],
    /// Blocks across the middle and the slowest direction.
    parts: [usize; 2],
}

impl Blocks {
    /// None when the nodes are not numbered line by line, or the lines are too few.
    pub fn new(grid: &TensorGrid, ranks: usize) -> Option<Self> {
        let numbers: Vec<u64> = (0..grid.indices.len() as u64).collect();
        let axes = grid.numbering(&numbers)?;
        let counts = axes.map(|c| grid.counts()[c]);
        let periodic = axes.map(|c| grid.periods[c].is_some());
        let middle = if periodic[1] { 1.0 } else { WALL_CUT };
        // Nodes of the largest block by nodes of a line, and half a node's work for every entry received.
        let cost = |&[a, b]: &[usize; 2]| {
            let (m, s) = (counts[1].div_ceil(a) as f64, counts[2].div_ceil(b) as f64);
            let cut = |parts: usize, lines: f64| if parts > 1 { lines } else { 0.0 };
            m * s + cut(b, m) + middle * cut(a, s)
        };
        let fits = |&[a, b]: &[usize; 2]| a * b == ranks && a <= counts[1] && b <= counts[2];
        let parts = (1..=ranks)
            .map(|a| [a, ranks / a])
            .filter(fits)
            .min_by(|a, b| cost(a).total_cmp(&cost(b)))?;
        Some(Self {
            counts,
            periodic,
            parts,
        })
    }

    /// Rank of every node.
    pub fn owners(&self) -> Vec<u32> {
        let [n, m, s] = self.counts;
        let part = |i: usize, count: usize, parts: usize| ((i + 1) * parts - 1) / count;
        let mut owners = Vec::with_capacity(n * m * s);
        for k in 0..s {
            for j in 0..m {
                let rank = part(j, m, self.parts[0]) + self.parts[0] * part(k, s, self.parts[1]);
                owners.extend(std::iter::repeat_n(rank as u32, n));
            }
        }
        owners
    }

    /// Nodes of the lines within `layers` of those that hold `owned` nodes, along either of the two slower directions.
    pub fn reached(&self, owned: &[u32], layers: usize) -> Vec<u32> {
        let [n, m, _] = self.counts;
        let lines = owned.iter().step_by(n).map(|&node| node as usize / n);
        let mut reached: Vec<usize> = Vec::new();
        for line in lines {
            let (j, k) = (line % m, line / m);
            for step in 1..=layers as isize {
                for step in [-step, step] {
                    reached.extend(self.shifted(j, 1, step).map(|j| j + m * k));
                    reached.extend(self.shifted(k, 2, step).map(|k| j + m * k));
                }
            }
        }
        reached.sort_unstable();
        reached.dedup();
        let nodes = |line: usize| (n * line..n * (line + 1)).map(|node| node as u32);
        reached.into_iter().flat_map(nodes).collect()
    }

    fn shifted(&self, i: usize, direction: usize, step: isize) -> Option<usize> {
        let count = self.counts[direction] as isize;
        let i = i as isize + step;
        if self.periodic[direction] {
            Some(i.rem_euclid(count) as usize)
        } else {
            (0..count).contains(&i).then_some(i as usize)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BoxMesh;

    fn channel() -> (Mesh, TensorGrid) {
        let mut mesh = BoxMesh {
            cells: [12, 6, 10],
            periodic: [false, true, true],
            ..BoxMesh::default()
        }
        .build()
        .expect("box");
        let grid = grid(&mut mesh).expect("tensor");
        (mesh, grid)
    }

    #[test]
    fn the_long_periodic_direction_runs_fastest_and_the_short_one_slowest() {
        let (mut mesh, grid) = channel();
        assert_eq!(lexicographic(&grid)[1], 13 * 6, "one step along z");
        crate::renumber(&mut mesh).expect("renumbering");
        let grid = super::grid(&mut mesh).expect("tensor");
        let numbers: Vec<u64> = (0..mesh.nodes.len() as u64).collect();
        assert_eq!(grid.numbering(&numbers), Some([2, 1, 0]));
    }

    #[test]
    fn blocks_are_lines_and_reach_as_far_as_asked() {
        let (_, grid) = channel();
        for (ranks, parts) in [(2, [1, 2]), (5, [1, 5]), (6, [3, 2])] {
            let blocks = Blocks::new(&grid, ranks).expect("blocks");
            assert_eq!(blocks.parts, parts, "{ranks} ranks");
            let owners = blocks.owners();
            let lines = owners.chunks(13);
            assert!(lines.clone().all(|line| line.iter().all(|&r| r == line[0])));
            for rank in 0..ranks as u32 {
                assert!(owners.contains(&rank));
            }
        }
        let blocks = Blocks::new(&grid, 5).expect("blocks");
        let owned: Vec<u32> = (0..13 * 12).collect();
        let planes = |layers| {
            let mut planes: Vec<u32> = blocks
                .reached(&owned, layers)
                .iter()
                .map(|n| n / 78)
                .collect();
            planes.dedup();
            planes
        };
        assert_eq!(planes(1), [0, 1, 2, 9]);
        assert_eq!(planes(3), [0, 1, 2, 3, 4, 7, 8, 9]);
    }
}
