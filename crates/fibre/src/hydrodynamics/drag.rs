//! Drag force per length of a fibre.

use super::{FluidProperties, Section, cylinder};
use nalgebra::Vector3;
use std::f64::consts::{LN_2, PI};

/// Constants of local slender-body theory (K 6.5): f∥ = 2πμ/(ln 2r_p + c∥) slip∥, f⊥ = 4πμ/(ln 2r_p + c⊥) slip⊥.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum SlenderConstants {
    /// Batchelor 1970: c∥ = ln 2 − 3/2, c⊥ = ln 2 − 1/2.
    #[default]
    Batchelor,
    /// As printed with K 6.5: ln 2 − 3/2 for both.
    Kunhappan,
}

impl SlenderConstants {
    /// Resistance per length at zero Reynolds number.
    pub fn resistance(self, aspect_ratio: f64, viscosity: f64) -> Resistance {
        let axial = LN_2 - 1.5;
        let normal = match self {
            Self::Batchelor => LN_2 - 0.5,
            Self::Kunhappan => axial,
        };
        let logarithm = (2.0 * aspect_ratio).ln();
        Resistance {
            normal: 4.0 * PI * viscosity / (logarithm + normal),
            axial: 2.0 * PI * viscosity / (logarithm + axial),
        }
    }
}

/// Which law gives the drag per length.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum DragModel {
    /// No drag.
    None,
    /// Local slender-body theory: Re_d < 1e-2, r_p > 10.
    SlenderBody(SlenderConstants),
    /// Infinite cylinder, Re_d > 1e-2 (K 4.21–4.23, corrected).
    InfiniteCylinder,
    /// The larger of slender body (Batchelor) and infinite cylinder, by the Reynolds number of the normal slip.
    /// The outer length of slender-body theory is min(L, ν/U) (Khayat & Cox 1989), whence the larger one.
    #[default]
    Auto,
}

/// Drag per length f = (normal (I − tt) + axial tt)·slip, both \[N·s/m²\].
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Resistance {
    /// Across the fibre.
    pub normal: f64,
    /// Along the fibre.
    pub axial: f64,
}

impl Resistance {
    /// Force per length \[N/m\] on a fibre with unit tangent `tangent` and slip = fluid − fibre velocity \[m/s\].
    pub fn force(&self, tangent: &Vector3<f64>, slip: &Vector3<f64>) -> Vector3<f64> {
        self.normal * slip + (self.axial - self.normal) * tangent.dot(slip) * tangent
    }
}

impl DragModel {
    /// Resistance per length at this slip \[m/s\]; finite and C¹ in the slip, also where its normal part vanishes.
    pub fn resistance(
        &self,
        tangent: &Vector3<f64>,
        slip: &Vector3<f64>,
        section: &Section,
        fluid: &FluidProperties,
    ) -> Resistance {
        let mu = fluid.viscosity;
        let cylinder = || {
            let normal_slip = slip - tangent.dot(slip) * tangent;
            let re = fluid.density * section.diameter * normal_slip.norm() / mu;
            let c = cylinder::coefficients(re);
            Resistance {
                normal: 0.5 * mu * c.normal,
                axial: 0.5 * mu * c.axial,
            }
        };
        match self {
            Self::None => Resistance::default(),
            Self::SlenderBody(constants) => constants.resistance(section.aspect_ratio(), mu),
            Self::InfiniteCylinder => cylinder(),
            Self::Auto => {
                let slender = SlenderConstants::Batchelor.resistance(section.aspect_ratio(), mu);
                let cylinder = cylinder();
                Resistance {
                    normal: larger(slender.normal, cylinder.normal),
                    axial: larger(slender.axial, cylinder.axial),
                }
            }
        }
    }
}

