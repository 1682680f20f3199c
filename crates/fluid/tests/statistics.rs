//! Averages of known fields: moments, spectra, errors, friction.

mod common;

use common::{fluid_in, fluid_on, of, ring, settings};
use fibreflow_fluid::{
    AROUND, Averaging, BoundaryCondition, Fluid, FluidSettings, Forcing, Statistics,
    StatisticsReport, StatisticsSettings, VelocityProfile,
};
use fibreflow_mesh::{BoxElement, BoxMesh, PipeMesh};
use std::f64::consts::{PI, TAU};

const CHANNEL: Averaging = Averaging::Planes {
    normal: 1,
    flow: 0,
    symmetric: true,
};

fn about(averaging: Averaging, spectra: &[usize]) -> StatisticsSettings {
    StatisticsSettings {
        averaging,
        from: 0.0,
        block: 1.0,
        spectra: spectra.to_vec(),
    }
}

fn channel(forcing: f64) -> Fluid {
    let mesh = BoxMesh {
        periodic: [true, false, true],
        ..of(BoxElement::Hexahedron, [3.0, 2.0, 1.5], [12, 16, 8], 0.0)
    };
    let settings = FluidSettings {
        forcing: Forcing::PressureGradient([forcing, 0.0, 0.0]),
        ..settings(2.0, 0.5, 1e-12)
    };
    fluid_on(&mesh, settings, |_| BoundaryCondition::WALL)
}

fn column<'a>(report: &'a StatisticsReport, name: &str) -> (&'a [f64], &'a [f64]) {
    let found = report.columns.iter().find(|c| c.name == name);
    let column = found.expect("a column of this name");
    (&column.values, &column.errors)
}

fn close(found: f64, wanted: f64, tolerance: f64, what: &str) {
    assert!(
        (found - wanted).abs() <= tolerance,
        "{what}: {found}, {wanted}"
    );
}

/// Streaks that do not change along x, and waves of w along x that do not change along z: both solenoidal.
fn streaks(u_mean: f64, a: f64, b: f64) -> impl Fn([f64; 3]) -> [f64; 3] {
    move |[x, y, z]| {
        let shape = y * (2.0 - y);
        let streak = a * (TAU * 3.0 * z / 1.5).sin();
        let wave = b * (TAU * 3.0 * x / 3.0).cos();
        [shape * (u_mean + streak), 0.0, shape * wave]
    }
}

#[test]
fn moments_and_spectra_of_waves_are_exact() {
    let mut fluid = channel(0.0);
    fluid.set_velocity(streaks(5.0, 0.4, 0.3)).expect("field");
    let mut statistics = Statistics::new(&fluid, about(CHANNEL, &[0, 2])).expect("statistics");
    statistics.sample(&fluid, 0.7);
    let report = statistics.report(&fluid).expect("a sample");
    assert_eq!((report.positions.len(), report.extent), (9, 1.0));
    for (bin, &y) in report.positions.iter().enumerate() {
        let shape = y * (2.0 - y);
        let value = |name: &str| column(&report, name).0[bin];
        close(value("u"), 5.0 * shape, 1e-12, "U");
        close(value("uu"), 0.08 * shape * shape, 1e-12, "uu");
        close(value("ww"), 0.045 * shape * shape, 1e-12, "ww");
        close(value("vv") + value("uv").abs(), 0.0, 1e-12, "vv");
        let flatness = if bin == 0 { 0.0 } else { 1.5 };
        close(value("flatness_u"), flatness, 1e-8, "flatness");
        close(value("skewness_w"), 0.0, 1e-8, "skewness");
    }
    for spectrum in &report.spectra {
        let waves = spectrum.wavenumbers.len();
        let step = spectrum.wavenumbers[1];
        // Streaks are wave 3 along z and everything along x; the waves of w the other way round.
        let (component, wave, square) = if spectrum.axis == 2 {
            (0, 3, 0.08)
        } else {
            (2, 3, 0.045)
        };
        for (bin, &y) in report.positions.iter().enumerate() {
            let shape = y * (2.0 - y);
            for k in 0..waves {
                let found = step * spectrum.spectra[component][bin * waves + k];
                let wanted = if k == wave {
                    square * shape * shape
                } else {
                    0.0
                };
                close(found, wanted, 1e-12, "spectrum");
                let r = spectrum.separations[k];
                let wanted = square * shape * shape * (spectrum.wavenumbers[wave] * r).cos();
                let found = spectrum.correlations[component][bin * waves + k];
                close(found, wanted, 1e-12, "correlation");
            }
        }
    }
}

