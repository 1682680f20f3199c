//! Brings points that any rank owns to the ranks that own the elements around them, and answers back.

use crate::CouplingError;
use crate::boxes::Bounds;
use crate::element::Cell;
use crate::fetch::{BLOCK, runs};
use crate::lattice::{Lattice, Shift};
use crate::locate::{Bent, Hint, Location, Locator, Near};
use crate::pairs::Places;
use bytemuck::{Pod, Zeroable};
use fibreflow_fibre::Ambient;
use fibreflow_mesh::LocalMesh;
use fibreflow_mesh::jet::Lanes;
use fibreflow_parallel::Communicator;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use std::ops::Range;

/// Points whose elements are fetched together; questions that one thread answers at least.
const GRAIN: usize = BLOCK;
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

/// The flow at a place, in three of four lanes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Flow {
    pub velocity: Lanes,
    /// Columns ∂u/∂x_j.
    pub gradient: [Lanes; 3],
    /// Change of the velocity in the step.
    pub change: Lanes,
}

impl Flow {
    /// Three lanes of each.
    fn packed(&self) -> [[f64; 3]; 5] {
        let [x, y, z] = self.gradient;
        [self.velocity, x, y, z, self.change].map(|v| vector(v).into())
    }

    /// The inverse of [`Flow::packed`].
    fn unpacked(packed: [[f64; 3]; 5]) -> Self {
        let [velocity, x, y, z, change] = packed.map(|[a, b, c]| [a, b, c, 0.0].into());
        Self {
            velocity,
            gradient: [x, y, z],
            change,
        }
    }
}

#[inline(always)]
pub(crate) fn vector(lanes: Lanes) -> Vector3<f64> {
    let [x, y, z, _] = lanes.to_array();
    Vector3::new(x, y, z)
}

/// The answer: where the point is and the flow there.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Reply {
    flow: [[f64; 3]; 5],
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

/// What is kept from point to point, as the next one is most often in the same element.
#[derive(Default)]
pub(crate) struct Kept {
    pub bent: Bent,
    pub cell: Cell,
}

/// What a rank knows of the flow in its elements.
pub(crate) trait Source: Sync {
    fn flow(&self, near: &Near<'_>, reference: [f64; 3], kept: &mut Kept) -> Flow;

    /// Lets what is known in an element come near.
    fn fetch(&self, element: u32);
}

/// The part of the mesh on this rank, and what is known of the flow there.
pub(crate) struct Host<'a, S> {
    pub mesh: &'a LocalMesh,
    pub locator: &'a Locator,
    pub source: S,
}

