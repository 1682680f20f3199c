//! Forming and pulling networks of linked fibres.

use super::Axis;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A face of the box that a weight presses on linked fibres, as Switzer (2002, 2.105): M dv/dt = W − ΣF.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Piston {
    /// Which face.
    pub face: Face,
    /// M [kg]. Its speed in a step follows from the forces at the start: steps must be short by M over the resistance of all fibres
    /// that it pushes.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub mass: f64,
    /// W, towards the fibres [N].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub weight: f64,
    /// Volume of the fibres over that of the box at which it stops and stays.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    pub volume_fraction: f64,
}

/// A face of the box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Face {
    /// x lowest
    XMin,
    /// x highest
    XMax,
    /// y lowest
    YMin,
    /// y highest
    YMax,
    /// z lowest
    ZMin,
    /// z highest
    ZMax,
}

impl Face {
    /// 0, 1, 2 for x, y, z.
    pub fn axis(self) -> usize {
        self as usize / 2
    }
}

/// Two planes that move apart and take along linked fibres where they cross them at the start, as Switzer (2002, 2.108–2.115).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grips {
    /// Axis across the planes, along which they move.
    pub axis: Axis,
    /// Where they cut it at the start [m], the lower one first.
    pub planes: [f64; 2],
    /// Speed of each, away from the other [m/s].
    pub speed: f64,
}
