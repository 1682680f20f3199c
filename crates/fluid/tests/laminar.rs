//! F3: laminar flows with exact solutions, on hexahedra and tetrahedra.
//!
//! Poiseuille flow on extremely stretched hexahedra, a pulsating pressure gradient (Womersley 1955, between plates), an
//! oscillating wall (Stokes' second problem). Couette start-up is in `walls`, Poiseuille on tetrahedra in `poiseuille`.

mod common;

use common::{errors, fluid_on, of, order, settings};
use fibreflow_fluid::{BoundaryCondition, Fluid, Forcing, Signal, VelocityProfile, initial};
use fibreflow_mesh::{BoxElement, BoxMesh, Stretching};
use std::f64::consts::TAU;
use std::sync::Arc;

const ELEMENTS: [BoxElement; 2] = [BoxElement::Hexahedron, BoxElement::Tetrahedron];
const NU: f64 = 0.05;
/// Frequency 1, so that ω = 2π; the Stokes layer √(2ν/ω) is 0.126 thick.
const OMEGA: f64 = TAU;

/// cosh((1 + i)a) as (real, imaginary).
fn cosh(a: f64) -> [f64; 2] {
    [a.cosh() * a.cos(), a.sinh() * a.sin()]
}

/// sinh((1 + i)a) as (real, imaginary).
fn sinh(a: f64) -> [f64; 2] {
    [a.sinh() * a.cos(), a.cosh() * a.sin()]
}

fn divided([a, b]: [f64; 2], [c, d]: [f64; 2]) -> [f64; 2] {
    let size = c * c + d * d;
    [(a * c + b * d) / size, (b * c - a * d) / size]
}

fn kappa() -> f64 {
    (0.5 * OMEGA / NU).sqrt()
}

/// Between plates at y = 0 and 1 under the driving force cos ωt: u = Re[e^{iωt} (1 − cosh λ(y − ½)/cosh ½λ)/(iω)],
/// λ = (1 + i)κ, κ² = ω/2ν.
fn pulsating(time: f64, y: f64) -> f64 {
    let [a, b] = divided(cosh(kappa() * (y - 0.5)), cosh(0.5 * kappa()));
    let phase = OMEGA * time;
    ((1.0 - a) * phase.sin() - b * phase.cos()) / OMEGA
}

/// Wall y = 0 moving with cos ωt, wall y = 1 at rest: u = Re[e^{iωt} sinh λ(1 − y)/sinh λ].
fn oscillating(time: f64, y: f64) -> f64 {
    let [a, b] = divided(sinh(kappa() * (1.0 - y)), sinh(kappa()));
    let phase = OMEGA * time;
    a * phase.cos() - b * phase.sin()
}

/// A slice of the gap between y = 0 and 1, periodic along x and z.
fn gap(element: BoxElement, cells: usize, lower: BoundaryCondition) -> Fluid {
    let h = 1.0 / cells as f64;
    let jitter = if element == BoxElement::Hexahedron {
        0.0
    } else {
        0.1
    };
    let mesh = BoxMesh {
        periodic: [true, false, true],
        ..of(element, [2.0 * h, 1.0, 2.0 * h], [2, cells, 2], jitter)
    };
    fluid_on(&mesh, settings(1.0, NU, 1e-10), |name| match name {
        "y_min" => lower.clone(),
        _ => BoundaryCondition::WALL,
    })
}

