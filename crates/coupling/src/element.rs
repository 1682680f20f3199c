//! The kernel of one element: its shape functions (K 3.63–3.66).

use crate::Coupling;
use crate::CouplingError;
use crate::coupling::Fields;
use crate::locate::{Location, Locator};
use crate::rendezvous::{Query, Reply, UNKNOWN};
use crate::spread::Sums;
use bytemuck::{Pod, Zeroable};
use fibreflow_fibre::{Ambient, Reaction};
use fibreflow_mesh::LocalMesh;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// A force and a torque on their way to the rank that owns the element.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Load {
    force: [f64; 3],
    torque: [f64; 3],
    reference: [f64; 3],
    shift: [i32; 3],
    element: u32,
}

/// A load turned into nodal forces.
struct Nodal {
    element: u32,
    force: [Vector3<f64>; 8],
    /// Σ x_i × f_i about the origin, in the frame of the point.
    torque: Vector3<f64>,
    /// How far that is from x × F + T.
    torque_defect: Vector3<f64>,
}

impl Coupling {
    /// u = Σ N_i u_i, ∂u_a/∂x_b = Σ u_i,a ∂N_i/∂x_b in the element around each point.
    pub(crate) fn sample_elements(
        &mut self,
        fields: &Fields<'_>,
        points: &[Vector3<f64>],
        ambient: &mut Ambient,
    ) -> Result<(), CouplingError> {
        let (mesh, locator) = (&self.mesh, &self.locator);
        let answer = |query: &Query| {
            let hint = (query.element != UNKNOWN).then_some((query.element, query.shift));
            match locator.find(&query.position.into(), hint) {
                Some(location) => interpolate(mesh, locator, fields, &location),
                None => Reply::nothing(),
            }
        };
        for reply in &self.rendezvous.place(points, answer)? {
            ambient.velocity.push(reply.value.into());
            let g = &reply.gradient;
            ambient.gradient.push(Matrix3::from_fn(|i, j| g[i][j]));
            if fields.change.is_some() {
                ambient.change.push(reply.change.into());
            }
        }
        Ok(())
    }

    /// f_i = N_i F + ½ T × ∇N_i at the nodes of the element where each point was sampled, into `nodal`.
    pub(crate) fn spread_elements(&mut self, reaction: &Reaction, sums: &mut Sums) {
        let communicator = self.communicator().clone();
        let mut outgoing = vec![Vec::new(); communicator.size()];
        for (k, place) in self.rendezvous.placements.iter().enumerate() {
            outgoing[place.rank as usize].push(Load {
                force: reaction.force[k].into(),
                torque: reaction.torque[k].into(),
                reference: place.reference,
                shift: place.shift,
                element: place.element,
            });
        }
        for loads in communicator.exchange(outgoing) {
            let nodal: Vec<Nodal> = loads
                .par_iter()
                .with_min_len(64)
                .map(|load| nodal(&self.locator, &self.mesh, load))
                .collect();
            for one in &nodal {
                let nodes = self.mesh.elements.nodes(one.element as usize);
                for (&node, force) in nodes.iter().zip(&one.force) {
                    let target = &mut self.nodal[node as usize];
                    (0..3).for_each(|c| target[c] += force[c]);
                }
                sums.torque += one.torque;
                sums.torque_defect += one.torque_defect;
            }
        }
        self.mesh.halo.accumulate(&mut self.nodal);
    }
}

fn interpolate(
    mesh: &LocalMesh,
    locator: &Locator,
    fields: &Fields<'_>,
    location: &Location,
) -> Reply {
    let element = location.element as usize;
    let weights = locator.weights(element, location.reference);
    // Four lanes of which the last is not used.
    let (mut value, mut change, mut along) = ([0.0; 4], [0.0; 4], [[0.0; 4]; 3]);
    let nodes = mesh.elements.nodes(element);
    for (v, &node) in nodes.iter().enumerate() {
        let (n, gradient) = (weights.n[v], &weights.gradient[v]);
        let nodal = &fields.velocity[node as usize];
        for l in 0..4 {
            value[l] += n * nodal[l];
            along[0][l] += gradient[0] * nodal[l];
            along[1][l] += gradient[1] * nodal[l];
            along[2][l] += gradient[2] * nodal[l];
        }
    }
    if let Some(changes) = fields.change {
        for (v, &node) in nodes.iter().enumerate() {
            let nodal = &changes[node as usize];
            (0..4).for_each(|l| change[l] += weights.n[v] * nodal[l]);
        }
    }
    let three = |x: &[f64; 4]| [x[0], x[1], x[2]];
    Reply {
        value: three(&value),
        gradient: std::array::from_fn(|i| along.map(|column| column[i])),
        change: three(&change),
        ..Reply::at(mesh, location)
    }
}

fn nodal(locator: &Locator, mesh: &LocalMesh, load: &Load) -> Nodal {
    let element = load.element as usize;
    let kind = mesh.elements.kinds[element];
    let coordinates = locator.coordinates(element);
    let weights = locator.weights(element, load.reference);
    let (force, torque) = (Vector3::from(load.force), Vector3::from(load.torque));
    let back = load.shift.map(|s| -s);
    let mut nodal = [Vector3::zeros(); 8];
    let mut total = Vector3::zeros();
    let mut position = Vector3::zeros();
    for v in 0..kind.vertices() {
        let gradient = Vector3::from(weights.gradient[v]);
        nodal[v] = weights.n[v] * force + 0.5 * torque.cross(&gradient);
        total += nodal[v];
        position += weights.n[v] * Vector3::from(coordinates[v]);
    }
    let arms = coordinates.iter().zip(&nodal).take(kind.vertices());
    let moment: Vector3<f64> = arms
        .map(|(x, f)| (Vector3::from(*x) - position).cross(f))
        .sum();
    position = locator.lattice().image(&position, back);
    Nodal {
        element: load.element,
        force: nodal,
        torque: position.cross(&total) + moment,
        torque_defect: position.cross(&(total - force)) + moment - torque,
    }
}
