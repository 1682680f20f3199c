//! Boundary values that change in time: second order in time, restart-safe.

mod common;

use common::{errors, fluid_on, of, order, settings};
use fibreflow_fluid::{BoundaryCondition, Fluid, Signal, TimeTable, VelocityProfile};
use fibreflow_mesh::{BoxElement, BoxMesh};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Order in time of a flow at time 1 by its difference from a run with small steps; halo-free velocities.
fn order_in_time(name: &str, steps: &[f64], finest: f64, make: impl Fn() -> Fluid) -> f64 {
    let run = |steps: f64| {
        let mut fluid = make();
        common::run_to(&mut fluid, 1.0, 1.0 / steps);
        fluid.velocity().to_vec()
    };
    let reference = run(finest);
    let difference = |&steps: &f64| {
        let velocity = run(steps);
        let pairs = velocity.iter().zip(&reference);
        let square = pairs.map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>());
        square.sum::<f64>().sqrt()
    };
    let found: Vec<f64> = steps.iter().map(difference).collect();
    let fitted = order(steps, &found);
    println!("{name}: {found:?}, order {fitted:.2}");
    fitted
}

const NU: f64 = 0.05;

/// Wall at y = 0 with velocity cos(2πt), wall at rest at y = 1 (Stokes' second problem in a gap):
/// u = Re[exp(iωt) sinh((1 + i)κ(1 − y))/sinh((1 + i)κ)], κ² = ω/2ν.
fn oscillating(time: f64, y: f64) -> f64 {
    let kappa = (0.5 * TAU / NU).sqrt();
    let sinh = |a: f64| [a.sinh() * a.cos(), a.cosh() * a.sin()];
    let ([a, b], [c, d]) = (sinh(kappa * (1.0 - y)), sinh(kappa));
    let size = c * c + d * d;
    let (real, imaginary) = ((a * c + b * d) / size, (b * c - a * d) / size);
    real * (TAU * time).cos() - imaginary * (TAU * time).sin()
}

fn oscillating_wall(cells: usize) -> Fluid {
    let h = 1.0 / cells as f64;
    let mesh = BoxMesh {
        periodic: [true, false, true],
        ..of(
            BoxElement::Hexahedron,
            [2.0 * h, 1.0, 2.0 * h],
            [2, cells, 2],
            0.0,
        )
    };
    let mut fluid = fluid_on(&mesh, settings(1.0, NU, 1e-11), |name| match name {
        "y_min" => BoundaryCondition::MovingWall {
            profile: VelocityProfile::Uniform([1.0, 0.0, 0.0])
                .scaled(Signal::Function(Arc::new(|t| (TAU * t).cos()))),
        },
        _ => BoundaryCondition::WALL,
    });
    let start = |x: [f64; 3]| [oscillating(0.0, x[1]), 0.0, 0.0];
    fluid.set_velocity(start).expect("start");
    fluid
}

#[test]
fn an_oscillating_wall_is_second_order_in_time_and_space() {
    let fitted = order_in_time("Stokes 2, time", &[16.0, 32.0, 64.0], 512.0, || {
        oscillating_wall(24)
    });
    assert!(fitted >= 1.9, "{fitted}");
    let sizes = [12.0, 24.0, 48.0];
    let found = sizes.map(|n| {
        let mut fluid = oscillating_wall(n as usize);
        common::run_to(&mut fluid, 1.2, 0.1 / n);
        errors(&fluid, |x| [oscillating(1.2, x[1]), 0.0, 0.0])[0]
    });
    let fitted = order(&sizes, &found);
    println!("Stokes 2, space: {found:?}, order {fitted:.2}");
    assert!(fitted >= 1.9 && found[2] < 1e-3, "{found:?}");
}

/// Force on the oscillating wall: what the discrete balance of momentum says, step by step.
#[test]
fn momentum_closes_with_a_moving_wall() {
    let mut fluid = oscillating_wall(12);
    for _ in 0..7 {
        let (before, dt) = (fluid.momentum()[0], 0.05);
        fluid.advance(dt).expect("step");
        let gained = (fluid.momentum()[0] - before) / dt;
        let walls = fluid.wall_force(0)[0] + fluid.wall_force(1)[0];
        let size = fluid.wall_force(0)[0].abs() + fluid.wall_force(1)[0].abs();
        assert!(
            (gained + walls).abs() < 1e-9 * size,
            "gained {gained}, walls {walls}"
        );
    }
}

