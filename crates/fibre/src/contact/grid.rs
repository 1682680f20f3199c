//! Cells that segments cover, in periodic and unbounded directions.

use crate::{PeriodicBox, Vector3};

/// Bits of a cell key per axis.
const BITS: u32 = 21;
const LIMIT: i64 = (1 << (BITS - 1)) - 1;

/// A lattice of equal cells; it wraps where the box is periodic.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellGrid {
    origin: Vector3,
    size: [f64; 3],
    /// Cells round a periodic axis.
    around: [Option<i64>; 3],
}

/// The block of cells that a box covers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cover {
    first: [i64; 3],
    count: [i64; 3],
    around: [Option<i64>; 3],
}

impl CellGrid {
    /// Cells at least `smallest` wide.
    pub fn new(periodic: &PeriodicBox, smallest: f64) -> Self {
        let around = periodic
            .lengths
            .map(|length| length.map(|l| ((l / smallest) as i64).clamp(1, LIMIT)));
        let width = |axis: usize| match (periodic.lengths[axis], around[axis]) {
            (Some(length), Some(cells)) => length / cells as f64,
            _ => smallest,
        };
        Self {
            origin: periodic.origin,
            size: [width(0), width(1), width(2)],
            around,
        }
    }

    /// Cells covered by the axis-aligned box of an axis, widened by `margin`; positions need not be wrapped.
    pub fn cover(&self, ends: &[Vector3; 2], margin: f64) -> Cover {
        let mut cover = Cover {
            first: [0; 3],
            count: [0; 3],
            around: self.around,
        };
        let (low, high) = (ends[0].inf(&ends[1]), ends[0].sup(&ends[1]));
        for axis in 0..3 {
            let index = |x: f64| ((x - self.origin[axis]) / self.size[axis]).floor() as i64;
            let (first, last) = (index(low[axis] - margin), index(high[axis] + margin));
            (cover.first[axis], cover.count[axis]) = match self.around[axis] {
                Some(n) if last.saturating_sub(first) >= n - 1 => (0, n),
                Some(n) => (first.rem_euclid(n), last - first + 1),
                None => {
                    let (first, last) = (first.clamp(-LIMIT, LIMIT), last.clamp(-LIMIT, LIMIT));
                    (first, last - first + 1)
                }
            };
        }
        cover
    }
}

impl Cover {
    /// Keys of all covered cells.
    pub fn keys(&self) -> impl Iterator<Item = u64> + '_ {
        let [nx, ny, nz] = self.count;
        (0..nz).flat_map(move |k| {
            (0..ny).flat_map(move |j| {
                (0..nx).map(move |i| key([self.cell(0, i), self.cell(1, j), self.cell(2, k)]))
            })
        })
    }

    /// Key of one cell that both blocks cover, the same for either order; `None` when they are apart.
    pub fn common(&self, other: &Self) -> Option<u64> {
        let mut cell = [0; 3];
        for axis in 0..3 {
            // Of two stretches that meet, one starts within the other.
            let (mine, theirs) = (self.first[axis], other.first[axis]);
            cell[axis] = match (other.holds(axis, mine), self.holds(axis, theirs)) {
                (true, true) => mine.min(theirs),
                (true, false) => mine,
                (false, true) => theirs,
                (false, false) => return None,
            };
        }
        Some(key(cell))
    }

    fn cell(&self, axis: usize, offset: i64) -> i64 {
        let cell = self.first[axis] + offset;
        match self.around[axis] {
            Some(n) if cell >= n => cell - n,
            _ => cell,
        }
    }

    /// Whether a cell, inside the period, is covered.
    fn holds(&self, axis: usize, cell: i64) -> bool {
        let offset = match (cell - self.first[axis], self.around[axis]) {
            (behind, Some(n)) if behind < 0 => behind + n,
            (offset, _) => offset,
        };
        (0..self.count[axis]).contains(&offset)
    }
}

fn key(cell: [i64; 3]) -> u64 {
    let part = |c: i64| (c + LIMIT) as u64;
    part(cell[0]) | part(cell[1]) << BITS | part(cell[2]) << (2 * BITS)
}

/// A well-mixed hash (the finaliser of SplitMix64).
pub(super) fn mix(key: u64) -> u64 {
    let mut z = key.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_across_the_seam_meets_the_blocks_on_both_sides() {
        let periodic = PeriodicBox {
            origin: Vector3::zeros(),
            lengths: [Some(10.0), None, None],
        };
        let grid = CellGrid::new(&periodic, 1.0);
        let axis = |x0: f64, x1: f64| [Vector3::new(x0, 0.5, 0.5), Vector3::new(x1, 0.5, 0.5)];
        let seam = grid.cover(&axis(9.5, 10.5), 0.1);
        assert_eq!(seam.keys().count(), 2);
        let (left, right) = (
            grid.cover(&axis(-1.5, -0.6), 0.1),
            grid.cover(&axis(20.2, 20.4), 0.1),
        );
        assert!(seam.common(&left).is_some() && seam.common(&right).is_some());
        assert_eq!(seam.common(&right), right.common(&seam));
        assert!(left.common(&right).is_none());
        assert!(seam.keys().any(|k| Some(k) == seam.common(&left)));
        assert_eq!(grid.cover(&axis(0.5, 40.0), 0.1).keys().count(), 10);
    }
}
