//! Subdomain deflation, as in the pressure solver of YALES2 (K 3.3.4; Malandain, Maheu & Moureau 2013).
//!
//! Long waves are taken out by vectors W that are one on a group of nodes and zero elsewhere, E = WᵀAW; the division by
//! the diagonal is left with the rest:
//!
//! z = D⁻¹ r + W E⁻¹ Wᵀ (r − A D⁻¹ r).
//!
//! This is form A-DEF2 of Tang, Nabben, Vuik & Erlangga (2009), as cheap as deflation itself and safe with coarse solves
//! that are not exact. It needs Wᵀ r = 0 at the start, which x + W E⁻¹ Wᵀ r gives, and stays symmetric and positive on what
//! then comes. Rows of A sum to zero inside a group: WᵀA z asks only for the pairs that are cut by groups.

mod coarse;
mod groups;

use crate::gather::Gathering;
use crate::merge::{Merged, NONE};
use crate::vectors::BLOCK;
use crate::{PairMatrix, Preconditioner, SolveError};
use coarse::Factor;
use fibreflow_parallel::Halo;
use groups::groups;
use rayon::prelude::*;

/// Groups of all ranks at most: their matrix is factored on every rank.
const MOST_GROUPS: usize = 8192;

/// Groups to a thread at a time.
const CHUNK: usize = 16;

/// How nodes are grouped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeflationSettings {
    /// Nodes in a group, about; more where there would be over 8192 groups.
    pub nodes: usize,
}

impl Default for DeflationSettings {
    fn default() -> Self {
        Self { nodes: 200 }
    }
}

/// The preconditioner.
pub struct Deflation {
    halo: Halo,
    /// 1/d, owned.
    inverse: Vec<f64>,
    /// Group of the owned nodes.
    groups: Vec<u32>,
    /// Nodes of every group.
    members: Rows<Member>,
    /// Pairs that leave every group.
    cut: Rows<Cut>,
    /// D⁻¹ r, total.
    scaled: Vec<f64>,
    /// Coarse right-hand side in the order of ranks, and answer.
    coarse: Gathering<f64>,
    factor: Factor,
    group_count: usize,
    singular: bool,
}

/// Compressed rows, one a group.
struct Rows<T> {
    offsets: Vec<u32>,
    entries: Vec<T>,
}

impl<T> Rows<T> {
    fn new() -> Self {
        Self {
            offsets: vec![0],
            entries: Vec::new(),
        }
    }

    fn close(&mut self) {
        self.offsets.push(self.entries.len() as u32);
    }

    fn row(&self, i: usize) -> &[T] {
        &self.entries[self.offsets[i] as usize..self.offsets[i + 1] as usize]
    }
}

#[derive(Clone, Copy)]
struct Member {
    node: u32,
    shift: f64,
}

#[derive(Clone, Copy)]
struct Cut {
    node: u32,
    other: u32,
    weight: f64,
}

impl Deflation {
    /// Groups the nodes and factors the coarse matrix. Collective.
    ///
    /// # Errors
    /// [`SolveError::Coarsest`] when the coarse matrix is not positive definite (a mesh in several pieces without
    /// Dirichlet nodes).
    pub fn new(matrix: &PairMatrix, settings: DeflationSettings) -> Result<Self, SolveError> {
        let matrix = matrix.without_lifted();
        let halo = matrix.halo().clone();
        let (owned, total) = (halo.owned(), halo.total());
        let nodes = halo.communicator().sum_count(owned);
        let (groups, count) = groups(&matrix, settings.nodes.max(nodes / MOST_GROUPS + 1));
        let merged = Merged::new(&matrix, &groups, count)?;
        let mut sorted: Vec<u32> = (0..owned as u32).collect();
        sorted.retain(|&i| groups[i as usize] != NONE);
        sorted.sort_by_key(|&i| groups[i as usize]);
        let (mut members, mut cut) = (Rows::new(), Rows::new());
        for rows in sorted.chunk_by(|&i, &j| groups[i as usize] == groups[j as usize]) {
            for &node in rows {
                let shift = matrix.shift()[node as usize];
                members.entries.push(Member { node, shift });
                let row = matrix.row(node as usize);
                let leaves = |&(j, _): &(usize, f64)| merged.groups[j] != groups[node as usize];
                cut.entries
                    .extend(row.filter(leaves).map(|(j, weight)| Cut {
                        node,
                        other: j as u32,
                        weight,
                    }));
            }
            members.close();
            cut.close();
        }
        let (coarse, whole) = Gathering::new(&merged.matrix)?;
        let singular = matrix.is_singular();
        Ok(Self {
            inverse: matrix.diagonal().iter().map(|d| d.recip()).collect(),
            factor: Factor::new(&whole, singular)?,
            scaled: vec![0.0; total],
            halo,
            groups,
            members,
            cut,
            coarse,
            group_count: whole.owned(),
            singular,
        })
    }

