//! Nodes, elements, median-dual geometry, generators, readers, quality.

mod affine;
mod blocks;
mod distribute;
mod error;
mod faces;
mod facets;
mod generate;
pub mod geometry;
pub mod gmsh;
mod graph;
mod jacobian;
pub mod jet;
mod line;
mod local;
mod pack;
mod piece;
mod quality;
mod renumber;
pub mod shape;
mod tensor;
mod topology;
mod validate;

pub use affine::Affine;
pub use distribute::{distribute, distribute_from, distribute_layers};
pub use error::MeshError;
pub use facets::facets;
pub use generate::{BoxElement, BoxMesh, Stretching};
pub use line::{Line, LinePair};
pub use local::{BoundaryNode, DualGeometry, LocalMesh, TensorLines};
pub use quality::{PatchQuality, QualityReport, quality};
pub use renumber::{Bandwidth, Renumbering, renumber};
pub use tensor::TensorGrid;
pub use topology::{BoundaryFace, ElementKind, Elements, Image, Mesh, Periods};
pub use validate::validate;
