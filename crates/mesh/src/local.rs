//! What one rank holds: its part of the mesh and its rows of the dual geometry.

use crate::{BoundaryFace, Elements, Image, Line, Mesh, Periods, TensorGrid};
use fibreflow_parallel::{Communicator, Halo};

/// One rank's part of a mesh: owned nodes first, then one layer of halo nodes, or several (see
/// [`crate::distribute_layers`]).
///
/// Every element that touches an owned node is here, in the order of the whole mesh, so that the rows of owned nodes
/// are assembled without communication and in the same order on any number of ranks.
#[derive(Clone, Debug)]
pub struct LocalMesh {
    /// Node coordinates \[m\], owned then halo, length `halo.total()`.
    pub nodes: Vec<[f64; 3]>,
    /// Index of every local node in the whole mesh. Owned nodes are in ascending order.
    pub global_nodes: Vec<u64>,
    /// Elements that touch an owned node; vertices are local node indices.
    pub elements: Elements,
    /// Index of every local element in the whole mesh.
    pub global_elements: Vec<u64>,
    /// True for the elements that this rank owns (the owner of an element's first-listed node); each has one owner.
    pub owned_elements: Vec<bool>,
    /// Boundary faces that touch an owned node; local node indices.
    pub boundary: Vec<BoundaryFace>,
    /// Patch names, the same on every rank.
    pub patches: Vec<String>,
    /// Periodic directions.
    pub periods: Periods,
    /// Exchange of node fields.
    pub halo: Halo,
    /// Nodes of the whole mesh.
    pub total_nodes: usize,
    /// Elements of the whole mesh.
    pub total_elements: usize,
}

impl LocalMesh {
    /// The whole mesh on one rank, without communication.
    pub fn single(mesh: Mesh) -> Self {
        let (nodes, elements) = (mesh.nodes.len(), mesh.elements.len());
        Self {
            nodes: mesh.nodes,
            global_nodes: (0..nodes as u64).collect(),
            elements: mesh.elements,
            global_elements: (0..elements as u64).collect(),
            owned_elements: vec![true; elements],
            boundary: mesh.boundary,
            patches: mesh.patches,
            periods: mesh.periods,
            halo: Halo::none(&Communicator::single(), nodes),
            total_nodes: nodes,
            total_elements: elements,
        }
    }

    /// Nodes this rank owns.
    pub fn owned(&self) -> usize {
        self.halo.owned()
    }

    /// Owned and halo nodes.
    pub fn total(&self) -> usize {
        self.halo.total()
    }
}

/// A boundary node's share of a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundaryNode {
    /// Local index of an owned node.
    pub node: u32,
    /// Patch index.
    pub patch: u16,
    /// ∮ N_i n dA over the patch \[m²\], pointing out of the domain.
    pub area: [f64; 3],
}

/// Rows of pairs (i, j) of the median-dual finite volumes, for owned nodes.
///
/// Entry e of row i joins node i to the image `images[e]` of node `columns[e]`. Rows are sorted by (global index of
/// the column, image code), so that an entry keeps its place on any number of ranks. Pairs of a node with its own
/// image are kept apart in `self_pairs` (they cancel in every operator on periodic fields).
/// S_ij = −S_ji and w_ij = w_ji bitwise. Source: NUMERICS section 1 (K 3.3).
#[derive(Clone, Debug)]
pub struct DualGeometry {
    /// Row starts, length owned + 1.
    pub offsets: Vec<u32>,
    /// Local node index j of every entry.
    pub columns: Vec<u32>,
    /// Image of j seen from i.
    pub images: Vec<Image>,
    /// (S_x, S_y, S_z, w): dual-face area vector from i to j \[m²\] and diffusive weight \[m\]:
    /// ∮∇φ·dS ≈ Σ_j w_ij (φ_j − φ_i).
    pub faces: Vec<[f64; 4]>,
    /// Mass couplings m_ij = ∫N_i N_j \[m³\], m_ij = m_ji bitwise: Σ_j m_ij = V_i with the node itself and its images.
    /// Empty where pairs are two-point. In single precision: Σ_j m_ij (x_i − x_j) conserves whatever their last digits.
    pub masses: Vec<f32>,
    /// x_j + shift − x_i \[m\].
    pub displacements: Vec<[f64; 3]>,
    /// Dual volumes \[m³\] of owned and halo nodes.
    pub volumes: Vec<f64>,
    /// Boundary shares, sorted by (node, patch). Σ_j S_ij + Σ_patches area = 0 for every owned node.
    pub boundary: Vec<BoundaryNode>,
    /// Pairs of an owned node with its own image: (node, image, face).
    pub self_pairs: Vec<(u32, Image, [f64; 4])>,
    /// True when all elements are orthogonal hexahedra: pairs along the edges only.
    pub orthogonal: bool,
    /// Volume of the whole mesh \[m³\], the same on every rank.
    pub total_volume: f64,
    /// Set when the pairs are the tensor product of three lines.
    pub tensor: Option<TensorLines>,
}

/// A tensor-product mesh with the one-dimensional operators of its pairs.
#[derive(Clone, Debug, PartialEq)]
pub struct TensorLines {
    /// Coordinates, and the place of every local node.
    pub grid: TensorGrid,
    /// Operators along x, y, z.
    pub lines: [Line; 3],
}

impl DualGeometry {
    /// Entry range of row i.
    pub fn row(&self, i: usize) -> std::ops::Range<usize> {
        self.offsets[i] as usize..self.offsets[i + 1] as usize
    }
}
