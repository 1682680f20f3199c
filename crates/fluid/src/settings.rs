//! What a flow is made of: fluid, boundary conditions, forcing, tolerances.

use crate::{BoundaryCondition, EddyViscosity, FluidError, Signal};
use fibreflow_solve::CgSettings;

/// Everything [`crate::Fluid`] needs besides the mesh. SI units.
#[derive(Clone, Debug)]
pub struct FluidSettings {
    /// Density ρ \[kg/m³\].
    pub density: f64,
    /// Dynamic viscosity μ \[Pa·s\]; zero means inviscid.
    pub viscosity: f64,
    /// One condition for every patch of the mesh, in patch order.
    pub boundary: Vec<BoundaryCondition>,
    /// What drives the flow besides boundaries and the body-force field.
    pub forcing: Forcing,
    /// Velocity of the frame that the mesh moves with \[m/s\]; velocities stay those of the frame at rest. Only what the flow
    /// does in this frame is convected through the mesh.
    pub frame: [f64; 3],
    /// Number in time that a given pressure gradient is multiplied by, taken in the middle of every step.
    pub forcing_factor: Signal,
    /// Stopping rule of the implicit viscous solves; relative to the norm of the explicit increment.
    pub momentum: CgSettings,
    /// Stopping rule of the pressure solve; relative to the norm of the predicted divergence.
    pub pressure: CgSettings,
    /// Preconditioner of the pressure solve.
    pub preconditioner: PressurePreconditioner,
    /// How often a step projects.
    pub projections: Projections,
    /// Short-wave corrections a step that clean the nodal velocity of the divergence which the approximate projection
    /// leaves there.
    pub cleaning_cycles: usize,
    /// How viscous terms are advanced in time.
    pub diffusion: Diffusion,
    /// Whether the dispersion of lumped mass is taken out.
    pub mass: Mass,
    /// How pairs of nodes are read.
    pub kernels: Kernels,
    /// Which inertia the flow has.
    pub inertia: Inertia,
    /// Stress of the motion that the mesh does not resolve; none in a direct simulation.
    pub turbulence: Option<EddyViscosity>,
    /// In a flow without convection: where nothing resists a uniform flow (periodic boxes), the net force is balanced by
    /// a uniform pressure gradient and the mean velocity kept. Always so in steady flow.
    pub hold_mean_velocity: bool,
}

/// How viscous terms are advanced in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Diffusion {
    /// Explicitly in the steps in which that is stable, else implicitly; see [`crate::DiffusionChoice`].
    #[default]
    Auto,
    /// Explicitly: the viscous number limits the step.
    Explicit,
    /// Implicitly (Crank–Nicolson).
    Implicit,
}

/// What stands before the rate of change of the velocity on meshes that are not of orthogonal hexahedra only; on those
/// it is the dual volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Mass {
    /// The consistent mass of the elements, by two explicit corrections, in the steps in which that is stable: Courant
    /// numbers up to 1.10.
    #[default]
    Corrected,
    /// The dual volume: less work, larger errors of dispersion.
    Lumped,
}

/// How pairs of nodes are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Kernels {
    /// Line by line on tensor-product meshes that are numbered so, else from compressed rows.
    #[default]
    Auto,
    /// From compressed rows.
    Rows,
}

/// How often a step makes the velocity solenoidal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Projections {
    /// After every sub-step where the pressure is solved directly, else once: a direct solve is a small part of a step.
    #[default]
    Auto,
    /// Once, at its end; the convecting flux is extrapolated from the last two steps.
    Once,
    /// After each of the three sub-steps of the Runge–Kutta scheme.
    EverySubStep,
}

/// Which inertia a flow has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Inertia {
    /// Navier–Stokes.
    #[default]
    Full,
    /// ∂u/∂t but no convection: unsteady Stokes flow.
    Linear,
    /// None: every step is a steady Stokes flow under the forces of the moment.
    Steady,
}

/// How the pressure equation is solved: directly, or by conjugate gradients with a preconditioner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum PressurePreconditioner {
    /// Direct solves where they are possible and cheap, else multigrid; see [`crate::PressureChoice`].
    #[default]
    Auto,
    /// The exact inverse: on tensor-product meshes whose nodes of given pressure are whole sides.
    Direct,
    /// Aggregation multigrid.
    Amg,
    /// Subdomain deflation: the diagonal, and long waves by groups of nodes.
    Deflation,
    /// The diagonal.
    Jacobi,
}

