//! The symmetric matrix of diffusive pair weights.

use crate::{LinearOperator, SolveError, Value, vectors::BLOCK};
use fibreflow_mesh::{DualGeometry, LocalMesh};
use fibreflow_parallel::Halo;
use rayon::prelude::*;
use std::ops::Range;

/// A x_i = d_i x_i − Σ_j w_ij x_j with d_i = s_i + Σ_j w_ij: minus the integrated Laplacian of NUMERICS section 1,
/// plus a diagonal shift s.
///
/// Rows of fixed (Dirichlet) nodes are the identity and their couplings are taken out of the free rows, so that the
/// matrix stays symmetric; [`PairMatrix::lift`] puts their values into the right-hand side. A row without shift and
/// without fixed neighbours maps a constant to exactly zero.
#[derive(Clone, Debug)]
pub struct PairMatrix {
    halo: Halo,
    offsets: Vec<u32>,
    columns: Vec<u32>,
    weights: Vec<f64>,
    diagonal: Vec<f64>,
    shift: Vec<f64>,
    fixed: Vec<bool>,
    /// Couplings of free rows to fixed nodes, in row order.
    lifted: Vec<Lifted>,
    /// Owned rows that read halo entries; empty when none does.
    border: Vec<bool>,
}

#[derive(Clone, Copy, Debug)]
struct Lifted {
    row: u32,
    column: u32,
    weight: f64,
}

impl PairMatrix {
    /// From the diffusive weights of a mesh \[m\].
    ///
    /// `fixed` marks Dirichlet nodes and has total length, the same on every rank that holds a node. `shift` is s for
    /// the owned nodes (longer is allowed), zero when not given.
    ///
    /// # Errors
    /// [`SolveError::Length`] when an argument is too short.
    pub fn new(
        mesh: &LocalMesh,
        geometry: &DualGeometry,
        fixed: &[bool],
        shift: Option<&[f64]>,
    ) -> Result<Self, SolveError> {
        let rows = |i: usize| {
            let entries = geometry.row(i);
            let weights = geometry.faces[entries.clone()].iter().map(|f| f[3]);
            geometry.columns[entries].iter().copied().zip(weights)
        };
        Self::from_rows(&mesh.halo, rows, fixed, shift)
    }

    /// From rows of (column, weight): `rows(i)` for every owned i; columns are local indices, owned or halo.
    ///
    /// The caller vouches for w_ij = w_ji, across ranks too. Zero weights and self-couplings are dropped.
    ///
    /// # Errors
    /// [`SolveError::Length`] when `fixed` or `shift` is too short.
    pub fn from_rows<R>(
        halo: &Halo,
        rows: impl Fn(usize) -> R,
        fixed: &[bool],
        shift: Option<&[f64]>,
    ) -> Result<Self, SolveError>
    where
        R: Iterator<Item = (u32, f64)>,
    {
        let owned = halo.owned();
        check_length("fixed", fixed.len(), halo.total())?;
        if let Some(shift) = shift {
            check_length("shift", shift.len(), owned)?;
        }
        let mut matrix = Self {
            halo: halo.clone(),
            offsets: vec![0],
            columns: Vec::new(),
            weights: Vec::new(),
            diagonal: Vec::with_capacity(owned),
            shift: shift.map_or_else(|| vec![0.0; owned], |s| s[..owned].to_vec()),
            fixed: fixed[..halo.total()].to_vec(),
            lifted: Vec::new(),
            border: vec![false; owned],
        };
        for i in 0..owned {
            matrix.push_row(i, rows(i));
        }
        if !matrix.border.contains(&true) {
            matrix.border.clear();
        }
        Ok(matrix)
    }

    fn push_row(&mut self, i: usize, entries: impl Iterator<Item = (u32, f64)>) {
        if self.fixed[i] {
            self.shift[i] = 1.0;
            self.diagonal.push(1.0);
            self.offsets.push(self.columns.len() as u32);
            return;
        }
        // Free couplings are summed first and in the order of the product, so that A·1 = 0 holds bitwise.
        let (mut coupled, mut lifted) = (0.0, 0.0);
        for (column, weight) in entries {
            let j = column as usize;
            if weight == 0.0 || j == i {
                continue;
            }
            if self.fixed[j] {
                lifted += weight;
                self.lifted.push(Lifted {
                    row: i as u32,
                    column,
                    weight,
                });
            } else {
                coupled += weight;
                self.columns.push(column);
                self.weights.push(weight);
                self.border[i] |= j >= self.halo.owned();
            }
        }
        self.diagonal.push(coupled + (lifted + self.shift[i]));
        self.offsets.push(self.columns.len() as u32);
    }

    /// Rows this rank owns.
    pub fn owned(&self) -> usize {
        self.halo.owned()
    }

    /// Exchange of the fields it acts on.
    pub fn halo(&self) -> &Halo {
        &self.halo
    }

    /// d of the owned rows; 1 on fixed rows.
    pub fn diagonal(&self) -> &[f64] {
        &self.diagonal
    }

    /// Fixed nodes, total length.
    pub fn fixed(&self) -> &[bool] {
        &self.fixed
    }

