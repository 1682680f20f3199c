//! How the flow gives way to the forces of the points.

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
        let here = places.iter().filter(|place| place.rank == own);
        let here = here.map(|place| (place.element as usize, place.reference));
        let sent = incoming.iter().flatten();
        let sent = sent.map(|share| (share.element as usize, share.reference));
        // Points in the same element, one after the other, go to its nodes together.
        let mut sums: Option<(usize, Moments)> = None;
        let first = |lanes: Lanes| lanes.to_array()[0];
        let one = Lanes::from([1.0, 0.0, 0.0, 0.0]);
        let mut add = |(element, sums): (usize, Moments)| {
            let nodes = self.mesh.elements.nodes(element).iter();
            let shares = nodes.zip(sums.vertices());
            shares.for_each(|(&i, n)| density[i as usize][0] += first(n));
        };
        for (element, reference) in here.chain(sent) {
            if sums.as_ref().is_none_or(|sums| sums.0 != element) {
                let next = (element, Moments::new(self.locator.kind(element)));
                sums.replace(next).into_iter().for_each(&mut add);
            }
            if let Some((_, sums)) = &mut sums {
                sums.add(one, [Lanes::ZERO; 3], reference);
            }
        }
        sums.into_iter().for_each(add);
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
        let response = places.iter().map(|place| {
            if place.rank == own {
                at(place.element as usize, place.reference)
            } else {
                answered[place.rank as usize].next().unwrap_or_default()
            }
        });
        if self.pairs.is_none() {
            return response.collect();
        }
        // Both points push there.
        response.flat_map(|response| [2.0 * response; 2]).collect()
    }
}
