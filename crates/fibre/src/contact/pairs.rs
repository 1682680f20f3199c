//! The list of pairs of segments that may touch, in columns: most pairs are passed over by reading one number.

use crate::Vector3;
use crate::contact::Segments;
use crate::contact::broad::Found;
use crate::contact::closest::{closest_points, near_points, share};
use crate::contact::crossing::crossings;
use crate::contact::far::Facing;
use crate::contact::images::Images;
use crate::contact::law::{Law, Response, Touch};
use crate::contact::linear::{Linear, Passed, Sway};
use crate::contact::loads::{Acting, Loads};
use crate::contact::travel::rest;
use bytemuck::{Pod, Zeroable};
use fibreflow_parallel::{block_sum, block_sums};
use rayon::prelude::*;

/// Pairs that one thread takes at least; sums over so many are added up, which must not depend on the threads.
const BLOCK: usize = 1024;

/// Pairs in ascending order of their ids.
#[derive(Default)]
pub(super) struct Pairs {
    /// Global ids, a < b.
    pub ids: Vec<[u64; 2]>,
    /// Owned segments by their index, then ghosts.
    pub local: Vec<[u32; 2]>,
    /// Path before which the pair cannot come into the range of its forces \[m\]; 0 for a pair within it.
    wake: Vec<f64>,
    contacts: Vec<Contact>,
    /// Contacts of the implicit integrator's present iteration; empty for the explicit one.
    linear: Vec<Option<Linear>>,
    /// Energy lost in the last step, by blocks of pairs \[J\].
    lost: Vec<f64>,
    /// Pairs of every owned segment: `rows[offsets[i]..offsets[i + 1]]` holds pair << 1 | side, ascending.
    offsets: Vec<u32>,
    rows: Vec<u32>,
}

/// What a pair did in the last step.
#[derive(Clone, Copy, Debug, Default)]
struct Contact {
    /// Whether the two are within the range of their forces; nothing else counts if not.
    active: bool,
    response: Response,
    /// Places on the two axes.
    at: [f64; 2],
    /// Levers from the axes to the contact point \[m\].
    arms: [Vector3; 2],
    overlap: f64,
    spring: Vector3,
}

/// A segment of another rank.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Ghost {
    ends: [[f64; 3]; 2],
    velocities: [[f64; 3]; 2],
    spin: [f64; 3],
    radius: f64,
    mass: f64,
}

impl Ghost {
    pub fn of(segments: &Segments<'_>, segment: usize) -> Self {
        Self {
            ends: segments.ends(segment).map(Into::into),
            velocities: segments.end_velocities(segment).map(Into::into),
            spin: segments.spin(segment).into(),
            radius: segments.radius[segment],
            mass: segments.mass[segment],
        }
    }
}

/// The segments that pairs refer to: those of this rank, then those of others.
#[derive(Clone, Copy)]
pub(super) struct Bodies<'a> {
    pub segments: &'a Segments<'a>,
    /// By local index; the entries of this rank's own segments are not read.
    pub ghosts: &'a [Ghost],
}

impl Bodies<'_> {
    fn velocities(&self, i: usize) -> [Vector3; 2] {
        if self.owns(i) {
            self.segments.end_velocities(i)
        } else {
            self.ghosts[i].velocities.map(Vector3::from)
        }
    }

    fn owns(&self, i: usize) -> bool {
        i < self.segments.count()
    }

    fn ends(&self, i: usize) -> [Vector3; 2] {
        if self.owns(i) {
            self.segments.ends(i)
        } else {
            self.ghosts[i].ends.map(Vector3::from)
        }
    }

    fn radius(&self, i: usize) -> f64 {
        if self.owns(i) {
            self.segments.radius[i]
        } else {
            self.ghosts[i].radius
        }
    }

    /// Velocity at the lever `arm` from the axis point `s`, spin, and mass.
    fn motion(&self, i: usize, s: f64, arm: &Vector3) -> (Vector3, Vector3, f64) {
        let [first, second] = self.velocities(i);
        let (spin, mass) = if self.owns(i) {
            (self.segments.spin(i), self.segments.mass[i])
        } else {
            (self.ghosts[i].spin.into(), self.ghosts[i].mass)
        };
        (first + (second - first) * s + spin.cross(arm), spin, mass)
    }
}

