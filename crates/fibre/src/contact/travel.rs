//! How far the nodes have moved, so that neither the list of pairs nor a pair is looked at before it can matter.

use crate::Vector3;
use rayon::prelude::*;

/// Nodes that one thread takes at least.
const GRAIN: usize = 2048;
/// Keeps round-off of a path on the safe side.
const SHORTER: f64 = 1.0 - 1e-6;

/// Positions and path since the last search for pairs.
///
/// In a sheared box, images keep their places in a frame that is sheared along: there, a node that keeps its speed
/// γ̇ y with the y it had at the search does not move, and two that were within `reach` of each other part or meet by
/// no more than the strain times that.
#[derive(Default)]
pub(crate) struct Travel {
    /// Nodes at the search.
    start: Vec<Vector3>,
    /// Nodes at the last step.
    last: Vec<Vector3>,
    /// Strain of the box at the last step since the search.
    strain: f64,
    /// Longest segment with its caps and all that is added to it \[m\].
    reach: f64,
    /// No pair has come nearer than by twice this since the search \[m\].
    pub path: f64,
    /// Path at which the distances from the start are to be measured again.
    check: f64,
}

impl Travel {
    pub fn new(position: &[Vector3], reach: f64) -> Self {
        Self {
            start: position.to_vec(),
            last: position.to_vec(),
            reach,
            ..Self::default()
        }
    }

    /// Half of how much nearer a pair can have come since the last call \[m\], when the strain since the search is
    /// `strain`; infinite when a position is not finite.
    pub fn step(&mut self, position: &[Vector3], strain: f64) -> f64 {
        let more = strain - self.strain;
        self.strain = strain;
        let last = self.last.par_chunks_mut(GRAIN);
        let nodes = last.zip(position.par_chunks(GRAIN));
        let largest = if more == 0.0 {
            let blocks = nodes.map(|(last, now)| {
                let mut largest = 0.0;
                for (last, now) in last.iter_mut().zip(now) {
                    largest = larger(largest, (now - *last).norm_squared());
                    *last = *now;
                }
                largest
            });
            blocks.reduce(|| 0.0, larger)
        } else {
            let blocks = nodes.zip(self.start.par_chunks(GRAIN));
            let blocks = blocks.map(|((last, now), start)| {
                let mut largest = 0.0;
                for ((last, now), start) in last.iter_mut().zip(now).zip(start) {
                    largest = larger(largest, (now - *last - along(more, start)).norm_squared());
                    *last = *now;
                }
                largest
            });
            blocks.reduce(|| 0.0, larger)
        };
        largest.sqrt() + 0.5 * more.abs() * self.reach
    }

    /// Half of how much nearer a pair can have come since the search \[m\], from where the nodes are.
    pub fn distance(&self, position: &[Vector3]) -> f64 {
        let start = self.start.par_chunks(GRAIN);
        let largest = start.zip(position.par_chunks(GRAIN)).map(|(start, now)| {
            let moved = start.iter().zip(now);
            let moved = moved.map(|(a, b)| (b - a - along(self.strain, a)).norm_squared());
            moved.fold(0.0, larger)
        });
        largest.reduce(|| 0.0, larger).sqrt() + 0.5 * self.strain.abs() * self.reach
    }

    /// Whether [`Travel::distance`] can have reached half of the skin.
    pub fn due(&self, half_skin: f64) -> bool {
        self.path >= self.check + half_skin * SHORTER
    }

    /// Puts the next measurement off, given the distance now.
    pub fn measured(&mut self, distance: f64) {
        self.check = self.path - distance;
    }
}

/// Displacement with the shear of a node that started at `start`.
#[inline(always)]
fn along(strain: f64, start: &Vector3) -> Vector3 {
    Vector3::new(strain * start.y, 0.0, 0.0)
}

/// The path for which a pair that is `gap` out of range stays so \[m\].
pub(crate) fn rest(gap: f64) -> f64 {
    0.5 * SHORTER * gap.max(0.0)
}

/// The larger of two squares; what is not finite is infinite.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if b <= a {
        a
    } else if b < f64::INFINITY {
        b
    } else {
        f64::INFINITY
    }
}
