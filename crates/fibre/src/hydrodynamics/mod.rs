//! Hydrodynamic laws: force and torque per length on a fibre, and ambient flows given by formulae.
//!
//! Sources: K = Kunhappan 2018 (thesis, Grenoble), chapter 4, with the corrections stated at each law.

mod ambient;
mod cylinder;
mod drag;
mod torque;

pub use ambient::AmbientFlow;
pub use drag::{DragModel, Resistance, SlenderConstants};
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
}

impl Section {
    /// Aspect ratio r_p = L/d, at least 2: slender-body denominators vanish near r_p = 1.
    pub fn aspect_ratio(&self) -> f64 {
        (self.fibre_length / self.diameter).max(2.0)
    }
}
