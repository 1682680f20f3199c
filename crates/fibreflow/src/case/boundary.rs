//! Conditions on the patches of the mesh.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Condition on a patch.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Boundary {
    /// No slip, at rest.
    Wall {},
    /// No slip, moving in its own plane.
    MovingWall {
        /// Velocity of the wall [m/s].
        velocity: [f64; 3],
        /// Number in time that this is multiplied by. Default: one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        factor: Option<Factor>,
    },
    /// No slip on a body of revolution that turns about its axis.
    RotatingWall {
        /// A point of the axis [m].
        #[serde(default)]
        point: [f64; 3],
        /// Direction of the axis; its length does not matter.
        axis: [f64; 3],
        /// Angular velocity about the axis, right-handed [rad/s].
        rate: f64,
        /// Number in time that this is multiplied by. Default: one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        factor: Option<Factor>,
    },
    /// Symmetry: no flow through, no shear stress.
    Slip {},
    /// Prescribed velocity.
    Inlet {
        /// Mean velocity [m/s]. Needed unless `profile` is a file or a formula.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        velocity: Option<[f64; 3]>,
        /// Shape over the patch.
        #[serde(default)]
        profile: Profile,
        /// Number in time that this is multiplied by. Default: one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        factor: Option<Factor>,
    },
    /// Prescribed pressure; the flow leaves as it likes, and what comes back brings no kinetic energy.
    Outlet {
        /// Pressure [Pa].
        #[serde(default)]
        pressure: f64,
        /// Number in time that this is multiplied by. Default: one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        factor: Option<Factor>,
    },
    /// The flow is carried out as it comes, ∂u/∂t + U ∂u/∂n = 0; nothing comes back.
    ConvectiveOutlet {
        /// U [m/s]. Default: the mean speed through the patch.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        speed: Option<f64>,
    },
}

/// Shape of an inlet profile.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Profile {
    /// The same everywhere.
    #[default]
    Uniform,
    /// Parabolic between each pair of opposite walls that bound the inlet of a box.
    Parabolic,
    /// Velocities at points, from a CSV file (path relative to the case file). Its columns are some of x, y, z [m] and
    /// some of u, v, w [m/s], the others being zero. Along one coordinate it is linear between points, along two or three
    /// a fit to the nearest points that is exact for linear fields.
    File(String),
    /// Formulas of the three components [m/s] in x, y, z [m] and t [s], as for `fluid.initial`.
    Formula([String; 3]),
}

/// A number that changes in time.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Factor {
    /// Values at given times, linear between them; before the first and after the last the value stays.
    Table {
        /// Times, ascending [s].
        times: Vec<f64>,
        /// A value for each.
        values: Vec<f64>,
        /// Repeats; the last value is then the first again.
        #[serde(default)]
        periodic: bool,
    },
    /// The same from a CSV file with columns time [s] and value.
    File {
        /// Path, relative to the case file.
        file: String,
        /// Repeats; the last value is then the first again.
        #[serde(default)]
        periodic: bool,
    },
    /// A formula.
    Formula {
        /// In t [s]: + − * / ^, parentheses, `pi`, and sin, cos, tan, sinh, cosh, tanh, exp, log, sqrt, abs.
        value: String,
    },
}
