//! Forces on the fluid at given places.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A constant force on the fluid around a point, spread as a Gaussian.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PointForce {
    /// Where it acts [m].
    pub position: [f64; 3],
    /// Force [N].
    pub force: [f64; 3],
    /// Standard deviation of the Gaussian [m]; from three node spacings on the mesh resolves it.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub width: f64,
}
