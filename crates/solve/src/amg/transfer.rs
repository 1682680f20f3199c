//! Smoothed prolongation and the Galerkin product, across ranks.

use super::aggregate::Strength;
use crate::{PairMatrix, SolveError, merge::NONE};
use fibreflow_parallel::Halo;
use std::collections::HashMap;

/// Couplings of the coarse matrix below this fraction of the geometric mean of the diagonals are round-off.
const NOISE: f64 = 1e-9;

/// Compressed rows in double precision.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    pub(super) offsets: Vec<u32>,
    pub(super) entries: Vec<(u32, f64)>,
}

impl Rows {
    fn with_capacity(rows: usize, entries: usize) -> Self {
        let mut offsets = Vec::with_capacity(rows + 1);
        offsets.push(0);
        Self {
            offsets,
            entries: Vec::with_capacity(entries),
        }
    }

    pub(super) fn row(&self, i: usize) -> &[(u32, f64)] {
        &self.entries[self.offsets[i] as usize..self.offsets[i + 1] as usize]
    }

    pub(super) fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    fn close(&mut self) {
        self.offsets.push(self.entries.len() as u32);
    }

    /// Row `rows[i]` of these for every i.
    pub(super) fn repeated(&self, rows: &[u32]) -> Self {
        let mut repeated = Self::with_capacity(rows.len(), self.entries.len());
        for &row in rows {
            repeated.entries.extend_from_slice(self.row(row as usize));
            repeated.close();
        }
        repeated
    }

    /// Rows of the first `columns` columns.
    pub(super) fn transposed(&self, columns: usize) -> Self {
        let mut offsets = vec![0u32; columns + 1];
        let kept = |c: u32| (c as usize) < columns;
        for &(c, _) in self.entries.iter().filter(|e| kept(e.0)) {
            offsets[c as usize + 1] += 1;
        }
        for c in 0..columns {
            offsets[c + 1] += offsets[c];
        }
        let mut next = offsets.clone();
        let mut entries = vec![(0, 0.0); offsets[columns] as usize];
        for i in 0..self.len() {
            for &(c, value) in self.row(i).iter().filter(|e| kept(e.0)) {
                entries[next[c as usize] as usize] = (i as u32, value);
                next[c as usize] += 1;
            }
        }
        Self { offsets, entries }
    }
}

/// Adds up entries of one row by column.
struct Sums {
    /// Where a column's entry was put last; stale when that lies before the row or holds another column.
    place: Vec<u32>,
}

impl Sums {
    fn add(&mut self, rows: &mut Rows, column: u32, value: f64) {
        if self.place.len() <= column as usize {
            self.place.resize(column as usize + 1, 0);
        }
        let first = rows.offsets[rows.offsets.len() - 1];
        let place = &mut self.place[column as usize];
        match rows.entries.get_mut(*place as usize) {
            Some(entry) if *place >= first && entry.0 == column => entry.1 += value,
            _ => {
                *place = rows.entries.len() as u32;
                rows.entries.push((column, value));
            }
        }
    }
}

/// Local indices of coarse unknowns: own ones first, then those of other ranks as they turn up.
pub(crate) struct Names {
    rank: u32,
    owned: usize,
    foreign: Vec<(u32, u32)>,
    index: HashMap<(u32, u32), u32>,
}

impl Names {
    /// With `owned` unknowns of this rank.
    pub(crate) fn new(rank: u32, owned: usize) -> Self {
        Self {
            rank,
            owned,
            foreign: Vec::new(),
            index: HashMap::new(),
        }
    }

    /// (rank, index there) of the unknowns of other ranks.
    pub(crate) fn foreign(&self) -> &[(u32, u32)] {
        &self.foreign
    }

    pub(crate) fn local(&mut self, name: [u32; 2]) -> u32 {
        if name[0] == self.rank {
            return name[1];
        }
        let (next, key) = (self.owned + self.foreign.len(), (name[0], name[1]));
        *self.index.entry(key).or_insert_with(|| {
            self.foreign.push(key);
            next as u32
        })
    }

    fn global(&self, local: u32) -> [u32; 2] {
        match (local as usize).checked_sub(self.owned) {
            None => [self.rank, local],
            Some(k) => [self.foreign[k].0, self.foreign[k].1],
        }
    }

    /// Appends the rows of the halo entries to those of the owned ones. Collective.
    fn exchange(&mut self, halo: &Halo, rows: &mut Rows) {
        let communicator = halo.communicator();
        if communicator.size() == 1 {
            return;
        }
        let owned = halo.owned();
        let mut lengths: Vec<u32> = (0..owned).map(|i| rows.row(i).len() as u32).collect();
        lengths.resize(halo.total(), 0);
        halo.update(&mut lengths);
        let longest = lengths.iter().copied().max().unwrap_or(0);
        let longest = communicator.max(f64::from(longest)) as usize;
        let mut received = vec![Vec::new(); halo.total() - owned];
        for k in 0..longest {
            let mut layer: Vec<[u64; 2]> = vec![[0; 2]; halo.total()];
            for i in 0..owned {
                if let Some(&(column, value)) = rows.row(i).get(k) {
                    let [rank, index] = self.global(column);
                    layer[i] = [u64::from(rank) << 32 | u64::from(index), value.to_bits()];
                }
            }
            halo.update(&mut layer);
            for (i, row) in (owned..).zip(&mut received) {
                if k < lengths[i] as usize {
                    let [name, value] = layer[i];
                    let column = self.local([(name >> 32) as u32, name as u32]);
                    row.push((column, f64::from_bits(value)));
                }
            }
        }
        for row in received {
            rows.entries.extend(row);
            rows.close();
        }
    }
}