/// On meshes of Galerkin pairs, second moments are those of the piecewise linear velocity: over all planes they add up to
/// its integrals, here by the exact rule of tetrahedra. Waves that change sign within a plane have no mean.
#[test]
fn second_moments_are_those_of_the_field_between_nodes() {
    let (size, cells) = ([3.0, 2.0, 1.5], [8, 6, 8]);
    let mesh = BoxMesh {
        periodic: [true, false, true],
        ..of(BoxElement::Tetrahedron, size, cells, 0.0)
    };
    let mut fluid = fluid_on(&mesh, settings(1.0, 0.1, 1e-13), |_| {
        BoundaryCondition::WALL
    });
    let short = |[x, y, z]: [f64; 3]| {
        let (k, m) = (TAU * 3.0 / size[0], TAU * 3.0 / size[2]);
        let shape = y * (2.0 - y);
        [shape * (m * z).sin(), 0.0, shape * (k * x + 0.4).cos()]
    };
    fluid.set_velocity(short).expect("field");
    let mut statistics = Statistics::new(&fluid, about(CHANNEL, &[])).expect("statistics");
    statistics.sample(&fluid, 1.0);
    let report = statistics.report(&fluid).expect("a sample");
    let thickness = size[0] * size[2] * size[1] / cells[1] as f64;
    let volumes = [1.0, 2.0, 2.0, 1.0].map(|share| share * thickness);
    let total = |name: &str| -> f64 {
        let values = column(&report, name).0;
        values.iter().zip(volumes).map(|(a, v)| a * v).sum()
    };
    let (local, u) = (fluid.mesh(), fluid.velocity());
    let integral = |c: usize, d: usize| -> f64 {
        let product = |nodes: &[u32]| {
            let sum = |c: usize| nodes.iter().map(|&n| u[n as usize][c]).sum::<f64>();
            let paired: f64 = (nodes.iter())
                .map(|&n| u[n as usize][c] * u[n as usize][d])
                .sum();
            (paired + sum(c) * sum(d)) / 20.0
        };
        let each = size.iter().product::<f64>() / local.elements.len() as f64;
        let elements = 0..local.elements.len();
        elements
            .map(|e| each * product(local.elements.nodes(e)))
            .sum()
    };
    let nodal: f64 = (u.iter().zip(&fluid.geometry().volumes))
        .map(|(u, v)| v * u[0] * u[0])
        .sum();
    assert!(integral(0, 0) < 0.7 * nodal, "the waves are short");
    for (name, c, d) in [("uu", 0, 0), ("ww", 2, 2), ("uw", 0, 2), ("vv", 1, 1)] {
        close(total(name), integral(c, d), 1e-6 * nodal, name);
    }
}

/// Two halves that mirror each other: v of the far half counts with the other sign.
#[test]
fn halves_of_a_channel_are_folded() {
    let mut fluid = channel(0.0);
    let vortex = |[_, y, z]: [f64; 3]| {
        let (wave, angle) = (TAU / 1.5, TAU / 1.5 * z);
        let (f, slope) = ((PI * y).sin().powi(2), PI * (TAU * y).sin());
        let along = y * y * (2.0 - y) * angle.cos();
        [along, f * wave * angle.cos(), -slope * angle.sin()]
    };
    fluid.set_velocity(vortex).expect("field");
    let both = |symmetric: bool| {
        let planes = Averaging::Planes {
            normal: 1,
            flow: 0,
            symmetric,
        };
        let mut statistics = Statistics::new(&fluid, about(planes, &[])).expect("statistics");
        statistics.sample(&fluid, 1.0);
        statistics.report(&fluid).expect("a sample")
    };
    let (folded, straight) = (both(true), both(false));
    assert_eq!((folded.positions.len(), straight.positions.len()), (9, 17));
    for bin in 0..8 {
        for (name, sign) in [("vv", 1.0), ("ww", 1.0), ("uu", 1.0), ("uv", -1.0)] {
            let (f, s) = (column(&folded, name).0, column(&straight, name).0);
            close(f[bin], 0.5 * (s[bin] + sign * s[16 - bin]), 1e-9, name);
        }
    }
    assert!(column(&folded, "uv").0[4].abs() > 0.1);
}

