//! Gmsh meshes, format MSH 4.1, text and binary.

mod build;
mod links;
mod sections;
mod tags;

#[cfg(test)]
mod tests;

use crate::source::{Source, bytes_of};
use crate::{Mesh, MeshError};
use std::path::Path;

/// Reads a mesh of tetrahedra, pyramids, prisms and hexahedra from a Gmsh file (MSH 4.1, text or binary).
///
/// - Physical surfaces become patches, in the order of their tags; one without a name is called `surface_<tag>`.
///   Their faces are turned to point out of the domain.
/// - Surfaces that `$Periodic` joins become one, whether in a physical group or not: nodes are identified along the
///   chains of copies, and the translations are the lattice vectors. Rotations are refused.
/// - Volume elements are taken from all physical volumes. Nodes that no volume element uses are left out.
/// - Coordinates are taken as metres.
///
/// The result is not checked further; see [`crate::validate`].
///
/// # Errors
/// [`MeshError::Read`] with file, section and line (or byte) for what cannot be read or is not supported (other
/// versions, higher order, partitioned meshes) and what to do about it; [`MeshError::Face`] for a patch that lies
/// inside the domain or belongs to no element.
pub fn read(path: &Path) -> Result<Mesh, MeshError> {
    parse(&path.display().to_string(), &bytes_of(path)?)
}

fn parse(name: &str, bytes: &[u8]) -> Result<Mesh, MeshError> {
    let contents = sections::read(&mut Source::new(name, bytes))?;
    build::mesh(name, contents)
}
