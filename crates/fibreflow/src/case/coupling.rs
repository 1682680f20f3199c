//! How fibres and fluid act on each other.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How fibres and fluid act on each other.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Coupling {
    /// One-way or two-way.
    pub mode: CouplingMode,
    /// Which nodes a hydrodynamic point samples and pushes.
    pub kernel: KernelKind,
    /// Standard deviation σ of the Gaussian kernel [m]: at least two spacings of the mesh for a drag that does not depend on it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub width: Option<f64>,
    /// Whether a fibre feels the flow that it made itself.
    pub correction: Correction,
    /// How a step of fluid and fibres is taken together.
    pub scheme: Scheme,
    /// Relative change of the forces in a round at which the iterated scheme has found them.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub tolerance: f64,
}

impl Default for Coupling {
    fn default() -> Self {
        Self {
            mode: CouplingMode::default(),
            kernel: KernelKind::default(),
            width: None,
            correction: Correction::default(),
            scheme: Scheme::default(),
            tolerance: 1e-6,
        }
    }
}

/// Direction of the coupling.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CouplingMode {
    /// The fluid moves the fibres.
    OneWay,
    /// The fibres act back on the fluid.
    #[default]
    TwoWay,
}

/// Which nodes a hydrodynamic point samples and pushes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum KernelKind {
    /// Those of the element around it, by its shape functions.
    #[default]
    Element,
    /// Those of the element around the middle of a segment (of parts no longer than the mesh), with its gradient: cheaper
    /// than `element` by a fifth, and the same where the flow is linear along the segment. Not for linked fibres.
    Middle,
    /// Those within 4 `width`, by a Gaussian that is exact for linear fields.
    Gaussian,
}

/// Whether a fibre feels the flow that it made itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Correction {
    /// `undisturbed` with the Gaussian kernel in two-way coupling, else `none`.
    #[default]
    Auto,
    /// The flow as it is.
    None,
    /// The flow less what the fibre itself has made of it, with the images of walls that are whole sides of a box.
    Undisturbed,
}

/// How a step of fluid and fibres is taken together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scheme {
    /// `iterated` in two-way coupling without convection, else `staggered`.
    #[default]
    Auto,
    /// Fibres in the flow of the step before, then the fluid.
    Staggered,
    /// Forces solved for together with the flow, to `tolerance`; needs a fluid without convection.
    Iterated,
}
