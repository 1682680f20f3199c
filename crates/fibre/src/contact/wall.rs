//! Contacts of segments with planes, pipes and triangulated surfaces, at rest or moving.

use crate::contact::facets::{Facets, Flaw, Near};
use crate::contact::far::Facing;
use crate::contact::law::{Law, Touch};
use crate::contact::linear::{Linear, Passed, Sway};
use crate::contact::loads::Loads;
use crate::contact::{ContactError, Segments};
use crate::{PeriodicBox, Vector3};

/// Marks the second id of a friction record as a wall.
const WALL_BIT: u64 = 1 << 63;

/// A surface that holds fibres.
#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    /// Where it is at time 0 of the contacts.
    pub surface: Surface,
    /// Its velocity \[m/s\]; it does not turn.
    pub velocity: Vector3,
    /// How its surface moves in itself besides.
    pub motion: SurfaceMotion,
}

/// Motion of a surface in itself, which moves fibres by friction and lubrication but leaves the wall where it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum SurfaceMotion {
    /// None.
    #[default]
    Rest,
    /// The same velocity everywhere \[m/s\].
    Sliding(Vector3),
    /// About an axis.
    Turning {
        /// A point of the axis \[m\].
        point: Vector3,
        /// Angular velocity \[rad/s\].
        spin: Vector3,
    },
}

impl SurfaceMotion {
    fn at(&self, x: &Vector3) -> Vector3 {
        match self {
            Self::Rest => Vector3::zeros(),
            Self::Sliding(velocity) => *velocity,
            Self::Turning { point, spin } => spin.cross(&(x - point)),
        }
    }

    fn is_finite(&self) -> bool {
        self.at(&Vector3::new(1.0, 2.0, 3.0)).sum().is_finite()
    }
}

/// Form of a wall.
#[derive(Clone, Debug, PartialEq)]
pub enum Surface {
    /// A plane.
    Plane {
        /// A point of it \[m\].
        point: Vector3,
        /// Normal to the fibres' side; any length.
        normal: Vector3,
    },
    /// The inside of a round pipe.
    Pipe {
        /// A point of its axis \[m\].
        point: Vector3,
        /// Direction of its axis; any length.
        axis: Vector3,
        /// \[m\]
        radius: f64,
    },
    /// Triangles whose normals (right-hand rule) point to the fibres' side; corners that coincide are one, also across a
    /// period. The rim of an open surface holds nothing.
    Facets(Vec<[Vector3; 3]>),
}

impl Wall {
    /// A plane at rest.
    pub fn plane(point: Vector3, normal: Vector3) -> Self {
        Self::fixed(Surface::Plane { point, normal })
    }

    /// The inside of a pipe at rest.
    pub fn pipe(point: Vector3, axis: Vector3, radius: f64) -> Self {
        Self::fixed(Surface::Pipe {
            point,
            axis,
            radius,
        })
    }

    /// Triangles at rest.
    pub fn facets(triangles: Vec<[Vector3; 3]>) -> Self {
        Self::fixed(Surface::Facets(triangles))
    }

    fn fixed(surface: Surface) -> Self {
        Self {
            surface,
            velocity: Vector3::zeros(),
            motion: SurfaceMotion::Rest,
        }
    }
}

/// Contacts between the owned segments and the walls.
///
/// A segment touches a wall with the spheres at its two ends, each with half the stiffness. That is the trapezoidal
/// rule for a contact along the axis: a segment that lies flat has the full stiffness, does not rock, and the force is
/// continuous when it tilts. In between it touches only edges and corners that protrude, with the full stiffness.
#[derive(Clone, Debug, Default)]
pub(super) struct WallContacts {
    walls: Vec<Checked>,
    /// In ascending order of segment and item.
    candidates: Vec<Candidate>,
    /// Candidates of a segment with one wall.
    groups: Vec<std::ops::Range<u32>>,
    /// Contacts in the implicit integrator's present iteration.
    linear: Vec<Joined>,
    scratch: Scratch,
}

#[derive(Clone, Debug)]
struct Checked {
    form: Form,
    velocity: Vector3,
    motion: SurfaceMotion,
    /// Number of its first item; a plane or pipe has one, a triangulated surface has its faces and edges.
    first_item: u32,
}

#[derive(Clone, Debug)]
enum Form {
    Plane {
        point: Vector3,
        normal: Vector3,
    },
    Pipe {
        point: Vector3,
        axis: Vector3,
        radius: f64,
    },
    Facets(Facets),
}