/// Blocks of three flows: mean and error are those of three numbers; time counts, not the number of samples.
#[test]
fn errors_come_from_the_spread_of_blocks_of_time() {
    let mut fluid = channel(0.0);
    let mut statistics = Statistics::new(&fluid, about(CHANNEL, &[])).expect("statistics");
    fluid
        .set_velocity(streaks(3.0, 0.0, 0.0))
        .expect("first flow");
    statistics.sample(&fluid, 0.25);
    statistics.sample(&fluid, 1.0);
    fluid
        .set_velocity(streaks(5.0, 0.0, 0.0))
        .expect("second flow");
    for k in 1..=4 {
        statistics.sample(&fluid, 1.0 + 0.25 * f64::from(k));
    }
    fluid
        .set_velocity(streaks(10.0, 0.0, 0.0))
        .expect("third flow");
    statistics.sample(&fluid, 3.0);
    let report = statistics.report(&fluid).expect("samples");
    assert_eq!((report.samples, report.blocks), (7, (3, 1.0)));
    let (values, errors) = column(&report, "u");
    close(values[8], 6.0, 1e-12, "mean");
    close(errors[8], (13.0f64 / 3.0).sqrt(), 1e-12, "error");
    // Averaged over all flows the profile varies; within each it does not.
    close(column(&report, "uu").0[8], 26.0 / 3.0, 1e-12, "variance");
}

/// More blocks than are kept: neighbours are joined and nothing is lost.
#[test]
fn long_runs_join_their_blocks() {
    let mut fluid = channel(0.0);
    fluid.set_velocity(streaks(1.0, 0.2, 0.1)).expect("flow");
    let mut statistics = Statistics::new(&fluid, about(CHANNEL, &[])).expect("statistics");
    for k in 1..=300 {
        statistics.sample(&fluid, f64::from(k));
    }
    let report = statistics.report(&fluid).expect("samples");
    // The last block is half full, and does not count in errors.
    assert_eq!(report.blocks, (37, 8.0));
    close(report.time, 300.0, 1e-9, "time");
    close(column(&report, "uu").0[8], 0.02, 1e-12, "uu");
}

/// Laminar flow: the total stress is the straight line, wall stress G δ, Reynolds stress zero.
#[test]
fn friction_and_stress_of_laminar_flow_are_exact() {
    let mut fluid = channel(1.5);
    // ν = ¼, G/ρ = ¾: u = 3/2 y(2 − y).
    let exact = |[_, y, _]: [f64; 3]| [1.5 * y * (2.0 - y), 0.0, 0.0];
    fluid.set_velocity(exact).expect("flow");
    let mut statistics = Statistics::new(&fluid, about(CHANNEL, &[])).expect("statistics");
    for _ in 0..3 {
        fluid.advance(1e-2).expect("step");
        statistics.sample(&fluid, fluid.time());
    }
    let report = statistics.report(&fluid).expect("samples");
    let friction = report.friction;
    close(friction.wall_stress, 1.5, 1e-9, "wall stress");
    close(friction.friction_velocity, 0.75f64.sqrt(), 1e-9, "u_tau");
    close(
        friction.reynolds_number,
        0.75f64.sqrt() / 0.25,
        1e-8,
        "Re_tau",
    );
    assert!(friction.stress_residual < 1e-9, "{friction:?}");
    for (total, line) in column(&report, "total_stress")
        .0
        .iter()
        .zip(column(&report, "stress_line").0)
    {
        close(*total, *line, 1e-9, "total stress");
    }
}

