//! Momentum of fluid and fibres together (validation row C1).

use fibreflow_coupling::Kernel;
use fibreflow_mesh::{BoxElement, BoxMesh};
use fibreflow_parallel::Communicator;
use fibreflow_tests::coupled::{Coupled, GAUSSIAN};
use nalgebra::Vector3;

const KINDS: [BoxElement; 4] = [
    BoxElement::Hexahedron,
    BoxElement::Tetrahedron,
    BoxElement::Prism,
    BoxElement::Mixed,
];
/// The kernel of many nodes is dear, so that it has fewer steps.
const RUNS: [(Kernel, usize); 3] = [
    (Kernel::Element, 1000),
    (Kernel::Middle, 300),
    (GAUSSIAN, 300),
];
const DT: f64 = 2e-4;

fn mesh(element: BoxElement, periodic: [bool; 3]) -> BoxMesh {
    BoxMesh {
        cells: [5, 5, 5],
        periodic,
        element,
        jitter: 0.15,
        seed: 2,
        ..BoxMesh::default()
    }
}

/// Constant to 1e-10 of Σ|impulse| over 1,000 steps in a fully periodic box, while fibres cross its boundaries.
#[test]
fn momentum_is_constant_in_a_periodic_box() {
    for (element, (kernel, steps)) in KINDS.into_iter().flat_map(|e| RUNS.map(|run| (e, run))) {
        let mesh = mesh(element, [true; 3]);
        let mut both = Coupled::new(&Communicator::single(), &mesh, kernel).expect("set-up");
        let (start, fibres_start) = (both.momentum(), both.fibre_momentum());
        let (mut drift, mut defect, mut exchanged) = (0.0_f64, 0.0_f64, 0.0_f64);
        for _ in 0..steps {
            let report = both.step(DT).expect("step");
            assert_eq!(report.outside, 0);
            defect = defect.max(report.defect_relative);
            drift = drift.max((both.momentum() - start).norm() / both.impulses);
            exchanged = exchanged.max((both.fibre_momentum() - fibres_start).norm());
        }
        println!(
            "{element:?}, {kernel:?}: drift {drift:.1e} of {:.1e} N s, defect {defect:.1e}",
            both.impulses
        );
        assert!(
            drift < 1e-10,
            "{element:?}: momentum drifts by {drift:e} of the impulses"
        );
        assert!(defect < 1e-12, "{element:?}: transfer loses {defect:e}");
        assert!(
            exchanged > 1e-3 * both.impulses,
            "the fibres should have taken up momentum"
        );
        let far = both
            .fibres
            .positions()
            .iter()
            .any(|x| x.amax() > 2.0 * fibreflow_tests::coupled::BOX);
        assert!(
            far || steps < 1000,
            "the fibres should have crossed the boundaries"
        );
    }
}

/// Between two walls what fluid and fibres lose is what the walls take, to 1e-8.
#[test]
fn walls_take_what_fluid_and_fibres_lose() {
    for (element, (kernel, _)) in KINDS.into_iter().flat_map(|e| RUNS.map(|run| (e, run))) {
        let mesh = mesh(element, [true, false, true]);
        let mut both = Coupled::new(&Communicator::single(), &mesh, kernel).expect("set-up");
        let patches = both.fluid.mesh().patches.len();
        let (mut taken, mut taken_size, mut landed) = (Vector3::zeros(), 0.0, 0.0);
        let start = both.momentum();
        for _ in 0..200 {
            let report = both.step(DT).expect("step");
            for patch in 0..patches {
                let impulse = DT * Vector3::from(both.fluid.wall_force(patch));
                taken += impulse;
                taken_size += impulse.norm();
            }
            landed += DT * report.on_walls.norm();
        }
        let open = (start - both.momentum() - taken).norm() / (both.impulses + taken_size);
        println!(
            "{element:?}, {kernel:?}: balance open by {open:.1e}, {landed:.1e} N s landed on wall nodes"
        );
        assert!(open < 1e-8, "{element:?}: balance open by {open:e}");
        assert!(landed > 0.0, "some force should land on wall nodes");
    }
}
