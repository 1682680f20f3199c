//! Which elements each cell of a box becomes, so that all faces fit.

use super::lattice::Lattice;
use crate::BoxElement;

/// What a cell is divided into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cell {
    Hexahedron,
    Prisms,
    Tetrahedra,
    /// A pyramid on every whole face and two tetrahedra on every divided one, meeting at the centre.
    Centre,
}

impl Cell {
    /// True when the faces across `direction` are cut into triangles.
    fn divides(self, direction: usize) -> bool {
        match self {
            Self::Tetrahedra => true,
            Self::Prisms => direction == 2,
            Self::Hexahedron | Self::Centre => false,
        }
    }
}

/// The division of all cells.
#[derive(Clone, Copy)]
pub(super) struct Division<'a> {
    pub lattice: &'a Lattice,
    pub element: BoxElement,
}

impl Division<'_> {
    /// What cell `at` becomes: as asked for, or joined from its centre where a neighbour's faces do not fit.
    pub fn of(self, at: [usize; 3]) -> Cell {
        let wanted = self.wanted(at);
        let is_imposed = |side: usize| {
            self.lattice
                .neighbour(at, side)
                .is_some_and(|other| self.wanted(other).divides(side / 2))
        };
        let fits = match wanted {
            Cell::Hexahedron => !(0..6).any(is_imposed),
            Cell::Prisms => !(0..4).any(is_imposed),
            Cell::Tetrahedra | Cell::Centre => true,
        };
        if fits { wanted } else { Cell::Centre }
    }

    /// True when the face of cell `at` on `side` (0–5: x_min, x_max, y_min …) is cut into triangles.
    pub fn is_divided(self, at: [usize; 3], side: usize) -> bool {
        let neighbour = self.lattice.neighbour(at, side);
        self.of(at).divides(side / 2)
            || neighbour.is_some_and(|other| self.of(other).divides(side / 2))
    }

    fn wanted(self, [i, j, k]: [usize; 3]) -> Cell {
        match self.element {
            BoxElement::Hexahedron => Cell::Hexahedron,
            BoxElement::Prism => Cell::Prisms,
            BoxElement::Tetrahedron => Cell::Tetrahedra,
            BoxElement::PyramidHexahedron if (i + j + k).is_multiple_of(2) => Cell::Centre,
            BoxElement::PyramidHexahedron => Cell::Hexahedron,
            BoxElement::Mixed => match (10 * i + 5) / self.lattice.cells[0] {
                0..4 => Cell::Hexahedron,
                4..6 => Cell::Tetrahedra,
                _ => Cell::Prisms,
            },
        }
    }
}
