//! A tensor-product mesh as lines of nodes: neighbours at constant strides instead of indices, area vectors and weights
//! as products of one-dimensional ones, and every pair flux stored once.
//!
//! Nodes are numbered line by line along the fastest direction a. A pair of lines that are neighbours along b or c is
//! an [`Arm`] of both; its area at node i of the line is `skew`·H_a(i), its weight `stiffness`·H_a(i). Pairs inside a
//! line have `skew`·H_b H_c and `stiffness`·H_b H_c. Sums run in the order along (by distance), then arms (direction, upper
//! before lower, distance): the same on any number of ranks.

use fibreflow_mesh::{DualGeometry, Line, LocalMesh, TensorLines};
use std::collections::HashMap;
use std::ops::Range;

/// Most distances inside a line, and most arms: fourth order next to the ends of all directions.
pub(super) const MOST_ALONG: usize = 3;
pub(super) const MOST_ARMS: usize = 10;

/// Pairs (i, i + step) inside every line, modulo its length.
#[derive(Clone, Debug)]
pub(super) struct Along {
    pub step: usize,
    /// Of the pair that starts at i, zero where there is none.
    pub skew: Vec<f64>,
    /// \[1/m\].
    pub stiffness: Vec<f64>,
    /// Both of the pair that ends at i.
    pub skew_before: Vec<f64>,
    pub stiffness_before: Vec<f64>,
}

/// A neighbouring line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arm {
    /// Its first node.
    pub start: u32,
    /// First of the fluxes of the pair of lines.
    pub slot: u32,
    /// 1 where the fluxes run away from this line, −1 where they run towards it.
    pub sign: f64,
    /// Component along which the pair lies.
    pub axis: u8,
    /// This line's task writes the fluxes.
    pub writes: bool,
    /// Area by H_a(i) \[m\].
    pub skew: f64,
    /// Weight by H_a(i).
    pub stiffness: f64,
}

/// The lines of a rank.
#[derive(Clone, Debug)]
pub(super) struct Lattice {
    /// Nodes of a line.
    pub length: usize,
    /// Component along the lines.
    pub axis: usize,
    /// H_a \[m\].
    pub norm: Vec<f64>,
    pub along: Vec<Along>,
    /// As long as a line.
    pub zeros: Vec<f64>,
    /// H_b H_c of every owned line \[m²\].
    pub areas: Vec<f64>,
    arms: Vec<Arm>,
    /// Where the arms of every owned line start, and where they end.
    arm_starts: Vec<u32>,
    /// The same of the fluxes that its task writes: those inside the line, distance by distance, then those of arms.
    pub slots: Vec<u32>,
    /// Owned lines with arms to halo lines; empty when there are none.
    pub border: Vec<bool>,
}

impl Lattice {
    /// None where the mesh is no tensor product, or not numbered line by line.
    pub fn new(mesh: &LocalMesh, geometry: &DualGeometry) -> Option<Self> {
        let TensorLines { grid, lines } = geometry.tensor.as_ref()?;
        let [a, b, c] = grid.numbering(&mesh.global_nodes)?;
        let length = grid.counts()[a];
        let whole = mesh.owned().is_multiple_of(length) && mesh.total().is_multiple_of(length);
        let in_order = |line: &[[u32; 3]]| {
            let nodes = line.iter().enumerate();
            let same = |at: &[u32; 3]| at[b] == line[0][b] && at[c] == line[0][c];
            nodes.clone().all(|(i, at)| at[a] as usize == i && same(at))
        };
        if !whole || !grid.indices.chunks(length).all(in_order) {
            return None;
        }
        let places = || grid.indices.iter().step_by(length);
        let starts: HashMap<[u32; 2], u32> = (0..)
            .zip(places())
            .map(|(line, at)| ([at[b], at[c]], line * length as u32))
            .collect();
        let owned = mesh.owned() / length;
        let mut lattice = Self {
            length,
            axis: a,
            norm: lines[a].norm.clone(),
            along: along(&lines[a]),
            zeros: vec![0.0; length],
            areas: Vec::with_capacity(owned),
            arms: Vec::new(),
            arm_starts: vec![0],
            slots: vec![0],
            border: Vec::new(),
        };
        // Fluxes of the pair `p` of direction 0 (b) or 1 (c) at a place of the other direction.
        let mut slots: HashMap<(usize, usize, u32), u32> = HashMap::new();
        let mut keys = Vec::new();
        let near = [b, c].map(|axis| {
            let line = &lines[axis];
            (0..line.len() as u32)
                .map(|at| neighbours(line, at))
                .collect::<Vec<_>>()
        });
        for at in places().take(owned) {
            lattice
                .areas
                .push(lines[b].norm[at[b] as usize] * lines[c].norm[at[c] as usize]);
            let mut next = *lattice.slots.last()? + (lattice.along.len() * length) as u32;
            for (direction, (axis, across)) in [(b, c), (c, b)].into_iter().enumerate() {
                for &(other, p, lower) in &near[direction][at[axis] as usize] {
                    let pair = &lines[axis].pairs[p];
                    let place = if direction == 0 {
                        [other, at[c]]
                    } else {
                        [at[b], other]
                    };
                    let start = *starts.get(&place)?;
                    let writes = lower || start as usize >= mesh.owned();
                    let key = (direction, p, at[across]);
                    if writes {
                        slots.insert(key, next);
                        next += length as u32;
                    }
                    keys.push(key);
                    let norm = lines[across].norm[at[across] as usize];
                    lattice.arms.push(Arm {
                        start,
                        slot: 0,
                        sign: if lower { 1.0 } else { -1.0 },
                        axis: axis as u8,
                        writes,
                        skew: pair.skew * norm,
                        stiffness: pair.stiffness * norm,
                    });
                }
            }
            lattice.arm_starts.push(lattice.arms.len() as u32);
            lattice.slots.push(next);
        }
        for (arm, key) in lattice.arms.iter_mut().zip(&keys) {
            arm.slot = slots[key];
        }
        let fits = (0..owned).all(|line| lattice.arms(line).len() <= MOST_ARMS);
        if !fits || lattice.along.len() > MOST_ALONG || lattice.flux_length() < length {
            return None;
        }
        let in_halo = |arm: &Arm| arm.start as usize >= mesh.owned();
        if lattice.arms.iter().any(in_halo) {
            lattice.border = (0..owned)
                .map(|l| lattice.arms(l).iter().any(in_halo))
                .collect();
        }
        Some(lattice)
    }

