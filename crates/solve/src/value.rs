//! What a field holds at a node: a number, or a vector in four lanes.

use fibreflow_parallel::Portable;

/// Entry of a field: `f64`, or `[f64; 4]` (x, y, z, 0).
pub trait Value: Portable + PartialEq + std::fmt::Debug {
    /// Numbers in an entry.
    const WIDTH: usize;
    /// The zero entry.
    const ZERO: Self;

    /// self · factor.
    fn scaled(self, factor: f64) -> Self;

    /// self + factor · other.
    fn plus(self, factor: f64, other: Self) -> Self;
}

impl Value for f64 {
    const WIDTH: usize = 1;
    const ZERO: Self = 0.0;

    #[inline(always)]
    fn scaled(self, factor: f64) -> Self {
        self * factor
    }

    #[inline(always)]
    fn plus(self, factor: f64, other: Self) -> Self {
        self + factor * other
    }
}

impl Value for [f64; 4] {
    const WIDTH: usize = 4;
    const ZERO: Self = [0.0; 4];

    #[inline(always)]
    fn scaled(self, factor: f64) -> Self {
        self.map(|v| v * factor)
    }

    #[inline(always)]
    fn plus(self, factor: f64, other: Self) -> Self {
        [
            self[0] + factor * other[0],
            self[1] + factor * other[1],
            self[2] + factor * other[2],
            self[3] + factor * other[3],
        ]
    }
}