/// Maximum of two positive numbers, C¹: exact when they differ by more than 10 % of their mean, else at most 2.5 % above.
fn larger(a: f64, b: f64) -> f64 {
    const WIDTH: f64 = 0.1;
    let mean = 0.5 * (a + b);
    let difference = (a - b).abs();
    if difference >= WIDTH * mean {
        a.max(b)
    } else {
        mean + (difference * difference / mean + WIDTH * WIDTH * mean) / (4.0 * WIDTH)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WATER: FluidProperties = FluidProperties {
        density: 1000.0,
        viscosity: 1e-3,
    };
    const SECTION: Section = Section {
        diameter: 2e-5,
        fibre_length: 1e-3,
    };

    const ALL: [DragModel; 4] = [
        DragModel::SlenderBody(SlenderConstants::Batchelor),
        DragModel::SlenderBody(SlenderConstants::Kunhappan),
        DragModel::InfiniteCylinder,
        DragModel::Auto,
    ];

    fn force(model: DragModel, slip: Vector3<f64>) -> Vector3<f64> {
        let t = Vector3::new(0.6, 0.0, 0.8);
        model
            .resistance(&t, &slip, &SECTION, &WATER)
            .force(&t, &slip)
    }

    /// Normal slip that gives this Reynolds number.
    fn normal_slip(re: f64) -> Vector3<f64> {
        Vector3::new(
            0.0,
            re * WATER.viscosity / (WATER.density * SECTION.diameter),
            0.0,
        )
    }

    #[test]
    fn slender_body_by_hand() {
        // r_p = 50: 4πμ/(ln 100 + ln 2 − ½), 2πμ/(ln 100 + ln 2 − 3/2)
        let r = SlenderConstants::Batchelor.resistance(50.0, 1.0);
        assert!((r.normal - 4.0 * PI / 4.798317367).abs() < 1e-8);
        assert!((r.axial - 2.0 * PI / 3.798317367).abs() < 1e-8);
        let k = SlenderConstants::Kunhappan.resistance(50.0, 1.0);
        assert!((k.normal - 2.0 * k.axial).abs() < 1e-14);
    }

    #[test]
    fn the_cylinder_law_gives_its_drag_coefficient() {
        for (re, c_n) in [(0.1, 58.31), (100.0, 1.4001)] {
            let slip = normal_slip(re);
            let f = force(DragModel::InfiniteCylinder, slip).norm();
            let c = f / (0.5 * WATER.density * SECTION.diameter * slip.norm_squared());
            assert!((c / c_n - 1.0).abs() < 1e-4, "Re {re}: {c}");
        }
    }

    #[test]
    fn drag_opposes_slip_and_is_larger_across() {
        for model in ALL {
            for re in [1e-8, 1e-4, 1e-2, 1.0, 50.0, 500.0] {
                let slip = normal_slip(re) + Vector3::new(0.003, 0.0, 0.001);
                assert!(force(model, slip).dot(&slip) > 0.0);
                let t = Vector3::z();
                let r = model.resistance(&t, &slip, &SECTION, &WATER);
                assert!(r.normal > r.axial && r.axial > 0.0, "{model:?} {re} {r:?}");
            }
        }
    }

    /// Pure axial slip has Re = 0: the force must neither vanish for `auto` nor jump when a normal slip appears.
    #[test]
    fn force_is_finite_and_smooth_where_the_normal_slip_vanishes() {
        let axial = 0.05 * Vector3::new(0.6, 0.0, 0.8);
        let slender = SlenderConstants::Batchelor.resistance(50.0, WATER.viscosity);
        let at_zero = force(DragModel::Auto, axial);
        assert!((at_zero.norm() - 0.05 * slender.axial).abs() < 1e-15);
        for model in ALL {
            assert!(force(model, Vector3::zeros()).norm() == 0.0);
            let centre = force(model, axial);
            let e = normal_slip(1e-9);
            let (up, down) = (force(model, axial + e), force(model, axial - e));
            assert!(
                ((up + down) * 0.5 - centre).norm() < 1e-6 * centre.norm(),
                "{model:?}"
            );
        }
    }

    /// Central differences of the force along the slip do not jump anywhere.
    #[test]
    fn auto_is_continuously_differentiable() {
        let ratio = 1.002_f64;
        let value = |re: f64| force(DragModel::Auto, normal_slip(re)).norm();
        let (mut re, mut last) = (1e-4, 1.0);
        while re < 1e3 {
            let slope = (value(re * ratio) / value(re)).ln() / ratio.ln();
            assert!(
                (slope - last).abs() < 1e-2,
                "kink at Re {re}: {last} {slope}"
            );
            last = slope;
            re *= ratio;
        }
    }

    #[test]
    fn auto_takes_the_larger_law() {
        for re in [1e-4, 1e-3, 0.1, 10.0, 300.0] {
            let slip = normal_slip(re);
            let laws = [ALL[0], ALL[2]].map(|m| force(m, slip).norm());
            let auto = force(DragModel::Auto, slip).norm();
            let largest = laws[0].max(laws[1]);
            assert!(
                auto >= largest && auto < 1.026 * largest,
                "{re}: {auto} {laws:?}"
            );
        }
    }
}
