//! The fluid: material, initial field, boundaries, forcing, solver.

use super::{Boundary, Factor, PointForce};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// An incompressible Newtonian fluid.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fluid {
    /// Density [kg/m³].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// Dynamic viscosity [Pa·s].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub viscosity: f64,
    /// Order of accuracy in space: 2, or 4 on meshes of axis-parallel hexahedra that are the tensor product of three
    /// coordinate lists (there 2 beside jumps of the spacing, and in directions of fewer than eight nodes).
    #[serde(default = "second")]
    #[schemars(extend("enum" = [2, 4]))]
    pub order: u8,
    /// Which inertia the flow has.
    #[serde(default)]
    pub inertia: Inertia,
    /// In a flow without convection that nothing holds in some direction (periodic boxes): the net force in that direction
    /// is balanced by a uniform pressure gradient, and the mean velocity kept. Always so with `inertia = "steady"`.
    #[serde(default)]
    pub hold_mean_velocity: bool,
    /// Velocity that the mesh moves with, along its walls and periodic directions [m/s]. At about the mean velocity of a channel or a
    /// pipe the errors of dispersion are much smaller, which pays on meshes that resolve the flow, and the Courant number allows longer steps: in turbulence keep them below half of ν/u_τ²
    /// (`time.cfl`, `time.max_step`). Velocities in all output are those of the frame at rest; places are those in the mesh. Not with fibres.
    #[serde(default, skip_serializing_if = "at_rest")]
    pub frame_velocity: [f64; 3],
    /// How viscous terms are advanced in time.
    #[serde(default)]
    pub diffusion: Diffusion,
    /// How the solver reads pairs of nodes; the answer differs by round-off.
    #[serde(default)]
    pub kernels: Kernels,
    /// Mass on meshes other than of axis-parallel hexahedra only.
    #[serde(default)]
    pub mass: Mass,
    /// Velocity at the start. Default: at rest.
    #[serde(default)]
    pub initial: Initial,
    /// What drives the flow. Default: nothing.
    #[serde(default)]
    pub forcing: Forcing,
    /// Stress of the motion that the mesh does not resolve, as 2ν_t S with an eddy viscosity ν_t, advanced explicitly. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turbulence: Option<Turbulence>,
    /// Constant forces on the fluid around points.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub forces: Vec<PointForce>,
    /// Condition on every patch of the mesh.
    #[serde(default)]
    pub boundaries: BTreeMap<String, Boundary>,
    /// Solver of the pressure equation.
    #[serde(default)]
    pub poisson: Poisson,
}

fn at_rest(velocity: &[f64; 3]) -> bool {
    *velocity == [0.0; 3]
}

fn second() -> u8 {
    2
}

/// Which inertia a flow has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Inertia {
    /// `linear` where the velocities, forces and lengths of the case give a Reynolds number below 0.1, else `full`.
    #[default]
    Auto,
    /// Navier–Stokes.
    Full,
    /// ∂u/∂t without convection: unsteady Stokes flow.
    Linear,
    /// None: at every step the steady Stokes flow of the moment.
    Steady,
}

/// How the solver reads pairs of nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kernels {
    /// Line by line where the mesh is a tensor product, else from a list of pairs.
    #[default]
    Auto,
    /// From a list of pairs, as on any mesh: to see what the other saves.
    Rows,
}

/// What the rate of change of the velocity is multiplied by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Mass {
    /// The consistent mass of the elements, by two explicit corrections: a sixth to a fortieth of the error of waves that the
    /// flow carries along. In steps of Courant numbers above 1.10 as `lumped`.
    #[default]
    Corrected,
    /// The dual volume.
    Lumped,
}

/// How viscous terms are advanced in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Diffusion {
    /// Explicitly in the steps in which that is stable, else implicitly.
    #[default]
    Auto,
    /// Explicitly; with `time.cfl` the viscous number limits the step too.
    Explicit,
    /// Implicitly (Crank–Nicolson).
    Implicit,
}

