//! Parallel loops over rows: every row is written by one task, so the result does not depend on the thread count.
//!
//! What kernels return is combined over a tree that depends on the number of rows alone.

use rayon::prelude::*;

/// Rows per task.
const BLOCK: usize = 1024;

/// The larger; a NaN wins.
pub(crate) fn largest(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// The sum.
pub(crate) fn sum(a: f64, b: f64) -> f64 {
    a + b
}

/// A field that takes no memory, for kernels with less to write than they could.
pub(crate) fn nothing(rows: usize) -> Vec<()> {
    vec![(); rows]
}

/// Calls `kernel(i, &mut out[i])` for every i.
pub(crate) fn each<O: Send>(out: &mut [O], kernel: impl Fn(usize, &mut O) + Sync) {
    out.par_chunks_mut(BLOCK)
        .enumerate()
        .for_each(|(block, out)| {
            for (i, out) in (block * BLOCK..).zip(out) {
                kernel(i, out);
            }
        });
}

/// Calls `kernel(i, &mut a[i], &mut b[i])` for every i and combines what it returns; zero without rows.
pub(crate) fn each_pair<A: Send, B: Send>(
    a: &mut [A],
    b: &mut [B],
    combine: impl Fn(f64, f64) -> f64 + Copy + Sync,
    kernel: impl Fn(usize, &mut A, &mut B) -> f64 + Sync,
) -> f64 {
    split_pair(0, a, b, combine, &kernel)
}

fn split_pair<A: Send, B: Send>(
    first: usize,
    a: &mut [A],
    b: &mut [B],
    combine: impl Fn(f64, f64) -> f64 + Copy + Sync,
    kernel: &(impl Fn(usize, &mut A, &mut B) -> f64 + Sync),
) -> f64 {
    if a.len() > BLOCK {
        let middle = a.len() / 2;
        let (a_left, a_right) = a.split_at_mut(middle);
        let (b_left, b_right) = b.split_at_mut(middle);
        let (left, right) = rayon::join(
            || split_pair(first, a_left, b_left, combine, kernel),
            || split_pair(first + middle, a_right, b_right, combine, kernel),
        );
        return combine(left, right);
    }
    let mut total = 0.0;
    for (i, (a, b)) in (first..).zip(a.iter_mut().zip(b)) {
        total = combine(total, kernel(i, a, b));
    }
    total
}

/// As [`each_pair`] with `kernel(i, entries of row i, &mut a[i], &mut b[i])`; row i owns entries
/// `offsets[i]..offsets[i + 1]`.
pub(crate) fn with_entries<E: Send, A: Send, B: Send>(
    offsets: &[u32],
    entries: &mut [E],
    (a, b): (&mut [A], &mut [B]),
    combine: impl Fn(f64, f64) -> f64 + Copy + Sync,
    kernel: impl Fn(usize, &mut [E], &mut A, &mut B) -> f64 + Sync,
) -> f64 {
    split_entries(0, offsets, entries, (a, b), combine, &kernel)
}

fn split_entries<E: Send, A: Send, B: Send>(
    first: usize,
    offsets: &[u32],
    entries: &mut [E],
    (a, b): (&mut [A], &mut [B]),
    combine: impl Fn(f64, f64) -> f64 + Copy + Sync,
    kernel: &(impl Fn(usize, &mut [E], &mut A, &mut B) -> f64 + Sync),
) -> f64 {
    if a.len() > BLOCK {
        let middle = a.len() / 2;
        let cut = (offsets[middle] - offsets[0]) as usize;
        let (left, right) = entries.split_at_mut(cut);
        let (a_left, a_right) = a.split_at_mut(middle);
        let (b_left, b_right) = b.split_at_mut(middle);
        let (upper, lower) = (&offsets[..=middle], &offsets[middle..]);
        let (left, right) = rayon::join(
            || split_entries(first, upper, left, (a_left, b_left), combine, kernel),
            || {
                let out = (a_right, b_right);
                split_entries(first + middle, lower, right, out, combine, kernel)
            },
        );
        return combine(left, right);
    }
    let mut rest = entries;
    let mut total = 0.0;
    for (k, (a, b)) in a.iter_mut().zip(b).enumerate() {
        let (row, others) = rest.split_at_mut((offsets[k + 1] - offsets[k]) as usize);
        total = combine(total, kernel(first + k, row, a, b));
        rest = others;
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_sees_its_own_entries() {
        let rows = 5000usize;
        let lengths = (0..rows as u32).map(|i| i * i % 7);
        let offsets: Vec<u32> = std::iter::once(0)
            .chain(lengths.scan(0, |end, length| {
                *end += length;
                Some(*end)
            }))
            .collect();
        let mut entries: Vec<usize> = (0..offsets[rows] as usize).collect();
        let mut out = vec![0usize; rows];
        let mut none = nothing(rows);
        let visited = with_entries(
            &offsets,
            &mut entries,
            (&mut out, &mut none),
            sum,
            |i, row, out, ()| {
                *out = row.len();
                row.iter_mut().for_each(|e| *e += i * 1_000_000);
                1.0
            },
        );
        assert_eq!(visited, rows as f64);
        for i in 0..rows {
            let range = offsets[i] as usize..offsets[i + 1] as usize;
            assert_eq!(out[i], range.len());
            for e in range {
                assert_eq!(entries[e], i * 1_000_000 + e);
            }
        }
    }

    #[test]
    fn a_nan_is_not_hidden_by_the_largest() {
        let mut out = vec![0.0; 3000];
        let mut none = nothing(3000);
        let found = each_pair(&mut out, &mut none, largest, |i, _, ()| {
            if i == 1700 { f64::NAN } else { i as f64 }
        });
        assert!(found.is_nan());
    }
}
