//! The kernel of one element: its shape functions (K 3.63–3.66).

use crate::Coupling;
use crate::CouplingError;
use crate::coupling::Fields;
use crate::fetch::{BLOCK, runs};
use crate::lattice::Shift;
use crate::locate::{Bent, Hint, Locator, Near};
use crate::pairs::Places;
use crate::rendezvous::{Flow, Host, Kept, Motion, Rendezvous, Source, vector};
use crate::spread::Sums;
use bytemuck::{Pod, Zeroable};
use fibreflow_fibre::{Ambient, Reaction};
use fibreflow_mesh::LocalMesh;
use fibreflow_mesh::jet::{Lanes, Moments, Polynomial};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::ops::Range;

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

/// What the two forces of a pair of points are beside their sum: f₂ − f₁ \[N\] at `arm` \[m\] from the place.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Dipole {
    arm: [f64; 3],
    pull: [f64; 3],
}

/// The flow in the element that was asked last.
#[derive(Default)]
pub(crate) struct Cell {
    element: Option<u32>,
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
        let places = Places::new(points, self.paired)?;
        let locator = &self.locator;
        let host = Host {
            mesh: &self.mesh,
            locator,
            source: Elements { locator, fields },
        };
        self.rendezvous.place(&places, motion, &host, ambient)?;
        if fields.change.is_none() && motion.is_none() {
            ambient.change.clear();
        }
        Ok(())
    }

    /// f_i = N_i F + ½ T × ∇N_i at the nodes of the element where each point was sampled, into `nodal`; what was given
    /// into `sums`.
    pub(crate) fn spread_elements(&mut self, reaction: &Reaction, sums: &mut Sums) {
        if self.paired {
            self.spread_loads::<true>(reaction, sums);
        } else {
            self.spread_loads::<false>(reaction, sums);
        }
    }

    fn spread_loads<const PAIRED: bool>(&mut self, reaction: &Reaction, sums: &mut Sums) {
        let communicator = self.mesh.halo.communicator();
        let own = communicator.rank() as u32;
        let given = Given::<'_, PAIRED> {
            rendezvous: &self.rendezvous,
            arms: &self.rendezvous.arms,
            reaction,
            own,
            scale: self.locator.scale(),
            outside: self.beyond(),
        };
        let mut target = Target {
            mesh: &self.mesh,
            locator: &self.locator,
            nodal: &mut self.nodal,
            beyond: Vector3::zeros(),
        };
        target.take(self.rendezvous.placements.len(), &given, sums);
        if communicator.size() > 1 {
            let mut outgoing = vec![Vec::new(); communicator.size()];
            let mut beside = vec![Vec::new(); communicator.size()];
            let places = self.rendezvous.placements.iter().enumerate();
            for (k, place) in places.filter(|(_, place)| place.rank != own) {
                outgoing[place.rank as usize].push(given.load(k));
                beside[place.rank as usize].extend(PAIRED.then(|| given.dipole(k)));
            }
            let incoming = communicator.exchange(outgoing);
            if PAIRED {
                beside = communicator.exchange(beside);
            }
            for (loads, dipoles) in incoming.into_iter().zip(beside) {
                let sent = Sent::<PAIRED> { loads, dipoles };
                target.take(sent.loads.len(), &sent, sums);
            }
        }
        let beyond = target.beyond;
        let torque = beyond + torque_of(&self.mesh.nodes, &self.nodal);
        sums.torque += torque;
        sums.torque_defect += torque - sums.torque_given;
        self.mesh.halo.accumulate(&mut self.nodal);
    }
}

