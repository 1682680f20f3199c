//! The sections of an MSH 4.1 file, as they stand there. Format: Gmsh reference manual, "MSH file format".

use crate::source::Source;
use crate::{ElementKind, MeshError};
use std::collections::HashMap;

/// What the file says, before nodes are identified and faces are matched.
#[derive(Debug, Default)]
pub(super) struct Contents {
    /// Names of physical groups by (dimension, tag).
    pub names: HashMap<(i32, i32), String>,
    /// Physical groups of surfaces, by the tag of the surface.
    pub groups: HashMap<i32, Vec<i32>>,
    pub node_tags: Vec<u64>,
    pub nodes: Vec<[f64; 3]>,
    /// Volume elements: kinds, and node tags one after another.
    pub kinds: Vec<ElementKind>,
    pub vertices: Vec<u64>,
    pub faces: Vec<SurfaceElement>,
    pub links: Vec<PeriodicLink>,
}

/// A triangle or quadrilateral of a surface.
#[derive(Debug)]
pub(super) struct SurfaceElement {
    pub surface: i32,
    pub vertices: u8,
    pub tags: [u64; 4],
}

/// A periodic point, curve or surface.
#[derive(Debug)]
pub(super) struct PeriodicLink {
    pub dimension: i32,
    pub entity: i32,
    pub master: i32,
    /// Row-major 4 × 4 map from master to slave, when given.
    pub affine: Vec<f64>,
    /// (node, master node) tags.
    pub pairs: Vec<[u64; 2]>,
}

/// Reads all sections.
pub(super) fn read(source: &mut Source<'_>) -> Result<Contents, MeshError> {
    let mut contents = Contents::default();
    let mut formatted = false;
    while let Some(word) = source.word() {
        let Some(name) = word.strip_prefix('$') else {
            return Err(source.error(format!("`{word}` where a section should begin")));
        };
        source.section = word.to_owned();
        source.line();
        if name == "MeshFormat" {
            format(source)?;
            formatted = true;
        } else if !formatted {
            return Err(source.error("a Gmsh mesh file begins with $MeshFormat"));
        }
        match name {
            "MeshFormat" => (),
            "PhysicalNames" => physical_names(source, &mut contents)?,
            "Entities" => entities(source, &mut contents)?,
            "Nodes" => nodes(source, &mut contents)?,
            "Elements" => elements(source, &mut contents)?,
            "Periodic" => periodic(source, &mut contents)?,
            "PartitionedEntities" => {
                return Err(source.error(
                    "the mesh is partitioned: save it whole (fibreflow partitions it itself)",
                ));
            }
            // Fields, parametrisations, comments: nothing a flow needs.
            other => {
                if !source.skip_past(&format!("$End{other}")) {
                    return Err(source.error(format!("$End{other} is missing")));
                }
                source.section.clear();
                continue;
            }
        }
        let end = source.word().unwrap_or("the end of the file");
        if end.strip_prefix("$End") != Some(name) {
            return Err(source.error(format!("{end} where $End{name} should be")));
        }
        source.section.clear();
    }
    if formatted {
        Ok(contents)
    } else {
        Err(source.error("the file is empty"))
    }
}

fn format(source: &mut Source<'_>) -> Result<(), MeshError> {
    let version = source.word().unwrap_or("");
    if version != "4.1" {
        return Err(source.error(format!(
            "the file has format version {version}; only 4.1 is read: save it with `gmsh -format msh41` or Mesh.MshFileVersion = 4.1"
        )));
    }
    let (binary, size): (i32, i32) = (source.text()?, source.text()?);
    if size != 8 {
        return Err(source.error(format!(
            "a data size of {size} bytes is not supported; 8 is"
        )));
    }
    source.line();
    if binary == 1 {
        source.binary = true;
        if source.int()? != 1 {
            return Err(source.error(
                "the file was written on a machine with the other byte order: save it as text (Mesh.Binary = 0)",
            ));
        }
    }
    Ok(())
}

/// Text in binary files too.
fn physical_names(source: &mut Source<'_>, contents: &mut Contents) -> Result<(), MeshError> {
    let count: usize = source.text()?;
    for _ in 0..count {
        let (dimension, tag) = (source.text()?, source.text()?);
        let name = source.line().trim_matches('"').to_owned();
        if name.is_empty() {
            return Err(source.error(format!("physical group {tag} has no name")));
        }
        contents.names.insert((dimension, tag), name);
    }
    Ok(())
}

