//! Vector kernels in fixed blocks: the sums do not depend on the number of threads.

use rayon::prelude::*;

/// Numbers per block; a constant of the program, never of the machine.
pub(crate) const BLOCK: usize = 4096;

/// Room for block sums, kept between calls so that a reduction does not allocate.
#[derive(Clone, Debug, Default)]
pub(crate) struct Partials<const N: usize>(Vec<[f64; N]>);

impl<const N: usize> Partials<N> {
    /// Sum of the partial sums in block order.
    pub(crate) fn sum(&mut self, parts: impl IndexedParallelIterator<Item = [f64; N]>) -> [f64; N] {
        parts.collect_into_vec(&mut self.0);
        let add = |total: [f64; N], part: &[f64; N]| std::array::from_fn(|k| total[k] + part[k]);
        self.0.iter().fold([0.0; N], add)
    }
}

/// a·b of one block, in eight lanes (a plain sum does not vectorise).
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a_lanes, a_rest) = a.as_chunks::<8>();
    let (b_lanes, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (x, y) in a_lanes.iter().zip(b_lanes) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    sums.iter().sum::<f64>() + rest
}

/// Matching blocks of two fields.
pub(crate) fn blocks<'a>(
    a: &'a [f64],
    b: &'a [f64],
) -> impl IndexedParallelIterator<Item = (&'a [f64], &'a [f64])> {
    a.par_chunks(BLOCK).zip(b.par_chunks(BLOCK))
}

/// y = x + factor·y.
pub(crate) fn scale_and_add(y: &mut [f64], factor: f64, x: &[f64]) {
    y.par_chunks_mut(BLOCK)
        .zip(x.par_chunks(BLOCK))
        .for_each(|(y, x)| {
            y.iter_mut().zip(x).for_each(|(y, x)| *y = x + factor * *y);
        });
}
