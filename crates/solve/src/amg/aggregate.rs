//! Aggregates along strong couplings of a rank's own rows (Vaněk, Mandel & Brezina 1996).

use crate::{PairMatrix, merge::NONE};

/// A row whose shift exceeds this multiple of its couplings is left to the smoother.
const DOMINANT: f64 = 4.0;

/// Which couplings of a matrix are strong: positive, and at least `threshold` times the geometric mean of the largest
/// ones of the two rows. Symmetric, so that both ends agree, across ranks too.
pub(super) struct Strength<'a> {
    matrix: &'a PairMatrix,
    threshold: f64,
    /// Square root of the largest coupling of every local row.
    largest: Vec<f64>,
}

impl<'a> Strength<'a> {
    /// Collective.
    pub(super) fn new(matrix: &'a PairMatrix, threshold: f64) -> Self {
        let row = |i: usize| matrix.row(i).fold(0.0, |s: f64, (_, w)| s.max(w)).sqrt();
        let mut largest: Vec<f64> = (0..matrix.owned()).map(row).collect();
        largest.resize(matrix.halo().total(), 0.0);
        matrix.halo().update(&mut largest);
        Self {
            matrix,
            threshold,
            largest,
        }
    }

    /// Strong couplings of an owned row.
    pub(super) fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> {
        let limit = self.threshold * self.largest[i];
        let strong = move |&(j, w): &(usize, f64)| w > 0.0 && w >= limit * self.largest[j];
        self.matrix.row(i).filter(strong)
    }
}

/// Aggregate of every owned row, none for those the coarse level does not see, and the number of aggregates.
///
/// A row all of whose strong neighbours are free makes an aggregate with them; what is left joins the aggregate it is
/// bound to most, or makes one with its free neighbours. Strong neighbours on other ranks are passed over. Sequential
/// in row order: the same for any number of threads.
pub(super) fn aggregate(matrix: &PairMatrix, strength: &Strength<'_>) -> (Vec<u32>, usize) {
    let owned = matrix.owned();
    let seen = |i: usize| {
        let coupled: f64 = matrix.row(i).map(|(_, w)| w.abs()).sum();
        coupled > 0.0 && matrix.shift()[i] <= DOMINANT * coupled
    };
    let seen: Vec<bool> = (0..owned).map(seen).collect();
    let own = |i: usize| strength.row(i).filter(|&(j, _)| j < owned && seen[j]);
    let (mut aggregates, mut count) = (vec![NONE; owned], 0);
    let mut found = |aggregates: &mut Vec<u32>, i: usize| {
        aggregates[i] = count;
        for (j, _) in own(i) {
            if aggregates[j] == NONE {
                aggregates[j] = count;
            }
        }
        count += 1;
    };
    for i in 0..owned {
        let mut free = own(i).map(|(j, _)| aggregates[j] == NONE).peekable();
        if seen[i] && aggregates[i] == NONE && free.peek().is_some() && free.all(|f| f) {
            drop(free);
            found(&mut aggregates, i);
        }
    }
    let roots = aggregates.clone();
    for i in (0..owned).filter(|&i| seen[i]) {
        if roots[i] == NONE {
            // The first of equals, so that ties depend on the order of the rows alone.
            let larger = |best: (u32, f64), (j, w): (usize, f64)| {
                if roots[j] != NONE && w > best.1 {
                    (roots[j], w)
                } else {
                    best
                }
            };
            aggregates[i] = own(i).fold((NONE, 0.0), larger).0;
        }
    }
    for i in (0..owned).filter(|&i| seen[i]) {
        if aggregates[i] == NONE {
            found(&mut aggregates, i);
        }
    }
    (aggregates, count as usize)
}
