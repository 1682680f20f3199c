//! Kernels along lines and over rows of pairs are the same operators.

mod common;

use common::{fluid_of, settings};
use fibreflow_fluid::{BoundaryCondition, Fluid, FluidSettings, Forcing, Kernels};
use fibreflow_mesh::{BoxMesh, Stretching, renumber};

fn channel(mesh: &BoxMesh, order: u8, kernels: Kernels) -> Fluid {
    let mut mesh = mesh.build().expect("box");
    renumber(&mut mesh).expect("order");
    let settings = FluidSettings {
        kernels,
        forcing: Forcing::BulkVelocity {
            direction: [1.0, 0.0, 0.0],
            value: 1.0,
        },
        ..settings(1.0, 0.01, 1e-13)
    };
    let mut fluid = fluid_of(order, mesh, settings, |_| BoundaryCondition::WALL);
    let start = |[x, y, z]: [f64; 3]| {
        let hat = |s: f64| s * (1.0 - s);
        let wave = (6.3 * x).sin() * (6.3 * z).cos();
        [hat(y) + 0.3 * wave, 0.2 * hat(y) * wave, 0.1 * hat(y)]
    };
    fluid.set_velocity(start).expect("start");
    fluid
}

/// Largest difference of velocities and pressures after four steps.
fn difference(mesh: &BoxMesh, order: u8) -> f64 {
    let mut fluids = [Kernels::Auto, Kernels::Rows].map(|kernels| channel(mesh, order, kernels));
    assert!(fluids[0].runs_on_lines() && !fluids[1].runs_on_lines());
    for fluid in &mut fluids {
        for _ in 0..4 {
            fluid.advance(0.02).expect("step");
        }
    }
    let [lines, rows] = &fluids;
    let velocities = lines.velocity().iter().zip(rows.velocity());
    let velocities = velocities.flat_map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).abs()));
    let pressures = lines.pressure().iter().zip(rows.pressure());
    let pressures = pressures.map(|(a, b)| (a - b).abs());
    let fluxes = lines.flux().into_iter().zip(rows.flux());
    let fluxes = fluxes.map(|(a, b)| (a - b).abs());
    velocities
        .chain(pressures)
        .chain(fluxes)
        .fold(0.0, f64::max)
}

#[test]
fn lines_and_rows_agree_on_every_kind_of_box() {
    let tanh = Stretching::Tanh(1.5);
    let uniform = Stretching::Uniform;
    for (cells, periodic, stretching) in [
        ([12, 8, 10], [true, false, true], [uniform, tanh, uniform]),
        ([8, 9, 1], [true, false, true], [uniform, tanh, uniform]),
        ([2, 9, 8], [true, false, true], [uniform; 3]),
        ([70, 6, 5], [true, false, false], [uniform, tanh, tanh]),
        ([6, 7, 8], [false; 3], [tanh; 3]),
        ([8, 6, 7], [true; 3], [uniform; 3]),
        ([16, 20, 12], [false, false, true], [uniform, tanh, uniform]),
    ] {
        let mesh = BoxMesh {
            cells,
            periodic,
            stretching,
            ..BoxMesh::default()
        };
        for order in [2, 4] {
            let found = difference(&mesh, order);
            println!("{cells:?}, periodic {periodic:?}, order {order}: {found:.1e}");
            assert!(found < 1e-11);
        }
    }
}
