//! The direct solver on several ranks.

use super::{Outcome, ensure};
use fibreflow_mesh::{BoxMesh, Line, LocalMesh, Stretching, TensorGrid, distribute_from, geometry};
use fibreflow_parallel::Communicator;
use fibreflow_solve::{Direct, PairMatrix};
use std::error::Error;

/// Reproducible numbers in −1…1.
fn noise(index: u64) -> f64 {
    let mixed = (index + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 11) as f64 / (1u64 << 52) as f64
        - 1.0
}

const FREE: [[bool; 2]; 3] = [[false; 2]; 3];

fn solver(mesh: &LocalMesh, ends: [[bool; 2]; 3]) -> Result<(TensorGrid, Direct), Box<dyn Error>> {
    let grid = TensorGrid::detect(mesh).ok_or("the grid was not found")?;
    let lines: [Line; 3] =
        std::array::from_fn(|d| Line::second(&grid.coordinates[d], grid.periods[d]));
    let direct = Direct::new(&mesh.halo, &grid, &lines, ends, 0.0)?;
    Ok((grid, direct))
}

/// Owned nodes in the whole mesh and their solution, of one component and of three.
struct Solution {
    nodes: Vec<u64>,
    x: Vec<f64>,
    vectors: Vec<[f64; 4]>,
}

fn solve(
    communicator: &Communicator,
    case: &BoxMesh,
    ends: [[bool; 2]; 3],
) -> Result<Solution, Box<dyn Error>> {
    let mesh = distribute_from(communicator, || case.build())?;
    let (grid, mut direct) = solver(&mesh, ends)?;
    let dual = geometry::dual(&mesh)?;
    let counts = grid.counts();
    let on_end = |at: &[u32; 3]| {
        (0..3).any(|d| {
            let (at, last) = (at[d] as usize, counts[d] - 1);
            ends[d][0] && at == 0 || ends[d][1] && at == last
        })
    };
    let fixed: Vec<bool> = grid.indices.iter().map(on_end).collect();
    ensure(
        Direct::fixed_ends(&mesh.halo, &grid, &fixed) == Some(ends),
        || format!("{case:?}: the fixed ends were not found"),
    )?;
    let matrix = PairMatrix::new(&mesh, &dual, &fixed, None)?;
    let nodes = mesh.global_nodes[..mesh.owned()].to_vec();
    let mean = (0..mesh.total_nodes as u64).map(noise).sum::<f64>() / mesh.total_nodes as f64;
    let mean = if ends == FREE { mean } else { 0.0 };
    let rhs: Vec<f64> = nodes.iter().map(|&node| noise(node) - mean).collect();
    let mut x = vec![0.0; mesh.total()];
    direct.solve(&rhs, &mut x);
    let mut product = vec![0.0; mesh.owned()];
    matrix.multiply(&mut x, &mut product);
    let square = |values: &mut dyn Iterator<Item = f64>| {
        communicator.sum(values.map(|v| v * v).sum::<f64>())
    };
    let rest = square(&mut rhs.iter().zip(&product).map(|(b, y)| b - y));
    let scale = square(&mut rhs.iter().copied());
    ensure(rest.sqrt() < 1e-12 * scale.sqrt(), || {
        format!("{case:?}: residual {:e}", (rest / scale).sqrt())
    })?;
    let vector = |&node: &u64| [0, 1, 2].map(|c| noise(3 * node + c));
    let sources: Vec<[f64; 4]> = nodes
        .iter()
        .map(vector)
        .map(|[x, y, z]| [x, y, z, 0.0])
        .collect();
    let mut vectors = vec![[0.0; 4]; mesh.owned()];
    direct.solve_vectors(&sources, &mut vectors);
    // Again: what is kept between solves does no harm.
    direct.solve(&rhs, &mut x);
    Ok(Solution { nodes, x, vectors })
}

/// The grid is found on any distribution, and the solution is that of one rank.
pub fn ranks_agree(communicator: &Communicator) -> Outcome {
    let (uniform, tanh) = (Stretching::Uniform, Stretching::Tanh(2.0));
    let case = |cells, periodic, stretching| BoxMesh {
        cells,
        periodic,
        stretching,
        ..BoxMesh::default()
    };
    let channel = case([20, 12, 16], [true, false, true], [uniform, tanh, uniform]);
    let outlet = [[false, true], [false; 2], [false; 2]];
    for (case, ends) in [
        (channel.clone(), FREE),
        (channel, [[false; 2], [true; 2], [false; 2]]),
        (
            case([9, 8, 10], [false; 3], [tanh, uniform, uniform]),
            outlet,
        ),
        (
            case([12, 16, 1], [false, true, true], [tanh, uniform, uniform]),
            FREE,
        ),
        (case([10, 9, 8], [true; 3], [uniform; 3]), FREE),
        // Fewer planes and fewer modes than ranks.
        (case([40, 3, 1], [true, true, true], [uniform; 3]), FREE),
        (case([40, 1, 1], [false, true, true], [uniform; 3]), outlet),
    ] {
        let alone = solve(&Communicator::single(), &case, ends)?;
        let together = solve(communicator, &case, ends)?;
        let scale = alone.x.iter().fold(0.0, |s: f64, v| s.max(v.abs()));
        let vectors = alone.vectors.iter().flatten();
        let vector_scale = vectors.fold(0.0, |s: f64, v| s.max(v.abs()));
        let (mut worst, mut worst_vector) = (0.0f64, 0.0f64);
        for (k, &node) in together.nodes.iter().enumerate() {
            worst = worst.max((together.x[k] - alone.x[node as usize]).abs());
            for c in 0..4 {
                let difference = together.vectors[k][c] - alone.vectors[node as usize][c];
                worst_vector = worst_vector.max(difference.abs());
            }
        }
        let worst = communicator.max((worst / scale).max(worst_vector / vector_scale));
        ensure(worst < 1e-11, || {
            format!("{case:?}: solutions differ by {worst:e}")
        })?;
    }
    Ok(())
}

/// One node out of its planes: no rank takes the mesh for a tensor product.
pub fn a_moved_node_is_seen_by_all(communicator: &Communicator) -> Outcome {
    for node in [0, 200, 700] {
        let mesh = distribute_from(communicator, || {
            let case = BoxMesh {
                cells: [8; 3],
                periodic: [true, false, true],
                ..BoxMesh::default()
            };
            let mut mesh = case.build()?;
            let node = node % mesh.nodes.len();
            mesh.nodes[node][1] += 1e-4;
            Ok(mesh)
        })?;
        let found = TensorGrid::detect(&mesh).is_some();
        ensure(!communicator.any(found), || {
            format!("node {node} was not seen")
        })?;
    }
    Ok(())
}
