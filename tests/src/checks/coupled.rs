//! Fluid and fibres, two-way coupled, on several ranks.

use super::{Outcome, ensure};
use crate::coupled::{BOX, Coupled, GAUSSIAN, SPEED};
use fibreflow_coupling::Kernel;
use fibreflow_mesh::{BoxElement, BoxMesh};
use fibreflow_parallel::Communicator;

const STEPS: usize = 30;
const DT: f64 = 2e-4;

/// Positions, velocities and momentum as on one rank, while fibres change owner and cross periodic boundaries.
pub fn ranks_agree(communicator: &Communicator) -> Outcome {
    for (element, kernel) in [
        (BoxElement::Hexahedron, Kernel::Element),
        (BoxElement::Mixed, Kernel::Element),
        (BoxElement::Mixed, Kernel::Middle),
        (BoxElement::Mixed, GAUSSIAN),
    ] {
        let mesh = BoxMesh {
            cells: [6, 6, 6],
            periodic: [true; 3],
            element,
            jitter: 0.15,
            seed: 2,
            ..BoxMesh::default()
        };
        let mut shared = Coupled::new(communicator, &mesh, kernel)?;
        let mut alone = Coupled::new(&Communicator::single(), &mesh, kernel)?;
        let start = shared.momentum();
        for step in 0..STEPS {
            if step % 10 == 5 {
                shared.settle()?;
            }
            let report = shared.step(DT)?;
            alone.step(DT)?;
            ensure(report.defect_relative < 1e-12, || {
                format!("{element:?}: {report:?}")
            })?;
        }
        let drift = (shared.momentum() - start).norm() / shared.impulses;
        ensure(drift < 1e-10, || {
            format!("{element:?}: momentum drifts by {drift:e}")
        })?;
        compare(&shared, &alone, element)?;
    }
    Ok(())
}

fn compare(shared: &Coupled, alone: &Coupled, element: BoxElement) -> Outcome {
    for local in 0..shared.fibres.fibres() {
        let id = shared.fibres.id(local);
        let Some(other) = alone.fibres.find(id) else {
            return Err(format!("fibre {id} appeared from nowhere").into());
        };
        let here = shared.fibres.offsets()[local]..shared.fibres.offsets()[local + 1];
        let there = alone.fibres.offsets()[other]..alone.fibres.offsets()[other + 1];
        for (a, b) in here.zip(there) {
            let distance = (shared.fibres.positions()[a] - alone.fibres.positions()[b]).norm();
            ensure(distance < 1e-8 * BOX, || {
                format!(
                    "{element:?}: fibre {id} is {distance:e} m away from where it is on one rank"
                )
            })?;
        }
    }
    let mesh = shared.fluid.mesh();
    for (i, u) in shared.fluid.velocity()[..mesh.owned()].iter().enumerate() {
        let expected = alone.fluid.velocity()[mesh.global_nodes[i] as usize];
        for (a, b) in u.iter().zip(expected) {
            ensure((a - b).abs() < 1e-8 * SPEED, || {
                format!(
                    "{element:?}: velocity {a} instead of {b} at node {}",
                    mesh.global_nodes[i]
                )
            })?;
        }
    }
    let all = shared
        .fibres
        .communicator()
        .sum_count(shared.fibres.fibres());
    ensure(all == alone.fibres.fibres(), || {
        format!("{all} fibres are left")
    })
}