impl Pairs {
    /// From a search, with the springs of contacts there were before; `local` numbers an (owner, index), `range` is that
    /// of the forces \[m\].
    pub fn new(
        owned: usize,
        found: &[Found],
        springs: &[Vector3],
        local: impl Fn((u32, u32)) -> u32 + Sync,
        range: f64,
    ) -> Self {
        let local: Vec<_> = found.par_iter().map(|f| f.places().map(&local)).collect();
        let (offsets, rows) = rows(owned, &local);
        // A spring without its contact is forgotten when the pair is looked at.
        let wake = |(found, spring): (&Found, &Vector3)| {
            if *spring == Vector3::zeros() {
                rest(found.gap - range)
            } else {
                0.0
            }
        };
        let contact = |&spring: &Vector3| Contact {
            spring,
            ..Contact::default()
        };
        Self {
            ids: found.par_iter().map(|f| f.ids).collect(),
            local,
            wake: found.par_iter().zip(springs).map(wake).collect(),
            contacts: springs.par_iter().map(contact).collect(),
            linear: Vec::new(),
            lost: vec![0.0; found.len().div_ceil(BLOCK)],
            offsets,
            rows,
        }
    }

    pub fn len(&self) -> usize {
        self.ids.len()
    }

    pub fn springs(&self) -> impl Iterator<Item = &Vector3> {
        self.contacts.iter().map(|contact| &contact.spring)
    }

    pub fn springs_mut(&mut self) -> impl Iterator<Item = &mut Vector3> {
        self.contacts.iter_mut().map(|contact| &mut contact.spring)
    }

    /// Computes all contacts at a `path`, advances their springs by `dt` and marks the owned segments that feel a force.
    /// Returns the energy lost by contacts whose first segment is owned \[J\].
    pub fn respond(
        &mut self,
        bodies: Bodies<'_>,
        law: &Law,
        images: &Images,
        path: f64,
        dt: f64,
        loads: &Loads,
    ) -> f64 {
        let wakes = self.wake.par_chunks_mut(BLOCK);
        let contacts = self.contacts.par_chunks_mut(BLOCK);
        let columns = wakes.zip(self.local.par_chunks(BLOCK)).zip(contacts);
        let blocks = columns.zip(&mut self.lost);
        let far = [law.far.range(), law.far.scale()];
        blocks.for_each(|(((wakes, local), contacts), lost)| {
            *lost = 0.0;
            for ((wake, local), contact) in wakes.iter_mut().zip(local).zip(contacts) {
                // Written so that a NaN is looked at.
                if path < *wake {
                    continue;
                }
                let local = local.map(|i| i as usize);
                match contact.respond(bodies, local, law, far, images, dt) {
                    Ok(()) => {
                        *wake = 0.0;
                        let dissipated = contact.response.dissipated;
                        *lost += if bodies.owns(local[0]) {
                            dissipated
                        } else {
                            0.0
                        };
                        let owned = local.into_iter().filter(|&i| bodies.owns(i));
                        owned.for_each(|i| loads.mark(i));
                    }
                    Err(gap) => {
                        if *wake == 0.0 {
                            *contact = Contact::default();
                        }
                        *wake = path + rest(gap);
                    }
                }
            }
        });
        self.lost.iter().sum()
    }

    /// Computes all contacts at the end of a step of length `time` in which the segments swayed so far.
    pub fn linearise(
        &mut self,
        bodies: Bodies<'_>,
        law: &Law,
        images: &Images,
        sway: &[Sway],
        time: f64,
        loads: &Loads,
    ) {
        self.linear.resize(self.len(), None);
        let far = [law.far.range(), law.far.scale()];
        let columns = self.local.par_iter().zip(&self.contacts);
        let all = columns.zip(&mut self.linear).with_min_len(BLOCK);
        all.for_each(|((local, contact), linear)| {
            let [i, j] = local.map(|i| i as usize);
            *linear = meet(bodies, [i, j], far, images).ok().map(|meeting| {
                let [s, t] = meeting.at;
                let own = sway[i].at(s, &meeting.arms[0]) - sway[j].at(t, &meeting.arms[1]);
                let passed = Passed {
                    slip: own + meeting.drift * time,
                    time,
                };
                Linear {
                    at: meeting.at,
                    arms: meeting.arms,
                    ..law.linearise(&meeting.touch, &passed, &contact.spring)
                }
            });
            if linear.is_some() {
                let owned = [i, j].into_iter().filter(|&i| bodies.owns(i));
                owned.for_each(|i| loads.mark(i));
            }
        });
    }

