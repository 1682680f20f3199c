//! Figures by which a user judges a mesh.

use crate::faces::{FaceKey, FaceTable};
use crate::graph::for_each_edge;
use crate::jacobian::smallest_jacobian;
use crate::skewness::face_angles;
use crate::{DualGeometry, ElementKind, LocalMesh};
use fibreflow_parallel::{block_max, block_sums};
use std::fmt;

/// Figures of the whole mesh, the same on every rank.
#[derive(Clone, Debug, PartialEq)]
pub struct QualityReport {
    /// Number of nodes.
    pub nodes: usize,
    /// Number of elements of each of [`ElementKind::ALL`].
    pub elements: [usize; 4],
    /// Volume \[m³\].
    pub volume: f64,
    /// Smallest and largest dual volume \[m³\].
    pub dual_volumes: [f64; 2],
    /// Largest ratio of the dual volumes of two nodes of an element.
    pub neighbour_ratio: f64,
    /// Angle between a face and the line that joins the centres of its two elements: largest and mean \[degrees\].
    pub face_angles: [f64; 2],
    /// Largest angle between S_ij and d_ij \[degrees\], over pairs with at least 1 % of the largest |S| of their row.
    pub non_orthogonality: f64,
    /// Mean of that angle over all pairs, weighted with |S_ij| \[degrees\].
    pub mean_non_orthogonality: f64,
    /// Longest over shortest edge of an element: the largest.
    pub aspect_ratio: f64,
    /// Jacobian at a vertex over the product of the lengths of its edges: the smallest. One for right angles.
    pub scaled_jacobian: f64,
    /// Whether the two-point form on orthogonal hexahedra is in use.
    pub orthogonal: bool,
    /// Per patch, in the order of the mesh.
    pub patches: Vec<PatchQuality>,
}

/// Figures of a patch.
#[derive(Clone, Debug, PartialEq)]
pub struct PatchQuality {
    /// Name.
    pub name: String,
    /// Number of boundary faces.
    pub faces: usize,
    /// Area \[m²\].
    pub area: f64,
    /// Smallest height of the elements on the patch: mean distance of the vertices off the face from its plane \[m\].
    /// Infinite on a patch without faces.
    pub first_cell: f64,
}

/// Measures a mesh. Collective.
pub fn quality(mesh: &LocalMesh, geometry: &DualGeometry) -> QualityReport {
    let communicator = mesh.halo.communicator();
    let mut elements = [0.0; 4];
    let owned = (0..mesh.elements.len()).filter(|&e| mesh.owned_elements[e]);
    owned.for_each(|e| elements[mesh.elements.kinds[e] as usize] += 1.0);
    communicator.sum_slice(&mut elements);
    let volumes = &geometry.volumes[..mesh.owned()];
    let largest = |f: &(dyn Fn(usize) -> f64 + Sync), length: usize| {
        let local = block_max(length, |range| {
            range.map(f).fold(f64::NEG_INFINITY, nan_max)
        });
        communicator.max(local)
    };
    let of_element = |e: usize| element_quality(mesh, e);
    let mut angles = block_sums(mesh.owned(), |range| {
        range.fold([0.0; 2], |sum, i| {
            let [weighted, weight, _] = row_angles(geometry, i);
            [sum[0] + weighted, sum[1] + weight]
        })
    });
    communicator.sum_slice(&mut angles);
    QualityReport {
        nodes: mesh.total_nodes,
        elements: elements.map(|n| n as usize),
        volume: geometry.total_volume,
        dual_volumes: [
            -largest(&|i| -volumes[i], volumes.len()),
            largest(&|i| volumes[i], volumes.len()),
        ],
        neighbour_ratio: largest(&|i| row_ratio(geometry, i), mesh.owned()),
        face_angles: face_angles(mesh),
        non_orthogonality: largest(&|i| row_angles(geometry, i)[2], mesh.owned()),
        mean_non_orthogonality: angles[0] / angles[1],
        aspect_ratio: largest(&|e| of_element(e)[0], mesh.elements.len()),
        scaled_jacobian: -largest(&|e| -of_element(e)[1], mesh.elements.len()),
        orthogonal: geometry.orthogonal,
        patches: patches(mesh),
    }
}

/// The larger; a NaN wins.
fn nan_max(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|c| a[c] * b[c]).sum()
}

fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| a[c] - b[c])
}

/// Largest ratio of a neighbour's dual volume to that of node i.
fn row_ratio(geometry: &DualGeometry, i: usize) -> f64 {
    let volume = |e: usize| geometry.volumes[geometry.columns[e] as usize];
    let largest = geometry.row(i).map(volume).fold(0.0, f64::max);
    largest / geometry.volumes[i]
}

