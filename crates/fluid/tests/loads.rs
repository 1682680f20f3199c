//! Forces and torques on patches, and walls that rotate.

mod common;

use common::{errors, fluid_in, fluid_on, of, order, patch, ring, settings};
use fibreflow_fluid::{BoundaryCondition, Fluid, Forcing, PatchLoad, VelocityProfile, initial};
use fibreflow_mesh::{BoxElement, BoxMesh};
use std::f64::consts::PI;

const RADII: [f64; 2] = [1.0, 2.0];
const SPIN: f64 = 1.5;
const VISCOSITY: f64 = 0.5;
const HEIGHT: f64 = 0.3;

/// B of u_θ = A r + B/r, inner cylinder rotating, outer at rest; and the velocity.
fn couette(x: [f64; 3]) -> (f64, [f64; 3]) {
    let [a, b] = RADII.map(|r| r * r);
    let b_over_r = SPIN * a * b / (b - a);
    let r2 = x[0] * x[0] + x[1] * x[1];
    let rate = -SPIN * a / (b - a) + b_over_r / r2;
    (b_over_r, [-rate * x[1], rate * x[0], 0.0])
}

fn between_cylinders(element: BoxElement, n: usize) -> Fluid {
    let mesh = ring(element, RADII, HEIGHT, [6 * n, n, 2]);
    let mut fluid = fluid_in(mesh, settings(2.0, VISCOSITY, 1e-11), |name| match name {
        "inner" => BoundaryCondition::MovingWall {
            profile: VelocityProfile::Rotation {
                point: [0.0; 3],
                angular_velocity: [0.0, 0.0, SPIN],
            },
        },
        "outer" => BoundaryCondition::WALL,
        _ => BoundaryCondition::Slip,
    });
    fluid.set_velocity(|x| couette(x).1).expect("start");
    fluid
}

#[test]
fn taylor_couette_profile_and_torque() {
    for element in [BoxElement::Hexahedron, BoxElement::Prism] {
        let sizes = [6.0, 10.0, 16.0];
        let mut torques = Vec::new();
        let found = sizes.map(|n| {
            let mut fluid = between_cylinders(element, n as usize);
            common::run_to(&mut fluid, 1.5, 0.5 / n);
            let loads = fluid.patch_loads([0.0; 3]);
            let exact = 4.0 * PI * VISCOSITY * couette([1.0, 0.0, 0.0]).0 * HEIGHT;
            let torque = |name: &str| loads[patch(&fluid, name)].viscous_torque[2] / exact;
            println!(
                "{element:?} {n}: torque {} {}",
                torque("inner"),
                torque("outer")
            );
            torques.push(
                (torque("inner") + 1.0)
                    .abs()
                    .max((torque("outer") - 1.0).abs()),
            );
            errors(&fluid, |x| couette(x).1)[0]
        });
        let fitted = [order(&sizes, &found), order(&sizes, &torques)];
        println!("{element:?}: velocity {found:?}, torque {torques:?}, orders {fitted:.2?}");
        assert!(fitted[0] >= 1.9 && found[2] < 2e-3, "{found:?}");
        assert!(fitted[1] >= 1.7 && torques[2] < 5e-3, "{torques:?}");
    }
}

#[test]
fn plane_poiseuille_shear_is_all_viscous() {
    let gradient = 1.5;
    let mesh = BoxMesh {
        periodic: [true, false, false],
        ..of(BoxElement::Hexahedron, [1.0, 2.0, 0.6], [4, 12, 3], 0.0)
    };
    let mut settings = settings(2.0, 0.5, 1e-12);
    settings.forcing = Forcing::PressureGradient([gradient, 0.0, 0.0]);
    let mut fluid = fluid_on(&mesh, settings, |name| match name {
        "z_min" | "z_max" => BoundaryCondition::Slip,
        _ => BoundaryCondition::WALL,
    });
    fluid
        .set_velocity(initial::poiseuille([1.0, 0.0, 0.0], 1, 0.0, 2.0))
        .expect("start");
    for _ in 0..300 {
        fluid.advance(0.1).expect("step");
    }
    // Half of the driving force goes to either wall, and the slip planes bear no shear.
    let (shear, middle) = (0.5 * gradient * 1.2, [0.5, 1.0, 0.3]);
    let loads = fluid.patch_loads(middle);
    for name in ["y_min", "y_max", "z_min", "z_max"] {
        let load = loads[patch(&fluid, name)];
        let (wall, top) = (name.starts_with('y'), name == "y_max");
        let expected = if wall { shear } else { 0.0 };
        assert!(
            (load.viscous[0] - expected).abs() < 1e-7 * shear,
            "{name}: {load:?}"
        );
        assert!(
            load.pressure.iter().all(|p| p.abs() < 1e-7),
            "{name}: {load:?}"
        );
        let torque = if top { -shear } else { shear };
        let torque = if wall { torque } else { 0.0 };
        assert!(
            (load.torque()[2] - torque).abs() < 1e-7 * shear,
            "{name}: {load:?}"
        );
    }
}

/// A fluid at rest under its weight: pressure on the walls of the box carries it, nothing is viscous.
#[test]
fn hydrostatic_pressure_carries_the_weight() {
    // Pressure is linear at the nodes where gradients on the boundary are exact, to discretisation error elsewhere.
    for (element, cells, tolerance) in [
        (BoxElement::Hexahedron, [4, 8, 3], 1e-7),
        (BoxElement::Tetrahedron, [4, 8, 3], 1e-3),
    ] {
        let mesh = of(element, [1.0, 2.0, 0.5], cells, 0.0);
        let mut fluid = fluid_on(&mesh, settings(2.0, 0.5, 1e-12), |_| {
            BoundaryCondition::WALL
        });
        let weight = 2.0 * 9.81;
        fluid.body_force_mut().fill([0.0, -weight, 0.0, 0.0]);
        // Long, as errors of the pressure next to walls may set it in growing motion.
        for _ in 0..100 {
            fluid.advance(0.1).expect("step");
        }
        let loads = fluid.patch_loads([0.5, 1.0, 0.25]);
        let total = loads.iter().fold(PatchLoad::default(), |s, l| s.plus(l));
        println!("{element:?}: {total:?}");
        let force = total.force();
        // What is still moving takes the rest.
        assert!(
            (force[1] + weight).abs() < 0.1 * tolerance * weight,
            "{force:?}"
        );
        assert!(
            force[0].abs() + force[2].abs() < 0.1 * tolerance * weight,
            "{force:?}"
        );
        assert!(total.viscous[1].abs() < tolerance * weight, "{total:?}");
        // Side wall of height 2 and width 0.5: ∫ p (y − 1) dA = −ρg 0.5 ∫ s² ds, s = −1…1.
        let side = loads[patch(&fluid, "x_max")].pressure_torque[2];
        let (arm, couple) = (
            -0.5 * loads[patch(&fluid, "x_max")].pressure[1],
            9.81 * 2.0 / 3.0,
        );
        let wrong = (side - arm - couple).abs() / couple;
        println!("{element:?}: torque of a side wall wrong by {wrong:.1e}");
        assert!(wrong < 0.04, "{side} {couple}");
    }
}