    /// Load on an owned segment of the contacts of [`Pairs::linearise`], or with `sway` what it changes by.
    pub fn linear_load(&self, segment: usize, sway: Option<&[Sway]>) -> Acting {
        let mut acting = Acting::default();
        let load = &mut acting.load;
        let row = self.offsets[segment] as usize..self.offsets[segment + 1] as usize;
        for &entry in &self.rows[row] {
            let (pair, side) = ((entry >> 1) as usize, (entry & 1) as usize);
            let Some(linear) = &self.linear[pair] else {
                continue;
            };
            match sway {
                None => {
                    let sign = if side == 0 { 1.0 } else { -1.0 };
                    linear.load(side, &linear.force, load);
                    load.torque += linear.couple * sign;
                }
                Some(sway) => {
                    let [i, j] = self.local[pair].map(|i| i as usize);
                    let [s, t] = linear.at;
                    let own = sway[i].at(s, &linear.arms[0]) - sway[j].at(t, &linear.arms[1]);
                    linear.load(side, &(linear.stiffness * -own), load);
                }
            }
        }
        acting
    }

    /// Takes the contacts of [`Pairs::linearise`] for those of a finished step. Returns the energy lost by contacts whose
    /// first segment is owned \[J\].
    pub fn commit(&mut self, owned: usize) -> f64 {
        let mut lost = 0.0;
        for (k, contact) in self.contacts.iter_mut().enumerate() {
            self.wake[k] = 0.0;
            *contact = self.linear[k].map_or_else(Contact::default, |linear| Contact {
                active: true,
                response: Response {
                    force: linear.force,
                    couple: linear.couple,
                    stored: linear.stored,
                    dissipated: linear.dissipated,
                    ..Response::default()
                },
                at: linear.at,
                arms: linear.arms,
                overlap: linear.overlap,
                spring: linear.spring,
            });
            if contact.active && (self.local[k][0] as usize) < owned {
                lost += contact.response.dissipated;
            }
        }
        lost
    }

    /// Largest part of its own sway in which no axis can reach that of an owned segment, if all others keep to theirs.
    pub fn own_stride(
        &self,
        segment: usize,
        bodies: Bodies<'_>,
        images: &Images,
        sway: &[Sway],
    ) -> f64 {
        // Part of the distance between two axes that each may come nearer.
        const NEARER: f64 = 0.4;
        let ends = sway[segment].ends.map(|x| Vector3::from(x).norm());
        let moved = ends[0].max(ends[1]);
        let row = self.offsets[segment] as usize..self.offsets[segment + 1] as usize;
        let part = |&entry: &u32| {
            let [i, j] = self.local[(entry >> 1) as usize].map(|i| i as usize);
            let distance = axis_distance(bodies, images, [i, j]);
            if moved <= NEARER * distance {
                1.0
            } else {
                NEARER * distance / moved
            }
        };
        self.rows[row].iter().map(part).fold(1.0, f64::min)
    }

    /// Largest part of `sway` in which no axis can reach another.
    pub fn stride(&self, bodies: Bodies<'_>, images: &Images, sway: &[Sway]) -> f64 {
        // Part of the distance between two axes that they may come nearer.
        const NEARER: f64 = 0.8;
        let part = |local: &[u32; 2]| {
            let [i, j] = local.map(|i| i as usize);
            let ends = |i: usize| sway[i].ends.map(Vector3::from);
            let (a, b) = (ends(i), ends(j));
            let both = a.iter().flat_map(|a| b.iter().map(move |b| (a - b).norm()));
            let nearer = both.fold(0.0, f64::max);
            let distance = axis_distance(bodies, images, [i, j]);
            if nearer <= NEARER * distance {
                1.0
            } else {
                NEARER * distance / nearer
            }
        };
        let parts = self.local.par_iter().with_min_len(BLOCK).map(part);
        parts.reduce(|| 1.0, f64::min)
    }

