//! Initial guess from past solutions of the same operator (after Fischer 1998).
//!
//! Of all combinations of the last few solutions, the one nearest to the solution in the norm of the operator A: the
//! solutions are kept as an A-orthonormal basis, so that its coefficients are products with the right-hand side. The change
//! that the solve then makes to the guess is A-orthogonal to the basis and is the next vector; its norm is its product with
//! the right-hand side. So no product with the operator is needed. When the basis is full the oldest solution leaves: its
//! column of the triangular factor goes and rotations make the rest triangular again.

use crate::vectors::{BLOCK, Partials, blocks, dot};
use fibreflow_parallel::Communicator;
use rayon::prelude::*;

/// Past solutions at most.
const MOST: usize = 8;

/// Squared norm of a change, relative to that of the solution, below which it adds nothing to the basis.
const NOTHING: f64 = 1e-20;

/// The last solutions of a linear system, whose right-hand side changes slowly.
#[derive(Clone, Debug)]
pub struct PastSolutions {
    communicator: Communicator,
    /// A-orthonormal over all ranks.
    basis: Vec<Vec<f64>>,
    /// Solutions in the basis, oldest first: column k reaches to vector k.
    columns: Vec<[f64; MOST]>,
    /// For the right-hand side at hand, by vectors of the basis and by nodes.
    coefficients: [f64; MOST],
    guess: Vec<f64>,
    partials: Partials<1>,
}

impl PastSolutions {
    /// Room for `count` solutions (1 to 8) on `owned` nodes of this rank.
    pub fn new(communicator: &Communicator, owned: usize, count: usize) -> Self {
        Self {
            communicator: communicator.clone(),
            basis: vec![vec![0.0; owned]; count.clamp(1, MOST)],
            columns: Vec::with_capacity(MOST),
            coefficients: [0.0; MOST],
            guess: vec![0.0; owned],
            partials: Partials::default(),
        }
    }

    /// Solutions held.
    pub fn len(&self) -> usize {
        self.columns.len()
    }

    /// True without any.
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// Drops all.
    pub fn clear(&mut self) {
        self.columns.clear();
    }

    /// The guess for a right-hand side (owned, or longer) into the owned entries of `x`. Collective.
    pub fn guess(&mut self, rhs: &[f64], x: &mut [f64]) {
        self.guess.fill(0.0);
        self.coefficients = [0.0; MOST];
        for k in 0..self.len() {
            self.coefficients[k] = self.product(rhs, |fields| &fields.basis[k]);
        }
        self.communicator.sum_slice(&mut self.coefficients);
        for (vector, &coefficient) in self
            .basis
            .iter()
            .zip(&self.coefficients[..self.columns.len()])
        {
            add(&mut self.guess, coefficient, vector);
        }
        x[..self.guess.len()].copy_from_slice(&self.guess);
    }

    /// Takes the solution of the right-hand side that [`PastSolutions::guess`] was asked for last (both owned, or longer).
    /// Not to be called when the solver found nothing to do: that teaches nothing. Collective.
    pub fn remember(&mut self, rhs: &[f64], solution: &[f64]) {
        let change = self
            .guess
            .par_chunks_mut(BLOCK)
            .zip(solution.par_chunks(BLOCK));
        change.for_each(|(guess, x)| {
            guess
                .iter_mut()
                .zip(x)
                .for_each(|(guess, x)| *guess = x - *guess);
        });
        let square = self.product(rhs, |fields| &fields.guess);
        let square = self.communicator.sum(square);
        let size: f64 = self.coefficients.iter().map(|c| c * c).sum();
        let moved = square > NOTHING * size;
        if !moved {
            return;
        }
        let full = self.len() == self.basis.len();
        if full {
            self.forget_oldest();
        }
        // The vector that the oldest left behind carries a part of this solution.
        let last = self.len();
        let carried = if full { self.coefficients[last] } else { 0.0 };
        let norm = carried.hypot(square.sqrt());
        let (kept, inverse) = (carried / norm, norm.recip());
        self.basis[last]
            .par_chunks_mut(BLOCK)
            .zip(self.guess.par_chunks(BLOCK))
            .for_each(|(p, change)| {
                for (p, change) in p.iter_mut().zip(change) {
                    *p = kept * *p + inverse * change;
                }
            });
        self.coefficients[last] = norm;
        self.columns.push(self.coefficients);
    }

    /// All that [`PastSolutions::restore`] needs: numbers by node, as many as there is room for solutions, and others.
    pub fn state(&self) -> (Vec<f64>, Vec<f64>) {
        let node = |i: usize| self.basis.iter().map(move |field| field[i]);
        let nodes = (0..self.guess.len()).flat_map(node).collect();
        (nodes, self.columns.as_flattened().to_vec())
    }

    /// Goes on from a state of as many nodes and as much room; from another one it starts anew.
    pub fn restore(&mut self, nodes: &[f64], columns: &[f64]) {
        self.clear();
        let width = self.basis.len();
        let (columns, []) = columns.as_chunks::<MOST>() else {
            return;
        };
        if nodes.len() != width * self.guess.len() || columns.len() > width {
            return;
        }
        for (k, field) in self.basis.iter_mut().enumerate() {
            let values = nodes.iter().skip(k).step_by(width);
            field.iter_mut().zip(values).for_each(|(f, v)| *f = *v);
        }
        self.columns.extend_from_slice(columns);
    }

    /// Givens rotations of neighbouring vectors bring the factor without its first column back to triangular form; the
    /// last vector is then free.
    fn forget_oldest(&mut self) {
        self.columns.remove(0);
        for k in 0..self.columns.len() {
            let [above, below] = [self.columns[k][k], self.columns[k][k + 1]];
            let length = above.hypot(below);
            let (c, s) = (above / length, below / length);
            for column in &mut self.columns[k..] {
                [column[k], column[k + 1]] = turned(c, s, [column[k], column[k + 1]]);
            }
            // So is the right-hand side at hand.
            let own = &mut self.coefficients;
            [own[k], own[k + 1]] = turned(c, s, [own[k], own[k + 1]]);
            let (left, right) = self.basis.split_at_mut(k + 1);
            rotate(c, s, &mut left[k], &mut right[0]);
        }
    }

    /// Of this rank's part of a right-hand side with one of the fields.
    fn product(&mut self, rhs: &[f64], field: impl Fn(&Self) -> &Vec<f64>) -> f64 {
        let mut partials = std::mem::take(&mut self.partials);
        let field = field(self);
        let parts = blocks(field, &rhs[..field.len()]).map(|(a, b)| [dot(a, b)]);
        let [sum] = partials.sum(parts);
        self.partials = partials;
        sum
    }
}

fn turned(c: f64, s: f64, [a, b]: [f64; 2]) -> [f64; 2] {
    [c * a + s * b, c * b - s * a]
}

fn rotate(c: f64, s: f64, a: &mut [f64], b: &mut [f64]) {
    a.par_chunks_mut(BLOCK)
        .zip(b.par_chunks_mut(BLOCK))
        .for_each(|(a, b)| {
            for (a, b) in a.iter_mut().zip(b) {
                [*a, *b] = turned(c, s, [*a, *b]);
            }
        });
}

/// y += factor·x.
fn add(y: &mut [f64], factor: f64, x: &[f64]) {
    y.par_chunks_mut(BLOCK)
        .zip(x.par_chunks(BLOCK))
        .for_each(|(y, x)| y.iter_mut().zip(x).for_each(|(y, x)| *y += factor * x));
}
