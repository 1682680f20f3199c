//! Guesses from past solutions.

mod common;

use common::{Lattice, norm, random};
use fibreflow_parallel::Communicator;
use fibreflow_solve::{
    CgSettings, ConjugateGradients, Jacobi, NullSpace, PairMatrix, PastSolutions,
};

const TOLERANCE: f64 = 1e-10;

fn exact(matrix: &PairMatrix, rhs: &[f64], x: &mut [f64]) -> f64 {
    let settings = CgSettings {
        relative_tolerance: TOLERANCE,
        ..CgSettings::default()
    };
    let mut jacobi = Jacobi::new(matrix);
    let report = ConjugateGradients::new()
        .solve(matrix, &mut jacobi, rhs, x, &settings, NullSpace::None)
        .expect("solve");
    report.initial_residual / report.rhs_norm
}

/// Right-hand sides Σ_k f_k(t) b_k of fixed fields b_k, zero on fixed rows.
fn fields(matrix: &PairMatrix, count: u64) -> Vec<Vec<f64>> {
    let zeroed = |seed| {
        let mut field = random(matrix.owned(), seed);
        let fixed = field.iter_mut().zip(matrix.fixed()).filter(|(_, f)| **f);
        fixed.for_each(|(b, _)| *b = 0.0);
        field
    };
    (0..count).map(zeroed).collect()
}

fn combined(fields: &[Vec<f64>], factor: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut sum = vec![0.0; fields[0].len()];
    for (k, field) in fields.iter().enumerate() {
        sum.iter_mut()
            .zip(field)
            .for_each(|(s, v)| *s += factor(k) * v);
    }
    sum
}

/// A right-hand side in the span of the past ones is solved by the guess, and whatever was held longest is forgotten.
#[test]
fn the_last_right_hand_sides_are_known() {
    let matrix = Lattice::geometric(8, 5.0).dirichlet();
    let fields = fields(&matrix, 7);
    let mut past = PastSolutions::new(&Communicator::single(), matrix.owned(), 3);
    let mut x = vec![0.0; matrix.owned()];
    for step in 0..7 {
        let rhs = combined(&fields, |k| {
            if k == step {
                1.0
            } else {
                0.1 * f64::from(k < step)
            }
        });
        past.guess(&rhs, &mut x);
        exact(&matrix, &rhs, &mut x);
        past.remember(&rhs, &x);
    }
    assert_eq!(past.len(), 3);
    let mixture = |weights: [f64; 3]| {
        let of = |step: usize, k: usize| {
            if k == step {
                1.0
            } else {
                0.1 * f64::from(k < step)
            }
        };
        combined(&fields, |k| (0..3).map(|j| weights[j] * of(4 + j, k)).sum())
    };
    for weights in [[1.0, 0.0, 0.0], [0.3, -2.0, 1.0]] {
        let rhs = mixture(weights);
        past.guess(&rhs, &mut x);
        let left = exact(&matrix, &rhs, &mut x);
        assert!(left < 1e3 * TOLERANCE, "{left}");
    }
    past.guess(&fields[1], &mut x);
    assert!(exact(&matrix, &fields[1], &mut x) > 0.5);
}

/// Of a right-hand side that changes smoothly, m solutions leave the m-th power of the step.
#[test]
fn what_is_left_falls_with_the_power_of_the_step() {
    let matrix = Lattice::uniform(10).dirichlet();
    let fields = fields(&matrix, 6);
    let left = |count: usize, step: f64| {
        let mut past = PastSolutions::new(&Communicator::single(), matrix.owned(), count);
        let mut x = vec![0.0; matrix.owned()];
        let mut left = 0.0;
        for n in 0..12 {
            let time = 1.0 + step * (f64::from(n) - 11.0);
            let rhs = combined(&fields, |k| ((k as f64 + 1.0) * time + k as f64).sin());
            past.guess(&rhs, &mut x);
            left = exact(&matrix, &rhs, &mut x);
            past.remember(&rhs, &x);
        }
        left
    };
    for count in 1..4 {
        let order = (left(count, 0.04) / left(count, 0.02)).log2();
        let expected = count as f64;
        assert!(
            (order - expected).abs() < 0.4,
            "{count} solutions: order {order}"
        );
    }
}

#[test]
fn a_restored_memory_gives_the_same_bits() {
    let matrix = Lattice::uniform(8).dirichlet();
    let fields = fields(&matrix, 6);
    let communicator = Communicator::single();
    let new = || PastSolutions::new(&communicator, matrix.owned(), 4);
    let (mut past, mut x) = (new(), vec![0.0; matrix.owned()]);
    let run = |past: &mut PastSolutions, x: &mut [f64], steps: std::ops::Range<usize>| {
        for n in steps {
            let rhs = combined(&fields, |k| ((k * n) as f64).cos());
            past.guess(&rhs, x);
            exact(&matrix, &rhs, x);
            past.remember(&rhs, x);
        }
    };
    run(&mut past, &mut x, 0..6);
    let (nodes, columns) = past.state();
    let mut other = new();
    other.restore(&nodes, &columns);
    let mut y = x.clone();
    run(&mut past, &mut x, 6..9);
    run(&mut other, &mut y, 6..9);
    assert!(x == y && past.state() == other.state());
    assert!(norm(&x) > 0.0);
}
