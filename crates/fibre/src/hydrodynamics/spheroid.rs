//! Segments as prolate spheroids (K 4.11–4.14; Kim & Karrila 1991): for comparison only, as forces depend on the number
//! of segments.

use super::Section;
use std::f64::consts::PI;

/// Aspect ratio r_e of the spheroid that stands for a cylindrical segment of aspect ratio l/d.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum SpheroidRatio {
    /// r_e = 0.7 l/d (Bretherton; K 4.13g), at least a sphere's.
    Bretherton,
    /// r_e = 1.24 (l/d)/√ln(l/d), the diameter of K 4.14 (Cox). It has a minimum at l/d = √e, which shorter segments get:
    /// the formula has no meaning there.
    #[default]
    Cox,
}

/// Resistance functions of K 4.13, Y^C with e³.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Functions {
    /// X^A, Y^A: force by slip along and across, by 6πμa.
    pub force: [f64; 2],
    /// X^C, Y^C: torque by spin about and across the axis, by 8πμa³.
    pub spin: [f64; 2],
    /// Y^H: torque by strain, by 8πμa³.
    pub strain: f64,
}

/// Eccentricity below which a spheroid is taken for one of this eccentricity: the functions are 0/0 at the sphere.
const LEAST_ECCENTRICITY: f64 = 0.05;

impl SpheroidRatio {
    fn ratio(self, segment: f64) -> f64 {
        match self {
            Self::Bretherton => 0.7 * segment,
            Self::Cox => {
                let r = segment.max(0.5_f64.exp());
                1.24 * r / r.ln().sqrt()
            }
        }
    }

    pub(crate) fn functions(self, section: &Section) -> Functions {
        let ratio = self
            .ratio(section.segment_length / section.diameter)
            .max(1.0);
        let e = (1.0 - 1.0 / (ratio * ratio)).sqrt().max(LEAST_ECCENTRICITY);
        let (e2, e3) = (e * e, e * e * e);
        let log = ((1.0 + e) / (1.0 - e)).ln();
        let long = -2.0 * e + (1.0 + e2) * log;
        Functions {
            force: [
                8.0 / 3.0 * e3 / long,
                16.0 / 3.0 * e3 / (2.0 * e + (3.0 * e2 - 1.0) * log),
            ],
            spin: [
                4.0 / 3.0 * e3 * (1.0 - e2) / (2.0 * e - (1.0 - e2) * log),
                4.0 / 3.0 * e3 * (2.0 - e2) / long,
            ],
            strain: 4.0 / 3.0 * e3 * e2 / long,
        }
    }

    /// Resistances to slip by length along and across the axis, 3πμ X^A and 3πμ Y^A \[N·s/m²\].
    pub(super) fn drag(self, section: &Section, viscosity: f64) -> [f64; 2] {
        self.functions(section)
            .force
            .map(|x| 3.0 * PI * viscosity * x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn functions(ratio: f64) -> Functions {
        let section = Section {
            segment_length: ratio / 0.7,
            ..Section::middle(1.0, 100.0)
        };
        SpheroidRatio::Bretherton.functions(&section)
    }

    /// Stokes' 6πμa and 8πμa³ of the sphere.
    #[test]
    fn a_sphere_has_stokes_drag_and_torque() {
        let f = functions(1.0);
        for x in [f.force, f.spin].concat() {
            assert!((x - 1.0).abs() < 4e-3, "{f:?}");
        }
        assert!(f.strain < 3e-3);
    }

    /// X^A → (4/3)/(2 ln 2r − 1), Y^A → (8/3)/(2 ln 2r + 1), Y^C → (2/3)/(2 ln 2r − 1) (Kim & Karrila, table 3.3).
    #[test]
    fn a_needle_has_the_slender_limits() {
        let f = functions(1e3);
        let log = 2.0 * 2e3_f64.ln();
        let expected = [
            (f.force[0], 4.0 / 3.0 / (log - 1.0)),
            (f.force[1], 8.0 / 3.0 / (log + 1.0)),
            (f.spin[0], 2.0 / 3.0 * 1e-6),
            (f.spin[1], 2.0 / 3.0 / (log - 1.0)),
        ];
        for (found, expected) in expected {
            assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
        }
    }

    /// Y^H/Y^C = (r² − 1)/(r² + 1): Jeffery's orbit. With e² in Y^C (as K 4.13d prints it) this fails.
    #[test]
    fn a_free_spheroid_turns_as_jeffery_says() {
        for ratio in [1.5, 3.0, 20.0_f64] {
            let f = functions(ratio);
            let expected = (ratio * ratio - 1.0) / (ratio * ratio + 1.0);
            assert!((f.strain / f.spin[1] - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn equivalent_ratios_by_hand() {
        assert_eq!(SpheroidRatio::Bretherton.ratio(10.0), 7.0);
        assert!((SpheroidRatio::Cox.ratio(10.0) - 8.1717).abs() < 1e-4);
        // ln √e = ½: 1.24 √(2e).
        assert!((SpheroidRatio::Cox.ratio(0.3) - 2.8912).abs() < 1e-4);
    }
}
