//! The graph of nodes joined by element edges.

use crate::{ElementKind, Elements, Mesh};
use rayon::prelude::*;

/// Largest cost of cutting an edge.
const DEAREST: f64 = 100.0;

/// Undirected node graph in compressed rows: both directions of an edge, no self-edges, rows ascending.
///
/// Element edges only, not face or body diagonals: on hexahedra 6 neighbours a node instead of 26, and a cut of
/// edges measures the interface as well.
pub(crate) struct NodeGraph {
    pub offsets: Vec<u32>,
    pub columns: Vec<u32>,
}

impl NodeGraph {
    pub fn new(elements: &Elements, nodes: usize) -> Self {
        let mut edges: Vec<(u32, u32)> = Vec::with_capacity(2 * elements.nodes.len());
        for e in 0..elements.len() {
            let vertices = elements.nodes(e);
            for_each_edge(elements.kinds[e], |a, b| {
                let (i, j) = (vertices[a], vertices[b]);
                if i != j {
                    edges.push((i.min(j), i.max(j)));
                }
            });
        }
        edges.par_sort_unstable();
        edges.dedup();
        Self::from_edges(&edges, nodes)
    }

    /// From sorted, distinct edges (i < j).
    fn from_edges(edges: &[(u32, u32)], nodes: usize) -> Self {
        let mut offsets = vec![0u32; nodes + 1];
        for &(i, j) in edges {
            offsets[i as usize + 1] += 1;
            offsets[j as usize + 1] += 1;
        }
        (0..nodes).for_each(|i| offsets[i + 1] += offsets[i]);
        let mut next = offsets.clone();
        let mut columns = vec![0; 2 * edges.len()];
        let mut put = |row: u32, column: u32| {
            let at = &mut next[row as usize];
            columns[*at as usize] = column;
            *at += 1;
        };
        // Lower neighbours come first and in ascending order, because the edges are sorted by i.
        edges.iter().for_each(|&(i, j)| put(j, i));
        edges.iter().for_each(|&(i, j)| put(i, j));
        Self { offsets, columns }
    }

    /// Neighbours of node i.
    pub fn row(&self, i: u32) -> &[u32] {
        &self.columns[self.offsets[i as usize] as usize..self.offsets[i as usize + 1] as usize]
    }

    /// Cost of cutting every entry: 1 for the longest edge at either end, (longest/length)² up to [`DEAREST`] for
    /// shorter ones.
    ///
    /// Diffusion couples the ends of the short edges of stretched cells most. Where such a coupling runs between
    /// ranks, multigrid cannot aggregate along it: a mesh stretched 1:1000 then takes four times the iterations.
    pub fn cutting_costs(&self, mesh: &Mesh) -> Vec<u32> {
        let mut squares = vec![f64::INFINITY; self.columns.len()];
        for e in 0..mesh.elements.len() {
            let points = mesh.elements.coordinates(e, &mesh.nodes, &mesh.periods);
            let vertices = mesh.elements.nodes(e);
            for_each_edge(mesh.elements.kinds[e], |a, b| {
                let square: f64 = (0..3).map(|c| (points[b][c] - points[a][c]).powi(2)).sum();
                for (i, j) in [(vertices[a], vertices[b]), (vertices[b], vertices[a])] {
                    if let Ok(k) = self.row(i).binary_search(&j) {
                        let entry = &mut squares[self.offsets[i as usize] as usize + k];
                        *entry = entry.min(square);
                    }
                }
            });
        }
        let row = |i: usize| self.offsets[i] as usize..self.offsets[i + 1] as usize;
        let longest: Vec<f64> = (0..self.nodes())
            .map(|i| squares[row(i)].iter().copied().fold(0.0, f64::max))
            .collect();
        let cost = |(i, k): (usize, usize)| {
            let scale = longest[i].max(longest[self.columns[k] as usize]);
            // A length of zero, too, costs the most.
            (scale / squares[k]).clamp(1.0, DEAREST) as u32
        };
        let entries = (0..self.nodes()).flat_map(|i| row(i).map(move |k| (i, k)));
        entries.map(cost).collect()
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.offsets.len() - 1
    }
}

/// Calls `edge(a, b)` once for every edge of an element kind, with local vertices a < b.
pub(crate) fn for_each_edge(kind: ElementKind, mut edge: impl FnMut(usize, usize)) {
    for face in kind.faces() {
        for (k, &a) in face.iter().enumerate() {
            let b = face[(k + 1) % face.len()];
            // The neighbouring face runs along the same edge from b to a.
            if a < b {
                edge(a, b);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Image;

    #[test]
    fn every_kind_has_its_number_of_edges() {
        for (kind, expected) in ElementKind::ALL.into_iter().zip([6, 8, 9, 12]) {
            let mut edges = Vec::new();
            for_each_edge(kind, |a, b| edges.push((a, b)));
            edges.sort_unstable();
            edges.dedup();
            assert_eq!(edges.len(), expected, "{}", kind.name());
        }
    }

    #[test]
    fn rows_are_symmetric_and_ascending() {
        let mut elements = Elements::default();
        let image = [Image::ZERO; 8];
        elements.push(ElementKind::Hexahedron, &[0, 1, 3, 2, 4, 5, 7, 6], &image);
        elements.push(ElementKind::Pyramid, &[4, 5, 7, 6, 8], &image[..5]);
        let graph = NodeGraph::new(&elements, 10);
        assert_eq!(graph.row(0), [1, 2, 4]);
        assert_eq!(graph.row(4), [0, 5, 6, 8]);
        assert_eq!(graph.row(8), [4, 5, 6, 7]);
        assert!(graph.row(9).is_empty());
        for i in 0..10 {
            assert!(graph.row(i).iter().all(|&j| graph.row(j).contains(&i)));
            assert!(graph.row(i).is_sorted());
        }
    }

    #[test]
    fn the_short_edges_of_a_flat_brick_are_dear_to_cut() {
        let mut mesh = Mesh::default();
        for z in [0.0, 0.1875] {
            for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                mesh.nodes.push([x, y, z]);
            }
        }
        let nodes = [0, 1, 2, 3, 4, 5, 6, 7];
        mesh.elements
            .push(ElementKind::Hexahedron, &nodes, &[Image::ZERO; 8]);
        let graph = NodeGraph::new(&mesh.elements, 8);
        assert_eq!(graph.row(0), [1, 3, 4]);
        assert_eq!(graph.cutting_costs(&mesh)[..3], [1, 1, 28]);
        mesh.nodes[4..].iter_mut().for_each(|x| x[2] = 1e-9);
        assert_eq!(graph.cutting_costs(&mesh)[..3], [1, 1, 100]);
    }
}
