//! How far the nodes have moved, so that neither the list of pairs nor a pair is looked at before it can matter.

use crate::Vector3;
use fibreflow_parallel::Communicator;
use rayon::prelude::*;

/// Nodes that one thread takes at least.
const GRAIN: usize = 2048;
/// Keeps round-off of a path on the safe side.
const SHORTER: f64 = 1.0 - 1e-6;

/// Positions and paths since the last search for pairs.
///
/// Pairs are counted by what moves apart, so that fibres in a common stream keep their list.
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
    /// What it grew by in that step.
    more: f64,
    /// Longest segment with its caps and all that is added to it \[m\].
    reach: f64,
    /// No pair has come nearer than by twice this path.
    pub pairs: Path,
    /// No node has come nearer to a surface at rest than by this path.
    pub walls: Path,
}

/// A path that is an upper bound, and when the distance itself is to be measured again.
#[derive(Default)]
pub(crate) struct Path {
    /// Since the search \[m\].
    pub length: f64,
    /// Length at which the distance was nothing, if it grew as the path does.
    check: f64,
}

impl Path {
    /// Whether the distance can have reached half of the skin.
    pub fn due(&self, half_skin: f64) -> bool {
        self.length >= self.check + half_skin * SHORTER
    }

    /// Puts the next measurement off, given the distance now.
    pub fn measured(&mut self, distance: f64) {
        self.check = self.length - distance;
    }
}

/// What a set of displacements lies in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    /// Square of the longest; infinite when one is not finite.
    longest: f64,
    low: [f64; 3],
    high: [f64; 3],
}

impl Extent {
    const NONE: Self = Self {
        longest: 0.0,
        low: [f64::INFINITY; 3],
        high: [f64::NEG_INFINITY; 3],
    };

    /// Anywhere.
    pub const BEYOND: Self = Self {
        longest: f64::INFINITY,
        ..Self::NONE
    };

    #[inline(always)]
    fn include(&mut self, moved: &Vector3) {
        self.longest = larger(self.longest, moved.norm_squared());
        for axis in 0..3 {
            self.low[axis] = self.low[axis].min(moved[axis]);
            self.high[axis] = self.high[axis].max(moved[axis]);
        }
    }

    fn with(mut self, other: Self) -> Self {
        self.longest = larger(self.longest, other.longest);
        for axis in 0..3 {
            self.low[axis] = self.low[axis].min(other.low[axis]);
            self.high[axis] = self.high[axis].max(other.high[axis]);
        }
        self
    }

    /// That of all ranks.
    pub fn over(self, communicator: &Communicator) -> Self {
        let [a, b, c] = self.low.map(|low| -low);
        let [d, e, f] = self.high;
        let mut all = [self.longest, a, b, c, d, e, f];
        communicator.max_slice(&mut all);
        Self {
            longest: all[0],
            low: [-all[1], -all[2], -all[3]],
            high: [all[4], all[5], all[6]],
        }
    }

    /// The longest; infinite when one is not finite.
    pub fn longest(&self) -> f64 {
        self.longest.sqrt()
    }

    /// No two differ by more than twice this.
    pub fn half(&self) -> f64 {
        let sides = (0..3).map(|axis| self.high[axis] - self.low[axis]);
        let diagonal = sides.map(|side| side * side).sum::<f64>().sqrt();
        // The diagonal of an empty or an infinite extent is no number.
        self.longest().min(0.5 * diagonal)
    }
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

    /// What the nodes have moved since the last call, when the strain since the search is `strain`.
    pub fn step(&mut self, position: &[Vector3], strain: f64) -> Extent {
        let more = strain - self.strain;
        (self.strain, self.more) = (strain, more);
        let last = self.last.par_chunks_mut(GRAIN);
        let nodes = last.zip(position.par_chunks(GRAIN));
        if more == 0.0 {
            let blocks = nodes.map(|(last, now)| {
                let mut extent = Extent::NONE;
                for (last, now) in last.iter_mut().zip(now) {
                    extent.include(&(now - *last));
                    *last = *now;
                }
                extent
            });
            blocks.reduce(|| Extent::NONE, Extent::with)
        } else {
            let blocks = nodes.zip(self.start.par_chunks(GRAIN));
            let blocks = blocks.map(|((last, now), start)| {
                let mut extent = Extent::NONE;
                for ((last, now), start) in last.iter_mut().zip(now).zip(start) {
                    extent.include(&(now - *last - along(more, start)));
                    *last = *now;
                }
                extent
            });
            blocks.reduce(|| Extent::NONE, Extent::with)
        }
    }

    /// Adds the last step, as it is over all ranks, to the paths.
    pub fn add(&mut self, step: &Extent) {
        self.pairs.length += step.half() + self.shear(self.more);
        self.walls.length += step.longest();
    }

    /// What the nodes have moved since the search.
    pub fn moved(&self, position: &[Vector3]) -> Extent {
        let start = self.start.par_chunks(GRAIN);
        let moved = start.zip(position.par_chunks(GRAIN)).map(|(start, now)| {
            let mut extent = Extent::NONE;
            let moved = start.iter().zip(now);
            moved.for_each(|(a, b)| extent.include(&(b - a - along(self.strain, a))));
            extent
        });
        moved.reduce(|| Extent::NONE, Extent::with)
    }

    /// Half of how much nearer a pair can have come since the search \[m\], by what the nodes of all ranks have moved.
    pub fn distance(&self, moved: &Extent) -> f64 {
        moved.half() + self.shear(self.strain)
    }

    /// Largest of a measure of what the nodes have moved since the search.
    pub fn largest(
        &self,
        position: &[Vector3],
        measure: impl Fn(&Vector3) -> f64 + Sync + Send,
    ) -> f64 {
        let start = self.start.par_chunks(GRAIN);
        let largest = start.zip(position.par_chunks(GRAIN)).map(|(start, now)| {
            let moved = start.iter().zip(now);
            let moved = moved.map(|(a, b)| measure(&(b - a - along(self.strain, a))));
            moved.fold(0.0, larger)
        });
        largest.reduce(|| 0.0, larger)
    }

    /// Half of how much nearer a pair comes in a strain that its segments follow \[m\].
    fn shear(&self, strain: f64) -> f64 {
        0.5 * strain.abs() * self.reach
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

/// The larger of two; what is not finite is infinite.
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
