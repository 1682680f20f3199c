//! All contacts of a rank: candidate pairs, ghosts of foreign segments, forces, friction springs.

use crate::Vector3;
use crate::contact::broad::{Found, Search, search};
use crate::contact::images::Images;
use crate::contact::law::Law;
use crate::contact::linear::Sway;
use crate::contact::loads::Loads;
use crate::contact::pairs::{Bodies, Ghost, Pairs};
use crate::contact::springs::{FrictionRecord, carry};
use crate::contact::travel::{Extent, Travel};
use crate::contact::wall::{WallContacts, WallTotals};
use crate::contact::{ContactError, ContactSettings, SegmentLoad, Segments};
use bytemuck::Zeroable;
use fibreflow_parallel::{Communicator, Halo};
use rayon::prelude::*;

/// Pairs a segment on the list below which the skin grows, and above which it shrinks: one that rests costs a hundredth of
/// what a segment does in a step, a search a third.
const SHORT_LIST: f64 = 1.0;
const LONG_LIST: f64 = 4.0;
const SKIN_STEP: f64 = 1.5;
/// Part of the shortest period that the reach of a search may grow to; half of it is the limit.
const ROOM: f64 = 0.45;

/// Contacts between the segments of all ranks, and with walls.
pub struct ContactSystem {
    settings: ContactSettings,
    law: Law,
    communicator: Communicator,
    built: Option<Built>,
    travel: Travel,
    /// That of the next search \[m\].
    skin: f64,
    pairs: Pairs,
    halo: Halo,
    /// Owned segments as other ranks see them, then ghosts; empty where no rank has ghosts of another.
    ghosts: Vec<Ghost>,
    loads: Loads,
    walls: WallContacts,
    /// Displacements of owned and foreign segments for the implicit integrator.
    sway: Vec<Sway>,
    /// Springs of a checkpoint that no pair has taken yet.
    pending: Vec<FrictionRecord>,
    /// Since the box was upright and the walls were where the settings put them \[s\].
    time: f64,
    /// Step of the loads \[s\].
    load_step: f64,
    totals: Totals,
    /// Loss \[J\], work of walls \[J\] and crossings of all finished steps and all ranks.
    settled: [f64; 3],
}

/// What the last search was made for.
struct Built {
    ids: Vec<u64>,
    time: f64,
    /// The skin that the list has \[m\].
    skin: f64,
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
    /// Energy lost by damping and friction since the first step \[J\].
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
            skin: settings.skin,
            settings,
            communicator: communicator.clone(),
            built: None,
            travel: Travel::default(),
            pairs: Pairs::default(),
            halo: Halo::none(communicator, 0),
            ghosts: Vec::new(),
            loads: Loads::default(),
            sway: Vec::new(),
            pending: Vec::new(),
            time: 0.0,
            load_step: 0.0,
            totals: Totals::default(),
            settled: [0.0; 3],
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

    /// Searches for pairs again when needed: ends have moved apart by the skin on any ranks, or towards a wall by half of
    /// it, segments have come, gone or changed owner, or friction springs were restored. Collective; to be called before every
    /// [`ContactSystem::forces`].
    ///
    /// # Errors
    /// [`ContactError`], the same on every rank, when a periodic box is too short or a position is not finite.
    pub fn update(&mut self, segments: &Segments<'_>) -> Result<(), ContactError> {
        let time = self.time;
        let built = self.built.as_ref().filter(|b| b.ids == segments.ids);
        let passed = built
            .filter(|_| self.pending.is_empty())
            .map(|b| (time - b.time, b.skin));
        // Infinite: segments have come or gone, springs were restored, or something is not finite.
        let step = passed.map_or(Extent::BEYOND, |(passed, _)| {
            let strain = self.settings.shear_rate * passed;
            self.travel.step(segments.position, strain)
        });
        let step = step.over(&self.communicator);
        let (Some((passed, skin)), true) = (passed, step.longest() < f64::INFINITY) else {
            return self.rebuild(segments, true);
        };
        self.travel.add(&step);
        if self.outgrown(segments, passed, 0.5 * skin) {
            return self.rebuild(segments, false);
        }
        Ok(())
    }

