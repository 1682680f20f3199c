//! Broad phase: pairs of segments near each other, found by rendezvous at the home ranks of cells.

use crate::Vector3;
use crate::contact::closest::closest_points;
use crate::contact::grid::{CellGrid, Cover, mix};
use crate::contact::images::Images;
use crate::contact::{ContactError, Segments};
use crate::shape::SEGMENT_BITS;
use bytemuck::{Pod, Zeroable};
use fibreflow_parallel::Communicator;
use rayon::prelude::*;
use std::f64::consts::FRAC_PI_2;

/// Two segments that can touch before the next search.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Found {
    /// Global ids, a < b.
    pub ids: [u64; 2],
    /// Their owners.
    pub owner: [u32; 2],
    /// Their local indices on the owners.
    pub index: [u32; 2],
    /// Gap between their surfaces \[m\].
    pub gap: f64,
}

impl Found {
    /// Owner and local index on it, of both segments.
    pub fn places(&self) -> [(u32, u32); 2] {
        [0, 1].map(|side| (self.owner[side], self.index[side]))
    }
}

/// What a search found for this rank.
pub(crate) struct Search {
    /// Pairs with at least one segment of this rank, in ascending order of the ids.
    pub pairs: Vec<Found>,
    /// Pairs that shared a cell on this rank: the work done.
    pub tests: usize,
    /// Longest segment with its caps and the skin \[m\].
    pub reach: f64,
}

/// A segment as the home rank of a cell sees it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Entry {
    id: u64,
    stem: u64,
    start: [f64; 3],
    end: [f64; 3],
    radius: f64,
    owner: u32,
    index: u32,
}

impl Entry {
    fn ends(&self) -> [Vector3; 2] {
        [self.start.into(), self.end.into()]
    }
}

/// A sphere that holds all that can be within half of the skin of a segment.
#[derive(Clone, Copy)]
struct Ball {
    middle: Vector3,
    radius: f64,
}

impl Ball {
    fn around(entry: &Entry, skin: f64) -> Self {
        let [start, end] = entry.ends();
        Self {
            middle: 0.5 * (start + end),
            // Round-off must not lose a pair.
            radius: (0.5 * (end - start).norm() + entry.radius + 0.5 * skin) * (1.0 + 1e-9),
        }
    }

    #[inline(always)]
    fn meets(&self, other: &Self, images: &Images) -> bool {
        let between = other.middle - self.middle;
        let reach = self.radius + other.radius;
        (between - images.nearest(&between).shift).norm_squared() <= reach * reach
    }
}

/// All pairs with a gap below `skin`, apart from neighbours in a fibre. Collective.
///
/// Each rank sends a segment once to every rank that is home to a cell it covers; a pair is found in the one cell
/// that both agree on and reported to the owners of its two segments.
pub(crate) fn search(
    communicator: &Communicator,
    segments: &Segments<'_>,
    images: &Images,
    skin: f64,
) -> Result<Search, ContactError> {
    let periodic = images.periodic();
    let reach = longest_reach(communicator, segments)? + skin;
    for (axis, length) in ['x', 'y', 'z'].into_iter().zip(periodic.lengths) {
        if let Some(length) = length
            && length < 2.0 * reach
        {
            return Err(ContactError::PeriodicTooShort {
                axis,
                length,
                reach,
            });
        }
    }
    let ranks = communicator.size();
    let home = |key: u64| match ranks {
        1 => 0,
        _ => (mix(key) % ranks as u64) as usize,
    };
    let grid = CellGrid::new(periodic, reach);
    let cover = |entry: &Entry| {
        let upright = entry.ends().map(|x| images.upright(&x));
        grid.cover(&upright, (entry.radius + 0.5 * skin) * images.stretch())
    };
    let received = communicator.exchange(addressed(communicator, segments, cover, home));
    let entries: Vec<Entry> = received.into_iter().flatten().collect();
    let covers: Vec<Cover> = entries.par_iter().map(cover).collect();
    let mut cells: Vec<(u64, u32)> = covers
        .par_iter()
        .enumerate()
        .flat_map_iter(|(i, cover)| {
            let here = cover.keys().filter(|&key| home(key) == communicator.rank());
            here.map(move |key| (key, i as u32))
        })
        .collect();
    cells.par_sort_unstable();

    let balls: Vec<Ball> = entries.par_iter().map(|e| Ball::around(e, skin)).collect();
    let near = |key: u64, first: u32, second: u32| {
        let (i, j) = (first as usize, second as usize);
        // Cheapest first: most pairs in a cell are too far apart, or found in another cell.
        if !balls[i].meets(&balls[j], images) || covers[i].common(&covers[j]) != Some(key) {
            return None;
        }
        let (a, b) = if entries[i].id < entries[j].id {
            (&entries[i], &entries[j])
        } else {
            (&entries[j], &entries[i])
        };
        near_gap(a, b, images, skin).map(|gap| Found {
            ids: [a.id, b.id],
            owner: [a.owner, b.owner],
            index: [a.index, b.index],
            gap,
        })
    };
    let in_cell = |(mut found, tests): (Vec<Found>, usize), cell: &[(u64, u32)]| {
        for (n, &(key, first)) in cell.iter().enumerate() {
            for &(_, second) in &cell[n + 1..] {
                found.extend(near(key, first, second));
            }
        }
        (found, tests + cell.len() * (cell.len() - 1) / 2)
    };
    let empty = || (Vec::new(), 0);
    let (found, tests) = cells
        .par_chunk_by(|x, y| x.0 == y.0)
        .fold(empty, in_cell)
        .reduce(empty, |(mut all, tests), (more, others)| {
            all.extend(more);
            (all, tests + others)
        });

    let mut reports = vec![Vec::new(); ranks];
    for pair in found {
        reports[pair.owner[0] as usize].push(pair);
        if pair.owner[1] != pair.owner[0] {
            reports[pair.owner[1] as usize].push(pair);
        }
    }
    let mut pairs: Vec<Found> = communicator
        .exchange(reports)
        .into_iter()
        .flatten()
        .collect();
    pairs.par_sort_unstable_by_key(|pair| pair.ids);
    Ok(Search {
        pairs,
        tests,
        reach,
    })
}

