//! Boundary patches as triangles.

use crate::LocalMesh;
use bytemuck::{Pod, Zeroable};

/// A triangle of a boundary face as it travels.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Facet {
    /// Global nodes of the face in ascending order, and which half of a quadrilateral.
    key: [u64; 5],
    corners: [[f64; 3]; 3],
}

/// Triangles of the patches with the given indices, normals (right-hand rule) pointing into the domain \[m\]; a
/// quadrilateral gives two. The same on every rank and in the same order on any number of ranks. Collective.
pub fn facets(mesh: &LocalMesh, patches: &[usize]) -> Vec<[[f64; 3]; 3]> {
    let mut own = Vec::new();
    for face in &mesh.boundary {
        // The rank of its first node sends a face.
        if face.nodes[0] as usize >= mesh.owned() || !patches.contains(&(face.patch as usize)) {
            continue;
        }
        let count = face.vertices as usize;
        let corner = |k: usize| {
            let node = &mesh.nodes[face.nodes[k] as usize];
            let shift = mesh.periods.shift(face.images[k]);
            std::array::from_fn(|c| node[c] + shift[c])
        };
        let mut key = [u64::MAX; 5];
        for (slot, &node) in key.iter_mut().zip(&face.nodes[..count]) {
            *slot = mesh.global_nodes[node as usize];
        }
        key[..count].sort_unstable();
        for half in 0..count - 2 {
            key[4] = half as u64;
            let corners = [corner(0), corner(half + 2), corner(half + 1)];
            own.push(Facet { key, corners });
        }
    }
    let gathered = mesh.halo.communicator().all_gather(&own);
    let mut all: Vec<Facet> = gathered.into_iter().flatten().collect();
    all.sort_unstable_by_key(|facet| facet.key);
    all.into_iter().map(|facet| facet.corners).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{distribute_from, gmsh};
    use fibreflow_parallel::Communicator;
    use std::path::Path;

    /// The inward area vectors of a closed surface sum to nothing, and its volume comes out negative.
    #[test]
    fn all_patches_enclose_the_domain() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../meshes/mixed.msh");
        let mesh = distribute_from(&Communicator::single(), || gmsh::read(&path)).expect("mesh");
        let (mut sum, mut volume, mut total) = ([0.0; 3], 0.0, 0.0);
        for [a, b, c] in facets(&mesh, &[0, 1, 2]) {
            let (u, v) = (
                [0, 1, 2].map(|k| b[k] - a[k]),
                [0, 1, 2].map(|k| c[k] - a[k]),
            );
            let area = [0, 1, 2].map(|k| {
                let (m, n) = ((k + 1) % 3, (k + 2) % 3);
                0.5 * (u[m] * v[n] - u[n] * v[m])
            });
            for k in 0..3 {
                sum[k] += area[k];
                volume -= a[k] * area[k] / 3.0;
            }
            total += area.iter().map(|x| x * x).sum::<f64>().sqrt();
        }
        assert!(sum.iter().all(|x| x.abs() < 1e-12));
        assert!(
            (total - 12.0).abs() < 1e-9 && (volume - 2.5).abs() < 1e-9,
            "{total} {volume}"
        );
    }
}
