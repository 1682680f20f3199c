//! From the sections of a file to a mesh.

use super::periodic::{Copy, identify};
use super::sections::{Contents, SurfaceElement};
use super::tags::Tags;
use crate::faces::{FaceKey, FaceTable};
use crate::{BoundaryFace, Elements, Image, Mesh, MeshError, Periods};
use std::collections::{BTreeMap, BTreeSet};

pub(super) fn mesh(path: &str, contents: Contents) -> Result<Mesh, MeshError> {
    let error = |place: &str| {
        let (path, place) = (path.to_owned(), place.to_owned());
        move |reason: String| MeshError::Read {
            path,
            place,
            reason,
        }
    };
    if contents.kinds.is_empty() {
        return Err(error("$Elements")(
            "there are no volume elements: mesh in three dimensions (`gmsh -3`), and put the volume in a physical group if surfaces are in one".into(),
        ));
    }
    let tags = Tags::new(&contents.node_tags).map_err(error("$Nodes"))?;
    let (periods, copies) =
        identify(&contents.links, &tags, &contents.nodes).map_err(error("$Periodic"))?;
    let mut vertices = Vertices::new(tags, copies);
    let elements = elements(&contents, &mut vertices).map_err(error("$Elements"))?;
    let table = FaceTable::new(&elements, vertices.masters.len());
    let groups = patch_groups(&contents).map_err(error("$Entities"))?;
    let patches = Patches::new(&contents, &groups).map_err(error("$Entities"))?;
    let mut mesh = Mesh {
        nodes: vertices
            .masters
            .iter()
            .map(|&n| contents.nodes[n as usize])
            .collect(),
        elements,
        boundary: Vec::new(),
        patches: patches.names,
        periods,
    };
    for face in &contents.faces {
        let Some(group) = groups.get(&face.surface) else {
            continue;
        };
        let patch = patches.of_group[group];
        let face = vertices.face(face, patch).map_err(error("$Elements"))?;
        let face = turned_outwards(face, &mesh, &table)?;
        mesh.boundary.push(face);
    }
    Ok(mesh)
}

/// Node tags of elements to nodes of the mesh.
struct Vertices {
    tags: Tags,
    /// By index in the file.
    copies: Vec<Copy>,
    /// Node of the mesh for every master that an element uses, by index in the file.
    nodes: Vec<Option<u32>>,
    /// Index in the file of every node of the mesh, in the order of first use.
    masters: Vec<u32>,
}

impl Vertices {
    fn new(tags: Tags, copies: Vec<Copy>) -> Self {
        Self {
            tags,
            nodes: vec![None; copies.len()],
            copies,
            masters: Vec::new(),
        }
    }

    /// Node and image of a tag in a volume element.
    fn used(&mut self, tag: u64) -> Result<(u32, Image), String> {
        let copy = self.copies[self.tags.index(tag)? as usize];
        let node = self.nodes[copy.master as usize].get_or_insert_with(|| {
            self.masters.push(copy.master);
            self.masters.len() as u32 - 1
        });
        Ok((*node, copy.image))
    }

    fn face(&self, face: &SurfaceElement, patch: u16) -> Result<BoundaryFace, String> {
        let mut result = BoundaryFace {
            patch,
            vertices: face.vertices,
            nodes: [0; 4],
            images: [Image::ZERO; 4],
        };
        for (k, &tag) in face.tags[..face.vertices as usize].iter().enumerate() {
            let copy = self.copies[self.tags.index(tag)? as usize];
            let node = self.nodes[copy.master as usize];
            result.nodes[k] = node.ok_or_else(|| {
                format!(
                    "surface {} has node {tag}, which belongs to no volume element",
                    face.surface
                )
            })?;
            result.images[k] = copy.image;
        }
        Ok(result)
    }
}