/// Flow around an axis: all of it in the third direction, whatever the angle.
#[test]
fn rings_turn_with_the_place() {
    // The start is projected, and the diagonals of prisms lean to one side.
    for (element, tolerance) in [(BoxElement::Hexahedron, 1e-6), (BoxElement::Prism, 1e-2)] {
        let mesh = ring(element, [1.0, 2.0], 0.5, [24, 6, 3]);
        let mut fluid = fluid_in(mesh, settings(1.0, 0.1, 1e-12), |name| {
            if name.starts_with('z') {
                BoundaryCondition::Slip
            } else {
                BoundaryCondition::WALL
            }
        });
        fluid.set_velocity(|_| [0.0; 3]).expect("at rest");
        let rings = Averaging::Rings {
            axis: 2,
            centre: [0.0; 3],
        };
        let mut statistics = Statistics::new(&fluid, about(rings, &[])).expect("statistics");
        // Walls hold the velocity at the sides: take one that vanishes there.
        let swirl = |[x, y, _]: [f64; 3]| {
            let r = x.hypot(y);
            let speed = (r - 1.0) * (2.0 - r);
            [-speed * y / r, speed * x / r, 0.0]
        };
        fluid.set_velocity(swirl).expect("swirl");
        statistics.sample(&fluid, 1.0);
        let report = statistics.report(&fluid).expect("a sample");
        assert_eq!(report.positions.len(), 7, "{:?}", report.positions);
        for (bin, &r) in report.positions.iter().enumerate() {
            let value = |name: &str| column(&report, name).0[bin];
            close(r, 1.0 + bin as f64 / 6.0, 1e-9, "radius");
            close(value("w"), (r - 1.0) * (2.0 - r), tolerance, "w");
            close(value("ww"), 0.0, tolerance * tolerance, "ww");
            close(value("v"), 0.0, tolerance, "v");
        }
    }
}

/// Waves around the axis of a pipe: one number of waves each, in the rings that are circles.
#[test]
fn spectra_around_a_pipe_are_exact() {
    let mesh = PipeMesh {
        radius: 2.0,
        length: 3.0,
        cells: 4,
        core: 6,
        layers: 8,
        ..PipeMesh::default()
    };
    let mesh = mesh.build().expect("pipe");
    let mut fluid = fluid_in(mesh, settings(1.0, 0.1, 1e-12), |_| BoundaryCondition::WALL);
    let rings = Averaging::Rings {
        axis: 0,
        centre: [0.0; 3],
    };
    let mut statistics = Statistics::new(&fluid, about(rings, &[0, AROUND])).expect("statistics");
    // Along the axis and the same along it: solenoidal.
    let shape = |r: f64| r.powi(3) * (4.0 - r * r);
    let waves = |[_, y, z]: [f64; 3]| {
        let (r, angle) = (y.hypot(z), z.atan2(y));
        [1.0 + shape(r) * (3.0 * angle).cos(), 0.0, 0.0]
    };
    fluid.set_velocity(waves).expect("waves");
    statistics.sample(&fluid, 1.0);
    let report = statistics.report(&fluid).expect("a sample");
    let [along, around] = &report.spectra[..] else {
        panic!("two spectra");
    };
    assert_eq!(along.bins.len(), report.positions.len());
    assert!(
        (4..report.positions.len()).contains(&around.bins.len()),
        "{:?}",
        around.bins
    );
    assert_eq!(
        *around.bins.last().expect("bins"),
        report.positions.len() - 1
    );
    let count = around.wavenumbers.len();
    assert_eq!(count, 13);
    for (k, &bin) in around.bins.iter().enumerate() {
        let r = report.positions[bin];
        // Nodes on the wall do not move.
        let square = if bin + 1 < report.positions.len() {
            0.5 * shape(r).powi(2)
        } else {
            0.0
        };
        let of_ring = |values: &[f64]| values[k * count..(k + 1) * count].to_vec();
        for (m, found) in of_ring(&around.spectra[0]).into_iter().enumerate() {
            assert_eq!(around.wavenumbers[m], m as f64);
            close(
                found,
                if m == 3 { square } else { 0.0 },
                1e-6,
                "waves around",
            );
        }
        for (angle, found) in around
            .separations
            .iter()
            .zip(of_ring(&around.correlations[0]))
        {
            close(found, square * (3.0 * angle).cos(), 1e-6, "correlation");
        }
    }
}