impl<S: Source> Host<'_, S> {
    fn reply(&self, query: &Query, kept: &mut Kept) -> Reply {
        let position = query.position.into();
        let hint = (query.element != UNKNOWN).then_some((query.element, query.shift));
        let Some(location) = self.locator.find(&position, hint, &mut kept.bent) else {
            // Any other rank is better.
            return Reply {
                distance: f64::INFINITY,
                global_element: u64::MAX,
                element: UNKNOWN,
                ..Reply::zeroed()
            };
        };
        let near = self.locator.near((location.element, location.shift));
        let flow = near.map(|near| self.source.flow(&near, location.reference, kept));
        Reply {
            flow: flow.unwrap_or_default().packed(),
            held: self.locator.held(&position, &location).into(),
            reference: location.reference,
            distance: location.distance,
            global_element: self.mesh.global_elements[location.element as usize],
            shift: location.shift,
            element: location.element,
            certain: location.certain.into(),
        }
    }

    /// As [`Host::reply`] where the host `own` asks itself, into the places of the answers; a point that is not finite
    /// instead.
    fn reply_here(&self, part: &mut Part<'_>, own: u32) -> Option<usize> {
        let mut kept = Kept::default();
        let mut near: Option<Near<'_>> = None;
        let mut before: Hint = (UNKNOWN, [0; 3]);
        runs_of(part, 0..GRAIN).for_each(|e| self.locator.fetch(e, true));
        for start in (0..part.places.len()).step_by(GRAIN) {
            let block = start..part.places.len().min(start + GRAIN);
            // Of this block elements are there by now, and say which nodes they have.
            runs_of(part, block.end..block.end + GRAIN).for_each(|e| self.locator.fetch(e, true));
            runs_of(part, block.clone()).for_each(|e| self.source.fetch(e));
            for k in block {
                let point = &part.places.at(k);
                let finite = || point.iter().all(|x| x.is_finite());
                if part.answers.hosts[k].rank != own {
                    if finite() {
                        continue;
                    }
                    return Some(part.first + k);
                }
                let mut alone = |near: &Near<'_>| near.alone(point, &mut kept.bent);
                let host = &part.answers.hosts[k];
                let last = (host.element, host.shift);
                // Places that were in one element are in one again, most often; others where they were.
                let together = last == before;
                before = last;
                let mut reference = None;
                if together {
                    reference = near.as_ref().and_then(&mut alone);
                }
                let tried = |near: &Near<'_>| together && (near.element, near.shift) == last;
                if reference.is_none() && !near.as_ref().is_some_and(tried) {
                    let own = self.locator.near(last);
                    reference = own.as_ref().and_then(&mut alone);
                    if reference.is_some() {
                        near = own;
                    } else if !together {
                        reference = near.as_ref().and_then(&mut alone);
                    }
                }
                match (&near, reference) {
                    (Some(near), Some(reference)) => {
                        part.answers.keep_alone(k, own, near, reference, point);
                    }
                    // It is in no element.
                    _ if !finite() => return Some(part.first + k),
                    _ => {
                        let found = self.seek(part, k, own, &mut kept.bent);
                        reference = found.as_ref().map(|found| found.1);
                        near = found.map(|found| found.0);
                    }
                }
                if let (Some(near), Some(reference)) = (&near, reference) {
                    let flow = self.source.flow(near, reference, &mut kept);
                    part.answers.put(k, flow, part.places.arm(k));
                }
            }
        }
        None
    }

    /// From where a point was last: where it is now.
    #[inline(never)]
    fn seek(
        &self,
        part: &mut Part<'_>,
        k: usize,
        own: u32,
        bent: &mut Bent,
    ) -> Option<(Near<'_>, [f64; 3])> {
        let (point, place) = (&part.places.at(k), &part.answers.hosts[k]);
        let last = (place.element != UNKNOWN).then_some((place.element, place.shift));
        let Some(location) = self.locator.find(point, last, bent) else {
            part.answers.nowhere(k);
            return None;
        };
        let held = self.locator.held(point, &location);
        part.answers.keep(k, own, &location, held);
        let near = self.locator.near((location.element, location.shift))?;
        Some((near, location.reference))
    }
}

/// Elements where points were last, each once for several in a row.
fn runs_of(part: &Part<'_>, range: Range<usize>) -> impl Iterator<Item = u32> {
    let count = part.answers.hosts.len();
    let hosts = &part.answers.hosts[range.start.min(count)..range.end.min(count)];
    runs(hosts.iter().map(|place| place.element))
}

/// Where places are and what the flow is there: one entry each or, of velocities, two for pairs of points.
struct Answers<'a> {
    hosts: &'a mut [Placement],
    /// From the middle of a pair to its second point \[m\]; empty where every point is asked for by itself.
    arms: &'a mut [Vector3<f64>],
    held: &'a mut [Vector3<f64>],
    distances: &'a mut [f64],
    velocity: &'a mut [Vector3<f64>],
    gradient: &'a mut [Matrix3<f64>],
    change: &'a mut [Vector3<f64>],
    travel: &'a mut [Vector3<f64>],
    /// Velocities of the points \[m/s\], which meet the flow on their way; empty where it is asked for as it is.
    speeds: &'a [Vector3<f64>],
    /// Step \[s\].
    dt: f64,
}

