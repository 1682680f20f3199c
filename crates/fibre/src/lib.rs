//! Fibres as beams: mechanics, contacts, placement, hydrodynamic laws, ambient flows.
//!
//! A [`Fibre`] describes one fibre; a [`FibreSystem`] holds the nodes of all fibres of a rank in flat arrays and
//! advances them in time. The mechanics are those of [`beam`] (an element derived from an energy of total strains) and
//! of a sub-cycled drift–kick–drift integrator; the flow acts through the laws of [`hydrodynamics`].

pub mod beam;
pub mod contact;
pub mod hydrodynamics;
pub mod linked;
pub mod placement;

mod blocktri;
mod breakage;
mod carried;
mod drag;
mod error;
mod implicit;
mod integrate;
mod lanes;
mod linear_slip;
mod migrate;
mod observe;
mod periodic;
mod points;
mod repeat;
mod shape;
mod state;
mod symmetric;
mod system;
mod touching;

pub use drag::Hydrodynamics;
pub use error::FibreError;
pub use implicit::{ImplicitSettings, Integrator};
pub use observe::{Budget, Energy, FOURTH, Histogram, Inside, OrientationMoments, Shear};
pub use periodic::PeriodicBox;
pub use points::{Ambient, FlowFormula, Points, Reaction};
pub use repeat::Saved;
pub use shape::{Equilibrium, Fibre, Kinematics, Material, Support};
pub use state::{FibreRecord, FibreState};
pub use system::{FibreSettings, FibreSystem};

/// A vector in space.
pub type Vector3 = nalgebra::Vector3<f64>;
/// A 3×3 matrix.
pub type Matrix3 = nalgebra::Matrix3<f64>;
/// A rotation. Node frames map body axes to space; the body x axis is the fibre's tangent.
pub type Quaternion = nalgebra::UnitQuaternion<f64>;
