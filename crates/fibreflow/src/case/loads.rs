//! Forces on patches, as a series.

use super::Schedule;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Forces, torques and flow on patches of the boundary.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Loads {
    /// Patches. Default: all of the mesh.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub patches: Vec<String>,
    /// Every so many steps; this or `interval`. Default: with `output.series`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1))]
    pub every: Option<u64>,
    /// Every so much simulated time [s]; steps land on it exactly. This or `every`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub interval: Option<f64>,
    /// Point about which torques are taken [m].
    pub about: [f64; 3],
    /// Drag and lift coefficients of these patches together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coefficients: Option<Coefficients>,
}

impl Loads {
    /// When a line is written, beside a series of this schedule.
    pub fn schedule(&self, series: &Schedule) -> Schedule {
        let own = Schedule {
            every: self.every,
            interval: self.interval,
        };
        if self.every.is_some() || self.interval.is_some() {
            own
        } else {
            series.clone()
        }
    }
}

/// Force along a direction by ½ ρ U² A.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Coefficients {
    /// U [m/s].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub velocity: f64,
    /// A [m²].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub area: f64,
    /// Direction of the drag; its length does not matter.
    pub drag: [f64; 3],
    /// Direction of the lift; its length does not matter. Default: no lift coefficient.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lift: Option<[f64; 3]>,
}
