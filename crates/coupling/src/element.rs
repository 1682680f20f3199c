//! The kernel of one element: its shape functions (K 3.63–3.66).

use crate::Coupling;
use crate::CouplingError;
use crate::coupling::Fields;
use crate::fetch::runs;
use crate::lattice::Shift;
use crate::locate::{Bent, Location, Locator};
use crate::rendezvous::{Flow, Host, Kept, Motion, Rendezvous, Source};
use crate::spread::Sums;
use bytemuck::{Pod, Zeroable};
use fibreflow_fibre::{Ambient, Reaction};
use fibreflow_mesh::LocalMesh;
use fibreflow_mesh::jet::{Lanes, Moments, Polynomial};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::ops::Range;

/// Loads among which those in the same element are summed before they go to its nodes.
const BLOCK: usize = 64;

/// Blocks that threads take at a time, before their nodal forces are added in order.
const BLOCKS: usize = 64;

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

/// The flow in the element that was asked last.
#[derive(Default)]
pub(crate) struct Cell {
    element: Option<usize>,
    velocity: Polynomial,
    change: Polynomial,
}

impl Coupling {
    /// u = Σ N_i u_i, ∂u_a/∂x_b = Σ u_i,a ∂N_i/∂x_b in the element around each point; what points in `motion` meet.
    pub(crate) fn sample_elements(
        &mut self,
        fields: &Fields<'_>,
        points: &[Vector3<f64>],
        motion: Option<Motion<'_>>,
        ambient: &mut Ambient,
    ) -> Result<(), CouplingError> {
        let locator = &self.locator;
        let host = Host {
            mesh: &self.mesh,
            locator,
            source: Elements { locator, fields },
        };
        self.rendezvous.place(points, motion, &host, ambient)?;
        if fields.change.is_none() && motion.is_none() {
            ambient.change.clear();
        }
        Ok(())
    }

    /// f_i = N_i F + ½ T × ∇N_i at the nodes of the element where each point was sampled, into `nodal`; what was given
    /// into `sums`.
    pub(crate) fn spread_elements(&mut self, reaction: &Reaction, sums: &mut Sums) {
        let communicator = self.mesh.halo.communicator();
        let own = communicator.rank() as u32;
        let given = Given {
            rendezvous: &self.rendezvous,
            reaction,
            own,
            scale: self.locator.scale(),
        };
        let mut target = Target {
            mesh: &self.mesh,
            locator: &self.locator,
            nodal: &mut self.nodal,
            beyond: Vector3::zeros(),
        };
        target.take(reaction.force.len(), &given, sums);
        if communicator.size() > 1 {
            let mut outgoing = vec![Vec::new(); communicator.size()];
            let places = self.rendezvous.placements.iter().enumerate();
            for (k, place) in places.filter(|(_, place)| place.rank != own) {
                outgoing[place.rank as usize].push(given.load(k));
            }
            for loads in communicator.exchange(outgoing) {
                target.take(loads.len(), &loads, sums);
            }
        }
        let beyond = target.beyond;
        let nodes = self.mesh.nodes.iter().zip(&self.nodal);
        let moment = |(x, force): (&[f64; 3], &[f64; 4])| {
            Vector3::from(*x).cross(&Vector3::new(force[0], force[1], force[2]))
        };
        let torque = beyond + by_parts(nodes.map(moment));
        sums.torque += torque;
        sums.torque_defect += torque - sums.torque_given;
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

/// The flow by shape functions.
struct Elements<'a> {
    locator: &'a Locator,
    fields: &'a Fields<'a>,
}

impl Source for Elements<'_> {
    #[inline(always)]
    fn flow(&self, location: &Location, kept: &mut Kept) -> Flow {
        let Self { locator, fields } = self;
        let (element, r) = (location.element as usize, location.reference);
        let Kept { bent, cell } = kept;
        if cell.element != Some(element) {
            cell.take(locator, fields, element);
        }
        let slopes = locator.slopes(element, r, bent);
        let jet = cell.velocity.jet(r);
        let change = if fields.change.is_some() {
            cell.change.value(r)
        } else {
            Lanes::ZERO
        };
        Flow {
            velocity: jet.value,
            gradient: slopes.map(|slope| along(slope, jet.along)),
            change,
        }
    }

