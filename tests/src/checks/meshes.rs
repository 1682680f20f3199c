//! Meshes for the checks.

use fibreflow_mesh::{BoxMesh, Mesh, MeshError};

/// A unit cube of n³ hexahedra, periodic in z.
pub fn cube(n: usize) -> Result<Mesh, MeshError> {
    BoxMesh {
        cells: [n; 3],
        periodic: [false, false, true],
        ..BoxMesh::default()
    }
    .build()
}