#[derive(Clone, Copy, Debug)]
struct Candidate {
    segment: u32,
    wall: u32,
    /// Item of the wall.
    item: u32,
    /// Period to subtract from the segment \[m\].
    shift: Vector3,
    springs: [Vector3; 2],
    overlap: f64,
    /// Bound of the stiffness of forces at a distance \[N/m\].
    far_stiffness: f64,
}

#[derive(Clone, Debug, Default)]
struct Scratch {
    around: Vec<(u32, Vector3)>,
    items: Vec<(u32, [Vector3; 2])>,
    near: Vec<Option<Near>>,
}

/// A contact in the implicit integrator's present iteration.
#[derive(Clone, Debug)]
struct Joined {
    candidate: u32,
    slot: u32,
    contact: Linear,
    /// Velocity of the wall's surface \[m/s\].
    surface: Vector3,
}

/// How a segment meets an item of a wall.
struct Meeting {
    touch: Touch,
    /// Place on the segment's axis.
    at: f64,
    /// Lever to the contact \[m\].
    arm: Vector3,
    /// Velocity of the wall's surface \[m/s\].
    surface: Vector3,
}

/// What the walls did in the last step.
#[derive(Clone, Debug, Default)]
pub(super) struct WallTotals {
    pub contacts: usize,
    pub max_overlap: f64,
    pub stored: f64,
    pub dissipated: f64,
    /// Work of moving walls on the fibres \[J\].
    pub work: f64,
    /// Force of the fibres on each wall \[N\].
    pub force: Vec<Vector3>,
}

impl WallTotals {
    /// Clears all but the work.
    fn restart(&mut self, walls: usize) {
        let work = self.work;
        *self = Self {
            work,
            force: std::mem::take(&mut self.force),
            ..Self::default()
        };
        self.force.clear();
        self.force.resize(walls, Vector3::zeros());
    }
}

impl WallContacts {
    pub fn new(walls: &[Wall], periodic: &PeriodicBox) -> Result<Self, ContactError> {
        let mut checked = Vec::with_capacity(walls.len());
        let mut first_item = 0;
        for (index, wall) in walls.iter().enumerate() {
            let form = form(wall, periodic);
            let form = form.map_err(|reason| ContactError::Wall { index, reason })?;
            let items = match &form {
                Form::Facets(facets) => facets.items(),
                _ => 1,
            };
            checked.push(Checked {
                form,
                velocity: wall.velocity,
                motion: wall.motion,
                first_item,
            });
            first_item += items as u32;
        }
        Ok(Self {
            walls: checked,
            ..Self::default()
        })
    }

    /// Speed of the fastest wall \[m/s\].
    pub fn speed(&self) -> f64 {
        let speeds = self.walls.iter().map(|wall| wall.velocity.norm());
        speeds.fold(0.0, f64::max)
    }

    /// How much nearer to any wall a node can be that has moved so \[m\].
    pub fn nearer(&self, moved: &Vector3) -> f64 {
        let by = self.walls.iter().map(|wall| match &wall.form {
            Form::Plane { normal, .. } => normal.dot(moved).abs(),
            Form::Pipe { axis, .. } => (moved - axis * axis.dot(moved)).norm(),
            Form::Facets(_) => moved.norm(),
        });
        by.fold(0.0, |most: f64, x| if x <= most { most } else { x })
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.walls.is_empty()
    }

    /// Lists the segments within `reach` of a wall after `time`, without springs.
    pub fn rebuild(&mut self, segments: &Segments<'_>, reach: f64, time: f64) {
        self.candidates.clear();
        self.groups.clear();
        for segment in 0..segments.count() {
            let reach = segments.radius[segment] + reach;
            for (index, wall) in self.walls.iter().enumerate() {
                let moved = wall.velocity * time;
                let axis = segments.ends(segment).map(|x| x - moved);
                let found = &mut self.scratch.around;
                wall.around(&axis, reach, found);
                let first = self.candidates.len() as u32;
                self.candidates
                    .extend(found.iter().map(|&(item, shift)| Candidate {
                        segment: segment as u32,
                        wall: index as u32,
                        item,
                        shift,
                        springs: [Vector3::zeros(); 2],
                        overlap: 0.0,
                        far_stiffness: 0.0,
                    }));
                let group = first..self.candidates.len() as u32;
                if !group.is_empty() {
                    self.groups.push(group);
                }
            }
        }
    }

