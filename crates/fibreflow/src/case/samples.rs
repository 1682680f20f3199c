//! The flow at chosen points: probes, lines, planes, coarser grids.

use super::{Axis, Schedule};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Velocity, pressure, vorticity and Q-criterion at chosen points at times of their own; NaN outside the mesh.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Samples {
    /// Name of the files: letters, digits, `-` and `_`.
    #[schemars(regex(pattern = "^[A-Za-z0-9_-]+$"))]
    pub name: String,
    /// Every so many steps; this or `interval`. Default: with `output.series`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1))]
    pub every: Option<u64>,
    /// Every so much simulated time [s]; steps land on it exactly. This or `every`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub interval: Option<f64>,
    /// Where.
    pub at: SamplePoints,
}

impl Samples {
    /// When the flow is sampled, beside a series of this schedule.
    pub fn schedule(&self, series: &Schedule) -> Schedule {
        if self.every.is_some() || self.interval.is_some() {
            Schedule {
                every: self.every,
                interval: self.interval,
            }
        } else {
            series.clone()
        }
    }
}

/// Chosen points.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum SamplePoints {
    /// Single points, as a series `series/NAME.csv`.
    Points {
        /// Coordinates [m].
        #[schemars(length(min = 1))]
        points: Vec<[f64; 3]>,
    },
    /// Points at equal distances, as tables `samples/NAME_STEP.csv`.
    Line {
        /// First point [m].
        start: [f64; 3],
        /// Last point [m].
        end: [f64; 3],
        /// Points.
        #[schemars(range(min = 2))]
        count: usize,
    },
    /// A plane across an axis, as pictures `samples/NAME_STEP.pvti` with `samples/NAME.pvd`.
    Plane {
        /// Axis across the plane.
        normal: Axis,
        /// Coordinate along it [m].
        position: f64,
        /// Lowest corner, along the other two axes in the order x, y, z [m].
        low: [f64; 2],
        /// Highest corner [m].
        high: [f64; 2],
        /// Points along the other two axes.
        #[schemars(inner(range(min = 2)))]
        counts: [usize; 2],
    },
    /// A regular grid in a box, in files as those of planes: a coarser picture of the whole flow.
    Box {
        /// Lowest corner [m].
        low: [f64; 3],
        /// Highest corner [m].
        high: [f64; 3],
        /// Points in each direction.
        #[schemars(inner(range(min = 2)))]
        counts: [usize; 3],
    },
}
