//! OpenFOAM meshes: the `polyMesh` folder, text and binary.

mod cells;
mod file;

#[cfg(test)]
mod tests;

use crate::assemble::{self, Parts, PatchFace};
use crate::matching::join;
use crate::source::bytes_of;
use crate::{Mesh, MeshError, PeriodicPatches};
use file::{File, Patch};
use std::path::{Path, PathBuf};

/// Reads `points`, `faces`, `owner`, `neighbour` and `boundary` of a `polyMesh` folder, or of the case that holds it.
///
/// - Cells must be tetrahedra, pyramids, prisms or hexahedra by their faces; hanging nodes and polyhedra are refused.
/// - Patches keep their names, whatever their type; those without faces are left out. `empty` ones become patches too: give
///   them `slip`, which is the same in a plane flow.
/// - `cyclic` patches and their `neighbourPatch` become a period; only translations are supported.
/// - Coordinates are taken as metres.
///
/// The result is not checked further; see [`crate::validate`].
///
/// # Errors
/// [`MeshError::Read`] with file, place and what to do; [`MeshError::Face`] for a patch inside the domain (baffles).
pub fn read(path: &Path) -> Result<Mesh, MeshError> {
    let folder = folder(path)?;
    let load = |name: &str| -> Result<(String, Vec<u8>), MeshError> {
        let file = folder.join(name);
        if !file.exists() && folder.join(format!("{name}.gz")).exists() {
            let reason = "the file is compressed: gunzip it";
            return Err(failed(&folder.join(format!("{name}.gz")), "file", reason));
        }
        Ok((file.display().to_string(), bytes_of(&file)?))
    };
    let (points, faces) = (load("points")?, load("faces")?);
    let (owner, neighbour) = (load("owner")?, load("neighbour")?);
    let boundary = load("boundary")?;
    let open = |file| {
        let (path, bytes): &(String, Vec<u8>) = file;
        File::new(path, bytes)
    };
    let points = open(&points)?.points()?;
    let faces = open(&faces)?.faces(points.len())?;
    let sides = cells::Sides {
        owner: open(&owner)?.labels()?,
        neighbour: open(&neighbour)?.labels()?,
    };
    let wrong = |reason| failed(&folder, "cells", reason);
    let (kinds, vertices) = cells::elements(&points, &faces, &sides).map_err(wrong)?;
    let mut parts = Parts {
        points,
        kinds,
        vertices,
        ..Parts::default()
    };
    let wrong = |reason| failed(&folder.join("boundary"), "patches", reason);
    let patches = open(&boundary)?.patches()?;
    let periodic = name(&mut parts, &faces, &patches).map_err(wrong)?;
    let (periods, copies) = join(&mut parts, &periodic).map_err(wrong)?;
    assemble::mesh(&parts, periods, &copies)
}

fn failed(path: &Path, place: &str, reason: impl Into<String>) -> MeshError {
    MeshError::Read {
        path: path.display().to_string(),
        place: place.to_owned(),
        reason: reason.into(),
    }
}

fn folder(path: &Path) -> Result<PathBuf, MeshError> {
    let below = [
        path.to_owned(),
        path.join("polyMesh"),
        path.join("constant/polyMesh"),
    ];
    let holds = |folder: &&PathBuf| folder.join("boundary").is_file();
    let found = below.iter().find(holds).cloned();
    found.ok_or_else(|| {
        let reason = "there is no OpenFOAM mesh here: a folder with points, faces, owner, neighbour and boundary, or the case above constant/polyMesh";
        failed(path, "folder", reason)
    })
}

/// Gives faces their patches; which of them are periodic.
fn name(
    parts: &mut Parts,
    faces: &[Vec<u32>],
    patches: &[Patch],
) -> Result<Vec<PeriodicPatches>, String> {
    let mut periodic: Vec<PeriodicPatches> = Vec::new();
    for patch in patches.iter().filter(|p| p.faces > 0) {
        let of_patch = patch.start.checked_add(patch.faces);
        let of_patch = of_patch.and_then(|end| faces.get(patch.start..end));
        let of_patch = of_patch.ok_or_else(|| {
            let (count, name) = (faces.len(), &patch.name);
            format!("patch `{name}` has more faces than the {count} there are")
        })?;
        match (patch.kind.as_str(), &patch.neighbour) {
            ("processor" | "processorCyclic", _) => {
                return Err(format!(
                    "patch `{}` is of a decomposed mesh: take the whole one, or run reconstructParMesh (fibreflow partitions it itself)",
                    patch.name
                ));
            }
            ("cyclic", Some(other)) => {
                let known = periodic.iter().any(|p| p.patches.contains(&patch.name));
                if !known {
                    periodic.push(PeriodicPatches {
                        patches: [patch.name.clone(), other.clone()],
                        translation: None,
                    });
                }
            }
            (kind, _) if kind.starts_with("cyclic") => {
                return Err(format!(
                    "patch `{}` is {kind}; periodic patches must be `cyclic` with a neighbourPatch, their faces translated onto each other",
                    patch.name
                ));
            }
            _ => {}
        }
        let number = u16::try_from(parts.patches.len());
        let number = number.map_err(|_| "more than 65536 patches".to_owned())?;
        parts.patches.push(patch.name.clone());
        for face in of_patch {
            let mut points = [0; 4];
            if !(3..=4).contains(&face.len()) {
                return Err(format!(
                    "a face of patch `{}` has {} points",
                    patch.name,
                    face.len()
                ));
            }
            points.iter_mut().zip(face).for_each(|(a, &b)| *a = b);
            parts.faces.push(PatchFace {
                patch: number,
                vertices: face.len() as u8,
                points,
            });
        }
    }
    Ok(periodic)
}
