//! Generated boxes through validation, renumbering and the quality report.

use fibreflow_mesh::{
    BoxElement, BoxMesh, LocalMesh, Mesh, QualityReport, Stretching, distribute, geometry, quality,
    renumber, validate,
};
use fibreflow_parallel::Communicator;

const ELEMENTS: [BoxElement; 5] = [
    BoxElement::Hexahedron,
    BoxElement::Prism,
    BoxElement::Tetrahedron,
    BoxElement::PyramidHexahedron,
    BoxElement::Mixed,
];

fn local(mesh: Mesh) -> LocalMesh {
    distribute(&Communicator::single(), Some(mesh)).expect("mesh")
}

fn report(mesh: Mesh) -> QualityReport {
    let mesh = local(mesh);
    let geometry = geometry::dual(&mesh).expect("geometry");
    quality(&mesh, &geometry)
}

#[test]
fn every_box_is_valid() {
    for element in ELEMENTS {
        for (cells, periodic) in [
            ([6, 4, 4], [false; 3]),
            ([6, 2, 2], [false, true, true]),
            ([6, 4, 2], [true; 3]),
        ] {
            for jitter in [0.0, 0.2] {
                let mesh = BoxMesh {
                    cells,
                    periodic,
                    element,
                    jitter,
                    ..BoxMesh::default()
                };
                let mesh = mesh.build().expect("mesh");
                let found = validate(&mesh);
                assert_eq!(found, Ok(()), "{element:?} {periodic:?} jitter {jitter}");
            }
        }
    }
}

/// The other numbering is the same mesh: the same figures to round-off, and the same closed boundary.
#[test]
fn renumbering_changes_no_figure() {
    for element in ELEMENTS {
        let mesh = BoxMesh {
            cells: [24, 3, 3],
            periodic: [false, false, true],
            element,
            jitter: 0.2,
            ..BoxMesh::default()
        };
        let mut mesh = mesh.build().expect("mesh");
        // Nodes in an order without any locality.
        let count = mesh.nodes.len();
        let scattered: Vec<usize> = (0..count).map(|i| i * 1009 % count).collect();
        assert_ne!(count % 1009, 0);
        let mut nodes = vec![[0.0; 3]; count];
        (0..count).for_each(|i| nodes[scattered[i]] = mesh.nodes[i]);
        mesh.nodes = nodes;
        let rename = |n: &mut u32| *n = scattered[*n as usize] as u32;
        mesh.elements.nodes.iter_mut().for_each(rename);
        for face in &mut mesh.boundary {
            face.nodes[..face.vertices as usize]
                .iter_mut()
                .for_each(rename);
        }
        let before = report(mesh.clone());
        let bandwidth = renumber(&mut mesh).expect("renumbering");
        assert!(
            bandwidth.after.mean < 0.25 * bandwidth.before.mean,
            "{element:?}: {bandwidth:?}"
        );
        assert_eq!(validate(&mesh), Ok(()));
        let after = report(mesh);
        assert_eq!(after.elements, before.elements);
        let same = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
        assert!(same(after.volume, before.volume));
        assert!(same(after.dual_volumes[0], before.dual_volumes[0]));
        assert!(same(after.dual_volumes[1], before.dual_volumes[1]));
        assert!(same(after.aspect_ratio, before.aspect_ratio));
        assert!((after.non_orthogonality - before.non_orthogonality).abs() < 1e-6);
        for (a, b) in after.patches.iter().zip(&before.patches) {
            assert_eq!((&a.name, a.faces), (&b.name, b.faces));
            assert!(same(a.area, b.area) && same(a.first_cell, b.first_cell));
        }
    }
}

#[test]
fn a_stretched_box_of_hexahedra_reports_its_walls() {
    let beta = 2.0;
    let mesh = BoxMesh {
        size: [4.0, 2.0, 1.0],
        cells: [4, 8, 1],
        stretching: [
            Stretching::Uniform,
            Stretching::Tanh(beta),
            Stretching::Uniform,
        ],
        periodic: [true, false, true],
        ..BoxMesh::default()
    };
    let report = report(mesh.build().expect("mesh"));
    assert!(report.orthogonal);
    assert!(report.non_orthogonality < 1e-5);
    assert!((report.volume - 8.0).abs() < 1e-12);
    let first = 1.0 + (beta * (0.25 - 1.0)).tanh() / beta.tanh();
    for (patch, name) in report.patches.iter().zip(["y_min", "y_max"]) {
        assert_eq!((patch.name.as_str(), patch.faces), (name, 4));
        assert!((patch.first_cell - first).abs() < 1e-12);
        assert!((patch.area - 4.0).abs() < 1e-12);
    }
    assert!((report.aspect_ratio - 1.0 / first).abs() < 1e-9);
    assert!((report.scaled_jacobian - 1.0).abs() < 1e-12);
    let text = report.to_string();
    assert!(text.contains("hexahedron × 32"), "{text}");
    assert!(text.contains("two-point"), "{text}");
}

#[test]
fn distortion_shows_as_non_orthogonality() {
    let figure = |jitter| {
        let mesh = BoxMesh {
            cells: [6; 3],
            jitter,
            ..BoxMesh::default()
        };
        report(mesh.build().expect("mesh")).mean_non_orthogonality
    };
    let (none, little, much) = (figure(0.0), figure(0.05), figure(0.25));
    assert!(none < 1e-5, "{none}");
    assert!(little > 1.0 && much > little, "{little} {much}");
}
