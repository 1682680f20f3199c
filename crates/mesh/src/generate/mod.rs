//! Meshes of boxes (any element kind, stretched, periodic, with random distortion) and of pipes.

mod cells;
mod division;
mod jitter;
mod lattice;
mod pipe;

use crate::{Mesh, MeshError, Periods};
use cells::Builder;
use division::Division;
use lattice::Lattice;
pub use pipe::PipeMesh;

/// Grid planes of one direction, at origin + size·x(s) with s = i/n.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Stretching {
    /// x = s.
    #[default]
    Uniform,
    /// Fine at both ends: x = ½(1 + tanh(β(2s − 1))/tanh β), β > 0.
    Tanh(f64),
    /// Every cell `ratio` times as long as the one before it: x = (ratioⁱ − 1)/(ratioⁿ − 1).
    Geometric(f64),
}

/// How a box is filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum BoxElement {
    /// One hexahedron a cell.
    #[default]
    Hexahedron,
    /// Two prisms a cell, extruded along z.
    Prism,
    /// Six tetrahedra a cell around its diagonal (Kuhn), which fit their periodic images.
    Tetrahedron,
    /// Hexahedra and, in every other cell (as a chequerboard), six pyramids that meet at its centre.
    PyramidHexahedron,
    /// Along x hexahedra (40 %), tetrahedra (20 %), prisms (40 %), joined by cells of pyramids and tetrahedra that
    /// meet at their centre; all four kinds from five cells along x.
    Mixed,
}

/// A box with a grid of cells.
#[derive(Clone, Debug, PartialEq)]
pub struct BoxMesh {
    /// Corner with the smallest coordinates \[m\].
    pub origin: [f64; 3],
    /// Edge lengths \[m\].
    pub size: [f64; 3],
    /// Number of cells in each direction.
    pub cells: [usize; 3],
    /// Grid planes in each direction.
    pub stretching: [Stretching; 3],
    /// Periodic directions; the others get the patches `x_min`, `x_max`, … `z_max`.
    pub periodic: [bool; 3],
    /// What the cells are divided into.
    pub element: BoxElement,
    /// Random displacement of inner vertices in each direction, as a fraction (0 to below 0.5) of the smaller
    /// neighbouring spacing; smaller where an element would be crushed. Nodes on patches stay, and periodic
    /// directions with one cell are not distorted.
    pub jitter: f64,
    /// Seed of the displacements.
    pub seed: u64,
}

impl Default for BoxMesh {
    fn default() -> Self {
        Self {
            origin: [0.0; 3],
            size: [1.0; 3],
            cells: [1; 3],
            stretching: [Stretching::Uniform; 3],
            periodic: [false; 3],
            element: BoxElement::Hexahedron,
            jitter: 0.0,
            seed: 0,
        }
    }
}

impl BoxMesh {
    /// The mesh. Nodes are numbered along x first, then y, z; centres of divided cells follow.
    ///
    /// # Errors
    /// [`MeshError::Parameter`] for values out of range, [`MeshError::Size`] for more nodes than 32 bits count.
    pub fn build(&self) -> Result<Mesh, MeshError> {
        self.check()?;
        let lattice = Lattice::new(self)?;
        let division = Division {
            lattice: &lattice,
            element: self.element,
        };
        let mut builder = Builder::new(division, self.periodic);
        builder.fill();
        let Builder {
            mut mesh, centres, ..
        } = builder;
        mesh.periods = Periods {
            vectors: std::array::from_fn(|a| {
                let length = if self.periodic[a] { self.size[a] } else { 0.0 };
                std::array::from_fn(|c| if a == c { length } else { 0.0 })
            }),
        };
        jitter::place(&mut mesh, &lattice, &centres, self.jitter, self.seed);
        Ok(mesh)
    }

    fn check(&self) -> Result<(), MeshError> {
        let refuse = |name, value: String, expected: &str| {
            Err(MeshError::Parameter {
                name,
                value,
                expected: expected.into(),
            })
        };
        if !self.origin.iter().all(|o| o.is_finite()) {
            return refuse("origin", format!("{:?}", self.origin), "finite coordinates");
        }
        if !self.size.iter().all(|s| s.is_finite() && *s > 0.0) {
            return refuse("size", format!("{:?}", self.size), "positive lengths");
        }
        if self.cells.contains(&0) {
            return refuse(
                "cells",
                format!("{:?}", self.cells),
                "at least one cell a direction",
            );
        }
        if !self.stretching.iter().all(|s| s.is_valid()) {
            let expected = "a positive tanh parameter or a positive ratio";
            return refuse("stretching", format!("{:?}", self.stretching), expected);
        }
        if !(0.0..0.5).contains(&self.jitter) {
            return refuse("jitter", self.jitter.to_string(), "0 to below 0.5");
        }
        if self.element == BoxElement::Mixed && self.cells[0] < 5 {
            let expected = "at least 5 cells along x for mixed elements";
            return refuse("cells", format!("{:?}", self.cells), expected);
        }
        let cells: u128 = self.cells.iter().map(|&n| n as u128 + 1).product();
        let vertices = match self.element {
            BoxElement::Hexahedron => 8,
            BoxElement::Prism => 12,
            BoxElement::Tetrahedron => 24,
            BoxElement::PyramidHexahedron => 30,
            BoxElement::Mixed => 48,
        };
        if cells * vertices > u128::from(u32::MAX) {
            return Err(MeshError::Size(format!(
                "a box of {:?} cells has more vertices than 32 bits count",
                self.cells
            )));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
