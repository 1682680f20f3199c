//! Resistances of slender-body theory in creeping flow.
//!
//! With x = 2s/L from the middle, a fibre of constant radius obeys to second order (Batchelor 1970, Keller & Rubinow 1976)
//!
//! ```text
//! 8πμ u⊥ = f⊥ (2 ln 2r_p + ln(1 − x²) + 1) + ∫ (f⊥(x') − f⊥(x))/|x' − x| dx'
//! 4πμ u∥ = f∥ (2 ln 2r_p + ln(1 − x²) − 1) + ∫ (f∥(x') − f∥(x))/|x' − x| dx'
//! ```
//!
//! The integral vanishes for a constant force and is −2f for one that is linear in x. Averaged over the length, or over
//! x² for the moment, this gives ln 2r_p + c with
//!
//! | | c⊥ | c∥ |
//! |---|---|---|
//! | constant slip | ln 2 − 1/2 | ln 2 − 3/2 |
//! | slip linear in x | ln 2 − 11/6 | ln 2 − 17/6 |

use super::{Resistance, Section};
use std::f64::consts::{LN_2, PI};

/// Constants of slender-body theory: f∥ = 2πμ/(ln 2r_p + c∥) slip∥, f⊥ = 4πμ/(ln 2r_p + c⊥) slip⊥.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum SlenderConstants {
    /// Batchelor's for a constant slip, at every point by itself: c∥ = ln 2 − 3/2, c⊥ = ln 2 − 1/2.
    #[default]
    Batchelor,
    /// As printed with K 6.5: ln 2 − 3/2 for both.
    Kunhappan,
    /// Batchelor's, and in the part of the slip that is linear along a straight fibre c∥ = ln 2 − 17/6, c⊥ = ln 2 − 11/6.
    Split,
    /// As `Split`, with ½ ln(1 − x² + 1/r_p) in place of its mean ln 2 − 1: more drag near the ends.
    Ends,
}

/// Aspect ratio below which c of the linear part is no longer followed: the axial denominator vanishes at 4.3.
const SHORTEST_LINEAR: f64 = 10.0;

fn resistance(logarithm: f64, normal: f64, axial: f64, viscosity: f64) -> Resistance {
    Resistance {
        normal: 4.0 * PI * viscosity / (logarithm + normal),
        axial: 2.0 * PI * viscosity / (logarithm + axial),
    }
}

impl SlenderConstants {
    /// Resistance per length \[N·s/m²\] to a slip that is the same along the fibre.
    pub fn resistance(self, aspect_ratio: f64, viscosity: f64) -> Resistance {
        let axial = LN_2 - 1.5;
        let normal = match self {
            Self::Kunhappan => axial,
            Self::Batchelor | Self::Split | Self::Ends => LN_2 - 0.5,
        };
        resistance((2.0 * aspect_ratio).ln(), normal, axial, viscosity)
    }

    /// Resistance per length of the point.
    pub(super) fn resistance_at(self, section: &Section, viscosity: f64) -> Resistance {
        let ratio = section.aspect_ratio();
        if self != Self::Ends {
            return self.resistance(ratio, viscosity);
        }
        let end = 1.0 - section.place * section.place + 1.0 / ratio;
        resistance((2.0 * ratio).ln() + 0.5 * end.ln(), 0.5, -0.5, viscosity)
    }

    /// Resistance per length to a slip that is linear along a straight fibre, where it is not [`Self::resistance`].
    pub fn linear_part(self, aspect_ratio: f64, viscosity: f64) -> Option<Resistance> {
        let logarithm = (2.0 * aspect_ratio.max(SHORTEST_LINEAR)).ln();
        let [normal, axial] = [LN_2 - 11.0 / 6.0, LN_2 - 17.0 / 6.0];
        match self {
            Self::Batchelor | Self::Kunhappan => None,
            Self::Split | Self::Ends => Some(resistance(logarithm, normal, axial, viscosity)),
        }
    }

    /// Torque on a straight fibre that turns across its axis, by ω L³/12 \[N·s/m²\].
    pub(super) fn rotation(self, aspect_ratio: f64, viscosity: f64) -> f64 {
        let linear = self.linear_part(aspect_ratio, viscosity);
        linear
            .unwrap_or_else(|| self.resistance(aspect_ratio, viscosity))
            .normal
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_by_hand() {
        // r_p = 50: 4πμ/(ln 100 + ln 2 − ½), 2πμ/(ln 100 + ln 2 − 3/2)
        let r = SlenderConstants::Batchelor.resistance(50.0, 1.0);
        assert!((r.normal - 4.0 * PI / 4.798317367).abs() < 1e-8);
        assert!((r.axial - 2.0 * PI / 3.798317367).abs() < 1e-8);
        let k = SlenderConstants::Kunhappan.resistance(50.0, 1.0);
        assert!((k.normal - 2.0 * k.axial).abs() < 1e-14);
        assert!((k.normal - 4.0 * PI / (100.0_f64.ln() - 0.806853)).abs() < 1e-5);
    }

    /// Local drag has 0.58, 0.72, 0.78 of the rotational resistance at r_p = 10, 50, 200.
    #[test]
    fn rotation_meets_more_resistance_than_local_drag() {
        for (r_p, expected) in [(10.0, 0.58), (50.0, 0.72), (200.0, 0.78)] {
            let local = SlenderConstants::Batchelor.rotation(r_p, 1.0);
            let ratio = local / SlenderConstants::Split.rotation(r_p, 1.0);
            assert!((ratio - expected).abs() < 0.006, "{r_p}: {ratio}");
        }
    }

    /// Ends change where the drag acts, and its sum at second order in 1/ln 2r_p only.
    #[test]
    fn drag_near_the_ends_sums_to_the_mean_constants() {
        let mut differences = Vec::new();
        for r_p in [20.0, 200.0, 2000.0] {
            let mean = SlenderConstants::Ends.resistance(r_p, 1.0);
            let (n, mut sum) = (20_000, 0.0);
            for k in 0..n {
                let place = 2.0 * (f64::from(k) + 0.5) / f64::from(n) - 1.0;
                let section = Section {
                    place,
                    ..Section::middle(1.0, r_p)
                };
                let r = SlenderConstants::Ends.resistance_at(&section, 1.0);
                assert!(r.normal > r.axial && r.axial > 0.0);
                sum += r.normal / f64::from(n);
            }
            differences.push((sum / mean.normal - 1.0).abs());
        }
        assert!(differences[0] < 0.02, "{differences:?}");
        assert!(
            differences[2] < 0.006 && differences[1] < differences[0],
            "{differences:?}"
        );
    }
}
