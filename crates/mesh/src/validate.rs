//! Checks of a whole mesh before anything is computed on it.

use crate::{Mesh, MeshError};

/// Checks that every index points into its array and that the arrays fit each other.
///
/// # Errors
/// [`MeshError::Empty`], [`MeshError::Index`] or [`MeshError::Size`].
pub(crate) fn indices(mesh: &Mesh) -> Result<(), MeshError> {
    let elements = &mesh.elements;
    if elements.is_empty() || mesh.nodes.is_empty() {
        return Err(MeshError::Empty);
    }
    let vertices: usize = elements.kinds.iter().map(|k| k.vertices()).sum();
    let ends = elements.offsets.windows(2).map(|w| w[1] - w[0]);
    let fits = elements.offsets.len() == elements.len() + 1
        && elements.nodes.len() == vertices
        && elements.images.len() == vertices
        && ends
            .zip(&elements.kinds)
            .all(|(n, k)| n as usize == k.vertices());
    if !fits {
        return Err(MeshError::Size(
            "the element arrays do not fit each other".into(),
        ));
    }
    let check = |what, index, refers_to, value: u64, limit| {
        let error = MeshError::Index {
            what,
            index,
            refers_to,
            value,
            limit,
        };
        if value < limit as u64 {
            Ok(())
        } else {
            Err(error)
        }
    };
    for e in 0..elements.len() {
        for &node in elements.nodes(e) {
            check("element", e, "node", node.into(), mesh.nodes.len())?;
        }
    }
    for (f, face) in mesh.boundary.iter().enumerate() {
        let patch = face.patch.into();
        check("boundary face", f, "patch", patch, mesh.patches.len())?;
        if !(3..=4).contains(&face.vertices) {
            return Err(MeshError::Size(format!(
                "boundary face {f} has {} vertices; 3 or 4 are supported",
                face.vertices
            )));
        }
        for &node in &face.nodes[..face.vertices as usize] {
            check("boundary face", f, "node", node.into(), mesh.nodes.len())?;
        }
    }
    Ok(())
}
