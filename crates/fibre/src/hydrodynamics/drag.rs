//! Drag force per length of a fibre.

use super::spheroid::SpheroidRatio;
use super::{FluidProperties, Section, SlenderConstants, cylinder};
use nalgebra::{Matrix3, Vector3};

/// Which law gives the drag per length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DragModel {
    /// No drag.
    None,
    /// Local slender-body theory: Re_d < 1e-2, r_p > 10.
    SlenderBody(SlenderConstants),
    /// Infinite cylinder, Re_d > 1e-2 (K 4.21–4.23, corrected).
    InfiniteCylinder,
    /// The larger of slender body and infinite cylinder, by the Reynolds number of the normal slip.
    /// The outer length of slender-body theory is min(L, ν/U) (Khayat & Cox 1989), whence the larger one.
    Auto(SlenderConstants),
    /// Every segment as a prolate spheroid in creeping flow (K 4.11).
    ProlateSpheroid(SpheroidRatio),
}

impl Default for DragModel {
    fn default() -> Self {
        Self::Auto(SlenderConstants::default())
    }
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

    /// The tensor normal (I − tt) + axial tt.
    pub fn tensor(&self, tangent: &Vector3<f64>) -> Matrix3<f64> {
        Matrix3::from_diagonal_element(self.normal)
            + tangent * tangent.transpose() * (self.axial - self.normal)
    }

    /// Derivative of [`Resistance::force`] by the tangent at constant resistances.
    pub fn turning(&self, tangent: &Vector3<f64>, slip: &Vector3<f64>) -> Matrix3<f64> {
        let turned = Matrix3::from_diagonal_element(tangent.dot(slip)) + tangent * slip.transpose();
        turned * (self.axial - self.normal)
    }
}

/// Drag per length and its derivatives. With n the normal slip and ζ' = (dζ/d|n|)/|n|, which stays finite as n vanishes,
/// δf = Z δs + (∂(Z s)/∂t at constant ζ) δt + (ζ⊥' n + ζ∥' (t·s) t) (n·δs − (t·s) n·δt).
#[derive(Clone, Copy, Debug)]
pub struct DragResponse {
    /// ζ⊥ and ζ∥.
    pub resistance: Resistance,
    /// ∂f/∂slip \[N·s/m²\].
    pub by_slip: Matrix3<f64>,
    /// ∂f/∂t for changes across the tangent \[N/m\].
    pub by_tangent: Matrix3<f64>,
}

impl DragModel {
    /// Resistance per length at this slip \[m/s\]; finite and C¹ in the slip, also where its normal part vanishes.
    pub fn resistance(
        self,
        tangent: &Vector3<f64>,
        slip: &Vector3<f64>,
        section: &Section,
        fluid: &FluidProperties,
    ) -> Resistance {
        self.law(tangent, slip, section, fluid).0
    }

    /// The drag per length and its exact derivatives.
    pub fn response(
        self,
        tangent: &Vector3<f64>,
        slip: &Vector3<f64>,
        section: &Section,
        fluid: &FluidProperties,
    ) -> DragResponse {
        let (resistance, slope) = self.law(tangent, slip, section, fluid);
        let along = tangent.dot(slip);
        let normal = slip - tangent * along;
        let steeper = normal * slope.normal + tangent * (along * slope.axial);
        let by_speed = steeper * normal.transpose();
        DragResponse {
            resistance,
            by_slip: resistance.tensor(tangent) + by_speed,
            by_tangent: resistance.turning(tangent, slip) - by_speed * along,
        }
    }

    /// Whether a fibre of one thickness has the same resistance all along, whatever the slip.
    pub(crate) fn uniform(self) -> bool {
        match self {
            Self::None => true,
            Self::SlenderBody(constants) => constants != SlenderConstants::Ends,
            Self::InfiniteCylinder | Self::Auto(_) | Self::ProlateSpheroid(_) => false,
        }
    }

    /// What the slender-body part of the law has for a slip that is linear along a straight fibre, where that is another
    /// resistance.
    pub fn linear_part(self, aspect_ratio: f64, viscosity: f64) -> Option<Resistance> {
        match self {
            Self::SlenderBody(constants) | Self::Auto(constants) => {
                constants.linear_part(aspect_ratio, viscosity)
            }
            Self::None | Self::InfiniteCylinder | Self::ProlateSpheroid(_) => None,
        }
    }

    /// Resistances and their derivatives by the speed of the normal slip, over that speed.
    fn law(
        self,
        tangent: &Vector3<f64>,
        slip: &Vector3<f64>,
        section: &Section,
        fluid: &FluidProperties,
    ) -> (Resistance, Resistance) {
        let mu = fluid.viscosity;
        let cylinder = || {
            let normal_slip = slip - tangent.dot(slip) * tangent;
            let by_speed = fluid.density * section.diameter / mu;
            let re = by_speed * normal_slip.norm();
            let (value, slope) = cylinder::coefficients(re);
            // d ln √(Re² + Re_0²) = Re dRe/(Re² + Re_0²)
            let rate = 0.5 * mu * (by_speed / cylinder::regular(re)).powi(2);
            let resistance = Resistance {
                normal: 0.5 * mu * value.normal,
                axial: 0.5 * mu * value.axial,
            };
            let slope = Resistance {
                normal: rate * slope.normal,
                axial: rate * slope.axial,
            };
            (resistance, slope)
        };
        let constant = |resistance| (resistance, Resistance::default());
        match self {
            Self::None => constant(Resistance::default()),
            Self::SlenderBody(constants) => constant(constants.resistance_at(section, mu)),
            Self::InfiniteCylinder => cylinder(),
            Self::Auto(constants) => {
                let slender = constants.resistance_at(section, mu);
                let (cylinder, slope) = cylinder();
                let normal = larger(slender.normal, cylinder.normal);
                let axial = larger(slender.axial, cylinder.axial);
                let resistance = Resistance {
                    normal: normal.0,
                    axial: axial.0,
                };
                let slope = Resistance {
                    normal: normal.1 * slope.normal,
                    axial: axial.1 * slope.axial,
                };
                (resistance, slope)
            }
            Self::ProlateSpheroid(ratio) => {
                let [axial, normal] = ratio.drag(section, mu);
                constant(Resistance { normal, axial })
            }
        }
    }
}

/// Maximum of two positive numbers, C¹, and its derivative by `b`: exact when they differ by more than 10 % of their
/// mean, else at most 2.5 % above.
pub(crate) fn larger(a: f64, b: f64) -> (f64, f64) {
    const WIDTH: f64 = 0.1;
    let mean = 0.5 * (a + b);
    let excess = (b - a) / mean;
    if excess.abs() >= WIDTH {
        if a > b { (a, 0.0) } else { (b, 1.0) }
    } else {
        let square = excess * excess;
        let value = mean * (1.0 + (square + WIDTH * WIDTH) / (4.0 * WIDTH));
        let slope = 0.5 + (2.0 * excess - 0.5 * square + 0.5 * WIDTH * WIDTH) / (4.0 * WIDTH);
        (value, slope)
    }
}

#[cfg(test)]
mod tests;
