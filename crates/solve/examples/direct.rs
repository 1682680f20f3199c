//! Time of the direct solver on boxes, one thread: `direct [cells a side, default 64 and 128]`.
//!
//! Nanoseconds, operations and bytes an unknown, the best of ten solves; operations as 5 n log₂ n a complex Fourier
//! transform and 2 n² a product with eigenvectors, bytes as what a solve must read and write once: right-hand side,
//! modes twice, factor, answer.

use fibreflow_mesh::{BoxMesh, Line, LocalMesh, Stretching, TensorGrid, geometry};
use fibreflow_solve::{Direct, PairMatrix};
use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let sizes: Vec<usize> = match std::env::args().nth(1) {
        Some(cells) => vec![cells.parse()?],
        None => vec![64, 128],
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(|| {
        for cells in sizes {
            let (u, tanh) = (Stretching::Uniform, Stretching::Tanh(2.5));
            for (name, periodic, stretching) in [
                ("channel", [true, false, true], [u, tanh, u]),
                ("duct", [true, false, false], [u, tanh, tanh]),
                ("cavity", [false; 3], [tanh; 3]),
                ("periodic", [true; 3], [u; 3]),
            ] {
                let mesh = BoxMesh {
                    cells: [cells; 3],
                    periodic,
                    stretching,
                    ..BoxMesh::default()
                };
                measure(name, &mesh)?;
            }
        }
        Ok(())
    })
}

fn measure(name: &str, mesh: &BoxMesh) -> Result<(), Box<dyn Error + Send + Sync>> {
    let mesh = LocalMesh::single(mesh.build()?);
    let start = Instant::now();
    let grid = TensorGrid::detect(&mesh).ok_or("no tensor grid")?;
    let detection = start.elapsed().as_secs_f64();
    let lines: [Line; 3] =
        std::array::from_fn(|d| Line::second(&grid.coordinates[d], grid.periods[d]));
    let start = Instant::now();
    let mut direct = Direct::new(&mesh.halo, &grid, &lines, [[false; 2]; 3], 0.0)?;
    let set_up = start.elapsed().as_secs_f64();
    let n = mesh.owned();
    let mut rhs: Vec<f64> = (0..n).map(|i| (i as f64 * 0.37).sin()).collect();
    let mean = rhs.iter().sum::<f64>() / n as f64;
    rhs.iter_mut().for_each(|v| *v -= mean);
    let mut x = vec![0.0; n];
    direct.solve(&rhs, &mut x);
    let alone = best(|| direct.solve(&rhs, &mut x)) / n as f64;
    let vectors: Vec<[f64; 4]> = rhs.iter().map(|&v| [v, 2.0 * v, 3.0 * v, 0.0]).collect();
    let mut answer = vec![[0.0; 4]; n];
    direct.solve_vectors(&vectors, &mut answer);
    let three = best(|| direct.solve_vectors(&vectors, &mut answer)) / n as f64;
    let refactored = best(|| direct.set(1.0, 1e-3)) / n as f64;

    let matrix = PairMatrix::new(&mesh, &geometry::dual(&mesh)?, &vec![false; n], None)?;
    let mut product = vec![0.0; n];
    matrix.multiply(&mut x, &mut product);
    let square = |v: &mut dyn Iterator<Item = f64>| v.map(|v| v * v).sum::<f64>().sqrt();
    let rest = square(&mut rhs.iter().zip(&product).map(|(b, y)| b - y));
    let residual = rest / square(&mut rhs.iter().copied());
    println!(
        "{name:<9} {:?} ({}): detection {detection:.3} s, set-up {set_up:.3} s\n  {:6.1} ns an unknown, {:.0} \
         operations, {:.1} GFLOP/s, 52 bytes, {:.1} GB/s; three components {:.1} ns; new shift {:.1} ns; residual \
         {residual:.1e}",
        grid.counts(),
        direct.describe(),
        1e9 * alone,
        direct.operations() / n as f64,
        1e-9 * direct.operations() / n as f64 / alone,
        52e-9 / alone,
        1e9 * three,
        1e9 * refactored,
    );
    Ok(())
}

/// Seconds of the fastest of ten runs.
fn best(mut run: impl FnMut()) -> f64 {
    let time = |_| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64()
    };
    (0..10).map(time).fold(f64::INFINITY, f64::min)
}
