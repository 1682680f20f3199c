//! The kernel of one element: its shape functions (K 3.63–3.66).

use crate::Coupling;
use crate::CouplingError;
use crate::coupling::Fields;
use crate::lattice::Shift;
use crate::locate::{Location, Locator};
use crate::rendezvous::{Answers, Flow, Host};
use crate::spread::Sums;
use bytemuck::{Pod, Zeroable};
use fibreflow_fibre::{Ambient, Reaction};
use fibreflow_mesh::jet::{self, Lanes};
use fibreflow_mesh::{ElementKind, LocalMesh};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Loads that threads turn into nodal forces at a time, before these are added in order.
const BLOCK: usize = 1024;

/// Terms of a part of a long sum.
const PART: usize = 256;

/// A force and a torque on their way to the nodes of an element.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Load {
    force: [f64; 3],
    torque: [f64; 3],
    reference: [f64; 3],
    shift: Shift,
    element: u32,
}

impl Coupling {
    /// u = Σ N_i u_i, ∂u_a/∂x_b = Σ u_i,a ∂N_i/∂x_b in the element around each point.
    pub(crate) fn sample_elements(
        &mut self,
        fields: &Fields<'_>,
        points: &[Vector3<f64>],
        ambient: &mut Ambient,
    ) -> Result<(), CouplingError> {
        let (mesh, locator) = (&*self.mesh, &self.locator);
        let host = Host {
            mesh,
            locator,
            flow: |location: &Location| flow(mesh, locator, fields, location),
        };
        let answers = Answers::within(ambient, points.len());
        self.rendezvous.place(points, &host, answers)?;
        if fields.change.is_none() {
            ambient.change.clear();
        }
        Ok(())
    }

    /// f_i = N_i F + ½ T × ∇N_i at the nodes of the element where each point was sampled, into `nodal`.
    pub(crate) fn spread_elements(&mut self, reaction: &Reaction, sums: &mut Sums) {
        let communicator = self.mesh.halo.communicator();
        let own = communicator.rank() as u32;
        let places = &self.rendezvous.placements;
        let load = |k: usize| Load {
            force: reaction.force[k].into(),
            torque: reaction.torque[k].into(),
            reference: places[k].reference,
            shift: places[k].shift,
            element: places[k].element,
        };
        let loads = reaction.force.iter().zip(&reaction.torque);
        let moments = places.iter().zip(loads);
        let given =
            by_parts(moments.map(|(place, (force, torque))| place.held.cross(force) + torque));
        let mut target = Target {
            mesh: &self.mesh,
            locator: &self.locator,
            nodal: &mut self.nodal,
            beyond: Vector3::zeros(),
        };
        if communicator.size() == 1 {
            target.take(places.len(), load);
        } else {
            let mut outgoing = vec![Vec::new(); communicator.size()];
            let mut mine = Vec::with_capacity(places.len());
            for (k, place) in places.iter().enumerate() {
                if place.rank == own {
                    mine.push(k);
                } else {
                    outgoing[place.rank as usize].push(load(k));
                }
            }
            target.take(mine.len(), |k| load(mine[k]));
            for loads in communicator.exchange(outgoing) {
                target.take(loads.len(), |k| loads[k]);
            }
        }
        let beyond = target.beyond;
        let nodes = self.mesh.nodes.iter().zip(&self.nodal);
        let moment = |(x, force): (&[f64; 3], &Lanes)| {
            Vector3::from(*x).cross(&Vector3::new(force[0], force[1], force[2]))
        };
        let torque = beyond + by_parts(nodes.map(moment));
        sums.torque += torque;
        sums.torque_defect += torque - given;
        self.mesh.halo.accumulate(&mut self.nodal);
    }
}

/// Sum of sums over parts, so that round-off does not grow with the number of terms.
fn by_parts(mut terms: impl ExactSizeIterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let mut sum = Vector3::zeros();
    while terms.len() > 0 {
        sum += terms.by_ref().take(PART).sum::<Vector3<f64>>();
    }
    sum
}

/// The flow at a place of an element.
#[inline(always)]
fn flow(mesh: &LocalMesh, locator: &Locator, fields: &Fields<'_>, location: &Location) -> Flow {
    let element = location.element as usize;
    let rows = locator.inverse_jacobian(element, location.reference);
    let nodes = mesh.elements.nodes(element);
    match locator.kind(element) {
        ElementKind::Tetrahedron => {
            let kind = ElementKind::Tetrahedron;
            flow_of(kind, vertices::<4>(nodes), rows, fields, location)
        }
        ElementKind::Hexahedron => {
            let kind = ElementKind::Hexahedron;
            flow_of(kind, vertices::<8>(nodes), rows, fields, location)
        }
        kind => flow_of(kind, nodes, rows, fields, location),
    }
}

