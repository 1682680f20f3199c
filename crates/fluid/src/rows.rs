//! Parallel loops over rows: every row is written by one task, so the result does not depend on the thread count.

use rayon::prelude::*;

/// Rows per task.
const BLOCK: usize = 1024;

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

/// Calls `kernel(i, &mut a[i], &mut b[i])` for every i.
pub(crate) fn each_pair<A: Send, B: Send>(
    a: &mut [A],
    b: &mut [B],
    kernel: impl Fn(usize, &mut A, &mut B) + Sync,
) {
    a.par_chunks_mut(BLOCK)
        .zip(b.par_chunks_mut(BLOCK))
        .enumerate()
        .for_each(|(block, (a, b))| {
            for (i, (a, b)) in (block * BLOCK..).zip(a.iter_mut().zip(b)) {
                kernel(i, a, b);
            }
        });
}

/// Calls `kernel(i, entries of row i, &mut out[i])` for every i; row i owns entries `offsets[i]..offsets[i + 1]`.
pub(crate) fn with_entries<E: Send, O: Send>(
    offsets: &[u32],
    entries: &mut [E],
    out: &mut [O],
    kernel: impl Fn(usize, &mut [E], &mut O) + Sync,
) {
    split(0, offsets, entries, out, &kernel);
}

fn split<E: Send, O: Send>(
    first: usize,
    offsets: &[u32],
    entries: &mut [E],
    out: &mut [O],
    kernel: &(impl Fn(usize, &mut [E], &mut O) + Sync),
) {
    if out.len() > BLOCK {
        let middle = out.len() / 2;
        let cut = (offsets[middle] - offsets[0]) as usize;
        let (left, right) = entries.split_at_mut(cut);
        let (out_left, out_right) = out.split_at_mut(middle);
        rayon::join(
            || split(first, &offsets[..=middle], left, out_left, kernel),
            || split(first + middle, &offsets[middle..], right, out_right, kernel),
        );
        return;
    }
    let mut rest = entries;
    for (k, out) in out.iter_mut().enumerate() {
        let (row, others) = rest.split_at_mut((offsets[k + 1] - offsets[k]) as usize);
        kernel(first + k, row, out);
        rest = others;
    }
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
        with_entries(&offsets, &mut entries, &mut out, |i, row, out| {
            *out = row.len();
            row.iter_mut().for_each(|e| *e += i * 1_000_000);
        });
        for i in 0..rows {
            let range = offsets[i] as usize..offsets[i + 1] as usize;
            assert_eq!(out[i], range.len());
            for e in range {
                assert_eq!(entries[e], i * 1_000_000 + e);
            }
        }
    }
}
