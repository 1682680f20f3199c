//! Plane Poiseuille flow: exact on stretched hexahedra, second order on tetrahedra, forces in balance.

mod common;

use common::{errors, fluid_on, of, order, settings};
use fibreflow_fluid::{BoundaryCondition, Fluid, Forcing, Signal, VelocityProfile, initial};
use fibreflow_mesh::{BoxElement, BoxMesh, Stretching};

/// Half height 1, μ = 0.5, ρ = 2, mean velocity 1: −dp/dx = 3 μ ū/h² = 1.5.
const DENSITY: f64 = 2.0;
const VISCOSITY: f64 = 0.5;
const GRADIENT: f64 = 1.5;

fn channel(mesh: &BoxMesh, forcing: Forcing) -> Fluid {
    let mesh = BoxMesh {
        periodic: [true, false, true],
        ..mesh.clone()
    };
    let mut settings = settings(DENSITY, VISCOSITY, 1e-10);
    settings.forcing = forcing;
    fluid_on(&mesh, settings, |_| BoundaryCondition::WALL)
}

fn stretched() -> BoxMesh {
    BoxMesh {
        stretching: [
            Stretching::Uniform,
            Stretching::Tanh(2.0),
            Stretching::Uniform,
        ],
        ..of(BoxElement::Hexahedron, [2.0, 2.0, 1.0], [4, 20, 3], 0.0)
    }
}

/// The discrete steady solution: two-point fluxes and dual volumes give the parabola at the nodes only where spacings
/// are equal, so it is found by direct elimination of ν(u_{j+1} − u_j)/h_j − … + V g = 0.
fn discrete_profile(y: &[f64]) -> Vec<f64> {
    let n = y.len();
    let (mut c, mut d) = (vec![0.0; n], vec![0.0; n]);
    for j in 1..n - 1 {
        let (a, b) = (1.0 / (y[j] - y[j - 1]), 1.0 / (y[j + 1] - y[j]));
        let source = 0.5 * (y[j + 1] - y[j - 1]) * GRADIENT / VISCOSITY;
        let pivot = a + b - a * c[j - 1];
        c[j] = b / pivot;
        d[j] = (source + a * d[j - 1]) / pivot;
    }
    let mut u = vec![0.0; n];
    for j in (1..n - 1).rev() {
        u[j] = d[j] + c[j] * u[j + 1];
    }
    u
}

fn steady(fluid: &mut Fluid, dt: f64, steps: usize) {
    for _ in 0..steps {
        fluid.advance(dt).expect("step");
    }
}

#[test]
fn steady_flow_on_stretched_hexahedra_is_the_discrete_solution_at_any_step() {
    for (dt, steps) in [(0.2, 250), (0.8, 400)] {
        let gradient = Forcing::PressureGradient([GRADIENT, 0.0, 0.0]);
        let mut fluid = channel(&stretched(), gradient);
        // Crank–Nicolson damps stiff waves slowly at large steps: start without any.
        let start = initial::poiseuille([0.9, 0.0, 0.0], 1, 0.0, 2.0);
        fluid.set_velocity(start).expect("start");
        steady(&mut fluid, dt, steps);
        let nodes = &fluid.mesh().nodes;
        let mut y: Vec<f64> = nodes.iter().map(|x| x[1]).collect();
        y.sort_by(f64::total_cmp);
        y.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        let profile = discrete_profile(&y);
        let at = |x: [f64; 3]| y.partition_point(|v| *v < x[1] - 1e-9);
        let [_, error] = errors(&fluid, |x| [profile[at(x)], 0.0, 0.0]);
        println!("dt {dt}: {error:.2e}");
        assert!(error < 1e-8, "dt {dt}: {error:e}");
    }
}

#[test]
fn bulk_velocity_finds_the_pressure_gradient() {
    let gradient = Forcing::PressureGradient([GRADIENT, 0.0, 0.0]);
    let mut given = channel(&stretched(), gradient);
    steady(&mut given, 0.4, 120);
    let bulk = Forcing::BulkVelocity {
        direction: [3.0, 0.0, 0.0],
        value: given.bulk_velocity()[0],
    };
    let mut found = channel(&stretched(), bulk);
    steady(&mut found, 0.4, 400);
    let [_, error] = errors(&found, |x| {
        let nodes = &given.mesh().nodes;
        let i = nodes.iter().position(|y| *y == x).expect("same mesh");
        let [u, v, w, _] = given.velocity()[i];
        [u, v, w]
    });
    let force = found.driving_force()[0];
    println!("bulk: velocity {error:.2e}, force {:.2e}", force - GRADIENT);
    assert!(error < 1e-8 && (force - GRADIENT).abs() < 1e-8);
}

