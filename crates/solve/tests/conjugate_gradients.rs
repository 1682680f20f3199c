//! Conjugate gradients and the pair matrix on problems with known answers.

mod common;

use common::{Lattice, norm, random};
use fibreflow_solve::{
    CgSettings, ConjugateGradients, Helmholtz, Jacobi, LinearOperator, NullSpace, PairMatrix,
    SolveError, SolveReport, Value,
};
use std::f64::consts::PI;

fn settings(relative_tolerance: f64) -> CgSettings {
    CgSettings {
        relative_tolerance,
        ..CgSettings::default()
    }
}

fn solve<T: Value>(
    matrix: &PairMatrix,
    rhs: &[T],
    x: &mut [T],
    tolerance: f64,
    null_space: NullSpace,
) -> Result<SolveReport, SolveError> {
    ConjugateGradients::new().solve(
        matrix,
        &mut Jacobi::new(matrix),
        rhs,
        x,
        &settings(tolerance),
        null_space,
    )
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[test]
fn the_matrix_is_symmetric_and_maps_constants_to_zero() {
    let lattice = Lattice::geometric(9, 100.0);
    for matrix in [lattice.dirichlet(), lattice.neumann()] {
        let n = lattice.len();
        let (mut x, mut y) = (random(n, 1), random(n, 2));
        let (mut ax, mut ay) = (vec![0.0; n], vec![0.0; n]);
        matrix.multiply(&mut x, &mut ax);
        matrix.multiply(&mut y, &mut ay);
        let (left, right) = (dot(&y, &ax), dot(&x, &ay));
        assert!(
            (left - right).abs() < 1e-13 * norm(&y) * norm(&ax),
            "{left} {right}"
        );
        assert!(dot(&x, &ax) > 0.0);
    }
    let mut ones = vec![1.0; lattice.len()];
    let mut image = vec![1.0; lattice.len()];
    lattice.neumann().multiply(&mut ones, &mut image);
    assert!(image.iter().all(|&v| v == 0.0), "A·1 must vanish bitwise");
}

/// Error of −∇²u = 14π²u, u = sin πx sin 2πy sin 3πz, on n³ cells.
fn sine_error(n: usize) -> f64 {
    let lattice = Lattice::uniform(n);
    let matrix = lattice.dirichlet();
    let exact: Vec<f64> = (0..lattice.len())
        .map(|i| {
            let [x, y, z] = lattice.point(i);
            (PI * x).sin() * (2.0 * PI * y).sin() * (3.0 * PI * z).sin()
        })
        .collect();
    let mut rhs: Vec<f64> = (0..lattice.len())
        .map(|i| 14.0 * PI * PI * exact[i] * lattice.volume(i))
        .collect();
    let zero = vec![0.0; lattice.len()];
    matrix.lift(&zero, &mut rhs);
    let mut x = zero;
    solve(&matrix, &rhs, &mut x, 1e-11, NullSpace::None).expect("solve");
    let worst = x.iter().zip(&exact).map(|(a, b)| (a - b).abs());
    worst.fold(0.0, f64::max)
}

#[test]
fn a_manufactured_solution_converges_at_second_order() {
    let (coarse, fine) = (sine_error(12), sine_error(24));
    let order = (coarse / fine).log2();
    assert!((1.9..2.2).contains(&order), "order {order}");
}

#[test]
fn a_linear_field_is_recovered_from_its_boundary_values_in_every_lane() {
    let lattice = Lattice::geometric(10, 30.0);
    let matrix = lattice.dirichlet();
    let exact: Vec<[f64; 4]> = (0..lattice.len())
        .map(|i| {
            let [x, y, z] = lattice.point(i);
            [1.0 + 2.0 * x, 3.0 * y - z, -4.0, 0.0]
        })
        .collect();
    let mut rhs = vec![[0.0; 4]; lattice.len()];
    matrix.lift(&exact, &mut rhs);
    let mut x = vec![[0.0; 4]; lattice.len()];
    let report = solve(&matrix, &rhs, &mut x, 1e-13, NullSpace::None).expect("solve");
    assert!(report.final_residual <= 1e-13 * report.rhs_norm);
    for (a, b) in x.iter().flatten().zip(exact.iter().flatten()) {
        assert!((a - b).abs() < 1e-10, "{a} {b}");
    }
}

#[test]
fn a_neumann_system_is_solved_with_mean_zero_though_its_right_hand_side_has_a_mean() {
    let lattice = Lattice::uniform(16);
    let matrix = lattice.neumann();
    assert!(matrix.is_singular() && !lattice.dirichlet().is_singular());
    let n = lattice.len();
    let rhs = random(n, 3);
    let mean = rhs.iter().sum::<f64>() / n as f64;
    let mut x = vec![5.0; n];
    solve(&matrix, &rhs, &mut x, 1e-12, NullSpace::Constant).expect("solve");
    assert!((x.iter().sum::<f64>() / n as f64).abs() < 1e-14);
    let mut image = vec![0.0; n];
    matrix.multiply(&mut x, &mut image);
    let residual: Vec<f64> = image.iter().zip(&rhs).map(|(q, b)| b - mean - q).collect();
    assert!(norm(&residual) < 5e-12 * norm(&rhs), "{}", norm(&residual));
}

#[test]
fn helmholtz_equals_the_shifted_matrix_and_follows_the_time_step() {
    let lattice = Lattice::geometric(8, 10.0);
    let n = lattice.len();
    let fixed: Vec<bool> = (0..n).map(|i| lattice.point(i)[1] == 0.0).collect();
    let matrix = lattice.matrix(&fixed).expect("matrix");
    let mass: Vec<f64> = (0..n).map(|i| lattice.volume(i)).collect();
    let values = random(n, 9);
    let mut jacobi = Jacobi::new(&matrix);
    for coefficient in [0.3, 1e-3] {
        let operator = Helmholtz {
            matrix: &matrix,
            mass: &mass,
            coefficient,
        };
        let scaled = |i: usize| {
            let row = lattice.row(i).into_iter();
            row.map(move |(j, w)| (j, coefficient * w))
        };
        let reference = PairMatrix::from_rows(&lattice.halo(), scaled, &fixed, Some(&mass));
        let reference = reference.expect("matrix");
        let (mut x, mut y, mut z) = (random(n, 4), vec![0.0; n], vec![0.0; n]);
        operator.apply(&mut x, &mut y);
        reference.multiply(&mut x, &mut z);
        let worst = y.iter().zip(&z).map(|(a, b)| (a - b).abs());
        assert!(worst.fold(0.0, f64::max) < 1e-13);

        let (mut left, mut right) = (vec![0.0; n], vec![0.0; n]);
        operator.lift(&values, &mut left);
        reference.lift(&values, &mut right);
        let worst = left.iter().zip(&right).map(|(a, b)| (a - b).abs());
        assert!(worst.fold(0.0, f64::max) < 1e-15);

        jacobi.update(operator.diagonal());
        let mut answer = vec![0.0; n];
        let report = ConjugateGradients::new()
            .solve(
                &operator,
                &mut jacobi,
                &y,
                &mut answer,
                &settings(1e-12),
                NullSpace::None,
            )
            .expect("solve");
        let worst = answer.iter().zip(&x).map(|(a, b)| (a - b).abs());
        assert!(worst.fold(0.0, f64::max) < 1e-9, "{report:?}");
    }
}

#[test]
fn failures_are_errors_that_say_what_happened() {
    let lattice = Lattice::uniform(12);
    let matrix = lattice.dirichlet();
    let rhs = random(lattice.len(), 5);
    let mut x = vec![0.0; lattice.len()];
    let few = CgSettings {
        max_iterations: 3,
        ..settings(1e-10)
    };
    let error = ConjugateGradients::new()
        .solve(
            &matrix,
            &mut Jacobi::new(&matrix),
            &rhs,
            &mut x,
            &few,
            NullSpace::None,
        )
        .expect_err("three iterations are too few");
    assert!(
        matches!(error, SolveError::NotConverged { iterations: 3, residual, target, .. } if residual > target)
    );
    assert!(
        error.to_string().contains("in 3 iterations: residual"),
        "{error}"
    );

    let mut broken = rhs.clone();
    broken[7] = f64::NAN;
    let error = solve(&matrix, &broken, &mut x, 1e-8, NullSpace::None).expect_err("NaN");
    assert_eq!(error, SolveError::NotFinite { iteration: 0 });

    let short = lattice.matrix(&[false; 3]).expect_err("short mask");
    assert!(matches!(
        short,
        SolveError::Length {
            what: "fixed",
            found: 3,
            ..
        }
    ));
}

#[test]
fn a_zero_right_hand_side_gives_zero_and_a_solved_one_no_iterations() {
    let lattice = Lattice::uniform(8);
    let matrix = lattice.dirichlet();
    let mut x = random(lattice.len(), 6);
    let zero = vec![0.0; lattice.len()];
    let report = solve(&matrix, &zero, &mut x, 1e-8, NullSpace::None).expect("solve");
    assert_eq!((report.iterations, norm(&x)), (0, 0.0));

    let rhs = random(lattice.len(), 7);
    solve(&matrix, &rhs, &mut x, 1e-10, NullSpace::None).expect("solve");
    let again = solve(&matrix, &rhs, &mut x, 1e-9, NullSpace::None).expect("solve");
    assert_eq!(again.iterations, 0);
}

#[test]
fn the_answer_is_bitwise_the_same_for_any_number_of_threads() {
    let lattice = Lattice::geometric(24, 20.0);
    let rhs: Vec<[f64; 4]> = random(3 * lattice.len(), 8)
        .chunks(3)
        .map(|v| [v[0], v[1], v[2], 0.0])
        .collect();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("pool").install(|| {
            let matrix = lattice.neumann();
            let mut x = vec![[0.0; 4]; lattice.len()];
            solve(&matrix, &rhs, &mut x, 1e-8, NullSpace::Constant).expect("solve");
            x
        })
    };
    assert!(run(1) == run(3));
}