/// Σ x × f, by parts, so that round-off does not grow with the number of terms.
fn torque_of(nodes: &[[f64; 3]], forces: &[[f64; 4]]) -> Vector3<f64> {
    let parts = nodes.chunks(PART).zip(forces.chunks(PART));
    parts.fold(Vector3::zeros(), |torque, (nodes, forces)| {
        // Columns x_c f: what is above the diagonal less what is below.
        let [mut x, mut y, mut z] = [Lanes::ZERO; 3];
        for (at, force) in nodes.iter().zip(forces) {
            let force = Lanes::from(*force);
            x = force.mul_add(Lanes::splat(at[0]), x);
            y = force.mul_add(Lanes::splat(at[1]), y);
            z = force.mul_add(Lanes::splat(at[2]), z);
        }
        let [x, y, z] = [x, y, z].map(Lanes::to_array);
        torque + Vector3::new(y[2] - z[1], z[0] - x[2], x[1] - y[0])
    })
}

/// The flow by shape functions.
struct Elements<'a> {
    locator: &'a Locator,
    fields: &'a Fields<'a>,
}

impl Source for Elements<'_> {
    #[inline(always)]
    fn flow(&self, near: &Near<'_>, r: [f64; 3], kept: &mut Kept) -> Flow {
        let Kept { bent, cell } = kept;
        if cell.element != Some(near.element) {
            cell.take(self.fields, near);
        }
        let slopes = near.slopes(r, bent);
        let jet = cell.velocity.jet(r);
        let change = if self.fields.change.is_some() {
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
    fn take(&mut self, fields: &Fields<'_>, near: &Near<'_>) {
        self.element = Some(near.element);
        let (kind, nodes) = (near.kind(), near.nodes());
        self.velocity = Polynomial::new(kind, |v| fields.velocity[nodes[v] as usize].into());
        if let Some(change) = fields.change {
            self.change = Polynomial::new(kind, |v| change[nodes[v] as usize].into());
        }
    }
}

/// Loads by number.
trait Loads: Sync {
    /// They are of points in pairs.
    const PAIRED: bool;

    fn load(&self, k: usize) -> Load;

    /// Of points in pairs.
    fn dipole(&self, k: usize) -> Dipole;

    /// Element of a load, and the shift of its point there.
    fn hint(&self, k: usize) -> Hint;

    /// True for a load that this rank takes itself.
    fn here(&self, k: usize) -> bool;

    /// Adds what it is to the sums over the points of this rank.
    fn book(&self, k: usize, sums: &mut Sums);
}

/// What the points of this rank give.
struct Given<'a, const PAIRED: bool> {
    rendezvous: &'a Rendezvous,
    /// By pair.
    arms: &'a [Vector3<f64>],
    reaction: &'a Reaction,
    own: u32,
    /// Size of an element \[m\].
    scale: f64,
    /// Distance from which points are outside \[m\].
    outside: f64,
}

impl<const PAIRED: bool> Given<'_, PAIRED> {
    /// Force and torque, of both points where they are in pairs.
    #[inline(always)]
    fn of(&self, k: usize) -> [Vector3<f64>; 2] {
        let Reaction { force, torque } = self.reaction;
        if PAIRED {
            let [a, b] = [2 * k, 2 * k + 1];
            [force[a] + force[b], torque[a] + torque[b]]
        } else {
            [force[k], torque[k]]
        }
    }
}

impl<const PAIRED: bool> Loads for Given<'_, PAIRED> {
    const PAIRED: bool = PAIRED;

    #[inline(always)]
    fn load(&self, k: usize) -> Load {
        let place = &self.rendezvous.placements[k];
        let [force, torque] = self.of(k).map(Into::into);
        Load {
            force,
            torque,
            reference: place.reference,
            shift: place.shift,
            element: place.element,
        }
    }

    #[inline(always)]
    fn dipole(&self, k: usize) -> Dipole {
        let force = &self.reaction.force;
        Dipole {
            arm: self.arms[k].into(),
            pull: (force[2 * k + 1] - force[2 * k]).into(),
        }
    }

    #[inline(always)]
    fn hint(&self, k: usize) -> Hint {
        let place = &self.rendezvous.placements[k];
        (place.element, place.shift)
    }

    #[inline(always)]
    fn here(&self, k: usize) -> bool {
        self.rendezvous.placements[k].rank == self.own
    }

    #[inline(always)]
    fn book(&self, k: usize, sums: &mut Sums) {
        let [force, torque] = self.of(k);
        sums.give(&force, &torque, self.scale);
        sums.torque_given += self.rendezvous.held[k].cross(&force) + torque;
        if PAIRED {
            let Dipole { arm, pull } = self.dipole(k);
            sums.torque_given += Vector3::from(arm).cross(&Vector3::from(pull));
        }
        if self.rendezvous.distance(k) > self.outside {
            sums.outside += if PAIRED { 2.0 } else { 1.0 };
        }
    }
}

