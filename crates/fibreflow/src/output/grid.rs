//! The fluid's mesh and fields as a VTK piece.

use super::vtk::{Array, Piece, Topology};
use fibreflow_mesh::{Image, LocalMesh};

/// The part of the mesh that this rank writes: its own elements and the points they need.
///
/// A node that an element sees through a periodic boundary becomes a point of its own, shifted to where the element
/// is, so that no cell spans the box.
#[derive(Clone, Debug)]
pub struct Grid {
    points: Vec<[f64; 3]>,
    /// Local node of every point.
    nodes: Vec<u32>,
    connectivity: Vec<i64>,
    offsets: Vec<i64>,
    types: Vec<u8>,
    rank: i64,
}

impl Grid {
    /// From a rank's mesh.
    pub fn new(mesh: &LocalMesh) -> Self {
        let owned = || (0..mesh.elements.len()).filter(|&e| mesh.owned_elements[e]);
        let vertices = |e: usize| {
            let (nodes, images) = (mesh.elements.nodes(e), mesh.elements.images(e));
            nodes.iter().copied().zip(images.iter().copied())
        };
        let mut used: Vec<(u32, Image)> = owned().flat_map(vertices).collect();
        used.sort_unstable();
        used.dedup();
        let point = |vertex: (u32, Image)| used.binary_search(&vertex).map_or(-1, |p| p as i64);
        let mut grid = Self {
            points: Vec::with_capacity(used.len()),
            nodes: used.iter().map(|u| u.0).collect(),
            connectivity: Vec::new(),
            offsets: Vec::new(),
            types: Vec::new(),
            rank: mesh.halo.communicator().rank() as i64,
        };
        for &(node, image) in &used {
            let (x, shift) = (mesh.nodes[node as usize], mesh.periods.shift(image));
            grid.points.push(std::array::from_fn(|c| x[c] + shift[c]));
        }
        for e in owned() {
            grid.connectivity.extend(vertices(e).map(point));
            grid.offsets.push(grid.connectivity.len() as i64);
            grid.types.push(mesh.elements.kinds[e].vtk_type());
        }
        grid
    }

    /// A scalar node field on the points.
    pub fn scalar(&self, name: &'static str, field: &[f64]) -> Array {
        Array::scalar(
            name,
            self.nodes.iter().map(|&n| field[n as usize]).collect(),
        )
    }

    /// A vector node field on the points.
    pub fn vector(&self, name: &'static str, field: &[[f64; 4]]) -> Array {
        let value = |&n: &u32| {
            let v = field[n as usize];
            [v[0], v[1], v[2]]
        };
        Array::vector(name, self.nodes.iter().map(value))
    }

    /// The piece with these fields and the rank that owns each cell.
    pub fn piece(&self, point_data: Vec<Array>) -> Piece {
        Piece {
            points: self.points.clone(),
            topology: Topology::Unstructured {
                connectivity: self.connectivity.clone(),
                offsets: self.offsets.clone(),
                types: self.types.clone(),
            },
            point_data,
            cell_data: vec![Array::integer(
                "partition",
                vec![self.rank; self.types.len()],
            )],
        }
    }
}
