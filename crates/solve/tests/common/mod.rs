//! A lattice of nodes with two-point weights, stretched at will.
#![allow(dead_code, reason = "every test file uses a part of this")]

use fibreflow_parallel::{Communicator, Halo};
use fibreflow_solve::{PairMatrix, SolveError};
use rand::{Rng, SeedableRng};

/// Node coordinates along the three axes \[m\].
pub struct Lattice {
    pub axes: [Vec<f64>; 3],
}

impl Lattice {
    pub fn uniform(n: usize) -> Self {
        let axis: Vec<f64> = (0..=n).map(|i| i as f64 / n as f64).collect();
        Self {
            axes: [axis.clone(), axis.clone(), axis],
        }
    }

    /// Spacing grows by a constant ratio along y, over a factor of `span` from first to last cell.
    pub fn geometric(n: usize, span: f64) -> Self {
        let mut lattice = Self::uniform(n);
        let ratio = span.powf(1.0 / (n - 1) as f64);
        let spacing: Vec<f64> = (0..n).map(|i| ratio.powi(i as i32)).collect();
        let length: f64 = spacing.iter().sum();
        let mut y = vec![0.0];
        spacing
            .iter()
            .for_each(|h| y.push(y[y.len() - 1] + h / length));
        lattice.axes[1] = y;
        lattice
    }

    pub fn counts(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.axes[a].len())
    }

    pub fn len(&self) -> usize {
        self.counts().iter().product()
    }

    pub fn indices(&self, node: usize) -> [usize; 3] {
        let n = self.counts();
        [node % n[0], node / n[0] % n[1], node / (n[0] * n[1])]
    }

    pub fn point(&self, node: usize) -> [f64; 3] {
        let at = self.indices(node);
        std::array::from_fn(|a| self.axes[a][at[a]])
    }

    fn width(&self, axis: usize, i: usize) -> f64 {
        let x = &self.axes[axis];
        0.5 * (x[(i + 1).min(x.len() - 1)] - x[i.saturating_sub(1)])
    }

    pub fn volume(&self, node: usize) -> f64 {
        let at = self.indices(node);
        (0..3).map(|a| self.width(a, at[a])).product()
    }

    pub fn on_boundary(&self, node: usize) -> bool {
        let (at, n) = (self.indices(node), self.counts());
        (0..3).any(|a| at[a] == 0 || at[a] + 1 == n[a])
    }

    pub fn row(&self, node: usize) -> Vec<(u32, f64)> {
        let (at, n) = (self.indices(node), self.counts());
        let strides = [1, n[0], n[0] * n[1]];
        let mut row = Vec::new();
        for a in 0..3 {
            let area: f64 = (0..3)
                .filter(|&b| b != a)
                .map(|b| self.width(b, at[b]))
                .product();
            let x = &self.axes[a];
            if at[a] > 0 {
                let w = area / (x[at[a]] - x[at[a] - 1]);
                row.push(((node - strides[a]) as u32, w));
            }
            if at[a] + 1 < n[a] {
                let w = area / (x[at[a] + 1] - x[at[a]]);
                row.push(((node + strides[a]) as u32, w));
            }
        }
        row
    }

    pub fn halo(&self) -> Halo {
        Halo::none(&Communicator::single(), self.len())
    }

    pub fn matrix(&self, fixed: &[bool]) -> Result<PairMatrix, SolveError> {
        PairMatrix::from_rows(&self.halo(), |i| self.row(i).into_iter(), fixed, None)
    }

    pub fn dirichlet(&self) -> PairMatrix {
        let fixed: Vec<bool> = (0..self.len()).map(|i| self.on_boundary(i)).collect();
        self.matrix(&fixed).expect("matrix")
    }

    pub fn neumann(&self) -> PairMatrix {
        self.matrix(&vec![false; self.len()]).expect("matrix")
    }
}

pub fn random(n: usize, seed: u64) -> Vec<f64> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    (0..n).map(|_| rng.random_range(-1.0..1.0)).collect()
}

pub fn norm(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum::<f64>().sqrt()
}