    /// True when the constant is in the null space: no shift and no fixed node on any rank. Collective.
    pub fn is_singular(&self) -> bool {
        let regular = !self.lifted.is_empty() || self.shift.iter().any(|&s| s != 0.0);
        !self.halo.communicator().any(regular)
    }

    /// Free columns and weights of row i.
    pub(crate) fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> {
        let entries = self.entries(i);
        let columns = self.columns[entries.clone()].iter();
        columns
            .map(|&j| j as usize)
            .zip(self.weights[entries].iter().copied())
    }

    /// s of the owned rows; 1 on fixed rows.
    pub(crate) fn shift(&self) -> &[f64] {
        &self.shift
    }

    /// The same matrix, its couplings to fixed nodes counted as shift.
    pub(crate) fn without_lifted(&self) -> Self {
        let mut matrix = self.clone();
        for entry in matrix.lifted.drain(..) {
            matrix.shift[entry.row as usize] += entry.weight;
        }
        matrix
    }

    /// The same matrix with owned row `order[i]` at place i, `order` being its own inverse; rows that other ranks know
    /// must stay. Of one without couplings to fixed nodes.
    pub(crate) fn reordered(&self, order: &[u32]) -> Result<Self, SolveError> {
        let place = |j: usize| order.get(j).map_or(j as u32, |&p| p);
        let row = |i: usize| {
            let row = self.row(order[i] as usize);
            row.map(|(j, w)| (place(j), w))
        };
        let shift: Vec<f64> = order.iter().map(|&i| self.shift[i as usize]).collect();
        let fixed = vec![false; self.halo.total()];
        Self::from_rows(&self.halo, row, &fixed, Some(&shift))
    }

    /// Couplings in the owned rows.
    pub(crate) fn entries_stored(&self) -> usize {
        self.columns.len()
    }

    fn entries(&self, i: usize) -> Range<usize> {
        self.offsets[i] as usize..self.offsets[i + 1] as usize
    }

    /// Moves Dirichlet values to the right-hand side: adds Σ_j w_ij g_j over fixed j to the free rows and sets the
    /// fixed rows to g. `values` is valid (halo entries up to date); `rhs` has owned length or longer.
    pub fn lift<T: Value>(&self, values: &[T], rhs: &mut [T]) {
        self.lift_scaled(1.0, values, rhs);
    }

    pub(crate) fn lift_scaled<T: Value>(&self, scale: f64, values: &[T], rhs: &mut [T]) {
        for entry in &self.lifted {
            let row = &mut rhs[entry.row as usize];
            *row = row.plus(scale * entry.weight, values[entry.column as usize]);
        }
        let owned = self.owned();
        for ((row, &value), &fixed) in rhs[..owned].iter_mut().zip(values).zip(&self.fixed) {
            if fixed {
                *row = value;
            }
        }
    }

    /// y = A x; see [`LinearOperator::apply`].
    pub fn multiply<T: Value>(&self, x: &mut [T], y: &mut [T]) {
        let diagonal = &self.diagonal;
        self.gather(x, y, |i, own, neighbours, _| {
            own.scaled(diagonal[i]).plus(-1.0, neighbours)
        });
    }

    /// y_i = `finish`(i, x_i, Σ_j w_ij x_j, old y_i) over owned rows; rows that need no halo run while messages travel.
    pub(crate) fn gather<T: Value>(
        &self,
        x: &mut [T],
        y: &mut [T],
        finish: impl Fn(usize, T, T, T) -> T + Sync,
    ) {
        let y = &mut y[..self.owned()];
        if self.border.is_empty() {
            self.halo
                .update_while(x, |x| self.gather_rows(x, y, &finish, |_| true));
            return;
        }
        self.halo.update_while(x, |x| {
            self.gather_rows(x, y, &finish, |i| !self.border[i]);
        });
        self.gather_rows(x, y, &finish, |i| self.border[i]);
    }

    fn gather_rows<T: Value>(
        &self,
        x: &[T],
        y: &mut [T],
        finish: &(impl Fn(usize, T, T, T) -> T + Sync),
        wanted: impl Fn(usize) -> bool + Sync,
    ) {
        y.par_chunks_mut(BLOCK).enumerate().for_each(|(block, y)| {
            for (i, y) in (block * BLOCK..).zip(y) {
                if wanted(i) {
                    let entries = self.entries(i);
                    let columns = &self.columns[entries.clone()];
                    let mut sum = T::ZERO;
                    for (&j, &w) in columns.iter().zip(&self.weights[entries]) {
                        sum = sum.plus(w, x[j as usize]);
                    }
                    *y = finish(i, x[i], sum, *y);
                }
            }
        });
    }
}

fn check_length(what: &'static str, found: usize, expected: usize) -> Result<(), SolveError> {
    if found < expected {
        return Err(SolveError::Length {
            what,
            found,
            expected,
        });
    }
    Ok(())
}

impl<T: Value> LinearOperator<T> for PairMatrix {
    fn halo(&self) -> &Halo {
        &self.halo
    }

    fn apply(&self, x: &mut [T], y: &mut [T]) {
        self.multiply(x, y);
    }
}
