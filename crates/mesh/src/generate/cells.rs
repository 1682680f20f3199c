//! Elements and boundary faces of the cells of a box.

use super::division::{Cell, Division};
use super::lattice::Lattice;
use crate::{BoundaryFace, ElementKind, Image, Mesh};

/// Corners of the faces x_min, x_max, y_min … of a cell, normal outwards; a divided face is cut along its first and
/// third corner, as the tetrahedra around the cell's diagonal cut it.
const FACES: [[usize; 4]; 6] = [
    [0, 4, 6, 2],
    [1, 3, 7, 5],
    [0, 1, 5, 4],
    [2, 6, 7, 3],
    [0, 2, 3, 1],
    [4, 5, 7, 6],
];
/// Corners of a cell in the vertex order of a hexahedron.
const HEXAHEDRON: [usize; 8] = [0, 1, 3, 2, 4, 5, 7, 6];
const PRISMS: [[usize; 6]; 2] = [[0, 1, 3, 4, 5, 7], [0, 3, 2, 4, 7, 6]];
/// Paths along the edges from corner 0 to corner 7, ordered for a positive volume.
const TETRAHEDRA: [[usize; 4]; 6] = [
    [0, 1, 3, 7],
    [0, 5, 1, 7],
    [0, 3, 2, 7],
    [0, 2, 6, 7],
    [0, 4, 5, 7],
    [0, 6, 4, 7],
];
const PATCHES: [&str; 6] = ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"];

type Vertex = (u32, Image);

/// Collects the elements of a box; nodes are placed afterwards.
pub(super) struct Builder<'a> {
    division: Division<'a>,
    /// Patch of each of the six sides, none where periodic.
    sides: [Option<u16>; 6],
    pub mesh: Mesh,
    /// Cells with a node at their centre, in the order of these nodes.
    pub centres: Vec<[usize; 3]>,
}

impl<'a> Builder<'a> {
    pub fn new(division: Division<'a>, periodic: [bool; 3]) -> Self {
        let mut mesh = Mesh::default();
        let sides = std::array::from_fn(|side| {
            (!periodic[side / 2]).then(|| {
                mesh.patches.push(PATCHES[side].into());
                mesh.patches.len() as u16 - 1
            })
        });
        Self {
            division,
            sides,
            mesh,
            centres: Vec::new(),
        }
    }

    /// Appends the elements and boundary faces of all cells, x fastest.
    pub fn fill(&mut self) {
        let [nx, ny, nz] = self.lattice().cells;
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    self.cell([i, j, k]);
                }
            }
        }
    }

    fn lattice(&self) -> &'a Lattice {
        self.division.lattice
    }

    fn cell(&mut self, at: [usize; 3]) {
        let corners = self.lattice().corners(at);
        match self.division.of(at) {
            Cell::Hexahedron => self.push(ElementKind::Hexahedron, HEXAHEDRON.map(|c| corners[c])),
            Cell::Prisms => {
                for prism in PRISMS {
                    self.push(ElementKind::Prism, prism.map(|c| corners[c]));
                }
            }
            Cell::Tetrahedra => {
                for tetrahedron in TETRAHEDRA {
                    self.push(ElementKind::Tetrahedron, tetrahedron.map(|c| corners[c]));
                }
            }
            Cell::Centre => self.centre(at, &corners),
        }
        for side in 0..6 {
            if let (Some(patch), None) = (self.sides[side], self.lattice().neighbour(at, side)) {
                let [a, b, c, d] = FACES[side].map(|c| corners[c]);
                if self.division.is_divided(at, side) {
                    self.boundary(patch, &[a, b, c]);
                    self.boundary(patch, &[a, c, d]);
                } else {
                    self.boundary(patch, &[a, b, c, d]);
                }
            }
        }
    }

    fn centre(&mut self, at: [usize; 3], corners: &[Vertex; 8]) {
        let apex = (
            (self.lattice().len() + self.centres.len()) as u32,
            Image::ZERO,
        );
        self.centres.push(at);
        for side in 0..6 {
            let [a, b, c, d] = FACES[side].map(|c| corners[c]);
            // Seen from the centre the corners of a face run the other way round.
            if self.division.is_divided(at, side) {
                self.push(ElementKind::Tetrahedron, [a, c, b, apex]);
                self.push(ElementKind::Tetrahedron, [a, d, c, apex]);
            } else {
                self.push(ElementKind::Pyramid, [a, d, c, b, apex]);
            }
        }
    }

    fn push<const N: usize>(&mut self, kind: ElementKind, vertices: [Vertex; N]) {
        let (nodes, images) = (vertices.map(|v| v.0), vertices.map(|v| v.1));
        self.mesh.elements.push(kind, &nodes, &images);
    }

    fn boundary(&mut self, patch: u16, vertices: &[Vertex]) {
        let mut face = BoundaryFace {
            patch,
            vertices: vertices.len() as u8,
            nodes: [0; 4],
            images: [Image::ZERO; 4],
        };
        for (v, &(node, image)) in vertices.iter().enumerate() {
            (face.nodes[v], face.images[v]) = (node, image);
        }
        self.mesh.boundary.push(face);
    }
}
