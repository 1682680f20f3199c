//! The element that contains a point, on one rank.
//!
//! The answer is a function of the point alone, not of how it was found: a point on a face, edge or vertex (to
//! `INSIDE` in reference coordinates) belongs to the containing element with the smallest index in the whole mesh. So
//! restarts, walks and searches agree, and so do different numbers of ranks.

use crate::adjacency::{Adjacency, stepped};
use crate::boxes::{Bins, Bounds};
use crate::closest;
use crate::fetch::fetch;
use crate::lattice::{Lattice, Shift};
use fibreflow_mesh::shape::{self, Map};
use fibreflow_mesh::{Affine, ElementKind, Image, LocalMesh};
use nalgebra::Vector3;
use std::sync::Arc;

/// Tolerance of being inside, in reference coordinates.
const INSIDE: f64 = 1e-9;
/// Elements crossed by a walk before the bins are asked.
const LONGEST_WALK: usize = 16;
/// Elements around a vertex that are considered.
const MOST_AROUND: usize = 128;
/// Reference coordinates by the tangent at its centre, beyond which a bent element is not asked whether it still holds
/// the next point.
const NEAR: f64 = 0.5;

/// An element and the shift of a point there.
pub(crate) type Hint = (u32, Shift);

/// Where a point is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Location {
    /// Local element, owned by this rank.
    pub element: u32,
    /// The point plus this many lattice vectors lies in the element's coordinates.
    pub shift: Shift,
    /// Reference coordinates in the element.
    pub reference: [f64; 3],
    /// Distance \[m\] of the point from the element, 0 inside.
    pub distance: f64,
    /// False when an element of another rank may be the right one.
    pub certain: bool,
}

/// A containing element on the way to a [`Location`].
#[derive(Clone, Copy)]
struct Candidate {
    element: usize,
    shift: Shift,
    reference: [f64; 3],
}

impl Location {
    fn of(candidate: &Candidate, certain: bool) -> Self {
        Self {
            element: candidate.element as u32,
            shift: candidate.shift,
            reference: candidate.reference,
            distance: 0.0,
            certain,
        }
    }
}

/// The map of an element without a linear one that was asked last, as most often it is asked again.
#[derive(Default)]
pub(crate) struct Bent(Option<(usize, Map)>);

impl Bent {
    #[inline(always)]
    fn of(&mut self, locator: &Locator, element: usize) -> &Map {
        if self.0.as_ref().is_none_or(|kept| kept.0 != element) {
            self.0 = None;
        }
        let map = || Map::new(locator.kind(element), &locator.coordinates(element));
        &self.0.get_or_insert_with(|| (element, map())).1
    }
}

/// What a point needs of its element, in two cache lines.
#[repr(align(64))]
struct Cell {
    /// The map, or its tangent.
    map: Affine,
    nodes: [u32; 8],
}

/// An element of a [`Locator`] with what is asked of it for every point.
#[derive(Clone, Copy)]
pub(crate) struct Near<'a> {
    locator: &'a Locator,
    pub element: u32,
    pub shift: Shift,
    /// What the shift moves points by \[m\].
    pub away: Vector3<f64>,
    traits: Traits,
    cell: &'a Cell,
}

impl Near<'_> {
    /// Reference coordinates of a point that is in this element and in no other; None if it is not, or not for this rank
    /// to say.
    #[inline(always)]
    pub fn alone(&self, point: &Vector3<f64>, bent: &mut Bent) -> Option<[f64; 3]> {
        let Traits {
            kind,
            linear,
            owned,
            ..
        } = self.traits;
        let x = (point + self.away).into();
        let mut reference = self.cell.map.locate(x);
        if !linear {
            if !shape::inside(kind, reference, NEAR) {
                return None;
            }
            let map = bent.of(self.locator, self.element as usize);
            reference = map.locate_from(x, reference)?;
        }
        (owned && shape::inside(kind, reference, -INSIDE)).then_some(reference)
    }

    /// ∂(r, s, t)/∂x_c \[1/m\] for the three c at a reference point, in the first three of four.
    #[inline(always)]
    pub fn slopes(&self, reference: [f64; 3], bent: &mut Bent) -> [[f64; 4]; 3] {
        if self.traits.linear {
            return *self.cell.map.columns();
        }
        let map = bent.of(self.locator, self.element as usize);
        let [r, s, t] = map.inverse_jacobian(reference);
        [0, 1, 2].map(|c| [r[c], s[c], t[c], 0.0])
    }

    /// Its map is linear: slopes are everywhere the same.
    #[inline(always)]
    pub fn is_linear(&self) -> bool {
        self.traits.linear
    }

    /// Kind of the element.
    #[inline(always)]
    pub fn kind(&self) -> ElementKind {
        self.traits.kind
    }

    /// Its nodes; zeros where the kind has fewer than eight.
    #[inline(always)]
    pub fn nodes(&self) -> &[u32; 8] {
        &self.cell.nodes
    }

    /// A vertex is another image of its node.
    #[inline(always)]
    pub fn wraps(&self) -> bool {
        self.traits.wraps
    }
}

