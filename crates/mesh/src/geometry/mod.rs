//! Dual geometry: area vectors, diffusive weights and volumes of node pairs, assembled element by element.
//!
//! Galerkin form, on anything: S_ij = ∫(N_i∇N_j − N_j∇N_i), w_ij = −∫∇N_i·∇N_j, V_i = ∫N_i over the isoparametric
//! elements; all pairs of vertices of an element, also across its diagonals. Then Σ_j ½S_ij(φ_i + φ_j) = V_i ∇φ and
//! Σ_j w_ij(φ_j − φ_i) = 0 for a linear φ at interior nodes of any mesh. On tetrahedra this is the median dual.
//! Two-point form, where every element of the whole mesh is an orthogonal hexahedron: dual faces between edge
//! neighbours, w = |S|/|d|. The two are never mixed, because that would lose linear exactness where they meet.
//! Source: NUMERICS section 1.

mod element;
mod flux;
mod rows;
mod tensor;

pub use flux::{FluxRule, face_pairs};
pub use tensor::fourth;

use crate::{BoundaryNode, DualGeometry, ElementKind, LocalMesh, MeshError, TensorGrid};
use element::Form;
use fibreflow_parallel::block_sum;
use rayon::prelude::*;
use rows::Rows;

/// Assembles the dual geometry of the owned nodes. Collective.
///
/// Entries are summed over elements in the order of the whole mesh, so S is antisymmetric and w symmetric bitwise,
/// also between ranks, and the result does not depend on the thread count.
///
/// # Errors
/// On every rank alike: [`MeshError::Inverted`] for the first element with a non-positive Jacobian at a
/// Gauss point, [`MeshError::Size`] when an element spans more than one period or the mesh has more entries than `u32` counts.
pub fn dual(mesh: &LocalMesh) -> Result<DualGeometry, MeshError> {
    let communicator = mesh.halo.communicator();
    let orthogonal = !communicator.any(!all_orthogonal(mesh));
    let form = if orthogonal {
        Form::TwoPoint
    } else {
        Form::Galerkin
    };
    let rows = agree(mesh, Rows::assemble(mesh, form))?;
    let owned = mesh.owned();
    let mut volumes = rows.volumes;
    volumes.resize(mesh.total(), 0.0);
    mesh.halo.update(&mut volumes);
    let volume = block_sum(owned, |range| volumes[range].iter().sum());
    Ok(DualGeometry {
        offsets: rows.offsets,
        columns: rows.columns,
        images: rows.images,
        faces: rows.faces,
        masses: rows.masses,
        displacements: rows.displacements,
        total_volume: communicator.sum(volume),
        volumes,
        boundary: boundary_shares(mesh, form),
        self_pairs: rows.self_pairs,
        orthogonal,
        tensor: if orthogonal {
            TensorGrid::detect(mesh).map(tensor::second)
        } else {
            None
        },
    })
}

fn all_orthogonal(mesh: &LocalMesh) -> bool {
    let elements = &mesh.elements;
    (0..elements.len()).into_par_iter().all(|e| {
        let x = elements.coordinates(e, &mesh.nodes, &mesh.periods);
        element::is_orthogonal(elements.kinds[e], &x)
    })
}

/// Sums the shares of all faces for every (owned node, patch), in the order of the faces.
fn boundary_shares(mesh: &LocalMesh, form: Form) -> Vec<BoundaryNode> {
    let mut shares = Vec::new();
    for face in &mesh.boundary {
        let areas = element::face_shares(form, face, &mesh.nodes, &mesh.periods);
        for (&node, area) in face.nodes.iter().zip(areas).take(face.vertices.into()) {
            if (node as usize) < mesh.owned() {
                let patch = face.patch;
                shares.push(BoundaryNode { node, patch, area });
            }
        }
    }
    shares.sort_by_key(|share| (share.node, share.patch));
    shares.dedup_by(|next, sum| {
        let same = (next.node, next.patch) == (sum.node, sum.patch);
        if same {
            (0..3).for_each(|c| sum.area[c] += next.area[c]);
        }
        same
    });
    shares
}

/// A local failure as numbers that travel: (global element, kind, centre, vertex, Jacobian; vertex −1 for a period).
type Failure = [f64; 7];

/// The same outcome on every rank: the failure with the smallest element anywhere.
fn agree(mesh: &LocalMesh, outcome: Result<Rows, rows::Failure>) -> Result<Rows, MeshError> {
    let local: Vec<Failure> = outcome
        .as_ref()
        .err()
        .map(|failure| {
            let e = failure.element;
            let kind = mesh.elements.kinds[e];
            let n = kind.vertices();
            let x = mesh.elements.coordinates(e, &mesh.nodes, &mesh.periods);
            let mean = |c: usize| x[..n].iter().map(|x| x[c]).sum::<f64>() / n as f64;
            let (vertex, jacobian) = failure
                .inversion
                .map_or((-1.0, 0.0), |(v, jacobian)| (v as f64, jacobian));
            let element = mesh.global_elements[e] as f64;
            let kind = f64::from(kind as u8);
            [element, kind, mean(0), mean(1), mean(2), vertex, jacobian]
        })
        .into_iter()
        .collect();
    let first = mesh
        .halo
        .communicator()
        .all_gather(&local)
        .into_iter()
        .flatten()
        .min_by(|a, b| a[0].total_cmp(&b[0]));
    match (first, outcome) {
        (Some([element, kind, x, y, z, vertex, jacobian]), _) if vertex >= 0.0 => {
            Err(MeshError::Inverted {
                element: element as u64,
                kind: ElementKind::ALL[kind as usize],
                centre: [x, y, z],
                vertex: vertex as usize,
                jacobian,
            })
        }
        (Some([element, _, x, y, z, ..]), _) => Err(MeshError::Size(format!(
            "element {element} around ({x:.6e}, {y:.6e}, {z:.6e}) spans more than one period"
        ))),
        (None, Ok(rows)) => {
            let fits = u32::try_from(rows.columns.len()).is_ok();
            if mesh.halo.communicator().any(!fits) {
                return Err(MeshError::Size(
                    "a rank has more node pairs than 32 bits count: use more ranks".into(),
                ));
            }
            Ok(rows)
        }
        (None, Err(_)) => unreachable!("a local failure is among those gathered"),
    }
}

#[cfg(test)]
mod tests;