/// Of row i: Σ|S|θ, Σ|S|, and the largest θ of faces that matter; θ in degrees.
fn row_angles(geometry: &DualGeometry, i: usize) -> [f64; 3] {
    let area = |e: usize| {
        let [x, y, z, _] = geometry.faces[e];
        norm([x, y, z])
    };
    let matters = 0.01 * geometry.row(i).map(area).fold(0.0, f64::max);
    geometry
        .row(i)
        .fold([0.0; 3], |[weighted, weight, largest], e| {
            let ([x, y, z, _], d) = (geometry.faces[e], geometry.displacements[e]);
            let product = area(e) * norm(d);
            if product == 0.0 {
                return [weighted, weight, largest];
            }
            let cosine = dot([x, y, z], d) / product;
            let angle = cosine.clamp(-1.0, 1.0).acos().to_degrees();
            let counted = if area(e) >= matters { angle } else { 0.0 };
            [
                weighted + area(e) * angle,
                weight + area(e),
                nan_max(largest, counted),
            ]
        })
}

/// Aspect ratio and smallest scaled Jacobian.
fn element_quality(mesh: &LocalMesh, e: usize) -> [f64; 2] {
    let x = mesh.elements.coordinates(e, &mesh.nodes, &mesh.periods);
    let kind = mesh.elements.kinds[e];
    let (mut shortest, mut longest) = (f64::INFINITY, 0.0f64);
    for_each_edge(kind, |a, b| {
        let length = norm(difference(x[a], x[b]));
        shortest = shortest.min(length);
        longest = longest.max(length);
    });
    let (_, _, scaled) = smallest_jacobian(kind, &x);
    [longest / shortest, scaled]
}

fn patches(mesh: &LocalMesh) -> Vec<PatchQuality> {
    let communicator = mesh.halo.communicator();
    let table = FaceTable::new(&mesh.elements, mesh.total());
    let mut sums = vec![[0.0; 2]; mesh.patches.len()];
    let mut heights = vec![f64::INFINITY; mesh.patches.len()];
    // The rank of its first node counts a face; it has the element behind it.
    let owned = |face: &&crate::BoundaryFace| (face.nodes[0] as usize) < mesh.owned();
    for face in mesh.boundary.iter().filter(owned) {
        let count = face.vertices as usize;
        let (key, _) = FaceKey::new(&face.nodes[..count], &face.images[..count]);
        let Some(side) = table.sides(&mesh.elements, key).next() else {
            continue;
        };
        let (area, height) = face_measures(mesh, side.element as usize, side.face as usize);
        let patch = face.patch as usize;
        sums[patch][0] += 1.0;
        sums[patch][1] += area;
        heights[patch] = heights[patch].min(height);
    }
    communicator.sum_slice(sums.as_flattened_mut());
    let names = mesh.patches.iter().zip(sums).zip(heights);
    names
        .map(|((name, [faces, area]), height)| PatchQuality {
            name: name.clone(),
            faces: faces as usize,
            area,
            first_cell: communicator.min(height),
        })
        .collect()
}

/// Area of a face of an element, and the mean distance of the element's other vertices from its plane.
fn face_measures(mesh: &LocalMesh, e: usize, face: usize) -> (f64, f64) {
    let x = mesh.elements.coordinates(e, &mesh.nodes, &mesh.periods);
    let kind = mesh.elements.kinds[e];
    let vertices = kind.faces()[face];
    // Half the cross product of the diagonals of a quadrilateral, of two edges of a triangle.
    let [a, b, c, d] = match vertices[..] {
        [a, b, c, d] => [a, c, b, d],
        _ => [vertices[0], vertices[1], vertices[0], vertices[2]],
    };
    let (u, v) = (difference(x[b], x[a]), difference(x[d], x[c]));
    let normal = [
        0.5 * (u[1] * v[2] - u[2] * v[1]),
        0.5 * (u[2] * v[0] - u[0] * v[2]),
        0.5 * (u[0] * v[1] - u[1] * v[0]),
    ];
    let area = norm(normal);
    let centre: [f64; 3] = std::array::from_fn(|k| {
        vertices.iter().map(|&v| x[v][k]).sum::<f64>() / vertices.len() as f64
    });
    let others = (0..kind.vertices()).filter(|v| !vertices.contains(v));
    let (mut sum, mut count) = (0.0, 0.0);
    for v in others {
        sum += dot(difference(centre, x[v]), normal) / area;
        count += 1.0;
    }
    (area, sum / count)
}

