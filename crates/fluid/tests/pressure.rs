//! How the pressure equation is solved: the choice, and that it does not matter for the flow.

mod common;

use common::{fluid_of, of, settings};
use fibreflow_fluid::{
    BoundaryCondition, Fluid, FluidError, FluidSettings, PressurePreconditioner, PressureReason,
    Projections, Signal, VelocityProfile,
};
use fibreflow_mesh::{BoxElement, BoxMesh, LocalMesh, Stretching, geometry};
use std::sync::Arc;

/// Eddies between walls on stretched hexahedra.
fn channel(order: u8, preconditioner: PressurePreconditioner, projections: Projections) -> Fluid {
    let mesh = BoxMesh {
        periodic: [true, false, true],
        stretching: [
            Stretching::Uniform,
            Stretching::Tanh(2.0),
            Stretching::Uniform,
        ],
        ..of(BoxElement::Hexahedron, [2.0, 1.0, 1.0], [12, 14, 9], 0.0)
    };
    let settings = FluidSettings {
        preconditioner,
        projections,
        ..settings(1.0, 0.01, 1e-12)
    };
    let mesh = mesh.build().expect("box");
    let mut fluid = fluid_of(order, mesh, settings, |_| BoundaryCondition::WALL);
    let start = |[x, y, z]: [f64; 3]| {
        let hat = 4.0 * y * (1.0 - y);
        let wave = (3.1 * x).sin() * (6.3 * z).cos();
        [hat * (1.0 + 0.3 * wave), 0.2 * hat * wave, 0.1 * hat]
    };
    fluid.set_velocity(start).expect("start");
    for _ in 0..4 {
        fluid.advance(0.02).expect("step");
    }
    fluid
}

#[test]
fn every_solver_gives_the_same_flow_of_both_orders() {
    for order in [2, 4] {
        for projections in [Projections::Once, Projections::EverySubStep] {
            let direct = channel(order, PressurePreconditioner::Direct, projections);
            for other in [PressurePreconditioner::Amg, PressurePreconditioner::Jacobi] {
                let fluid = channel(order, other, projections);
                let pairs = direct.velocity().iter().zip(fluid.velocity());
                let differences = pairs.flat_map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).abs()));
                let largest = differences.fold(0.0, f64::max);
                println!("order {order}, {projections:?}, {other:?}: {largest:.1e}");
                assert!(largest < 1e-10, "{largest:e}");
            }
        }
    }
}

/// A channel of hexahedra with an inlet, an outlet and `sides` in between.
fn through(
    element: BoxElement,
    sides: BoundaryCondition,
    wanted: PressurePreconditioner,
) -> Result<Fluid, FluidError> {
    let mesh = BoxMesh {
        periodic: [false, false, true],
        ..of(element, [2.0, 1.0, 0.5], [8, 6, 3], 0.0)
    };
    let mesh = Arc::new(LocalMesh::single(mesh.build().expect("box")));
    let dual = Arc::new(geometry::dual(&mesh).expect("dual geometry"));
    let condition = |name: &String| match name.as_str() {
        "x_min" => BoundaryCondition::Inlet {
            profile: VelocityProfile::Uniform([1.0, 0.0, 0.0]),
        },
        "x_max" => BoundaryCondition::Outlet {
            pressure: Signal::Constant(0.0),
        },
        _ => sides.clone(),
    };
    let settings = FluidSettings {
        boundary: mesh.patches.iter().map(condition).collect(),
        preconditioner: wanted,
        ..settings(1.0, 0.01, 1e-10)
    };
    Fluid::new(mesh, dual, settings)
}

#[test]
fn the_choice_says_why() {
    use PressurePreconditioner::{Amg, Auto, Direct};
    let choice = |element, sides, wanted| {
        let fluid = through(element, sides, wanted).expect("fluid");
        println!("{}", fluid.pressure_choice());
        fluid.pressure_choice().clone()
    };
    let (hexahedra, slip) = (BoxElement::Hexahedron, BoundaryCondition::Slip);
    let found = choice(hexahedra, slip.clone(), Auto);
    assert!(found.preconditioner == Direct && found.solves == 3);
    assert!(matches!(found.reason, PressureReason::TensorProduct { .. }));
    // Walls take the edges of the outlet: its nodes are not a whole side.
    let found = choice(hexahedra, BoundaryCondition::WALL, Auto);
    assert!(found.preconditioner == Amg && found.solves == 1);
    assert_eq!(found.reason, PressureReason::PartOfAnEnd);
    let found = choice(BoxElement::Tetrahedron, slip.clone(), Auto);
    assert_eq!(
        (found.preconditioner, found.reason),
        (Amg, PressureReason::NotTensorProduct)
    );
    let found = choice(hexahedra, slip.clone(), Amg);
    assert_eq!(
        (found.preconditioner, found.reason),
        (Amg, PressureReason::AsSet)
    );
    let refused = through(BoxElement::Tetrahedron, slip, Direct).map(|_| ());
    let expected = FluidError::NoDirect(PressureReason::NotTensorProduct);
    assert_eq!(refused.expect_err("tetrahedra"), expected);
}