/// Nodes that lie on no planes are averaged in layers of many nodes, at the mean of their positions: exact for a linear profile.
#[test]
fn meshes_without_planes_are_averaged_in_layers() {
    let mesh = BoxMesh {
        periodic: [true, false, true],
        ..of(BoxElement::Tetrahedron, [2.0, 1.0, 2.0], [20, 12, 20], 0.2)
    };
    let mut fluid = fluid_on(&mesh, settings(1.0, 0.1, 1e-12), |name| {
        let speed = if name == "y_max" { 3.0 } else { 0.0 };
        BoundaryCondition::MovingWall {
            profile: VelocityProfile::Uniform([speed, 0.0, 0.0]),
        }
    });
    fluid
        .set_velocity(|[_, y, _]| [3.0 * y, 0.0, 0.0])
        .expect("field");
    let across = Averaging::Planes {
        normal: 1,
        flow: 0,
        symmetric: false,
    };
    let mut statistics = Statistics::new(&fluid, about(across, &[])).expect("statistics");
    statistics.sample(&fluid, 1.0);
    let report = statistics.report(&fluid).expect("a sample");
    let bins = report.positions.len();
    // A layer holds a quarter of a wall's nodes or more, and as yet 400 nodes lie about every twelfth of the width.
    assert!((30..=46).contains(&bins), "{bins} layers");
    assert_eq!(
        (report.positions[0], report.positions[bins - 1]),
        (0.0, 1.0)
    );
    for (y, u) in report.positions.iter().zip(column(&report, "u").0) {
        close(*u, 3.0 * y, 1e-9, "profile");
    }
}

#[test]
fn meshes_without_lines_are_refused() {
    let mesh = BoxMesh {
        periodic: [true, false, true],
        ..of(BoxElement::Tetrahedron, [1.0; 3], [6, 6, 6], 0.2)
    };
    let fluid = fluid_on(&mesh, settings(1.0, 0.1, 1e-10), |_| {
        BoundaryCondition::WALL
    });
    let refused = Statistics::new(&fluid, about(CHANNEL, &[0])).expect_err("jittered");
    assert!(refused.to_string().contains("spectra along x"), "{refused}");
    let refused = Statistics::new(&fluid, about(CHANNEL, &[AROUND])).expect_err("planes");
    assert!(refused.to_string().contains("rings"), "{refused}");
    let across = Averaging::Planes {
        normal: 0,
        flow: 1,
        symmetric: true,
    };
    let refused = Statistics::new(&fluid, about(across, &[])).expect_err("periodic");
    assert!(refused.to_string().contains("periodic"), "{refused}");
}

/// Averages go on from a stored state as if nothing had happened.
#[test]
fn stored_averages_go_on() {
    let mut fluid = channel(0.0);
    let mut straight = Statistics::new(&fluid, about(CHANNEL, &[2])).expect("statistics");
    let mut resumed = Statistics::new(&fluid, about(CHANNEL, &[2])).expect("statistics");
    let mut state = None;
    for k in 1..=8 {
        let a = 0.1 * f64::from(k);
        fluid.set_velocity(streaks(2.0, a, 0.2)).expect("flow");
        straight.sample(&fluid, 0.4 * f64::from(k));
        match k {
            5 => state = Some(straight.state(&fluid)),
            6.. => {
                if let Some(state) = state.take() {
                    assert!(resumed.restore(&fluid, &state).expect("fits"));
                }
                resumed.sample(&fluid, 0.4 * f64::from(k));
            }
            _ => {}
        }
    }
    assert_eq!(straight.report(&fluid), resumed.report(&fluid));
    let mut other = Statistics::new(&fluid, about(CHANNEL, &[0])).expect("statistics");
    let refused = other.restore(&fluid, &straight.state(&fluid));
    assert!(
        refused
            .expect_err("other lines")
            .to_string()
            .contains("spectra_x")
    );
}
