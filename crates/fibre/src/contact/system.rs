//! All contacts of a rank: candidate pairs, ghosts of foreign segments, forces, friction springs.

use crate::Vector3;
use crate::contact::broad::{Found, search};
use crate::contact::closest::{near_points, share};
use crate::contact::crossing::crossings;
use crate::contact::far::Facing;
use crate::contact::images::Images;
use crate::contact::law::{Law, Response, Touch};
use crate::contact::springs::{FrictionRecord, carry};
use crate::contact::wall::{WallContacts, WallTotals};
use crate::contact::{ContactError, ContactSettings, SegmentLoad, Segments};
use bytemuck::{Pod, Zeroable};
use fibreflow_parallel::{Communicator, Halo, block_max, block_sum, block_sums};
use rayon::prelude::*;

/// Contacts between the segments of all ranks, and with walls.
pub struct ContactSystem {
    settings: ContactSettings,
    law: Law,
    communicator: Communicator,
    built: Option<Built>,
    pairs: Vec<Pair>,
    /// Pairs of every owned segment: `rows[offsets[i]..offsets[i + 1]]` holds pair << 1 | side, ascending.
    offsets: Vec<u32>,
    rows: Vec<u32>,
    halo: Halo,
    /// Owned segments, then ghosts.
    states: Vec<State>,
    constants: Vec<[f64; 2]>,
    walls: WallContacts,
    /// Springs of a checkpoint that no pair has taken yet.
    pending: Vec<FrictionRecord>,
    /// Since the box was upright and the walls were where the settings put them \[s\].
    time: f64,
    /// Load of the last step whose work is lost, and that step \[s\].
    drag: Vec<SegmentLoad>,
    drag_step: f64,
    totals: Totals,
}

/// What the last search was made for.
struct Built {
    ids: Vec<u64>,
    ends: Vec<[Vector3; 2]>,
    time: f64,
    /// Longest segment with its caps and all that is added to it \[m\].
    reach: f64,
}

/// Two segments that may touch, in ascending order of their ids.
#[derive(Clone, Copy, Debug)]
struct Pair {
    ids: [u64; 2],
    /// Indices into `states`.
    local: [u32; 2],
    spring: Vector3,
    /// What the pair did in the last step, `None` when apart.
    contact: Option<Contact>,
}

#[derive(Clone, Copy, Debug)]
struct Contact {
    response: Response,
    /// Places on the two axes.
    at: [f64; 2],
    /// Levers from the axes to the contact point \[m\].
    arms: [Vector3; 2],
    overlap: f64,
}

/// Kinematics of a segment as it travels between ranks.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct State {
    ends: [[f64; 3]; 2],
    velocities: [[f64; 3]; 2],
    spin: [f64; 3],
}

impl State {
    fn ends(&self) -> [Vector3; 2] {
        self.ends.map(Vector3::from)
    }
}

#[derive(Clone, Debug, Default)]
struct Totals {
    walls: WallTotals,
    dissipated: f64,
    crossings: f64,
    rebuilds: usize,
    tests: usize,
}

/// Figures of the last step over all ranks, see [`ContactSystem::statistics`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactStatistics {
    /// Touching pairs of segments.
    pub contacts: usize,
    /// Segment ends that touch a wall.
    pub wall_contacts: usize,
    /// Pairs on the list of candidates.
    pub candidates: usize,
    /// Largest overlap \[m\].
    pub max_overlap: f64,
    /// Energy in the contact springs and of the forces at a distance \[J\].
    pub stored_energy: f64,
    /// Energy lost by damping and friction since the start of the run or its last resumption \[J\].
    pub dissipated_energy: f64,
    /// Work of the moving walls on the fibres since then \[J\].
    pub wall_work: f64,
    /// Times that two centre lines passed through each other since then, if the settings have them counted.
    pub crossings: usize,
    /// Searches for pairs since then.
    pub rebuilds: usize,
    /// Pairs that shared a cell in the last search: its cost.
    pub tests: usize,
}

impl ContactSystem {
    /// No contacts yet.
    ///
    /// # Errors
    /// [`ContactError`] when a constant or a wall is unusable.
    pub fn new(
        settings: ContactSettings,
        communicator: &Communicator,
    ) -> Result<Self, ContactError> {
        if settings.shear_rate != 0.0 && settings.periodic.lengths[1].is_none() {
            return Err(ContactError::Setting {
                name: "shear_rate",
                value: settings.shear_rate,
                valid: "0 unless the box is periodic along y",
            });
        }
        Ok(Self {
            law: Law::new(&settings)?,
            walls: WallContacts::new(&settings.walls, &settings.periodic)?,
            settings,
            communicator: communicator.clone(),
            built: None,
            pairs: Vec::new(),
            offsets: vec![0],
            rows: Vec::new(),
            halo: Halo::none(communicator, 0),
            states: Vec::new(),
            constants: Vec::new(),
            pending: Vec::new(),
            time: 0.0,
            drag: Vec::new(),
            drag_step: 0.0,
            totals: Totals::default(),
        })
    }

