//! Fibres as beams: mechanics, contacts, placement, hydrodynamic laws, ambient flows.

pub mod hydrodynamics;
mod points;

pub use points::{Ambient, Reaction};
