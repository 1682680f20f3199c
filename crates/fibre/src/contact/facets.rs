//! A triangulated surface as a wall: its features, neighbours in a cell list, and what a segment touches of it.
//!
//! A segment touches a surface where the distance between them has a local minimum: an end with a face, edge or corner, or
//! a point inside the axis with a protruding edge or corner. A face's closest point on its own rim counts only if no
//! other face with that part of the rim is nearer, and once: so an edge inside a flat wall is not felt. Where the surface
//! bends a little towards the fibres, two faces are near at once; the nearer one counts, or a polygon in place of a pipe
//! would be twice as stiff at its edges.

use crate::contact::closest::closest_points;
use crate::contact::grid::CellGrid;
use crate::{PeriodicBox, Vector3};
use std::collections::HashMap;

/// Beyond this sine of the angle between two faces their edge protrudes or recedes.
const FLAT: f64 = 1e-6;
/// Corners nearer than this fraction of the largest facet are one.
const WELD: f64 = 1e-6;
/// Normals whose cosine is above this belong to one contact.
const SAME_CONTACT: f64 = 0.94;

/// A surface of triangles whose normals (right-hand rule) point to the fibres' side.
#[derive(Clone, Debug)]
pub(super) struct Facets {
    faces: Vec<Face>,
    edges: Vec<Edge>,
    periodic: PeriodicBox,
    grid: CellGrid,
    /// (cell, item), ascending; items are the faces, then the edges.
    cells: Vec<(u64, u32)>,
}

#[derive(Clone, Debug)]
struct Face {
    corners: [Vector3; 3],
    ids: [u32; 3],
    /// Ids of the edges, from corner k to the next.
    edges: [u32; 3],
    normal: Vector3,
    /// Whether edge k, from corner k to the next, has another face.
    shared: [bool; 3],
    /// Whether it protrudes towards the fibres.
    protrudes: [bool; 3],
}

#[derive(Clone, Debug)]
struct Edge {
    ends: [Vector3; 2],
    ids: [u32; 2],
    id: u32,
    /// Unit vectors in the two faces, across the edge and away from it.
    into: [Vector3; 2],
    protrudes: bool,
}

/// Part of a face or edge that is nearest to something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Feature {
    Inside,
    Edge(u32),
    Corner(u32),
    /// An edge or corner at the rim of the surface.
    Rim,
}

/// Nearest point of an item.
#[derive(Clone, Copy, Debug)]
pub(super) struct Near {
    /// Unit vector from the surface to the axis.
    pub normal: Vector3,
    /// Distance; negative behind a face \[m\].
    pub height: f64,
    /// Place on the axis, 0 to 1.
    pub at: f64,
    feature: Feature,
    /// Not the nearest place after all.
    lost: bool,
}

impl Near {
    /// On a surface without edges.
    pub fn smooth(normal: Vector3, height: f64, at: f64) -> Self {
        Self {
            normal,
            height,
            at,
            feature: Feature::Inside,
            lost: false,
        }
    }
}

/// Why a list of triangles is no surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Flaw {
    Empty,
    NoArea,
    ManyFaces,
}

impl Facets {
    pub fn new(triangles: &[[Vector3; 3]], periodic: &PeriodicBox) -> Result<Self, Flaw> {
        let spans = triangles.iter().map(|t| {
            let sides = [t[1] - t[0], t[2] - t[1], t[0] - t[2]];
            sides.iter().map(|s| s.norm()).fold(0.0, f64::max)
        });
        let largest = spans.fold(0.0, f64::max);
        if !(largest > 0.0 && largest.is_finite()) {
            return Err(Flaw::Empty);
        }
        let middle = |t: &[Vector3; 3], k: usize| (t[k] + t[(k + 1) % 3]) * 0.5;
        let tolerance = WELD * largest;
        let corner_ids = weld(triangles, periodic, tolerance, |t, k| t[k]);
        let edge_ids = weld(triangles, periodic, tolerance, middle);
        let mut faces = Vec::with_capacity(triangles.len());
        for (corners, (ids, edges)) in triangles.iter().zip(corner_ids.into_iter().zip(edge_ids)) {
            let across = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
            let normal = across.try_normalize(1e-12 * largest * largest);
            faces.push(Face {
                corners: *corners,
                ids,
                edges,
                normal: normal.ok_or(Flaw::NoArea)?,
                shared: [false; 3],
                protrudes: [false; 3],
            });
        }
        let edges = join(&mut faces)?;
        let grid = CellGrid::new(periodic, largest);
        let mut surface = Self {
            faces,
            edges,
            periodic: *periodic,
            grid,
            cells: Vec::new(),
        };
        for item in 0..surface.items() {
            let corners = surface.corners(item);
            let low = corners.iter().fold(corners[0], |low, x| low.inf(x));
            let high = corners.iter().fold(corners[0], |high, x| high.sup(x));
            let cover = grid.cover(&[low, high], WELD * largest);
            let cells = cover.keys().map(|key| (key, item as u32));
            surface.cells.extend(cells);
        }
        surface.cells.sort_unstable();
        Ok(surface)
    }