    /// Whether the lists no longer hold all that can touch, `passed` seconds after the search. Collective.
    fn outgrown(&mut self, segments: &Segments<'_>, passed: f64, half_skin: f64) -> bool {
        if self.walls.speed() * passed.abs() > half_skin {
            return true;
        }
        if self.travel.pairs.due(half_skin) {
            let moved = self.travel.moved(segments.position);
            let distance = self.travel.distance(&moved.over(&self.communicator));
            if distance >= half_skin {
                return true;
            }
            self.travel.pairs.measured(distance);
        }
        if !self.walls.is_empty() && self.travel.walls.due(half_skin) {
            let nearer = |moved: &Vector3| self.walls.nearer(moved);
            let distance = self.travel.largest(segments.position, nearer);
            let distance = self.communicator.max(distance);
            if distance >= half_skin {
                return true;
            }
            self.travel.walls.measured(distance);
        }
        false
    }

    fn rebuild(&mut self, segments: &Segments<'_>, moved: bool) -> Result<(), ContactError> {
        if moved {
            self.loads.clear();
        }
        let range = self.law.far.range();
        let images = self.images();
        let look = |skin: f64| search(&self.communicator, segments, &images, skin + range);
        let found = match look(self.skin) {
            // Segments have grown longer since the skin grew.
            Err(ContactError::PeriodicTooShort { .. }) if self.skin > self.settings.skin => {
                self.skin = self.settings.skin;
                look(self.skin)?
            }
            found => found?,
        };
        let skin = self.skin;
        let reach = skin + range;
        let published = if moved { self.records() } else { Vec::new() };
        let known = self.springs(|_| true);
        self.walls.rebuild(segments, reach, self.time);
        let pair_keys = found.pairs.iter().map(|pair| pair.ids);
        let wanted: Vec<[u64; 2]> = pair_keys.chain(self.walls.keys(segments.ids)).collect();
        let springs = carry(&self.communicator, known, &published, &wanted, moved);
        let (pair_springs, wall_springs) = springs.split_at(found.pairs.len());
        self.walls.set_springs(wall_springs);
        self.connect(segments, &found.pairs, pair_springs);
        self.fit_skin(segments, &found);
        self.travel = Travel::new(segments.position, found.reach);
        self.built = Some(Built {
            ids: segments.ids.to_vec(),
            time: self.time,
            skin,
        });
        self.pending.clear();
        self.totals.rebuilds += 1;
        self.totals.tests = found.tests;
        Ok(())
    }

    /// Widens the skin of the next search while the list is short, so that searches are rare, and narrows it where the
    /// list is long. Collective.
    fn fit_skin(&mut self, segments: &Segments<'_>, found: &Search) {
        if !self.settings.skin_grows {
            return;
        }
        let rank = self.communicator.rank() as u32;
        let pairs = found.pairs.iter().filter(|pair| pair.owner[0] == rank);
        let mut counts = [pairs.count() as f64, segments.count() as f64];
        self.communicator.sum_slice(&mut counts);
        let [pairs, all] = counts;
        if pairs < SHORT_LIST * all {
            let lengths = self.settings.periodic.lengths.into_iter().flatten();
            let segment = found.reach - self.skin - self.law.far.range();
            let room = ROOM * lengths.fold(f64::INFINITY, f64::min) - (found.reach - self.skin);
            let widest = segment.min(room);
            self.skin = (self.skin * SKIN_STEP).min(widest).max(self.skin);
        } else if pairs > LONG_LIST * all {
            self.skin = (self.skin / SKIN_STEP).max(self.settings.skin);
        }
    }

