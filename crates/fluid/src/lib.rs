//! Incompressible finite-volume Navier–Stokes on node pairs: second order in space and time, skew-symmetric
//! convection, explicit or implicit diffusion, incremental projection with solenoidal pair fluxes.

mod boundary;
mod creeping;
mod diagnostics;
mod diffusion;
mod eddy;
mod error;
mod fluid;
pub mod initial;
mod inverse;
mod isolated;
mod loads;
mod measure;
mod mismatch;
mod operators;
mod phase;
mod poisson;
mod polynomial;
mod predict;
mod project;
mod rows;
mod settings;
mod spectrum;
mod state;
mod statistics;
mod sub_steps;
mod turbulence;

pub use boundary::{BoundaryCondition, Signal, TimeTable, VelocityProfile};
pub use creeping::{BodyLink, BodyMotion, BodyPart, BodyState, CreepingStep};
pub use diffusion::DiffusionChoice;
pub use eddy::{EddyModel, EddyViscosity};
pub use error::FluidError;
pub use fluid::{Fluid, StepReport};
pub use loads::PatchLoad;
pub use measure::KernelCost;
pub use phase::{FreeEnergy, PhaseField, PhaseReport, PhaseSettings, affinity};
pub use poisson::{PressureChoice, PressureReason, Projection};
pub use predict::Prediction;
pub use settings::{
    Diffusion, FluidSettings, Forcing, Inertia, Kernels, Mass, PressurePreconditioner, Projections,
};
pub use spectrum::EnergySpectrum;
pub use state::FluidState;
pub use statistics::{
    AROUND, Averaging, Column, Friction, LineSpectrum, Statistics, StatisticsReport,
    StatisticsSettings,
};
pub use turbulence::TurbulenceBudget;
