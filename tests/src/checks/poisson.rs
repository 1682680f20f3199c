//! The pressure solver on several ranks.

use super::{Outcome, ensure};
use fibreflow_mesh::{BoxElement, BoxMesh, Stretching, distribute_from, geometry};
use fibreflow_parallel::{Communicator, Halo};
use fibreflow_solve::{
    Amg, AmgSettings, CgSettings, ConjugateGradients, NullSpace, PairMatrix, SolveReport,
};
use std::error::Error;

/// Reproducible numbers in −1…1.
fn noise(index: u64) -> f64 {
    let mixed = (index + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 11) as f64 / (1u64 << 52) as f64
        - 1.0
}

/// Solution with its nodes' indices in the whole mesh.
struct Solution {
    nodes: Vec<u64>,
    x: Vec<f64>,
    report: SolveReport,
}

fn solve(
    communicator: &Communicator,
    mesh: &BoxMesh,
    dirichlet: bool,
) -> Result<Solution, Box<dyn Error>> {
    let mesh = distribute_from(communicator, || mesh.build())?;
    let geometry = geometry::dual(&mesh)?;
    let fixed: Vec<bool> = mesh
        .nodes
        .iter()
        .map(|x| dirichlet && x[0] == 0.0)
        .collect();
    let matrix = PairMatrix::new(&mesh, &geometry, &fixed, None)?;
    let values: Vec<f64> = mesh.global_nodes.iter().map(|&g| noise(g)).collect();
    let mut rhs = values.clone();
    matrix.lift(&values, &mut rhs);
    let mut x = vec![0.0; mesh.total()];
    let settings = CgSettings {
        relative_tolerance: 1e-12,
        max_iterations: 200,
        ..CgSettings::default()
    };
    let null_space = if dirichlet {
        NullSpace::None
    } else {
        NullSpace::Constant
    };
    let mut amg = Amg::new(&matrix, AmgSettings::default())?;
    let mut solver = ConjugateGradients::new();
    let report = solver.solve(&matrix, &mut amg, &rhs, &mut x, &settings, null_space)?;
    Ok(Solution {
        nodes: mesh.global_nodes,
        x,
        report,
    })
}

fn agree(communicator: &Communicator, mesh: &BoxMesh, dirichlet: bool) -> Outcome {
    let alone = solve(&Communicator::single(), mesh, dirichlet)?;
    let together = solve(communicator, mesh, dirichlet)?;
    let scale = alone.x.iter().fold(0.0, |s: f64, v| s.max(v.abs()));
    // Halo entries too: they are up to date on return.
    let pairs = together.x.iter().zip(&together.nodes);
    let difference = pairs.fold(0.0, |d: f64, (v, &node)| {
        d.max((v - alone.x[node as usize]).abs())
    });
    ensure(communicator.max(difference) < 1e-9 * scale, || {
        format!("{mesh:?}: solutions differ by {:e}", difference / scale)
    })?;
    let (one, many) = (alone.report.iterations, together.report.iterations);
    ensure(2 * many <= 3 * one + 6, || {
        format!("{mesh:?}: {one} iterations alone, {many} together")
    })
}

/// The same solution as on one rank, with about as many iterations.
pub fn ranks_agree(communicator: &Communicator) -> Outcome {
    let cube = |n: usize| BoxMesh {
        cells: [n; 3],
        periodic: [false, false, true],
        ..BoxMesh::default()
    };
    agree(communicator, &cube(20), false)?;
    // Few rows a rank.
    agree(communicator, &cube(3), true)?;
    agree(
        communicator,
        &BoxMesh {
            element: BoxElement::Tetrahedron,
            jitter: 0.2,
            ..cube(14)
        },
        true,
    )?;
    // Neighbouring cells differ by 1.35, first and last by 1000.
    agree(
        communicator,
        &BoxMesh {
            stretching: [
                Stretching::Uniform,
                Stretching::Geometric(1.35),
                Stretching::Uniform,
            ],
            ..cube(24)
        },
        false,
    )
}

/// One layer of nodes a rank, bound 10⁴ times more to the other ranks than within: nothing strong can be aggregated,
/// and multigrid converges slowly instead of giving up.
pub fn strong_couplings_cut(communicator: &Communicator) -> Outcome {
    const N: usize = 48;
    let (rank, size) = (communicator.rank(), communicator.size());
    let others: Vec<usize> = [rank.wrapping_sub(1), rank + 1]
        .into_iter()
        .filter(|&r| r < size)
        .collect();
    let owners: Vec<(u32, u32)> = others
        .iter()
        .flat_map(|&r| (0..(N * N) as u32).map(move |i| (r as u32, i)))
        .collect();
    let halo = Halo::new(communicator, N * N, &owners);
    let row = |i: usize| {
        let (x, y) = (i % N, i / N);
        let inside = [
            (x > 0).then(|| i - 1),
            (x + 1 < N).then_some(i + 1),
            (y > 0).then(|| i - N),
            (y + 1 < N).then_some(i + N),
        ];
        let inside = inside.into_iter().flatten().map(|j| (j as u32, 1.0));
        inside.chain((1..=others.len()).map(move |k| ((k * N * N + i) as u32, 1e4)))
    };
    let matrix = PairMatrix::from_rows(&halo, row, &vec![false; halo.total()], None)?;
    let mut amg = Amg::new(&matrix, AmgSettings::default())?;
    let first = (rank * N * N) as u64;
    let rhs: Vec<f64> = (first..).take(N * N).map(noise).collect();
    let mut x = vec![0.0; halo.total()];
    let settings = CgSettings {
        relative_tolerance: 1e-10,
        max_iterations: 1000,
        ..CgSettings::default()
    };
    let mut solver = ConjugateGradients::new();
    solver.solve(
        &matrix,
        &mut amg,
        &rhs,
        &mut x,
        &settings,
        NullSpace::Constant,
    )?;
    Ok(())
}