impl Answers<'_> {
    #[inline(always)]
    fn put(&mut self, k: usize, flow: Flow, arm: Option<Vector3<f64>>) {
        self.gradient[k] = Matrix3::from_columns(&flow.gradient.map(vector));
        let Some(arm) = arm else {
            return self.put_at(k, flow);
        };
        self.arms[k] = arm;
        let [x, y, z] = flow.gradient;
        let away = x * arm.x + y * arm.y + z * arm.z;
        for (point, side) in [(2 * k, -away), (2 * k + 1, away)] {
            let velocity = flow.velocity + side;
            self.put_at(point, Flow { velocity, ..flow });
        }
    }

    #[inline(always)]
    fn put_at(&mut self, k: usize, flow: Flow) {
        let Flow {
            mut velocity,
            gradient,
            mut change,
        } = flow;
        if let Some(speed) = self.speeds.get(k) {
            let met = Ambient::met(velocity, gradient, change, speed, self.dt);
            [velocity, change, _] = met;
            if let Some(travel) = self.travel.get_mut(k) {
                *travel = vector(met[2]);
            }
        }
        self.velocity[k] = vector(velocity);
        self.change[k] = vector(change);
    }

    /// Of a point that is in one element alone.
    #[inline(always)]
    fn keep_alone(
        &mut self,
        k: usize,
        own: u32,
        near: &Near<'_>,
        reference: [f64; 3],
        point: &Vector3<f64>,
    ) {
        let place = &mut self.hosts[k];
        place.reference = reference;
        place.shift = near.shift;
        place.element = near.element;
        place.rank = own;
        (place.certain, place.outside) = (true, false);
        self.held[k] = *point;
    }

    fn keep(&mut self, k: usize, rank: u32, location: &Location, held: Vector3<f64>) {
        let outside = location.distance != 0.0;
        self.hosts[k] = Placement {
            reference: location.reference,
            shift: location.shift,
            element: location.element,
            rank,
            certain: location.certain,
            outside,
        };
        self.held[k] = held;
        if outside {
            self.distances[k] = location.distance;
        }
    }

    fn keep_reply(&mut self, k: usize, rank: u32, reply: &Reply, arm: Option<Vector3<f64>>) {
        let location = Location {
            element: reply.element,
            shift: reply.shift,
            reference: reply.reference,
            distance: reply.distance,
            certain: reply.certain == 1,
        };
        self.keep(k, rank, &location, reply.held.into());
        self.put(k, Flow::unpacked(reply.flow), arm);
    }

    /// This rank has no elements.
    fn nowhere(&mut self, k: usize) {
        self.distances[k] = f64::INFINITY;
        self.hosts[k].outside = true;
        self.hosts[k].certain = false;
    }

    fn split(self, at: usize) -> (Self, Self) {
        let hosts = self.hosts.split_at_mut(at);
        let held = self.held.split_at_mut(at);
        let distances = self.distances.split_at_mut(at);
        let sharing = if self.arms.is_empty() { 1 } else { 2 };
        let arms = self.arms.split_at_mut(at.min(self.arms.len()));
        let gradient = self.gradient.split_at_mut(at);
        let at = at * sharing;
        let velocity = self.velocity.split_at_mut(at);
        let change = self.change.split_at_mut(at);
        let travel = self.travel.split_at_mut(at.min(self.travel.len()));
        let speeds = self.speeds.split_at(at.min(self.speeds.len()));
        let first = Self {
            hosts: hosts.0,
            arms: arms.0,
            held: held.0,
            distances: distances.0,
            velocity: velocity.0,
            gradient: gradient.0,
            change: change.0,
            travel: travel.0,
            speeds: speeds.0,
            dt: self.dt,
        };
        let second = Self {
            hosts: hosts.1,
            arms: arms.1,
            held: held.1,
            distances: distances.1,
            velocity: velocity.1,
            gradient: gradient.1,
            change: change.1,
            travel: travel.1,
            speeds: speeds.1,
            dt: self.dt,
        };
        (first, second)
    }
}

/// Places in a row and their answers.
struct Part<'a> {
    /// Number of the first among all.
    first: usize,
    places: Places<'a>,
    answers: Answers<'a>,
}

impl Part<'_> {
    /// In the middle, unless it is short.
    fn split(self) -> (Self, Option<Self>) {
        if self.places.len() <= GRAIN {
            return (self, None);
        }
        let at = (self.places.len() / 2).next_multiple_of(GRAIN);
        let (places, others) = self.places.split_at(at);
        let (answers, theirs) = self.answers.split(at);
        let part = |first, places, answers| Self {
            first,
            places,
            answers,
        };
        let second = part(self.first + at, others, theirs);
        (part(self.first, places, answers), Some(second))
    }
}

