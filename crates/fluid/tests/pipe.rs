//! Hagen–Poiseuille flow in O-grid pipes: second order, forces in balance, the same in any section.

mod common;

use common::{errors, fluid_in, settings};
use fibreflow_fluid::{
    BoundaryCondition, Fluid, Forcing,
    initial::{MeanProfile, PerturbedPipe},
};
use fibreflow_mesh::{PipeMesh, Stretching};

/// R = 1, μ = 0.5, ρ = 2, mean velocity 1: −dp/dx = 8 μ ū/R² = 4.
const GRADIENT: f64 = 4.0;

fn steady(core: usize) -> Fluid {
    let mesh = PipeMesh {
        radius: 1.0,
        length: 1.0,
        // With two, a central difference along the pipe is none.
        cells: 3,
        core,
        layers: core,
        stretching: Stretching::Geometric(0.95),
        ..PipeMesh::default()
    };
    let mut settings = settings(2.0, 0.5, 1e-10);
    settings.forcing = Forcing::PressureGradient([GRADIENT, 0.0, 0.0]);
    let mesh = mesh.build().expect("pipe");
    let mut fluid = fluid_in(mesh, settings, |_| BoundaryCondition::WALL);
    let start = PerturbedPipe {
        origin: [0.0; 3],
        stream: 0,
        radius: 1.0,
        length: 1.0,
        mean: 1.0,
        profile: MeanProfile::Laminar,
        intensity: 0.05,
        seed: 1,
    };
    fluid.set_velocity(start.field()).expect("start");
    for _ in 0..200 {
        fluid.advance(0.05).expect("step");
    }
    fluid
}

#[test]
fn hagen_poiseuille_flow_is_second_order() {
    let exact = |[_, y, z]: [f64; 3]| [2.0 * (1.0 - y * y - z * z), 0.0, 0.0];
    let fluids = [4, 8].map(steady);
    let [coarse, fine] = [&fluids[0], &fluids[1]].map(|fluid| errors(fluid, exact));
    for (name, k) in [("mean", 0), ("largest", 1)] {
        let order = (coarse[k] / fine[k]).log2();
        println!(
            "{name}: {:.3e} {:.3e}, order {order:.2}",
            coarse[k], fine[k]
        );
        assert!(order > 1.8, "{name}: {coarse:?} {fine:?}");
    }
    for fluid in &fluids {
        // What drives the flow is what holds it at the wall.
        let force = fluid.wall_force(0);
        let driving = GRADIENT * fluid.volume();
        assert!(
            (force[0] / driving - 1.0).abs() < 1e-6,
            "{force:?} {driving}"
        );
        assert!(force[1].hypot(force[2]) < 1e-6 * driving);
        // Every section is the same: the eddies of the start leave no trace.
        let mesh = fluid.mesh();
        let first = mesh.nodes.iter().enumerate().filter(|(_, x)| x[0] == 0.0);
        for (i, x) in first {
            let mut others = mesh.nodes.iter();
            let other = others.position(|y| y[0] > 0.0 && y[1..] == x[1..]);
            let other = other.expect("the node of the next section");
            let [u, v] = [i, other].map(|k| fluid.velocity()[k][0]);
            assert!((u - v).abs() < 1e-6, "{u} {v} at {x:?}");
        }
    }
}
