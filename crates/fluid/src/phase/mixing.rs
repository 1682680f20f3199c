//! Acceleration of x ← x + f(x) by the differences of past iterates (Anderson 1965; Washio & Oosterlee 1997).

use crate::rows;
use fibreflow_parallel::{Communicator, block_sums};

/// Differences kept.
const KEPT: usize = 5;

/// Part of a difference of f that must be new.
const NEW: f64 = 1e-6;

#[derive(Default)]
pub(super) struct Mixing {
    /// Differences of x and of f, those of f orthonormal.
    pairs: Vec<[Vec<f64>; 2]>,
    /// x and f of the iteration before.
    last: [Vec<f64>; 2],
    started: bool,
}

impl Mixing {
    /// Forgets everything but its memory.
    pub fn restart(&mut self) {
        self.pairs.clear();
        self.started = false;
    }

    /// x of the next iteration from x and f(x), owned entries; products are weighted by `weights`. Collective.
    pub fn step(&mut self, x: &mut [f64], f: &[f64], weights: &[f64], communicator: &Communicator) {
        if self.started {
            self.learn(x, f, weights, communicator);
        }
        for (last, now) in self.last.iter_mut().zip([&*x, f]) {
            last.resize(now.len(), 0.0);
            last.copy_from_slice(now);
        }
        self.started = true;
        let pairs = &self.pairs;
        let shares = products(pairs, f, weights, communicator);
        rows::each(x, |i, x| {
            *x += f[i];
            for ([dx, df], share) in pairs.iter().zip(shares) {
                *x -= share * (dx[i] + df[i]);
            }
        });
    }

    fn learn(&mut self, x: &[f64], f: &[f64], weights: &[f64], communicator: &Communicator) {
        // The oldest makes room.
        let [mut dx, mut df] = if self.pairs.len() == KEPT {
            self.pairs.remove(0)
        } else {
            [x, f].map(|field| vec![0.0; field.len()])
        };
        let [last_x, last_f] = &self.last;
        rows::each(&mut dx, |i, dx| *dx = x[i] - last_x[i]);
        rows::each(&mut df, |i, df| *df = f[i] - last_f[i]);
        let norm = |df: &[f64]| {
            let [sum] = block_sums(df.len(), |range| {
                [range.map(|i| weights[i] * df[i] * df[i]).sum()]
            });
            communicator.sum(sum).sqrt()
        };
        let before = norm(&df);
        // Twice is enough.
        for _ in 0..2 {
            let shares = products(&self.pairs, &df, weights, communicator);
            for (kind, field) in [&mut dx, &mut df].into_iter().enumerate() {
                let pairs = &self.pairs;
                rows::each(field, |i, value| {
                    for (pair, share) in pairs.iter().zip(shares) {
                        *value -= share * pair[kind][i];
                    }
                });
            }
        }
        let size = norm(&df);
        if size > NEW * before {
            let inverse = 1.0 / size;
            rows::each(&mut dx, |_, v| *v *= inverse);
            rows::each(&mut df, |_, v| *v *= inverse);
            self.pairs.push([dx, df]);
        }
    }
}

/// Products of f with the differences of f.
fn products(
    pairs: &[[Vec<f64>; 2]],
    f: &[f64],
    weights: &[f64],
    communicator: &Communicator,
) -> [f64; KEPT] {
    let mut sums = block_sums::<KEPT>(f.len(), |range| {
        std::array::from_fn(|k| match pairs.get(k) {
            Some([_, df]) => range.clone().map(|i| weights[i] * df[i] * f[i]).sum(),
            None => 0.0,
        })
    });
    communicator.sum_slice(&mut sums);
    sums
}
