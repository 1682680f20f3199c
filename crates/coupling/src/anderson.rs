//! Fixed points x = g(x) by Anderson acceleration.

use fibreflow_parallel::Communicator;

/// Anderson's (1965) acceleration in the form of Walker & Ni (2011): of all combinations of past iterates that with the
/// least residual f = g − x, then one step of the fixed point from there. For an affine g that is GMRES, so it
/// converges whatever the gain, as long as 1 is no eigenvalue of g. Differences of residuals are kept orthonormal.
pub struct Anderson {
    depth: usize,
    /// The last iterate and its residual.
    last: Option<[Vec<f64>; 2]>,
    /// Pairs (Δx, Δf) with orthonormal Δf.
    past: Vec<[Vec<f64>; 2]>,
}

impl Anderson {
    /// From the start, with the differences of `depth` iterates.
    pub fn new(depth: usize) -> Self {
        Self {
            depth,
            last: None,
            past: Vec::with_capacity(depth),
        }
    }

    /// The next iterate in `x`, from what came of the present one. Collective.
    pub fn advance(&mut self, x: &mut [f64], g: &[f64], communicator: &Communicator) {
        let dot =
            |a: &[f64], b: &[f64]| communicator.sum(a.iter().zip(b).map(|(a, b)| a * b).sum());
        let residual: Vec<f64> = g.iter().zip(x.iter()).map(|(g, x)| g - x).collect();
        if let Some([old, old_residual]) = self.last.take() {
            let minus = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect();
            let mut pair: [Vec<f64>; 2] = [minus(x, &old), minus(&residual, &old_residual)];
            let whole = dot(&pair[1], &pair[1]).sqrt();
            for past in &self.past {
                let along = dot(&past[1], &pair[1]);
                for (new, past) in pair.iter_mut().zip(past) {
                    new.iter_mut().zip(past).for_each(|(n, p)| *n -= along * p);
                }
            }
            let size = dot(&pair[1], &pair[1]).sqrt();
            // Below that it is round-off, and tells nothing new.
            if size > 1e-10 * whole {
                for new in &mut pair {
                    new.iter_mut().for_each(|n| *n /= size);
                }
                if self.past.len() == self.depth {
                    self.past.remove(0);
                }
                self.past.push(pair);
            }
        }
        self.last = Some([x.to_vec(), residual]);
        let mut left = g.to_vec();
        if let Some([_, residual]) = &self.last {
            for [moved, changed] in &self.past {
                let along = dot(changed, residual);
                for (l, (m, c)) in left.iter_mut().zip(moved.iter().zip(changed)) {
                    *l -= along * (m + c);
                }
            }
        }
        x.copy_from_slice(&left);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gains from −50 to 0.9: the plain iteration grows by 50 a step, this ends after as many steps as there are gains.
    #[test]
    fn an_affine_map_of_any_gain_is_solved() {
        let gains = [-50.0, -8.0, -3.0, -0.5, 0.9];
        let map = |x: &[f64]| -> Vec<f64> {
            let row = |i: usize| gains[i] * (x[i] - 1.0) + 1.0 + 0.1 * (x[(i + 1) % 5] - 1.0);
            (0..5).map(row).collect()
        };
        let (mut x, mut solver) = (vec![0.0; 5], Anderson::new(10));
        for _ in 0..7 {
            let g = map(&x);
            solver.advance(&mut x, &g, &Communicator::single());
        }
        let error = x.iter().map(|x| (x - 1.0).abs()).fold(0.0, f64::max);
        assert!(error < 1e-9, "{error}");
    }
}
