//! What can be wrong with a mesh, with the place where it is wrong.

use crate::ElementKind;

/// Errors of building, reading, checking and distributing a mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// No mesh was given, or it has no elements.
    #[error("the mesh is empty: it has no elements")]
    Empty,
    /// A parameter of a generator is out of its range.
    #[error("mesh parameter `{name}` = {value} is not valid: {expected}")]
    Parameter {
        /// Name as in the case file.
        name: &'static str,
        /// Value as given.
        value: String,
        /// What would be valid.
        expected: String,
    },
    /// An element has a non-positive Jacobian at a vertex.
    #[error(
        "element {element} ({}) around ({:.6e}, {:.6e}, {:.6e}) is inverted or flat: its Jacobian at vertex {vertex} is {jacobian:.3e} m³",
        kind.name(), centre[0], centre[1], centre[2]
    )]
    Inverted {
        /// Index in the whole mesh.
        element: u64,
        /// Its kind.
        kind: ElementKind,
        /// Mean of its vertices \[m\].
        centre: [f64; 3],
        /// Local vertex with the smallest Jacobian.
        vertex: usize,
        /// That Jacobian (triple product of the edges there) \[m³\].
        jacobian: f64,
    },
    /// An index points outside its array.
    #[error("{what} {index} refers to {refers_to} {value}, but there are only {limit}")]
    Index {
        /// What holds the index.
        what: &'static str,
        /// Which one.
        index: usize,
        /// What is referred to.
        refers_to: &'static str,
        /// The index found.
        value: u64,
        /// Length of the array.
        limit: usize,
    },
    /// A coordinate is not finite.
    #[error("node {node} has the coordinates ({}, {}, {}), which are not finite", position[0], position[1], position[2])]
    NotFinite {
        /// Index in the whole mesh.
        node: u64,
        /// Its coordinates.
        position: [f64; 3],
    },
    /// A node that no element uses.
    #[error("node {node} at ({:.6e}, {:.6e}, {:.6e}) belongs to no element", position[0], position[1], position[2])]
    UnusedNode {
        /// Index in the whole mesh.
        node: u64,
        /// Its coordinates \[m\].
        position: [f64; 3],
    },
    /// A face of an element or of the boundary that does not fit its neighbours.
    #[error("{}face around ({:.6e}, {:.6e}, {:.6e}) {problem}", of_patch(patch), centre[0], centre[1], centre[2])]
    Face {
        /// Patch of a boundary face.
        patch: Option<String>,
        /// Mean of its vertices \[m\].
        centre: [f64; 3],
        /// What is wrong and what to do.
        problem: String,
    },
    /// A mesh file could not be read.
    #[error("{path}: {place}: {reason}")]
    Read {
        /// The file.
        path: String,
        /// Section with line (text) or byte (binary).
        place: String,
        /// What is wrong and what to do.
        reason: String,
    },
    /// The mesh is too large or too small for what was asked.
    #[error("{0}")]
    Size(String),
    /// Fourth order was asked for on a mesh that is no tensor product.
    #[error(
        "fourth order needs a mesh of axis-parallel hexahedra that is a tensor product of three coordinate lists; \
         this one is not: use second order"
    )]
    NotTensorProduct,
    /// The partitioner failed.
    #[error("{0}")]
    Partition(String),
    /// Set-up failed on rank 0; seen from the other ranks.
    #[error("set-up of the mesh failed on rank 0: {0}")]
    OnRoot(String),
}

fn of_patch(patch: &Option<String>) -> String {
    patch
        .as_ref()
        .map_or_else(String::new, |name| format!("patch `{name}`: "))
}