    /// Owned lines.
    pub fn lines(&self) -> usize {
        self.areas.len()
    }

    pub fn arms(&self, line: usize) -> &[Arm] {
        &self.arms[self.arm_starts[line] as usize..self.arm_starts[line + 1] as usize]
    }

    /// Length of a field of pair fluxes.
    pub fn flux_length(&self) -> usize {
        self.slots.last().map_or(0, |&end| end as usize)
    }

    /// Nodes of an owned line.
    pub fn nodes(&self, line: usize) -> Range<usize> {
        line * self.length..(line + 1) * self.length
    }

    /// The fluxes of pairs at distance `k` inside a line.
    pub fn inner<'a>(&self, line: usize, k: usize, flux: &'a [f64]) -> &'a [f64] {
        let start = self.slots[line] as usize + k * self.length;
        &flux[start..start + self.length]
    }

    /// Calls `visit(column, component, sign, slot)` for every pair of a node; sign 1 where the flux of the slot runs away
    /// from the node.
    pub fn pairs_of(&self, node: usize, mut visit: impl FnMut(usize, usize, f64, usize)) {
        let (line, i, n) = (node / self.length, node % self.length, self.length);
        let first = line * n;
        for (k, along) in self.along.iter().enumerate() {
            let start = self.slots[line] as usize + k * n;
            let (next, previous) = (wrapped(i + along.step, n), wrapped(i + n - along.step, n));
            if along.skew[i] != 0.0 {
                visit(first + next, self.axis, 1.0, start + i);
            }
            if along.skew[previous] != 0.0 {
                visit(first + previous, self.axis, -1.0, start + previous);
            }
        }
        for arm in self.arms(line) {
            let (column, slot) = (arm.start as usize + i, arm.slot as usize + i);
            visit(column, arm.axis as usize, arm.sign, slot);
        }
    }

    /// Σ_j F_ij of a node.
    pub fn flux_sum(&self, flux: &[f64], node: usize) -> f64 {
        let mut sum = 0.0;
        self.pairs_of(node, |_, _, sign, slot| sum += sign * flux[slot]);
        sum
    }

    /// Calls `visit(entry, slot, sign)` for every entry of the rows of `geometry`.
    pub fn entries(&self, geometry: &DualGeometry, mut visit: impl FnMut(usize, usize, f64)) {
        for node in 0..geometry.offsets.len() - 1 {
            self.pairs_of(node, |column, axis, sign, slot| {
                // Two pairs may join the same nodes, in opposite directions.
                let found = geometry.row(node).find(|&e| {
                    geometry.columns[e] as usize == column
                        && geometry.displacements[e][axis] * sign > 0.0
                });
                if let Some(entry) = found {
                    visit(entry, slot, sign);
                }
            });
        }
    }
}

/// i modulo n, for i below 2n.
#[inline(always)]
pub(super) fn wrapped(i: usize, n: usize) -> usize {
    if i >= n { i - n } else { i }
}

/// By distance. A node's pair with its own image is left out.
fn along(line: &Line) -> Vec<Along> {
    let n = line.len();
    let mut all: Vec<Along> = Vec::new();
    for pair in &line.pairs {
        if line.other(pair) == pair.a as usize {
            continue;
        }
        let step = pair.distance as usize;
        let k = all
            .iter()
            .position(|along| along.step == step)
            .unwrap_or_else(|| {
                all.push(Along {
                    step,
                    skew: vec![0.0; n],
                    stiffness: vec![0.0; n],
                    skew_before: vec![0.0; n],
                    stiffness_before: vec![0.0; n],
                });
                all.len() - 1
            });
        let (a, b) = (pair.a as usize, line.other(pair));
        let along = &mut all[k];
        (along.skew[a], along.stiffness[a]) = (pair.skew, pair.stiffness);
        (along.skew_before[b], along.stiffness_before[b]) = (pair.skew, pair.stiffness);
    }
    all.sort_by_key(|along| along.step);
    all
}

/// (other place, pair, whether this is the lower end) of a place, upper neighbours first, by distance.
fn neighbours(line: &Line, at: u32) -> Vec<(u32, usize, bool)> {
    let mut found = Vec::new();
    for (p, pair) in line.pairs.iter().enumerate() {
        let b = line.other(pair) as u32;
        if b == pair.a {
            continue;
        }
        if pair.a == at {
            found.push((b, p, true));
        }
        if b == at {
            found.push((pair.a, p, false));
        }
    }
    found.sort_by_key(|&(_, p, lower)| (!lower, line.pairs[p].distance));
    found
}