    /// Keys of the friction springs, in the order of [`WallContacts::springs`].
    pub fn keys(&self, ids: &[u64]) -> impl Iterator<Item = [u64; 2]> {
        self.candidates.iter().flat_map(move |c| {
            let item = self.walls[c.wall as usize].first_item + c.item;
            let wall = WALL_BIT | u64::from(item) << 1;
            [0, 1].map(|end| [ids[c.segment as usize], wall | end])
        })
    }

    pub fn springs(&self) -> impl Iterator<Item = &Vector3> {
        self.candidates.iter().flat_map(|c| &c.springs)
    }

    pub fn set_springs(&mut self, springs: &[Vector3]) {
        let slots = self.springs_mut();
        slots
            .zip(springs)
            .for_each(|(slot, spring)| *slot = *spring);
    }

    pub fn springs_mut(&mut self) -> impl Iterator<Item = &mut Vector3> {
        self.candidates.iter_mut().flat_map(|c| &mut c.springs)
    }

    /// Adds the wall forces of a step `dt` to the loads; `time` is that since the walls were where the settings put them.
    pub fn forces(
        &mut self,
        segments: &Segments<'_>,
        law: &Law,
        (time, dt): (f64, f64),
        loads: &mut Loads,
        totals: &mut WallTotals,
    ) {
        totals.restart(self.walls.len());
        for group in &self.groups {
            let group = &mut self.candidates[group.start as usize..group.end as usize];
            let wall = &self.walls[group[0].wall as usize];
            group.iter_mut().for_each(|c| {
                c.overlap = 0.0;
                c.far_stiffness = 0.0;
            });
            let step = Step {
                segments,
                law,
                dt,
                moved: wall.velocity * time,
            };
            for slot in 0..2 {
                wall.touch(group, &step, slot, &mut self.scratch);
                wall.hand_over(group, slot, &self.scratch.near);
                step.press(wall, group, slot, &self.scratch.near, loads, totals);
            }
        }
    }

    /// As [`WallContacts::forces`] at the end of a step of length `dt` in which the segments swayed, without any change
    /// of springs and totals: these follow with [`WallContacts::commit`].
    pub fn linearise(
        &mut self,
        segments: &Segments<'_>,
        law: &Law,
        sway: &[Sway],
        time: f64,
        dt: f64,
        loads: &mut Loads,
    ) {
        self.linear.clear();
        for group in &self.groups {
            let first = group.start;
            let group = &self.candidates[group.start as usize..group.end as usize];
            let wall = &self.walls[group[0].wall as usize];
            let i = group[0].segment as usize;
            let step = Step {
                segments,
                law,
                dt,
                moved: wall.velocity * time,
            };
            for slot in 0..2 {
                wall.touch(group, &step, slot, &mut self.scratch);
                for (k, (candidate, near)) in group.iter().zip(&self.scratch.near).enumerate() {
                    let Some(meeting) = step.meet(wall, i, near.as_ref()) else {
                        continue;
                    };
                    let Meeting {
                        touch,
                        at,
                        arm,
                        surface,
                    } = meeting;
                    let passed = Passed {
                        slip: sway[i].at(at, &arm) - surface * dt,
                        time: dt,
                    };
                    let linear = Linear {
                        at: [at, 0.0],
                        arms: [arm, Vector3::zeros()],
                        ..law.linearise(&touch, &passed, &candidate.springs[slot])
                    };
                    linear.load(0, &linear.force, &mut loads.at(i).load);
                    self.linear.push(Joined {
                        candidate: first + k as u32,
                        slot: slot as u32,
                        contact: linear,
                        surface,
                    });
                }
            }
        }
    }

    /// Adds what the loads of [`WallContacts::linearise`] change by with `sway`.
    pub fn add_change(&self, sway: &[Sway], loads: &mut Loads) {
        for joined in &self.linear {
            let linear = &joined.contact;
            let i = self.candidates[joined.candidate as usize].segment as usize;
            let own = sway[i].at(linear.at[0], &linear.arms[0]);
            linear.load(0, &(linear.stiffness * -own), &mut loads.at(i).load);
        }
    }