    /// Number of faces and edges.
    pub fn items(&self) -> usize {
        self.faces.len() + self.edges.len()
    }

    fn corners(&self, item: usize) -> &[Vector3] {
        match item.checked_sub(self.faces.len()) {
            None => &self.faces[item].corners,
            Some(edge) => &self.edges[edge].ends,
        }
    }

    /// Items within `reach` of an axis, with the period to subtract from the axis, ascending.
    pub fn around(&self, axis: &[Vector3; 2], reach: f64, out: &mut Vec<(u32, Vector3)>) {
        out.clear();
        let mut items: Vec<u32> = Vec::new();
        for key in self.grid.cover(axis, reach).keys() {
            let first = self.cells.partition_point(|c| c.0 < key);
            let here = self.cells[first..].iter().take_while(|c| c.0 == key);
            items.extend(here.map(|c| c.1));
        }
        items.sort_unstable();
        items.dedup();
        let middle = (axis[0] + axis[1]) * 0.5;
        for item in items {
            let corners = self.corners(item as usize);
            let base = self.periodic.nearest_period(&(middle - corners[0]));
            for image in self.images() {
                let shift = base + image;
                let moved = axis.map(|x| x - shift);
                if self.distance(item as usize, &moved) < reach {
                    out.push((item, shift));
                }
            }
        }
    }

    /// The box and its neighbours in the periodic directions.
    fn images(&self) -> impl Iterator<Item = Vector3> {
        let steps = self.periodic.lengths.map(|l| match l {
            Some(l) => [0.0, -l, l],
            None => [0.0, f64::NAN, f64::NAN],
        });
        (0..27)
            .map(move |k| Vector3::new(steps[0][k % 3], steps[1][k / 3 % 3], steps[2][k / 9]))
            .filter(|v| !v.sum().is_nan())
    }

    fn distance(&self, item: usize, axis: &[Vector3; 2]) -> f64 {
        let Some(edge) = item.checked_sub(self.faces.len()) else {
            let ends = axis.iter().map(|x| self.faces[item].near(x).1.norm());
            let sides = self.faces[item].sides();
            let sides = sides.map(|side| closest_points(axis, &side).distance);
            return ends.chain(sides).fold(f64::INFINITY, f64::min);
        };
        closest_points(axis, &self.edges[edge].ends).distance
    }

    /// Nearest points of the items to the axis (in the surface's own frame) for one contact slot: 0 and 1 are the ends
    /// with faces, 0 the inside with edges. Answers one entry an item, `None` where there is no local minimum.
    pub fn touch(&self, items: &[(u32, [Vector3; 2])], slot: usize, out: &mut Vec<Option<Near>>) {
        out.clear();
        let nearest = |(item, axis): &(u32, [Vector3; 2])| self.nearest(*item as usize, axis, slot);
        out.extend(items.iter().map(nearest));
        for k in 0..out.len() {
            if let Some(mut near) = out[k] {
                near.lost = !self.counts(items[k].0, &near) || self.is_beaten(items, k, &near, out);
                out[k] = Some(near);
            }
        }
        keep_found(out);
        for k in 0..out.len() {
            if let Some(mut near) = out[k] {
                near.lost = belongs_to_another(items, k, &near, out);
                out[k] = Some(near);
            }
        }
        keep_found(out);
    }

    fn counts(&self, item: u32, near: &Near) -> bool {
        match (item as usize).checked_sub(self.faces.len()) {
            Some(edge) => self.edges[edge].carries(near),
            None => near.feature != Feature::Rim,
        }
    }

    fn nearest(&self, item: usize, axis: &[Vector3; 2], slot: usize) -> Option<Near> {
        match item.checked_sub(self.faces.len()) {
            None => {
                let face = &self.faces[item];
                let (feature, away, protrudes) = face.near(&axis[slot]);
                let distance = away.norm();
                // Behind a protruding edge something else is nearer.
                let in_front = protrudes || away.dot(&face.normal) >= 0.0;
                let sign = if in_front { 1.0 } else { -1.0 };
                let on_surface = distance <= 1e-12 * (axis[1] - axis[0]).norm();
                let normal = if feature == Feature::Inside || on_surface {
                    face.normal
                } else {
                    away / distance * sign
                };
                Some(Near {
                    normal,
                    height: distance * sign,
                    at: slot as f64,
                    feature,
                    lost: false,
                })
            }
            Some(edge) if slot == 0 => self.edges[edge].near(axis),
            Some(_) => None,
        }
    }

