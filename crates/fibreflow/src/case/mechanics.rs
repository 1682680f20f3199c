//! How fibres advance in time.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Time integration of the fibres.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Mechanics {
    /// Scheme.
    pub integrator: IntegratorKind,
    /// One linear solve a stage of the implicit scheme instead of Newton's iteration.
    pub linear: bool,
    /// Largest estimated error of a position in an implicit sub-step, over how far the fibre moves in the step. 0: one
    /// sub-step a step.
    #[schemars(range(min = 0.0))]
    pub tolerance: f64,
    /// Shear rate by which `kinematics = "auto"` judges [1/s]. Default: that of the prescribed flow.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub shear_rate: Option<f64>,
}

impl Default for Mechanics {
    fn default() -> Self {
        Self {
            integrator: IntegratorKind::Auto,
            linear: false,
            tolerance: 1e-3,
            shear_rate: None,
        }
    }
}

/// Scheme that advances fibres in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum IntegratorKind {
    /// Implicit for fibres that would need many explicit sub-steps in a step and touch nothing, else explicit.
    #[default]
    Auto,
    /// Position Verlet in sub-steps below the critical one; drag implicit.
    Explicit,
    /// Second-order, L-stable, with the exact tangent of beam and drag; of first order where the case has contacts.
    Implicit,
}
