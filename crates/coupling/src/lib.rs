//! Two-way coupling of fluid and fibres: locate, interpolate, spread, exchange.

mod adjacency;
mod anderson;
mod balance;
mod beads;
mod boxes;
mod circle;
mod closest;
mod coupling;
mod disturbance;
mod element;
mod error;
mod fetch;
mod gaussian;
mod kernel;
mod lattice;
mod locate;
mod pairs;
mod probes;
mod rendezvous;
mod response;
pub mod smooth_profile;
mod spread;

pub use anderson::Anderson;
pub use balance::FibreLoad;
pub use beads::{Bead, BeadSettings, Beads, Chain, RECORD};
pub use coupling::Coupling;
pub use disturbance::{PlaneWall, Undisturbed, Wake};
pub use error::CouplingError;
pub use kernel::Kernel;
pub use probes::{PointSet, PointValue, Probes};
pub use spread::SpreadReport;