    /// Time since the box was upright and the walls were where the settings put them \[s\].
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Moves the walls and shears the box to a `time` \[s\]; to be called before [`ContactSystem::update`].
    pub fn set_time(&mut self, time: f64) {
        self.time = time;
    }

    fn images(&self) -> Images {
        let (periodic, rate) = (&self.settings.periodic, self.settings.shear_rate);
        Images::new(periodic, rate, rate * self.time)
    }

    /// Searches for pairs again when needed: an end has moved by half the skin on any rank, segments have come, gone
    /// or changed owner, or friction springs were restored. Collective; to be called before every
    /// [`ContactSystem::forces`].
    ///
    /// # Errors
    /// [`ContactError`], the same on every rank, when a periodic box is too short or a position is not finite.
    pub fn update(&mut self, segments: &Segments<'_>) -> Result<(), ContactError> {
        let same = |built: &Built| built.ids == segments.ids;
        let moved = !self.built.as_ref().is_some_and(same) || !self.pending.is_empty();
        let stale = moved
            || self
                .built
                .as_ref()
                .is_none_or(|b| self.strayed(b, segments));
        // One reduction answers both questions.
        let need = self
            .communicator
            .max(f64::from(u8::from(stale) + u8::from(moved)));
        if need > 0.0 {
            self.rebuild(segments, need > 1.0)?;
        }
        Ok(())
    }

    /// Whether two surfaces can have come nearer by the skin since the last search. In a sheared box, images keep their
    /// places in a frame that is sheared along, so strays are measured in that frame.
    fn strayed(&self, built: &Built, segments: &Segments<'_>) -> bool {
        let passed = self.time - built.time;
        let strain = self.settings.shear_rate * passed;
        let moved = self.walls.speed() * passed.abs();
        let room = 0.5 * (self.settings.skin - strain.abs() * built.reach);
        if !(room > 0.0 && moved <= 0.5 * self.settings.skin) {
            return true;
        }
        // Written so that a NaN counts as strayed.
        let near = |x: &Vector3, before: &Vector3| {
            let along = Vector3::new(strain * before.y, 0.0, 0.0);
            (x - before - along).norm_squared() <= room * room
        };
        let ends = segments.start.par_iter().zip(segments.end);
        ends.zip(&built.ends)
            .any(|((start, end), before)| !(near(start, &before[0]) && near(end, &before[1])))
    }

    fn rebuild(&mut self, segments: &Segments<'_>, moved: bool) -> Result<(), ContactError> {
        if moved {
            self.drag.clear();
        }
        let reach = self.settings.skin + self.law.far.range();
        let found = search(&self.communicator, segments, &self.images(), reach)?;
        let published = if moved { self.records() } else { Vec::new() };
        let known = self.springs(|_| true);
        self.walls.rebuild(segments, reach, self.time);
        let pair_keys = found.pairs.iter().map(|pair| pair.ids);
        let wanted: Vec<[u64; 2]> = pair_keys.chain(self.walls.keys(segments.ids)).collect();
        let springs = carry(&self.communicator, known, &published, &wanted, moved);
        let (pair_springs, wall_springs) = springs.split_at(found.pairs.len());
        self.walls.set_springs(wall_springs);
        self.connect(segments, &found.pairs, pair_springs);
        let ends = segments.start.iter().zip(segments.end);
        self.built = Some(Built {
            ids: segments.ids.to_vec(),
            ends: ends.map(|(start, end)| [*start, *end]).collect(),
            time: self.time,
            reach: found.reach,
        });
        self.pending.clear();
        self.totals.rebuilds += 1;
        self.totals.tests = found.tests;
        Ok(())
    }