    /// What all contacts of an owned segment do to it.
    pub fn acting(&self, segment: usize) -> Acting {
        let mut acting = Acting::default();
        let row = self.offsets[segment] as usize..self.offsets[segment + 1] as usize;
        for &entry in &self.rows[row] {
            let (contact, side) = (&self.contacts[(entry >> 1) as usize], (entry & 1) as usize);
            if contact.active {
                let sign = if side == 0 { 1.0 } else { -1.0 };
                let (at, arm) = (contact.at[side], &contact.arms[side]);
                let response = &contact.response;
                acting.load.add(&(response.force * sign), at, arm);
                acting.drag.add(&(response.drag * sign), at, arm);
                acting.load.torque += response.couple * sign;
            }
        }
        acting
    }

    /// Pairs of an owned segment that are within range.
    pub fn count(&self, segment: usize) -> usize {
        let row = self.offsets[segment] as usize..self.offsets[segment + 1] as usize;
        let active = |&&entry: &&u32| self.contacts[(entry >> 1) as usize].active;
        self.rows[row].iter().filter(active).count()
    }

    /// Calls `each` with the local indices of every pair within range, its overlap \[m\] and the bound of the stiffness
    /// of its forces at a distance \[N/m\].
    pub fn within_range(&self, mut each: impl FnMut([u32; 2], f64, f64)) {
        for (&local, contact) in self.local.iter().zip(&self.contacts) {
            if contact.active {
                each(local, contact.overlap, contact.response.far_stiffness);
            }
        }
    }

    /// Number of contacts whose first segment is owned and whose overlap is above `-gap`, and the energy stored in those
    /// within range \[J\].
    pub fn own_sums(&self, owned: usize, gap: f64) -> [f64; 2] {
        block_sums(self.len(), |range| {
            let mut sums = [0.0; 2];
            for (contact, local) in self.contacts[range.clone()].iter().zip(&self.local[range]) {
                if contact.active && (local[0] as usize) < owned {
                    sums[0] += f64::from(u8::from(contact.overlap > -gap));
                    sums[1] += contact.response.stored;
                }
            }
            sums
        })
    }

    /// Largest overlap \[m\].
    pub fn deepest(&self) -> f64 {
        let overlaps = self.contacts.iter().map(|contact| contact.overlap);
        overlaps.fold(0.0, f64::max)
    }

    /// Crossings of centre lines of pairs whose first segment is owned, while their ends moved with their velocities to
    /// their places for a time `moved` \[s\].
    pub fn crossings(&self, bodies: Bodies<'_>, images: &Images, moved: f64) -> f64 {
        let of_pair = |local: &[u32; 2]| {
            let [i, j] = local.map(|x| x as usize);
            let (a, mut b) = (bodies.ends(i), bodies.ends(j));
            let image = images.beside(&a, &b);
            b.iter_mut().for_each(|end| *end -= image.shift);
            let back = |ends: &[Vector3; 2], velocities: [Vector3; 2], own: &Vector3| {
                [0, 1].map(|k| ends[k] - (velocities[k] - own) * moved)
            };
            let before = [
                back(&a, bodies.velocities(i), &Vector3::zeros()),
                back(&b, bodies.velocities(j), &image.velocity),
            ];
            f64::from(crossings(&before, &[a, b]))
        };
        block_sum(self.len(), |range| {
            let own = self.local[range].iter();
            let own = own.filter(|local| bodies.owns(local[0] as usize));
            own.map(of_pair).sum()
        })
    }
}

impl Contact {
    /// Computes this contact of the pair (i, j); an error is how far the two are out of the range of their forces \[m\].
    fn respond(
        &mut self,
        bodies: Bodies<'_>,
        [i, j]: [usize; 2],
        law: &Law,
        [range, scale]: [f64; 2],
        images: &Images,
        dt: f64,
    ) -> Result<(), f64> {
        let meeting = meet(bodies, [i, j], [range, scale], images)?;
        self.active = true;
        self.overlap = meeting.touch.overlap;
        self.arms = meeting.arms;
        self.at = meeting.at;
        self.response = law.respond(&meeting.touch, &mut self.spring, dt);
        self.response.dissipated -= self.response.drag.dot(&meeting.drift) * dt;
        Ok(())
    }
}

