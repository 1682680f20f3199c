//! How the flow gives way to the forces of the points.

use crate::fetch::BLOCK;
use crate::rendezvous::Placement;
use crate::{Coupling, CouplingError};
use bytemuck::{Pod, Zeroable};
use fibreflow_fibre::{Ambient, Reaction};
use fibreflow_mesh::jet::{Lanes, Moments, Polynomial};
use nalgebra::Vector3;

/// A place in an element of the rank that is asked.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Share {
    reference: [f64; 3],
    element: u64,
}

impl Coupling {
    /// Σ_i w_i Σ_q w_qi / V_i at the points of the last sample \[1/m³\], over the nodes that are free to move: by it, a
    /// density and a time the velocity at a point changes when every point pushes with the same force. Collective.
    ///
    /// # Errors
    /// As [`Coupling::sample`].
    pub fn response(&mut self, points: &[Vector3<f64>]) -> Result<Vec<f64>, CouplingError> {
        if self.gaussian.is_none() && self.points() == points.len() {
            return Ok(self.response_in_elements());
        }
        let unit = Reaction {
            force: vec![Vector3::x(); points.len()],
            torque: vec![Vector3::zeros(); points.len()],
        };
        let mut density = vec![[0.0; 4]; self.mesh.total()];
        self.spread(&unit, &mut density)?;
        for (density, &held) in density.iter_mut().zip(&self.no_slip) {
            if held {
                *density = [0.0; 4];
            }
        }
        self.mesh.halo.update(&mut density);
        let mut ambient = Ambient::default();
        self.sample(&density, points, &mut ambient)?;
        Ok(ambient.velocity.iter().map(|u| u.x).collect())
    }

    /// By shape functions alone, where the points were found last.
    fn response_in_elements(&self) -> Vec<f64> {
        let communicator = self.communicator();
        let own = communicator.rank() as u32;
        let places = &self.rendezvous.placements;
        let mut outgoing = vec![Vec::new(); communicator.size()];
        for place in places.iter().filter(|place| place.rank != own) {
            outgoing[place.rank as usize].push(Share {
                reference: place.reference,
                element: place.element.into(),
            });
        }
        let incoming = communicator.exchange(outgoing);
        let mut density = vec![[0.0]; self.mesh.total()];
        for (block, next) in ahead(places) {
            for place in next {
                self.locator.fetch(place.element, false);
            }
            for place in block {
                self.locator.fetch_nodes(place.element, &density);
            }
            for run in block.chunk_by(|a, b| (a.element, a.rank) == (b.element, b.rank)) {
                if run[0].rank == own {
                    let references = run.iter().map(|place| place.reference);
                    self.push_ones(run[0].element as usize, references, &mut density);
                }
            }
        }
        for shares in &incoming {
            for run in shares.chunk_by(|a, b| a.element == b.element) {
                let references = run.iter().map(|share| share.reference);
                self.push_ones(run[0].element as usize, references, &mut density);
            }
        }
        self.mesh.halo.accumulate(&mut density);
        let nodes = density.iter_mut().zip(&self.geometry.volumes);
        for (([density], volume), &held) in nodes.zip(&self.no_slip) {
            *density = if held { 0.0 } else { *density / volume };
        }
        self.mesh.halo.update(&mut density);
        let mut cell = (usize::MAX, Polynomial::default());
        let mut at = |element: usize, reference: [f64; 3]| -> f64 {
            if cell.0 != element {
                let nodes = self.locator.nodes(element);
                let value = |v: usize| [density[nodes[v] as usize][0], 0.0, 0.0, 0.0].into();
                cell = (element, Polynomial::new(self.locator.kind(element), value));
            }
            first(cell.1.value(reference))
        };
        let mut answer = |shares: &Vec<Share>| {
            let each = shares.iter();
            each.map(|share| at(share.element as usize, share.reference))
                .collect::<Vec<f64>>()
        };
        let answered = communicator.exchange(incoming.iter().map(&mut answer).collect());
        let mut answered: Vec<_> = answered.into_iter().map(Vec::into_iter).collect();
        // Both points of a pair push there.
        let sharing = if self.paired { 2 } else { 1 };
        let mut response = Vec::with_capacity(sharing * places.len());
        for (block, next) in ahead(places) {
            for place in next {
                self.locator.fetch(place.element, false);
            }
            for place in block {
                self.locator.fetch_nodes(place.element, &density);
            }
            for place in block {
                let one = if place.rank == own {
                    at(place.element as usize, place.reference)
                } else {
                    answered[place.rank as usize].next().unwrap_or_default()
                };
                response.extend(std::iter::repeat_n(sharing as f64 * one, sharing));
            }
        }
        response
    }

    /// Adds Σ N_i over points in an element to its nodes.
    #[inline(always)]
    fn push_ones(
        &self,
        element: usize,
        references: impl Iterator<Item = [f64; 3]>,
        density: &mut [[f64; 1]],
    ) {
        let kind = self.locator.kind(element);
        let one = Lanes::from([1.0, 0.0, 0.0, 0.0]);
        let mut moments = Moments::new(kind);
        moments.add_all(references.map(|r| (one, [Lanes::ZERO; 3], r)));
        let nodes = &self.locator.nodes(element)[..kind.vertices()];
        for (&node, n) in nodes.iter().zip(moments.vertices()) {
            density[node as usize][0] += first(n);
        }
    }
}

fn first(lanes: Lanes) -> f64 {
    lanes.to_array()[0]
}

/// Blocks of places, each with the next, whose elements are asked for meanwhile.
fn ahead(places: &[Placement]) -> impl Iterator<Item = (&[Placement], &[Placement])> {
    let next = places.chunks(BLOCK).skip(1).chain(std::iter::once(&[][..]));
    places.chunks(BLOCK).zip(next)
}