    /// Numbers the ghosts, and lists the pairs of every owned segment.
    fn connect(&mut self, segments: &Segments<'_>, found: &[Found], springs: &[Vector3]) {
        let (owned, rank) = (segments.ids.len(), self.communicator.rank() as u32);
        let places = |pair: &Found| [0, 1].map(|side| (pair.owner[side], pair.index[side]));
        let mut ghosts: Vec<(u32, u32)> = found.iter().flat_map(places).collect();
        ghosts.retain(|&(owner, _)| owner != rank);
        ghosts.sort_unstable();
        ghosts.dedup();
        let local = |(owner, index): (u32, u32)| {
            if owner == rank {
                return index;
            }
            let ghost = ghosts.binary_search(&(owner, index));
            (owned + ghost.expect("every foreign segment of a pair is listed")) as u32
        };
        self.pairs = found
            .iter()
            .zip(springs)
            .map(|(pair, &spring)| Pair {
                ids: pair.ids,
                local: places(pair).map(local),
                spring,
                contact: None,
            })
            .collect();
        (self.offsets, self.rows) = rows(owned, &self.pairs);
        self.halo = Halo::new(&self.communicator, owned, &ghosts);
        let total = self.halo.total();
        self.constants = vec![[0.0; 2]; total];
        for (i, constant) in self.constants[..owned].iter_mut().enumerate() {
            *constant = [segments.radius[i], segments.mass[i]];
        }
        self.halo.update(&mut self.constants);
        self.states = vec![State::zeroed(); total];
    }

    /// Adds the contact forces to `loads` (one entry an owned segment) and advances the friction springs by `dt`.
    /// Collective; `segments` are those of the last [`ContactSystem::update`].
    pub fn forces(&mut self, segments: &Segments<'_>, dt: f64, loads: &mut [SegmentLoad]) {
        debug_assert_eq!(segments.ids.len(), self.halo.owned());
        debug_assert_eq!(segments.ids.len(), loads.len());
        let owned = &mut self.states[..segments.ids.len()];
        owned.par_iter_mut().enumerate().for_each(|(i, state)| {
            *state = State {
                ends: [segments.start[i].into(), segments.end[i].into()],
                velocities: [
                    segments.start_velocity[i].into(),
                    segments.end_velocity[i].into(),
                ],
                spin: segments.angular_velocity[i].into(),
            };
        });
        self.halo.update(&mut self.states);
        self.book(segments, self.drag_step);
        self.respond(dt);
        let mut drag = std::mem::take(&mut self.drag);
        drag.clear();
        drag.resize(loads.len(), SegmentLoad::default());
        self.gather(loads, &mut drag);
        let walls = &mut self.totals.walls;
        let now = (self.time, dt);
        self.walls
            .forces(segments, &self.law, now, loads, &mut drag, walls);
        (self.drag, self.drag_step) = (drag, dt);
        self.book(segments, dt);
        self.totals.dissipated += self.totals.walls.dissipated + self.own_sums()[2];
    }

    /// Books half the loss of a step: forces act in its middle, where the velocity is the mean of those before and after
    /// the kick that they give.
    fn book(&mut self, segments: &Segments<'_>, step: f64) {
        let power = block_sum(self.drag.len(), |range| {
            let each = |i: usize| {
                let (start, end) = (&segments.start_velocity[i], &segments.end_velocity[i]);
                self.drag[i].power(start, end, &segments.angular_velocity[i])
            };
            range.map(each).sum()
        });
        self.totals.dissipated -= 0.5 * step * power;
    }

    fn respond(&mut self, dt: f64) {
        let (states, constants) = (&self.states, &self.constants);
        let (law, images) = (&self.law, self.images());
        let far = (law.far.range(), law.far.scale());
        self.pairs.par_iter_mut().for_each(|pair| {
            let [i, j] = pair.local.map(|x| x as usize);
            let (a, mut b) = (states[i].ends(), states[j].ends());
            let image = images.beside(&a, &b);
            b.iter_mut().for_each(|end| *end -= image.shift);
            let ([radius_a, mass_a], [radius_b, mass_b]) = (constants[i], constants[j]);
            let reach = radius_a + radius_b;
            let Some(points) = near_points(&a, &b, reach, far.0, far.1) else {
                pair.spring = Vector3::zeros();
                pair.contact = None;
                return;
            };
            let normal = if points.distance > 1e-12 * reach {
                points.separation / points.distance
            } else {
                across(&(a[1] - a[0]), &(b[1] - b[0]))
            };
            let overlap = reach - points.distance;
            // The contact point is in the middle of the overlap.
            let arms = [
                normal * (radius_a - 0.5 * overlap),
                -normal * (radius_b - 0.5 * overlap),
            ];
            let at = [points.s, points.t];
            let spins = [states[i].spin, states[j].spin].map(Vector3::from);
            let velocity = |state: &State, side: usize| {
                let [first, second] = state.velocities.map(Vector3::from);
                first + (second - first) * at[side] + spins[side].cross(&arms[side])
            };
            let touch = Touch {
                normal,
                overlap,
                velocity: velocity(&states[i], 0) - velocity(&states[j], 1) + image.velocity,
                spin: 0.5 * (spins[0] + spins[1]),
                mass: 1.0 / (compliance(at[0], mass_a) + compliance(at[1], mass_b)),
                share: share(&points),
                rub_share: 1.0,
                facing: (far.0 > 0.0).then(|| Facing::axes(&a, &b, [radius_a, radius_b])),
            };
            let mut response = law.respond(&touch, &mut pair.spring, dt);
            response.dissipated -= response.drag.dot(&image.velocity) * dt;
            pair.contact = Some(Contact {
                response,
                at,
                arms,
                overlap,
            });
        });
    }

