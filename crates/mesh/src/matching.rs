//! Patches that are joined as periodic copies of each other, their nodes matched by position.

use crate::assemble::Parts;
use crate::periodic::{Copy, Link, TOLERANCE, identify};
use crate::{Image, Periods};
use std::collections::HashMap;

/// Two patches of a mesh file that are one surface of a periodic domain.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PeriodicPatches {
    /// Names of the two.
    pub patches: [String; 2],
    /// From the first to the second \[m\]; None: between the means of their nodes.
    pub translation: Option<[f64; 3]>,
}

/// Joins patches: lattice vectors and copies. Their faces and names leave the parts.
pub(crate) fn join(
    parts: &mut Parts,
    pairs: &[PeriodicPatches],
) -> Result<(Periods, Vec<Copy>), String> {
    let links = pairs.iter().map(|pair| link(parts, pair));
    let links: Vec<Link> = links.collect::<Result<_, _>>()?;
    let found = if links.is_empty() {
        let own = |master| Copy {
            master,
            image: Image::ZERO,
        };
        let points = 0..parts.points.len() as u32;
        (Periods::default(), points.map(own).collect())
    } else {
        identify(&links, &parts.points)?
    };
    let joined = |name: &String| pairs.iter().any(|pair| pair.patches.contains(name));
    let mut kept = 0;
    let places: Vec<Option<u16>> = (parts.patches.iter())
        .map(|name| {
            let place = (!joined(name)).then_some(kept);
            kept += u16::from(place.is_some());
            place
        })
        .collect();
    parts.patches.retain(|name| !joined(name));
    parts.faces.retain_mut(|face| {
        let place = places[face.patch as usize];
        face.patch = place.unwrap_or(0);
        place.is_some()
    });
    Ok(found)
}

fn link(parts: &Parts, pair: &PeriodicPatches) -> Result<Link, String> {
    let [first, second] = &pair.patches;
    let nodes = |name: &String| {
        let patch = parts.patches.iter().position(|p| p == name);
        let patch = patch.ok_or_else(|| {
            let known = parts.patches.join("`, `");
            format!("there is no patch `{name}` to be periodic; there are `{known}`")
        })?;
        let faces = parts.faces.iter().filter(|f| f.patch as usize == patch);
        let mut nodes: Vec<u32> = faces.flat_map(|f| f.points()).copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        Ok::<_, String>(nodes)
    };
    let (a, b) = (nodes(first)?, nodes(second)?);
    if a.len() != b.len() {
        return Err(format!(
            "patches `{first}` and `{second}` are no periodic copies of each other: they have {} and {} nodes",
            a.len(),
            b.len()
        ));
    }
    let mean = |nodes: &[u32]| -> [f64; 3] {
        let sum = |c: usize| -> f64 { nodes.iter().map(|&n| parts.points[n as usize][c]).sum() };
        std::array::from_fn(|c| sum(c) / nodes.len() as f64)
    };
    let translation = pair.translation.unwrap_or_else(|| {
        let (from, to) = (mean(&a), mean(&b));
        std::array::from_fn(|c| to[c] - from[c])
    });
    let length = translation.iter().map(|t| t * t).sum::<f64>().sqrt();
    let near = Near::new(&parts.points, &a, TOLERANCE * length);
    let original = |&copy: &u32| {
        let x = parts.points[copy as usize];
        let from = std::array::from_fn(|c| x[c] - translation[c]);
        let node = near.find(from).ok_or_else(|| {
            format!(
                "patches `{first}` and `{second}` are no periodic copies of each other: the node at {x:?} of `{second}` has no partner at {from:?} (translation {translation:?})"
            )
        })?;
        Ok([copy, node])
    };
    Ok(Link {
        names: [format!("`{second}`"), format!("`{first}`")],
        translation: Some(translation),
        pairs: b.iter().map(original).collect::<Result<_, String>>()?,
    })
}

/// Points found by position within a tolerance, through a grid of cells of that size.
struct Near<'a> {
    points: &'a [[f64; 3]],
    tolerance: f64,
    cells: HashMap<[i64; 3], Vec<u32>>,
}

impl<'a> Near<'a> {
    fn new(points: &'a [[f64; 3]], nodes: &[u32], tolerance: f64) -> Self {
        let mut near = Self {
            points,
            tolerance,
            cells: HashMap::with_capacity(nodes.len()),
        };
        for &node in nodes {
            let cell = near.cell(points[node as usize]);
            near.cells.entry(cell).or_default().push(node);
        }
        near
    }

    fn cell(&self, x: [f64; 3]) -> [i64; 3] {
        x.map(|c| (c / self.tolerance).floor() as i64)
    }

    /// The nearest point within the tolerance.
    fn find(&self, x: [f64; 3]) -> Option<u32> {
        let cell = self.cell(x);
        let around = (0..27).flat_map(|k: i64| {
            let steps = [k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1];
            let cell = std::array::from_fn(|c| cell[c].saturating_add(steps[c]));
            self.cells.get(&cell).into_iter().flatten()
        });
        let distance = |&node: &u32| {
            let y = self.points[node as usize];
            (0..3).map(|c| (x[c] - y[c]).powi(2)).sum::<f64>().sqrt()
        };
        let nearest = around.map(|n| (distance(n), *n));
        let nearest = nearest.min_by(|a, b| a.0.total_cmp(&b.0))?;
        (nearest.0 <= self.tolerance).then_some(nearest.1)
    }
}