fn elements(contents: &Contents, vertices: &mut Vertices) -> Result<Elements, String> {
    let mut elements = Elements::default();
    let mut tags = &contents.vertices[..];
    for &kind in &contents.kinds {
        let (of_element, rest) = tags.split_at(kind.vertices());
        let mut nodes = [0; 8];
        let mut images = [Image::ZERO; 8];
        for (k, &tag) in of_element.iter().enumerate() {
            (nodes[k], images[k]) = vertices.used(tag)?;
        }
        let count = kind.vertices();
        elements.push(kind, &nodes[..count], &images[..count]);
        tags = rest;
    }
    Ok(elements)
}

/// The physical group of every surface that is a patch: in a group, and not joined to another by `$Periodic`.
fn patch_groups(contents: &Contents) -> Result<BTreeMap<i32, i32>, String> {
    let links = contents.links.iter().filter(|l| l.dimension == 2);
    let joined: BTreeSet<i32> = links.flat_map(|l| [l.entity, l.master]).collect();
    let mut groups = BTreeMap::new();
    for (&surface, of_surface) in &contents.groups {
        if joined.contains(&surface) {
            continue;
        }
        if let [first, second, ..] = of_surface[..] {
            let name = |tag| group_name(contents, tag);
            return Err(format!(
                "surface {surface} is in two physical groups, `{}` and `{}`: a surface belongs to one patch",
                name(first),
                name(second)
            ));
        }
        groups.insert(surface, of_surface[0]);
    }
    Ok(groups)
}

fn group_name(contents: &Contents, tag: i32) -> String {
    let name = contents.names.get(&(2, tag));
    name.cloned().unwrap_or_else(|| format!("surface_{tag}"))
}

struct Patches {
    names: Vec<String>,
    /// Patch of a physical group; groups of one name are one patch.
    of_group: BTreeMap<i32, u16>,
}

impl Patches {
    fn new(contents: &Contents, groups: &BTreeMap<i32, i32>) -> Result<Self, String> {
        let mut patches = Self {
            names: Vec::new(),
            of_group: BTreeMap::new(),
        };
        let used: BTreeSet<i32> = groups.values().copied().collect();
        for tag in used {
            let name = group_name(contents, tag);
            let known = patches.names.iter().position(|n| *n == name);
            let patch = known.unwrap_or_else(|| {
                patches.names.push(name);
                patches.names.len() - 1
            });
            let patch = u16::try_from(patch).map_err(|_| "more than 65536 patches".to_owned())?;
            patches.of_group.insert(tag, patch);
        }
        Ok(patches)
    }
}

/// The face with its normal out of the element that it lies on.
fn turned_outwards(
    mut face: BoundaryFace,
    mesh: &Mesh,
    table: &FaceTable,
) -> Result<BoundaryFace, MeshError> {
    let count = face.vertices as usize;
    let (key, direction) = FaceKey::new(&face.nodes[..count], &face.images[..count]);
    let mut sides = table.sides(&mesh.elements, key);
    let problem = match (sides.next(), sides.next()) {
        (Some(side), None) => {
            if side.direction != direction {
                face.nodes[..count].reverse();
                face.images[..count].reverse();
            }
            return Ok(face);
        }
        (None, _) => {
            "belongs to no volume element: save all volumes, or take this surface out of its physical group"
        }
        (Some(_), Some(_)) => {
            "lies between two elements: walls inside the domain are not supported; take this surface out of its physical group"
        }
    };
    Err(MeshError::Face {
        patch: Some(mesh.patches[face.patch as usize].clone()),
        centre: centre(&face, &mesh.nodes, &mesh.periods),
        problem: problem.into(),
    })
}

fn centre(face: &BoundaryFace, nodes: &[[f64; 3]], periods: &Periods) -> [f64; 3] {
    let count = face.vertices as usize;
    let coordinate =
        |k: usize, c: usize| nodes[face.nodes[k] as usize][c] + periods.shift(face.images[k])[c];
    std::array::from_fn(|c| (0..count).map(|k| coordinate(k, c)).sum::<f64>() / count as f64)
}
