//! A level with few unknowns a rank, held whole by every rank: messages would cost more than the work.

use super::hierarchy::Node;
use crate::{PairMatrix, SolveError};
use fibreflow_parallel::{Communicator, Halo};

/// The level and what follows, the same on every rank.
#[derive(Clone, Debug)]
pub(super) struct Gathered {
    /// Makes the right-hand side of all ranks local.
    halo: Halo,
    /// Unknowns of the ranks before this one.
    before: usize,
    /// D^½ of owned rows.
    pub(super) roots: Vec<f64>,
    /// As the halo orders it: owned, then the other ranks in rank order.
    pub(super) rhs: Vec<f32>,
    pub(super) owned: usize,
    pub(super) x: Vec<f32>,
    /// Right-hand side in rank order.
    ordered: Vec<f32>,
    pub(super) whole: Box<Node>,
}

impl Gathered {
    /// `build` makes the hierarchy of the whole matrix. Collective.
    pub(super) fn new(
        matrix: &PairMatrix,
        build: impl FnOnce(PairMatrix) -> Result<Node, SolveError>,
    ) -> Result<Self, SolveError> {
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
            entries.extend(
                matrix
                    .row(i)
                    .map(|(j, w)| (u64::from(numbers[j]), w.to_bits())),
            );
            let length = (entries.len() - first) as u64;
            rows.push([length, matrix.shift()[i].to_bits()]);
        }
        let entries: Vec<[u64; 2]> = entries.into_iter().map(|(j, w)| [j, w]).collect();
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
        let whole = build(whole)?;
        let owners: Vec<(u32, u32)> = (0..communicator.size())
            .filter(|&r| r != rank)
            .flat_map(|r| (0..counts[r] as u32).map(move |k| (r as u32, k)))
            .collect();
        Ok(Self {
            halo: Halo::new(communicator, owned, &owners),
            before,
            roots: whole.roots()[before..before + owned].to_vec(),
            rhs: vec![0.0; size],
            owned,
            x: vec![0.0; owned],
            ordered: vec![0.0; size],
            whole: Box::new(whole),
        })
    }

    /// `x` from `rhs` of the owned rows. Collective.
    pub(super) fn solve(&mut self) {
        let (owned, before) = (self.owned, self.before);
        self.halo.update(&mut self.rhs);
        let (own, others) = self.rhs.split_at(owned);
        self.ordered[..before].copy_from_slice(&others[..before]);
        self.ordered[before..before + owned].copy_from_slice(own);
        self.ordered[before + owned..].copy_from_slice(&others[before..]);
        let ordered = &self.ordered;
        self.whole.solve(|i| ordered[i]);
        self.x
            .copy_from_slice(&self.whole.answer()[before..before + owned]);
    }
}
