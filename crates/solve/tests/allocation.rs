//! Iterations do not touch the heap: a solve of twelve allocates as often as a solve of four, and a direct solve not at
//! all.

mod common;

use common::{Lattice, random};
use fibreflow_mesh::{BoxMesh, Line, LocalMesh, Stretching, TensorGrid};
use fibreflow_solve::{
    Amg, AmgSettings, CgSettings, ConjugateGradients, Deflation, DeflationSettings, Direct, Jacobi,
    NullSpace, PairMatrix, Preconditioner, SolveError,
};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is passed on to the system allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

fn allocations(
    matrix: &PairMatrix,
    preconditioner: &mut dyn Preconditioner<f64>,
    solver: &mut ConjugateGradients<f64>,
    iterations: usize,
) -> usize {
    let rhs = random(matrix.owned(), 3);
    let mut x = vec![0.0; matrix.owned()];
    let settings = CgSettings {
        relative_tolerance: 1e-30,
        max_iterations: iterations,
        ..CgSettings::default()
    };
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    let outcome = solver.solve(
        matrix,
        preconditioner,
        &rhs,
        &mut x,
        &settings,
        NullSpace::Constant,
    );
    let after = ALLOCATIONS.load(Ordering::Relaxed);
    assert!(matches!(outcome, Err(SolveError::NotConverged { .. })));
    after - before
}

/// One test: the count is that of the whole process.
#[test]
fn solves_do_not_allocate() {
    an_iteration_does_not_allocate();
    a_direct_solve_does_not_allocate();
}

fn an_iteration_does_not_allocate() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.expect("pool").install(|| {
        let matrix = Lattice::uniform(24).neumann();
        let mut amg = Amg::new(&matrix, AmgSettings::default()).expect("hierarchy");
        let mut jacobi = Jacobi::new(&matrix);
        let mut solver = ConjugateGradients::new();
        let mut deflation = Deflation::new(&matrix, DeflationSettings::default()).expect("groups");
        let preconditioners: [&mut dyn Preconditioner<f64>; 3] =
            [&mut amg, &mut jacobi, &mut deflation];
        for preconditioner in preconditioners {
            allocations(&matrix, preconditioner, &mut solver, 12);
            let few = allocations(&matrix, preconditioner, &mut solver, 4);
            let many = allocations(&matrix, preconditioner, &mut solver, 12);
            assert_eq!(few, many);
        }
    });
}

/// Fourier transforms and products with eigenvectors, one component and three, and a new shift.
fn a_direct_solve_does_not_allocate() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.expect("pool").install(|| {
        for periodic in [[true, false, true], [true, false, false], [false; 3]] {
            let mesh = BoxMesh {
                cells: [12; 3],
                periodic,
                stretching: [
                    Stretching::Uniform,
                    Stretching::Tanh(2.0),
                    Stretching::Uniform,
                ],
                ..BoxMesh::default()
            };
            let mesh = LocalMesh::single(mesh.build().expect("mesh"));
            let grid = TensorGrid::detect(&mesh).expect("tensor grid");
            let lines: [Line; 3] =
                std::array::from_fn(|d| Line::second(&grid.coordinates[d], grid.periods[d]));
            let free = [[false; 2]; 3];
            let mut direct = Direct::new(&mesh.halo, &grid, &lines, free, 0.0).expect("direct");
            let rhs = random(mesh.owned(), 3);
            let mut x = vec![0.0; mesh.owned()];
            let vectors = vec![[1.0, 2.0, 3.0, 0.0]; mesh.owned()];
            let mut answer = vectors.clone();
            let mut run = || {
                let before = ALLOCATIONS.load(Ordering::Relaxed);
                direct.solve(&rhs, &mut x);
                direct.set(1.0, 0.1);
                direct.solve_vectors(&vectors, &mut answer);
                direct.set(0.0, 1.0);
                ALLOCATIONS.load(Ordering::Relaxed) - before
            };
            run();
            let (second, third) = (run(), run());
            assert_eq!([second, third], [0, 0], "{periodic:?}");
        }
    });
}
