//! Helpers shared by the cross-crate tests.

pub mod checks;
pub mod coupled;
