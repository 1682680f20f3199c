//! The pressure solver on several ranks.

use super::{Outcome, ensure, meshes};
use fibreflow_mesh::{ElementKind, LocalMesh, Mesh, distribute};
use fibreflow_parallel::Communicator;
use fibreflow_solve::{
    Amg, AmgSettings, CgSettings, ConjugateGradients, NullSpace, PairMatrix, SolveReport,
};

/// Two-point weights of orthogonal hexahedra.
fn matrix(mesh: &LocalMesh, fixed: &[bool]) -> Result<PairMatrix, Box<dyn std::error::Error>> {
    const EDGES: [[usize; 2]; 12] = [
        [0, 1],
        [3, 2],
        [4, 5],
        [7, 6],
        [0, 3],
        [1, 2],
        [4, 7],
        [5, 6],
        [0, 4],
        [1, 5],
        [2, 6],
        [3, 7],
    ];
    let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); mesh.owned()];
    for e in 0..mesh.elements.len() {
        assert_eq!(mesh.elements.kinds[e], ElementKind::Hexahedron);
        let x = mesh.elements.coordinates(e, &mesh.nodes, &mesh.periods);
        let size: [f64; 3] = std::array::from_fn(|a| x[6][a] - x[0][a]);
        let nodes = mesh.elements.nodes(e);
        for (k, edge) in EDGES.iter().enumerate() {
            let along = size[k / 4];
            let weight = 0.25 * size.iter().product::<f64>() / (along * along);
            for [a, b] in [[edge[0], edge[1]], [edge[1], edge[0]]] {
                if (nodes[a] as usize) < mesh.owned() {
                    rows[nodes[a] as usize].push((nodes[b], weight));
                }
            }
        }
    }
    for row in &mut rows {
        row.sort_by_key(|&(j, _)| mesh.global_nodes[j as usize]);
        row.dedup_by(|b, a| {
            let same = a.0 == b.0;
            a.1 += if same { b.1 } else { 0.0 };
            same
        });
    }
    Ok(PairMatrix::from_rows(
        &mesh.halo,
        |i| rows[i].iter().copied(),
        fixed,
        None,
    )?)
}

fn noise(index: u64) -> f64 {
    let mixed = (index + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 11) as f64 / (1u64 << 52) as f64
        - 1.0
}

fn solve(
    communicator: &Communicator,
    mesh: Mesh,
    dirichlet: bool,
) -> Result<(LocalMesh, Vec<f64>, SolveReport), Box<dyn std::error::Error>> {
    let mesh = distribute(communicator, communicator.is_root().then_some(mesh))?;
    let fixed: Vec<bool> = mesh
        .nodes
        .iter()
        .map(|x| dirichlet && x[0] == 0.0)
        .collect();
    let matrix = matrix(&mesh, &fixed)?;
    let mut rhs: Vec<f64> = mesh.global_nodes.iter().map(|&g| noise(g)).collect();
    matrix.lift(&vec![0.0; mesh.total()], &mut rhs);
    let mut x = vec![0.0; mesh.total()];
    let mut amg = Amg::new(&matrix, AmgSettings::default())?;
    let settings = CgSettings {
        relative_tolerance: 1e-12,
        absolute_tolerance: 0.0,
        max_iterations: 300,
    };
    let null_space = if dirichlet {
        NullSpace::None
    } else {
        NullSpace::Constant
    };
    let report =
        ConjugateGradients::new().solve(&matrix, &mut amg, &rhs, &mut x, &settings, null_space)?;
    if communicator.is_root() && std::env::var("SHOW").is_ok() {
        eprintln!(
            "{} ranks {} its {:?}",
            communicator.size(),
            report.iterations,
            amg.unknowns()
        );
    }
    Ok((mesh, x, report))
}

/// The same solution as on one rank, with about as many iterations.
pub fn ranks_agree(communicator: &Communicator) -> Outcome {
    let mut stretched = meshes::cube(24);
    stretched
        .nodes
        .iter_mut()
        .for_each(|x| x[1] = x[1].powi(2) * (0.02 + x[1]));
    for (mesh, dirichlet) in [
        (meshes::cube(20), false),
        (meshes::cube(20), true),
        (stretched, false),
        (meshes::cube(4), false),
    ] {
        let (_, whole, alone) = solve(&Communicator::single(), mesh.clone(), dirichlet)?;
        let (local, part, together) = solve(communicator, mesh, dirichlet)?;
        let scale = whole.iter().fold(0.0, |s: f64, v| s.max(v.abs()));
        let difference = part.iter().zip(&local.global_nodes);
        let difference =
            difference.fold(0.0, |d: f64, (v, &g)| d.max((v - whole[g as usize]).abs()));
        ensure(communicator.max(difference) < 1e-9 * scale, || {
            format!("differs by {:e}", difference / scale)
        })?;
        let (one, many) = (alone.iterations, together.iterations);
        ensure(2 * many <= 3 * one + 6, || {
            format!(
                "{one} iterations alone, {many} on {} ranks",
                communicator.size()
            )
        })?;
    }
    Ok(())
}
