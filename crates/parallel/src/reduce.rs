//! Sums in fixed blocks: bitwise the same for any number of threads.

use rayon::prelude::*;
use std::ops::Range;

/// Entries per block; a constant of the program, never of the machine.
const BLOCK: usize = 4096;

fn blocks(length: usize) -> impl IndexedParallelIterator<Item = Range<usize>> {
    (0..length.div_ceil(BLOCK))
        .into_par_iter()
        .map(move |b| b * BLOCK..((b + 1) * BLOCK).min(length))
}

/// Sum of `partial(range)` over fixed blocks of `0..length`, pairwise. Local to the rank.
pub fn block_sum(length: usize, partial: impl Fn(Range<usize>) -> f64 + Sync + Send) -> f64 {
    block_sums::<1>(length, |range| [partial(range)])[0]
}

/// Several sums in one pass, see [`block_sum`].
pub fn block_sums<const N: usize>(
    length: usize,
    partial: impl Fn(Range<usize>) -> [f64; N] + Sync + Send,
) -> [f64; N] {
    block_tree(0..length.div_ceil(BLOCK), length, &partial)
}

/// Halves joined again and again: the tree depends on the length alone, and nothing is allocated.
fn block_tree<const N: usize>(
    blocks: Range<usize>,
    length: usize,
    partial: &(impl Fn(Range<usize>) -> [f64; N] + Sync),
) -> [f64; N] {
    if blocks.len() <= 1 {
        return partial(blocks.start * BLOCK..(blocks.end * BLOCK).min(length));
    }
    let middle = blocks.start + blocks.len() / 2;
    let (left, right) = rayon::join(
        || block_tree(blocks.start..middle, length, partial),
        || block_tree(middle..blocks.end, length, partial),
    );
    std::array::from_fn(|k| left[k] + right[k])
}

/// Largest `partial(range)` over blocks of `0..length`; `f64::NEG_INFINITY` when empty. A NaN wins. Local to the rank.
pub fn block_max(length: usize, partial: impl Fn(Range<usize>) -> f64 + Sync + Send) -> f64 {
    let larger = |a: f64, b: f64| if a.is_nan() || a > b { a } else { b };
    blocks(length)
        .map(partial)
        .reduce(|| f64::NEG_INFINITY, larger)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_do_not_depend_on_the_thread_count() {
        let values: Vec<f64> = (0..100_003).map(|i| (i as f64 * 0.7).sin() * 1e3).collect();
        let sum = || block_sum(values.len(), |r| values[r].iter().sum());
        let pool = |n| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(n)
                .build()
                .expect("pool")
        };
        let one = pool(1).install(sum);
        let four = pool(4).install(sum);
        assert_eq!(one.to_bits(), four.to_bits());
    }

    #[test]
    fn a_nan_is_not_hidden_by_the_maximum() {
        assert!(block_max(10, |r| if r.contains(&3) { f64::NAN } else { 1.0 }).is_nan());
        assert_eq!(block_max(0, |_| 1.0), f64::NEG_INFINITY);
    }
}
