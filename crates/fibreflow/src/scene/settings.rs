//! The settings of the solver, as the case file asks for them.

use super::boundary::Boundaries;
use crate::case::{self, CaseError};
use fibreflow_fluid::{
    Diffusion, EddyModel, EddyViscosity, FluidSettings, Forcing, Inertia, Kernels, Mass,
    PressurePreconditioner, Projections,
};
use fibreflow_solve::CgSettings;

/// What the solver is made with.
///
/// # Errors
/// Boundaries and signals that make no sense.
pub fn settings(
    boundaries: &Boundaries<'_>,
    patches: &[String],
    inertia: Inertia,
) -> Result<FluidSettings, Box<CaseError>> {
    let fluid = boundaries.fluid;
    let mut settings = FluidSettings::new(fluid.density, fluid.viscosity);
    settings.boundary = boundaries.conditions(patches)?;
    settings.forcing = match &fluid.forcing {
        case::Forcing::None => Forcing::default(),
        case::Forcing::PressureGradient { value, factor } => {
            if let Some(factor) = factor {
                settings.forcing_factor = boundaries.signal(factor, "fluid.forcing.factor")?;
            }
            Forcing::PressureGradient(*value)
        }
        case::Forcing::Linear { rate, energy } => Forcing::Linear {
            rate: *rate,
            energy: *energy,
        },
        case::Forcing::BulkVelocity { direction, value } => Forcing::BulkVelocity {
            direction: *direction,
            value: *value,
        },
    };
    settings.inertia = inertia;
    settings.turbulence = fluid.turbulence.as_ref().map(|turbulence| {
        let (model, usual) = match turbulence.model {
            case::TurbulenceModel::Smagorinsky => (EddyModel::Smagorinsky, 0.17),
            case::TurbulenceModel::Wale => (EddyModel::Wale, 0.5),
            case::TurbulenceModel::Sigma => (EddyModel::Sigma, 1.35),
        };
        let constant = turbulence.constant.unwrap_or(usual);
        EddyViscosity { model, constant }
    });
    settings.frame = fluid.frame_velocity;
    settings.hold_mean_velocity = fluid.hold_mean_velocity;
    settings.kernels = match fluid.kernels {
        case::Kernels::Auto => Kernels::Auto,
        case::Kernels::Rows => Kernels::Rows,
    };
    settings.diffusion = match fluid.diffusion {
        case::Diffusion::Auto => Diffusion::Auto,
        case::Diffusion::Explicit => Diffusion::Explicit,
        case::Diffusion::Implicit => Diffusion::Implicit,
    };
    settings.mass = match fluid.mass {
        case::Mass::Corrected => Mass::Corrected,
        case::Mass::Lumped => Mass::Lumped,
    };
    settings.pressure = CgSettings {
        relative_tolerance: fluid.poisson.tolerance,
        absolute_tolerance: 0.0,
        max_iterations: fluid.poisson.max_iterations,
    };
    settings.momentum = settings.pressure;
    settings.projections = match fluid.poisson.solves_per_step {
        Some(3) => Projections::EverySubStep,
        Some(_) => Projections::Once,
        None => Projections::Auto,
    };
    settings.preconditioner = match fluid.poisson.preconditioner {
        case::Preconditioner::Auto => PressurePreconditioner::Auto,
        case::Preconditioner::Direct => PressurePreconditioner::Direct,
        case::Preconditioner::Amg => PressurePreconditioner::Amg,
        case::Preconditioner::Deflation => PressurePreconditioner::Deflation,
        case::Preconditioner::Jacobi => PressurePreconditioner::Jacobi,
    };
    Ok(settings)
}
