//! Drag on a towed segment does not depend on the mesh (C5; the long form is the example `towed`).

use fibreflow_coupling::Kernel;
use fibreflow_mesh::BoxElement;
use fibreflow_tests::towed::{BOX, Basin, LENGTH, Tow};
use nalgebra::Vector3;

fn tow(element: BoxElement, reynolds: f64, walls: bool) -> Tow {
    let high = if walls { LENGTH } else { 0.43 * BOX };
    Tow {
        element,
        cells: 24,
        reynolds,
        walls,
        kernel: Kernel::Gaussian { width: 1.0 },
        corrected: true,
        middle: Vector3::new(0.31 * BOX, high, 0.57 * BOX),
        directions: [
            Vector3::new(0.6, 0.0, 0.8),
            Vector3::new(0.5, 0.0, -0.2).normalize(),
        ],
    }
}

#[test]
fn drag_on_a_segment_is_that_of_the_law_in_the_bulk() {
    for element in [
        BoxElement::Hexahedron,
        BoxElement::Tetrahedron,
        BoxElement::Prism,
    ] {
        for reynolds in [1e-3, 10.0] {
            let tow = tow(element, reynolds, false);
            let mut basin = Basin::new(&tow).expect("basin");
            let right = basin.tow(&tow).expect("tow");
            let tow = Tow {
                corrected: false,
                ..tow
            };
            let disturbed = basin.tow(&tow).expect("tow");
            println!("{element:?}, Re {reynolds}: {right:?}, uncorrected {disturbed:?}");
            assert!(right.error < 0.02, "{element:?}, Re {reynolds}: {right:?}");
            assert!(
                reynolds > 1.0 || disturbed.error > 0.1,
                "{element:?}: without the correction it should matter: {disturbed:?}"
            );
        }
    }
}

#[test]
fn drag_on_a_segment_is_that_of_the_law_one_length_from_a_wall() {
    for element in [BoxElement::Hexahedron, BoxElement::Tetrahedron] {
        let tow = tow(element, 1e-3, true);
        let towed = Basin::new(&tow).expect("basin").tow(&tow).expect("tow");
        println!("{element:?}: {towed:?}");
        assert!(towed.error < 0.05, "{element:?}: {towed:?}");
    }
}
