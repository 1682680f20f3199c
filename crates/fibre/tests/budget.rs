//! The budget of energy closes: what comes in is stored or lost.

use fibreflow_fibre::contact::{ContactSettings, NormalDamping};
use fibreflow_fibre::hydrodynamics::{
    AmbientFlow, DragModel, FluidProperties, SlenderConstants, TorqueModel,
};
use fibreflow_fibre::{
    Budget, Fibre, FibreSettings, FibreSystem, Hydrodynamics, ImplicitSettings, Integrator,
    Material, Vector3,
};
use fibreflow_parallel::Communicator;

const LENGTH: f64 = 1e-2;

fn settings(viscosity: f64, integrator: Integrator) -> FibreSettings {
    FibreSettings {
        gravity: Vector3::new(0.0, 0.0, -9.81),
        buoyant_density: 900.0,
        hydrodynamics: Some(Hydrodynamics {
            fluid: FluidProperties {
                density: 900.0,
                viscosity,
            },
            drag: DragModel::SlenderBody(SlenderConstants::Batchelor),
            torque: TorqueModel::Jeffery(SlenderConstants::Batchelor),
            point_spacing: f64::INFINITY,
        }),
        integrator,
        budget: true,
        ..FibreSettings::default()
    }
}

fn fibre(id: u64, start: Vector3, direction: Vector3) -> Fibre {
    let mut material = Material::new(1e-4, 2e6, 0.3, 1300.0);
    material.retardation = 2e-3;
    Fibre::straight(id, material, start, start + direction * LENGTH, 8)
}

/// A damped fibre that sinks, turns and bends in a shear under a point load and a torque.
fn in_shear(dt: f64, integrator: Integrator) -> Budget {
    let across = Vector3::new(0.2, 1.0, 0.3).normalize();
    let mut system = FibreSystem::new(
        Communicator::single(),
        settings(0.1, integrator),
        vec![fibre(0, Vector3::zeros(), across)],
    )
    .expect("fibre");
    let (force, torque) = (Vector3::new(0.0, 0.0, 2e-6), Vector3::new(1e-9, 0.0, 0.0));
    system.add_load(0, 8, force, torque).expect("load");
    let flow = AmbientFlow::Shear { rate: 20.0 };
    let steps = (0.05 / dt).round() as usize;
    for _ in 0..steps {
        system.advance_in_flow(&flow, dt).expect("step");
    }
    system.budget().expect("asked for")
}

fn closes(integrator: Integrator) {
    let [coarse, fine] = [4e-5, 1e-5].map(|dt| in_shear(dt, integrator));
    let [first, last] = [coarse, fine].map(|b| b.residual().abs() / b.largest());
    println!("{fine:?}\nresidual {first:.2e} {last:.2e}");
    assert!(last < 1e-3, "{last}");
    // A quarter of the step: nearly second order.
    assert!(last < 0.15 * first, "{first} {last}");
    for term in [fine.flow, fine.drag, fine.elastic, fine.material] {
        // A term that were left out would be seen.
        assert!(term.abs() > 10.0 * fine.residual().abs(), "{fine:?}");
    }
}

#[test]
fn in_a_flow_with_loads_and_damping() {
    closes(Integrator::Explicit);
}

#[test]
fn with_the_implicit_integrator() {
    closes(Integrator::Implicit(ImplicitSettings::default()));
}

/// Two crossed fibres fall on each other, rub and bounce.
#[test]
fn with_contacts_and_friction_and_over_a_restart() {
    let contacts = ContactSettings {
        friction: 0.3,
        damping: NormalDamping::Ratio(0.2),
        ..ContactSettings::new(20.0, 1e-4)
    };
    let settings = FibreSettings {
        contacts: Some(contacts),
        ..settings(1e-3, Integrator::Explicit)
    };
    let make = |fibres| FibreSystem::new(Communicator::single(), settings.clone(), fibres);
    let low = fibre(0, Vector3::new(-0.5 * LENGTH, 0.0, 0.0), Vector3::x());
    let above = Vector3::new(0.3e-3, -0.4 * LENGTH, 2.5e-4);
    let mut system = make(vec![low, fibre(1, above, Vector3::y())]).expect("fibres");
    for node in [0, 8] {
        let up = Vector3::new(0.0, 0.0, 4e-6);
        system
            .add_load(0, node, up, Vector3::zeros())
            .expect("load");
    }
    let dt = 2e-6;
    let flow = AmbientFlow::Uniform(Vector3::new(0.05, 0.0, 0.0));
    for _ in 0..5000 {
        system.advance_in_flow(&flow, dt).expect("step");
    }
    let mut resumed = make(Vec::new()).expect("empty");
    resumed.restore(system.state()).expect("restored");
    for _ in 0..5000 {
        system.advance_in_flow(&flow, dt).expect("step");
        resumed.advance_in_flow(&flow, dt).expect("step");
    }
    let [budget, again] = [&system, &resumed].map(|s| s.budget().expect("asked for"));
    let residual = budget.residual().abs() / budget.largest();
    println!("{budget:?}\nresidual {residual:.2e}");
    assert!(budget.contact_loss > 1e-3 * budget.largest());
    assert!(residual < 1e-3, "{residual}");
    let difference = again.contact_loss - budget.contact_loss;
    println!("{:.2e}", difference / budget.contact_loss);
    // The loss of a sub-step is booked in the next one, which a restart forgets.
    assert!(difference.abs() < 1e-3 * budget.contact_loss);
    assert_eq!(again.flow, budget.flow);
    assert_eq!(again.material, budget.material);
}
