//! Which fibres a statistic counts.

use crate::Vector3;

/// A box with edges along the axes; fibres whose centre of mass is in it count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inside {
    /// Lowest coordinates \[m\]; −∞ where there is no limit.
    pub low: Vector3,
    /// Highest coordinates \[m\]; ∞ where there is no limit.
    pub high: Vector3,
}

impl Inside {
    /// All fibres count.
    pub const EVERYWHERE: Self = Self {
        low: Vector3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
        high: Vector3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
    };

    /// Whether a fibre with this centre counts.
    pub fn holds(&self, centre: &Vector3) -> bool {
        (0..3).all(|c| centre[c] >= self.low[c] && centre[c] <= self.high[c])
    }
}
