//! Helpers shared by the cross-crate tests.

pub mod checks;
pub mod coupled;
pub mod launch;
pub mod program;
pub mod state;
pub mod towed;
