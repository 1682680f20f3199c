//! Contacts of segments with planes.

use crate::contact::law::{Law, Touch};
use crate::contact::{ContactError, SegmentLoad, Segments};
use crate::{PeriodicBox, Vector3};

/// Marks the second id of a friction record as a wall.
const WALL_BIT: u64 = 1 << 63;

/// A plane; fibres are on the side its normal points to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// A point of the plane \[m\].
    pub point: Vector3,
    /// Normal into the domain; any length.
    pub normal: Vector3,
}

/// Contacts between the owned segments and the walls.
///
/// A segment touches a plane with the spheres at its two ends, each with half the stiffness. That is the trapezoidal
/// rule for a contact along the axis: a segment that lies flat has the full stiffness, does not rock, and the force is
/// continuous when it tilts.
#[derive(Clone, Debug, Default)]
pub(super) struct WallContacts {
    walls: Vec<Wall>,
    candidates: Vec<Candidate>,
}

#[derive(Clone, Copy, Debug)]
struct Candidate {
    segment: u32,
    wall: u32,
    springs: [Vector3; 2],
    overlap: f64,
}

/// What the walls did in the last step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WallTotals {
    pub contacts: usize,
    pub max_overlap: f64,
    pub stored: f64,
    pub dissipated: f64,
}

impl WallContacts {
    pub fn new(walls: &[Wall], periodic: &PeriodicBox) -> Result<Self, ContactError> {
        let mut unit = Vec::with_capacity(walls.len());
        for (index, wall) in walls.iter().enumerate() {
            let normal = wall
                .normal
                .try_normalize(0.0)
                .filter(|n| n.iter().all(|x| x.is_finite()));
            let reason = match normal {
                None => "its normal has no direction",
                Some(n) if (0..3).any(|i| periodic.lengths[i].is_some() && n[i].abs() > 1e-12) => {
                    "its normal points along a periodic direction"
                }
                Some(normal) => {
                    unit.push(Wall { normal, ..*wall });
                    continue;
                }
            };
            return Err(ContactError::Wall { index, reason });
        }
        Ok(Self {
            walls: unit,
            candidates: Vec::new(),
        })
    }

    /// Lists the segments within `skin` of a wall, without springs.
    pub fn rebuild(&mut self, segments: &Segments<'_>, skin: f64) {
        self.candidates.clear();
        for segment in 0..segments.ids.len() {
            for (index, wall) in self.walls.iter().enumerate() {
                let height = |x: &Vector3| (x - wall.point).dot(&wall.normal);
                let lowest = height(&segments.start[segment]).min(height(&segments.end[segment]));
                if lowest < segments.radius[segment] + skin {
                    self.candidates.push(Candidate {
                        segment: segment as u32,
                        wall: index as u32,
                        springs: [Vector3::zeros(); 2],
                        overlap: 0.0,
                    });
                }
            }
        }
    }

    /// Keys of the friction springs, in the order of [`WallContacts::springs`].
    pub fn keys(&self, ids: &[u64]) -> impl Iterator<Item = [u64; 2]> {
        self.candidates.iter().flat_map(move |c| {
            let wall = WALL_BIT | u64::from(c.wall) << 1;
            [0, 1].map(|end| [ids[c.segment as usize], wall | end])
        })
    }

    pub fn springs(&self) -> impl Iterator<Item = &Vector3> {
        self.candidates.iter().flat_map(|c| &c.springs)
    }

    pub fn set_springs(&mut self, springs: &[Vector3]) {
        let slots = self.candidates.iter_mut().flat_map(|c| &mut c.springs);
        slots
            .zip(springs)
            .for_each(|(slot, spring)| *slot = *spring);
    }

    /// Adds the wall forces of a step to the loads.
    pub fn forces(
        &mut self,
        segments: &Segments<'_>,
        law: &Law,
        dt: f64,
        loads: &mut [SegmentLoad],
    ) -> WallTotals {
        let mut totals = WallTotals::default();
        for candidate in &mut self.candidates {
            let i = candidate.segment as usize;
            let wall = &self.walls[candidate.wall as usize];
            let ends = [
                (segments.start[i], segments.start_velocity[i]),
                (segments.end[i], segments.end_velocity[i]),
            ];
            candidate.overlap = 0.0;
            for (end, (position, velocity)) in ends.iter().enumerate() {
                let overlap = segments.radius[i] - (position - wall.point).dot(&wall.normal);
                if overlap <= 0.0 {
                    candidate.springs[end] = Vector3::zeros();
                    continue;
                }
                let arm = -wall.normal * (segments.radius[i] - overlap);
                let spin = segments.angular_velocity[i];
                let touch = Touch {
                    normal: -wall.normal,
                    overlap,
                    velocity: velocity + spin.cross(&arm),
                    spin: 0.5 * spin,
                    mass: 0.5 * segments.mass[i],
                    share: 0.5,
                };
                let response = law.respond(&touch, &mut candidate.springs[end], dt);
                loads[i].add(&response.force, end as f64, &arm);
                candidate.overlap = candidate.overlap.max(overlap);
                totals.contacts += 1;
                totals.max_overlap = totals.max_overlap.max(overlap);
                totals.stored += response.stored;
                totals.dissipated += response.dissipated;
            }
        }
        totals
    }

    /// Walls that each owned segment touched in the last step, as segment indices with repetition.
    pub fn touched(&self) -> impl Iterator<Item = usize> {
        let touching = self.candidates.iter().filter(|c| c.overlap > 0.0);
        touching.map(|c| c.segment as usize)
    }
}