/// Where a point is hosted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placement {
    pub reference: [f64; 3],
    pub shift: Shift,
    pub element: u32,
    pub rank: u32,
    /// No other rank can know better.
    certain: bool,
    /// The point is in no element, and held at the nearest place of one.
    pub outside: bool,
}

/// How points move through the flow that they are asked for.
#[derive(Clone, Copy)]
pub(crate) struct Motion<'a> {
    /// Velocities of the points, of both where they are in pairs \[m/s\].
    pub speeds: &'a [Vector3<f64>],
    /// Step \[s\].
    pub dt: f64,
    /// What comes from their way is asked for by itself.
    pub travels: bool,
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
    /// The points or, out of the domain, the nearest places in it \[m\].
    pub held: Vec<Vector3<f64>>,
    /// From the middle of a pair to its second point \[m\]; empty without pairs.
    pub arms: Vec<Vector3<f64>>,
    /// From their elements \[m\], of those outside.
    distances: Vec<f64>,
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
            held: Vec::new(),
            arms: Vec::new(),
            distances: Vec::new(),
        }
    }

    /// Distance of a point from its element \[m\], 0 inside.
    pub fn distance(&self, point: usize) -> f64 {
        if self.placements[point].outside {
            self.distances[point]
        } else {
            0.0
        }
    }

    /// Finds every place and puts what the hosts say of it, or what a point meets in its `motion`, into `ambient`; of pairs what both
    /// of them meet. Collective; one round of messages when no place has left the elements of its host, two otherwise.
    /// Places that this rank hosts itself are in none.
    pub fn place<S: Source>(
        &mut self,
        places: &Places<'_>,
        motion: Option<Motion<'_>>,
        host: &Host<'_, S>,
        ambient: &mut Ambient,
    ) -> Result<(), CouplingError> {
        if self.placements.len() != places.len() {
            let all = (0..places.len()).map(|k| self.first_guess(&places.at(k)));
            self.placements = all.collect();
        }
        self.held.resize(places.len(), Vector3::zeros());
        self.distances.resize(places.len(), 0.0);
        let pairs = if places.paired() { places.len() } else { 0 };
        self.arms.resize(pairs, Vector3::zeros());
        let count = places.points();
        ambient.velocity.resize(count, Vector3::zeros());
        ambient.gradient.resize(places.len(), Matrix3::zeros());
        ambient.paired = places.paired();
        ambient.change.resize(count, Vector3::zeros());
        let travels = motion.is_some_and(|motion| motion.travels);
        let travelling = if travels { count } else { 0 };
        ambient.travel.resize(travelling, Vector3::zeros());
        let own = self.communicator.rank() as u32;
        // Points that this rank hosts itself: no message, and nothing on the way.
        let all = Part {
            first: 0,
            places: *places,
            answers: self.answers(motion, ambient),
        };
        let bad = rayon::iter::split(all, Part::split)
            .filter_map(|mut part| host.reply_here(&mut part, own))
            .min();
        if self.communicator.size() == 1 {
            return self.agree(places, bad, false).map(|_| ());
        }
        let mut asked: Vec<(u32, u32)> = Vec::new();
        if bad.is_none() {
            let hosts = self.placements.iter().map(|place| place.rank);
            asked.extend((0..).zip(hosts).filter(|&(_, rank)| rank != own));
        }
        let replies = self.ask(places, &asked, host);
        let mut answers = self.answers(motion, ambient);
        for (&(k, rank), reply) in asked.iter().zip(&replies) {
            answers.keep_reply(k as usize, rank, reply, places.arm(k as usize));
        }
        let uncertain = |k: &u32| !self.placements[*k as usize].certain;
        let places_here = if bad.is_none() { places.len() } else { 0 };
        let open: Vec<u32> = (0..places_here as u32).filter(uncertain).collect();
        if self.agree(places, bad, !open.is_empty())? {
            self.ask_others(places, &open, motion, host, ambient);
        }
        Ok(())
    }

    fn answers<'a>(
        &'a mut self,
        motion: Option<Motion<'a>>,
        ambient: &'a mut Ambient,
    ) -> Answers<'a> {
        let motion = motion.unwrap_or(Motion {
            speeds: &[],
            dt: 0.0,
            travels: false,
        });
        Answers {
            hosts: &mut self.placements,
            arms: &mut self.arms,
            held: &mut self.held,
            distances: &mut self.distances,
            velocity: &mut ambient.velocity,
            gradient: &mut ambient.gradient,
            change: &mut ambient.change,
            travel: &mut ambient.travel,
            speeds: motion.speeds,
            dt: motion.dt,
        }
    }

    /// True when any rank has open places; an error on all ranks when any has one that is not finite.
    fn agree(
        &self,
        places: &Places<'_>,
        bad: Option<usize>,
        open: bool,
    ) -> Result<bool, CouplingError> {
        let mut flags = [
            f64::from(u8::from(bad.is_some())),
            f64::from(u8::from(open)),
        ];
        self.communicator.sum_slice(&mut flags);
        match bad {
            Some(k) => Err(CouplingError::NotFinite {
                point: places.first(k),
                rank: self.communicator.rank(),
                position: places.at(k).into(),
            }),
            None if flags[0] > 0.0 => Err(CouplingError::OtherRank),
            None => Ok(flags[1] > 0.0),
        }
    }

    /// Second round: all other ranks that may hold something nearer than what the host found, against its own word.
    fn ask_others<S: Source>(
        &mut self,
        places: &Places<'_>,
        open: &[u32],
        motion: Option<Motion<'_>>,
        host: &Host<'_, S>,
        ambient: &mut Ambient,
    ) {
        let mut asked = Vec::new();
        for &k in open {
            let known = self.placements[k as usize].rank;
            asked.push((k, known));
            let reach = self.distance(k as usize) + self.quantum;
            let near = (0..self.bounds.len() as u32)
                .filter(|&r| r != known && self.outside_of(r, &places.at(k as usize)) <= reach);
            asked.extend(near.map(|r| (k, r)));
        }
        let replies = self.ask(places, &asked, host);
        let replies: Vec<_> = asked.iter().zip(&replies).collect();
        for of_point in replies.chunk_by(|a, b| a.0.0 == b.0.0) {
            let best = of_point.iter().min_by_key(|(_, reply)| self.key(reply));
            if let Some(&(&(k, rank), reply)) = best {
                let arm = places.arm(k as usize);
                self.answers(motion, ambient)
                    .keep_reply(k as usize, rank, reply, arm);
            }
        }
    }

    /// Containing elements first, then nearer ones, then those listed earlier in the whole mesh.
    fn key(&self, reply: &Reply) -> (bool, u64, u64) {
        let steps = (reply.distance / self.quantum) as u64;
        (reply.distance > 0.0, steps, reply.global_element)
    }

    /// Sends (point, rank) questions and returns the answers in their order. This rank's own are not sent. Collective.
    fn ask<S: Source>(
        &self,
        places: &Places<'_>,
        asked: &[(u32, u32)],
        host: &Host<'_, S>,
    ) -> Vec<Reply> {
        let mut outgoing = vec![Vec::new(); self.communicator.size()];
        for &(k, rank) in asked {
            let known = &self.placements[k as usize];
            let same = known.rank == rank;
            outgoing[rank as usize].push(Query {
                position: places.at(k as usize).into(),
                shift: known.shift,
                element: if same { known.element } else { UNKNOWN },
            });
        }
        let answer = |queries: Vec<Query>| -> Vec<Reply> {
            let queries = queries.par_iter().with_min_len(GRAIN);
            (queries.map_init(Kept::default, |kept, query| host.reply(query, kept))).collect()
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
            (self.outside_of(r, point), centre)
        };
        let nearer = |a: &(f64, f64), b: &(f64, f64)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1));
        let rank = (0..self.bounds.len() as u32).min_by(|&a, &b| nearer(&key(a), &key(b)));
        Placement {
            reference: [0.0; 3],
            shift: [0; 3],
            element: UNKNOWN,
            rank: rank.unwrap_or(0),
            certain: false,
            outside: false,
        }
    }

    /// Distance of a point, or the nearest of its images, to the bounds of a rank.
    fn outside_of(&self, rank: u32, point: &Vector3<f64>) -> f64 {
        let bounds = &self.bounds[rank as usize];
        let images = self.lattice.images(point);
        images
            .map(|shift| bounds.distance(&self.lattice.image(point, shift)))
            .fold(f64::INFINITY, f64::min)
    }
}