/// Root mean square error at `end` over meshes, with steps in proportion to the spacing.
fn fitted(
    name: &str,
    end: f64,
    exact: impl Fn(f64, f64) -> f64 + Copy,
    make: impl Fn(usize) -> Fluid,
    force: impl Fn(f64) -> f64,
) -> (f64, [f64; 3]) {
    let sizes = [16.0, 32.0, 64.0];
    let found = sizes.map(|n| {
        let mut fluid = make(n as usize);
        let profile = |time: f64| move |x: [f64; 3]| [exact(time, x[1]), 0.0, 0.0];
        fluid.set_velocity(profile(0.0)).expect("start");
        let steps = (end * 4.0 * n).ceil();
        let dt = end / steps;
        for step in 0..steps as usize {
            // Constant over the step, of its middle: second order.
            let force = force((step as f64 + 0.5) * dt);
            fluid.body_force_mut().fill([force, 0.0, 0.0, 0.0]);
            fluid.advance(dt).expect("step");
        }
        errors(&fluid, profile(end))[0]
    });
    let order = order(&sizes, &found);
    println!("{name}: {found:?}, order {order:.2}");
    (order, found)
}

#[test]
fn pulsating_channel_flow_is_second_order() {
    for element in ELEMENTS {
        let make = |n| gap(element, n, BoundaryCondition::WALL);
        let name = format!("Womersley, {element:?}");
        let (order, found) = fitted(&name, 0.7, pulsating, make, |t| (OMEGA * t).cos());
        assert!(
            order >= 1.9 && found[2] < 1e-3 / OMEGA,
            "{found:?}: {order}"
        );
    }
}

#[test]
fn flow_over_an_oscillating_wall_is_second_order() {
    for element in ELEMENTS {
        let wall = || BoundaryCondition::MovingWall {
            profile: VelocityProfile::Uniform([1.0, 0.0, 0.0])
                .scaled(Signal::Function(Arc::new(|t| (OMEGA * t).cos()))),
        };
        let make = |n| gap(element, n, wall());
        let name = format!("Stokes 2, {element:?}");
        let (order, found) = fitted(&name, 0.7, oscillating, make, |_| 0.0);
        assert!(order >= 1.9 && found[2] < 2e-3, "{found:?}: {order}");
    }
}

/// Half a channel, wall to plane of symmetry, spacings from 1 to 1020 by factors of 1.2. The discrete solution is the
/// parabola itself: two-point differences are exact half way between nodes, where the faces of dual volumes are.
#[test]
fn poiseuille_flow_on_spacings_of_one_to_a_thousand_is_the_discrete_solution() {
    let cells = 39;
    let mesh = BoxMesh {
        periodic: [true, false, true],
        stretching: [
            Stretching::Uniform,
            Stretching::Geometric(1.2),
            Stretching::Uniform,
        ],
        ..of(BoxElement::Hexahedron, [1.0, 1.0, 0.5], [3, cells, 2], 0.0)
    };
    let mut settings = settings(1.0, 0.5, 1e-11);
    settings.forcing = Forcing::PressureGradient([1.5, 0.0, 0.0]);
    let mut fluid = fluid_on(&mesh, settings, |name| match name {
        "y_min" => BoundaryCondition::WALL,
        _ => BoundaryCondition::Slip,
    });
    let mut y: Vec<f64> = fluid.mesh().nodes.iter().map(|x| x[1]).collect();
    y.sort_by(f64::total_cmp);
    y.dedup();
    let spacings: Vec<f64> = y.windows(2).map(|w| w[1] - w[0]).collect();
    assert!(spacings[cells - 1] / spacings[0] > 1000.0);
    let slower = initial::poiseuille([0.9, 0.0, 0.0], 1, 0.0, 2.0);
    fluid.set_velocity(slower).expect("start");
    common::run_to(&mut fluid, 30.0, 0.1);
    // Crank–Nicolson damps waves of ν Δt/h² far above 1 slowly: shorter and shorter steps take them one after another.
    for shorter in 1..=14 {
        let dt = 0.1 * 0.4f64.powi(shorter);
        common::run_to(&mut fluid, 20.0 * dt, dt);
    }
    let [_, error] = errors(&fluid, initial::poiseuille([1.0, 0.0, 0.0], 1, 0.0, 2.0));
    println!("largest error {error:.1e} of the largest velocity 1.5");
    assert!(error < 1e-8, "{error:e}");
}
