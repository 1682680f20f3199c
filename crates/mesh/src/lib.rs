//! Nodes, elements, median-dual geometry, generators, readers, quality.

mod local;
mod topology;

pub use local::{BoundaryNode, DualGeometry, LocalMesh};
pub use topology::{BoundaryFace, ElementKind, Elements, Image, Mesh, Periods};
