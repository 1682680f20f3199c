//! Implicit diffusion: along the stiff direction only, by direct solves of the whole, by conjugate gradients.

mod common;

use common::{of, periodic, settings};
use fibreflow_fluid::{
    BoundaryCondition, Diffusion, DiffusionChoice, Fluid, FluidSettings, Forcing, Projections,
    Signal, VelocityProfile, initial,
};
use fibreflow_mesh::{BoxElement, BoxMesh, LocalMesh, Stretching, geometry};
use std::sync::Arc;

const SIZE: [f64; 3] = [1.0, 1.0, 1.0];

/// A channel with thin cells at its walls; without its lines the solver has only conjugate gradients.
fn channel(
    order: u8,
    diffusion: Diffusion,
    lines: bool,
    wall: BoundaryCondition,
    projections: Projections,
) -> Fluid {
    let mesh = BoxMesh {
        periodic: [true, false, true],
        stretching: [
            Stretching::Uniform,
            Stretching::Tanh(2.5),
            Stretching::Uniform,
        ],
        ..of(BoxElement::Hexahedron, SIZE, [8, 24, 8], 0.0)
    };
    let mesh = Arc::new(LocalMesh::single(mesh.build().expect("box")));
    let dual = match order {
        4 => geometry::fourth(&mesh),
        _ => geometry::dual(&mesh),
    };
    let mut dual = dual.expect("dual geometry");
    if !lines {
        dual.tensor = None;
    }
    let settings = FluidSettings {
        diffusion,
        boundary: vec![wall; 2],
        forcing: Forcing::PressureGradient([1.0, 0.0, 0.5]),
        projections,
        ..settings(1.0, 0.02, 1e-13)
    };
    let mut fluid = Fluid::new(mesh, Arc::new(dual), settings).expect("fluid");
    let start = initial::PerturbedChannel {
        origin: [0.0; 3],
        size: SIZE,
        stream: 0,
        across: 1,
        mean: 1.0,
        profile: initial::MeanProfile::Laminar,
        intensity: 0.2,
        seed: 3,
    };
    fluid.set_velocity(start.field()).expect("start");
    fluid
}

fn run(mut fluid: Fluid, steps: usize) -> (Fluid, DiffusionChoice) {
    let mut choice = DiffusionChoice::default();
    for _ in 0..steps {
        let report = fluid.advance(0.2 / steps as f64).expect("step");
        choice = report.diffusion;
    }
    (fluid, choice)
}

fn difference(a: &Fluid, b: &Fluid) -> f64 {
    let pairs = a.velocity().iter().zip(b.velocity());
    let differences = pairs.flat_map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).abs()));
    differences.fold(0.0, f64::max)
}

/// A wall that is at rest, or one that swings in its plane.
fn walls() -> [BoundaryCondition; 2] {
    [BoundaryCondition::WALL, swinging()]
}

fn swinging() -> BoundaryCondition {
    let velocity = Signal::Function(Arc::new(|t| (9.0 * t).sin()));
    BoundaryCondition::MovingWall {
        profile: VelocityProfile::Uniform([0.5, 0.0, 0.2]).scaled(velocity),
    }
}

#[test]
fn direct_solves_are_those_of_conjugate_gradients() {
    for order in [2, 4] {
        for wall in walls() {
            let (direct, choice) = run(
                channel(
                    order,
                    Diffusion::Implicit,
                    true,
                    wall.clone(),
                    Projections::EverySubStep,
                ),
                5,
            );
            assert!(choice.implicit && choice.direct && choice.along.is_none());
            let (iterative, choice) = run(
                channel(
                    order,
                    Diffusion::Implicit,
                    false,
                    wall,
                    Projections::EverySubStep,
                ),
                5,
            );
            assert!(choice.implicit && !choice.direct);
            let rest = difference(&direct, &iterative);
            println!("order {order}: {rest:.1e}");
            assert!(rest < 1e-10, "{rest:e}");
        }
    }
}

