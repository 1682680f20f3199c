//! Brings points that any rank owns to the ranks that own the elements around them, and answers back.

use crate::CouplingError;
use crate::boxes::Bounds;
use crate::lattice::{Lattice, Shift};
use crate::locate::{Location, Locator};
use bytemuck::{Pod, Zeroable};
use fibreflow_fibre::Ambient;
use fibreflow_mesh::LocalMesh;
use fibreflow_parallel::Communicator;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// Questions that one thread answers at least.
const GRAIN: usize = 64;
/// No element is known yet.
const UNKNOWN: u32 = u32::MAX;

/// A question to the rank that may hold a point.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Query {
    position: [f64; 3],
    /// Where the point was last, on the rank that is asked.
    shift: Shift,
    element: u32,
}

/// The flow at a place.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Flow {
    pub velocity: [f64; 3],
    /// Columns ∂u/∂x_j.
    pub gradient: [[f64; 3]; 3],
    /// Change of the velocity in the step.
    pub change: [f64; 3],
}

/// The answer: where the point is and the flow there.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Reply {
    flow: Flow,
    held: [f64; 3],
    reference: [f64; 3],
    /// Distance \[m\] from the element, 0 inside; infinite from a rank without elements.
    distance: f64,
    /// Index of the element in the whole mesh.
    global_element: u64,
    shift: Shift,
    element: u32,
    /// 1 when no other rank can know better.
    certain: u64,
}

/// The part of the mesh on this rank, and what `flow` says of a place in it.
pub(crate) struct Host<'a, F> {
    pub mesh: &'a LocalMesh,
    pub locator: &'a Locator,
    pub flow: F,
}

impl<F: Fn(&Location) -> Flow + Sync> Host<'_, F> {
    fn reply(&self, query: &Query) -> Reply {
        let position = query.position.into();
        let hint = (query.element != UNKNOWN).then_some((query.element, query.shift));
        let Some(location) = self.locator.find(&position, hint) else {
            // Any other rank is better.
            return Reply {
                distance: f64::INFINITY,
                global_element: u64::MAX,
                element: UNKNOWN,
                ..Reply::zeroed()
            };
        };
        Reply {
            flow: (self.flow)(&location),
            held: self.locator.held(&position, &location).into(),
            reference: location.reference,
            distance: location.distance,
            global_element: self.mesh.global_elements[location.element as usize],
            shift: location.shift,
            element: location.element,
            certain: location.certain.into(),
        }
    }

    /// As [`Host::reply`] where the host asks itself: into the places of the answer.
    #[inline(always)]
    fn reply_here(&self, point: &Vector3<f64>, place: &mut Placement, answer: Answer<'_>) {
        let hint = (place.element != UNKNOWN).then_some((place.element, place.shift));
        let Some(location) = self.locator.find(point, hint) else {
            place.distance = f64::INFINITY;
            place.certain = false;
            return;
        };
        *place = Placement {
            held: self.locator.held(point, &location),
            reference: location.reference,
            distance: location.distance,
            shift: location.shift,
            element: location.element,
            rank: place.rank,
            certain: location.certain,
        };
        answer.put(&(self.flow)(&location));
    }
}

/// Where answers go, one entry each for every point.
pub(crate) struct Answers<'a> {
    velocity: &'a mut [Vector3<f64>],
    gradient: &'a mut [Matrix3<f64>],
    change: &'a mut [Vector3<f64>],
}

/// Where one answer goes.
struct Answer<'a>(
    &'a mut Vector3<f64>,
    &'a mut Matrix3<f64>,
    &'a mut Vector3<f64>,
);

impl Answer<'_> {
    #[inline(always)]
    fn put(self, flow: &Flow) {
        *self.0 = flow.velocity.into();
        *self.1 = flow.gradient.into();
        *self.2 = flow.change.into();
    }
}

impl<'a> Answers<'a> {
    /// Room for `points` answers in `ambient`.
    pub fn within(ambient: &'a mut Ambient, points: usize) -> Self {
        ambient.velocity.resize(points, Vector3::zeros());
        ambient.gradient.resize(points, Matrix3::zeros());
        ambient.change.resize(points, Vector3::zeros());
        Self {
            velocity: &mut ambient.velocity,
            gradient: &mut ambient.gradient,
            change: &mut ambient.change,
        }
    }

    fn put(&mut self, k: u32, flow: &Flow) {
        let k = k as usize;
        Answer(
            &mut self.velocity[k],
            &mut self.gradient[k],
            &mut self.change[k],
        )
        .put(flow);
    }
}

