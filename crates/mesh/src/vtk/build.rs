//! From a VTK grid to a mesh.

use super::grid::Grid;
use super::{Options, PATCH_ARRAYS, failed};
use crate::assemble::{self, Parts, PatchFace};
use crate::faces::{FaceTable, face_key};
use crate::matching::join;
use crate::{ElementKind, Elements, Image, Mesh, MeshError};
use std::collections::{BTreeMap, BTreeSet};

/// What a VTK cell type means here.
enum Shape {
    /// Of no use here.
    Skipped,
    /// Places of its corners in the order of a polygon.
    Surface(&'static [usize]),
    /// Kind, and places of its vertices.
    Volume(ElementKind, &'static [usize]),
}

fn shape(code: u8) -> Option<Shape> {
    const ORDER: [usize; 8] = [0, 1, 2, 3, 4, 5, 6, 7];
    Some(match code {
        0..=4 => Shape::Skipped,
        5 => Shape::Surface(&ORDER[..3]),
        8 => Shape::Surface(&[0, 1, 3, 2]),
        9 => Shape::Surface(&ORDER[..4]),
        10 => Shape::Volume(ElementKind::Tetrahedron, &ORDER[..4]),
        11 => Shape::Volume(ElementKind::Hexahedron, &[0, 1, 3, 2, 4, 5, 7, 6]),
        12 => Shape::Volume(ElementKind::Hexahedron, &ORDER),
        13 => Shape::Volume(ElementKind::Prism, &ORDER[..6]),
        14 => Shape::Volume(ElementKind::Pyramid, &ORDER[..5]),
        _ => return None,
    })
}

pub(super) fn mesh(path: &str, grid: Grid, options: &Options) -> Result<Mesh, MeshError> {
    let mut parts = Parts::default();
    // Cell of every face.
    let mut surfaces = Vec::new();
    for (cell, (code, points)) in grid.cells().enumerate() {
        let place = || format!("cell {cell}");
        let Some(shape) = shape(code) else {
            let reason = format!(
                "VTK cell type {code} is not supported; linear tetrahedra (10), hexahedra (12), wedges (13) and pyramids (14) are, with triangles (5) and quadrilaterals (9) as patches"
            );
            return Err(failed(path, &place(), reason));
        };
        let order = match shape {
            Shape::Skipped => continue,
            Shape::Surface(order) | Shape::Volume(_, order) => order,
        };
        if order.len() != points.len() {
            let (wanted, found) = (order.len(), points.len());
            let reason = format!("a cell of type {code} has {wanted} points, not {found}");
            return Err(failed(path, &place(), reason));
        }
        let points = order.iter().map(|&k| points[k]);
        if let Shape::Volume(kind, _) = shape {
            parts.kinds.push(kind);
            parts.vertices.extend(points);
            if kind == ElementKind::Prism {
                let start = parts.vertices.len() - 6;
                turn(&mut parts.vertices[start..], &grid.points);
            }
        } else {
            let mut face = PatchFace {
                patch: 0,
                vertices: order.len() as u8,
                points: [0; 4],
            };
            face.points.iter_mut().zip(points).for_each(|(a, b)| *a = b);
            parts.faces.push(face);
            surfaces.push(cell);
        }
    }
    if parts.kinds.is_empty() {
        let reason = "there are no volume cells (tetrahedra, hexahedra, wedges, pyramids)";
        return Err(failed(path, "cells", reason));
    }
    let called = if surfaces.is_empty() {
        parts.points = grid.points;
        outer_faces(&mut parts)
    } else {
        let called = numbered(path, &grid, options, &surfaces)?;
        parts.points = grid.points;
        called
    };
    name(&mut parts, called, options).map_err(|reason| failed(path, "patches", reason))?;
    let (periods, copies) = join(&mut parts, &options.periodic)
        .map_err(|reason| failed(path, "periodic patches", reason))?;
    assemble::mesh(&parts, periods, &copies)
}

/// The first triangle of a prism looks at the second.
fn turn(prism: &mut [u32], points: &[[f64; 3]]) {
    let x = |k: usize| points[prism[k] as usize];
    let edge = |a: usize, b: usize| -> [f64; 3] { std::array::from_fn(|c| x(b)[c] - x(a)[c]) };
    let (u, v) = (edge(0, 1), edge(0, 2));
    let across = [edge(0, 3), edge(1, 4), edge(2, 5)];
    let volume: f64 = (0..3)
        .map(|c| {
            let (m, n) = ((c + 1) % 3, (c + 2) % 3);
            (u[m] * v[n] - u[n] * v[m]) * across.iter().map(|a| a[c]).sum::<f64>()
        })
        .sum();
    if volume < 0.0 {
        prism.rotate_left(3);
    }
}

/// What every face is called before names are given: the number of its surface.
fn numbered(
    path: &str,
    grid: &Grid,
    options: &Options,
    surfaces: &[usize],
) -> Result<Vec<String>, MeshError> {
    let found = PATCH_ARRAYS.iter().map(|&name| name.to_owned());
    let names: Vec<String> = options.array.clone().map_or(found.collect(), |a| vec![a]);
    let array = names.iter().find_map(|name| {
        let mut arrays = grid.arrays.iter();
        arrays.find_map(|(n, values)| values.as_ref().filter(|_| n == name))
    });
    match (array, &options.array) {
        (Some(values), _) => {
            let value = |&cell: &usize| values.get(cell).map(f64::to_string);
            let called: Option<Vec<String>> = surfaces.iter().map(value).collect();
            called.ok_or_else(|| failed(path, "cell data", "there are more cells than numbers"))
        }
        (None, None) => Ok(vec!["boundary".into(); surfaces.len()]),
        (None, Some(name)) => {
            let known: Vec<&str> = grid.arrays.iter().map(|a| a.0.as_str()).collect();
            let known = known.join("`, `");
            let reason = format!(
                "there is no cell array `{name}` with one number a cell; there are `{known}`"
            );
            Err(failed(path, "cell data", reason))
        }
    }
}

/// Faces that belong to one element, by the plane of the bounding box in which they lie.
fn outer_faces(parts: &mut Parts) -> Vec<String> {
    let mut elements = Elements::default();
    let mut rest = &parts.vertices[..];
    for &kind in &parts.kinds {
        let (nodes, others) = rest.split_at(kind.vertices());
        elements.push(kind, nodes, &[Image::ZERO; 8][..nodes.len()]);
        rest = others;
    }
    let used = || parts.vertices.iter().map(|&p| parts.points[p as usize]);
    let low: [f64; 3] = std::array::from_fn(|c| used().fold(f64::INFINITY, |low, x| low.min(x[c])));
    let high: [f64; 3] =
        std::array::from_fn(|c| used().fold(f64::NEG_INFINITY, |high, x| high.max(x[c])));
    let table = FaceTable::new(&elements, parts.points.len());
    let mut called = Vec::new();
    for e in 0..elements.len() {
        for (f, vertices) in elements.kinds[e].faces().iter().enumerate() {
            let (key, _) = face_key(&elements, e, f);
            if table.sides(&elements, key).count() != 1 {
                continue;
            }
            let mut face = PatchFace {
                patch: 0,
                vertices: vertices.len() as u8,
                points: [0; 4],
            };
            let nodes = elements.nodes(e);
            face.points
                .iter_mut()
                .zip(*vertices)
                .for_each(|(p, &v)| *p = nodes[v]);
            let lies = |(side, c): &(usize, usize)| {
                let plane = [low, high][*side][*c];
                let off = 1e-6 * (high[*c] - low[*c]);
                let near = |&p: &u32| (parts.points[p as usize][*c] - plane).abs() <= off;
                face.points().iter().all(near)
            };
            let plane = (0..6).map(|k| (k % 2, k / 2)).find(lies);
            called.push(match plane {
                Some((side, c)) => format!("{}_{}", ["x", "y", "z"][c], ["min", "max"][side]),
                None => "boundary".into(),
            });
            parts.faces.push(face);
        }
    }
    called
}

/// Gives every face its patch.
fn name(parts: &mut Parts, called: Vec<String>, options: &Options) -> Result<(), String> {
    let mut known: Vec<&String> = called.iter().collect::<BTreeSet<_>>().into_iter().collect();
    // Numbers in their own order.
    known.sort_by_key(|name| name.parse::<f64>().map_or(0, |x| x as i64));
    if let Some(unknown) = options.names.keys().find(|name| !known.contains(name)) {
        let known: Vec<&str> = known.into_iter().map(String::as_str).collect();
        return Err(format!(
            "there is no surface `{unknown}` to name; there are `{}`",
            known.join("`, `")
        ));
    }
    let mut patch_of = BTreeMap::new();
    for name in known {
        let given = options.names.get(name).cloned();
        let number = name.parse::<f64>().is_ok();
        let patch = given.unwrap_or_else(|| match number {
            true => format!("surface_{name}"),
            false => name.clone(),
        });
        let place = parts.patches.iter().position(|p| *p == patch);
        let place = place.unwrap_or_else(|| {
            parts.patches.push(patch);
            parts.patches.len() - 1
        });
        let place = u16::try_from(place).map_err(|_| "more than 65536 patches".to_owned())?;
        patch_of.insert(name, place);
    }
    for (face, name) in parts.faces.iter_mut().zip(&called) {
        face.patch = patch_of[name];
    }
    Ok(())
}