impl FluidSettings {
    /// Fluid with default tolerances (1e-8, both equations), no patches and no forcing.
    pub fn new(density: f64, viscosity: f64) -> Self {
        let solver = CgSettings {
            relative_tolerance: 1e-8,
            absolute_tolerance: 0.0,
            max_iterations: 2000,
        };
        Self {
            density,
            viscosity,
            boundary: Vec::new(),
            forcing: Forcing::default(),
            frame: [0.0; 3],
            forcing_factor: Signal::Constant(1.0),
            momentum: solver,
            pressure: solver,
            preconditioner: PressurePreconditioner::default(),
            projections: Projections::default(),
            cleaning_cycles: 2,
            diffusion: Diffusion::default(),
            mass: Mass::default(),
            kernels: Kernels::default(),
            inertia: Inertia::default(),
            turbulence: None,
            hold_mean_velocity: false,
        }
    }

    /// Kinematic viscosity ν = μ/ρ \[m²/s\].
    pub fn kinematic_viscosity(&self) -> f64 {
        self.viscosity / self.density
    }

    pub(crate) fn check(&self) -> Result<(), FluidError> {
        let positive = |name, value: f64| {
            let problem = FluidError::Setting {
                name,
                value,
                expected: "positive and finite",
            };
            (value > 0.0 && value.is_finite())
                .then_some(())
                .ok_or(problem)
        };
        positive("density", self.density)?;
        if self.viscosity != 0.0 {
            positive("viscosity", self.viscosity)?;
        }
        if self.inertia != Inertia::Full {
            positive("viscosity of a creeping flow", self.viscosity)?;
        }
        if self.frame.iter().any(|x| !x.is_finite()) {
            positive("speed of the frame", length(self.frame))?;
        }
        if let Forcing::BulkVelocity { direction, value } = &self.forcing {
            positive("length of the bulk direction", length(*direction))?;
            if !value.is_finite() {
                positive("bulk velocity", *value)?;
            }
        }
        if let Some(model) = &self.turbulence {
            positive("constant of the eddy viscosity", model.constant)?;
            if self.inertia != Inertia::Full {
                return Err(FluidError::EddiesWithoutConvection);
            }
        }
        if let Forcing::Linear { rate, energy } = self.forcing {
            positive("rate of linear forcing", rate)?;
            positive("energy of linear forcing", energy.unwrap_or(1.0))?;
            if !self.boundary.is_empty() || self.inertia != Inertia::Full {
                return Err(FluidError::NotPeriodic);
            }
        }
        Ok(())
    }
}

/// What drives a flow besides boundaries and the body-force field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Forcing {
    /// Constant driving force −∇P \[Pa/m\], P the mean pressure.
    PressureGradient([f64; 3]),
    /// The driving force that holds the volume-mean velocity along `direction` at `value` \[m/s\].
    BulkVelocity {
        /// Any length.
        direction: [f64; 3],
        /// Mean velocity over the domain \[m/s\].
        value: f64,
    },
    /// Linear forcing of isotropic turbulence in periodic boxes, f/ρ = A (u − ū) (Lundgren 2003; Rosales & Meneveau 2005;
    /// K 5.3.2), or A (K₀/K)(u − ū), whose power 2AK₀ is constant (Carroll & Blanquart 2013).
    Linear {
        /// A \[1/s\].
        rate: f64,
        /// K₀ \[m²/s²\], where the power is held.
        energy: Option<f64>,
    },
}

impl Default for Forcing {
    fn default() -> Self {
        Self::PressureGradient([0.0; 3])
    }
}

impl Forcing {
    /// Unit vector of a bulk-velocity controller and the velocity to hold.
    pub(crate) fn controlled(&self) -> Option<([f64; 3], f64)> {
        match *self {
            Self::PressureGradient(_) | Self::Linear { .. } => None,
            Self::BulkVelocity { direction, value } => {
                let norm = length(direction);
                Some((direction.map(|d| d / norm), value))
            }
        }
    }
}

pub(crate) fn length(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
