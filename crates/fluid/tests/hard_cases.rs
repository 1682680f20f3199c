//! C10, the part of the fluid, in short: flows that are hard on a solver stay bounded. `cases/hard-fluid` runs 10,000 steps.

mod common;

use common::{fluid_on, of, settings};
use fibreflow_fluid::{BoundaryCondition, Fluid, Signal, VelocityProfile, initial};
use fibreflow_mesh::{BoxElement, BoxMesh, Stretching};
use std::f64::consts::PI;
use std::sync::Arc;

const STEPS: usize = 100;

/// Largest kinetic energy on the way, by the one at the start; largest divergence by the rate at which volumes are filled.
fn march(name: &str, fluid: &mut Fluid, cfl: f64) -> [f64; 2] {
    let start = fluid.kinetic_energy();
    let (mut highest, mut divergence) = (0.0f64, 0.0f64);
    for _ in 0..STEPS {
        let dt = fluid.suggest_dt(cfl, 0.1);
        fluid.advance(dt).expect("step");
        highest = highest.max(fluid.kinetic_energy());
        divergence = divergence.max(fluid.divergence_max() / fluid.courant_number(1.0));
    }
    let fastest = fluid
        .velocity()
        .iter()
        .map(|u| u[0].hypot(u[1]).hypot(u[2]));
    println!(
        "{name}: energy {start:.3e} -> {:.3e}, at most {highest:.3e}; divergence {divergence:.1e}, fastest {:.2}",
        fluid.kinetic_energy(),
        fastest.fold(0.0, f64::max)
    );
    [highest / start, divergence]
}

fn channel(mesh: &BoxMesh, viscosity: f64) -> Fluid {
    let mesh = BoxMesh {
        periodic: [true, false, true],
        ..mesh.clone()
    };
    let mut fluid = fluid_on(&mesh, settings(1.0, viscosity, 1e-8), |_| {
        BoundaryCondition::WALL
    });
    let [_, height, _] = mesh.size;
    let eddies = initial::random_solenoidal(mesh.size, 2, 0.3, 7);
    let mean = initial::poiseuille([1.0, 0.0, 0.0], 1, 0.0, height);
    let start = move |x: [f64; 3]| {
        let (a, b) = (eddies(x), mean(x));
        let inside = (PI * x[1] / height).sin();
        std::array::from_fn(|c| inside * a[c] + b[c])
    };
    fluid.set_velocity(start).expect("start");
    fluid
}

/// Nothing drives these channels: energy may only fall.
#[test]
fn slivers_extreme_spacings_and_large_steps_keep_the_energy_bounded() {
    let slivers = of(BoxElement::Tetrahedron, [1.0, 0.1, 1.0], [4, 40, 4], 0.2);
    let stretched = BoxMesh {
        stretching: [
            Stretching::Uniform,
            Stretching::Tanh(4.15),
            Stretching::Uniform,
        ],
        ..of(BoxElement::Hexahedron, [1.0, 2.0, 1.0], [4, 96, 4], 0.0)
    };
    let channels = of(BoxElement::Hexahedron, [2.0, 1.0, 1.0], [12, 12, 8], 0.0);
    for (name, mesh, viscosity, cfl) in [
        ("slivers", &slivers, 1e-4, 1.0),
        ("spacing 1000", &stretched, 3e-4, 1.0),
        ("Courant number 1", &channels, 1e-4, 1.0),
        ("Courant number 1.5", &channels, 1e-4, 1.5),
    ] {
        let [energy, divergence] = march(name, &mut channel(mesh, viscosity), cfl);
        assert!(energy <= 1.0 + 1e-3, "{name}: {energy}");
        assert!(divergence < 1e-5, "{name}: {divergence:e}");
    }
}

/// At rest until the first step; then the inlet, or the lid, is at full speed.
#[test]
fn impulsive_starts_stay_bounded() {
    let duct = BoxMesh {
        periodic: [false, false, true],
        ..of(BoxElement::Tetrahedron, [4.0, 1.0, 0.25], [16, 8, 1], 0.2)
    };
    let mut fluid = fluid_on(&duct, settings(1.0, 1e-3, 1e-8), |name| match name {
        "x_min" => BoundaryCondition::Inlet {
            profile: VelocityProfile::Uniform([1.0, 0.0, 0.0]),
        },
        "x_max" => BoundaryCondition::Outlet {
            pressure: 0.0.into(),
        },
        _ => BoundaryCondition::WALL,
    });
    let [energy, divergence] = march("inlet", &mut fluid, 1.0);
    assert!(energy < 2.0 && divergence < 1e-5);
    let cavity = BoxMesh {
        periodic: [false, false, true],
        ..of(BoxElement::Prism, [1.0, 1.0, 0.1], [20, 20, 1], 0.0)
    };
    let mut fluid = fluid_on(&cavity, settings(1.0, 1e-4, 1e-8), |name| {
        let speed = if name == "y_max" { 1.0 } else { 0.0 };
        BoundaryCondition::Wall {
            velocity: [speed, 0.0, 0.0],
        }
    });
    let [_, divergence] = march("lid", &mut fluid, 1.0);
    // No part of the fluid is faster than the lid: its mean square cannot be near that.
    assert!(fluid.kinetic_energy() < 0.5 * 0.1 * 0.5 && divergence < 1e-5);
}

/// Both ends open, the pressure at one of them oscillating: all flow comes back in every period.
#[test]
fn flow_that_turns_round_at_outlets_stays_bounded() {
    for element in [BoxElement::Hexahedron, BoxElement::Tetrahedron] {
        let duct = BoxMesh {
            periodic: [false, false, true],
            ..of(element, [4.0, 1.0, 0.25], [16, 8, 1], 0.0)
        };
        let mut fluid = fluid_on(&duct, settings(1.0, 1e-3, 1e-8), |name| match name {
            "x_min" => BoundaryCondition::Outlet {
                pressure: Signal::Function(Arc::new(|t| 4.0 * (PI * t).sin())),
            },
            "x_max" => BoundaryCondition::Outlet {
                pressure: 0.0.into(),
            },
            _ => BoundaryCondition::WALL,
        });
        let mut fastest = 0.0f64;
        let mut lowest = 0.0f64;
        for _ in 0..STEPS {
            fluid.advance(0.05).expect("step");
            let bulk = fluid.bulk_velocity()[0];
            (fastest, lowest) = (fastest.max(bulk), lowest.min(bulk));
        }
        println!("{element:?}: bulk velocity from {lowest:.3} to {fastest:.3}");
        // ∂p/∂x = sin πt alone gives 2/π from rest and back to zero.
        assert!(fastest < 2.0 / PI && lowest > -2.0 / PI);
        assert!(fastest - lowest > 0.2);
    }
}
