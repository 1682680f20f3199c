//! Rigid fibres among each other: where they are, and which pieces of them are near.

use super::cells::Cells;
use super::region::Walls;
use super::{PlacementError, Region};
use crate::contact::closest_points;
use crate::{PeriodicBox, Quaternion, Vector3};
use rayon::prelude::*;

/// Cells per fibre: bounds the memory of dilute regions.
const CELLS_PER_FIBRE: f64 = 64.0;

/// Length of a piece in diameters, where many fibres need small cells.
const PIECE: f64 = 5.0;

/// How a fibre may be turned when it gives way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Turns {
    /// In any way.
    #[default]
    Free,
    /// About one direction only.
    About(Vector3),
    /// Not at all.
    Never,
    /// Nor does it move.
    Held,
}

/// A rigid fibre.
#[derive(Clone, Debug, Default)]
pub(super) struct Body {
    pub centre: Vector3,
    /// From the fibre's own frame to space.
    pub rotation: Quaternion,
    pub turns: Turns,
    /// Nodes in the fibre's own frame \[m\].
    pub nodes: Vec<Vector3>,
    /// Radius with half of the gap to others \[m\].
    pub shell: f64,
    /// Least distance of the nodes from walls \[m\].
    pub clearance: f64,
    /// Walls of its region; none for fibres that are held.
    pub walls: Option<Walls>,
    /// Direction that was drawn for it.
    pub drawn: Vector3,
    /// Index of its group.
    pub group: usize,
    /// Given up for want of room.
    pub gone: bool,
    /// First of its pieces, and the one after the last.
    pub pieces: std::ops::Range<usize>,
}

impl Body {
    /// Root mean square distance of the nodes from the centre \[m\].
    pub fn gyration(&self) -> f64 {
        let square: f64 = self.nodes.iter().map(Vector3::norm_squared).sum();
        (square / self.nodes.len() as f64).sqrt()
    }

    pub fn at(&self, x: &Vector3) -> Vector3 {
        self.centre + self.rotation * x
    }

    /// Inside its walls.
    pub fn inside(&self) -> bool {
        let free = |walls: &Walls, x| walls.excess(&self.at(x), self.clearance) == Vector3::zeros();
        let inside = |walls: Walls| self.nodes.iter().all(|x| free(&walls, x));
        self.walls.is_none_or(inside)
    }
}

/// Pieces that one thread handles at least.
const GRAIN: usize = 256;

/// All fibres, cut into pieces short enough for the cells.
pub(super) struct Crowd {
    pub bodies: Vec<Body>,
    /// Ends of the pieces in the frames of their fibres \[m\].
    pub local: Vec<[Vector3; 2]>,
    /// Ends of the pieces in space \[m\].
    pub ends: Vec<[Vector3; 2]>,
    /// Fibre of every piece.
    pub owner: Vec<u32>,
    /// Middles of the pieces when they were listed \[m\].
    middles: Vec<Vector3>,
    pub cells: Cells,
    /// Pairs nearer than this beyond touching are found \[m\].
    pub skin: f64,
    periodic: PeriodicBox,
    /// Longest piece \[m\].
    piece: f64,
}

impl Crowd {
    /// Room for about `count` fibres with shells up to `shell` \[m\] in the regions.
    pub fn new(
        periodic: &PeriodicBox,
        regions: &[Region],
        shell: f64,
        count: usize,
    ) -> Result<Self, PlacementError> {
        let apart = 2.0 * shell;
        let skin = 0.5 * apart;
        let mut bounds = [
            Vector3::repeat(f64::INFINITY),
            Vector3::repeat(f64::NEG_INFINITY),
        ];
        for region in regions {
            let [low, high] = region.bounds();
            bounds = [bounds[0].inf(&low), bounds[1].sup(&high)];
        }
        let least = 4.0 * apart;
        let mut shortest = f64::INFINITY;
        for (axis, length) in ['x', 'y', 'z'].into_iter().zip(periodic.lengths) {
            let length = length.unwrap_or(f64::INFINITY);
            if length < least {
                return Err(PlacementError::BoxTooSmall {
                    axis,
                    length,
                    radius: shell,
                    least,
                });
            }
            shortest = shortest.min(length);
        }
        // Two cells at least round a periodic axis, so that two pieces meet through one image only.
        let volume = (bounds[1] - bounds[0]).product();
        let sparse = (volume / (CELLS_PER_FIBRE * count.max(1) as f64)).cbrt();
        let width = sparse.max(PIECE * apart + apart + skin).min(0.5 * shortest);
        Ok(Self {
            bodies: Vec::new(),
            local: Vec::new(),
            ends: Vec::new(),
            owner: Vec::new(),
            middles: Vec::new(),
            cells: Cells::new(*periodic, bounds, width),
            skin,
            periodic: *periodic,
            piece: width - apart - skin,
        })
    }