    /// Numbers the ghosts, and lists the pairs of every owned segment.
    fn connect(&mut self, segments: &Segments<'_>, found: &[Found], springs: &[Vector3]) {
        let (owned, rank) = (segments.count(), self.communicator.rank() as u32);
        let mut ghosts: Vec<(u32, u32)> = found.iter().flat_map(Found::places).collect();
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
        self.pairs = Pairs::new(owned, found, springs, local, self.law.far.range());
        self.halo = Halo::new(&self.communicator, owned, &ghosts);
        let shared = self.halo.total() > owned || self.halo.sent_entries() > 0;
        let room = if shared { self.halo.total() } else { 0 };
        self.ghosts.resize(room, Ghost::zeroed());
        if self.loads.count() != owned {
            self.loads = Loads::new(owned);
        }
    }

    /// Computes the contact loads and advances the friction springs by `dt`. Collective; `segments` are those of the
    /// last [`ContactSystem::update`].
    pub fn forces(&mut self, segments: &Segments<'_>, dt: f64) {
        debug_assert_eq!(segments.count(), self.loads.count());
        self.share(segments);
        self.book(segments);
        self.load_step = dt;
        self.loads.clear();
        let images = self.images();
        let bodies = Bodies {
            segments,
            ghosts: &self.ghosts,
        };
        let (law, path) = (&self.law, self.travel.pairs.length);
        let lost = self
            .pairs
            .respond(bodies, law, &images, path, dt, &self.loads);
        self.loads.gather(|segment| self.pairs.acting(segment));
        let (walls, now) = (&mut self.totals.walls, (self.time, dt));
        self.walls
            .forces(segments, law, now, &mut self.loads, walls);
        self.totals.dissipated += self.totals.walls.dissipated + lost;
        self.book(segments);
    }

    /// Books half the loss of a step: forces act in its middle, where the velocity is the mean of those before and after
    /// the kick that they give.
    fn book(&mut self, segments: &Segments<'_>) {
        let power = self.loads.drag_power(segments);
        self.totals.dissipated -= 0.5 * self.load_step * power;
    }

    /// Tells other ranks how the segments move.
    fn share(&mut self, segments: &Segments<'_>) {
        if !self.ghosts.is_empty() {
            let owned = &mut self.ghosts[..segments.count()];
            let filled = owned.par_iter_mut().enumerate();
            filled.for_each(|(i, ghost)| *ghost = Ghost::of(segments, i));
            self.halo.update(&mut self.ghosts);
        }
    }

    /// Load on an owned segment by the last [`ContactSystem::forces`]; `None` when nothing acts on it.
    #[inline]
    pub fn load(&self, segment: usize) -> Option<&SegmentLoad> {
        self.loads.get(segment).map(|acting| &acting.load)
    }

    /// Contacts of an owned segment with others in the last step.
    pub(crate) fn contacts_of(&self, segment: usize) -> usize {
        self.pairs.count(segment)
    }

