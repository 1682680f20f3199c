//! Fibres: shape, material, placement, contacts, hydrodynamic laws, coupling.

use super::population::{Orientation, Quantity, Region, Shortfall};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A group of equal fibres.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FibreGroup {
    /// Where the fibres are at the start.
    pub placement: Placement,
    /// Length along the axis [m]. Needed for random placement; otherwise it follows from the positions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<Quantity>,
    /// Diameter [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub diameter: f64,
    /// Beam segments of a fibre; of one of mean length where lengths differ, others in proportion. Needed unless all nodes are given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1))]
    pub segments: Option<usize>,
    /// Young's modulus [Pa].
    pub youngs_modulus: Quantity,
    /// Poisson's ratio.
    #[serde(default = "poisson_ratio")]
    #[schemars(extend("exclusiveMinimum" = -1), range(max = 0.5))]
    pub poisson_ratio: f64,
    /// Density [kg/m³].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// Internal damping: retardation time of the material, viscous by elastic modulus [s].
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub retardation: f64,
    /// Tensile stress at which a fibre breaks, from bending and tension together [Pa]. Default: it never does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub strength: Option<f64>,
    /// Fibres give way to shear (Timoshenko) instead of bending alone (Euler, Bernoulli).
    #[serde(default)]
    pub shear: bool,
    /// Diameter of the last end over that of the first; `diameter` is that in the middle, which the aspect ratio of drag
    /// laws and reports is made of.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub taper: f64,
    /// Bending stiffness in the plane of tangent and `section_axis` over that across it; their mean is E I. Other than 1 for
    /// ribbons and collapsed pulp fibres, which touch and feel the flow as round ones.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub bending_ratio: f64,
    /// Direction of the plane of `bending_ratio`: of a fibre's placed shape where it is straight or as placed without
    /// load, else of its shape without load (which lies along x, a U in the plane x y).
    #[serde(default = "section_axis")]
    pub section_axis: [f64; 3],
    /// What the fibres can do.
    #[serde(default)]
    pub kinematics: Kinematics,
    /// Joints of linked fibres.
    #[serde(default)]
    pub joints: Joints,
    /// Shape without load.
    #[serde(default)]
    pub shape: Shape,
    /// Twist of the shape without load about its tangent [rad/m]; fibres that are placed in another shape are placed without.
    #[serde(default)]
    pub twist: f64,
    /// Ends that are held in place and direction.
    #[serde(default)]
    pub clamp: Clamp,
    /// Constant forces on nodes.
    #[serde(default)]
    pub point_loads: Vec<PointLoad>,
}

fn poisson_ratio() -> f64 {
    0.3
}

fn one() -> f64 {
    1.0
}

fn section_axis() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

/// Where the fibres of a group are at the start.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Placement {
    /// At random without overlap with any fibre of any group, in the box of the mesh or of the ambient flow or in a region.
    Random {
        /// Number of fibres; this or `volume_fraction`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        count: Option<usize>,
        /// Volume of fibres by volume of the region; this or `count`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0), range(max = 0.5))]
        volume_fraction: Option<f64>,
        /// Seed of the random numbers.
        #[serde(default)]
        seed: u64,
        /// Directions.
        #[serde(default)]
        orientation: Orientation,
        /// Where. Default: the box of the mesh or of the ambient flow.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        region: Option<Region>,
        /// Least distance between surfaces of fibres, and of fibres and walls [m].
        #[serde(default)]
        #[schemars(range(min = 0.0))]
        gap: f64,
        /// In which form the fibres are placed.
        #[serde(default)]
        form: Form,
        /// What happens when there is no room for all.
        #[serde(default)]
        shortfall: Shortfall,
    },
    /// One straight fibre between two points.
    Line {
        /// First end [m].
        start: [f64; 3],
        /// Last end [m].
        end: [f64; 3],
    },
    /// Fibres through nodes from a file.
    File {
        /// Path, relative to the case file: a CSV file with columns x, y, z [m], and `fibre`, a number for each fibre, where
        /// there are several, nodes in the order of the lines; or a `.vtp` file, one fibre a line (not as compressed base64 within the tags, pyvista's default).
        file: String,
    },
    /// Linked fibres with the frames of their segments, which nodes leave open; `length` is that of a fibre.
    Frames {
        /// Path of a CSV file, relative to the case file: the columns fibre, a number for each, x, y, z, the middle of a segment [m], and
        /// q0, q1, q2, q3, the Euler parameters (scalar first) that turn the x axis into the segment's, in the order of the segments.
        file: String,
    },
    /// One fibre through given nodes.
    Nodes {
        /// Node positions [m].
        #[schemars(length(min = 2))]
        positions: Vec<[f64; 3]>,
    },
}

/// Shape without load.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Shape {
    /// Straight.
    #[default]
    Straight,
    /// An arc that turns by the same angle at every node.
    U {
        /// Angle between the two end tangents, seen from the middle [rad]: π is straight, 0 a half circle.
        #[schemars(range(min = 0.0, max = std::f64::consts::PI))]
        opening_angle: f64,
    },
    /// A right-handed helix; its length is that of the fibre.
    Helix {
        /// Radius [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius: f64,
        /// Advance in a turn [m].
        #[schemars(range(min = 0.0))]
        pitch: f64,
    },
    /// Straight segments that bend at every inner node by one angle, and turn about themselves by another from bend to bend: an
    /// arc without turning, else a helix (Switzer 2002, figure 2.8).
    Chain {
        /// Angle between neighbouring segments [rad].
        #[schemars(range(min = 0.0, max = 3.0))]
        bend: f64,
        /// Angle between the planes of neighbouring bends [rad].
        #[serde(default)]
        #[schemars(range(min = -3.15, max = 3.15))]
        turn: f64,
    },
    /// Any polyline, scaled to the length of the fibre, with as many nodes as the fibre.
    File {
        /// Path of a CSV file with the columns x, y, z, or of a `.vtp` file with one line, relative to the case file.
        file: String,
    },
    /// As placed: the given nodes are free of stress.
    AsPlaced,
}