    /// Adds a fibre at the first of `attempts` places at which it is free, or where it overlaps least.
    pub fn add(&mut self, mut body: Body, attempts: usize, place: impl FnMut(&mut Body)) {
        let first = self.local.len();
        for ends in body.nodes.windows(2) {
            let span = ends[1] - ends[0];
            let parts = (span.norm() / self.piece).ceil().max(1.0);
            let at = |k: usize| ends[0] + span * (k as f64 / parts);
            self.local
                .extend((0..parts as usize).map(|k| [at(k), at(k + 1)]));
        }
        body.pieces = first..self.local.len();
        self.ends.resize(self.local.len(), [Vector3::zeros(); 2]);
        self.owner
            .resize(self.local.len(), self.bodies.len() as u32);
        self.middles.resize(self.local.len(), Vector3::zeros());
        let pieces = body.pieces.clone();
        self.bodies.push(body);
        self.put(self.bodies.len() - 1, attempts, place);
        for piece in pieces {
            self.cells.insert(piece, &middle(&self.ends[piece]));
        }
    }

    /// Puts a fibre at the first of `attempts` places at which it is free of those listed, or where it overlaps least.
    pub fn put(&mut self, index: usize, attempts: usize, mut place: impl FnMut(&mut Body)) {
        let mut best = (usize::MAX, Vector3::zeros(), Quaternion::identity());
        for _ in 0..attempts {
            place(&mut self.bodies[index]);
            self.follow(index);
            let overlaps = self.overlaps(index, best.0);
            if overlaps < best.0 {
                let body = &self.bodies[index];
                best = (overlaps, body.centre, body.rotation);
            }
            if overlaps == 0 {
                return;
            }
        }
        let body = &mut self.bodies[index];
        (body.centre, body.rotation) = (best.1, best.2);
        self.follow(index);
    }

    /// Moves the pieces of a fibre to where it is.
    fn follow(&mut self, index: usize) {
        let body = &self.bodies[index];
        for piece in body.pieces.clone() {
            self.ends[piece] = self.local[piece].map(|x| body.at(&x));
        }
    }

    /// How often a fibre overlaps those that are listed, an image of itself, or a wall; `most` if it is more.
    fn overlaps(&self, index: usize, most: usize) -> usize {
        let body = &self.bodies[index];
        let walls = usize::from(!body.inside());
        let pieces = body.pieces.clone().flat_map(|i| {
            let others = self.cells.around(middle(&self.ends[i]));
            let others = others.chain(i + 1..body.pieces.end);
            others.filter(move |&j| self.gap(i, j).is_some_and(|gap| gap < 0.0))
        });
        walls + pieces.take(most.saturating_sub(walls)).count()
    }

    /// Lists all pieces anew and returns the pairs that are nearer than the skin.
    pub fn pairs(&mut self) -> Vec<[u32; 2]> {
        self.cells.clear(self.ends.len());
        for (piece, ends) in self.ends.iter().enumerate() {
            self.middles[piece] = middle(ends);
            if !self.bodies[self.owner[piece] as usize].gone {
                self.cells.insert(piece, &self.middles[piece]);
            }
        }
        let listed: &Self = self;
        let present = |&i: &usize| !listed.bodies[listed.owner[i] as usize].gone;
        let pieces = (0..listed.ends.len()).into_par_iter().with_min_len(GRAIN);
        let near = pieces.filter(present).flat_map_iter(|i| {
            let others = listed.cells.around(listed.middles[i]);
            let others = others.filter(move |&j| j > i && listed.may_meet(i, j));
            let near = move |&j: &usize| listed.gap(i, j).is_some_and(|gap| gap < listed.skin);
            others.filter(near).map(move |j| [i as u32, j as u32])
        });
        near.collect()
    }

    /// A quick answer from the middles of two pieces.
    fn may_meet(&self, a: usize, b: usize) -> bool {
        let between = self.middles[b] - self.middles[a];
        // The skin is half of the largest distance at which two axes touch.
        let reach = self.piece + 3.0 * self.skin;
        self.periodic.minimum_image(&between).norm_squared() < reach * reach
    }

    /// What to subtract from piece b to have it beside a \[m\].
    pub fn shift(&self, a: usize, b: usize) -> Vector3 {
        let between = middle(&self.ends[b]) - middle(&self.ends[a]);
        self.periodic.nearest_period(&between)
    }

    /// Distance of the shells of two pieces \[m\]; none where they cannot collide: in one fibre but for its images,
    /// or both held.
    pub fn gap(&self, a: usize, b: usize) -> Option<f64> {
        let (i, j) = (self.owner[a] as usize, self.owner[b] as usize);
        let shift = self.shift(a, b);
        if i == j && shift == Vector3::zeros() {
            return None;
        }
        let held = |k: usize| self.bodies[k].turns == Turns::Held;
        if held(i) && held(j) {
            return None;
        }
        let other = self.ends[b].map(|x| x - shift);
        let apart = self.bodies[i].shell + self.bodies[j].shell;
        Some(closest_points(&self.ends[a], &other).distance - apart)
    }
}

fn middle(ends: &[Vector3; 2]) -> Vector3 {
    0.5 * (ends[0] + ends[1])
}
