//! From the sections of a file to a mesh.

use super::links::links;
use super::sections::Contents;
use super::tags::Tags;
use crate::assemble::{self, Parts, PatchFace};
use crate::periodic::identify;
use crate::{Mesh, MeshError};
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
    let links = links(&contents.links, &tags, &contents.nodes).map_err(error("$Periodic"))?;
    let (periods, copies) = identify(&links, &contents.nodes).map_err(error("$Periodic"))?;
    let groups = patch_groups(&contents).map_err(error("$Entities"))?;
    let patches = Patches::new(&contents, &groups).map_err(error("$Entities"))?;
    let faces = faces(&contents, &tags, &groups, &patches).map_err(error("$Elements"))?;
    let vertices = contents.vertices.iter().map(|&tag| tags.index(tag));
    let vertices = vertices.collect::<Result<_, _>>();
    let parts = Parts {
        points: contents.nodes,
        kinds: contents.kinds,
        vertices: vertices.map_err(error("$Elements"))?,
        faces,
        patches: patches.names,
    };
    assemble::mesh(&parts, periods, &copies)
}

/// Faces of the surfaces that are patches.
fn faces(
    contents: &Contents,
    tags: &Tags,
    groups: &BTreeMap<i32, i32>,
    patches: &Patches,
) -> Result<Vec<PatchFace>, String> {
    let mut faces = Vec::new();
    for face in &contents.faces {
        let Some(group) = groups.get(&face.surface) else {
            continue;
        };
        let mut points = [0; 4];
        for (point, &tag) in points.iter_mut().zip(&face.tags[..face.vertices as usize]) {
            *point = tags.index(tag)?;
        }
        faces.push(PatchFace {
            patch: patches.of_group[group],
            vertices: face.vertices,
            points,
        });
    }
    Ok(faces)
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
