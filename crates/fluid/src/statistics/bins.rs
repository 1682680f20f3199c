//! Which nodes are averaged together, and along which directions velocities are taken there.

use super::Averaging;
use crate::Fluid;
use crate::settings::dot;
use fibreflow_mesh::LocalMesh;
use fibreflow_parallel::Communicator;

/// Positions closer than this share of the extent are one.
const SAME: f64 = 1e-6;

/// Most distinct positions; those of meshes with more are rounded to this many of equal distance.
const MOST: usize = 1 << 12;

/// Rings, and bins of meshes without planes, with fewer nodes than this share of the fullest one are joined with the next.
const FULL: f64 = 0.25;

/// Rings nearer than this share of the last distance between two are joined.
const CLOSE: f64 = 0.2;

/// Nodes in planes or rings.
#[derive(Clone, Debug)]
pub(super) struct Bins {
    /// Bin of every owned node.
    pub of: Vec<u32>,
    /// Position of every bin \[m\]: along the normal, from the nearer side, or the radius; mean over its volume.
    pub positions: Vec<f64>,
    /// Volume of every bin on all ranks \[m³\].
    pub volumes: Vec<f64>,
    /// Half the extent of symmetric planes, else the extent; the radius of the outermost ring \[m\].
    pub extent: f64,
    frame: Frame,
}

/// Directions (1: of the flow, 2: across bins, 3: the rest) by place.
#[derive(Clone, Copy, Debug)]
enum Frame {
    /// Axes; beyond `middle` the second direction is turned round.
    Planes { axes: [usize; 3], middle: f64 },
    /// Axis of the flow, and a point on it \[m\].
    Rings { axis: usize, centre: [f64; 3] },
}

impl Frame {
    fn new(averaging: &Averaging, low: [f64; 3], high: [f64; 3]) -> Self {
        match *averaging {
            Averaging::Planes {
                normal,
                flow,
                symmetric,
            } => Self::Planes {
                axes: [flow, normal, 3 - flow - normal],
                middle: if symmetric {
                    0.5 * (low[normal] + high[normal])
                } else {
                    f64::INFINITY
                },
            },
            Averaging::Rings { axis, centre } => Self::Rings { axis, centre },
        }
    }
}

/// From an axis to a place, in the two directions across it \[m\].
fn across(axis: usize, centre: [f64; 3], x: [f64; 3]) -> [f64; 2] {
    [1, 2].map(|k| x[(axis + k) % 3] - centre[(axis + k) % 3])
}

/// Directions along an axis, away from it and around it.
fn around(axis: usize, centre: [f64; 3], x: [f64; 3]) -> [[f64; 3]; 3] {
    let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
    let [p, q] = across(axis, centre, x);
    let radius = p.hypot(q);
    let (cos, sin) = if radius > 0.0 {
        (p / radius, q / radius)
    } else {
        (1.0, 0.0)
    };
    let mut directions = [[0.0; 3]; 3];
    directions[0][axis] = 1.0;
    (directions[1][b], directions[1][c]) = (cos, sin);
    (directions[2][b], directions[2][c]) = (-sin, cos);
    directions
}

