//! The second fluid.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A second fluid of the same density and viscosity, with an interface of finite width: Cahn–Hilliard for the order parameter ψ, 1 in
/// fluid A and −1 in fluid B (Lecrivain et al. 2020).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Phase {
    /// Surface tension σ between both fluids [N/m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub surface_tension: f64,
    /// Width ξ of the interface [m]: ψ = tanh(x/√2ξ). From two spacings of the mesh it is resolved.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub interface_width: f64,
    /// Diffusivity D [m²/s]: mobility times the energy density 3σ/(√8 ξ).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub diffusivity: f64,
    /// ψ at the start, a formula in x, y, z [m] as in `fluid.initial`; in beads it is replaced by their ψ_0.
    pub initial: String,
    /// A solid at rest that ψ sees, but not the flow. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub solid: Option<Solid>,
    /// Part of the free energy that diffusion may take in a step: with `time.cfl` the step follows it. Default: no such limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    pub decay: Option<f64>,
    /// Residual at which the equation of a step counts as solved, relative to its terms.
    #[serde(default = "tolerance")]
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1e-4))]
    pub tolerance: f64,
}

/// A solid at rest.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Solid {
    /// Its volume fraction φ, a formula in x, y, z [m].
    pub fraction: String,
    /// ψ_0, the value of ψ inside: positive where it is wetted by fluid A.
    #[schemars(range(min = -1.0, max = 1.0))]
    pub psi_0: f64,
}

fn tolerance() -> f64 {
    1e-9
}
