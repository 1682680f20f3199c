//! Meshes for the checks.

use fibreflow_mesh::{BoxMesh, Mesh, MeshError, gmsh as reader, renumber, validate};
use std::path::Path;

/// A unit cube of n³ hexahedra, periodic in z.
pub fn cube(n: usize) -> Result<Mesh, MeshError> {
    BoxMesh {
        cells: [n; 3],
        periodic: [false, false, true],
        ..BoxMesh::default()
    }
    .build()
}

/// A Gmsh mesh of the folder `meshes`, renumbered.
///
/// # Errors
/// As reading and validating.
pub fn gmsh(name: &str) -> Result<Mesh, MeshError> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../meshes");
    let mut mesh = reader::read(&folder.join(format!("{name}.msh")))?;
    validate(&mesh)?;
    renumber(&mut mesh)?;
    Ok(mesh)
}