/// Finds elements on one rank.
pub(crate) struct Locator {
    mesh: Arc<LocalMesh>,
    adjacency: Adjacency,
    lattice: Lattice,
    bins: Bins,
    /// Faces (element, face) of owned elements behind which there is no owned element.
    surface: Vec<(u32, u8)>,
    surface_bins: Bins,
    /// Bounds of all local elements.
    bounds: Bounds,
    owned_bounds: Bounds,
    /// Typical size of an element \[m\].
    scale: f64,
    cells: Vec<Cell>,
    traits: Vec<Traits>,
}

/// What is asked of an element first, in one place.
#[derive(Clone, Copy)]
struct Traits {
    kind: ElementKind,
    /// Its map is the linear one of its cell.
    linear: bool,
    /// A vertex is another image of its node.
    wraps: bool,
    owned: bool,
}

impl Locator {
    /// Collective.
    pub fn new(mesh: Arc<LocalMesh>, total_volume: f64) -> Self {
        let adjacency = Adjacency::new(&mesh.elements);
        let scale = (total_volume / mesh.total_elements.max(1) as f64).cbrt();
        let vertices = |e: usize| {
            let x = mesh.elements.coordinates(e, &mesh.nodes, &mesh.periods);
            (x, mesh.elements.kinds[e])
        };
        let mut boxes = Vec::with_capacity(mesh.elements.len());
        let (mut bounds, mut owned_bounds) = (Bounds::empty(), Bounds::empty());
        let mut lattice = Lattice::new(&mesh.periods);
        let mut lowest = Vector3::repeat(f64::INFINITY);
        let mut surface = Vec::new();
        let mut surface_boxes = Vec::new();
        let mut cells = Vec::with_capacity(mesh.elements.len());
        let mut traits = Vec::with_capacity(mesh.elements.len());
        for e in 0..mesh.elements.len() {
            let (x, kind) = vertices(e);
            let linear = Affine::of(kind, &x);
            let mut nodes = [0; 8];
            nodes[..kind.vertices()].copy_from_slice(mesh.elements.nodes(e));
            cells.push(Cell {
                map: linear.unwrap_or_else(|| Affine::tangent(kind, &x)),
                nodes,
            });
            traits.push(Traits {
                kind,
                linear: linear.is_some(),
                wraps: mesh.elements.images(e).iter().any(|&i| i != Image::ZERO),
                owned: mesh.owned_elements[e],
            });
            let x = &x[..kind.vertices()];
            let around = Bounds::around(x);
            bounds.merge(&around);
            boxes.push(around.inflated(1e-6 * scale));
            for &vertex in x {
                lowest = lowest.inf(&lattice.fractions(&vertex.into()));
            }
            if !mesh.owned_elements[e] {
                continue;
            }
            owned_bounds.merge(&around);
            for (f, neighbour) in adjacency.of(e).iter().enumerate() {
                if !neighbour.is_some_and(|n| mesh.owned_elements[n.element as usize]) {
                    surface.push((e as u32, f as u8));
                    surface_boxes.push(Bounds::around(kind.faces()[f].iter().map(|&v| &x[v])));
                }
            }
        }
        let communicator = mesh.halo.communicator();
        lattice.start_at(lowest.map(|f| communicator.min(f)));
        Self {
            adjacency,
            lattice,
            bins: Bins::new(&boxes),
            surface_bins: Bins::new(&surface_boxes),
            surface,
            bounds: bounds.inflated(1e-6 * scale),
            owned_bounds,
            scale,
            cells,
            traits,
            mesh,
        }
    }

    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Bounds of the elements this rank owns.
    pub fn owned_bounds(&self) -> &Bounds {
        &self.owned_bounds
    }