    /// Takes the contacts of [`WallContacts::linearise`] for those of a finished step of length `dt`.
    pub fn commit(&mut self, law: &Law, dt: f64, totals: &mut WallTotals) {
        totals.restart(self.walls.len());
        for candidate in &mut self.candidates {
            candidate.springs = [Vector3::zeros(); 2];
            candidate.overlap = 0.0;
            candidate.far_stiffness = 0.0;
        }
        for joined in &self.linear {
            let linear = &joined.contact;
            let candidate = &mut self.candidates[joined.candidate as usize];
            let wall = candidate.wall as usize;
            candidate.springs[joined.slot as usize] = linear.spring;
            candidate.overlap = candidate.overlap.max(linear.overlap);
            totals.contacts += usize::from(linear.overlap > -law.far.contact_gap());
            totals.max_overlap = totals.max_overlap.max(linear.overlap);
            totals.stored += linear.stored;
            totals.dissipated += linear.dissipated;
            totals.work += linear.force.dot(&joined.surface) * dt;
            totals.force[wall] -= linear.force;
        }
    }

    /// (segment, bound of the stiffness of forces at a distance, whether it touches) of each candidate.
    pub fn stiffness(&self) -> impl Iterator<Item = (usize, f64, bool)> {
        let each = |c: &Candidate| (c.segment as usize, c.far_stiffness, c.overlap > 0.0);
        self.candidates.iter().map(each)
    }
}

/// What all walls need to know in a step.
struct Step<'a> {
    segments: &'a Segments<'a>,
    law: &'a Law,
    dt: f64,
    /// How far the wall has moved \[m\].
    moved: Vector3,
}

impl Step<'_> {
    /// How a segment meets an item of the wall; none out of range.
    fn meet(&self, wall: &Checked, segment: usize, near: Option<&Near>) -> Option<Meeting> {
        let Self { segments, law, .. } = self;
        let (i, near) = (segment, near?);
        let radius = segments.radius[i];
        let overlap = radius - near.height;
        if overlap <= -law.far.range() || near.height <= -wall.depth(radius) {
            return None;
        }
        let inside = near.at > 0.0 && near.at < 1.0;
        let share = if inside { 1.0 } else { 0.5 };
        let arm = -near.normal * (radius - overlap.max(0.0));
        let spin = segments.spin(i);
        let [first, second] = segments.end_velocities(i);
        let velocity = first + (second - first) * near.at + spin.cross(&arm);
        let [start, end] = segments.ends(i);
        let length = (end - start).norm();
        let place = start + (end - start) * near.at + arm;
        let surface = wall.velocity + wall.motion.at(&place);
        let touch = Touch {
            normal: -near.normal,
            overlap,
            velocity: velocity - surface,
            spin: 0.5 * spin,
            mass: if inside {
                let (a, b) = (1.0 - near.at, near.at);
                0.5 * segments.mass[i] / (a * a + b * b)
            } else {
                0.5 * segments.mass[i]
            },
            share,
            rub_share: share,
            facing: (law.far.range() > 0.0).then(|| Facing::plane(radius, length)),
        };
        Some(Meeting {
            touch,
            at: near.at,
            arm,
            surface,
        })
    }

    /// Forces of one slot of a segment: its ends, or the inside with edges.
    fn press(
        &self,
        wall: &Checked,
        group: &mut [Candidate],
        slot: usize,
        near: &[Option<Near>],
        loads: &mut Loads,
        totals: &mut WallTotals,
    ) {
        let Self { law, dt, .. } = self;
        let i = group[0].segment as usize;
        for (candidate, near) in group.iter_mut().zip(near) {
            let Some(meeting) = self.meet(wall, i, near.as_ref()) else {
                candidate.springs[slot] = Vector3::zeros();
                continue;
            };
            let Meeting {
                touch,
                at,
                arm,
                surface,
            } = meeting;
            let overlap = touch.overlap;
            let response = law.respond(&touch, &mut candidate.springs[slot], *dt);
            let acting = loads.at(i);
            acting.load.add(&response.force, at, &arm);
            acting.drag.add(&response.drag, at, &arm);
            candidate.overlap = candidate.overlap.max(overlap);
            candidate.far_stiffness += response.far_stiffness;
            totals.contacts += usize::from(overlap > -law.far.contact_gap());
            totals.max_overlap = totals.max_overlap.max(overlap);
            totals.stored += response.stored;
            totals.dissipated += response.dissipated + response.drag.dot(&surface) * dt;
            totals.work += response.force.dot(&surface) * dt;
            totals.force[candidate.wall as usize] -= response.force;
        }
    }
}

impl Checked {
    /// Items within `reach` of an axis given in the wall's frame.
    fn around(&self, axis: &[Vector3; 2], reach: f64, out: &mut Vec<(u32, Vector3)>) {
        match &self.form {
            Form::Facets(facets) => facets.around(axis, reach, out),
            _ => {
                out.clear();
                if axis.iter().any(|x| self.near(x).1 < reach) {
                    out.push((0, Vector3::zeros()));
                }
            }
        }
    }