/// Longest axis plus two radii over all ranks \[m\].
fn longest_reach(
    communicator: &Communicator,
    segments: &Segments<'_>,
) -> Result<f64, ContactError> {
    let reach = (0..segments.count())
        .map(|i| {
            let [start, end] = segments.ends(i);
            (end - start).norm() + 2.0 * segments.radius[i]
        })
        .fold(0.0, |longest: f64, x| {
            if x.is_nan() || longest.is_nan() {
                f64::NAN
            } else {
                longest.max(x)
            }
        });
    let reach = communicator.max(reach);
    reach
        .is_finite()
        .then_some(reach)
        .ok_or(ContactError::NonFinite)
}

/// The segments each home rank needs.
fn addressed(
    communicator: &Communicator,
    segments: &Segments<'_>,
    cover: impl Fn(&Entry) -> Cover,
    home: impl Fn(u64) -> usize,
) -> Vec<Vec<Entry>> {
    let entry = |index: usize| {
        let [start, end] = segments.ends(index).map(Into::into);
        Entry {
            id: segments.ids[index],
            stem: segments.stems[index],
            start,
            end,
            radius: segments.radius[index],
            owner: communicator.rank() as u32,
            index: index as u32,
        }
    };
    if communicator.size() == 1 {
        let all = (0..segments.count()).into_par_iter();
        return vec![all.map(entry).collect()];
    }
    let mut outgoing = vec![Vec::new(); communicator.size()];
    let mut homes = Vec::with_capacity(8);
    for entry in (0..segments.count()).map(entry) {
        homes.clear();
        homes.extend(cover(&entry).keys().map(&home));
        homes.sort_unstable();
        homes.dedup();
        homes.iter().for_each(|&rank| outgoing[rank].push(entry));
    }
    outgoing
}

/// Gap between two segments \[m\] if it is below `skin` and they are no neighbours in a fibre.
fn near_gap(a: &Entry, b: &Entry, images: &Images, skin: f64) -> Option<f64> {
    if neighbours(a, b) {
        return None;
    }
    let (ends_a, mut ends_b) = (a.ends(), b.ends());
    let shift = images.beside(&ends_a, &ends_b).shift;
    ends_b.iter_mut().for_each(|end| *end -= shift);
    let reach = a.radius + b.radius;
    let apart = (0..3).any(|axis| {
        let (low_a, high_a) = sorted(ends_a[0][axis], ends_a[1][axis]);
        let (low_b, high_b) = sorted(ends_b[0][axis], ends_b[1][axis]);
        low_b - high_a > reach + skin || low_a - high_b > reach + skin
    });
    let gap = if apart {
        f64::INFINITY
    } else {
        closest_points(&ends_a, &ends_b).distance - reach
    };
    (gap < skin).then_some(gap)
}

fn sorted(x: f64, y: f64) -> (f64, f64) {
    if x < y { (x, y) } else { (y, x) }
}

/// Segments so close along what is or was one fibre that they overlap by construction: adjacent ones, and those nearer along the
/// fibre than π times its radius, the shortest way in which a fibre can fold back onto itself.
fn neighbours(a: &Entry, b: &Entry) -> bool {
    if a.stem >> SEGMENT_BITS != b.stem >> SEGMENT_BITS {
        return false;
    }
    let between = b.stem.abs_diff(a.stem).saturating_sub(1) as f64;
    let length = |e: &Entry| (e.ends()[1] - e.ends()[0]).norm();
    between == 0.0 || between * length(a).min(length(b)) < FRAC_PI_2 * (a.radius + b.radius)
}

#[cfg(test)]
mod tests;