    /// Typical size of an element \[m\].
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// The owned element that contains the point or, failing that, the nearest one. None without owned elements.
    #[inline]
    pub fn find(
        &self,
        point: &Vector3<f64>,
        hint: Option<Hint>,
        bent: &mut Bent,
    ) -> Option<Location> {
        let walked = hint.and_then(|(e, shift)| self.walk(point, e as usize, shift, bent));
        match walked {
            Some(start) if self.is_alone(&start) => Some(Location::of(&start, true)),
            _ => self.find_slowly(point, walked, bent),
        }
    }

    /// A local element, and a shift of points there, at hand for many of them; None if there is no such element.
    #[inline(always)]
    pub fn near(&self, (element, shift): Hint) -> Option<Near<'_>> {
        Some(Near {
            locator: self,
            element,
            shift,
            away: self.lattice.away(shift),
            traits: *self.traits.get(element as usize)?,
            cell: self.cells.get(element as usize)?,
        })
    }

    #[cold]
    fn find_slowly(
        &self,
        point: &Vector3<f64>,
        walked: Option<Candidate>,
        bent: &mut Bent,
    ) -> Option<Location> {
        walked
            .or_else(|| self.search(point, bent))
            .and_then(|start| self.canonical(point, start, bent))
            .or_else(|| self.nearest(point))
    }

    /// Lets what is kept of an element come near, and its neighbours where points may `leave` it.
    #[inline(always)]
    pub fn fetch(&self, element: u32, leave: bool) {
        let element = element as usize;
        if let Some(cell) = self.cells.get(element) {
            fetch(&cell.map);
            fetch(&cell.nodes);
            if leave {
                self.adjacency.fetch(element);
            }
        }
    }

    /// Lets what `values` has at the nodes of an element come near.
    #[inline(always)]
    pub fn fetch_nodes<T>(&self, element: u32, values: &[T]) {
        let cell = self.cells.get(element as usize);
        let nodes = cell.into_iter().flat_map(|cell| &cell.nodes);
        nodes.for_each(|&node| fetch(&values[node as usize]));
    }

    /// Nodes of a local element; zeros where the kind has fewer than eight.
    #[inline(always)]
    pub fn nodes(&self, element: usize) -> &[u32; 8] {
        &self.cells[element].nodes
    }

    /// Vertex coordinates of a local element.
    pub fn coordinates(&self, element: usize) -> [[f64; 3]; 8] {
        let mesh = &self.mesh;
        mesh.elements
            .coordinates(element, &mesh.nodes, &mesh.periods)
    }

    /// Kind of a local element.
    #[inline(always)]
    pub fn kind(&self, element: usize) -> ElementKind {
        self.traits[element].kind
    }

    /// Where a point is held: at itself, or, out of the domain, at its location \[m\], in the frame of the point.
    #[inline(always)]
    pub fn held(&self, point: &Vector3<f64>, location: &Location) -> Vector3<f64> {
        if location.distance == 0.0 {
            return *point;
        }
        let element = location.element as usize;
        let coordinates = self.coordinates(element);
        let place = shape::position(self.kind(element), &coordinates, location.reference);
        self.lattice
            .image(&place.into(), location.shift.map(|s| -s))
    }

    /// Reference coordinates of a point, which may be outside, in an element; None where that has no answer.
    #[inline(always)]
    fn reference(
        &self,
        point: &Vector3<f64>,
        element: usize,
        shift: Shift,
        bent: &mut Bent,
    ) -> Option<[f64; 3]> {
        let x = self.lattice.image(point, shift).into();
        let guess = self.cells[element].map.locate(x);
        if self.traits[element].linear {
            Some(guess)
        } else {
            bent.of(self, element).locate_from(x, guess)
        }
    }

    #[inline(always)]
    fn contained(
        &self,
        point: &Vector3<f64>,
        element: usize,
        shift: Shift,
        bent: &mut Bent,
    ) -> Option<Candidate> {
        let reference = self.reference(point, element, shift, bent)?;
        shape::inside(self.kind(element), reference, INSIDE).then_some(Candidate {
            element,
            shift,
            reference,
        })
    }

    /// From element to element through the face that the point lies farthest behind.
    #[inline(always)]
    fn walk(
        &self,
        point: &Vector3<f64>,
        element: usize,
        shift: Shift,
        bent: &mut Bent,
    ) -> Option<Candidate> {
        if element >= self.traits.len() {
            return None;
        }
        let (mut element, mut shift) = (element, shift);
        for _ in 0..LONGEST_WALK {
            let reference = self.reference(point, element, shift, bent)?;
            let kind = self.kind(element);
            if shape::inside(kind, reference, INSIDE) {
                return Some(Candidate {
                    element,
                    shift,
                    reference,
                });
            }
            let next = self.adjacency.of(element)[shape::exit(kind, reference)]?;
            (element, shift) = (next.element as usize, stepped(shift, next.shift));
        }
        None
    }

    /// No other element contains the point, and this rank owns the one that does.
    #[inline(always)]
    fn is_alone(&self, found: &Candidate) -> bool {
        let Traits { kind, owned, .. } = self.traits[found.element];
        owned && shape::inside(kind, found.reference, -INSIDE)
    }

    /// Any local element that contains the point, by bins.
    fn search(&self, point: &Vector3<f64>, bent: &mut Bent) -> Option<Candidate> {
        self.lattice.images(point).find_map(|shift| {
            let x = self.lattice.image(point, shift);
            if !self.bounds.contains(&x) {
                return None;
            }
            let listed = self.bins.at(&x).iter();
            listed
                .filter_map(|&e| self.contained(point, e as usize, shift, bent))
                .next()
        })
    }

    /// Among all elements that contain the point, the owned one with the smallest index in the whole mesh.
    fn canonical(
        &self,
        point: &Vector3<f64>,
        start: Candidate,
        bent: &mut Bent,
    ) -> Option<Location> {
        let mesh = &self.mesh;
        if shape::inside(self.kind(start.element), start.reference, -INSIDE) {
            return mesh.owned_elements[start.element].then(|| Location::of(&start, true));
        }
        let mut around = self.around(point, start, bent);
        around.sort_by_key(|c| (mesh.global_elements[c.element], c.shift));
        let best = around.iter().position(|c| mesh.owned_elements[c.element])?;
        let nodes = mesh.elements.nodes(around[best].element);
        // With all its nodes owned, every element that touches it is here.
        let all_known = nodes.iter().all(|&n| (n as usize) < mesh.owned());
        Some(Location::of(&around[best], best == 0 && all_known))
    }

    /// All local elements that contain the point, joined by faces.
    fn around(&self, point: &Vector3<f64>, start: Candidate, bent: &mut Bent) -> Vec<Candidate> {
        let mut found = vec![start];
        let mut next = 0;
        while next < found.len() && found.len() < MOST_AROUND {
            let from = found[next];
            for neighbour in self.adjacency.of(from.element).iter().flatten() {
                let (element, shift) = (
                    neighbour.element as usize,
                    stepped(from.shift, neighbour.shift),
                );
                let known = |c: &Candidate| c.element == element && c.shift == shift;
                if !found.iter().any(known) {
                    found.extend(self.contained(point, element, shift, bent));
                }
            }
            next += 1;
        }
        found
    }

    /// The nearest owned element to a point that is in none.
    fn nearest(&self, point: &Vector3<f64>) -> Option<Location> {
        let mut images: Vec<(f64, Shift)> = self
            .lattice
            .images(point)
            .map(|shift| {
                (
                    self.owned_bounds
                        .distance(&self.lattice.image(point, shift)),
                    shift,
                )
            })
            .collect();
        images.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut best: Option<(f64, u32, Shift, Vector3<f64>)> = None;
        for (bound, shift) in images {
            let mut reach = best.map_or(f64::INFINITY, |b| b.0);
            if bound > reach {
                break;
            }
            let x = self.lattice.image(point, shift);
            self.surface_bins.outwards(&x, |item| {
                let (element, face) = self.surface[item as usize];
                let closest = self.closest(&x, element as usize, face as usize);
                let distance = (closest - x).norm();
                if distance < reach {
                    reach = distance;
                    best = Some((distance, element, shift, closest));
                }
                reach
            });
        }
        let (distance, element, shift, closest) = best?;
        let kind = self.mesh.elements.kinds[element as usize];
        let coordinates = self.coordinates(element as usize);
        let reference = shape::locate(kind, &coordinates, closest.into())
            .map_or_else(|| shape::centre(kind), |r| closest::in_reference(kind, r));
        Some(Location {
            element,
            shift,
            reference,
            distance,
            certain: false,
        })
    }

    fn closest(&self, x: &Vector3<f64>, element: usize, face: usize) -> Vector3<f64> {
        let vertices = self.mesh.elements.kinds[element].faces()[face];
        let coordinates = self.coordinates(element);
        let mut corners = [Vector3::zeros(); 4];
        for (corner, &v) in corners.iter_mut().zip(vertices) {
            *corner = coordinates[v].into();
        }
        closest::on_face(x, &corners[..vertices.len()])
    }
}
