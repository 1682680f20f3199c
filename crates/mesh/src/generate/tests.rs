//! Boxes of every kind are valid meshes and look as described.

use super::*;
use crate::{ElementKind, validate};

const KINDS: [BoxElement; 5] = [
    BoxElement::Hexahedron,
    BoxElement::Prism,
    BoxElement::Tetrahedron,
    BoxElement::PyramidHexahedron,
    BoxElement::Mixed,
];

fn count(mesh: &Mesh) -> [usize; 4] {
    ElementKind::ALL.map(|kind| mesh.elements.kinds.iter().filter(|k| **k == kind).count())
}

#[test]
fn boxes_of_every_kind_are_valid() {
    for element in KINDS {
        for periodic in 0..8 {
            for cells in [[5, 3, 4], [6, 2, 1], [7, 1, 2]] {
                for jitter in [0.0, 0.2, 0.45] {
                    let case = BoxMesh {
                        cells,
                        element,
                        jitter,
                        periodic: std::array::from_fn(|a| periodic >> a & 1 == 1),
                        stretching: [
                            Stretching::Geometric(1.3),
                            Stretching::Tanh(2.0),
                            Stretching::Uniform,
                        ],
                        ..BoxMesh::default()
                    };
                    let mesh = case.build().expect("mesh");
                    validate(&mesh).unwrap_or_else(|error| panic!("{case:?}: {error}"));
                }
            }
        }
    }
}

#[test]
fn kinds_are_counted() {
    let expected = [
        [0, 0, 0, 45],
        [0, 0, 90, 0],
        [270, 0, 0, 0],
        // 23 of 45 cells are divided.
        [0, 138, 0, 22],
        // Per layer of 9 cells: hexahedra, joint, tetrahedra, joint, prisms; a joint has one divided face.
        [2 * 18 + 54, 2 * 45, 18, 9],
    ];
    for (element, expected) in KINDS.into_iter().zip(expected) {
        let mesh = BoxMesh {
            cells: [5, 3, 3],
            element,
            ..BoxMesh::default()
        }
        .build()
        .expect("mesh");
        assert_eq!(count(&mesh), expected, "{element:?}");
    }
}

#[test]
fn planes_follow_the_stretching() {
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-14, "{a} {b}");
    let x = Stretching::Tanh(1.5).planes(4);
    near(x[1], 0.5 * (1.0 - 0.75f64.tanh() / 1.5f64.tanh()));
    near(x[2], 0.5);
    near(x[1] + x[3], 1.0);
    let x = Stretching::Geometric(2.0).planes(3);
    near(x[1], 1.0 / 7.0);
    near(x[2], 3.0 / 7.0);
    let x = Stretching::Geometric(1.0 + 1e-12).planes(10);
    near(x[3], 0.3 - 0.5 * 10.0 * 0.3 * 0.7 * 1e-12);
    assert_eq!((x[0], x[10]), (0.0, 1.0));
}

#[test]
fn nodes_and_patches_are_where_they_are_said_to_be() {
    let mesh = BoxMesh {
        origin: [1.0, 2.0, 3.0],
        size: [3.0, 2.0, 1.0],
        cells: [3, 2, 1],
        periodic: [true, false, true],
        ..BoxMesh::default()
    }
    .build()
    .expect("mesh");
    assert_eq!(mesh.nodes.len(), 3 * 3);
    assert_eq!(mesh.nodes[4], [2.0, 3.0, 3.0]);
    assert_eq!(mesh.patches, ["y_min", "y_max"]);
    assert_eq!(mesh.boundary.len(), 6);
    assert_eq!(
        mesh.periods.vectors,
        [[3.0, 0.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0]]
    );
}

#[test]
fn jitter_moves_inner_nodes_within_its_reach_and_is_repeatable() {
    let still = BoxMesh {
        cells: [8, 8, 1],
        periodic: [false, true, true],
        ..BoxMesh::default()
    };
    let moved = BoxMesh {
        jitter: 0.2,
        seed: 5,
        ..still.clone()
    };
    let (a, b) = (still.build().expect("mesh"), moved.build().expect("mesh"));
    let mut largest = 0.0f64;
    for (x, y) in a.nodes.iter().zip(&b.nodes) {
        let d: [f64; 3] = std::array::from_fn(|c| (y[c] - x[c]).abs());
        assert_eq!(d[2], 0.0);
        if x[0] == 0.0 || x[0] == 1.0 {
            assert_eq!(x, y);
        }
        assert!(d[0] <= 0.2 / 8.0 + 1e-15 && d[1] <= 0.2 / 8.0 + 1e-15);
        largest = largest.max(d[0]);
    }
    assert!(largest > 0.15 / 8.0);
    assert_eq!(b.nodes, moved.build().expect("mesh").nodes);
    let other = BoxMesh { seed: 6, ..moved };
    assert_ne!(b.nodes, other.build().expect("mesh").nodes);
}

#[test]
fn parameters_out_of_range_are_named() {
    let good = BoxMesh::default();
    let cases = [
        (
            "size",
            BoxMesh {
                size: [1.0, 0.0, 1.0],
                ..good.clone()
            },
        ),
        (
            "origin",
            BoxMesh {
                origin: [f64::NAN, 0.0, 0.0],
                ..good.clone()
            },
        ),
        (
            "cells",
            BoxMesh {
                cells: [1, 0, 1],
                ..good.clone()
            },
        ),
        (
            "cells",
            BoxMesh {
                element: BoxElement::Mixed,
                cells: [4, 4, 4],
                ..good.clone()
            },
        ),
        (
            "jitter",
            BoxMesh {
                jitter: 0.5,
                ..good.clone()
            },
        ),
        (
            "stretching",
            BoxMesh {
                stretching: [Stretching::Tanh(0.0); 3],
                ..good.clone()
            },
        ),
        (
            "stretching",
            BoxMesh {
                stretching: [Stretching::Tanh(800.0); 3],
                cells: [9; 3],
                ..good.clone()
            },
        ),
    ];
    for (expected, case) in cases {
        match case.build() {
            Err(MeshError::Parameter { name, .. }) => assert_eq!(name, expected),
            other => panic!("{case:?}: {:?}", other.map(|m| m.nodes.len())),
        }
    }
    let huge = BoxMesh {
        cells: [5000; 3],
        ..good
    };
    assert!(matches!(huge.build(), Err(MeshError::Size(_))));
}
