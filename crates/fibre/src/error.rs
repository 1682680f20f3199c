//! Errors of the fibre crate.

use crate::Vector3;
use crate::contact::ContactError;

/// What can be wrong with fibres, at set-up or in time.
#[derive(Debug, thiserror::Error)]
pub enum FibreError {
    /// A fibre needs at least two nodes.
    #[error("fibre {fibre} has {nodes} node(s); a fibre needs at least two")]
    TooFewNodes {
        /// Global id.
        fibre: u64,
        /// Nodes given.
        nodes: usize,
    },
    /// More segments than a segment id can count.
    #[error("fibre {fibre} has {segments} segments; at most {limit} are possible")]
    TooManySegments {
        /// Global id.
        fibre: u64,
        /// Segments given.
        segments: usize,
        /// Largest possible number.
        limit: usize,
    },
    /// The id leaves no room for the segment index in a segment id.
    #[error("fibre id {fibre} is too large; ids must be below {limit}")]
    IdTooLarge {
        /// Global id.
        fibre: u64,
        /// First id that is refused.
        limit: u64,
    },
    /// Two fibres with one id.
    #[error("two fibres have the id {fibre}")]
    DuplicateId {
        /// Global id.
        fibre: u64,
    },
    /// Two neighbouring nodes coincide, or the chain folds back on itself.
    #[error(
        "fibre {fibre}: segment {segment} of the {shape} shape has no length or folds back onto its neighbour"
    )]
    DegenerateShape {
        /// Global id.
        fibre: u64,
        /// Index of the segment in the fibre.
        segment: usize,
        /// `placed` or `equilibrium`.
        shape: &'static str,
    },
    /// A rigid fibre is held somewhere.
    #[error("fibre {fibre} is rigid and has supports; only flexible fibres can be held")]
    RigidSupport {
        /// Global id.
        fibre: u64,
    },
    /// A fibre whose energy is not told by positions alone.
    #[error("fibre {fibre} {reason}, so it cannot be twist-free")]
    TwistFree {
        /// Global id.
        fibre: u64,
        /// Why not.
        reason: &'static str,
    },
    /// A section that bends more easily one way needs to know which.
    #[error(
        "fibre {fibre}: the axis {axis:?} of its section does not lie across its first segment"
    )]
    SectionAxis {
        /// Global id.
        fibre: u64,
        /// Given axis.
        axis: Vector3,
    },
    /// Segments are too long for the twist.
    #[error(
        "fibre {fibre}: the twist of {twist} rad/m is beyond {limit:.4e} rad/m, which its segments can have; use shorter ones"
    )]
    Twist {
        /// Global id.
        fibre: u64,
        /// Twist \[rad/m\].
        twist: f64,
        /// Largest possible \[rad/m\].
        limit: f64,
    },
    /// A rigid fibre with the inertia of the fluid.
    #[error("fibre {fibre} is rigid; only flexible fibres can have the inertia of the fluid")]
    RigidInertia {
        /// Global id.
        fibre: u64,
    },
    /// A fibre that cannot be a chain of rigid segments.
    #[error("fibre {fibre} {reason}")]
    Linked {
        /// Global id.
        fibre: u64,
        /// Why not.
        reason: &'static str,
    },
    /// Linked fibres on more than one rank.
    #[error("linked fibres run on one rank; threads share the work there")]
    LinkedRanks,
    /// Linked fibres in a sampled flow by the explicit scheme.
    #[error("linked fibres move implicitly in a flow that is solved for")]
    LinkedSampled,
    /// A wall of linked fibres that is no plane.
    #[error("walls of linked fibres are planes with a point and a normal")]
    LinkedWall,
    /// The equilibrium shape has another number of nodes than the fibre.
    #[error("fibre {fibre} has {nodes} nodes but its equilibrium shape has {equilibrium}")]
    EquilibriumSize {
        /// Global id.
        fibre: u64,
        /// Nodes of the fibre.
        nodes: usize,
        /// Nodes of the equilibrium shape.
        equilibrium: usize,
    },
    /// A material constant is not usable.
    #[error("fibre {fibre}: {quantity} is {value}; it must be {requirement}")]
    Material {
        /// Global id.
        fibre: u64,
        /// Name of the constant.
        quantity: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        requirement: &'static str,
    },
    /// A node index beyond the fibre's end.
    #[error("fibre {fibre} has {nodes} nodes; node {node} does not exist")]
    NoSuchNode {
        /// Global id.
        fibre: u64,
        /// Index asked for.
        node: usize,
        /// Nodes of the fibre.
        nodes: usize,
    },
    /// A fibre that this rank does not hold.
    #[error("fibre {fibre} is not held by this rank")]
    NoSuchFibre {
        /// Global id.
        fibre: u64,
    },
    /// A setting is not usable.
    #[error("{setting} is {value}; it must be {requirement}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        requirement: &'static str,
    },
    /// A stored fibre cannot be read.
    #[error("the record of fibre {fibre} cannot be read: {reason}")]
    Record {
        /// Global id.
        fibre: u64,
        /// What is wrong.
        reason: &'static str,
    },
    /// A list of owners does not fit.
    #[error("{given} owners are given for {fibres} fibres, or one of them is not a rank")]
    Owners {
        /// Fibres of this rank.
        fibres: usize,
        /// Owners given.
        given: usize,
    },
    /// Contacts cannot be computed.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// The flow is not given at all points.
    #[error("the fibres have {points} hydrodynamic points but the flow is given at {given}")]
    AmbientSize {
        /// Points of this rank.
        points: usize,
        /// Values given.
        given: usize,
    },
    /// A flow is given but no law for what it does.
    #[error("fibres in a flow need a hydrodynamic law in their settings")]
    NoHydrodynamics,
    /// The implicit integrator finds no answer, however short its sub-step.
    #[error("fibre {fibre}, centre ({:.6e}, {:.6e}, {:.6e}): the implicit integrator found no answer in its shortest sub-step", position.x, position.y, position.z)]
    NoConvergence {
        /// Global id.
        fibre: u64,
        /// Centre of mass \[m\].
        position: Vector3,
    },
    /// Rigid fibres in implicit steps with contacts.
    #[error("rigid and twist-free fibres that may touch need the explicit integrator")]
    RigidContact,
    /// The implicit step of fibres that touch finds no answer, however short its sub-step.
    #[error(
        "the implicit step of touching fibres found no answer in its shortest sub-step; take a smaller step or softer contacts"
    )]
    NoJointConvergence,
    /// A position, velocity or rotation is not finite.
    #[error("fibre {fibre}, node {node}: non-finite {field} at position ({:.6e}, {:.6e}, {:.6e})", position.x, position.y, position.z)]
    NonFinite {
        /// Global id.
        fibre: u64,
        /// Index of the node in the fibre.
        node: usize,
        /// Which field.
        field: &'static str,
        /// Where the node is, as far as known.
        position: Vector3,
    },
}
