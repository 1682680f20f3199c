//! Numbers that differ from fibre to fibre: lengths, stiffnesses.

use super::PlacementError;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A positive quantity, the same for all fibres or drawn for each. Means and deviations are those of the distribution
/// before it is cut to `min`…`max`.
#[derive(Clone, Debug, PartialEq)]
pub enum Quantity {
    /// The same for all.
    Constant(f64),
    /// Normal, cut.
    Normal {
        /// Mean.
        mean: f64,
        /// Standard deviation.
        deviation: f64,
        /// Smallest and largest value.
        range: [f64; 2],
    },
    /// Lognormal, cut.
    Lognormal {
        /// Mean of the quantity, not of its logarithm.
        mean: f64,
        /// Standard deviation of the quantity.
        deviation: f64,
        /// Smallest and largest value; 0 and infinity for no cut.
        range: [f64; 2],
    },
    /// Measured values, each used once in random order before any is used again.
    Values(Vec<f64>),
}

/// Standard deviations from the mean beyond which nothing is drawn.
const REACH: f64 = 6.0;

impl Quantity {
    /// A number the quantity is near to, before cutting: mean or constant.
    pub fn mean(&self) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Normal { mean, .. } | Self::Lognormal { mean, .. } => *mean,
            Self::Values(values) => values.iter().sum::<f64>() / values.len() as f64,
        }
    }

    /// The smallest value that can be drawn.
    pub fn smallest(&self) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Values(values) => values.iter().copied().fold(f64::INFINITY, f64::min),
            Self::Normal { .. } => self.bell()[2],
            Self::Lognormal { .. } => self.bell()[2].exp(),
        }
    }

    /// # Errors
    /// [`PlacementError::Setting`] when nothing, or nothing positive, can be drawn.
    pub fn check(&self, name: &'static str) -> Result<(), PlacementError> {
        let check = |good: bool, value: f64, valid: &'static str| {
            let error = PlacementError::Setting { name, value, valid };
            if good { Ok(()) } else { Err(error) }
        };
        let positive = |value: f64| {
            let good = value > 0.0 && value.is_finite();
            check(good, value, "a positive number")
        };
        match self {
            Self::Constant(value) => positive(*value),
            Self::Values(values) => {
                check(!values.is_empty(), 0.0, "given by one value at least")?;
                values.iter().try_for_each(|v| positive(*v))
            }
            Self::Normal {
                mean,
                deviation,
                range,
            }
            | Self::Lognormal {
                mean,
                deviation,
                range,
            } => {
                positive(*mean)?;
                positive(*deviation)?;
                let lowest = matches!(self, Self::Lognormal { .. });
                let good = range[0] > 0.0 || (lowest && range[0] == 0.0);
                check(good, range[0], "cut at a positive number")?;
                check(
                    range[1] > range[0],
                    range[1],
                    "cut above its smallest value",
                )?;
                let [_, _, low, high] = self.bell();
                let valid = "within six standard deviations of its mean";
                check(low < high, range[0], valid)
            }
        }
    }

    /// As many values, which depend on `seed` and `stream` only, of a quantity that has been checked.
    pub fn draw(&self, count: usize, seed: u64, stream: u64) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // Other streams than those of the places.
        random.set_stream(!stream);
        let mut draws = Draws::new(self);
        (0..count).map(|_| draws.next(&mut random)).collect()
    }

    /// Mean, deviation and range of the normal distribution that is behind, in the logarithm for a lognormal one.
    fn bell(&self) -> [f64; 4] {
        let (m, s, range) = match self {
            Self::Normal {
                mean,
                deviation,
                range,
            } => (*mean, *deviation, *range),
            Self::Lognormal {
                mean,
                deviation,
                range,
            } => {
                let square = (deviation / mean).powi(2).ln_1p();
                let middle = mean.ln() - 0.5 * square;
                (middle, square.sqrt(), range.map(f64::ln))
            }
            Self::Constant(_) | Self::Values(_) => (0.0, 0.0, [0.0; 2]),
        };
        [
            m,
            s,
            range[0].max(m - REACH * s),
            range[1].min(m + REACH * s),
        ]
    }
}

