//! Lexicographic or reverse Cuthill–McKee order of nodes, and elements after their nodes.

use crate::graph::NodeGraph;
use crate::{Elements, Mesh, MeshError, blocks, validate};

/// Distance |i − j| over the element edges of a mesh: how far apart in memory a row's gather reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bandwidth {
    /// Largest distance.
    pub maximum: usize,
    /// Mean distance.
    pub mean: f64,
}

/// What [`renumber`] did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Renumbering {
    /// Of the order the mesh came in.
    pub before: Bandwidth,
    /// Of the order it has now.
    pub after: Bandwidth,
}

/// Puts nodes that are neighbours near each other in memory.
///
/// Nodes of a tensor-product mesh get lexicographic order: along a long periodic direction first, or else the longest;
/// then the flow solver needs no index to find neighbours. Otherwise nodes get the reverse Cuthill–McKee order of the element-edge graph (Cuthill & McKee 1969; start at a
/// pseudo-peripheral node, George & Liu 1979); elements and boundary faces follow their lowest node. The order depends
/// on the mesh alone, not on ranks or threads. A mesh whose own order has the lower mean distance, such as a box in
/// lexicographic order, keeps it.
///
/// # Errors
/// [`MeshError::Index`], [`MeshError::Empty`] or [`MeshError::Size`] when the arrays do not fit each other.
pub fn renumber(mesh: &mut Mesh) -> Result<Renumbering, MeshError> {
    validate::indices(mesh)?;
    let grid = blocks::grid(mesh);
    let graph = NodeGraph::new(&mesh.elements, mesh.nodes.len());
    let order = match &grid {
        Some(grid) => blocks::lexicographic(grid),
        None => reverse_cuthill_mckee(&graph),
    };
    let mut place = vec![0; order.len()];
    for (k, &node) in order.iter().enumerate() {
        place[node as usize] = k as u32;
    }
    let before = bandwidth(&graph, |i| i);
    let after = bandwidth(&graph, |i| place[i as usize]);
    let in_order = order.iter().copied().eq(0..order.len() as u32);
    if in_order || (grid.is_none() && after.mean >= before.mean) {
        return Ok(Renumbering {
            before,
            after: before,
        });
    }
    mesh.nodes = order.iter().map(|&n| mesh.nodes[n as usize]).collect();
    mesh.elements = reordered(&mesh.elements, &place);
    for face in &mut mesh.boundary {
        face.nodes[..face.vertices as usize]
            .iter_mut()
            .for_each(|n| *n = place[*n as usize]);
    }
    mesh.boundary.sort_by_key(|face| {
        let nodes = face.nodes[..face.vertices as usize].iter();
        (face.patch, nodes.min().copied())
    });
    Ok(Renumbering { before, after })
}

fn bandwidth(graph: &NodeGraph, place: impl Fn(u32) -> u32) -> Bandwidth {
    let (mut maximum, mut sum) = (0, 0.0);
    for i in 0..graph.nodes() as u32 {
        for &j in graph.row(i) {
            let distance = place(i).abs_diff(place(j)) as usize;
            maximum = maximum.max(distance);
            sum += distance as f64;
        }
    }
    Bandwidth {
        maximum,
        mean: sum / graph.columns.len().max(1) as f64,
    }
}

fn reordered(elements: &Elements, place: &[u32]) -> Elements {
    let renamed: Vec<u32> = elements.nodes.iter().map(|&n| place[n as usize]).collect();
    let range = |e: usize| elements.offsets[e] as usize..elements.offsets[e + 1] as usize;
    let mut order: Vec<u32> = (0..elements.len() as u32).collect();
    order.sort_by_key(|&e| renamed[range(e as usize)].iter().min().copied());
    let mut sorted = Elements::default();
    for e in order {
        let e = e as usize;
        sorted.push(elements.kinds[e], &renamed[range(e)], elements.images(e));
    }
    sorted
}

/// Nodes in their new order.
fn reverse_cuthill_mckee(graph: &NodeGraph) -> Vec<u32> {
    let nodes = graph.nodes();
    let mut levels = Levels {
        graph,
        seen: vec![0; nodes],
        sweep: 0,
    };
    let mut placed = vec![false; nodes];
    let mut order = Vec::with_capacity(nodes);
    for first in 0..nodes as u32 {
        if placed[first as usize] {
            continue;
        }
        let start = levels.pseudo_peripheral(first);
        let from = order.len();
        placed[start as usize] = true;
        order.push(start);
        let mut head = from;
        while head < order.len() {
            let tail = order.len();
            for &j in graph.row(order[head]) {
                if !std::mem::replace(&mut placed[j as usize], true) {
                    order.push(j);
                }
            }
            order[tail..].sort_by_key(|&j| (graph.row(j).len(), j));
            head += 1;
        }
        order[from..].reverse();
    }
    order
}

/// Breadth-first level structures.
struct Levels<'a> {
    graph: &'a NodeGraph,
    seen: Vec<u32>,
    sweep: u32,
}