impl Bins {
    /// Collective; the same bins on every rank.
    pub fn new(fluid: &Fluid, averaging: &Averaging) -> Self {
        let mesh = fluid.mesh();
        let communicator = mesh.halo.communicator();
        let (low, high) = bounds(mesh);
        let frame = Frame::new(averaging, low, high);
        let rings = matches!(averaging, Averaging::Rings { .. });
        let position = |x: [f64; 3]| match frame {
            Frame::Planes { axes, middle } if middle.is_finite() => {
                (x[axes[1]] - low[axes[1]]).min(high[axes[1]] - x[axes[1]])
            }
            Frame::Planes { axes, .. } => x[axes[1]],
            Frame::Rings { axis, centre } => {
                let [p, q] = across(axis, centre, x);
                p.hypot(q)
            }
        };
        let owned: Vec<f64> = (mesh.nodes[..mesh.owned()].iter())
            .map(|&x| position(x))
            .collect();
        let widest = (0..3).map(|c| high[c] - low[c]).fold(0.0, f64::max);
        let starts = starts(&owned, SAME * widest, rings, communicator);
        let of: Vec<u32> = owned
            .iter()
            .map(|&p| starts.partition_point(|&s| s <= p).saturating_sub(1) as u32)
            .collect();
        let count = starts.len();
        let mut sums = vec![0.0; 2 * count];
        for ((&bin, &p), v) in of.iter().zip(&owned).zip(fluid.operators.volumes()) {
            sums[bin as usize] += v;
            sums[count + bin as usize] += v * p;
        }
        communicator.sum_slice(&mut sums);
        let (volumes, weighted) = sums.split_at(count);
        let largest = communicator.max(owned.iter().copied().fold(f64::NEG_INFINITY, f64::max));
        Self {
            positions: weighted.iter().zip(volumes).map(|(w, v)| w / v).collect(),
            volumes: volumes.to_vec(),
            extent: match frame {
                Frame::Planes { axes, middle } if !middle.is_finite() => {
                    high[axes[1]] - low[axes[1]]
                }
                _ => largest,
            },
            of,
            frame,
        }
    }

    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Components of a vector along the directions at a place.
    pub fn local(&self, x: [f64; 3], v: [f64; 3]) -> [f64; 3] {
        match self.frame {
            Frame::Planes { axes, middle } => {
                let sign = if x[axes[1]] > middle { -1.0 } else { 1.0 };
                [v[axes[0]], sign * v[axes[1]], v[axes[2]]]
            }
            Frame::Rings { axis, centre } => around(axis, centre, x).map(|d| dot(d, v)),
        }
    }

    /// Along the flow.
    pub fn along(&self, v: [f64; 3]) -> f64 {
        match self.frame {
            Frame::Planes { axes, .. } => v[axes[0]],
            Frame::Rings { axis, .. } => v[axis],
        }
    }

    /// Of rings: along the axis \[m\], radius \[m\] and angle of a place.
    pub fn around(&self) -> Option<impl Fn([f64; 3]) -> [f64; 3] + use<>> {
        let Frame::Rings { axis, centre } = self.frame else {
            return None;
        };
        Some(move |x: [f64; 3]| {
            let [p, q] = across(axis, centre, x);
            [x[axis], p.hypot(q), q.atan2(p)]
        })
    }

    pub fn rings(&self) -> bool {
        matches!(self.frame, Frame::Rings { .. })
    }

    /// The planes are counted from the nearer of two sides.
    pub fn symmetric(&self) -> bool {
        matches!(self.frame, Frame::Planes { middle, .. } if middle.is_finite())
    }
}

/// Corners of the box around all nodes. Collective.
fn bounds(mesh: &LocalMesh) -> ([f64; 3], [f64; 3]) {
    let communicator = mesh.halo.communicator();
    let owned = &mesh.nodes[..mesh.owned()];
    let least = |c: usize| owned.iter().map(|x| x[c]).fold(f64::INFINITY, f64::min);
    let most = |c: usize| owned.iter().map(|x| x[c]).fold(f64::NEG_INFINITY, f64::max);
    (
        [0, 1, 2].map(|c| communicator.min(least(c))),
        [0, 1, 2].map(|c| communicator.max(most(c))),
    )
}