    /// How far the axis may be behind the surface \[m\]; facets end somewhere.
    fn depth(&self, radius: f64) -> f64 {
        match self.form {
            Form::Facets(_) => radius,
            _ => f64::INFINITY,
        }
    }

    /// Normal and height at an end of a segment, on a plane or in a pipe.
    fn near(&self, x: &Vector3) -> (Vector3, f64) {
        match &self.form {
            Form::Plane { point, normal } => (*normal, (x - point).dot(normal)),
            Form::Pipe {
                point,
                axis,
                radius,
            } => {
                let from_axis = (x - point) - axis * (x - point).dot(axis);
                let distance = from_axis.norm();
                let normal = if distance > 1e-12 * radius {
                    -from_axis / distance
                } else {
                    Vector3::zeros()
                };
                (normal, radius - distance)
            }
            Form::Facets(_) => (Vector3::zeros(), f64::INFINITY),
        }
    }

    /// What a slot of a segment touches, one entry a candidate.
    fn touch(&self, group: &[Candidate], step: &Step<'_>, slot: usize, scratch: &mut Scratch) {
        let i = group[0].segment as usize;
        let axis = step.segments.ends(i).map(|x| x - step.moved);
        match &self.form {
            Form::Facets(facets) => {
                let items = &mut scratch.items;
                items.clear();
                items.extend(group.iter().map(|c| (c.item, axis.map(|x| x - c.shift))));
                facets.touch(items, slot, &mut scratch.near);
            }
            _ => {
                let (normal, height) = self.near(&axis[slot]);
                let near = Near::smooth(normal, height, slot as f64);
                scratch.near.clear();
                scratch.near.push(Some(near));
            }
        }
    }

    /// A friction spring follows the contact from one facet to its neighbour.
    fn hand_over(&self, group: &mut [Candidate], slot: usize, near: &[Option<Near>]) {
        let Form::Facets(facets) = &self.form else {
            return;
        };
        let fresh = |c: &Candidate| c.springs[slot] == Vector3::zeros();
        for k in 0..group.len() {
            if near[k].is_none() || !fresh(&group[k]) {
                continue;
            }
            let left = (0..group.len()).find(|&m| {
                let beside = facets.adjacent(group[m].item, group[k].item);
                near[m].is_none() && beside && !fresh(&group[m])
            });
            if let Some(m) = left {
                group[k].springs[slot] = group[m].springs[slot];
                group[m].springs[slot] = Vector3::zeros();
            }
        }
    }
}

/// Checks a wall and normalises its directions.
fn form(wall: &Wall, periodic: &PeriodicBox) -> Result<Form, &'static str> {
    if !(wall.velocity.sum().is_finite() && wall.motion.is_finite()) {
        return Err("its velocity is not finite");
    }
    let repeats = |axis: usize| periodic.lengths[axis].is_some();
    let unit = |v: &Vector3| {
        let unit = v.try_normalize(0.0);
        unit.filter(|n| n.iter().all(|x| x.is_finite()))
    };
    match &wall.surface {
        Surface::Plane { point, normal } => {
            let normal = unit(normal).ok_or("its normal has no direction")?;
            if (0..3).any(|i| repeats(i) && normal[i].abs() > 1e-12) {
                return Err("its normal points along a periodic direction");
            }
            Ok(Form::Plane {
                point: *point,
                normal,
            })
        }
        Surface::Pipe {
            point,
            axis,
            radius,
        } => {
            let axis = unit(axis).ok_or("its axis has no direction")?;
            if (0..3).any(|i| repeats(i) && axis[i].abs() < 1.0 - 1e-12) {
                return Err("a direction across its axis is periodic");
            }
            if !(*radius > 0.0 && radius.is_finite()) {
                return Err("its radius is not a positive length");
            }
            Ok(Form::Pipe {
                point: *point,
                axis,
                radius: *radius,
            })
        }
        Surface::Facets(triangles) => {
            let facets = Facets::new(triangles, periodic);
            let facets = facets.map_err(|flaw| match flaw {
                Flaw::Empty => "it has no facets, or one that is not finite",
                Flaw::NoArea => "one of its facets has no area",
                Flaw::ManyFaces => "an edge has more than two facets",
            })?;
            Ok(Form::Facets(facets))
        }
    }
}

#[cfg(test)]
mod tests;
