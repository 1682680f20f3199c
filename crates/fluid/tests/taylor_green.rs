//! F1: two-dimensional Taylor–Green vortices carried by a drift, on every element kind and of fourth order. Sizes 16 to
//! 64; with `FIBREFLOW_FULL` set, 128 too.

mod common;

use common::{errors, fluid_of, of, order, periodic, run_to, settings};
use fibreflow_fluid::{Fluid, FluidSettings, Projections, initial::TaylorGreen};
use fibreflow_mesh::{BoxElement, BoxMesh};
use std::f64::consts::TAU;

const FLOW: TaylorGreen = TaylorGreen {
    amplitude: 1.0,
    wave_number: 1.0,
    drift: [1.0, 1.0],
    kinematic_viscosity: 0.01,
};

fn vortices(element: BoxElement, n: usize, jitter: f64) -> Fluid {
    let h = TAU / n as f64;
    let mesh = of(element, [TAU, TAU, h], [n, n, 1], jitter);
    let mut fluid = periodic(&mesh, FLOW.kinematic_viscosity, 1e-8);
    fluid
        .set_velocity(|x| FLOW.velocity(0.0, x))
        .expect("start");
    fluid
}

/// Errors (L2, L∞) at t = 2; the step is small against the space error.
fn error_at(element: BoxElement, n: usize, jitter: f64) -> [f64; 2] {
    let mut fluid = vortices(element, n, jitter);
    run_to(&mut fluid, 2.0, 0.16 * TAU / n as f64);
    errors(&fluid, |x| FLOW.velocity(2.0, x))
}

fn check_order(element: BoxElement, jitter: f64) {
    let mut sizes = vec![16, 32, 64];
    if std::env::var_os("FIBREFLOW_FULL").is_some() {
        sizes.push(128);
    }
    let found: Vec<[f64; 2]> = sizes
        .iter()
        .map(|&n| error_at(element, n, jitter))
        .collect();
    let sizes: Vec<f64> = sizes.into_iter().map(|n| n as f64).collect();
    let norm = |k: usize| found.iter().map(|e| e[k]).collect::<Vec<_>>();
    let [l2, largest] = [order(&sizes, &norm(0)), order(&sizes, &norm(1))];
    println!("{element:?} jitter {jitter}: {found:?}, order L2 {l2:.2}, Linf {largest:.2}");
    assert!(l2 >= 1.9 && largest >= 1.6, "{found:?}: {l2}, {largest}");
}

#[test]
fn second_order_on_uniform_hexahedra() {
    check_order(BoxElement::Hexahedron, 0.0);
}

#[test]
fn second_order_on_distorted_hexahedra() {
    check_order(BoxElement::Hexahedron, 0.2);
}

#[test]
fn second_order_on_distorted_tetrahedra() {
    check_order(BoxElement::Tetrahedron, 0.2);
}

#[test]
fn second_order_on_prisms() {
    check_order(BoxElement::Prism, 0.2);
}

/// OpenFOAM 1912, pimpleFoam, on 32 × 32 hexahedra: 2.0e-2 of the exact root mean square 0.679. Lumped mass has three
/// times that on jittered tetrahedra.
#[test]
fn corrected_mass_brings_every_element_below_hexahedra() {
    for element in [
        BoxElement::Hexahedron,
        BoxElement::Tetrahedron,
        BoxElement::Prism,
        BoxElement::PyramidHexahedron,
        BoxElement::Mixed,
    ] {
        let [error, _] = error_at(element, 32, 0.2);
        println!("{element:?}: {:.2e} of the exact", error / 0.679);
        assert!(error < 0.75 * 2.0e-2 * 0.679, "{element:?}: {error:e}");
    }
}

/// Of an order in space, periodic hexahedra.
fn hexahedra(of_order: u8, n: usize, projections: Projections) -> Fluid {
    let h = TAU / n as f64;
    let mesh = BoxMesh {
        periodic: [true; 3],
        ..of(BoxElement::Hexahedron, [TAU, TAU, h], [n, n, 1], 0.0)
    };
    let settings = FluidSettings {
        projections,
        ..settings(1.0, FLOW.kinematic_viscosity, 1e-8)
    };
    let mesh = mesh.build().expect("box");
    let mut fluid = fluid_of(of_order, mesh, settings, |_| unreachable!("no patches"));
    let start = fluid.set_velocity(|x| FLOW.velocity(0.0, x));
    start.expect("start");
    fluid
}

/// L2 and L∞ error at t = 2 by the root mean square of the exact velocity (without drift); steps by the spacing.
fn relative_errors(of_order: u8, n: usize, step: f64) -> [f64; 2] {
    let mut fluid = hexahedra(of_order, n, Projections::EverySubStep);
    run_to(&mut fluid, 2.0, step * TAU / n as f64);
    let size = (-2.0 * FLOW.kinematic_viscosity * 2.0).exp() / 2f64.sqrt();
    errors(&fluid, |x| FLOW.velocity(2.0, x)).map(|e| e / size)
}

