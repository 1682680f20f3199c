//! A matrix of few unknowns a rank, held whole by every rank, and fields for it.

use crate::{PairMatrix, SolveError};
use fibreflow_parallel::{Communicator, Halo, Portable};

/// Brings a distributed field together on every rank, the same on each.
#[derive(Clone, Debug)]
pub(crate) struct Gathering<T> {
    /// Makes the field of all ranks local.
    halo: Halo,
    /// Unknowns of the ranks before this one.
    before: usize,
    /// As the halo orders it: owned, then the other ranks in rank order.
    field: Vec<T>,
    /// In rank order.
    ordered: Vec<T>,
}

impl<T: Portable> Gathering<T> {
    /// With the whole matrix, rows in rank order. Collective.
    pub(crate) fn new(matrix: &PairMatrix) -> Result<(Self, PairMatrix), SolveError> {
        let communicator = matrix.halo().communicator();
        let (owned, rank) = (matrix.owned(), communicator.rank());
        let counts = communicator.all_gather(&[owned as u32]);
        let counts: Vec<usize> = counts.iter().map(|c| c[0] as usize).collect();
        let (before, size) = (counts[..rank].iter().sum(), counts.iter().sum());
        let mut numbers: Vec<u32> = (before as u32..).take(owned).collect();
        numbers.resize(matrix.halo().total(), 0);
        matrix.halo().update(&mut numbers);
        let (mut entries, mut rows) = (Vec::new(), Vec::new());
        for i in 0..owned {
            let first = entries.len();
            let row = matrix.row(i);
            entries.extend(row.map(|(j, w)| [u64::from(numbers[j]), w.to_bits()]));
            let length = (entries.len() - first) as u64;
            rows.push([length, matrix.shift()[i].to_bits()]);
        }
        let entries = communicator.all_gather(&entries).concat();
        let rows = communicator.all_gather(&rows).concat();
        let mut starts = vec![0];
        for row in &rows {
            starts.push(starts[starts.len() - 1] + row[0] as usize);
        }
        let shift: Vec<f64> = rows.iter().map(|row| f64::from_bits(row[1])).collect();
        let row = |i: usize| {
            let row = entries[starts[i]..starts[i + 1]].iter();
            row.map(|e| (e[0] as u32, f64::from_bits(e[1])))
        };
        let alone = Halo::none(&Communicator::single(), size);
        let whole = PairMatrix::from_rows(&alone, row, &vec![false; size], Some(&shift))?;
        let owners: Vec<(u32, u32)> = (0..communicator.size())
            .filter(|&r| r != rank)
            .flat_map(|r| (0..counts[r] as u32).map(move |k| (r as u32, k)))
            .collect();
        let gathering = Self {
            halo: Halo::new(communicator, owned, &owners),
            before,
            field: vec![T::zeroed(); size],
            ordered: vec![T::zeroed(); size],
        };
        Ok((gathering, whole))
    }

    /// Entries of this rank, to be written.
    pub(crate) fn own(&mut self) -> &mut [T] {
        &mut self.field[..self.halo.owned()]
    }

    /// Entries of all ranks in rank order. Collective.
    pub(crate) fn collect(&mut self) -> &mut [T] {
        let (owned, before) = (self.halo.owned(), self.before);
        self.halo.update(&mut self.field);
        let (own, others) = self.field.split_at(owned);
        self.ordered[..before].copy_from_slice(&others[..before]);
        self.ordered[before..before + owned].copy_from_slice(own);
        self.ordered[before + owned..].copy_from_slice(&others[before..]);
        &mut self.ordered
    }

    /// This rank's part of a field in rank order.
    pub(crate) fn part(&self) -> std::ops::Range<usize> {
        self.before..self.before + self.halo.owned()
    }
}
