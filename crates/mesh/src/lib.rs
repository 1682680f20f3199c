//! Nodes, elements, median-dual geometry, generators, readers, quality.

mod error;
mod local;
mod topology;

pub use error::MeshError;
pub use local::{BoundaryNode, DualGeometry, LocalMesh};
pub use topology::{BoundaryFace, ElementKind, Elements, Image, Mesh, Periods};