/// OpenFOAM 1912, pimpleFoam, hexahedra, N = 128, the same drift: relative L2 error 1.2e-3.
#[test]
fn fourth_order_on_uniform_hexahedra() {
    let step = 0.0625;
    let mut sizes = vec![16, 32, 64];
    if std::env::var_os("FIBREFLOW_FULL").is_some() {
        sizes.push(128);
    }
    let found: Vec<[f64; 2]> = sizes.iter().map(|&n| relative_errors(4, n, step)).collect();
    let largest = relative_errors(4, 32, 2.0 * step)[0];
    let second = relative_errors(2, 64, step)[0];
    let sizes: Vec<f64> = sizes.into_iter().map(|n| n as f64).collect();
    let norm = |k: usize| found.iter().map(|e| e[k]).collect::<Vec<_>>();
    let orders = [order(&sizes, &norm(0)), order(&sizes, &norm(1))];
    println!(
        "fourth order: {found:?}, orders {orders:.2?}; second order, 64: {second:.2e}; 32, twice the step: {largest:.3e}"
    );
    assert!(orders[0] >= 3.8 && orders[1] >= 3.8, "{orders:?}");
    assert!(found[1][0] < 1.2e-3 && second > 20.0 * found[2][0]);
    // Third order in time: what is left of the error of this step is an eighth of that of twice the step.
    assert!((largest - found[1][0]).abs() < 0.1 * 7.0 * found[1][0]);
}

#[test]
fn third_order_in_time_with_a_projection_every_sub_step() {
    let velocity = |dt: f64| {
        let mut fluid = hexahedra(4, 24, Projections::EverySubStep);
        run_to(&mut fluid, 1.0, dt);
        fluid
    };
    let finest = velocity(1.0 / 320.0);
    let steps = [10.0, 20.0, 40.0];
    let difference = |steps: &f64| {
        let coarse = velocity(1.0 / steps);
        let pairs = coarse.velocity().iter().zip(finest.velocity());
        pairs.fold(0.0, |m: f64, (a, b)| {
            (0..3).fold(m, |m, c| m.max((a[c] - b[c]).abs()))
        })
    };
    let found: Vec<f64> = steps.iter().map(difference).collect();
    let fitted = order(&steps, &found);
    println!("time, three projections: {found:?}, order {fitted:.2}");
    assert!(fitted >= 2.7, "{found:?}: {fitted}");
}

#[test]
fn second_order_in_time() {
    let velocity = |dt: f64| {
        let mut fluid = hexahedra(2, 24, Projections::Once);
        run_to(&mut fluid, 1.0, dt);
        fluid
    };
    let finest = velocity(1.0 / 320.0);
    let nodes = finest.mesh().nodes.clone();
    let steps = [10.0, 20.0, 40.0];
    let difference = |steps: &f64| {
        let coarse = velocity(1.0 / steps);
        let pairs = coarse.velocity().iter().zip(finest.velocity());
        let square =
            |(a, b): (&[f64; 4], &[f64; 4])| -> f64 { (0..3).map(|c| (a[c] - b[c]).powi(2)).sum() };
        (pairs.map(square).sum::<f64>() / nodes.len() as f64).sqrt()
    };
    let found: Vec<f64> = steps.iter().map(difference).collect();
    let fitted = order(&steps, &found);
    println!("time: {found:?}, order {fitted:.2}");
    assert!(fitted >= 1.9, "{found:?}: {fitted}");
}

/// A mesh that moves with the drift sees the vortices as one at rest sees them without drift.
#[test]
fn a_moving_mesh_takes_the_drift_away() {
    const DRIFT: [f64; 3] = [3.0, -2.0, 1.0];
    let run = |mesh: &BoxMesh, projections: Projections, drift: [f64; 3], frame: [f64; 3]| {
        let settings = FluidSettings {
            projections,
            frame,
            ..settings(1.0, FLOW.kinematic_viscosity, 1e-13)
        };
        let mut fluid = fluid_of(2, mesh.build().expect("box"), settings, |_| {
            unreachable!("no patches")
        });
        let vortices = TaylorGreen {
            drift: [0.0; 2],
            ..FLOW
        };
        let start = fluid.set_velocity(|x| {
            let u = vortices.velocity(0.0, x);
            [0, 1, 2].map(|c| u[c] + drift[c])
        });
        start.expect("start");
        run_to(&mut fluid, 0.5, 0.05);
        fluid
    };
    let still = [0.0; 3];
    for (element, jitter) in [
        (BoxElement::Hexahedron, 0.0),
        (BoxElement::Hexahedron, 0.2),
        (BoxElement::Tetrahedron, 0.2),
        (BoxElement::Prism, 0.2),
        (BoxElement::Mixed, 0.2),
    ] {
        let mesh = BoxMesh {
            periodic: [true; 3],
            ..of(element, [TAU, TAU, TAU / 4.0], [12, 12, 4], jitter)
        };
        for projections in [Projections::Once, Projections::EverySubStep] {
            let moving = run(&mesh, projections, DRIFT, DRIFT);
            let resting = run(&mesh, projections, still, still);
            let rate = moving.courant_number(1.0) / resting.courant_number(1.0);
            let pairs = moving.velocity().iter().zip(resting.velocity());
            let apart = pairs.flat_map(|(u, v)| (0..3).map(|c| (u[c] - v[c] - DRIFT[c]).abs()));
            let apart = apart.fold(0.0, f64::max);
            println!("{element:?} {jitter} {projections:?}: {apart:.1e}, {rate}");
            assert!(apart < 1e-11 && (rate - 1.0).abs() < 1e-11);
        }
    }
}