/// Where bins start, ascending. Collective; does not depend on the ranks.
fn starts(positions: &[f64], tolerance: f64, join: bool, communicator: &Communicator) -> Vec<f64> {
    let mut sorted: Vec<[f64; 2]> = positions.iter().map(|&p| [p, 1.0]).collect();
    let mut local = groups(&mut sorted, tolerance);
    let mut crowded = communicator.any(local.len() > MOST);
    if !crowded {
        let mut all = communicator.all_gather(&local).concat();
        local = groups(&mut all, tolerance);
        crowded = local.len() > MOST;
    }
    let all = if crowded {
        rounded(positions, communicator)
    } else {
        local
    };
    let join = join || crowded;
    // A node lies above the start of its bin by less than the tolerance.
    let start = |p: f64| p - 2.0 * tolerance;
    if !join {
        return all.iter().map(|g| start(g[0])).collect();
    }
    let least = FULL * all.iter().map(|g| g[1]).fold(0.0, f64::max);
    let mut starts = Vec::new();
    // From the wall inwards, so that the sparse rings are those around the axis.
    let mut held = 0.0;
    let (mut lowest, mut first, mut gap) = (f64::INFINITY, f64::INFINITY, 0.0);
    for (k, group) in all.iter().enumerate().rev() {
        // A plane or ring that is full stays alone; what lies just outside joins those further out.
        if group[1] >= least
            && held > 0.0
            && let Some(outer) = starts.last_mut()
        {
            (*outer, held) = (lowest, 0.0);
        }
        held += group[1];
        lowest = start(group[0]);
        if held < least {
            continue;
        }
        held = 0.0;
        match starts.last_mut() {
            // Beside its neighbour it would have no slope of its own; the last may be a wall.
            Some(outer) if k > 0 && first - lowest < CLOSE * gap => *outer = lowest,
            outer => {
                gap = outer.map_or(0.0, |outer| *outer - lowest);
                first = lowest;
                starts.push(lowest);
            }
        }
    }
    if held > 0.0 {
        match starts.last_mut() {
            Some(innermost) => *innermost = f64::NEG_INFINITY,
            None => starts.push(f64::NEG_INFINITY),
        }
    }
    starts.reverse();
    starts
}

/// [`groups`] of positions that are rounded down to [`MOST`] of equal distance, from all ranks. Collective.
fn rounded(positions: &[f64], communicator: &Communicator) -> Vec<[f64; 2]> {
    let least = communicator.min(positions.iter().copied().fold(f64::INFINITY, f64::min));
    let most = communicator.max(positions.iter().copied().fold(f64::NEG_INFINITY, f64::max));
    let step = (most - least) / (MOST - 1) as f64;
    let mut counts = vec![0.0; MOST];
    for p in positions {
        // A hundredth of a step, so that round-off cannot part a plane.
        counts[((p - least) / step + 0.01) as usize] += 1.0;
    }
    communicator.sum_slice(&mut counts);
    let counts = counts.into_iter().enumerate();
    counts
        .filter(|&(_, count)| count > 0.0)
        .map(|(k, count)| [least + (k as f64 - 0.01) * step, count])
        .collect()
}

/// Lowest position and number of nodes of every group of positions without gaps above the tolerance.
fn groups(positions: &mut [[f64; 2]], tolerance: f64) -> Vec<[f64; 2]> {
    positions.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let mut groups: Vec<[f64; 2]> = Vec::new();
    let mut last = f64::NEG_INFINITY;
    for &[p, count] in positions.iter() {
        match groups.last_mut() {
            Some(group) if p - last <= tolerance => group[1] += count,
            _ => groups.push([p, count]),
        }
        last = p;
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sparse_and_close_rings_are_joined() {
        // From the wall: full rings, one beside another, a few nodes, full ones, three about the axis.
        let rings = [
            (1.0, 8),
            (0.9, 8),
            (0.8, 8),
            (0.79, 8),
            (0.75, 1),
            (0.7, 8),
            (0.6, 6),
            (0.1, 1),
        ];
        let positions: Vec<f64> = rings
            .iter()
            .flat_map(|&(r, count)| vec![r; count])
            .collect();
        let starts = starts(&positions, 1e-9, true, &Communicator::single());
        let wanted = [f64::NEG_INFINITY, 0.7, 0.75, 0.9, 1.0];
        assert_eq!(starts.len(), wanted.len(), "{starts:?}");
        for (found, wanted) in starts.iter().zip(wanted) {
            assert!(
                (found - wanted).abs() < 1e-6 || *found == wanted,
                "{starts:?}"
            );
        }
    }
}
