//! Settings of linked fibres.

use super::grips::Grips;
use super::walls::Piston;
use crate::contact::{Far, Repulsion, Wall};
use crate::hydrodynamics::SpheroidRatio;
use crate::{FibreError, PeriodicBox};

/// How a step is taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LinkedScheme {
    /// Scheme A: explicit, friction with the joint forces of the step before (S 2.9.2).
    #[default]
    Explicit,
    /// Scheme B: bending, twist and repulsion implicit, joints and friction solved together.
    Implicit,
}

/// Settings of linked fibres.
#[derive(Clone, Debug)]
pub struct LinkedSettings {
    /// How a step is taken.
    pub scheme: LinkedScheme,
    /// Dynamic viscosity of the fluid \[Pa·s\].
    pub viscosity: f64,
    /// The spheroid that stands for a segment; Switzer's is [`SpheroidRatio::Bretherton`].
    pub spheroid: SpheroidRatio,
    /// Repulsion, and the gap below which segments rub; none for fibres that pass through each other.
    pub repulsion: Option<Repulsion>,
    /// Static and kinetic coefficient of friction.
    pub friction: [f64; 2],
    /// Pairs nearer than this beyond the range of repulsion are kept between searches \[m\].
    pub skin: f64,
    /// Directions in which the domain repeats.
    pub periodic: PeriodicBox,
    /// Rate at which the box is sheared, that above moving along x \[1/s\] (Lees & Edwards 1972).
    pub shear_rate: f64,
    /// Planes that keep joints and ends of fibres on one side, by the repulsion between segments and without friction.
    pub walls: Vec<Wall>,
    /// A wall that a weight moves.
    pub piston: Option<Piston>,
    /// Planes that hold the fibres that cross them at the start.
    pub grips: Option<Grips>,
}

impl LinkedSettings {
    /// Fibres in an unbounded fluid of a dynamic `viscosity` \[Pa·s\] that pass through each other, with Switzer's spheroids; `skin` \[m\].
    pub fn new(scheme: LinkedScheme, viscosity: f64, skin: f64) -> Self {
        Self {
            scheme,
            viscosity,
            spheroid: SpheroidRatio::Bretherton,
            repulsion: None,
            friction: [0.0; 2],
            skin,
            periodic: PeriodicBox::unbounded(),
            shear_rate: 0.0,
            walls: Vec::new(),
            piston: None,
            grips: None,
        }
    }

    pub(super) fn check(&self) -> Result<(), FibreError> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let zero = |x: f64| x >= 0.0 && x.is_finite();
        let [at_rest, sliding] = self.friction;
        for (setting, value, good, requirement) in [
            (
                "fluid viscosity",
                self.viscosity,
                positive(self.viscosity),
                "positive",
            ),
            ("skin", self.skin, positive(self.skin), "positive"),
            (
                "static friction",
                at_rest,
                zero(at_rest),
                "zero or positive",
            ),
            (
                "kinetic friction",
                sliding,
                zero(sliding),
                "zero or positive",
            ),
            (
                "shear_rate",
                self.shear_rate,
                self.shear_rate == 0.0 || self.periodic.lengths[1].is_some(),
                "0 unless the box is periodic along y",
            ),
        ] {
            if !good {
                return Err(FibreError::Setting {
                    setting,
                    value,
                    requirement,
                });
            }
        }
        Far::new(self.repulsion, None, None)?;
        Ok(())
    }
}