/// Draws a quantity again and again.
pub(super) struct Draws<'a> {
    quantity: &'a Quantity,
    /// Measured values that are not yet used in this round.
    left: Vec<f64>,
}

impl<'a> Draws<'a> {
    /// Of a quantity that has been checked.
    pub fn new(quantity: &'a Quantity) -> Self {
        Self {
            quantity,
            left: Vec::new(),
        }
    }

    /// The next one.
    pub fn next(&mut self, random: &mut ChaCha8Rng) -> f64 {
        match self.quantity {
            Quantity::Constant(value) => *value,
            Quantity::Normal { .. } => self.normal(random),
            Quantity::Lognormal { .. } => self.normal(random).exp(),
            Quantity::Values(values) => {
                if self.left.is_empty() {
                    self.left.clone_from(values);
                }
                let chosen = random.random_range(0..self.left.len());
                self.left.swap_remove(chosen)
            }
        }
    }

    /// By rejection below the curve: one in five is kept at worst, unless the cut is far out in the tail.
    fn normal(&self, random: &mut ChaCha8Rng) -> f64 {
        let [mean, deviation, low, high] = self.quantity.bell();
        let square = |x: f64| ((x - mean) / deviation).powi(2);
        let peak = square(mean.clamp(low, high));
        loop {
            let x = low + (high - low) * random.random::<f64>();
            if random.random::<f64>() < (0.5 * (peak - square(x))).exp() {
                return x;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(quantity: &Quantity, count: usize) -> Vec<f64> {
        quantity.check("length").expect("usable");
        quantity.draw(count, 3, 0)
    }

    fn moments(values: &[f64]) -> [f64; 2] {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
        [mean, square.sqrt()]
    }

    #[test]
    fn samples_have_mean_deviation_and_range() {
        let range = [1e-3, 20.0];
        let (mean, deviation) = (4.0, 0.5);
        for quantity in [
            Quantity::Normal {
                mean,
                deviation,
                range,
            },
            Quantity::Lognormal {
                mean,
                deviation,
                range,
            },
        ] {
            let [m, s] = moments(&drawn(&quantity, 40_000));
            assert!((m - 4.0).abs() < 0.01 && (s - 0.5).abs() < 0.01, "{m} {s}");
        }
        // Cut at one deviation on both sides: σ² (1 − 2φ(1)/(2Φ(1) − 1)).
        let cut = Quantity::Normal {
            mean,
            deviation,
            range: [3.5, 4.5],
        };
        let values = drawn(&cut, 40_000);
        let [m, s] = moments(&values);
        assert!(
            (m - 4.0).abs() < 0.01 && (s - 0.5 * 0.5396).abs() < 0.005,
            "{m} {s}"
        );
        assert!(values.iter().all(|v| (3.5..=4.5).contains(v)));
        assert_eq!(cut.smallest(), 3.5);
    }

    #[test]
    fn measured_values_are_all_used_before_any_is_used_again() {
        let mut values = drawn(&Quantity::Values(vec![1.0, 2.0, 3.0, 5.0]), 8);
        values.sort_by(f64::total_cmp);
        assert_eq!(values, [1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 5.0, 5.0]);
    }

    #[test]
    fn unusable_quantities_are_refused() {
        let refused = |quantity: Quantity| {
            let error = quantity.check("length").expect_err("refused");
            assert!(error.to_string().contains("length"), "{error}");
        };
        refused(Quantity::Constant(0.0));
        refused(Quantity::Constant(f64::NAN));
        refused(Quantity::Values(Vec::new()));
        refused(Quantity::Values(vec![1.0, -1.0]));
        let (mean, deviation) = (1.0, 0.1);
        for range in [[0.0, 2.0], [1.2, 1.1], [2.0, 3.0]] {
            refused(Quantity::Normal {
                mean,
                deviation,
                range,
            });
        }
    }
}