impl Levels<'_> {
    /// A node nearly as far from the others of its component as any.
    fn pseudo_peripheral(&mut self, first: u32) -> u32 {
        let (mut start, mut depth) = (first, 0);
        loop {
            let (last, levels) = self.last_level(start);
            if levels <= depth {
                return start;
            }
            let lowest = last.iter().min_by_key(|&&j| (self.graph.row(j).len(), j));
            (start, depth) = (lowest.copied().unwrap_or(start), levels);
        }
    }

    /// Nodes farthest from `start`, and the number of levels.
    fn last_level(&mut self, start: u32) -> (Vec<u32>, usize) {
        self.sweep += 1;
        self.seen[start as usize] = self.sweep;
        let (mut level, mut levels) = (vec![start], 1);
        loop {
            let mut next = Vec::new();
            for &i in &level {
                for &j in self.graph.row(i) {
                    if std::mem::replace(&mut self.seen[j as usize], self.sweep) != self.sweep {
                        next.push(j);
                    }
                }
            }
            if next.is_empty() {
                return (level, levels);
            }
            (level, levels) = (next, levels + 1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BoundaryFace, ElementKind, Image};
    use rand::seq::SliceRandom;
    use rand::{SeedableRng, rngs::StdRng};

    /// A bar of 4 × 4 × 30 hexahedra, its nodes and elements in lexicographic order or shuffled; patch 0 at z = 0.
    fn bar(shuffled: bool) -> Mesh {
        let (n, length) = (4, 30);
        let mut generator = StdRng::seed_from_u64(7);
        let count = (n + 1) * (n + 1) * (length + 1);
        let mut name: Vec<u32> = (0..count as u32).collect();
        if shuffled {
            name.shuffle(&mut generator);
        }
        let mut mesh = Mesh {
            nodes: vec![[0.0; 3]; count],
            patches: vec!["end".into()],
            ..Mesh::default()
        };
        let node = |i, j, k| name[i + (n + 1) * (j + (n + 1) * k)];
        for k in 0..=length {
            for j in 0..=n {
                for i in 0..=n {
                    // Sheared: a tensor product would be put in lexicographic order.
                    mesh.nodes[node(i, j, k) as usize] =
                        [i as f64, j as f64, k as f64 + 0.1 * i as f64];
                }
            }
        }
        let square = |i, j, k| {
            [
                node(i, j, k),
                node(i + 1, j, k),
                node(i + 1, j + 1, k),
                node(i, j + 1, k),
            ]
        };
        let mut cells: Vec<usize> = (0..n * n * length).collect();
        if shuffled {
            cells.shuffle(&mut generator);
        }
        for cell in cells {
            let (i, j, k) = (cell % n, cell / n % n, cell / (n * n));
            let nodes = [square(i, j, k), square(i, j, k + 1)].concat();
            mesh.elements
                .push(ElementKind::Hexahedron, &nodes, &[Image::ZERO; 8]);
            if k == 0 {
                let [a, b, c, d] = square(i, j, k);
                mesh.boundary.push(BoundaryFace {
                    patch: 0,
                    vertices: 4,
                    nodes: [a, d, c, b],
                    images: [Image::ZERO; 4],
                });
            }
        }
        mesh
    }

    /// Vertex coordinates of elements, as sorted bit patterns: what a mesh is, whatever its numbering.
    fn shape(mesh: &Mesh) -> Vec<Vec<[u64; 3]>> {
        let bits = |&n: &u32| mesh.nodes[n as usize].map(f64::to_bits);
        let elements = (0..mesh.elements.len()).map(|e| mesh.elements.nodes(e));
        let faces = mesh.boundary.iter().map(|f| &f.nodes[..]);
        let mut shape: Vec<Vec<_>> = elements
            .chain(faces)
            .map(|nodes| nodes.iter().map(bits).collect())
            .collect();
        shape.sort();
        shape
    }

    #[test]
    fn a_shuffled_bar_gets_narrow_rows_and_stays_the_same_mesh() {
        let mut mesh = bar(true);
        let shape_before = shape(&mesh);
        let report = renumber(&mut mesh).expect("renumbering");
        assert_eq!(shape(&mesh), shape_before);
        assert!(report.before.maximum > 600, "{report:?}");
        // Fronts through 5 × 5 nodes.
        assert!(report.after.maximum <= 30, "{report:?}");
        assert!(report.after.mean < 26.0, "{report:?}");
        let graph = NodeGraph::new(&mesh.elements, mesh.nodes.len());
        assert_eq!(bandwidth(&graph, |i| i), report.after);
        let lowest = |e| mesh.elements.nodes(e).iter().min();
        assert!((1..mesh.elements.len()).all(|e| lowest(e - 1) <= lowest(e)));
    }

    #[test]
    fn an_order_that_is_better_is_kept() {
        let mut mesh = bar(false);
        let (nodes, elements) = (mesh.nodes.clone(), mesh.elements.nodes.clone());
        let report = renumber(&mut mesh).expect("renumbering");
        assert_eq!(report.after, report.before);
        assert_eq!((mesh.nodes, mesh.elements.nodes), (nodes, elements));
    }
}
