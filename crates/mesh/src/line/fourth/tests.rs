//! Sums, symmetry, positivity and orders of fourth-order lines.

use crate::Line;
use std::f64::consts::TAU;

/// Smoothly stretched: x = s + 0.1 sin(2πs)/π on a period of one.
fn periodic(n: usize) -> Vec<f64> {
    let place = |i: usize| i as f64 / n as f64;
    let stretched = |s: f64| s + 0.2 * (TAU * s).sin() / TAU;
    (0..n).map(|i| stretched(place(i))).collect()
}

/// Tanh-stretched between walls at 0 and 1.
fn walled(n: usize) -> Vec<f64> {
    let place = |i: usize| 2.0 * i as f64 / (n - 1) as f64 - 1.0;
    let beta = 1.8f64;
    (0..n)
        .map(|i| 0.5 * (1.0 + (beta * place(i)).tanh() / beta.tanh()))
        .collect()
}

/// Two uniform halves with spacings 1 : 2.
fn kinked(n: usize) -> Vec<f64> {
    let half = n / 2;
    (0..n)
        .map(|i| i.min(half) as f64 + 2.0 * i.saturating_sub(half) as f64)
        .collect()
}

fn cases() -> Vec<(&'static str, Vec<f64>, Option<f64>)> {
    vec![
        ("periodic", periodic(16), Some(1.0)),
        ("walls", walled(17), None),
        ("eight nodes", walled(8), None),
        ("jump", kinked(20), None),
        ("jump, periodic", kinked(20), Some(30.0)),
        (
            "jump near the end",
            {
                let mut x = kinked(20);
                x.push(80.0);
                x
            },
            None,
        ),
        ("few", walled(5), None),
    ]
}

/// x of both ends of a pair, the second one unwrapped.
fn ends(line: &Line, x: &[f64], period: Option<f64>, k: usize) -> (usize, usize, f64) {
    let pair = &line.pairs[k];
    let (a, b) = (pair.a as usize, line.other(pair));
    let wrapped = if b <= a { period.unwrap_or(0.0) } else { 0.0 };
    (a, b, x[b] + wrapped - x[a])
}

#[test]
fn linear_fields_have_their_gradient_and_no_laplacian_and_lengths_sum_up() {
    for (name, x, period) in cases() {
        let line = Line::fourth(&x, period);
        let n = x.len();
        let (mut gradient, mut rows, mut laplacian) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        for k in 0..line.pairs.len() {
            let (a, b, length) = ends(&line, &x, period, k);
            let pair = &line.pairs[k];
            // Q x with the ends' ∓½ x taken to the row sums: zero sums are what closes volumes.
            gradient[a] += 0.5 * pair.skew * length;
            gradient[b] += 0.5 * pair.skew * length;
            rows[a] += pair.skew;
            rows[b] -= pair.skew;
            laplacian[a] += pair.stiffness * length;
            laplacian[b] -= pair.stiffness * length;
        }
        let total = period.unwrap_or(x[n - 1] - x[0]);
        assert!(
            (line.norm.iter().sum::<f64>() - total).abs() < 1e-13 * total,
            "{name}"
        );
        for i in 0..n {
            let end = match (period, i) {
                (None, 0) => 1.0,
                (None, i) if i == n - 1 => -1.0,
                _ => 0.0,
            };
            assert!(line.norm[i] > 0.0, "{name} {i}");
            assert!(
                (gradient[i] - line.norm[i]).abs() < 1e-14 * total,
                "{name} {i}"
            );
            assert!((rows[i] - end).abs() < 1e-14, "{name} {i}: {}", rows[i]);
            assert!(
                (laplacian[i] - end).abs() < 1e-13,
                "{name} {i}: {}",
                laplacian[i]
            );
        }
    }
}

/// Quadratic form Σ w (φ_b − φ_a)² against the two-point one, for the roughest and for random fields.
#[test]
fn stiffness_is_positive() {
    for (name, x, period) in cases() {
        let line = Line::fourth(&x, period);
        let second = Line::second(&x, period);
        for seed in 0..200u64 {
            let phi: Vec<f64> = (0..x.len() as u64)
                .map(|i| (((i * i + 7) * (seed + 3)) as f64 * 0.783).sin() + (i % 2) as f64)
                .collect();
            let energy = |line: &Line| -> f64 {
                let pairs = line.pairs.iter();
                pairs
                    .map(|p| p.stiffness * (phi[line.other(p)] - phi[p.a as usize]).powi(2))
                    .sum()
            };
            assert!(energy(&line) > 0.85 * energy(&second), "{name} {seed}");
        }
    }
}