impl fmt::Display for QualityReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kinds = ElementKind::ALL.iter().zip(self.elements);
        let kinds: Vec<String> = kinds
            .filter(|(_, count)| *count > 0)
            .map(|(kind, count)| format!("{} × {count}", kind.name()))
            .collect();
        let form = if self.orthogonal {
            "two-point (orthogonal hexahedra)"
        } else {
            "Galerkin"
        };
        writeln!(f, "nodes               {}", self.nodes)?;
        writeln!(f, "elements            {}", kinds.join(", "))?;
        writeln!(f, "volume              {:.6e} m³", self.volume)?;
        let [low, high] = self.dual_volumes;
        writeln!(
            f,
            "dual volumes        {low:.3e} to {high:.3e} m³ (ratio {:.3}, of neighbours at most {:.3})",
            high / low,
            self.neighbour_ratio
        )?;
        writeln!(f, "pair form           {form}")?;
        writeln!(
            f,
            "non-orthogonality   {:.1}° at most, {:.1}° on average (faces and lines between centres of elements)",
            self.face_angles[0], self.face_angles[1]
        )?;
        writeln!(
            f,
            "  of pairs          {:.1}° at most, {:.1}° on average (dual faces and lines between nodes)",
            self.non_orthogonality, self.mean_non_orthogonality
        )?;
        writeln!(f, "aspect ratio        {:.2} at most", self.aspect_ratio)?;
        write!(
            f,
            "scaled Jacobian     {:.3} at least",
            self.scaled_jacobian
        )?;
        for patch in &self.patches {
            write!(
                f,
                "\npatch {}: {} faces, {:.6e} m², first cell {:.3e} m",
                patch.name, patch.faces, patch.area, patch.first_cell
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Image, distribute_from, gmsh};
    use fibreflow_parallel::Communicator;
    use std::path::Path;

    fn column() -> LocalMesh {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../meshes/mixed.msh");
        distribute_from(&Communicator::single(), || gmsh::read(&path)).expect("mesh")
    }

    #[test]
    fn patches_have_their_area_and_first_cell() {
        let mesh = column();
        let patches = patches(&mesh);
        let expected = [("bottom", 4, 1.0, 0.5), ("top", 14, 1.0, 0.5)];
        for (patch, (name, faces, area, first_cell)) in patches.iter().zip(expected) {
            assert_eq!((patch.name.as_str(), patch.faces), (name, faces));
            assert!((patch.area - area).abs() < 1e-12);
            assert!((patch.first_cell - first_cell).abs() < 1e-12);
        }
        assert!((patches[2].area - 10.0).abs() < 1e-12);
    }

    #[test]
    fn a_hexahedron_of_the_column_is_a_cube() {
        // Gmsh places nodes on curves to 1e-12 only.
        let mesh = column();
        let kinds = mesh.elements.kinds.iter();
        let hexahedron = kinds.clone().position(|&k| k == ElementKind::Hexahedron);
        let [aspect, jacobian] = element_quality(&mesh, hexahedron.expect("hexahedron"));
        assert!((aspect - 1.0).abs() < 1e-9 && (jacobian - 1.0).abs() < 1e-9);
        let mut stretched = mesh.clone();
        stretched.nodes.iter_mut().for_each(|x| x[2] *= 0.1);
        let [aspect, jacobian] = element_quality(&stretched, hexahedron.expect("hexahedron"));
        assert!((aspect - 10.0).abs() < 1e-9 && (jacobian - 1.0).abs() < 1e-9);
    }

    #[test]
    fn small_faces_count_for_the_mean_and_not_for_the_maximum() {
        let geometry = DualGeometry {
            offsets: vec![0, 3],
            columns: vec![1, 2, 3],
            images: vec![Image::ZERO; 3],
            faces: vec![
                [2.0, 0.0, 0.0, 1.0],
                [1.0, 1.0, 0.0, 1.0],
                [0.0, 1e-3, 0.0, 1.0],
            ],
            masses: Vec::new(),
            displacements: vec![[3.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
            volumes: vec![1.0],
            boundary: Vec::new(),
            self_pairs: Vec::new(),
            orthogonal: false,
            total_volume: 1.0,
            tensor: None,
        };
        let [weighted, weight, largest] = row_angles(&geometry, 0);
        assert!((largest - 45.0).abs() < 1e-10);
        let area = 2.0f64.sqrt();
        assert!((weight - (2.0 + area + 1e-3)).abs() < 1e-12);
        assert!((weighted - (45.0 * area + 90.0 * 1e-3)).abs() < 1e-9);
    }
}
