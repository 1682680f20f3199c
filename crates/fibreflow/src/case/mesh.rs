//! Where the fluid is: a generated box, a mesh file, or a prescribed flow without mesh.

use super::AmbientFlow;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

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
    /// A circular pipe of hexahedra along x: a square core with rounded sides in rings (O-grid). Its patch is `wall`, and without
    /// period also `x_min` and `x_max`.
    Pipe {
        /// Centre of the end with the smaller x [m].
        #[serde(default)]
        origin: [f64; 3],
        /// Radius [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius: f64,
        /// Length [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        length: f64,
        /// Cells along the pipe.
        #[schemars(range(min = 1))]
        cells: usize,
        /// Cells across the core; a ring has four times as many.
        #[schemars(range(min = 1))]
        core: usize,
        /// Rings between the core and the wall.
        #[schemars(range(min = 1))]
        layers: usize,
        /// Radius of the corners of the core, by the radius of the pipe: above 0, below 1.
        #[serde(default = "half")]
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
        core_radius: f64,
        /// Sides of the core: from 0, straight, to below 1, where they would be a circle.
        #[serde(default = "half")]
        #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 1))]
        roundness: f64,
        /// Thickness of the rings from the core to the wall; `tanh` is fine at the wall only.
        #[serde(default)]
        stretching: Stretching,
        /// Periodic along x.
        #[serde(default = "yes")]
        periodic: bool,
    },
    /// A Gmsh file, format 4.1, ASCII or binary; physical groups of surfaces are the patches.
    Gmsh {
        /// Path of the `.msh` file, relative to the case file.
        file: String,
    },
    /// A VTK file of an unstructured grid: `.vtu` (text, base64, appended, zlib) or legacy `.vtk` (to version 5.1), as
    /// ParaView and meshio write them. Triangles and quadrilaterals are the patches, by a number for each surface; without any,
    /// the outer faces are: `x_min` … `z_max` in the planes of the bounding box, `boundary` elsewhere.
    Vtk {
        /// Path of the file, relative to the case file.
        file: String,
        /// Cell array that numbers the surfaces. Default: `patch`, `gmsh:physical` or `CellEntityIds`, whichever is there first.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        array: Option<String>,
        /// Names of the patches by their number in the array (or by what they are called without one), as in
        /// `{ 1 = "wall", 2 = "inlet" }`. Surfaces of one name are one patch; unnamed ones are called `surface_<number>`.
        #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
        patches: BTreeMap<String, String>,
        /// Patches that are periodic copies of each other; they are no patches any more.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        periodic: Vec<PeriodicPair>,
    },
    /// An OpenFOAM mesh of tetrahedra, pyramids, prisms and hexahedra, text or binary. Patches keep their names; `cyclic` ones
    /// become periods; `empty` ones need the condition `slip`.
    #[serde(rename = "openfoam")]
    OpenFoam {
        /// Path of the case or of its `polyMesh` folder, relative to the case file.
        folder: String,
    },
}

/// Two patches that are one surface of a periodic domain.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PeriodicPair {
    /// Names of the two.
    pub patches: [String; 2],
    /// From the first to the second [m]. Default: between their middles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub translation: Option<[f64; 3]>,
}

fn half() -> f64 {
    0.5
}

fn yes() -> bool {
    true
}

impl MeshSource {
    /// File or folder that the mesh is read from.
    pub fn file(&self) -> Option<&str> {
        match self {
            Self::Gmsh { file } | Self::Vtk { file, .. } | Self::OpenFoam { folder: file } => {
                Some(file)
            }
            Self::Box { .. } | Self::Pipe { .. } => None,
        }
    }
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
