//! The O-grid of a pipe: closed, exact where it is exact, second order where the circle is cut into chords.

use fibreflow_mesh::{
    Mesh, PipeMesh, QualityReport, Stretching, distribute, geometry, quality, renumber, validate,
};
use fibreflow_parallel::Communicator;
use std::f64::consts::PI;

fn pipe(core: usize) -> PipeMesh {
    PipeMesh {
        origin: [0.3, -1.0, 2.0],
        radius: 0.7,
        length: 1.3,
        cells: 3,
        core,
        layers: 2 * core,
        stretching: Stretching::Tanh(1.5),
        ..PipeMesh::default()
    }
}

fn report(mesh: Mesh) -> QualityReport {
    let local = distribute(&Communicator::single(), Some(mesh)).expect("mesh");
    let dual = geometry::dual(&local).expect("geometry");
    quality(&local, &dual)
}

#[test]
fn every_pipe_is_valid() {
    for (core, layers) in [(1, 1), (2, 3), (5, 4), (8, 12)] {
        for stretching in [
            Stretching::Uniform,
            Stretching::Tanh(2.0),
            Stretching::Geometric(0.8),
        ] {
            for (periodic, cells, roundness) in [(true, 1, 0.0), (true, 4, 0.5), (false, 2, 0.9)] {
                let pipe = PipeMesh {
                    cells,
                    layers,
                    roundness,
                    stretching,
                    periodic,
                    ..pipe(core)
                };
                let mut mesh = pipe.build().expect("pipe");
                assert_eq!(validate(&mesh), Ok(()), "{pipe:?}");
                renumber(&mut mesh).expect("order");
                assert_eq!(validate(&mesh), Ok(()), "{pipe:?}");
            }
        }
    }
}

/// Volume and wall of a prism of 4N sides, which tend to those of the cylinder at second order.
#[test]
fn volume_and_wall_are_those_of_the_prism_through_the_nodes() {
    let mut errors = Vec::new();
    for core in [3, 6] {
        for periodic in [true, false] {
            let pipe = PipeMesh {
                periodic,
                ..pipe(core)
            };
            let report = report(pipe.build().expect("pipe"));
            let (n, r, l) = (4.0 * core as f64, pipe.radius, pipe.length);
            let section = 0.5 * n * r * r * (2.0 * PI / n).sin();
            assert!((report.volume / (section * l) - 1.0).abs() < 1e-12);
            let wall = &report.patches[0];
            assert_eq!((wall.name.as_str(), wall.faces), ("wall", 3 * 4 * core));
            assert!((wall.area / (l * n * 2.0 * r * (PI / n).sin()) - 1.0).abs() < 1e-12);
            if !periodic {
                for (end, name) in report.patches[1..].iter().zip(["x_min", "x_max"]) {
                    assert_eq!(end.name, name);
                    assert!((end.area / section - 1.0).abs() < 1e-12);
                }
            }
            if periodic {
                errors.push(1.0 - report.volume / (PI * r * r * l));
            }
        }
    }
    let order = (errors[0] / errors[1]).log2();
    assert!((order - 2.0).abs() < 0.03, "{order}");
}

/// The ring on the wall is as thick as its law says, and rounded sides open the angles at the corners of the core.
#[test]
fn rounded_sides_make_a_better_mesh() {
    let figures = |roundness| {
        let mesh = PipeMesh {
            roundness,
            stretching: Stretching::Geometric(0.9),
            ..pipe(8)
        };
        report(mesh.build().expect("pipe"))
    };
    let (square, rounded) = (figures(0.0), figures(0.5));
    // A straight side meets the rings at 135° at the corners.
    assert!((square.scaled_jacobian - 0.5f64.sqrt()).abs() < 0.01);
    assert!(rounded.scaled_jacobian > 0.8);
    // The same all around, seen from the chord between two radial lines.
    let part = 0.9f64.powi(15) * (1.0 - 0.9) / (1.0 - 0.9f64.powi(16));
    let expected = part * 0.35 * (PI / 32.0).cos();
    let found = rounded.patches[0].first_cell;
    assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
}

#[test]
fn parameters_out_of_range_are_named() {
    let wrong = [
        (
            PipeMesh {
                radius: 0.0,
                ..pipe(2)
            },
            "radius",
        ),
        (
            PipeMesh {
                length: f64::NAN,
                ..pipe(2)
            },
            "length",
        ),
        (PipeMesh { core: 0, ..pipe(2) }, "core"),
        (
            PipeMesh {
                core_radius: 1.0,
                ..pipe(2)
            },
            "core_radius",
        ),
        (
            PipeMesh {
                roundness: 1.0,
                ..pipe(2)
            },
            "roundness",
        ),
        (
            PipeMesh {
                stretching: Stretching::Tanh(-1.0),
                ..pipe(2)
            },
            "stretching",
        ),
        (
            PipeMesh {
                cells: 1 << 28,
                ..pipe(20)
            },
            "32 bits",
        ),
    ];
    for (pipe, name) in wrong {
        let error = pipe.build().map(|_| ()).expect_err("refused").to_string();
        assert!(error.contains(name), "{error}");
    }
}

/// Averages over rings have one ring a layer there.
#[test]
fn layers_of_the_outer_half_are_circles() {
    let pipe = PipeMesh {
        layers: 8,
        ..pipe(6)
    };
    let mesh = pipe.build().expect("a mesh");
    let middle = 0.5 * (1.0 + pipe.core_radius) * pipe.radius;
    let radius = |x: &[f64; 3]| (x[1] - pipe.origin[1]).hypot(x[2] - pipe.origin[2]);
    let mut radii: Vec<f64> = mesh.nodes.iter().map(radius).collect();
    radii.retain(|r| *r > middle + 1e-9);
    radii.sort_by(f64::total_cmp);
    let circle = 4 * pipe.core * pipe.cells;
    assert!(radii.len() >= 2 * circle);
    for radii in radii.chunks(circle) {
        assert_eq!(radii.len(), circle);
        assert!(radii[circle - 1] - radii[0] < 1e-12, "{radii:?}");
    }
}
