//! Random fibres: where, how many, in which directions, and quantities that differ from fibre to fibre.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A quantity of a fibre: a number, or a distribution from which every fibre draws its own.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Quantity {
    /// The same for all fibres.
    Constant(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// Drawn for every fibre.
    Drawn(Spread),
}

impl Quantity {
    /// The number, or the mean before cutting; None for values in a file.
    pub fn nominal(&self) -> Option<f64> {
        match self {
            Self::Constant(value) => Some(*value),
            Self::Drawn(Spread::Normal { mean, .. } | Spread::Lognormal { mean, .. }) => {
                Some(*mean)
            }
            Self::Drawn(Spread::File { .. }) => None,
        }
    }
}

/// A distribution of a positive quantity.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Spread {
    /// Normal, cut to a range.
    Normal {
        /// Mean before cutting.
        #[schemars(extend("exclusiveMinimum" = 0))]
        mean: f64,
        /// Standard deviation before cutting.
        #[schemars(extend("exclusiveMinimum" = 0))]
        deviation: f64,
        /// Smallest value.
        #[schemars(extend("exclusiveMinimum" = 0))]
        min: f64,
        /// Largest value.
        #[schemars(extend("exclusiveMinimum" = 0))]
        max: f64,
    },
    /// Lognormal.
    Lognormal {
        /// Mean of the quantity itself, before cutting.
        #[schemars(extend("exclusiveMinimum" = 0))]
        mean: f64,
        /// Standard deviation of the quantity itself, before cutting.
        #[schemars(extend("exclusiveMinimum" = 0))]
        deviation: f64,
        /// Smallest value. Default: none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        min: Option<f64>,
        /// Largest value. Default: none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        max: Option<f64>,
    },
    /// Measured values, each used once in random order before any is used again.
    File {
        /// Path of a CSV file with the column `value`, relative to the case file.
        file: String,
    },
}

/// Where random fibres are put.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Region {
    /// A box with edges along the axes.
    Box {
        /// Lowest corner [m].
        origin: [f64; 3],
        /// Edges [m].
        #[schemars(extend("items" = {"type": "number", "exclusiveMinimum": 0}))]
        size: [f64; 3],
    },
    /// A circular pipe along an axis.
    Pipe {
        /// Centre of the end with the lowest coordinate [m].
        start: [f64; 3],
        /// Direction.
        axis: Axis,
        /// Inner radius [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius: f64,
        /// Length [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        length: f64,
    },
}

impl Region {
    /// Lowest and highest corner of the box around it [m].
    pub fn corners(&self) -> [[f64; 3]; 2] {
        match *self {
            Self::Box { origin, size } => [origin, [0, 1, 2].map(|c| origin[c] + size[c])],
            Self::Pipe {
                start,
                axis,
                radius,
                length,
            } => {
                let along = axis as usize;
                let reach = |c: usize| if c == along { 0.0 } else { radius };
                let low = [0, 1, 2].map(|c| start[c] - reach(c));
                let high = [0, 1, 2].map(|c| start[c] + reach(c));
                let end = |c: usize| high[c] + if c == along { length } else { 0.0 };
                [low, [0, 1, 2].map(end)]
            }
        }
    }
}

/// A coordinate axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Axis {
    /// x
    X,
    /// y
    Y,
    /// z
    Z,
}

/// What happens when there is no room for all fibres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Shortfall {
    /// The case is refused, with the volume fraction that was reached.
    #[default]
    Refuse,
    /// The run goes on with those that were placed; the log has a warning.
    Accept,
}

/// Directions of randomly placed fibres.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Orientation {
    /// All directions alike.
    #[default]
    Isotropic,
    /// One direction.
    Aligned {
        /// Direction; its length does not matter.
        direction: [f64; 3],
    },
    /// At random in a plane.
    InPlane {
        /// Normal of the plane; its length does not matter.
        normal: [f64; 3],
    },
    /// On Jeffery's orbits in simple shear, with the phases that time gives.
    Jeffery {
        /// Aspect ratio of the spheroid that turns as the fibre does. Default: Cox's (1971) for mean length by diameter.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        aspect_ratio: Option<f64>,
        /// Direction of the flow.
        #[serde(default = "along_x")]
        flow: [f64; 3],
        /// Direction of the velocity gradient.
        #[serde(default = "along_y")]
        gradient: [f64; 3],
        /// Which orbits.
        #[serde(default)]
        orbits: Orbits,
    },
    /// Angular central Gaussian distribution with a given mean of pp.
    Tensor {
        /// ⟨pp⟩: symmetric, trace 1, no negative eigenvalue.
        tensor: [[f64; 3]; 3],
    },
}

fn along_x() -> [f64; 3] {
    [1.0, 0.0, 0.0]
}

fn along_y() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

/// Distribution of Jeffery's orbit constant C.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Orbits {
    /// Those of fibres that were isotropic when the shear began.
    #[default]
    FromIsotropic,
    /// Steady state of slender fibres under weak rotary diffusion (Leal & Hinch 1971).
    WeakDiffusion,
    /// One orbit with this C ≥ 0.
    Constant(#[schemars(range(min = 0.0))] f64),
}