/// (Largest inner error, largest error) of first and second derivative of sin 2πx; inner: eight nodes from the ends.
fn derivative_errors(x: &[f64], period: Option<f64>) -> [[f64; 2]; 2] {
    let line = Line::fourth(x, period);
    let n = x.len();
    let phi: Vec<f64> = x.iter().map(|x| (TAU * x).sin()).collect();
    let (mut first, mut second) = (vec![0.0; n], vec![0.0; n]);
    for pair in &line.pairs {
        let (a, b) = (pair.a as usize, line.other(pair));
        first[a] += 0.5 * pair.skew * phi[b];
        first[b] -= 0.5 * pair.skew * phi[a];
        second[a] += pair.stiffness * (phi[b] - phi[a]);
        second[b] -= pair.stiffness * (phi[b] - phi[a]);
    }
    if period.is_none() {
        first[0] -= 0.5 * phi[0];
        first[n - 1] += 0.5 * phi[n - 1];
        second[0] -= TAU;
        second[n - 1] += TAU;
    }
    let mut errors = [[0.0f64; 2]; 2];
    for i in 0..n {
        let found = [first[i] / line.norm[i], second[i] / line.norm[i]];
        let exact = [TAU * (TAU * x[i]).cos(), -TAU * TAU * phi[i]];
        let inner = period.is_some() || (8..n - 8).contains(&i);
        for k in 0..2 {
            let error = (found[k] - exact[k]).abs();
            errors[k][1] = errors[k][1].max(error);
            // The natural condition makes the second derivative at a wall node one of first order.
            if inner {
                errors[k][0] = errors[k][0].max(error);
            }
        }
    }
    errors
}

#[test]
fn derivatives_are_of_fourth_order_inside_and_second_at_ends() {
    let fine = [64, 128];
    let [coarse, finer] = fine.map(|n| derivative_errors(&periodic(n), Some(1.0)));
    for k in 0..2 {
        let order = (coarse[k][0] / finer[k][0]).log2();
        println!(
            "periodic, derivative {}: {coarse:?} {finer:?}, order {order:.2}",
            k + 1
        );
        assert!(order > 3.8, "{order}");
    }
    let [coarse, finer] = fine.map(|n| derivative_errors(&walled(n + 1), None));
    for (k, least) in [(0, 1.8), (1, 0.8)] {
        let [inner, all] = [0, 1].map(|j| (coarse[k][j] / finer[k][j]).log2());
        println!(
            "walls, derivative {}: order {inner:.2} inside, {all:.2}",
            k + 1
        );
        assert!(inner > 3.8 && all > least, "{inner} {all}");
    }
}

/// −u'' = f with u given at the ends: the largest error, against 2.0 of the two-point operator.
#[test]
fn dirichlet_problems_are_solved_to_fourth_order() {
    let error = |n: usize| {
        let x = walled(n);
        let line = Line::fourth(&x, None);
        let exact: Vec<f64> = x.iter().map(|x| (TAU * x + 0.3).sin()).collect();
        let mut matrix = nalgebra::DMatrix::<f64>::zeros(n, n);
        for pair in &line.pairs {
            let (a, b) = (pair.a as usize, line.other(pair));
            for (i, j) in [(a, b), (b, a)] {
                matrix[(i, i)] += pair.stiffness;
                matrix[(i, j)] -= pair.stiffness;
            }
        }
        let mut rhs = nalgebra::DVector::from_fn(n, |i, _| line.norm[i] * TAU * TAU * exact[i]);
        for i in [0, n - 1] {
            matrix.row_mut(i).fill(0.0);
            matrix[(i, i)] = 1.0;
            rhs[i] = exact[i];
        }
        let solution = matrix.lu().solve(&rhs).expect("regular");
        (0..n)
            .map(|i| (solution[i] - exact[i]).abs())
            .fold(0.0, f64::max)
    };
    let order = (error(65) / error(129)).log2();
    println!(
        "Dirichlet: {:.2e} {:.2e}, order {order:.2}",
        error(65),
        error(129)
    );
    assert!(order > 3.7, "{order}");
}