    /// Largest stable step of velocity Verlet with the contacts of the last step, over all ranks \[s\]. Collective.
    ///
    /// K 3.37–3.40 with Δt = 2/ω: N contacts on a segment of mass m, lumped in halves at its ends, bound the frequency
    /// of the motion by ω² ≤ N max(4 k_n, 8 k_t)/m (the second from sliding with spin), and damping by ζ shortens the
    /// step by √(1 + ζ²) − ζ. At least two contacts are assumed, so that the step does not fall at the first touch.
    /// Together with a beam of step Δt_b: 1/Δt² = 1/Δt_b² + 1/Δt_c².
    pub fn critical_step(&self, segments: &Segments<'_>) -> f64 {
        let owned = segments.count();
        let mut touching = vec![(0u32, 0.0); owned];
        let gap = self.law.far.contact_gap();
        if owned == self.loads.count() {
            for (i, stiffness, touches) in self.walls.stiffness() {
                touching[i].0 += u32::from(touches);
                touching[i].1 += stiffness;
            }
            self.pairs.within_range(|local, overlap, stiffness| {
                for i in local.map(|i| i as usize).into_iter().filter(|&i| i < owned) {
                    touching[i].0 += u32::from(overlap > -gap);
                    touching[i].1 += stiffness;
                }
            });
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

    /// Counts the crossings of centre lines while their ends moved with their velocities to their places, both those of
    /// the last [`ContactSystem::forces`], for a time `moved` \[s\].
    pub fn count_crossings(&mut self, segments: &Segments<'_>, moved: f64) {
        let bodies = Bodies {
            segments,
            ghosts: &self.ghosts,
        };
        self.totals.crossings += self.pairs.crossings(bodies, &self.images(), moved);
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
        let (owned, gap) = (self.halo.owned(), self.law.far.contact_gap());
        let [count, stored] = self.pairs.own_sums(owned, gap);
        let walls = &self.totals.walls;
        let local = self.pairs.local.iter();
        let candidates = local.filter(|local| (local[0] as usize) < owned).count();
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
        let deepest = self.pairs.deepest().max(walls.max_overlap);
        ContactStatistics {
            contacts: sums[0] as usize,
            wall_contacts: sums[1] as usize,
            candidates: sums[2] as usize,
            max_overlap: self.communicator.max(deepest),
            stored_energy: sums[3],
            dissipated_energy: self.settled[0] + sums[4],
            wall_work: self.settled[1] + sums[6],
            crossings: (self.settled[2] + sums[7]) as usize,
            rebuilds: self.totals.rebuilds,
            tests: sums[5] as usize,
        }
    }

    /// Ends a step: books what is left of it and adds up the ranks. Collective.
    pub(crate) fn finish(&mut self, segments: &Segments<'_>) {
        self.book(segments);
        self.load_step = 0.0;
        let totals = &mut self.totals;
        let work = std::mem::take(&mut totals.walls.work);
        let (lost, crossings) = (&mut totals.dissipated, &mut totals.crossings);
        let mut sums = [std::mem::take(lost), work, std::mem::take(crossings)];
        self.communicator.sum_slice(&mut sums);
        for (settled, sum) in self.settled.iter_mut().zip(sums) {
            *settled += sum;
        }
    }

    /// Loss \[J\], work of walls \[J\] and crossings since the first step of the first run, over all ranks.
    pub fn settled(&self) -> [f64; 3] {
        self.settled
    }

    /// Takes over the sums of an earlier run.
    pub fn set_settled(&mut self, settled: [f64; 3]) {
        self.settled = settled;
    }

    /// Friction springs for a checkpoint: each contact once over all ranks, at the owner of its first segment.
    pub fn records(&self) -> Vec<FrictionRecord> {
        let owned = self.halo.owned();
        let mut records = self.springs(|local| (local[0] as usize) < owned);
        records.extend_from_slice(&self.pending);
        records
    }

    /// Takes the springs of a checkpoint; any rank may bring any of them. They reach the owners of their segments at
    /// the next [`ContactSystem::update`].
    pub fn restore_records(&mut self, records: Vec<FrictionRecord>) {
        self.pending.extend(records);
    }

    /// Friction springs become those of an earlier state of the same segments.
    pub fn replace_springs(&mut self, records: &[FrictionRecord]) {
        self.pending.clear();
        if records.is_empty() && self.springs(|_| true).is_empty() {
            return;
        }
        self.pairs
            .springs_mut()
            .for_each(|spring| *spring = Vector3::zeros());
        self.walls
            .springs_mut()
            .for_each(|spring| *spring = Vector3::zeros());
        self.pending.extend_from_slice(records);
    }

    fn springs(&self, chosen: impl Fn(&[u32; 2]) -> bool) -> Vec<FrictionRecord> {
        let record = |([a, b], spring): ([u64; 2], &Vector3)| FrictionRecord {
            a,
            b,
            spring: (*spring).into(),
        };
        let pairs = self.pairs.ids.iter().copied().zip(self.pairs.springs());
        let chosen = pairs
            .zip(&self.pairs.local)
            .filter(|(_, local)| chosen(local));
        let ids = self.built.as_ref().map_or(&[][..], |built| &built.ids);
        let walls = self.walls.keys(ids).zip(self.walls.springs());
        let all = chosen.map(|(pair, _)| pair).chain(walls).map(record);
        all.filter(|r| r.spring != [0.0; 3]).collect()
    }
}

mod joint;

#[cfg(test)]
mod tests;