/// Velocity at the start.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Initial {
    /// At rest.
    #[default]
    Rest,
    /// The same everywhere.
    Uniform {
        /// Velocity [m/s].
        velocity: [f64; 3],
    },
    /// Laminar profile between the two walls of a box: 3/2 U (1 − η²), η = −1…1 across.
    Poiseuille {
        /// Mean velocity [m/s].
        bulk_velocity: [f64; 3],
    },
    /// Two-dimensional Taylor–Green vortices on a drift:
    /// u = U + A sin kx' cos ky', v = V − A cos kx' sin ky', k = 2π/wavelength, x' = x − Ut, y' = y − Vt.
    TaylorGreen {
        /// A [m/s].
        amplitude: f64,
        /// Wavelength [m], the same in x and y.
        #[schemars(extend("exclusiveMinimum" = 0))]
        wavelength: f64,
        /// Uniform drift (U, V) [m/s].
        #[serde(default)]
        drift: [f64; 2],
    },
    /// Mean profile between the two walls of a box with random divergence-free eddies that vanish at the walls.
    PerturbedChannel {
        /// Mean velocity [m/s], along x, y or z.
        bulk_velocity: [f64; 3],
        /// Shape of the mean profile.
        #[serde(default)]
        profile: ChannelProfile,
        /// Root mean square of the eddies in the middle of the channel, by the mean velocity.
        #[serde(default = "tenth")]
        #[schemars(range(min = 0.0))]
        intensity: f64,
        /// Seed of the eddies.
        #[serde(default)]
        seed: u64,
    },
    /// Isotropic turbulence in a box that is periodic in all directions: random divergence-free waves whose energy is
    /// E ∝ k⁴ exp(−2(k/k₀)²), the same on any mesh.
    Isotropic {
        /// Root mean square of a component of the velocity [m/s].
        #[schemars(extend("exclusiveMinimum" = 0))]
        intensity: f64,
        /// Wavelength 2π/k₀ of the largest energy [m]; waves down to a third of it take part.
        #[schemars(extend("exclusiveMinimum" = 0))]
        wavelength: f64,
        /// Seed of the waves.
        #[serde(default)]
        seed: u64,
    },
    /// Mean profile of a circular pipe with random divergence-free eddies that vanish at the wall. Centre, radius and length
    /// are those of the mesh, which must be one straight pipe along x, y or z.
    PerturbedPipe {
        /// Mean velocity [m/s], along x, y or z.
        bulk_velocity: [f64; 3],
        /// Shape of the mean profile.
        #[serde(default)]
        profile: ChannelProfile,
        /// Root mean square of the eddies on the axis, by the mean velocity.
        #[serde(default = "tenth")]
        #[schemars(range(min = 0.0))]
        intensity: f64,
        /// Seed of the eddies.
        #[serde(default)]
        seed: u64,
    },
    /// From formulas in x, y, z [m]: + − * / ^, parentheses, `pi`, and sin, cos, tan, sinh, cosh, tanh, exp, log, sqrt, abs.
    Expression {
        /// Formulas of the three components [m/s].
        velocity: [String; 3],
    },
    /// From a CSV file with columns x,y,z,u,v,w (SI units) that has a line for every node.
    File {
        /// Path, relative to the case file.
        file: String,
    },
}

fn tenth() -> f64 {
    0.1
}

/// Shape of the mean profile of a channel or pipe.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ChannelProfile {
    /// Parabola.
    #[default]
    Laminar,
    /// Seventh-root law.
    Turbulent,
}

/// What drives the flow.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Forcing {
    /// Nothing but the boundaries.
    #[default]
    None,
    /// Given driving force per volume, −dp/dx.
    PressureGradient {
        /// Force per volume [N/m³].
        value: [f64; 3],
        /// Number in time that this is multiplied by. Default: one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        factor: Option<Factor>,
    },
    /// A force per volume that keeps the mean velocity along a direction.
    BulkVelocity {
        /// Direction; its length does not matter.
        direction: [f64; 3],
        /// Mean velocity [m/s].
        value: f64,
    },
    /// A force per mass A (u − ū) that keeps isotropic turbulence alive in a mesh that is periodic in all directions
    /// (Lundgren 2003; Rosales & Meneveau 2005).
    Linear {
        /// A [1/s]. The turnover time K/ε becomes 1/(2A), the large eddies about a fifth of the box.
        #[schemars(extend("exclusiveMinimum" = 0))]
        rate: f64,
        /// K₀ [m²/s²]: the force is A (K₀/K)(u − ū), K the kinetic energy of the moment, and its power 2AK₀ constant (Carroll &
        /// Blanquart 2013). Default: K₀ = K.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        energy: Option<f64>,
    },
}

/// An eddy viscosity ν_t = (C Δ)² × a rate from the velocity gradient, Δ the cube root of the dual volume; zero on walls.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Turbulence {
    /// Which rate.
    pub model: TurbulenceModel,
    /// C. Default: 0.17 (smagorinsky), 0.5 (wale), 1.35 (sigma).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub constant: Option<f64>,
}

/// Model of an eddy viscosity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TurbulenceModel {
    /// The rate of strain (Smagorinsky 1963); too much in laminar shear and at walls.
    Smagorinsky,
    /// Of the square of the gradient; none in pure shear, with the cube of the distance at walls (Nicoud & Ducros 1999).
    Wale,
    /// Of the singular values of the gradient; none in two-dimensional flow and rotation either (Nicoud et al. 2011).
    Sigma,
}

/// Solver of the pressure equation.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Poisson {
    /// Residual at which the solver stops, relative to the right-hand side.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 0.1))]
    pub tolerance: f64,
    /// Direct solves, or the preconditioner of conjugate gradients. `auto`: direct solves where the mesh is a tensor
    /// product, nodes of given pressure are whole sides and they are cheap, else multigrid.
    pub preconditioner: Preconditioner,
    /// Iterations after which the run is given up.
    #[schemars(range(min = 1))]
    pub max_iterations: usize,
    /// Pressure solves a step: 1, at its end, or 3, after every sub-step of the Runge–Kutta scheme. Default: 3 where the
    /// solver is direct, else 1.
    #[schemars(extend("enum" = [1, 3]))]
    pub solves_per_step: Option<u8>,
}

impl Default for Poisson {
    fn default() -> Self {
        Self {
            tolerance: 1e-8,
            preconditioner: Preconditioner::default(),
            max_iterations: 2000,
            solves_per_step: None,
        }
    }
}

/// How the pressure equation is solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Preconditioner {
    /// Direct solves where they are possible and cheap, else multigrid.
    #[default]
    Auto,
    /// Direct solves; an error where they are not possible.
    Direct,
    /// Conjugate gradients with algebraic multigrid by aggregation.
    Amg,
    /// Conjugate gradients with the diagonal, and groups of nodes for long waves (subdomain deflation).
    Deflation,
    /// Conjugate gradients with the diagonal.
    Jacobi,
}
