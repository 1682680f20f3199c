//! Multigrid as a preconditioner: iterations that neither grow with the mesh nor with its stretching.

mod common;

use common::{Lattice, Tetrahedra, norm, random};
use fibreflow_parallel::{Communicator, Halo};
use fibreflow_solve::{
    Amg, AmgSettings, CgSettings, ConjugateGradients, Jacobi, NullSpace, PairMatrix,
    Preconditioner, SolveError, SolveReport,
};

fn amg(matrix: &PairMatrix) -> Amg {
    Amg::new(matrix, AmgSettings::default()).expect("hierarchy")
}

/// Right-hand side that is zero on fixed rows.
fn load(matrix: &PairMatrix) -> Vec<f64> {
    let mut rhs = random(matrix.owned(), 11);
    let fixed = rhs.iter_mut().zip(matrix.fixed()).filter(|(_, f)| **f);
    fixed.for_each(|(b, _)| *b = 0.0);
    rhs
}

fn solve(
    matrix: &PairMatrix,
    preconditioner: &mut dyn Preconditioner<f64>,
    tolerance: f64,
    max_iterations: usize,
) -> Result<(SolveReport, Vec<f64>), SolveError> {
    let null_space = if matrix.is_singular() {
        NullSpace::Constant
    } else {
        NullSpace::None
    };
    let settings = CgSettings {
        relative_tolerance: tolerance,
        max_iterations,
        ..CgSettings::default()
    };
    let mut x = vec![0.0; matrix.owned()];
    let mut solver = ConjugateGradients::new();
    let report = solver.solve(
        matrix,
        preconditioner,
        &load(matrix),
        &mut x,
        &settings,
        null_space,
    )?;
    Ok((report, x))
}

fn iterations(matrix: &PairMatrix) -> usize {
    let (report, _) = solve(matrix, &mut amg(matrix), 1e-8, 100).expect("solve");
    report.iterations
}

#[test]
fn iterations_hardly_grow_with_the_mesh() {
    let lattices = [16, 32].map(Lattice::uniform);
    for build in [Lattice::dirichlet, Lattice::neumann] {
        let [coarse, fine] = [0, 1].map(|k| iterations(&build(&lattices[k])) as f64);
        assert!(fine < 1.3 * coarse, "{coarse} iterations become {fine}");
        assert!(fine < 16.0, "{fine} iterations");
    }
}

/// Spacing over a factor of 1000: Jacobi is far from done where multigrid has converged.
#[test]
fn stretched_cells_are_coarsened_along_their_short_side() {
    for n in [16, 32] {
        let matrix = Lattice::geometric(n, 1000.0).neumann();
        let count = iterations(&matrix);
        assert!(count < 20, "{count} iterations at n = {n}");
        let jacobi = solve(&matrix, &mut Jacobi::new(&matrix), 1e-8, 6 * count);
        assert!(matches!(jacobi, Err(SolveError::NotConverged { .. })));
    }
}

#[test]
fn tetrahedra_with_negative_weights_converge() {
    for (squash, most) in [(1.0, 18), (0.05, 70)] {
        let mesh = Tetrahedra::new(16, 0.2, squash);
        assert!(mesh.negative_weights() > 1000);
        for dirichlet in [false, true] {
            let count = iterations(&mesh.matrix(dirichlet));
            assert!(count < most, "{count} iterations, y squashed by {squash}");
        }
    }
}

/// Height a hundredth: couplings of both signs a hundred times those around them.
#[test]
fn slivers_cost_less_than_twice_the_iterations() {
    // The larger one is smoothed in two blocks.
    for (n, dirichlet) in [(20, false), (20, true), (28, false)] {
        let clean = iterations(&Tetrahedra::new(n, 0.2, 1.0).matrix(dirichlet));
        let count = iterations(&Tetrahedra::with_slivers(n, 0.2).matrix(dirichlet));
        assert!(count < 2 * clean, "{clean} iterations become {count}");
    }
}

#[test]
fn multigrid_and_jacobi_agree() {
    let lattice = Lattice::geometric(16, 30.0);
    for matrix in [lattice.dirichlet(), lattice.neumann()] {
        let (_, x) = solve(&matrix, &mut amg(&matrix), 1e-12, 100).expect("solve");
        let (_, y) = solve(&matrix, &mut Jacobi::new(&matrix), 1e-13, 5000).expect("solve");
        let difference: Vec<f64> = x.iter().zip(&y).map(|(a, b)| a - b).collect();
        assert!(norm(&difference) < 1e-9 * norm(&y));
    }
}

/// Conjugate gradients need it symmetric; single precision is as far as it can be.
#[test]
fn the_cycle_is_symmetric_and_positive() {
    for matrix in [
        Lattice::uniform(11).dirichlet(),
        Tetrahedra::new(11, 0.2, 0.2).matrix(false),
    ] {
        let settings = AmgSettings {
            coarsest: 1000,
            ..AmgSettings::default()
        };
        let mut amg = Amg::new(&matrix, settings).expect("hierarchy");
        assert!(amg.unknowns().len() >= 2 && !amg.is_variable());
        let n = matrix.owned();
        let mean_free = |seed| {
            let mut r = random(n, seed);
            let mean = r.iter().sum::<f64>() / n as f64;
            r.iter_mut().for_each(|v| *v -= mean);
            r
        };
        let (r, s) = (mean_free(1), mean_free(2));
        let (mut z, mut t) = (vec![0.0; n], vec![0.0; n]);
        amg.apply(&r, &mut z);
        amg.apply(&s, &mut t);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let (left, right) = (dot(&s, &z), dot(&r, &t));
        assert!(
            (left - right).abs() < 1e-6 * norm(&s) * norm(&z),
            "{left} {right}"
        );
        assert!(dot(&r, &z) > 0.0);
    }
}

#[test]
fn tiny_and_diagonal_systems_are_solved() {
    let matrix = Lattice::uniform(1).neumann();
    let (report, _) = solve(&matrix, &mut amg(&matrix), 1e-12, 5).expect("solve");
    assert!(report.iterations <= 2);

    // Shifts that dwarf the couplings leave nothing to coarsen.
    let lattice = Lattice::uniform(12);
    let shift = vec![1e3; lattice.len()];
    let rows = |i: usize| lattice.row(i).into_iter();
    let fixed = vec![false; lattice.len()];
    let matrix = PairMatrix::from_rows(&lattice.halo(), rows, &fixed, Some(&shift));
    let matrix = matrix.expect("matrix");
    let mut amg = amg(&matrix);
    assert_eq!(amg.unknowns(), [lattice.len(), 0]);
    solve(&matrix, &mut amg, 1e-12, 20).expect("solve");
}

#[test]
fn a_matrix_in_two_pieces_without_dirichlet_nodes_is_refused() {
    let halo = Halo::none(&Communicator::single(), 4);
    let rows = |i: usize| std::iter::once((i as u32 ^ 1, 1.0));
    let matrix = PairMatrix::from_rows(&halo, rows, &[false; 4], None).expect("matrix");
    let error = Amg::new(&matrix, AmgSettings::default()).expect_err("singular twice");
    assert_eq!(error, SolveError::Coarsest { unknowns: 4 });
}

#[test]
fn the_answer_is_bitwise_the_same_for_any_number_of_threads() {
    let matrix = Lattice::geometric(24, 20.0).neumann();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let solve = || {
            solve(&matrix, &mut amg(&matrix), 1e-8, 100)
                .expect("solve")
                .1
        };
        pool.expect("pool").install(solve)
    };
    assert!(run(1) == run(3));
}