/// What points of another rank give.
struct Sent<const PAIRED: bool> {
    loads: Vec<Load>,
    dipoles: Vec<Dipole>,
}

impl<const PAIRED: bool> Loads for Sent<PAIRED> {
    const PAIRED: bool = PAIRED;

    #[inline(always)]
    fn load(&self, k: usize) -> Load {
        self.loads[k]
    }

    #[inline(always)]
    fn dipole(&self, k: usize) -> Dipole {
        self.dipoles[k]
    }

    #[inline(always)]
    fn hint(&self, k: usize) -> Hint {
        (self.loads[k].element, self.loads[k].shift)
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
struct Run<'a> {
    near: Near<'a>,
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
        if rayon::current_num_threads() == 1 {
            self.take_alone(count, loads, sums);
        } else {
            self.take_together(count, loads, sums);
        }
    }

    #[inline(never)]
    fn take_alone(&mut self, count: usize, loads: &impl Loads, sums: &mut Sums) {
        let locator = self.locator;
        for start in (0..count).step_by(BLOCK) {
            let block = start..count.min(start + BLOCK);
            let elements = runs(block.clone().map(|k| loads.hint(k).0));
            elements.for_each(|e| locator.fetch_nodes(e, self.nodal));
            let of_block = gather(locator, block, count, loads, |run| self.add(run));
            sums.add(&of_block);
        }
    }

    #[inline(never)]
    fn take_together(&mut self, count: usize, loads: &impl Loads, sums: &mut Sums) {
        let locator = self.locator;
        let block = |b: usize| b * BLOCK..count.min((b + 1) * BLOCK);
        let blocks = count.div_ceil(BLOCK);
        let several = |first: usize| -> Vec<(Sums, Vec<Run<'_>>)> {
            let several = first.min(blocks)..blocks.min(first + BLOCKS);
            let gathered = several.into_par_iter().map(|b| {
                let mut runs = Vec::with_capacity(BLOCK);
                let sums = gather(locator, block(b), count, loads, |run| runs.push(*run));
                (sums, runs)
            });
            gathered.collect()
        };
        // While one thread adds, the others sum what comes next.
        let mut gathered = several(0);
        for first in (0..blocks).step_by(BLOCKS) {
            let add = || {
                for (of_block, runs) in &gathered {
                    sums.add(of_block);
                    runs.iter().for_each(|run| self.add(run));
                }
            };
            let (next, ()) = rayon::join(|| several(first + BLOCKS), add);
            gathered = next;
        }
    }

    #[inline(always)]
    fn add(&mut self, Run { near, moments }: &Run<'_>) {
        let pushes = moments.vertices();
        let nodes = &near.nodes()[..near.kind().vertices()];
        for (&node, push) in nodes.iter().zip(&pushes) {
            let target = &mut self.nodal[node as usize];
            *target = (Lanes::from(*target) + *push).to_array();
        }
        if near.shift != [0; 3] || near.wraps() {
            self.add_beyond(near, &pushes);
        }
    }