    #[inline(always)]
    fn fetch(&self, element: u32) {
        self.locator.fetch_nodes(element, self.fields.velocity);
        if let Some(change) = self.fields.change {
            self.locator.fetch_nodes(element, change);
        }
    }
}

/// Σ_k s_k v_k over the first three.
#[inline(always)]
fn along([r, s, t, _]: [f64; 4], v: [Lanes; 3]) -> Lanes {
    let [r, s, t] = [r, s, t].map(Lanes::splat);
    t.mul_add(v[2], s.mul_add(v[1], r * v[0]))
}

impl Cell {
    #[inline(always)]
    fn take(&mut self, locator: &Locator, fields: &Fields<'_>, element: usize) {
        self.element = Some(element);
        let (kind, nodes) = (locator.kind(element), locator.nodes(element));
        self.velocity = Polynomial::new(kind, |v| fields.velocity[nodes[v] as usize].into());
        if let Some(change) = fields.change {
            self.change = Polynomial::new(kind, |v| change[nodes[v] as usize].into());
        }
    }
}

/// Loads by number.
trait Loads: Sync {
    fn load(&self, k: usize) -> Load;

    /// Element of a load.
    fn element(&self, k: usize) -> u32;

    /// True for a load that this rank takes itself.
    fn here(&self, k: usize) -> bool;

    /// Adds what it is to the sums over the points of this rank.
    fn book(&self, k: usize, sums: &mut Sums);
}

/// What the points of this rank give.
struct Given<'a> {
    rendezvous: &'a Rendezvous,
    reaction: &'a Reaction,
    own: u32,
    /// Size of an element \[m\].
    scale: f64,
}

impl Loads for Given<'_> {
    #[inline(always)]
    fn load(&self, k: usize) -> Load {
        let place = &self.rendezvous.placements[k];
        Load {
            force: self.reaction.force[k].into(),
            torque: self.reaction.torque[k].into(),
            reference: place.reference,
            shift: place.shift,
            element: place.element,
        }
    }

    #[inline(always)]
    fn element(&self, k: usize) -> u32 {
        self.rendezvous.placements[k].element
    }

    #[inline(always)]
    fn here(&self, k: usize) -> bool {
        self.rendezvous.placements[k].rank == self.own
    }

    #[inline(always)]
    fn book(&self, k: usize, sums: &mut Sums) {
        let (force, torque) = (&self.reaction.force[k], &self.reaction.torque[k]);
        sums.give(force, torque, self.scale);
        sums.torque_given += self.rendezvous.held[k].cross(force) + torque;
    }
}

/// What points of another rank give.
impl Loads for Vec<Load> {
    #[inline(always)]
    fn load(&self, k: usize) -> Load {
        self[k]
    }

    #[inline(always)]
    fn element(&self, k: usize) -> u32 {
        self[k].element
    }

    #[inline(always)]
    fn here(&self, _: usize) -> bool {
        true
    }

    #[inline(always)]
    fn book(&self, _: usize, _: &mut Sums) {}
}

/// Loads in one element, one after the other.
#[derive(Clone, Copy)]
struct Run {
    element: usize,
    shift: Shift,
    moments: Moments,
}

/// Nodes that take loads.
struct Target<'a> {
    mesh: &'a LocalMesh,
    locator: &'a Locator,
    nodal: &'a mut [[f64; 4]],
    /// Torque for that nodes and points are other images than those at the coordinates of the nodes.
    beyond: Vector3<f64>,
}

