//! Pieces of fibres listed by cells.

use crate::{PeriodicBox, Vector3};

/// End of a cell's list.
const NONE: u32 = u32::MAX;

/// A piece is listed in the cell of its middle, and reaches no further than the next cells.
pub(super) struct Cells {
    periodic: PeriodicBox,
    origin: Vector3,
    width: [f64; 3],
    count: [usize; 3],
    /// First piece of every cell.
    first: Vec<u32>,
    /// Next piece in the same cell, of every piece.
    next: Vec<u32>,
}

impl Cells {
    /// Cells at least `width` wide over a box. A periodic axis has to be twice that long.
    pub fn new(periodic: PeriodicBox, [low, high]: [Vector3; 2], width: f64) -> Self {
        let mut cells = Self {
            periodic,
            origin: low,
            width: [0.0; 3],
            count: [0; 3],
            first: Vec::new(),
            next: Vec::new(),
        };
        for axis in 0..3 {
            let mut size = high[axis] - low[axis];
            if let Some(period) = periodic.lengths[axis] {
                (cells.origin[axis], size) = (periodic.origin[axis], period);
            }
            cells.count[axis] = ((size / width) as usize).max(1);
            cells.width[axis] = size / cells.count[axis] as f64;
        }
        cells.first = vec![NONE; cells.count.iter().product()];
        cells
    }

    /// Forgets all pieces and makes room for `pieces`.
    pub fn clear(&mut self, pieces: usize) {
        self.first.fill(NONE);
        self.next.clear();
        self.next.resize(pieces, NONE);
    }

    /// Lists a piece with this middle.
    pub fn insert(&mut self, piece: usize, middle: &Vector3) {
        let cell = self.index(self.cell(middle));
        if self.next.len() <= piece {
            self.next.resize(piece + 1, NONE);
        }
        self.next[piece] = self.first[cell];
        self.first[cell] = piece as u32;
    }

    /// All pieces in the cell of a point and in those around it.
    pub fn around(&self, middle: Vector3) -> impl Iterator<Item = usize> {
        let [x, y, z] = self.cell(&middle);
        let neighbours = self.row(2, z).into_iter().flatten().flat_map(move |k| {
            let rows = self.row(1, y).into_iter().flatten();
            rows.flat_map(move |j| {
                let row = self.row(0, x).into_iter().flatten();
                row.map(move |i| self.index([i, j, k]))
            })
        });
        neighbours.flat_map(|cell| {
            let first = self.first[cell];
            let next = |&piece: &u32| Some(self.next[piece as usize]).filter(|&n| n != NONE);
            let list = std::iter::successors(Some(first).filter(|&n| n != NONE), next);
            list.map(|piece| piece as usize)
        })
    }

    /// A place along an axis and those beside it, each once.
    fn row(&self, axis: usize, at: usize) -> [Option<usize>; 3] {
        let count = self.count[axis];
        let repeats = self.periodic.lengths[axis].is_some();
        // With two cells round the axis, the one before is the one after.
        let before = match at {
            0 if repeats && count > 2 => Some(count - 1),
            0 => None,
            _ if repeats && count == 2 => None,
            _ => Some(at - 1),
        };
        let after = match at + 1 {
            next if next < count => Some(next),
            _ if repeats && count > 1 => Some(0),
            _ => None,
        };
        [before, Some(at), after]
    }

    /// What lies outside is listed in the last cell on its side, next to whatever it was next to.
    fn cell(&self, x: &Vector3) -> [usize; 3] {
        let x = self.periodic.wrap(x) - self.origin;
        [0, 1, 2].map(|axis| {
            let place = (x[axis] / self.width[axis]).max(0.0);
            (place as usize).min(self.count[axis] - 1)
        })
    }

    fn index(&self, cell: [usize; 3]) -> usize {
        cell[0] + self.count[0] * (cell[1] + self.count[1] * cell[2])
    }
}