    fn add_beyond(&mut self, near: &Near<'_>, pushes: &[Lanes; 8]) {
        let lattice = self.locator.lattice();
        let force = pushes.iter().copied().sum();
        self.beyond -= near.away.cross(&vector(force));
        if near.wraps() {
            let images = self.mesh.elements.images(near.element as usize).iter();
            for (image, push) in images.zip(pushes) {
                let away = lattice.away(image.shifts().map(i32::from));
                self.beyond += away.cross(&vector(*push));
            }
        }
    }
}

/// Sums loads in the same element: N_i F + ½ T × ∇N_i at its vertices.
#[inline(always)]
fn gather<'a, L>(
    locator: &'a Locator,
    range: Range<usize>,
    count: usize,
    loads: &L,
    mut done: impl FnMut(&Run<'a>),
) -> Sums
where
    L: Loads,
{
    let (mut sums, mut bent) = (Sums::default(), Bent::default());
    let ahead = range.end..count.min(range.end + BLOCK);
    runs(ahead.map(|k| loads.hint(k).0)).for_each(|e| locator.fetch(e, false));
    let mut next = range.start;
    while next < range.end {
        let (first, hint, here) = (next, loads.hint(next), loads.here(next));
        while next < range.end && loads.hint(next) == hint && loads.here(next) == here {
            loads.book(next, &mut sums);
            next += 1;
        }
        let Some(near) = locator.near(hint).filter(|_| here) else {
            continue;
        };
        let mut moments = Moments::new(near.kind());
        let loads = (first..next).map(|k| (loads.load(k), L::PAIRED.then(|| loads.dipole(k))));
        if near.is_linear() {
            let turning = Turning::new(near.slopes([0.0; 3], &mut bent));
            moments.add_all(loads.map(|(load, dipole)| turning.of(&load, dipole)));
        } else {
            moments.add_all(loads.map(|(load, dipole)| {
                let slopes = near.slopes(load.reference, &mut bent);
                Turning::new(slopes).of(&load, dipole)
            }));
        }
        done(&Run { near, moments });
    }
    sums
}

/// ∇r_k, in the order of the components that a product across takes them in.
struct Turning {
    /// y, z, x and z, x, y for the three k.
    rows: [[Lanes; 2]; 3],
    /// ∂(r, s, t)/∂x_c.
    columns: [Lanes; 3],
}

impl Turning {
    #[inline(always)]
    fn new(columns: [[f64; 4]; 3]) -> Self {
        let [x, y, z] = columns;
        let orders = |k: usize| {
            let yzx = Lanes::from([y[k], z[k], x[k], 0.0]);
            let zxy = Lanes::from([z[k], x[k], y[k], 0.0]);
            [yzx, zxy]
        };
        Self {
            rows: [orders(0), orders(1), orders(2)],
            columns: columns.map(Lanes::from),
        }
    }

    /// F, ½ T × ∇r_k and, of points in pairs, (f₂ − f₁) a·∇r_k with it, and where.
    #[inline(always)]
    fn of(&self, load: &Load, dipole: Option<Dipole>) -> (Lanes, [Lanes; 3], [f64; 3]) {
        let ([fx, fy, fz], [x, y, z]) = (load.force, load.torque);
        let force = Lanes::from([fx, fy, fz, 0.0]);
        let yzx = 0.5 * Lanes::from([y, z, x, 0.0]);
        let zxy = 0.5 * Lanes::from([z, x, y, 0.0]);
        let turned = |k: usize| yzx.mul_sub(self.rows[k][1], zxy * self.rows[k][0]);
        let mut moments = [turned(0), turned(1), turned(2)];
        if let Some(Dipole { arm, pull }) = dipole {
            let [x, y, z] = arm;
            let [by_x, by_y, by_z] = self.columns;
            let along = (by_x * x + by_y * y + by_z * z).to_array();
            let [px, py, pz] = pull;
            let pull = Lanes::from([px, py, pz, 0.0]);
            for (moment, along) in moments.iter_mut().zip(along) {
                *moment += pull * along;
            }
        }
        (force, moments, load.reference)
    }
}