#[test]
fn second_order_on_tetrahedra() {
    let sizes = [6.0, 12.0, 24.0];
    let found: Vec<f64> = sizes
        .iter()
        .map(|&n| {
            let cells = [3, n as usize, 2];
            let h = 2.0 / n;
            let mesh = of(BoxElement::Tetrahedron, [3.0 * h, 2.0, 2.0 * h], cells, 0.2);
            let mut fluid = channel(&mesh, Forcing::PressureGradient([GRADIENT, 0.0, 0.0]));
            fluid
                .set_velocity(initial::poiseuille([1.0, 0.0, 0.0], 1, 0.0, 2.0))
                .expect("start");
            // Convection is explicit, and the start is within the discretisation error.
            common::run_to(&mut fluid, 8.0, 0.25 * h);
            errors(&fluid, initial::poiseuille([1.0, 0.0, 0.0], 1, 0.0, 2.0))[0]
        })
        .collect();
    let fitted = order(&sizes, &found);
    println!("tetrahedra: {found:?}, order {fitted:.2}");
    assert!(fitted >= 1.9, "{found:?}: {fitted}");
}

#[test]
fn wall_force_balances_the_pressure_gradient() {
    for element in [BoxElement::Hexahedron, BoxElement::Tetrahedron] {
        let mesh = of(element, [1.0, 2.0, 0.75], [4, 10, 3], 0.15);
        let mut fluid = channel(&mesh, Forcing::PressureGradient([GRADIENT, 0.0, 0.0]));
        steady(&mut fluid, 0.1, 1000);
        let wall = |k| fluid.wall_force(k)[0];
        let driving = GRADIENT * 1.5;
        println!("{element:?}: {} {} of {driving}", wall(0), wall(1));
        assert!((wall(0) + wall(1) - driving).abs() < 1e-8 * driving);
    }
}

/// Before the steady state too, what the walls take and what stays in the fluid is what was put in.
#[test]
fn momentum_closes_step_by_step_with_walls() {
    let mesh = of(BoxElement::Tetrahedron, [1.0, 2.0, 0.75], [4, 8, 3], 0.15);
    let mut fluid = channel(&mesh, Forcing::PressureGradient([GRADIENT, 0.0, 0.0]));
    let eddies = initial::random_solenoidal([1.0, 2.0, 0.75], 2, 0.3, 1);
    fluid.set_velocity(eddies).expect("start");
    for _ in 0..5 {
        let (before, dt) = (fluid.momentum(), 0.02);
        fluid.advance(dt).expect("step");
        let after = fluid.momentum();
        let walls = [fluid.wall_force(0), fluid.wall_force(1)];
        for c in 0..3 {
            let driving = if c == 0 { GRADIENT * 1.5 } else { 0.0 };
            let gained = (after[c] - before[c]) / dt;
            let defect = gained - driving + walls[0][c] + walls[1][c];
            assert!(defect.abs() < 1e-8 * GRADIENT, "component {c}: {defect:e}");
        }
    }
}

#[test]
fn channel_with_inlet_and_outlet_reaches_poiseuille_and_conserves_mass() {
    let mesh = BoxMesh {
        periodic: [false, false, true],
        ..of(BoxElement::Hexahedron, [4.0, 2.0, 0.5], [16, 12, 1], 0.0)
    };
    let mut fluid = fluid_on(&mesh, settings(1.0, 0.2, 1e-13), |name| match name {
        "x_min" => BoundaryCondition::Inlet {
            profile: VelocityProfile::parabolic([1.0, 0.0, 0.0], 1, 0.0, 2.0),
        },
        "x_max" => BoundaryCondition::Outlet {
            pressure: Signal::Constant(5.0),
        },
        _ => BoundaryCondition::WALL,
    });
    for _ in 0..400 {
        fluid.advance(0.1).expect("step");
    }
    let profile = initial::poiseuille([1.0, 0.0, 0.0], 1, 0.0, 2.0);
    let [error, largest] = errors(&fluid, profile);
    let patch = |name: &str| {
        let index = fluid.mesh().patches.iter().position(|p| p == name);
        fluid.patch_flux(index.expect("patch"))
    };
    let (inflow, outflow) = (-patch("x_min"), patch("x_max"));
    let pressure = fluid.pressure();
    let nodes = &fluid.mesh().nodes;
    let middle = (0..nodes.len()).filter(|&i| (nodes[i][1] - 1.0).abs() < 1e-9);
    let slope = 3.0 * 0.2;
    let wrong = middle.map(|i| (pressure[i] - 5.0 - slope * (4.0 - nodes[i][0])).abs());
    let wrong = wrong.fold(0.0, f64::max);
    println!(
        "inlet-outlet: {error:.2e} {largest:.2e}, flux {inflow} {outflow:e} {:.1e}, pressure {wrong:.2e}",
        outflow - inflow
    );
    assert!(largest < 1e-4 && wrong < 1e-4);
    assert!((outflow - inflow).abs() < 1e-12 * inflow);
    assert!(fluid.divergence_max() < 1e-11);
}
