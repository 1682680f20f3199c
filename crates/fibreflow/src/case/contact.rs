//! Contacts: laws and walls.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Contacts between segments and with walls: linear spring, damping, Coulomb friction.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Normal stiffness [N/m]. Needed, but for linked fibres, which have `repulsion` alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub stiffness: Option<f64>,
    /// Tangential by normal stiffness.
    #[serde(default = "tangential_ratio")]
    #[schemars(range(min = 0.0))]
    pub tangential_ratio: f64,
    /// Damping ratio of the contact oscillator; 1 is critical.
    #[serde(default = "contact_damping")]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub damping: f64,
    /// Coefficient of friction.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub friction: f64,
    /// Coefficient of friction of what slides, for linked fibres. Default: `friction`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub sliding_friction: Option<f64>,
    /// Pairs nearer than this beyond touching are kept between searches [m]. Default: the largest diameter; for beams it grows, up to the longest segment, while few pairs are kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub skin: Option<f64>,
    /// Short-range repulsion, as Switzer (2002, 2.7).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repulsion: Option<Repulsion>,
    /// Van der Waals attraction of cylinders.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub van_der_waals: Option<VanDerWaals>,
    /// Resistance of the film of fluid between surfaces, as Kunhappan (2018, 3.35, 3.36).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lubrication: Option<Lubrication>,
    /// Surfaces that hold the fibres, in place of the faces of the box. Default: the faces of a box that are not periodic.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub walls: Option<Vec<ContactWall>>,
    /// Counts in every sub-step how often two centre lines pass through each other.
    #[serde(default)]
    pub count_crossings: bool,
}

/// Force F₀ exp(−h/λ) at a gap h, less a weak attraction A exp(−(h/w)²).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Repulsion {
    /// F₀ [N].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub strength: f64,
    /// Decay length λ [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub decay: f64,
    /// A [N].
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub attraction: f64,
    /// w [m]. Default: the decay length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub attraction_width: Option<f64>,
    /// Gap beyond which there is no force [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub range: f64,
    /// Gap below which surfaces rub [m]; not above the range.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub contact_gap: f64,
}

/// Attraction between cylinders that cross or run side by side.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VanDerWaals {
    /// Hamaker constant [J].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub hamaker: f64,
    /// Gap below which the force no longer grows [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub closest: f64,
    /// Gap beyond which there is no force [m]; above `closest`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub range: f64,
}

/// Lubrication between fibres and with walls.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lubrication {
    /// Dynamic viscosity [Pa·s]. Default: that of the fluid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub viscosity: Option<f64>,
    /// Height of roughness: gap below which the resistance no longer grows [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub roughness: f64,
    /// Gap beyond which there is no force [m]; above `roughness`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub range: f64,
    /// What the surfaces are taken for.
    #[serde(default)]
    pub model: LubricationModel,
}

/// What surfaces are taken for in lubrication.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LubricationModel {
    /// Cylinders that cross or run side by side.
    #[default]
    Cylinders,
    /// Spheres of the fibres' radius (Kunhappan 2018, 3.35).
    Spheres,
}

/// A surface that holds fibres.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ContactWall {
    /// A plane.
    Plane {
        /// A point of it [m].
        point: [f64; 3],
        /// Normal to the fibres' side; its length does not matter.
        normal: [f64; 3],
        /// Velocity [m/s].
        #[serde(default)]
        velocity: [f64; 3],
    },
    /// The inside of a round pipe.
    Pipe {
        /// A point of its axis [m].
        point: [f64; 3],
        /// Direction of its axis; its length does not matter.
        axis: [f64; 3],
        /// Radius [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius: f64,
    },
    /// Boundary patches of the mesh.
    Patches {
        /// Names of the patches.
        #[schemars(length(min = 1))]
        names: Vec<String>,
    },
}

fn tangential_ratio() -> f64 {
    2.0 / 7.0
}

fn contact_damping() -> f64 {
    0.1
}
