//! Iterations and time of the pressure solver on boxes: `poisson [cells a side, default 48]`.
//!
//! One thread; residual 1e-8 of a random right-hand side, no Dirichlet nodes; the best of three cold solves.

use fibreflow_mesh::{BoxElement, BoxMesh, Stretching, distribute, geometry};
use fibreflow_parallel::Communicator;
use fibreflow_solve::{
    Amg, AmgSettings, CgSettings, ConjugateGradients, Jacobi, NullSpace, PairMatrix, Preconditioner,
};
use rand::{Rng, SeedableRng};
use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let cells = std::env::args()
        .nth(1)
        .map_or(Ok(48), |n| n.parse::<usize>())?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(|| {
        let cube = BoxMesh {
            cells: [cells; 3],
            periodic: [true, false, true],
            ..BoxMesh::default()
        };
        let stretched = |stretching| BoxMesh {
            stretching: [Stretching::Uniform, stretching, Stretching::Uniform],
            ..cube.clone()
        };
        let ratio = 1000f64.powf(1.0 / (cells - 1) as f64);
        let tetrahedra = BoxMesh {
            element: BoxElement::Tetrahedron,
            jitter: 0.2,
            ..cube.clone()
        };
        measure("hexahedra, uniform", &cube)?;
        measure("hexahedra, tanh 2.5", &stretched(Stretching::Tanh(2.5)))?;
        measure(
            "hexahedra, 1:1000",
            &stretched(Stretching::Geometric(ratio)),
        )?;
        measure(
            "hexahedra, jitter 0.2",
            &BoxMesh {
                jitter: 0.2,
                ..cube.clone()
            },
        )?;
        measure("tetrahedra, jitter 0.2", &tetrahedra)?;
        measure(
            "tetrahedra, 1:20 flat",
            &BoxMesh {
                size: [1.0, 0.05, 1.0],
                ..tetrahedra
            },
        )
    })
}

fn measure(name: &str, mesh: &BoxMesh) -> Result<(), Box<dyn Error + Send + Sync>> {
    let mesh = distribute(&Communicator::single(), Some(mesh.build()?))?;
    let matrix = PairMatrix::new(
        &mesh,
        &geometry::dual(&mesh)?,
        &vec![false; mesh.total()],
        None,
    )?;
    let start = Instant::now();
    let mut amg = Amg::new(&matrix, AmgSettings::default())?;
    let set_up = start.elapsed().as_secs_f64();
    println!("{name}: levels {:?}, set-up {set_up:.3} s", amg.unknowns());
    solve("multigrid", &matrix, &mut amg)?;
    solve("jacobi", &matrix, &mut Jacobi::new(&matrix))
}

fn solve(
    name: &str,
    matrix: &PairMatrix,
    preconditioner: &mut dyn Preconditioner<f64>,
) -> Result<(), Box<dyn Error + Send + Sync>> {
    let nodes = matrix.owned();
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let rhs: Vec<f64> = (0..nodes).map(|_| random.random_range(-1.0..1.0)).collect();
    let settings = CgSettings {
        max_iterations: 10_000,
        ..CgSettings::default()
    };
    let mut solver = ConjugateGradients::new();
    let (mut seconds, mut iterations) = (f64::INFINITY, 0);
    for _ in 0..3 {
        let mut x = vec![0.0; nodes];
        let start = Instant::now();
        let report = solver.solve(
            matrix,
            preconditioner,
            &rhs,
            &mut x,
            &settings,
            NullSpace::Constant,
        )?;
        seconds = start.elapsed().as_secs_f64().min(seconds);
        iterations = report.iterations;
    }
    let each = 1e6 * seconds / nodes as f64;
    println!("  {name:<10} {iterations:5} iterations {seconds:8.3} s {each:7.3} µs per unknown");
    Ok(())
}