/// Distance of the axes of two segments \[m\].
fn axis_distance(bodies: Bodies<'_>, images: &Images, [i, j]: [usize; 2]) -> f64 {
    let (a, mut b) = (bodies.ends(i), bodies.ends(j));
    let image = images.beside(&a, &b);
    b.iter_mut().for_each(|end| *end -= image.shift);
    closest_points(&a, &b).distance
}

/// Where and how two segments meet.
struct Meeting {
    touch: Touch,
    /// Places on the two axes.
    at: [f64; 2],
    /// Levers from the axes to the contact point \[m\].
    arms: [Vector3; 2],
    /// Velocity of a against b that the sheared box adds \[m/s\].
    drift: Vector3,
}

/// An error is how far the two are out of the range of their forces \[m\].
#[inline(always)]
fn meet(
    bodies: Bodies<'_>,
    [i, j]: [usize; 2],
    [range, scale]: [f64; 2],
    images: &Images,
) -> Result<Meeting, f64> {
    let (a, mut b) = (bodies.ends(i), bodies.ends(j));
    let image = images.beside(&a, &b);
    b.iter_mut().for_each(|end| *end -= image.shift);
    let radii = [bodies.radius(i), bodies.radius(j)];
    let reach = radii[0] + radii[1];
    let points = near_points(&a, &b, reach, range, scale)?;
    let normal = if points.distance > 1e-12 * reach {
        points.separation / points.distance
    } else {
        across(&(a[1] - a[0]), &(b[1] - b[0]))
    };
    let overlap = reach - points.distance;
    // The contact point is in the middle of the overlap.
    let arm = |radius: f64| normal * (radius - 0.5 * overlap);
    let arms = [arm(radii[0]), -arm(radii[1])];
    let at = [points.s, points.t];
    let (velocity_a, spin_a, mass_a) = bodies.motion(i, at[0], &arms[0]);
    let (velocity_b, spin_b, mass_b) = bodies.motion(j, at[1], &arms[1]);
    let touch = Touch {
        normal,
        overlap,
        velocity: velocity_a - velocity_b + image.velocity,
        spin: 0.5 * (spin_a + spin_b),
        mass: 1.0 / (compliance(at[0], mass_a) + compliance(at[1], mass_b)),
        share: share(&points),
        rub_share: 1.0,
        facing: (range > 0.0).then(|| Facing::axes(&a, &b, radii)),
    };
    Ok(Meeting {
        touch,
        at,
        arms,
        drift: image.velocity,
    })
}

/// Pairs of each owned segment, ascending, as pair << 1 | side.
fn rows(owned: usize, local: &[[u32; 2]]) -> (Vec<u32>, Vec<u32>) {
    let sides = || {
        local.iter().enumerate().flat_map(move |(p, local)| {
            [0, 1].map(|side| (local[side] as usize, (p << 1 | side) as u32))
        })
    };
    let mut offsets = vec![0u32; owned + 1];
    for (segment, _) in sides().filter(|&(segment, _)| segment < owned) {
        offsets[segment + 1] += 1;
    }
    for i in 0..owned {
        offsets[i + 1] += offsets[i];
    }
    let mut next = offsets.clone();
    let mut rows = vec![0u32; offsets[owned] as usize];
    for (segment, entry) in sides().filter(|&(segment, _)| segment < owned) {
        rows[next[segment] as usize] = entry;
        next[segment] += 1;
    }
    (offsets, rows)
}

/// 1/m of the axis point `s` when the mass is lumped in halves at the ends \[1/kg\].
fn compliance(s: f64, mass: f64) -> f64 {
    ((1.0 - s) * (1.0 - s) + s * s) / (0.5 * mass)
}

/// A unit vector across two axes that intersect.
fn across(p: &Vector3, q: &Vector3) -> Vector3 {
    let candidates = [
        p.cross(q),
        p.cross(&Vector3::x()),
        p.cross(&Vector3::y()),
        Vector3::x(),
    ];
    let scale = 1e-12 * (p.norm_squared() + q.norm_squared());
    let usable = candidates.iter().find_map(|v| v.try_normalize(scale));
    usable.unwrap_or_else(Vector3::x)
}
