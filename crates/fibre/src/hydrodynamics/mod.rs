//! Hydrodynamic laws: force and torque per length on a fibre, and ambient flows given by formulae.
//!
//! Sources: K = Kunhappan 2018 (thesis, Grenoble), chapter 4, with the corrections stated at each law.

mod ambient;
mod cylinder;
mod drag;
mod slender;
mod spheroid;
mod torque;

pub use ambient::AmbientFlow;
pub(crate) use drag::larger;
pub use drag::{DragModel, DragResponse, Resistance};
pub use slender::SlenderConstants;
pub use spheroid::SpheroidRatio;
pub use torque::{TorqueLaw, TorqueModel, cox_aspect_ratio, spin};

/// The fluid around a fibre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FluidProperties {
    /// Density \[kg/m³\].
    pub density: f64,
    /// Dynamic viscosity \[Pa·s\].
    pub viscosity: f64,
}

/// What the laws need to know of the fibre at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Diameter d \[m\].
    pub diameter: f64,
    /// Length L of the whole fibre \[m\].
    pub fibre_length: f64,
    /// Length l of the segment \[m\].
    pub segment_length: f64,
    /// Place x along the fibre: −1 at its start, 1 at its end.
    pub place: f64,
}

/// ζ⊥ γ̇ L⁴/EI of a fibre in shear: viscous load by bending stiffness. A straight fibre buckles above
/// [`BUCKLING_FLEXIBILITY`] as it turns through the compressing quadrant.
pub fn flexibility(section: &Section, bending_stiffness: f64, viscosity: f64, rate: f64) -> f64 {
    let drag = SlenderConstants::Batchelor.resistance(section.aspect_ratio(), viscosity);
    drag.normal * rate.abs() * section.fibre_length.powi(4) / bending_stiffness
}

/// Twice the 153.2 of Becker & Shelley 2001 (Phys. Rev. Lett. 87, 198301), whose rate is that of the compression, γ̇/2; ζ⊥ = 2ζ∥.
pub const BUCKLING_FLEXIBILITY: f64 = 306.4;

impl Section {
    /// The middle of a fibre of one segment.
    pub fn middle(diameter: f64, fibre_length: f64) -> Self {
        Self {
            diameter,
            fibre_length,
            segment_length: fibre_length,
            place: 0.0,
        }
    }

    /// Aspect ratio r_p = L/d, at least 2: slender-body denominators vanish near r_p = 1.
    pub fn aspect_ratio(&self) -> f64 {
        (self.fibre_length / self.diameter).max(2.0)
    }
}
