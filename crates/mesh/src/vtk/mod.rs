//! VTK meshes: XML files of unstructured grids (`.vtu`) and legacy files (`.vtk`, versions 2 to 5.1).

mod build;
mod data;
mod grid;
mod legacy;
mod xml;

#[cfg(test)]
mod tests;

use crate::source::bytes_of;
use crate::{Mesh, MeshError, PeriodicPatches};
use std::collections::BTreeMap;
use std::path::Path;

/// Cell arrays that number surfaces, where none is named: ours, what meshio makes of Gmsh's physical groups, VMTK's.
pub const PATCH_ARRAYS: [&str; 3] = ["patch", "gmsh:physical", "CellEntityIds"];

/// How the surfaces of a VTK mesh become patches.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// Cell array that numbers the surfaces; None: the first of [`PATCH_ARRAYS`] that is there.
    pub array: Option<String>,
    /// Names of patches by what they are called otherwise: the number of the surface, or `x_min` ….
    pub names: BTreeMap<String, String>,
    /// Patches that are periodic copies of each other.
    pub periodic: Vec<PeriodicPatches>,
}

/// Reads tetrahedra, pyramids, wedges, hexahedra and voxels, and as patches triangles, quadrilaterals and pixels.
///
/// - `.vtu`: text, base64 or appended, raw or zlib-compressed, either byte order. Else legacy, text or binary.
/// - A surface is named by the number that the array gives its cells: by [`Options::names`], or `surface_<number>`;
///   surfaces of one name are one patch. Without such an array there is one patch, `boundary`.
/// - Without surface cells the outer faces are patches: `x_min`, `x_max`, … `z_max` in the planes of the bounding box, `boundary` elsewhere.
/// - Wedges may be listed in either direction, as both are in use. Lines and vertices are passed over.
/// - Coordinates are taken as metres; points that no volume cell uses are left out.
///
/// The result is not checked further; see [`crate::validate`].
///
/// # Errors
/// [`MeshError::Read`] with file, place and what to do; [`MeshError::Face`] for a surface inside the domain.
pub fn read(path: &Path, options: &Options) -> Result<Mesh, MeshError> {
    parse(&path.display().to_string(), &bytes_of(path)?, options)
}

fn parse(path: &str, bytes: &[u8], options: &Options) -> Result<Mesh, MeshError> {
    let wanted = |name: &str| match &options.array {
        Some(array) => array == name,
        None => PATCH_ARRAYS.contains(&name),
    };
    let start = bytes.iter().position(|b| !b.is_ascii_whitespace());
    let grid = if start.is_some_and(|k| bytes[k] == b'<') {
        xml::read(path, bytes, &wanted)?
    } else {
        legacy::read(path, bytes, &wanted)?
    };
    build::mesh(path, grid, options)
}

fn failed(path: &str, place: &str, reason: impl Into<String>) -> MeshError {
    MeshError::Read {
        path: path.to_owned(),
        place: place.to_owned(),
        reason: reason.into(),
    }
}
