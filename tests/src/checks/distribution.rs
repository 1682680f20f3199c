//! What the ranks hold and send.

use super::{Outcome, ensure, meshes};
use fibreflow_mesh::{MeshError, distribute, distribute_from};
use fibreflow_parallel::Communicator;

/// Each rank holds its share of a 32³ mesh and little more: at most 45 % at 4 ranks (ARCHITECTURE section 4).
pub fn no_rank_holds_the_mesh(communicator: &Communicator) -> Outcome {
    let mesh = distribute_from(communicator, || meshes::cube(32))?;
    let allowed = match communicator.size() {
        4 => 0.45,
        size => 1.0 / size as f64 + 0.2,
    };
    let held = communicator.max(mesh.total() as f64 / mesh.total_nodes as f64);
    ensure(held <= allowed, || {
        format!("a rank holds {:.1} % of the nodes", 100.0 * held)
    })?;
    let elements = communicator.max(mesh.elements.len() as f64 / mesh.total_elements as f64);
    ensure(elements <= allowed, || {
        format!("a rank holds {:.1} % of the elements", 100.0 * elements)
    })
}

/// Doubling n multiplies the entries sent per update by about 4 (the interface), not by 8 (the volume).
pub fn messages_scale(communicator: &Communicator) -> Outcome {
    let mut sent = [0.0; 2];
    for (sent, n) in sent.iter_mut().zip([16, 32]) {
        let mesh = distribute_from(communicator, || meshes::cube(n))?;
        *sent = communicator.sum(mesh.halo.sent_entries() as f64);
    }
    let ratio = sent[1] / sent[0];
    ensure((3.0..5.0).contains(&ratio), || {
        format!("{sent:?} entries are sent at n = 16 and 32: ratio {ratio:.2}")
    })
}

/// No rank waits for a piece that never comes.
pub fn errors_reach_all(communicator: &Communicator) -> Outcome {
    let mut broken = meshes::cube(4)?;
    broken.elements.nodes[10] = 1_000_000;
    let outcomes = [
        distribute(communicator, None),
        distribute(communicator, communicator.is_root().then_some(broken)),
        distribute_from(communicator, || Err(MeshError::Size("no such file".into()))),
    ];
    for (outcome, expected) in outcomes
        .into_iter()
        .zip(["empty", "1000000", "no such file"])
    {
        let Err(error) = outcome else {
            return Err(format!("no error about {expected}").into());
        };
        ensure(error.to_string().contains(expected), || {
            format!("`{error}` does not say {expected}")
        })?;
        ensure(
            communicator.is_root() != matches!(error, MeshError::OnRoot(_)),
            || format!("{error:?} on rank {}", communicator.rank()),
        )?;
    }
    Ok(())
}