/// Where a point is hosted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placement {
    /// The point or, out of the domain, the nearest place in it \[m\].
    pub held: Vector3<f64>,
    pub reference: [f64; 3],
    /// From the element \[m\], 0 inside.
    pub distance: f64,
    pub shift: Shift,
    pub element: u32,
    pub rank: u32,
    /// No other rank can know better.
    certain: bool,
}

impl Placement {
    fn keep(&mut self, rank: u32, reply: &Reply) {
        *self = Self {
            held: reply.held.into(),
            reference: reply.reference,
            distance: reply.distance,
            shift: reply.shift,
            element: reply.element,
            rank,
            certain: reply.certain == 1,
        };
    }
}

/// Which ranks hold which part of space, and where each point of this rank was last.
pub(crate) struct Rendezvous {
    communicator: Communicator,
    lattice: Lattice,
    /// Bounds of the elements that each rank owns.
    bounds: Vec<Bounds>,
    /// Distances closer than this are equal \[m\].
    quantum: f64,
    pub placements: Vec<Placement>,
}

impl Rendezvous {
    /// Collective: gathers the bounds of all ranks once.
    pub fn new(communicator: &Communicator, lattice: Lattice, owned: &Bounds, scale: f64) -> Self {
        let mine = [owned.low, owned.high].map(<[f64; 3]>::from);
        let bounds = communicator.all_gather(&mine).into_iter();
        Self {
            communicator: communicator.clone(),
            lattice,
            bounds: bounds
                .map(|corners| Bounds {
                    low: corners[0].into(),
                    high: corners[1].into(),
                })
                .collect(),
            quantum: 1e-9 * scale,
            placements: Vec::new(),
        }
    }

    /// Places every point and puts what the hosts say of it into `answers`. Collective; one round of messages when no
    /// point has left the elements of its host, two otherwise. Points that this rank hosts itself are in none.
    pub fn place<F: Fn(&Location) -> Flow + Sync>(
        &mut self,
        points: &[Vector3<f64>],
        host: &Host<'_, F>,
        mut answers: Answers<'_>,
    ) -> Result<(), CouplingError> {
        if self.placements.len() != points.len() {
            self.placements = points.iter().map(|p| self.first_guess(p)).collect();
        }
        // Not a number as soon as one is not finite.
        let zero: Vector3<f64> = points.iter().map(|p| 0.0 * p).sum();
        let finite = |p: &Vector3<f64>| p.iter().all(|x| x.is_finite());
        let bad = if finite(&zero) {
            None
        } else {
            points.iter().position(|p| !finite(p))
        };
        if bad.is_none() {
            self.answer_own(points, host, &mut answers);
        }
        if self.communicator.size() == 1 {
            return self.agree(points, bad, false).map(|_| ());
        }
        let own = self.communicator.rank() as u32;
        let mut asked: Vec<(u32, u32)> = Vec::new();
        if bad.is_none() {
            let hosts = self.placements.iter().map(|place| place.rank);
            asked.extend((0..).zip(hosts).filter(|&(_, rank)| rank != own));
        }
        for (&(k, rank), reply) in asked.iter().zip(self.ask(points, &asked, host)) {
            self.placements[k as usize].keep(rank, &reply);
            answers.put(k, &reply.flow);
        }
        let uncertain = |k: &u32| !self.placements[*k as usize].certain;
        let points_here = if bad.is_none() { points.len() } else { 0 };
        let open: Vec<u32> = (0..points_here as u32).filter(uncertain).collect();
        if self.agree(points, bad, !open.is_empty())? {
            self.ask_others(points, &open, host, &mut answers);
        }
        Ok(())
    }

    /// Points that this rank hosts itself: no message, and nothing on the way.
    fn answer_own<F: Fn(&Location) -> Flow + Sync>(
        &mut self,
        points: &[Vector3<f64>],
        host: &Host<'_, F>,
        answers: &mut Answers<'_>,
    ) {
        let own = self.communicator.rank() as u32;
        self.placements
            .par_chunks_mut(GRAIN)
            .zip(points.par_chunks(GRAIN))
            .zip(answers.velocity.par_chunks_mut(GRAIN))
            .zip(answers.gradient.par_chunks_mut(GRAIN))
            .zip(answers.change.par_chunks_mut(GRAIN))
            .for_each(|((((places, points), velocity), gradient), change)| {
                let places = places.iter_mut().zip(points);
                let answers = velocity.iter_mut().zip(gradient).zip(change);
                for ((place, point), ((u, g), c)) in places.zip(answers) {
                    if place.rank == own {
                        host.reply_here(point, place, Answer(u, g, c));
                    }
                }
            });
    }