    /// Whether another item with the same edge or corner is nearer, or an earlier one has the same nearest point.
    fn is_beaten(
        &self,
        items: &[(u32, [Vector3; 2])],
        k: usize,
        near: &Near,
        all: &[Option<Near>],
    ) -> bool {
        let faces = self.faces.len();
        let shares = |item: u32| match ((item as usize).checked_sub(faces), near.feature) {
            (_, Feature::Inside | Feature::Rim) => false,
            (None, Feature::Edge(id)) => self.faces[item as usize].edges.contains(&id),
            (None, Feature::Corner(id)) => self.faces[item as usize].ids.contains(&id),
            (Some(edge), Feature::Edge(id)) => self.edges[edge].id == id,
            (Some(edge), Feature::Corner(id)) => self.edges[edge].ids.contains(&id),
        };
        let is_edge = |k: usize| items[k].0 as usize >= faces;
        let away = |near: &Near| near.normal * near.height;
        let size = near.height.abs();
        let others = (0..items.len()).filter(|&other| other != k && is_edge(other) == is_edge(k));
        others
            .filter_map(|other| all[other].map(|found| (other, found)))
            .any(|(other, found)| {
                let same = (away(&found) - away(near)).norm() <= 1e-9 * size
                    && (found.at - near.at).abs() <= 1e-9;
                if same {
                    other < k && !found.lost
                } else {
                    shares(items[other].0) && found.height.abs() < size
                }
            })
    }

    /// Whether two items have a corner in common.
    pub fn adjacent(&self, a: u32, b: u32) -> bool {
        let ids = |item: u32| match (item as usize).checked_sub(self.faces.len()) {
            None => &self.faces[item as usize].ids[..],
            Some(edge) => &self.edges[edge].ids[..],
        };
        ids(a).iter().any(|id| ids(b).contains(id))
    }
}

fn keep_found(out: &mut [Option<Near>]) {
    out.iter_mut()
        .for_each(|near| *near = near.filter(|x| !x.lost));
}

/// Whether another item is nearer in almost the same direction at almost the same place of the axis.
fn belongs_to_another(
    items: &[(u32, [Vector3; 2])],
    k: usize,
    near: &Near,
    all: &[Option<Near>],
) -> bool {
    let axis = &items[k].1;
    let length = (axis[1] - axis[0]).norm();
    (0..items.len()).filter(|&other| other != k).any(|other| {
        all[other].is_some_and(|found| {
            let (a, b) = (found.height.abs(), near.height.abs());
            found.normal.dot(&near.normal) > SAME_CONTACT
                && (found.at - near.at).abs() * length <= b
                && (a < b || (a == b && other < k))
        })
    })
}

impl Face {
    fn sides(&self) -> [[Vector3; 2]; 3] {
        [0, 1, 2].map(|k| [self.corners[k], self.corners[(k + 1) % 3]])
    }

    /// Where the face is nearest to a point, the way from there to the point, and whether the place protrudes.
    fn near(&self, x: &Vector3) -> (Feature, Vector3, bool) {
        let height = (x - self.corners[0]).dot(&self.normal);
        let sides = self.sides();
        let inside = sides.iter().all(|[start, end]| {
            let inward = self.normal.cross(&(end - start));
            inward.dot(&(x - start)) > 0.0
        });
        if inside {
            return (Feature::Inside, self.normal * height, false);
        }
        let nearest = (0..3).map(|k| {
            let [start, end] = sides[k];
            let side = end - start;
            let t = ((x - start).dot(&side) / side.norm_squared()).clamp(0.0, 1.0);
            let (feature, protrudes) = self.feature(k, t);
            (feature, x - start - side * t, protrudes)
        });
        let first = (Feature::Rim, Vector3::repeat(f64::INFINITY), false);
        nearest.fold(first, |best, next| {
            if next.1.norm_squared() < best.1.norm_squared() {
                next
            } else {
                best
            }
        })
    }

