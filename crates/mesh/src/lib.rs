//! Nodes, elements, median-dual geometry, generators, readers, quality.

mod affine;
mod assemble;
mod blocks;
mod distribute;
mod error;
mod faces;
mod facets;
pub mod foam;
mod generate;
pub mod geometry;
pub mod gmsh;
mod graph;
mod jacobian;
pub mod jet;
mod line;
mod local;
mod matching;
#[cfg(test)]
mod measures;
mod pack;
mod periodic;
mod piece;
mod quality;
mod renumber;
pub mod shape;
mod skewness;
mod source;
mod tensor;
mod topology;
mod validate;
pub mod vtk;

pub use affine::Affine;
pub use distribute::{distribute, distribute_from, distribute_layers};
pub use error::MeshError;
pub use facets::facets;
pub use generate::{BoxElement, BoxMesh, PipeMesh, Stretching};
pub use line::{Line, LinePair};
pub use local::{BoundaryNode, DualGeometry, LocalMesh, TensorLines};
pub use matching::PeriodicPatches;
pub use quality::{PatchQuality, QualityReport, quality};
pub use renumber::{Bandwidth, Renumbering, renumber};
pub use tensor::TensorGrid;
pub use topology::{BoundaryFace, ElementKind, Elements, Image, Mesh, Periods};
pub use validate::validate;
