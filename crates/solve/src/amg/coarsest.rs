//! The last level: small enough that every rank holds its rows of the inverse.

use crate::{PairMatrix, SolveError, vectors::dot};
use faer::{
    Mat, Side,
    linalg::solvers::{Llt, Solve},
};
use fibreflow_parallel::Halo;

/// Pivot over diagonal entry below which a matrix counts as singular.
const SMALLEST_PIVOT: f64 = 1e-13;

/// Dense inverse of the coarsest matrix, this rank's rows.
#[derive(Clone, Debug)]
pub(super) struct Coarsest {
    /// Makes the right-hand side of all ranks local.
    halo: Halo,
    /// Unknowns of the ranks before this one.
    before: usize,
    /// Owned rows of the inverse, row-major; columns in rank order.
    inverse: Vec<f64>,
    /// Right-hand side as the halo orders it: owned, then the other ranks in rank order.
    gathered: Vec<f64>,
    /// The same in rank order.
    ordered: Vec<f64>,
}

impl Coarsest {
    /// Factors the matrix on every rank. With constants in the null space s·11ᵀ/n is added, which leaves the answer
    /// to right-hand sides of mean zero untouched and gives it mean zero. Collective.
    pub(super) fn new(matrix: &PairMatrix, singular: bool) -> Result<Self, SolveError> {
        let communicator = matrix.halo().communicator();
        let (owned, rank) = (matrix.owned(), communicator.rank());
        let counts = communicator.all_gather(&[owned as u32]);
        let starts: Vec<usize> = counts
            .iter()
            .scan(0, |start, count| {
                let here = *start;
                *start += count[0] as usize;
                Some(here)
            })
            .collect();
        let (before, size) = (starts[rank], counts.iter().map(|c| c[0] as usize).sum());

        let mut numbers: Vec<u32> = (before as u32..).take(owned).collect();
        numbers.resize(matrix.halo().total(), 0);
        matrix.halo().update(&mut numbers);
        let mut entries = Vec::new();
        for i in 0..owned {
            let row = f64::from(numbers[i]);
            entries.push([row, row, matrix.diagonal()[i]]);
            entries.extend(matrix.row(i).map(|(j, w)| [row, f64::from(numbers[j]), -w]));
        }
        let mut dense = Mat::<f64>::zeros(size, size);
        for [row, column, value] in communicator.all_gather(&entries).into_iter().flatten() {
            dense[(row as usize, column as usize)] += value;
        }
        if singular {
            let scale = (0..size).map(|i| dense[(i, i)]).sum::<f64>() / size as f64;
            let added = scale / size as f64;
            dense.col_iter_mut().for_each(|column| {
                column.iter_mut().for_each(|value| *value += added);
            });
        }
        let failed = SolveError::Coarsest { unknowns: size };
        let factor = Llt::new(dense.as_ref(), Side::Lower).map_err(|_| failed.clone())?;
        let lower = factor.L();
        // A second null vector survives as a pivot of round-off size.
        if (0..size).any(|i| lower[(i, i)] * lower[(i, i)] < SMALLEST_PIVOT * dense[(i, i)]) {
            return Err(failed);
        }
        let unit = Mat::from_fn(size, owned, |i, j| f64::from(u8::from(i == before + j)));
        let columns = factor.solve(&unit);
        let owners: Vec<(u32, u32)> = (0..communicator.size())
            .filter(|&r| r != rank)
            .flat_map(|r| (0..counts[r][0]).map(move |k| (r as u32, k)))
            .collect();
        Ok(Self {
            halo: Halo::new(communicator, owned, &owners),
            before,
            inverse: (0..owned)
                .flat_map(|i| (0..size).map(move |j| (i, j)))
                .map(|(i, j)| columns[(j, i)])
                .collect(),
            gathered: vec![0.0; size],
            ordered: vec![0.0; size],
        })
    }

    /// x = A⁻¹ b on owned entries. Collective.
    pub(super) fn solve(&mut self, rhs: &[f64], x: &mut [f64]) {
        let (owned, size) = (rhs.len(), self.gathered.len());
        self.gathered[..owned].copy_from_slice(rhs);
        self.halo.update(&mut self.gathered);
        let (own, others) = self.gathered.split_at(owned);
        self.ordered[..self.before].copy_from_slice(&others[..self.before]);
        self.ordered[self.before..self.before + owned].copy_from_slice(own);
        self.ordered[self.before + owned..].copy_from_slice(&others[self.before..]);
        if size > 0 {
            for (x, row) in x.iter_mut().zip(self.inverse.chunks(size)) {
                *x = dot(row, &self.ordered);
            }
        }
    }
}
