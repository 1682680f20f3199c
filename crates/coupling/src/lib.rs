//! Two-way coupling of fluid and fibres: locate, interpolate, spread, exchange.

mod adjacency;
mod balance;
mod boxes;
mod closest;
mod coupling;
mod element;
mod error;
mod gaussian;
mod kernel;
mod lattice;
mod locate;
mod rendezvous;
mod spread;

pub use balance::FibreLoad;
pub use coupling::Coupling;
pub use error::CouplingError;
pub use kernel::Kernel;
pub use spread::SpreadReport;