impl Target<'_> {
    /// Adds loads in their order, whatever the number of threads.
    fn take(&mut self, count: usize, loads: &impl Loads, sums: &mut Sums) {
        let locator = self.locator;
        let block = |b: usize| b * BLOCK..count.min((b + 1) * BLOCK);
        let blocks = count.div_ceil(BLOCK);
        if rayon::current_num_threads() == 1 {
            for b in 0..blocks {
                let elements = runs(block(b).map(|k| loads.element(k)));
                elements.for_each(|e| locator.fetch_nodes(e, self.nodal));
                sums.add(&gather(locator, block(b), count, loads, |run| {
                    self.add(run)
                }));
            }
            return;
        }
        let mut gathered: Vec<(Sums, Vec<Run>)> = Vec::with_capacity(BLOCKS.min(blocks));
        for first in (0..blocks).step_by(BLOCKS) {
            (first..blocks.min(first + BLOCKS))
                .into_par_iter()
                .map(|b| {
                    let mut runs = Vec::with_capacity(BLOCK);
                    let sums = gather(locator, block(b), count, loads, |run| runs.push(*run));
                    (sums, runs)
                })
                .collect_into_vec(&mut gathered);
            for (of_block, runs) in gathered.drain(..) {
                sums.add(&of_block);
                runs.iter().for_each(|run| self.add(run));
            }
        }
    }

    #[inline(always)]
    fn add(&mut self, run: &Run) {
        let pushes = run.moments.vertices();
        let vertices = self.locator.kind(run.element).vertices();
        let nodes = &self.locator.nodes(run.element)[..vertices];
        for (&node, push) in nodes.iter().zip(&pushes) {
            let target = &mut self.nodal[node as usize];
            *target = (Lanes::from(*target) + *push).to_array();
        }
        if run.shift != [0; 3] || self.locator.wraps(run.element) {
            self.add_beyond(run, &pushes);
        }
    }

    fn add_beyond(&mut self, run: &Run, pushes: &[Lanes; 8]) {
        let lattice = self.locator.lattice();
        let vector = |push: &Lanes| Vector3::from_row_slice(&push.to_array()[..3]);
        let away = |shift: Shift| lattice.image(&Vector3::zeros(), shift);
        let force = pushes.iter().map(vector).sum::<Vector3<f64>>();
        self.beyond += away(run.shift.map(|s| -s)).cross(&force);
        if self.locator.wraps(run.element) {
            let images = self.mesh.elements.images(run.element).iter();
            for (image, push) in images.zip(pushes) {
                self.beyond += away(image.shifts().map(i32::from)).cross(&vector(push));
            }
        }
    }
}

/// Sums loads in the same element: N_i F + ½ T × ∇N_i at its vertices.
#[inline(always)]
fn gather(
    locator: &Locator,
    range: Range<usize>,
    count: usize,
    loads: &impl Loads,
    mut done: impl FnMut(&Run),
) -> Sums {
    let (mut sums, mut bent) = (Sums::default(), Bent::default());
    let ahead = range.end..count.min(range.end + BLOCK);
    runs(ahead.map(|k| loads.element(k))).for_each(|e| locator.fetch(e, false));
    let mut run: Option<Run> = None;
    for k in range {
        loads.book(k, &mut sums);
        if !loads.here(k) {
            continue;
        }
        let load = loads.load(k);
        let element = load.element as usize;
        let goes_on = |run: &Run| run.element == element && run.shift == load.shift;
        if !run.as_ref().is_some_and(goes_on) {
            run.iter().for_each(&mut done);
            run = Some(Run {
                element,
                shift: load.shift,
                moments: Moments::new(locator.kind(element)),
            });
        }
        if let Some(run) = &mut run {
            let slopes = locator.slopes(element, load.reference, &mut bent);
            let (force, along) = by_reference(&load, &slopes);
            run.moments.add(force, along, load.reference);
        }
    }
    run.iter().for_each(done);
    sums
}

/// F and ½ T × ∇r_k.
#[inline(always)]
fn by_reference(load: &Load, slopes: &[[f64; 4]; 3]) -> (Lanes, [Lanes; 3]) {
    let ([fx, fy, fz], [tx, ty, tz]) = (load.force, load.torque.map(|t| 0.5 * t));
    // ½ T × e_c
    let turned = [
        [0.0, tz, -ty, 0.0],
        [-tz, 0.0, tx, 0.0],
        [ty, -tx, 0.0, 0.0],
    ]
    .map(Lanes::from);
    let [x, y, z] = slopes;
    let turning = [0, 1, 2].map(|k| along([x[k], y[k], z[k], 0.0], turned));
    ([fx, fy, fz, 0.0].into(), turning)
}
