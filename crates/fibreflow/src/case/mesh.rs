//! Where the fluid is: a generated box, a mesh file, or a prescribed flow without mesh.

use super::AmbientFlow;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The mesh of the fluid.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum MeshSource {
    /// A box; its patches are `x_min`, `x_max`, `y_min`, `y_max`, `z_min`, `z_max`, without those of periodic directions.
    Box {
        /// Lowest corner [m].
        #[serde(default)]
        origin: [f64; 3],
        /// Edge lengths [m].
        #[schemars(extend("items" = {"type": "number", "exclusiveMinimum": 0}))]
        size: [f64; 3],
        /// Hexahedral cells in each direction (before they are cut into other elements).
        #[schemars(inner(range(min = 1)))]
        cells: [usize; 3],
        /// What the cells are cut into.
        #[serde(default)]
        element: BoxElement,
        /// Spacing in each direction.
        #[serde(default)]
        stretching: [Stretching; 3],
        /// Periodic directions.
        #[serde(default)]
        periodic: [bool; 3],
        /// Random displacement of interior nodes, as a fraction of the local spacing.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 0.45))]
        jitter: f64,
        /// Seed of the displacement.
        #[serde(default)]
        seed: u64,
    },
    /// A Gmsh file, format 4.1, ASCII or binary; physical groups of surfaces are the patches.
    Gmsh {
        /// Path of the `.msh` file, relative to the case file.
        file: String,
    },
}

/// What the cells of a box are cut into.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BoxElement {
    /// Hexahedra.
    #[default]
    Hexahedron,
    /// Two prisms a cell.
    Prism,
    /// Tetrahedra.
    Tetrahedron,
    /// Hexahedra and six-pyramid cells side by side.
    PyramidHexahedron,
    /// All four kinds.
    Mixed,
}

/// Spacing of nodes along one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Stretching {
    /// Equal spacing.
    #[default]
    Uniform,
    /// Finer at both ends: x = ½(1 + tanh(β(2s − 1))/tanh β), with this β > 0.
    Tanh(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// Each cell is this many times its predecessor.
    Geometric(#[schemars(extend("exclusiveMinimum" = 0))] f64),
}

/// A prescribed flow: fibres move in it and do not change it.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ambient {
    /// Density of the fluid [kg/m³].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// Dynamic viscosity [Pa·s].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub viscosity: f64,
    /// The flow.
    pub flow: AmbientFlow,
    /// Where fibres may be; without it space is unbounded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub domain: Option<Domain>,
}

/// A box for fibres in a prescribed flow.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Domain {
    /// Lowest corner [m].
    #[serde(default)]
    pub origin: [f64; 3],
    /// Edge lengths [m].
    #[schemars(extend("items" = {"type": "number", "exclusiveMinimum": 0}))]
    pub size: [f64; 3],
    /// Periodic directions; the others end at walls. In a shear flow, a box that is periodic along y is sheared with the
    /// flow (Lees and Edwards).
    #[serde(default)]
    pub periodic: [bool; 3],
}
