//! Brings points that any rank owns to the ranks that own the elements around them, and answers back.

use crate::CouplingError;
use crate::boxes::Bounds;
use crate::lattice::{Lattice, Shift};
use crate::locate::Location;
use bytemuck::{Pod, Zeroable};
use fibreflow_mesh::LocalMesh;
use fibreflow_parallel::Communicator;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Questions that one thread answers at least.
const GRAIN: usize = 64;
/// No element is known yet.
pub(crate) const UNKNOWN: u32 = u32::MAX;

/// A question to the rank that may hold a point.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Query {
    pub position: [f64; 3],
    /// Where the point was last, on the rank that is asked.
    pub shift: Shift,
    pub element: u32,
}

/// The answer: where the point is and the flow there.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Reply {
    /// Velocity, or the nearest place of the domain.
    pub value: [f64; 3],
    /// `gradient[i][j]` = ∂u_i/∂x_j.
    pub gradient: [[f64; 3]; 3],
    /// Change of the velocity in the step.
    pub change: [f64; 3],
    pub reference: [f64; 3],
    /// Distance \[m\] from the element, 0 inside; infinite from a rank without elements.
    pub distance: f64,
    /// Index of the element in the whole mesh.
    pub global_element: u64,
    pub shift: Shift,
    pub element: u32,
    /// 1 when no other rank can know better.
    pub certain: u64,
}

impl Reply {
    /// Where a point is, and no flow yet.
    pub fn at(mesh: &LocalMesh, location: &Location) -> Self {
        Self {
            reference: location.reference,
            distance: location.distance,
            global_element: mesh.global_elements[location.element as usize],
            shift: location.shift,
            element: location.element,
            certain: location.certain.into(),
            ..Self::zeroed()
        }
    }

    /// The answer of a rank without elements: any other is better.
    pub fn nothing() -> Self {
        Self {
            distance: f64::INFINITY,
            global_element: u64::MAX,
            element: UNKNOWN,
            ..Self::zeroed()
        }
    }
}

/// Where a point is hosted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placement {
    pub rank: u32,
    pub element: u32,
    pub shift: Shift,
    pub reference: [f64; 3],
    pub distance: f64,
}

impl Placement {
    fn keep(&mut self, rank: u32, reply: &Reply) {
        *self = Self {
            rank,
            element: reply.element,
            shift: reply.shift,
            reference: reply.reference,
            distance: reply.distance,
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

    /// Places every point and returns what the hosts answer. Collective; one round of messages when no point has left
    /// the elements of its host, two otherwise.
    pub fn place(
        &mut self,
        points: &[Vector3<f64>],
        answer: impl Fn(&Query) -> Reply + Sync,
    ) -> Result<Vec<Reply>, CouplingError> {
        if self.placements.len() != points.len() {
            self.placements = points.iter().map(|p| self.first_guess(p)).collect();
        }
        let bad = points.iter().position(|p| !p.iter().all(|x| x.is_finite()));
        let asked: Vec<(u32, u32)> = match bad {
            Some(_) => Vec::new(),
            None => (0..points.len() as u32)
                .map(|k| (k, self.placements[k as usize].rank))
                .collect(),
        };
        let mut replies = self.ask(points, &asked, &answer);
        let uncertain = |k: &u32| replies[*k as usize].certain == 0;
        let open: Vec<u32> = (0..replies.len() as u32).filter(uncertain).collect();
        let open_anywhere = self.agree(points, bad, !open.is_empty())?;
        for (place, reply) in self.placements.iter_mut().zip(&replies) {
            place.keep(place.rank, reply);
        }
        if open_anywhere && self.communicator.size() > 1 {
            self.ask_others(points, &open, &mut replies, &answer);
        }
        Ok(replies)
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

    /// Second round: all other ranks that may hold something nearer than what the host found.
    fn ask_others(
        &mut self,
        points: &[Vector3<f64>],
        open: &[u32],
        replies: &mut [Reply],
        answer: &(impl Fn(&Query) -> Reply + Sync),
    ) {
        let mut asked = Vec::new();
        for &k in open {
            let host = self.placements[k as usize].rank;
            let reach = replies[k as usize].distance + self.quantum;
            let near = (0..self.bounds.len() as u32)
                .filter(|&r| r != host && self.distance(r, &points[k as usize]) <= reach);
            asked.extend(near.map(|r| (k, r)));
        }
        let answers = self.ask(points, &asked, answer);
        for (&(k, rank), reply) in asked.iter().zip(answers) {
            let best = &mut replies[k as usize];
            if self.key(&reply) < self.key(best) {
                *best = reply;
                self.placements[k as usize].keep(rank, &reply);
            }
        }
    }

    /// Containing elements first, then nearer ones, then those listed earlier in the whole mesh.
    fn key(&self, reply: &Reply) -> (bool, u64, u64) {
        let steps = (reply.distance / self.quantum) as u64;
        (reply.distance > 0.0, steps, reply.global_element)
    }

    /// Sends (point, rank) questions and returns the answers in their order. This rank's own are not sent.
    fn ask(
        &self,
        points: &[Vector3<f64>],
        asked: &[(u32, u32)],
        answer: &(impl Fn(&Query) -> Reply + Sync),
    ) -> Vec<Reply> {
        let query = |k: u32, rank: u32| {
            let known = &self.placements[k as usize];
            let same = known.rank == rank;
            Query {
                position: points[k as usize].into(),
                shift: known.shift,
                element: if same { known.element } else { UNKNOWN },
            }
        };
        let own = self.communicator.rank() as u32;
        let mut replies = vec![Reply::zeroed(); asked.len()];
        let (slots, questions) = (replies.par_chunks_mut(GRAIN), asked.par_chunks(GRAIN));
        slots.zip(questions).for_each(|(slots, questions)| {
            for (slot, &(k, rank)) in slots.iter_mut().zip(questions) {
                if rank == own {
                    *slot = answer(&query(k, rank));
                }
            }
        });
        if self.communicator.size() == 1 {
            return replies;
        }
        let mut outgoing = vec![Vec::new(); self.communicator.size()];
        let others = || asked.iter().enumerate().filter(|(_, a)| a.1 != own);
        for (_, &(k, rank)) in others() {
            outgoing[rank as usize].push(query(k, rank));
        }
        let incoming = self.communicator.exchange(outgoing);
        let answers = incoming.into_iter();
        let answers = answers
            .map(|queries| queries.par_iter().with_min_len(GRAIN).map(answer).collect())
            .collect();
        let answered: Vec<Vec<Reply>> = self.communicator.exchange(answers);
        let mut next = vec![0; answered.len()];
        for (slot, &(_, rank)) in others() {
            let place = &mut next[rank as usize];
            replies[slot] = answered[rank as usize][*place];
            *place += 1;
        }
        replies
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
            rank: rank.unwrap_or(0),
            element: UNKNOWN,
            shift: [0; 3],
            reference: [0.0; 3],
            distance: 0.0,
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