/// Form in which random fibres are placed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Form {
    /// In their shape without load.
    #[default]
    Relaxed,
    /// Straight, whatever their shape without load.
    Straight,
}

/// What fibres can do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kinematics {
    /// A chain of beam elements: six unknowns a node.
    #[default]
    Flexible,
    /// Without twist: three unknowns a node, always implicit. For fibres that are round and straight without load.
    TwistFree,
    /// Keeps the shape it is placed in: six unknowns a fibre.
    Rigid,
    /// Rigid segments with joints, without inertia (Switzer 2002): in a prescribed flow, for all groups of the case or none.
    Linked,
    /// Rigid where the viscous load of the shear rate is below a tenth of that which buckles the fibre, else without twist where
    /// that can be, else flexible.
    Auto,
}

/// What the joints of linked fibres let their segments do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Joints {
    /// Bend in all directions and twist.
    #[default]
    Ball,
    /// Bend in the plane of tangent and `section_axis` alone, and twist.
    Pin,
}

/// Ends that are held in place and direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Clamp {
    /// Both ends free.
    #[default]
    None,
    /// First node.
    First,
    /// Last node.
    Last,
    /// Both.
    Both,
}

/// A constant force on one node of every fibre of the group.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PointLoad {
    /// Node, from 0; negative counts from the end: −1 is the last.
    pub node: i64,
    /// Force [N].
    pub force: [f64; 3],
}

/// Drag and torque laws.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Hydrodynamics {
    /// Force per length.
    pub drag: DragLaw,
    /// Torque per length.
    pub torque: TorqueLaw,
    /// Constants of slender-body theory, in `drag` of `auto` and `slender-body` and in `torque` of `jeffery`.
    pub slender_body: SlenderBody,
    /// Aspect ratio of the spheroid that stands for a segment, with `prolate-spheroid`.
    pub spheroid: Spheroid,
    /// Adds the inertia of the displaced fluid: its pressure gradient, and added mass across the fibre. Not for rigid fibres.
    pub fluid_inertia: bool,
}

/// Force per length on a segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DragLaw {
    /// By the Reynolds number of the normal slip.
    #[default]
    Auto,
    /// Slender body in creeping flow (Batchelor 1970).
    SlenderBody,
    /// Infinite cylinder (Tomotika; Marheineke & Wegener; Taylor).
    InfiniteCylinder,
    /// Every segment a prolate spheroid in creeping flow (Kunhappan 4.11): depends on the number of segments, for comparison.
    ProlateSpheroid,
    /// No force.
    None,
}

/// Constants of slender-body theory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SlenderBody {
    /// Those of a constant slip: ln 2 − 3/2 along, ln 2 − 1/2 across.
    #[default]
    Batchelor,
    /// ln 2 − 3/2 both along and across, as Kunhappan 6.5.
    Kunhappan,
    /// As `batchelor`, and ln 2 − 17/6, ln 2 − 11/6 for the part of the slip that is linear along a straight fibre.
    Split,
    /// As `split`, with more drag near the ends.
    Ends,
}

/// Aspect ratio r_e of a spheroid that stands for a segment of length l.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Spheroid {
    /// 1.24 (l/d)/√ln(l/d) (Cox; Kunhappan 4.14).
    #[default]
    Cox,
    /// 0.7 l/d (Bretherton; Kunhappan 4.13g).
    Bretherton,
}

/// Torque per length on a segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TorqueLaw {
    /// The constant that gives a straight rigid fibre Jeffery's period at Cox's aspect ratio.
    #[default]
    Jeffery,
    /// Spin and strain terms with Kunhappan's constants (4.27, 4.28).
    Kunhappan,
    /// Every segment a prolate spheroid (Kunhappan 4.12), with `drag` of that name.
    ProlateSpheroid,
    /// No torque.
    None,
}

/// Gravity.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Gravity {
    /// Acceleration [m/s²].
    pub acceleration: [f64; 3],
}

/// A prescribed flow.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum AmbientFlow {
    /// At rest.
    Quiescent,
    /// The same everywhere.
    Uniform {
        /// Velocity [m/s].
        velocity: [f64; 3],
    },
    /// Simple shear: u = rate · y.
    Shear {
        /// Shear rate [1/s].
        rate: f64,
    },
    /// Uniaxial extension along x: u = rate (x, −y/2, −z/2).
    Extension {
        /// Extension rate [1/s].
        rate: f64,
    },
    /// Planar extension: u = rate (x, −y, 0).
    PlanarExtension {
        /// Extension rate [1/s].
        rate: f64,
    },
    /// Counter-rotating cells: u = velocity (sin kx cos ky, −cos kx sin ky, 0), k = 2π/wavelength.
    Vortex {
        /// Largest velocity [m/s].
        velocity: f64,
        /// Wavelength of the cells [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        wavelength: f64,
    },
}