    fn gather(&self, loads: &mut [SegmentLoad], drag: &mut [SegmentLoad]) {
        let both = loads.par_iter_mut().zip(drag).enumerate();
        both.for_each(|(i, (load, drag))| {
            for &entry in self.row(i) {
                let (pair, side) = ((entry >> 1) as usize, (entry & 1) as usize);
                if let Some(contact) = &self.pairs[pair].contact {
                    let sign = if side == 0 { 1.0 } else { -1.0 };
                    let (at, arm) = (contact.at[side], &contact.arms[side]);
                    load.add(&(contact.response.force * sign), at, arm);
                    drag.add(&(contact.response.drag * sign), at, arm);
                    load.torque += contact.response.couple * sign;
                }
            }
        });
    }

    fn row(&self, segment: usize) -> &[u32] {
        &self.rows[self.offsets[segment] as usize..self.offsets[segment + 1] as usize]
    }

    /// Largest stable step of velocity Verlet with the contacts of the last step, over all ranks \[s\]. Collective.
    ///
    /// K 3.37–3.40 with Δt = 2/ω: N contacts on a segment of mass m, lumped in halves at its ends, bound the frequency
    /// of the motion by ω² ≤ N max(4 k_n, 8 k_t)/m (the second from sliding with spin), and damping by ζ shortens the
    /// step by √(1 + ζ²) − ζ. At least two contacts are assumed, so that the step does not fall at the first touch.
    /// Together with a beam of step Δt_b: 1/Δt² = 1/Δt_b² + 1/Δt_c².
    pub fn critical_step(&self, segments: &Segments<'_>) -> f64 {
        let mut touching = vec![(0u32, 0.0); segments.ids.len()];
        let gap = self.law.far.contact_gap();
        if segments.ids.len() == self.halo.owned() {
            for (i, stiffness, touches) in self.walls.stiffness() {
                touching[i].0 += u32::from(touches);
                touching[i].1 += stiffness;
            }
            for (i, (count, far)) in touching.iter_mut().enumerate() {
                for &entry in self.row(i) {
                    if let Some(contact) = &self.pairs[(entry >> 1) as usize].contact {
                        *count += u32::from(contact.overlap > -gap);
                        *far += contact.response.far_stiffness;
                    }
                }
            }
        }
        let friction = if self.law.friction > 0.0 {
            8.0 * self.law.tangential_stiffness
        } else {
            0.0
        };
        let spring = friction.max(4.0 * self.law.stiffness);
        let zeta = self.law.damping_ratio;
        let damped = 2.0 * ((1.0 + zeta * zeta).sqrt() - zeta);
        let step = |(&(count, far), mass): (&(u32, f64), &f64)| {
            let stiffness = f64::from(count.max(2)) * spring + 4.0 * far;
            damped * (mass / stiffness).sqrt()
        };
        let steps = touching.iter().zip(segments.mass).map(step);
        self.communicator.min(steps.fold(f64::INFINITY, f64::min))
    }

    /// Counts the crossings of centre lines while their ends moved with the velocities of the last
    /// [`ContactSystem::forces`] to their places then, for a time `moved` \[s\].
    pub fn count_crossings(&mut self, moved: f64) {
        let (owned, images) = (self.halo.owned(), self.images());
        let of_pair = |pair: &Pair| {
            let [i, j] = pair.local.map(|x| x as usize);
            let (a, mut b) = (self.states[i].ends(), self.states[j].ends());
            let image = images.beside(&a, &b);
            b.iter_mut().for_each(|end| *end -= image.shift);
            let back = |ends: &[Vector3; 2], state: &State, own: &Vector3| {
                [0, 1].map(|k| ends[k] - (Vector3::from(state.velocities[k]) - own) * moved)
            };
            let before = [
                back(&a, &self.states[i], &Vector3::zeros()),
                back(&b, &self.states[j], &image.velocity),
            ];
            f64::from(crossings(&before, &[a, b]))
        };
        let count = block_sum(self.pairs.len(), |range| {
            let own = self.pairs[range].iter();
            let own = own.filter(|pair| (pair.local[0] as usize) < owned);
            own.map(of_pair).sum()
        });
        self.totals.crossings += count;
    }