    /// Unknowns of the coarse matrix.
    pub fn groups(&self) -> usize {
        self.group_count
    }

    /// y = E⁻¹ of what `sum` gives for the groups of this rank; all groups in rank order.
    fn solve_coarse(
        &mut self,
        sum: impl Fn(usize, &[Member], &[Cut], &[f64]) -> f64 + Sync,
    ) -> &[f64] {
        let (members, cut, scaled) = (&self.members, &self.cut, &self.scaled);
        let own = self.coarse.own().par_chunks_mut(CHUNK).enumerate();
        own.for_each(|(chunk, values)| {
            for (group, value) in (chunk * CHUNK..).zip(values) {
                *value = sum(group, members.row(group), cut.row(group), scaled);
            }
        });
        let part = self.coarse.part();
        let answer = self.coarse.collect();
        self.factor.solve(answer);
        if self.singular {
            let mean = answer.iter().sum::<f64>() / answer.len() as f64;
            answer.iter_mut().for_each(|y| *y -= mean);
        }
        &answer[part]
    }
}

/// z += W y.
fn add_groups(groups: &[u32], y: &[f64], z: &mut [f64]) {
    z.par_chunks_mut(BLOCK)
        .zip(groups.par_chunks(BLOCK))
        .for_each(|(z, groups)| {
            for (z, &group) in z.iter_mut().zip(groups) {
                if group != NONE {
                    *z += y[group as usize];
                }
            }
        });
}

impl Preconditioner<f64> for Deflation {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        let scaled = self.scaled.par_chunks_mut(BLOCK);
        let parts = scaled
            .zip(r.par_chunks(BLOCK))
            .zip(self.inverse.par_chunks(BLOCK));
        parts.for_each(|((scaled, r), inverse)| {
            for ((scaled, r), inverse) in scaled.iter_mut().zip(r).zip(inverse) {
                *scaled = r * inverse;
            }
        });
        self.halo.update(&mut self.scaled);
        let groups = std::mem::take(&mut self.groups);
        z.copy_from_slice(&self.scaled[..z.len()]);
        let y = self.solve_coarse(|_, members, cut, scaled| {
            let kept = members.iter().map(|m| {
                let i = m.node as usize;
                r[i] - m.shift * scaled[i]
            });
            let lost = cut
                .iter()
                .map(|c| c.weight * (scaled[c.node as usize] - scaled[c.other as usize]));
            kept.sum::<f64>() - lost.sum::<f64>()
        });
        add_groups(&groups, y, z);
        self.groups = groups;
    }

    fn improve(&mut self, r: &[f64], x: &mut [f64]) -> bool {
        let groups = std::mem::take(&mut self.groups);
        let y =
            self.solve_coarse(|_, members, _, _| members.iter().map(|m| r[m.node as usize]).sum());
        add_groups(&groups, y, &mut x[..groups.len()]);
        self.groups = groups;
        true
    }
}
