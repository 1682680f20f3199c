//! Beads.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Rigid beads in a creeping flow, alone or joined by beams to fibres, that two fluids wet (Lecrivain et al. 2020). In a mesh one
/// element thick a bead is a disc of that depth.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Beads {
    /// Radius r_b [m]. From six spacings of the mesh it is resolved.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: f64,
    /// Width ξ of the edge of a bead [m]. Default: `phase.interface_width`, or a sixth of the radius.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub interface_width: Option<f64>,
    /// Distance ξ_c from its edge beyond which a bead is cut off [m]. Default: five times the width.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub cutoff: Option<f64>,
    /// Length over which a flow that is not rigid dies out inside a bead [m]. Default: that at which a bead has the drag of a sharp one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub screening: Option<f64>,
    /// Rows of beads.
    pub chains: Vec<BeadChain>,
}

/// Beads in a row, each in touch with the next.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BeadChain {
    /// Centre of the first bead [m].
    pub start: [f64; 3],
    /// From the first to the last bead; any length.
    #[serde(default = "along_x")]
    pub direction: [f64; 3],
    /// Beads.
    #[serde(default = "one")]
    #[schemars(range(min = 1))]
    pub count: usize,
    /// ψ_0, the value of the order parameter inside: positive where fluid A wets the beads.
    #[serde(default)]
    #[schemars(range(min = -1.0, max = 1.0))]
    pub psi_0: f64,
    /// Young's modulus of the beams between the beads [Pa]; with zero they are loose.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub youngs_modulus: f64,
    /// The beads stay where they are.
    #[serde(default)]
    pub fixed: bool,
}

fn along_x() -> [f64; 3] {
    [1.0, 0.0, 0.0]
}

fn one() -> usize {
    1
}