fn channel(inlet: VelocityProfile, outlet: Signal, mesh: &BoxMesh) -> Fluid {
    let mesh = BoxMesh {
        periodic: [false, false, true],
        ..mesh.clone()
    };
    fluid_on(&mesh, settings(1.0, NU, 1e-11), |name| match name {
        "x_min" => BoundaryCondition::Inlet {
            profile: inlet.clone(),
        },
        "x_max" => BoundaryCondition::Outlet {
            pressure: outlet.clone(),
        },
        _ => BoundaryCondition::WALL,
    })
}

#[test]
fn a_pulsating_inlet_is_second_order_in_time() {
    for element in [BoxElement::Hexahedron, BoxElement::Tetrahedron] {
        let parabola = VelocityProfile::parabolic([1.0, 0.0, 0.0], 1, 0.0, 1.0);
        let pulse = Signal::Function(Arc::new(|t| 0.5 - 0.5 * (PI * t).cos()));
        let profile = parabola.scaled(pulse);
        // On finer meshes the slow waves of the approximate projection hide the order until steps are small.
        let name = format!("pulsating inlet, {element:?}");
        let fitted = order_in_time(&name, &[64.0, 128.0, 256.0], 1024.0, || {
            channel(
                profile.clone(),
                0.0.into(),
                &of(element, [1.0, 1.0, 0.25], [6, 6, 1], 0.0),
            )
        });
        assert!(fitted >= 1.85, "{fitted}");
    }
}

/// Two open ends, the pressure at one of them oscillating.
#[test]
fn a_pulsating_outlet_pressure_is_second_order_in_time() {
    let make = || {
        let mesh = BoxMesh {
            periodic: [false, false, true],
            ..of(BoxElement::Hexahedron, [2.0, 1.0, 0.25], [12, 10, 2], 0.0)
        };
        fluid_on(&mesh, settings(1.0, NU, 1e-11), |name| match name {
            "x_min" => BoundaryCondition::Outlet {
                pressure: Signal::Function(Arc::new(|t| 1.0 + (PI * t).sin())),
            },
            "x_max" => BoundaryCondition::Outlet {
                pressure: 0.0.into(),
            },
            _ => BoundaryCondition::WALL,
        })
    };
    let fitted = order_in_time("pulsating pressure", &[64.0, 128.0, 256.0], 1024.0, make);
    assert!(fitted >= 1.85, "{fitted}");
}

/// Flow that a table brings in is what leaves, at every step.
#[test]
fn a_table_of_inflow_is_met_at_every_step() {
    let table = TimeTable::new(vec![0.0, 0.3, 0.5], vec![[0.0], [1.0], [0.2]], false);
    let table = Arc::new(table.expect("table"));
    let profile = VelocityProfile::Uniform([1.0, 0.0, 0.0]).scaled(Signal::Table(table.clone()));
    let mut fluid = channel(
        profile,
        0.0.into(),
        &of(BoxElement::Tetrahedron, [2.0, 1.0, 0.25], [12, 10, 2], 0.0),
    );
    let patch = |name: &str| fluid.mesh().patches.iter().position(|p| p == name);
    let (inlet, outlet) = (
        patch("x_min").expect("inlet"),
        patch("x_max").expect("outlet"),
    );
    let mut open = 0.0;
    for step in 1..=20 {
        fluid.advance(0.03).expect("step");
        let (inflow, outflow) = (-fluid.patch_flux(inlet), fluid.patch_flux(outlet));
        let factor = table.at(0.03 * f64::from(step))[0];
        if open == 0.0 {
            open = inflow / factor;
        }
        assert!((inflow - open * factor).abs() < 1e-12, "step {step}");
        assert!((inflow - outflow).abs() < 1e-9 * open, "step {step}");
    }
}

#[test]
fn a_restart_between_boundary_changes_is_bitwise() {
    let make = || {
        let shape = VelocityProfile::parabolic([1.0, 0.0, 0.0], 1, 0.0, 1.0);
        let pulse = Signal::Function(Arc::new(|t| 1.0 + 0.5 * (3.0 * t).sin()));
        let pressure = Signal::Function(Arc::new(|t| (2.0 * t).cos()));
        channel(
            shape.scaled(pulse),
            pressure,
            &of(BoxElement::Prism, [2.0, 1.0, 0.25], [12, 10, 2], 0.0),
        )
    };
    let advance = |fluid: &mut Fluid, steps: usize| {
        for _ in 0..steps {
            let dt = fluid.suggest_dt(0.5, 0.02);
            fluid.advance(dt).expect("step");
        }
    };
    let mut whole = make();
    advance(&mut whole, 7);
    for split in [1, 4] {
        let mut first = make();
        advance(&mut first, split);
        let mut second = make();
        second.restore(first.state()).expect("restore");
        advance(&mut second, 7 - split);
        assert!(second.state() == whole.state(), "split after {split}");
    }
}
