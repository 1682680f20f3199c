//! Restart, thread count, values that are not finite.

mod common;

use common::{fluid_of, fluid_on, of, settings};
use fibreflow_fluid::{
    BoundaryCondition, Fluid, FluidError, FluidSettings, Forcing, Projections, initial,
};
use fibreflow_mesh::{BoxElement, BoxMesh, Stretching};

/// Everything in flight: walls, adaptive steps, bulk controller, body force.
fn channel() -> Fluid {
    let size = [2.0, 1.0, 1.0];
    let mesh = BoxMesh {
        periodic: [true, false, true],
        ..of(BoxElement::Prism, size, [10, 12, 10], 0.15)
    };
    let mut settings = settings(1.0, 0.002, 1e-7);
    settings.forcing = Forcing::BulkVelocity {
        direction: [1.0, 0.0, 0.0],
        value: 1.0,
    };
    let mut fluid = fluid_on(&mesh, settings, |_| BoundaryCondition::WALL);
    let start = initial::PerturbedChannel {
        origin: [0.0; 3],
        size,
        stream: 0,
        across: 1,
        mean: 1.0,
        profile: initial::MeanProfile::Turbulent,
        intensity: 0.1,
        seed: 7,
    };
    fluid.set_velocity(start.field()).expect("start");
    fluid
}

fn advance(fluid: &mut Fluid, steps: usize) {
    for _ in 0..steps {
        let nodes = fluid.mesh().nodes.clone();
        let phase = fluid.steps() as f64;
        for (f, x) in fluid.body_force_mut().iter_mut().zip(nodes) {
            *f = [0.0, 0.2 * (x[0] + phase).sin(), 0.0, 0.0];
        }
        let dt = fluid.suggest_dt(0.6, 1.0);
        fluid.advance(dt).expect("step");
    }
}

#[test]
fn a_restart_is_bitwise() {
    let mut whole = channel();
    advance(&mut whole, 9);
    for split in [1, 2, 5] {
        let mut first = channel();
        advance(&mut first, split);
        let mut second = channel();
        second.restore(first.state()).expect("restore");
        advance(&mut second, 9 - split);
        assert!(second.state() == whole.state(), "split after {split}");
    }
}

/// Of fourth order, once a step and every sub-step projected; walls, adaptive steps, bulk controller, body force.
fn fourth_order(projections: Projections) -> Fluid {
    let size = [2.0, 1.0, 1.0];
    let mesh = BoxMesh {
        periodic: [true, false, true],
        stretching: [
            Stretching::Uniform,
            Stretching::Tanh(1.5),
            Stretching::Uniform,
        ],
        ..of(BoxElement::Hexahedron, size, [10, 14, 8], 0.0)
    };
    let settings = FluidSettings {
        forcing: Forcing::BulkVelocity {
            direction: [1.0, 0.0, 0.0],
            value: 1.0,
        },
        projections,
        ..settings(1.0, 0.002, 1e-7)
    };
    let mesh = mesh.build().expect("box");
    let mut fluid = fluid_of(4, mesh, settings, |_| BoundaryCondition::WALL);
    let start = initial::PerturbedChannel {
        origin: [0.0; 3],
        size,
        stream: 0,
        across: 1,
        mean: 1.0,
        profile: initial::MeanProfile::Turbulent,
        intensity: 0.1,
        seed: 7,
    };
    fluid.set_velocity(start.field()).expect("start");
    fluid
}

#[test]
fn a_restart_of_fourth_order_is_bitwise() {
    for projections in [Projections::Once, Projections::EverySubStep] {
        let mut whole = fourth_order(projections);
        advance(&mut whole, 7);
        for split in [1, 4] {
            let mut first = fourth_order(projections);
            advance(&mut first, split);
            let mut second = fourth_order(projections);
            second.restore(first.state()).expect("restore");
            advance(&mut second, 7 - split);
            assert!(
                second.state() == whole.state(),
                "{projections:?}, split after {split}"
            );
        }
    }
}

#[test]
fn a_state_that_does_not_fit_is_refused_by_name() {
    let mut fluid = channel();
    let mut state = fluid.state();
    state.node[1].2.pop();
    let error = fluid.restore(state).expect_err("too short");
    assert!(error.to_string().contains("fluid.pressure"), "{error}");
    let mut state = fluid.state();
    state.scalars.clear();
    let error = fluid.restore(state).expect_err("missing");
    assert!(matches!(error, FluidError::State { .. }), "{error}");
}

#[test]
fn threads_do_not_change_a_bit() {
    let state = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads").install(|| {
            let mut fluid = channel();
            advance(&mut fluid, 3);
            fluid.state()
        })
    };
    let one = state(1);
    for threads in [2, 5] {
        assert!(state(threads) == one, "{threads} threads");
    }
}

#[test]
fn a_value_that_is_not_finite_is_named() {
    let mut fluid = channel();
    advance(&mut fluid, 1);
    fluid.body_force_mut()[17][1] = f64::NAN;
    let position = fluid.mesh().nodes[17];
    let error = fluid.advance(1e-3).expect_err("NaN");
    let expected = FluidError::NotFinite {
        field: "body force",
        node: 17,
        position,
        step: 1,
    };
    assert_eq!(error, expected);
}