    /// Whether the settings ask for [`ContactSystem::count_crossings`].
    pub fn counts_crossings(&self) -> bool {
        self.settings.count_crossings
    }

    /// Force of the fibres on each wall in the last step, over all ranks \[N\]. Collective.
    pub fn wall_forces(&self) -> Vec<Vector3> {
        let own = &self.totals.walls.force;
        let mut sums: Vec<f64> = own.iter().flat_map(|f| [f.x, f.y, f.z]).collect();
        sums.resize(3 * self.settings.walls.len(), 0.0);
        self.communicator.sum_slice(&mut sums);
        sums.chunks(3).map(Vector3::from_row_slice).collect()
    }

    /// Figures of the last step over all ranks. Collective.
    pub fn statistics(&self) -> ContactStatistics {
        let [count, stored, _] = self.own_sums();
        let walls = &self.totals.walls;
        let own = |pair: &&Pair| (pair.local[0] as usize) < self.halo.owned();
        let candidates = self.pairs.iter().filter(own).count();
        let mut sums = [
            count,
            walls.contacts as f64,
            candidates as f64,
            stored + walls.stored,
            self.totals.dissipated,
            self.totals.tests as f64,
            walls.work,
            self.totals.crossings,
        ];
        self.communicator.sum_slice(&mut sums);
        let deepest = block_max(self.pairs.len(), |range| {
            let contacts = self.pairs[range].iter().filter_map(|p| p.contact);
            contacts.map(|c| c.overlap).fold(0.0, f64::max)
        });
        ContactStatistics {
            contacts: sums[0] as usize,
            wall_contacts: sums[1] as usize,
            candidates: sums[2] as usize,
            max_overlap: self.communicator.max(deepest.max(walls.max_overlap)),
            stored_energy: sums[3],
            dissipated_energy: sums[4],
            wall_work: sums[6],
            crossings: sums[7] as usize,
            rebuilds: self.totals.rebuilds,
            tests: sums[5] as usize,
        }
    }

    /// Number, stored energy and loss of the contacts whose first segment is owned.
    fn own_sums(&self) -> [f64; 3] {
        let (owned, gap) = (self.halo.owned(), self.law.far.contact_gap());
        block_sums(self.pairs.len(), |range| {
            let mut sums = [0.0; 3];
            for pair in &self.pairs[range] {
                if let Some(contact) = &pair.contact
                    && (pair.local[0] as usize) < owned
                {
                    sums[0] += f64::from(u8::from(contact.overlap > -gap));
                    sums[1] += contact.response.stored;
                    sums[2] += contact.response.dissipated;
                }
            }
            sums
        })
    }

    /// Friction springs for a checkpoint: each contact once over all ranks, at the owner of its first segment.
    pub fn records(&self) -> Vec<FrictionRecord> {
        let owned = self.halo.owned();
        let mut records = self.springs(|pair| (pair.local[0] as usize) < owned);
        records.extend_from_slice(&self.pending);
        records
    }

    /// Takes the springs of a checkpoint; any rank may bring any of them. They reach the owners of their segments at
    /// the next [`ContactSystem::update`].
    pub fn restore_records(&mut self, records: Vec<FrictionRecord>) {
        self.pending.extend(records);
    }

    fn springs(&self, chosen: impl Fn(&Pair) -> bool) -> Vec<FrictionRecord> {
        let record = |[a, b]: [u64; 2], spring: &Vector3| FrictionRecord {
            a,
            b,
            spring: (*spring).into(),
        };
        let pairs = self.pairs.iter().filter(|pair| chosen(pair));
        let mut records: Vec<_> = pairs.map(|pair| record(pair.ids, &pair.spring)).collect();
        let ids = self.built.as_ref().map_or(&[][..], |built| &built.ids);
        let walls = self.walls.keys(ids).zip(self.walls.springs());
        records.extend(walls.map(|(key, spring)| record(key, spring)));
        records.retain(|r| r.spring != [0.0; 3]);
        records
    }
}

/// Pairs of each owned segment, ascending, as pair << 1 | side.
fn rows(owned: usize, pairs: &[Pair]) -> (Vec<u32>, Vec<u32>) {
    let sides = || {
        pairs.iter().enumerate().flat_map(move |(p, pair)| {
            [0, 1].map(|side| (pair.local[side] as usize, (p << 1 | side) as u32))
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

#[cfg(test)]
mod tests;