/// The nodes of an element whose number is known to the compiler.
#[inline(always)]
fn vertices<const N: usize>(nodes: &[u32]) -> &[u32; N] {
    nodes.first_chunk().expect("as many nodes as the kind has")
}

#[inline(always)]
fn flow_of<N: AsRef<[u32]> + ?Sized>(
    kind: ElementKind,
    nodes: &N,
    rows: [[f64; 3]; 3],
    fields: &Fields<'_>,
    location: &Location,
) -> Flow {
    let three = |x: Lanes| [x[0], x[1], x[2]];
    let nodes = nodes.as_ref();
    let jet = jet::jet(
        kind,
        |v| fields.velocity[nodes[v] as usize],
        location.reference,
    );
    let column = |c: usize| -> Lanes {
        std::array::from_fn(|l| {
            let [a, b, c] = [0, 1, 2].map(|k| (rows[k][c], jet.along[k][l]));
            c.0.mul_add(c.1, b.0.mul_add(b.1, a.0 * a.1))
        })
    };
    let change = fields.change.map_or([0.0; 4], |change| {
        jet::value(kind, |v| change[nodes[v] as usize], location.reference)
    });
    Flow {
        velocity: three(jet.value),
        gradient: [0, 1, 2].map(|c| three(column(c))),
        change: three(change),
    }
}

/// Nodes that take loads.
struct Target<'a> {
    mesh: &'a LocalMesh,
    locator: &'a Locator,
    nodal: &'a mut [Lanes],
    /// Torque for that nodes and points are other images than those at the coordinates of the nodes.
    beyond: Vector3<f64>,
}

impl Target<'_> {
    /// Adds loads in their order, whatever the number of threads.
    fn take(&mut self, count: usize, load: impl Fn(usize) -> Load + Sync) {
        if rayon::current_num_threads() == 1 {
            for k in 0..count {
                let load = load(k);
                self.add(&load, &pushes(self.locator, &load));
            }
            return;
        }
        let mut block = Vec::with_capacity(BLOCK.min(count));
        for start in (0..count).step_by(BLOCK) {
            (start..count.min(start + BLOCK))
                .into_par_iter()
                .with_min_len(64)
                .map(|k| {
                    let load = load(k);
                    (load, pushes(self.locator, &load))
                })
                .collect_into_vec(&mut block);
            for (load, pushes) in &block {
                self.add(load, pushes);
            }
        }
    }

    #[inline(always)]
    fn add(&mut self, load: &Load, pushes: &[Lanes; 8]) {
        let element = load.element as usize;
        let nodes = self.mesh.elements.nodes(element);
        for (&node, push) in nodes.iter().zip(pushes) {
            let target = &mut self.nodal[node as usize];
            (0..4).for_each(|l| target[l] += push[l]);
        }
        if load.shift != [0; 3] || self.locator.wraps(element) {
            self.add_beyond(load, pushes);
        }
    }

    fn add_beyond(&mut self, load: &Load, pushes: &[Lanes; 8]) {
        let element = load.element as usize;
        let images = self.mesh.elements.images(element);
        let back = load.shift.map(|s| -s);
        let lattice = self.locator.lattice();
        for (image, push) in images.iter().zip(pushes) {
            let steps = image.shifts();
            let shift = std::array::from_fn(|k| i32::from(steps[k]) + back[k]);
            let away = lattice.image(&Vector3::zeros(), shift);
            self.beyond += away.cross(&Vector3::new(push[0], push[1], push[2]));
        }
    }
}

/// N_i F + ½ T × ∇N_i at the vertices of the element.
#[inline(always)]
fn pushes(locator: &Locator, load: &Load) -> [Lanes; 8] {
    let element = load.element as usize;
    let rows = locator.inverse_jacobian(element, load.reference);
    let ([fx, fy, fz], [tx, ty, tz]) = (load.force, load.torque.map(|t| 0.5 * t));
    // ½ T × e_c
    let turned = [
        [0.0, tz, -ty, 0.0],
        [-tz, 0.0, tx, 0.0],
        [ty, -tx, 0.0, 0.0],
    ];
    let along = rows.map(|row| -> Lanes {
        std::array::from_fn(|l| {
            let [a, b, c] = [0, 1, 2].map(|c| (row[c], turned[c][l]));
            c.0.mul_add(c.1, b.0.mul_add(b.1, a.0 * a.1))
        })
    });
    let push = |kind| jet::transpose(kind, [fx, fy, fz, 0.0], along, load.reference);
    match locator.kind(element) {
        ElementKind::Tetrahedron => push(ElementKind::Tetrahedron),
        ElementKind::Hexahedron => push(ElementKind::Hexahedron),
        kind => push(kind),
    }
}