/// How a level hangs together with the next one.
pub(super) struct Transfer {
    /// P on the rows of owned and halo entries; columns are local coarse indices.
    pub(super) prolongation: Rows,
    /// Pᵀ on owned coarse rows; columns are local fine indices.
    pub(super) restriction: Rows,
    /// PᵀAP.
    pub(super) coarse: PairMatrix,
}

impl Transfer {
    /// P = (1 − ω D_F⁻¹ A_F) P₀: piecewise constants smoothed once along strong couplings (Vaněk et al. 1996). A_F
    /// has the weak and the negative couplings lumped to its diagonal, so that its spectrum ends below 2 and ω needs no
    /// estimate, and rows without shift still interpolate constants exactly. Collective.
    pub(super) fn new(
        fine: &PairMatrix,
        strength: &Strength<'_>,
        aggregates: &[u32],
        count: usize,
        omega: f64,
    ) -> Result<Self, SolveError> {
        let halo = fine.halo();
        let (owned, total) = (halo.owned(), halo.total());
        let rank = halo.communicator().rank() as u32;
        let mut names = Names::new(rank, count);
        let mut groups: Vec<[u32; 2]> = aggregates.iter().map(|&a| [rank, a]).collect();
        groups.resize(total, [0, NONE]);
        halo.update(&mut groups);
        let local = |name: [u32; 2]| match name {
            [_, NONE] => NONE,
            name => names.local(name),
        };
        let groups: Vec<u32> = groups.into_iter().map(local).collect();

        let mut sums = Sums {
            place: vec![0; count],
        };
        let mut prolongation = Rows::with_capacity(total, 4 * owned);
        // P 1: exactly one where the constant is interpolated.
        let mut unity = vec![1.0; owned];
        for i in 0..owned {
            if groups[i] != NONE {
                let shift = fine.shift()[i];
                let coupled: f64 = strength.row(i).map(|(_, w)| w).sum();
                if coupled == 0.0 {
                    sums.add(&mut prolongation, groups[i], 1.0);
                } else {
                    let scale = omega / (coupled + shift);
                    let mut blind = 0.0;
                    sums.add(&mut prolongation, groups[i], 1.0 - omega);
                    for (j, w) in strength.row(i) {
                        match groups[j] {
                            NONE => blind += w,
                            group => sums.add(&mut prolongation, group, scale * w),
                        }
                    }
                    unity[i] -= scale * (shift + blind);
                }
            } else {
                unity[i] = 0.0;
            }
            prolongation.close();
        }
        names.exchange(halo, &mut prolongation);
        unity.resize(total, 0.0);
        halo.update(&mut unity);

        let mut product = Rows::with_capacity(total, 10 * owned);
        // A P 1, exactly zero where P 1 is constant and the row has no shift.
        let mut image = vec![0.0; total];
        for i in 0..owned {
            let coupled: f64 = fine.row(i).map(|(_, w)| w).sum();
            for &(group, p) in prolongation.row(i) {
                sums.add(&mut product, group, (coupled + fine.shift()[i]) * p);
            }
            image[i] = fine.shift()[i] * unity[i];
            for (j, w) in fine.row(i) {
                image[i] += w * (unity[i] - unity[j]);
                for &(group, p) in prolongation.row(j) {
                    sums.add(&mut product, group, -w * p);
                }
            }
            product.close();
        }
        names.exchange(halo, &mut product);
        halo.update(&mut image);

        let restriction = prolongation.transposed(count);
        let mut coarse = Rows::with_capacity(count, 27 * count);
        let mut shift = vec![0.0; count];
        for group in 0..count {
            for &(i, p) in restriction.row(group) {
                shift[group] += p * image[i as usize];
                for &(other, value) in product.row(i as usize) {
                    sums.add(&mut coarse, other, p * value);
                }
            }
            coarse.close();
        }
        let coarse = names.matrix(halo, &coarse, &shift)?;
        Ok(Self {
            prolongation,
            restriction,
            coarse,
        })
    }
}

impl Names {
    /// The coarse matrix from its rows: what is dropped as noise goes to the diagonal. Collective.
    fn matrix(&self, fine: &Halo, rows: &Rows, shift: &[f64]) -> Result<PairMatrix, SolveError> {
        let halo = Halo::new(fine.communicator(), self.owned, &self.foreign);
        let own = |i: usize| rows.row(i).iter().find(|e| e.0 as usize == i);
        let root = |i: usize| own(i).map_or(0.0, |e| e.1.max(0.0).sqrt());
        let mut roots: Vec<f64> = (0..self.owned).map(root).collect();
        roots.resize(halo.total(), 0.0);
        halo.update(&mut roots);
        let couplings = |i: usize| {
            let entries = rows.row(i).iter();
            let heard = |e: &&(u32, f64)| e.1.abs() > NOISE * roots[i] * roots[e.0 as usize];
            let others = entries.filter(|e| e.0 as usize != i).filter(heard);
            others.map(|&(j, value)| (j, -value)).collect::<Vec<_>>()
        };
        let rows = |i: usize| couplings(i).into_iter();
        PairMatrix::from_rows(&halo, rows, &vec![false; halo.total()], Some(shift))
    }
}
