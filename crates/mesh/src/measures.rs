//! Volumes and areas of whole meshes, for the tests of the readers.

use crate::{BoundaryFace, ElementKind, Mesh};
use std::path::PathBuf;

/// A file of the folder `meshes`.
pub fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../meshes")
        .join(name)
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Area vector of a plane face, from its listed direction.
pub fn area(x: &[[f64; 3]]) -> [f64; 3] {
    let edge = |k: usize| std::array::from_fn(|c| x[k][c] - x[0][c]);
    let parts = (1..x.len() - 1).map(|k| cross(edge(k), edge(k + 1)));
    parts.fold([0.0; 3], |sum, part| {
        std::array::from_fn(|c| sum[c] + 0.5 * part[c])
    })
}

/// ⅓ ∮ x·n dA.
pub fn enclosed<'a>(faces: impl Iterator<Item = &'a [[f64; 3]]>) -> f64 {
    faces
        .map(|x| {
            let area = area(x);
            (0..3).map(|c| x[0][c] * area[c]).sum::<f64>() / 3.0
        })
        .sum()
}

/// Sum over all elements, from their faces \[m³\].
pub fn element_volume(mesh: &Mesh) -> f64 {
    let elements = &mesh.elements;
    let volume = |e: usize| {
        let x = elements.coordinates(e, &mesh.nodes, &mesh.periods);
        let faces = elements.kinds[e].faces().iter();
        let faces: Vec<Vec<[f64; 3]>> = faces.map(|f| f.iter().map(|&v| x[v]).collect()).collect();
        enclosed(faces.iter().map(Vec::as_slice))
    };
    (0..elements.len()).map(volume).sum()
}

/// Corners of the faces of a patch.
pub fn boundary_faces(mesh: &Mesh, patch: &str) -> Vec<Vec<[f64; 3]>> {
    let faces = mesh.boundary.iter();
    let faces = faces.filter(|f| mesh.patches[f.patch as usize] == patch);
    let vertex = |f: &BoundaryFace, k: usize| -> [f64; 3] {
        let shift = mesh.periods.shift(f.images[k]);
        std::array::from_fn(|c| mesh.nodes[f.nodes[k] as usize][c] + shift[c])
    };
    faces
        .map(|f| (0..f.vertices as usize).map(|k| vertex(f, k)).collect())
        .collect()
}

/// Area vector of a patch \[m²\].
pub fn patch_area(mesh: &Mesh, patch: &str) -> [f64; 3] {
    let areas = boundary_faces(mesh, patch).into_iter().map(|x| area(&x));
    areas.fold([0.0; 3], |sum, a| std::array::from_fn(|c| sum[c] + a[c]))
}

/// Equal but for round-off of coordinates in text.
pub fn close(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
}

/// Number of elements of a kind.
pub fn of_kind(mesh: &Mesh, kind: ElementKind) -> usize {
    mesh.elements.kinds.iter().filter(|&&k| k == kind).count()
}
