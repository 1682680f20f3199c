//! Grips: planes that hold the fibres that cross them and move apart (S 2.11.2).

use super::cone::LEAST;
use super::joints::{Workspace, hold};
use super::system::{Chain, Segment};
use crate::{FibreError, Vector3};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Two planes across an axis that move apart and take along the points in which fibres cross them at the start: along the axis these move as
/// the planes do (S 2.109), otherwise they are free.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grips {
    /// Direction of the axis; any length.
    pub axis: Vector3,
    /// Places of the planes along it at the start \[m\], the lower one first.
    pub planes: [f64; 2],
    /// Speed of each, away from the other \[m/s\].
    pub speed: f64,
}

impl Grips {
    /// Speed of a plane along the axis \[m/s\].
    pub fn speed_of(&self, plane: usize) -> f64 {
        if plane == 0 { -self.speed } else { self.speed }
    }

    /// Place of a plane at a time \[m\].
    pub fn place(&self, plane: usize, time: f64) -> f64 {
        self.planes[plane] + self.speed_of(plane) * time
    }

    pub(super) fn check(&self) -> Result<Self, FibreError> {
        let axis = self.axis.try_normalize(0.0);
        let [low, high] = self.planes;
        for (setting, value, good, requirement) in [
            (
                "axis of the grips",
                self.axis.norm(),
                axis.is_some_and(|a| a.sum().is_finite()),
                "a direction",
            ),
            (
                "lower plane of the grips",
                low,
                low < high && high.is_finite(),
                "below the upper one",
            ),
            (
                "speed of the grips",
                self.speed,
                self.speed.is_finite(),
                "finite",
            ),
        ] {
            if !good {
                return Err(FibreError::Setting {
                    setting,
                    value,
                    requirement,
                });
            }
        }
        let axis = axis.unwrap_or_default();
        Ok(Self { axis, ..*self })
    }

    /// Where segments cross the planes at the start, in the order of the segments.
    pub(super) fn find(&self, chains: &[Chain], segments: &[Segment]) -> Vec<Grip> {
        let mut found = Vec::new();
        for s in segments {
            let half = chains[s.chain as usize].half_length;
            let (middle, slope) = (self.axis.dot(&s.centre), self.axis.dot(&s.axis));
            for (plane, place) in self.planes.iter().enumerate() {
                let [first, last] = [-half, half].map(|x| middle + slope * x >= *place);
                if first != last {
                    found.push(Grip {
                        segment: s.index,
                        plane: plane as u8,
                        along: ((place - middle) / slope).clamp(-half, half),
                        force: 0.0,
                    });
                }
            }
        }
        found
    }
}

/// A point of a fibre that a plane holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    /// Index of the segment.
    pub segment: u32,
    /// 0 for the lower plane, 1 for the upper one.
    pub plane: u8,
    /// Place on the segment from its centre, ν of S 2.108 \[m\].
    pub along: f64,
    /// Force on the segment along the axis in the last step, F^p \[N\].
    pub force: f64,
}

/// Adds what the grips' forces do to the motion of the segments.
pub(super) fn load(axis: &Vector3, grips: &[Grip], chains: &[Chain], segments: &mut [Segment]) {
    for grip in grips {
        let s = &mut segments[grip.segment as usize];
        push(axis, grip, grip.force, &chains[s.chain as usize], s);
    }
}

fn push(axis: &Vector3, grip: &Grip, force: f64, chain: &Chain, s: &mut Segment) {
    let force = axis * force;
    let lever = s.axis * grip.along;
    s.velocity += chain.mobility.velocity(&s.axis, &force);
    s.spin += chain.mobility.spin(&s.axis, &lever.cross(&force));
}

/// Forces of the grips on segments that move with the free velocities and spins that they hold: together with the forces in the joints
/// (S 2.114), which follow then.
pub(super) fn solve(
    grips: &mut [Grip],
    about: &Grips,
    chains: &[Chain],
    segments: &[Segment],
    offsets: &[usize],
) {
    let chain = |grip: &Grip| segments[grip.segment as usize].chain;
    let mut fibres: Vec<&mut [Grip]> = grips.chunk_by_mut(|a, b| chain(a) == chain(b)).collect();
    fibres.par_iter_mut().with_min_len(16).for_each(|own| {
        let f = chain(&own[0]) as usize;
        let (first, end) = (offsets[f], offsets[f + 1]);
        fibre(own, about, &chains[f], first, &segments[first..end]);
    });
}

/// The forces on one fibre, whose first segment is number `first`.
fn fibre(grips: &mut [Grip], about: &Grips, chain: &Chain, first: usize, segments: &[Segment]) {
    let own = |grip: &Grip| grip.segment as usize - first;
    let mut work = Workspace::default();
    let speeds = |grips: &[Grip], segments: &[Segment]| -> DVector<f64> {
        DVector::from_iterator(
            grips.len(),
            grips.iter().map(|grip| {
                let s = &segments[own(grip)];
                let velocity = s.velocity + s.spin.cross(&(s.axis * grip.along));
                about.axis.dot(&velocity)
            }),
        )
    };
    let mut free = segments.to_vec();
    hold(chain, &mut free, &mut work);
    let missing = DVector::from_iterator(
        grips.len(),
        grips.iter().map(|g| about.speed_of(g.plane as usize)),
    ) - speeds(grips, &free);
    let mut answers = DMatrix::zeros(grips.len(), grips.len());
    for (k, grip) in grips.iter().enumerate() {
        let mut moved = segments.to_vec();
        for s in &mut moved {
            (s.velocity, s.spin) = (Vector3::zeros(), Vector3::zeros());
        }
        push(&about.axis, grip, 1.0, chain, &mut moved[own(grip)]);
        hold(chain, &mut moved, &mut work);
        answers.set_column(k, &speeds(grips, &moved));
    }
    // A taut fibre between both planes would need boundless forces: the small ones on the diagonal bound them.
    let least = LEAST * answers.trace();
    for k in 0..grips.len() {
        answers[(k, k)] += least;
    }
    if let Some(forces) = answers.lu().solve(&missing) {
        for (grip, force) in grips.iter_mut().zip(forces.iter()) {
            grip.force = *force;
        }
    }
}
