//! Subdomain deflation: the same answers as other preconditioners in far fewer iterations than Jacobi's.

mod common;

use common::{Lattice, Tetrahedra, norm, random};
use fibreflow_parallel::{Communicator, Halo};
use fibreflow_solve::{
    CgSettings, ConjugateGradients, Deflation, DeflationSettings, Jacobi, NullSpace, PairMatrix,
    Preconditioner, SolveError,
};

fn deflation(matrix: &PairMatrix, nodes: usize) -> Deflation {
    Deflation::new(matrix, DeflationSettings { nodes }).expect("groups")
}

/// Iterations and answer from a guess that is not zero.
fn solve(
    matrix: &PairMatrix,
    preconditioner: &mut dyn Preconditioner<f64>,
    tolerance: f64,
) -> (usize, Vec<f64>) {
    let null_space = if matrix.is_singular() {
        NullSpace::Constant
    } else {
        NullSpace::None
    };
    let settings = CgSettings {
        relative_tolerance: tolerance,
        max_iterations: 5000,
        ..CgSettings::default()
    };
    let (rhs, mut x) = (random(matrix.owned(), 11), random(matrix.owned(), 12));
    let report = ConjugateGradients::new()
        .solve(matrix, preconditioner, &rhs, &mut x, &settings, null_space)
        .expect("solve");
    (report.iterations, x)
}

#[test]
fn deflation_and_jacobi_agree_and_deflation_is_sooner() {
    let shift = vec![1e-4; 17 * 17 * 17];
    let lattice = Lattice::geometric(16, 5.0);
    let rows = |i: usize| lattice.row(i).into_iter();
    let shifted = PairMatrix::from_rows(&lattice.halo(), rows, &vec![false; 4913], Some(&shift));
    for matrix in [
        lattice.dirichlet(),
        lattice.neumann(),
        shifted.expect("matrix"),
        Tetrahedra::new(16, 0.2, 1.0).matrix(false),
    ] {
        let (few, x) = solve(&matrix, &mut deflation(&matrix, 40), 1e-12);
        let (many, y) = solve(&matrix, &mut Jacobi::new(&matrix), 1e-13);
        let difference: Vec<f64> = x.iter().zip(&y).map(|(a, b)| a - b).collect();
        assert!(norm(&difference) < 1e-9 * norm(&y), "{}", norm(&difference));
        assert!(4 * few < 3 * many, "{few} iterations, Jacobi {many}");
    }
}

/// As the theory of deflation says: iterations depend on the size of the groups, hardly on the size of the mesh.
#[test]
fn iterations_depend_on_the_groups_not_on_the_mesh() {
    let count = |n: usize| {
        let matrix = Lattice::uniform(n).neumann();
        solve(&matrix, &mut deflation(&matrix, 64), 1e-8).0 as f64
    };
    let (coarse, fine) = (count(16), count(32));
    assert!(fine < 1.3 * coarse, "{coarse} iterations become {fine}");
    let jacobi = |n: usize| {
        let matrix = Lattice::uniform(n).neumann();
        solve(&matrix, &mut Jacobi::new(&matrix), 1e-8).0 as f64
    };
    assert!(jacobi(32) > 1.7 * jacobi(16));
}

/// With a group of its own for every node the coarse matrix is the matrix.
#[test]
fn groups_of_one_node_solve_at_once() {
    let matrix = Lattice::geometric(8, 100.0).neumann();
    let mut deflation = deflation(&matrix, 1);
    assert_eq!(deflation.groups(), matrix.owned());
    let (iterations, _) = solve(&matrix, &mut deflation, 1e-9);
    assert!(iterations <= 1, "{iterations}");
}

#[test]
fn groups_have_about_the_size_asked_for() {
    let matrix = Lattice::uniform(24).neumann();
    let groups = deflation(&matrix, 100).groups();
    let mean = matrix.owned() as f64 / groups as f64;
    assert!((50.0..200.0).contains(&mean), "{mean} nodes a group");
}

#[test]
fn a_matrix_in_two_pieces_without_dirichlet_nodes_is_refused() {
    let halo = Halo::none(&Communicator::single(), 8);
    let rows = |i: usize| [(i as u32 ^ 1, 1.0), (i as u32 ^ 2, 0.5)].into_iter();
    let matrix = PairMatrix::from_rows(&halo, rows, &[false; 8], None).expect("matrix");
    let error = Deflation::new(&matrix, DeflationSettings { nodes: 2 });
    assert!(matches!(error, Err(SolveError::Coarsest { .. })));
}

#[test]
fn the_answer_is_bitwise_the_same_for_any_number_of_threads() {
    let matrix = Lattice::geometric(24, 20.0).neumann();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let run = || solve(&matrix, &mut deflation(&matrix, 100), 1e-8).1;
        pool.expect("pool").install(run)
    };
    assert!(run(1) == run(3));
}