    /// True when any rank has open points; an error on all ranks when any has a point that is not finite.
    fn agree(
        &self,
        points: &[Vector3<f64>],
        bad: Option<usize>,
        open: bool,
    ) -> Result<bool, CouplingError> {
        let mut flags = [
            f64::from(u8::from(bad.is_some())),
            f64::from(u8::from(open)),
        ];
        self.communicator.sum_slice(&mut flags);
        match bad {
            Some(point) => Err(CouplingError::NotFinite {
                point,
                rank: self.communicator.rank(),
                position: points[point].into(),
            }),
            None if flags[0] > 0.0 => Err(CouplingError::OtherRank),
            None => Ok(flags[1] > 0.0),
        }
    }

    /// Second round: all other ranks that may hold something nearer than what the host found, against its own word.
    fn ask_others<F: Fn(&Location) -> Flow + Sync>(
        &mut self,
        points: &[Vector3<f64>],
        open: &[u32],
        host: &Host<'_, F>,
        answers: &mut Answers<'_>,
    ) {
        let mut asked = Vec::new();
        for &k in open {
            let known = &self.placements[k as usize];
            asked.push((k, known.rank));
            let reach = known.distance + self.quantum;
            let near = (0..self.bounds.len() as u32)
                .filter(|&r| r != known.rank && self.distance(r, &points[k as usize]) <= reach);
            asked.extend(near.map(|r| (k, r)));
        }
        let replies = self.ask(points, &asked, host);
        let replies: Vec<_> = asked.iter().zip(&replies).collect();
        for of_point in replies.chunk_by(|a, b| a.0.0 == b.0.0) {
            let best = of_point.iter().min_by_key(|(_, reply)| self.key(reply));
            if let Some(&(&(k, rank), reply)) = best {
                self.placements[k as usize].keep(rank, reply);
                answers.put(k, &reply.flow);
            }
        }
    }

    /// Containing elements first, then nearer ones, then those listed earlier in the whole mesh.
    fn key(&self, reply: &Reply) -> (bool, u64, u64) {
        let steps = (reply.distance / self.quantum) as u64;
        (reply.distance > 0.0, steps, reply.global_element)
    }

    /// Sends (point, rank) questions and returns the answers in their order. This rank's own are not sent. Collective.
    fn ask<F: Fn(&Location) -> Flow + Sync>(
        &self,
        points: &[Vector3<f64>],
        asked: &[(u32, u32)],
        host: &Host<'_, F>,
    ) -> Vec<Reply> {
        let mut outgoing = vec![Vec::new(); self.communicator.size()];
        for &(k, rank) in asked {
            let known = &self.placements[k as usize];
            let same = known.rank == rank;
            outgoing[rank as usize].push(Query {
                position: points[k as usize].into(),
                shift: known.shift,
                element: if same { known.element } else { UNKNOWN },
            });
        }
        let answer = |queries: Vec<Query>| -> Vec<Reply> {
            let queries = queries.par_iter().with_min_len(GRAIN);
            queries.map(|query| host.reply(query)).collect()
        };
        let incoming = self.communicator.exchange(outgoing).into_iter();
        let answered = self.communicator.exchange(incoming.map(answer).collect());
        let mut answered: Vec<_> = answered.into_iter().map(Vec::into_iter).collect();
        let replies = asked
            .iter()
            .filter_map(|&(_, rank)| answered[rank as usize].next());
        replies.collect()
    }

    /// The rank whose bounds are nearest, then whose centre is.
    fn first_guess(&self, point: &Vector3<f64>) -> Placement {
        let key = |r: u32| {
            let x = self.lattice.image(point, self.lattice.wrap(point));
            let centre = (self.bounds[r as usize].centre() - x).norm();
            (self.distance(r, point), centre)
        };
        let nearer = |a: &(f64, f64), b: &(f64, f64)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1));
        let rank = (0..self.bounds.len() as u32).min_by(|&a, &b| nearer(&key(a), &key(b)));
        Placement {
            held: *point,
            reference: [0.0; 3],
            distance: 0.0,
            shift: [0; 3],
            element: UNKNOWN,
            rank: rank.unwrap_or(0),
            certain: false,
        }
    }

    /// Distance of a point, or the nearest of its images, to the bounds of a rank.
    fn distance(&self, rank: u32, point: &Vector3<f64>) -> f64 {
        let bounds = &self.bounds[rank as usize];
        let images = self.lattice.images(point);
        images
            .map(|shift| bounds.distance(&self.lattice.image(point, shift)))
            .fold(f64::INFINITY, f64::min)
    }
}
