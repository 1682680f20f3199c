//! From the parts of a mesh file to a mesh: periodic copies identified, faces turned outwards.

use crate::faces::{FaceKey, FaceTable};
use crate::periodic::Copy;
use crate::{BoundaryFace, ElementKind, Elements, Image, Mesh, MeshError, Periods};

/// What a file says, by index of its points.
#[derive(Debug, Default)]
pub(crate) struct Parts {
    /// Points \[m\].
    pub points: Vec<[f64; 3]>,
    /// Volume elements: kinds, and points one after another.
    pub kinds: Vec<ElementKind>,
    pub vertices: Vec<u32>,
    /// Faces of patches, in either direction.
    pub faces: Vec<PatchFace>,
    /// Names of the patches.
    pub patches: Vec<String>,
}

/// A triangle or quadrilateral of a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PatchFace {
    pub patch: u16,
    /// 3 or 4.
    pub vertices: u8,
    pub points: [u32; 4],
}

impl PatchFace {
    /// Its points.
    pub fn points(&self) -> &[u32] {
        &self.points[..self.vertices as usize]
    }
}

/// The mesh; nodes in the order in which elements use them first, points that none uses left out.
///
/// # Errors
/// [`MeshError::Face`] for a face of a patch that lies inside the domain or belongs to no element.
pub(crate) fn mesh(parts: &Parts, periods: Periods, copies: &[Copy]) -> Result<Mesh, MeshError> {
    let mut used = Used {
        copies,
        nodes: vec![None; copies.len()],
        masters: Vec::new(),
    };
    let mut elements = Elements::default();
    let mut rest = &parts.vertices[..];
    for &kind in &parts.kinds {
        let (of_element, others) = rest.split_at(kind.vertices());
        let (mut nodes, mut images) = ([0; 8], [Image::ZERO; 8]);
        for (k, &point) in of_element.iter().enumerate() {
            (nodes[k], images[k]) = used.node(point);
        }
        let count = kind.vertices();
        elements.push(kind, &nodes[..count], &images[..count]);
        rest = others;
    }
    let table = FaceTable::new(&elements, used.masters.len());
    let masters = used.masters.iter();
    let mut mesh = Mesh {
        nodes: masters.map(|&n| parts.points[n as usize]).collect(),
        elements,
        boundary: Vec::with_capacity(parts.faces.len()),
        patches: parts.patches.clone(),
        periods,
    };
    for face in &parts.faces {
        let turned = used.face(face).and_then(|f| outwards(f, &mesh, &table));
        let face = turned.map_err(|problem| MeshError::Face {
            patch: Some(parts.patches[face.patch as usize].clone()),
            centre: centre(face, &parts.points),
            problem: problem.into(),
        })?;
        mesh.boundary.push(face);
    }
    Ok(mesh)
}

const ALONE: &str =
    "belongs to no volume element: save all volumes, or take this surface out of the patch";

/// Points of the file to nodes of the mesh.
struct Used<'a> {
    copies: &'a [Copy],
    /// Node of every master that an element uses.
    nodes: Vec<Option<u32>>,
    /// Point of every node, in the order of first use.
    masters: Vec<u32>,
}

impl Used<'_> {
    /// Node and image of a point of a volume element.
    fn node(&mut self, point: u32) -> (u32, Image) {
        let copy = self.copies[point as usize];
        let node = self.nodes[copy.master as usize].get_or_insert_with(|| {
            self.masters.push(copy.master);
            self.masters.len() as u32 - 1
        });
        (*node, copy.image)
    }

    fn face(&self, face: &PatchFace) -> Result<BoundaryFace, &'static str> {
        let mut result = BoundaryFace {
            patch: face.patch,
            vertices: face.vertices,
            nodes: [0; 4],
            images: [Image::ZERO; 4],
        };
        for (k, &point) in face.points().iter().enumerate() {
            let copy = self.copies[point as usize];
            result.nodes[k] = self.nodes[copy.master as usize].ok_or(ALONE)?;
            result.images[k] = copy.image;
        }
        Ok(result)
    }
}

/// The face with its normal out of the element that it lies on.
fn outwards(
    mut face: BoundaryFace,
    mesh: &Mesh,
    table: &FaceTable,
) -> Result<BoundaryFace, &'static str> {
    let count = face.vertices as usize;
    let (key, direction) = FaceKey::new(&face.nodes[..count], &face.images[..count]);
    let mut sides = table.sides(&mesh.elements, key);
    match (sides.next(), sides.next()) {
        (Some(side), None) => {
            if side.direction != direction {
                face.nodes[..count].reverse();
                face.images[..count].reverse();
            }
            Ok(face)
        }
        (None, _) => Err(ALONE),
        (Some(_), Some(_)) => Err(
            "lies between two elements: walls inside the domain are not supported; take this surface out of the patch",
        ),
    }
}

fn centre(face: &PatchFace, points: &[[f64; 3]]) -> [f64; 3] {
    let sum = |c: usize| -> f64 { face.points().iter().map(|&p| points[p as usize][c]).sum() };
    std::array::from_fn(|c| sum(c) / f64::from(face.vertices))
}