    /// Place `t` of side `k`, and whether it protrudes.
    fn feature(&self, k: usize, t: f64) -> (Feature, bool) {
        let [next, before] = [(k + 1) % 3, (k + 2) % 3];
        let corner = |corner: usize, other: usize| {
            if self.shared[k] && self.shared[other] {
                let protrudes = self.protrudes[k] || self.protrudes[other];
                (Feature::Corner(self.ids[corner]), protrudes)
            } else {
                (Feature::Rim, false)
            }
        };
        if t <= 0.0 {
            corner(k, before)
        } else if t >= 1.0 {
            corner(next, next)
        } else if self.shared[k] {
            (Feature::Edge(self.edges[k]), self.protrudes[k])
        } else {
            (Feature::Rim, false)
        }
    }
}

impl Edge {
    /// Where the inside of an axis is nearest; `None` if an end is.
    fn near(&self, axis: &[Vector3; 2]) -> Option<Near> {
        let points = closest_points(axis, &self.ends);
        if !(points.s > 0.0 && points.s < 1.0 && points.distance > 0.0) {
            return None;
        }
        let feature = match points.t {
            0.0 => Feature::Corner(self.ids[0]),
            1.0 => Feature::Corner(self.ids[1]),
            _ => Feature::Edge(self.id),
        };
        Some(Near {
            normal: -points.separation / points.distance,
            height: points.distance,
            at: points.s,
            feature,
            lost: false,
        })
    }

    /// Whether the edge protrudes and the axis is in front of it rather than of one of its faces.
    fn carries(&self, near: &Near) -> bool {
        let beside = |into: &Vector3| near.normal.dot(into) > 1e-9;
        self.protrudes && !self.into.iter().any(beside)
    }
}

/// Ids of three points of each triangle; equal for those that coincide, also across the period.
fn weld(
    triangles: &[[Vector3; 3]],
    periodic: &PeriodicBox,
    tolerance: f64,
    point: impl Fn(&[Vector3; 3], usize) -> Vector3,
) -> Vec<[u32; 3]> {
    let mut known: HashMap<[i64; 3], Vec<(Vector3, u32)>> = HashMap::new();
    let mut count = 0;
    let cell = 4.0 * tolerance;
    let mut id_of = |x: &Vector3| {
        let x = periodic.wrap(x);
        let place = |x: f64| (x / cell).floor() as i64;
        let apart = |y: &Vector3| periodic.minimum_image(&(x - y)).norm();
        // Near a seam or a cell boundary the partner lies in a neighbouring cell.
        for k in 0..27_usize {
            let step = [k % 3, k / 3 % 3, k / 9].map(|s| (s as f64 - 1.0) * tolerance);
            let near = periodic.wrap(&(x + Vector3::from(step)));
            let list = known.get(&[place(near.x), place(near.y), place(near.z)]);
            let found = list.and_then(|l| l.iter().find(|(y, _)| apart(y) < tolerance));
            if let Some((_, id)) = found {
                return *id;
            }
        }
        let key = [place(x.x), place(x.y), place(x.z)];
        known.entry(key).or_default().push((x, count));
        count += 1;
        count - 1
    };
    triangles
        .iter()
        .map(|t| [0, 1, 2].map(|k| id_of(&point(t, k))))
        .collect()
}

/// The edges with two faces; marks them in the faces.
fn join(faces: &mut [Face]) -> Result<Vec<Edge>, Flaw> {
    let mut sides: HashMap<u32, Vec<(usize, usize)>> = HashMap::new();
    for (f, face) in faces.iter().enumerate() {
        for k in 0..3 {
            sides.entry(face.edges[k]).or_default().push((f, k));
        }
    }
    let mut edges = Vec::new();
    for pair in sides.into_values() {
        let &[(f, k), (g, m)] = &pair[..] else {
            if pair.len() > 2 {
                return Err(Flaw::ManyFaces);
            }
            continue;
        };
        let (first, second) = (&faces[f], &faces[g]);
        let into = |face: &Face, k: usize| {
            let [start, end] = face.sides()[k];
            face.normal.cross(&(end - start)).normalize()
        };
        let into = [into(first, k), into(second, m)];
        // The second face falls away from the side that the first one's normal points to.
        let protrudes = into[1].dot(&first.normal) < -FLAT;
        edges.push(Edge {
            ends: first.sides()[k],
            ids: [first.ids[k], first.ids[(k + 1) % 3]],
            id: first.edges[k],
            protrudes,
            into,
        });
        for (face, side) in [(f, k), (g, m)] {
            faces[face].shared[side] = true;
            faces[face].protrudes[side] = protrudes;
        }
    }
    edges.sort_unstable_by_key(|edge| edge.id);
    Ok(edges)
}

#[cfg(test)]
mod tests;