fn entities(source: &mut Source<'_>, contents: &mut Contents) -> Result<(), MeshError> {
    let counts = [
        source.count()?,
        source.count()?,
        source.count()?,
        source.count()?,
    ];
    for (dimension, count) in counts.into_iter().enumerate() {
        for _ in 0..count {
            let entity = source.int()?;
            // A point has its position, all others a bounding box.
            source.point()?;
            if dimension > 0 {
                source.point()?;
            }
            let groups = source.count()?;
            let groups = (0..groups).map(|_| source.int());
            let groups: Vec<i32> = groups.collect::<Result<_, _>>()?;
            if dimension == 2 && !groups.is_empty() {
                // A negative tag only says that the group turns the surface round.
                let groups = groups.into_iter().map(i32::abs).collect();
                contents.groups.insert(entity, groups);
            }
            if dimension > 0 {
                for _ in 0..source.count()? {
                    source.int()?;
                }
            }
        }
    }
    Ok(())
}

fn nodes(source: &mut Source<'_>, contents: &mut Contents) -> Result<(), MeshError> {
    let (blocks, total) = (source.count()?, source.count()?);
    let _tags_from_to = (source.tag()?, source.tag()?);
    contents.node_tags.reserve(total);
    contents.nodes.reserve(total);
    for _ in 0..blocks {
        let (dimension, _entity, parametric) = (source.int()?, source.int()?, source.int()?);
        let count = source.count()?;
        for _ in 0..count {
            contents.node_tags.push(source.tag()?);
        }
        for _ in 0..count {
            contents.nodes.push(source.point()?);
            let parameters = if parametric == 1 { dimension } else { 0 };
            for _ in 0..parameters {
                source.real()?;
            }
        }
    }
    Ok(())
}

/// What a Gmsh element type means here.
enum Shape {
    /// A point or line with this many nodes: of no use here.
    Skipped(usize),
    Surface(usize),
    Volume(ElementKind),
}

fn shape(code: i32) -> Option<Shape> {
    Some(match code {
        15 => Shape::Skipped(1),
        1 => Shape::Skipped(2),
        2 => Shape::Surface(3),
        3 => Shape::Surface(4),
        4 => Shape::Volume(ElementKind::Tetrahedron),
        5 => Shape::Volume(ElementKind::Hexahedron),
        6 => Shape::Volume(ElementKind::Prism),
        7 => Shape::Volume(ElementKind::Pyramid),
        _ => return None,
    })
}

fn elements(source: &mut Source<'_>, contents: &mut Contents) -> Result<(), MeshError> {
    let (blocks, _total) = (source.count()?, source.count()?);
    let _tags_from_to = (source.tag()?, source.tag()?);
    for _ in 0..blocks {
        let (_dimension, entity, code) = (source.int()?, source.int()?, source.int()?);
        let count = source.count()?;
        let Some(shape) = shape(code) else {
            return Err(source.error(format!(
                "elements of Gmsh type {code} are not supported; linear ones are: mesh with Mesh.ElementOrder = 1"
            )));
        };
        for _ in 0..count {
            let _tag = source.tag()?;
            match shape {
                Shape::Skipped(vertices) => {
                    for _ in 0..vertices {
                        source.tag()?;
                    }
                }
                Shape::Surface(vertices) => {
                    let mut tags = [0; 4];
                    for tag in &mut tags[..vertices] {
                        *tag = source.tag()?;
                    }
                    contents.faces.push(SurfaceElement {
                        surface: entity,
                        vertices: vertices as u8,
                        tags,
                    });
                }
                Shape::Volume(kind) => {
                    contents.kinds.push(kind);
                    for _ in 0..kind.vertices() {
                        contents.vertices.push(source.tag()?);
                    }
                }
            }
        }
    }
    Ok(())
}

fn periodic(source: &mut Source<'_>, contents: &mut Contents) -> Result<(), MeshError> {
    for _ in 0..source.count()? {
        let (dimension, entity, master) = (source.int()?, source.int()?, source.int()?);
        let affine = source.count()?;
        let affine = (0..affine).map(|_| source.real());
        let affine = affine.collect::<Result<_, _>>()?;
        let count = source.count()?;
        let pairs = (0..count).map(|_| Ok([source.tag()?, source.tag()?]));
        let pairs = pairs.collect::<Result<_, MeshError>>()?;
        contents.links.push(PeriodicLink {
            dimension,
            entity,
            master,
            affine,
            pairs,
        });
    }
    Ok(())
}
