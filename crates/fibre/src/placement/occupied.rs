//! The space taken by placed fibres: short pieces of their axes in cells.

use crate::contact::closest_points;
use crate::placement::{PlacementError, PlacementSettings};
use crate::{PeriodicBox, Vector3};

/// End of a cell's list.
const NONE: u32 = u32::MAX;
/// Cells per fibre: bounds the memory of dilute boxes.
const CELLS_PER_FIBRE: f64 = 64.0;

/// Pieces of placed fibres; a piece is listed in the cell of its middle, and reaches no further than the next cells.
pub(super) struct Occupied {
    periodic: PeriodicBox,
    low: Vector3,
    high: Vector3,
    /// Least distance of an axis from the low and high faces that do not repeat.
    wall: f64,
    /// Least distance of two axes.
    apart: f64,
    piece: f64,
    origin: Vector3,
    width: [f64; 3],
    cells: [usize; 3],
    /// First piece of every cell.
    first: Vec<u32>,
    /// Next piece in the same cell, of every piece.
    next: Vec<u32>,
    pieces: Vec<Piece>,
    trial: Vec<Piece>,
    wraps: bool,
}

#[derive(Clone, Copy)]
struct Piece {
    ends: [Vector3; 2],
}

impl Piece {
    fn middle(&self) -> Vector3 {
        0.5 * (self.ends[0] + self.ends[1])
    }
}

impl Occupied {
    pub fn new(settings: &PlacementSettings, fibres: usize) -> Result<Self, PlacementError> {
        let domain = &settings.domain;
        let periodic = domain.periodic_box();
        let apart = 2.0 * settings.radius + settings.gap;
        let least = 4.0 * apart;
        let mut shortest = f64::INFINITY;
        for (axis, length) in ['x', 'y', 'z'].into_iter().zip(periodic.lengths) {
            let length = length.unwrap_or(f64::INFINITY);
            if length < least {
                return Err(PlacementError::BoxTooSmall {
                    axis,
                    length,
                    radius: settings.radius,
                    least,
                });
            }
            shortest = shortest.min(length);
        }
        // Two cells at least round a periodic axis, so that two pieces meet through one image only.
        let sparse = (domain.size.product() / (CELLS_PER_FIBRE * fibres.max(1) as f64)).cbrt();
        let width = sparse.max(3.0 * apart).min(0.5 * shortest);
        let count = |axis: usize| ((domain.size[axis] / width) as usize).max(1);
        let cells = [count(0), count(1), count(2)];
        let nodes = settings
            .centre_line
            .nodes(settings.length, settings.segments);
        let span = nodes
            .iter()
            .map(|x| x.norm())
            .fold(0.0, |a: f64, b| a.max(b));
        Ok(Self {
            periodic,
            low: domain.origin,
            high: domain.origin + domain.size,
            wall: settings.radius + settings.wall_clearance,
            apart,
            piece: width - apart,
            origin: domain.origin,
            width: [0, 1, 2].map(|axis| domain.size[axis] / cells[axis] as f64),
            cells,
            first: vec![NONE; cells.iter().product()],
            next: Vec::new(),
            pieces: Vec::new(),
            trial: Vec::new(),
            wraps: 2.0 * span + apart > 0.5 * shortest,
        })
    }

    /// Takes the space of a fibre if it is free.
    pub fn try_insert(&mut self, nodes: &[Vector3]) -> bool {
        if !nodes.iter().all(|x| self.inside(x)) {
            return false;
        }
        self.cut(nodes);
        let taken =
            self.trial.iter().any(|piece| self.meets(piece)) || (self.wraps && self.meets_itself());
        if !taken {
            for piece in &self.trial {
                let cell = self.index(self.cell(&piece.middle()));
                self.next.push(self.first[cell]);
                self.first[cell] = self.pieces.len() as u32;
                self.pieces.push(*piece);
            }
        }
        !taken
    }

    fn inside(&self, x: &Vector3) -> bool {
        (0..3).all(|axis| {
            self.periodic.lengths[axis].is_some()
                || (x[axis] - self.low[axis] >= self.wall && self.high[axis] - x[axis] >= self.wall)
        })
    }

    /// Cuts the axis into pieces short enough for the cells.
    fn cut(&mut self, nodes: &[Vector3]) {
        self.trial.clear();
        for ends in nodes.windows(2) {
            let span = ends[1] - ends[0];
            let parts = (span.norm() / self.piece).ceil().max(1.0);
            let at = |k: usize| ends[0] + span * (k as f64 / parts);
            let pieces = (0..parts as usize).map(|k| Piece {
                ends: [at(k), at(k + 1)],
            });
            self.trial.extend(pieces);
        }
    }

    fn meets(&self, piece: &Piece) -> bool {
        let centre = self.cell(&piece.middle());
        let around = |axis: usize| {
            let cells = self.cells[axis];
            let (repeats, at) = (self.periodic.lengths[axis].is_some(), centre[axis]);
            // With two cells round the axis, the one before is the one after.
            let before = match at {
                0 if repeats && cells > 2 => Some(cells - 1),
                0 => None,
                _ if repeats && cells == 2 => None,
                _ => Some(at - 1),
            };
            let after = match at + 1 {
                next if next < cells => Some(next),
                _ if repeats && cells > 1 => Some(0),
                _ => None,
            };
            [before, Some(at), after].into_iter().flatten()
        };
        around(2).any(|k| {
            around(1).any(|j| around(0).any(|i| self.meets_in(self.index([i, j, k]), piece)))
        })
    }

    fn meets_in(&self, cell: usize, piece: &Piece) -> bool {
        let mut other = self.first[cell];
        while other != NONE {
            if self.too_near(piece, &self.pieces[other as usize]) {
                return true;
            }
            other = self.next[other as usize];
        }
        false
    }

    fn too_near(&self, a: &Piece, b: &Piece) -> bool {
        let shift = self.periodic.nearest_period(&(b.middle() - a.middle()));
        closest_points(&a.ends, &b.ends.map(|x| x - shift)).distance < self.apart
    }

    /// Whether the trial fibre is longer than the box and meets its own image.
    fn meets_itself(&self) -> bool {
        self.trial.iter().enumerate().any(|(n, a)| {
            self.trial[n + 1..].iter().any(|b| {
                let shift = self.periodic.nearest_period(&(b.middle() - a.middle()));
                shift != Vector3::zeros() && self.too_near(a, b)
            })
        })
    }

    fn cell(&self, x: &Vector3) -> [usize; 3] {
        let x = self.periodic.wrap(x) - self.origin;
        // The last cell also takes what rounding puts on the upper face.
        [0, 1, 2].map(|axis| ((x[axis] / self.width[axis]) as usize).min(self.cells[axis] - 1))
    }

    fn index(&self, cell: [usize; 3]) -> usize {
        cell[0] + self.cells[0] * (cell[1] + self.cells[1] * cell[2])
    }
}
