//! The halo exchange.

use super::{Outcome, ensure, meshes};
use fibreflow_mesh::distribute_from;
use fibreflow_parallel::Communicator;

/// Reproducible numbers in −1…1 that depend on a seed and an index.
fn noise(seed: u64, index: u64) -> f64 {
    let mixed = (index ^ (seed << 32)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 11) as f64 / (1u64 << 52) as f64
        - 1.0
}

/// ⟨update x, y⟩ over owned and halo entries equals ⟨x, accumulate y⟩ over owned entries.
pub fn adjoint(communicator: &Communicator) -> Outcome {
    let mesh = distribute_from(communicator, || meshes::cube(9))?;
    let rank = communicator.rank() as u64;
    let mut x: Vec<[f64; 1]> = (0..mesh.total() as u64)
        .map(|i| [noise(1 + rank, i)])
        .collect();
    let mut y: Vec<[f64; 1]> = (0..mesh.total() as u64)
        .map(|i| [noise(91 + rank, i)])
        .collect();
    let dot = |x: &[[f64; 1]], y: &[[f64; 1]]| x.iter().zip(y).map(|(a, b)| a[0] * b[0]).sum();
    let owned_x = x[..mesh.owned()].to_vec();
    mesh.halo.update(&mut x);
    let updated = communicator.sum(dot(&x, &y));
    mesh.halo.accumulate(&mut y);
    ensure(y[mesh.owned()..].iter().all(|v| v[0] == 0.0), || {
        "accumulate left values in the halo".into()
    })?;
    let accumulated = communicator.sum(dot(&owned_x, &y[..mesh.owned()]));
    let size = communicator.sum(mesh.total() as f64);
    ensure((updated - accumulated).abs() < 1e-13 * size, || {
        format!("⟨update x, y⟩ = {updated}, ⟨x, accumulate y⟩ = {accumulated}")
    })
}

/// After an update every halo entry holds what its owner put there, and its coordinates are the owner's.
pub fn owners_values(communicator: &Communicator) -> Outcome {
    let mesh = distribute_from(communicator, || meshes::cube(9))?;
    let mut ids = vec![u64::MAX; mesh.total()];
    let mut nodes = vec![[f64::NAN; 3]; mesh.total()];
    ids[..mesh.owned()].copy_from_slice(&mesh.global_nodes[..mesh.owned()]);
    nodes[..mesh.owned()].copy_from_slice(&mesh.nodes[..mesh.owned()]);
    let mut seen_inside = 0;
    mesh.halo
        .update_while(&mut ids, |field| seen_inside = field.len());
    mesh.halo.update(&mut nodes);
    ensure(seen_inside == mesh.total(), || {
        "the work was not done".into()
    })?;
    ensure(ids == mesh.global_nodes, || "wrong nodes arrived".into())?;
    ensure(nodes == mesh.nodes, || "wrong coordinates arrived".into())?;
    let owned = communicator.sum_count(mesh.owned());
    ensure(owned == mesh.total_nodes, || {
        format!("{owned} nodes are owned, there are {}", mesh.total_nodes)
    })?;
    let elements = mesh.owned_elements.iter().filter(|&&o| o).count();
    let elements = communicator.sum_count(elements);
    ensure(elements == mesh.total_elements, || {
        format!(
            "{elements} elements are owned, there are {}",
            mesh.total_elements
        )
    })
}
