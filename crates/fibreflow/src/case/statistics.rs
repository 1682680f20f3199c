//! Averages of a turbulent flow over time and over planes or rings.

use super::{Axis, Schedule};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Averages over time and over planes or rings, in `profiles/` and `statistics.json`; friction in `series/friction.csv`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Statistics {
    /// Time at which averaging starts [s].
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub from: f64,
    /// A sample every so many steps; this or `interval`. Default: every 10 steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1))]
    pub every: Option<u64>,
    /// A sample every so much simulated time [s]; steps land on it exactly. This or `every`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub interval: Option<f64>,
    /// Length of the blocks of time that sampling errors are from [s]; doubled when there are more than 64. It should be
    /// longer than the flow remembers. Default: a twentieth of the time from `from` to the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub block: Option<f64>,
    /// Nodes that are averaged together.
    pub average: Average,
    /// Periodic directions along which spectra and two-point correlations are taken, where nodes must be equally spaced; and `around` the
    /// circles of rings, of those that consist of equally spaced nodes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub spectra: Vec<Line>,
}

impl Statistics {
    /// When a sample is taken.
    pub fn schedule(&self) -> Schedule {
        let default = self.interval.is_none().then_some(10);
        Schedule {
            every: self.every.or(default),
            interval: self.interval,
        }
    }
}

/// A direction of spectra.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Line {
    /// Along x.
    X,
    /// Along y.
    Y,
    /// Along z.
    Z,
    /// Around rings: wavenumbers are numbers of waves, separations are angles.
    Around,
}

/// Nodes that are averaged together. Velocities u, v, w are those along the flow, across planes or rings, and the third.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Average {
    /// Planes: a channel.
    Planes {
        /// Direction across the planes.
        normal: Axis,
        /// Direction of the flow.
        flow: Axis,
        /// Planes at the same distance from the two sides count as one; v points away from the nearer side.
        #[serde(default)]
        symmetric: bool,
    },
    /// Rings: a pipe. v points away from the axis, w goes around it.
    Rings {
        /// Direction of the axis and of the flow.
        axis: Axis,
        /// A point on the axis [m].
        #[serde(default)]
        centre: [f64; 3],
    },
}