/// Thin cells do not limit the step, and the other directions stay explicit.
#[test]
fn lines_are_taken_where_one_direction_is_stiff() {
    for order in [2, 4] {
        let steps = [10, 20, 40];
        let found = steps.map(|steps| {
            let (lines, choice) = run(
                channel(
                    order,
                    Diffusion::Auto,
                    true,
                    BoundaryCondition::WALL,
                    Projections::EverySubStep,
                ),
                steps,
            );
            assert!(choice.along == Some(1) && choice.direct, "{choice}");
            assert!(
                choice.viscous_number > 5.0 && choice.explicit_number < 1.0,
                "{choice}"
            );
            let (whole, _) = run(
                channel(
                    order,
                    Diffusion::Implicit,
                    true,
                    BoundaryCondition::WALL,
                    Projections::EverySubStep,
                ),
                steps,
            );
            difference(&lines, &whole)
        });
        println!("order {order}: lines against the whole {found:?}");
        // Both are of second order in time.
        assert!(
            found[1] < found[0] / 3.0 && found[2] < found[1] / 3.0,
            "{found:?}"
        );
    }
}

#[test]
fn momentum_closes_step_by_step() {
    for projections in [Projections::Once, Projections::EverySubStep] {
        for diffusion in [Diffusion::Auto, Diffusion::Implicit] {
            for wall in walls() {
                let mut fluid = channel(2, diffusion, true, wall, projections);
                for _ in 0..4 {
                    check_momentum(&mut fluid);
                }
            }
        }
    }
}

fn check_momentum(fluid: &mut Fluid) {
    let (before, dt) = (fluid.momentum(), 0.02);
    let report = fluid.advance(dt).expect("step");
    let after = fluid.momentum();
    let forces = [fluid.wall_force(0), fluid.wall_force(1)];
    for c in 0..3 {
        let gained = (after[c] - before[c]) / dt;
        let defect = gained - [1.0, 0.0, 0.5][c] + forces[0][c] + forces[1][c];
        assert!(
            defect.abs() < 1e-11,
            "{}, component {c}: {defect:e}",
            report.diffusion
        );
    }
}

/// Waves of four nodes in one, two and three directions on elements of the general form, by the rate of the exact wave:
/// (1 + A + A²) K/k², A = 1 − M, with M and K of the elements and k = π/2.
#[test]
fn short_waves_decay_at_the_rate_of_corrected_mass() {
    // On a line M is ⅔ and K is 2; across the diagonals of the triangles M is ⅓.
    let corrected = |mass: f64, stiffness: f64, directions: usize| {
        let error = 1.0 - mass;
        let square = 0.25 * std::f64::consts::PI.powi(2) * directions as f64;
        (1.0 + error + error * error) * stiffness / square
    };
    let line = 2.0 / 3.0;
    let kinds = [
        (
            BoxElement::Hexahedron,
            vec![
                (1, corrected(line, 2.0, 1)),
                (2, corrected(line * line, 4.0 * line, 2)),
                (3, corrected(line.powi(3), 6.0 * line * line, 3)),
            ],
        ),
        (
            BoxElement::Prism,
            vec![
                (1, corrected(line, 2.0, 1)),
                (3, corrected(line / 3.0, 4.0 * line + 2.0 / 3.0, 3)),
            ],
        ),
    ];
    for (element, waves) in kinds {
        let mesh = of(element, [8.0; 3], [8; 3], 1e-7);
        for (directions, wanted) in waves {
            let mut fluid = periodic(&mesh, 1.0, 1e-10);
            let number = 0.5 * std::f64::consts::PI;
            // Across the wave, so that neither convection nor pressure has a part in it.
            let across = match directions {
                3 => [1e-3, -1e-3, 0.0],
                _ => [0.0, 0.0, 1e-3],
            };
            let wave = |x: [f64; 3]| {
                let phase: f64 = x[..directions].iter().map(|x| number * x).sum();
                across.map(|a| a * (phase + 0.3).sin())
            };
            fluid.set_velocity(wave).expect("start");
            let before = fluid.kinetic_energy();
            let (dt, steps) = (2e-3, 20);
            for _ in 0..steps {
                fluid.advance(dt).expect("step");
            }
            let decay = (before / fluid.kinetic_energy()).ln() / (2.0 * dt * f64::from(steps));
            let rate = decay / (directions as f64 * number * number);
            println!("{element:?}, {directions} directions: {rate:.4}, wanted {wanted:.4}");
            assert!((rate - wanted).abs() < 1e-3, "{element:?}: {rate}");
        }
    }
}
