//! Linked fibres in a flow that is known at their segments, and what they do to it.

use fibreflow_fibre::contact::Repulsion;
use fibreflow_fibre::hydrodynamics::AmbientFlow;
use fibreflow_fibre::linked::{Joint, LinkedFibre, LinkedScheme, LinkedSettings, LinkedSystem};
use fibreflow_fibre::{Ambient, Fibre, Material, Matrix3, Points, Vector3};
use fibreflow_parallel::Communicator;
use rand::{Rng, SeedableRng};

fn system(scheme: LinkedScheme, fibres: Vec<LinkedFibre>) -> LinkedSystem {
    let settings = LinkedSettings {
        repulsion: Some(Repulsion {
            strength: 2e4,
            decay: 0.05,
            attraction: 0.0,
            attraction_width: 0.17,
            range: 0.66,
            contact_gap: 0.33,
        }),
        friction: [2.0, 1.0],
        ..LinkedSettings::new(scheme, 1.0, 3.0)
    };
    LinkedSystem::new(&Communicator::single(), settings, fibres).expect("fibres")
}

/// Straight fibres of five segments in a cube so small that they touch.
fn crowd(count: u64) -> Vec<LinkedFibre> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let mut vector = move || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
    let mut fibre = |id: u64| {
        let (middle, half) = (vector() * 30.0, vector().normalize() * 40.0);
        let material = Material::new(1.0, 1e7, 0.3, 1.0);
        let beam = Fibre::straight(id, material, middle - half, middle + half, 5);
        LinkedFibre::new(&beam, Joint::Ball).expect("a fibre")
    };
    (0..count).map(&mut fibre).collect()
}

fn sample(points: &Points, yielding: f64) -> Ambient {
    let mut ambient = Ambient::default();
    for x in &points.position {
        let (u, gradient) = AmbientFlow::Shear { rate: 1.0 }.at(x);
        ambient.velocity.push(u);
        ambient.gradient.push(gradient);
        ambient.yielding.push(yielding);
    }
    ambient
}

/// A linear flow is the same sampled or as a formula, and fibres without weight that touch leave no net force or torque in it.
#[test]
fn a_linear_flow_may_be_sampled() {
    let make = || system(LinkedScheme::Implicit, crowd(24));
    let (mut sampled, mut formula) = (make(), make());
    let (mut points, mut rubbing) = (Points::default(), 0);
    for _ in 0..40 {
        let step = 5e-3;
        sampled.points(step, &mut points);
        let ambient = sample(&points, 0.0);
        let reaction = sampled
            .advance_sampled(&points, &ambient, step)
            .expect("step");
        let net: Vector3 = reaction.force.iter().sum();
        let size: f64 = reaction.force.iter().map(|f| f.norm()).sum();
        assert!(net.norm() < 1e-11 * size, "{net} of {size}");
        let shear = AmbientFlow::Shear { rate: 1.0 };
        let flow = |x: &Vector3, _: f64| -> (Vector3, Matrix3) { shear.at(x) };
        formula.advance(&flow, step).expect("step");
        let touches = formula.solved_touches().iter();
        rubbing += touches.filter(|t| t.friction.norm() > 0.0).count();
    }
    assert!(rubbing > 100, "{rubbing} contacts that rub");
    for (a, b) in sampled.nodes().iter().zip(formula.nodes()) {
        assert!((a - b).norm() < 1e-7, "{a} {b}");
    }
}

/// A rod that sinks along its axis: the fluid takes its weight, and gives way to it.
#[test]
fn the_fluid_takes_the_weight_and_gives_way() {
    let sinking = |yielding: f64| {
        let half = Vector3::z() * 40.0;
        let material = Material::new(1.0, 1e7, 0.3, 1.0);
        let beam = Fibre::straight(0, material, -half, half, 5);
        let mut fibre = LinkedFibre::new(&beam, Joint::Ball).expect("a fibre");
        fibre.weight = Vector3::z() * -3.0;
        let mut system = system(LinkedScheme::Implicit, vec![fibre]);
        let mut points = Points::default();
        system.points(0.1, &mut points);
        let still = Ambient {
            velocity: vec![Vector3::zeros(); 5],
            gradient: vec![Matrix3::zeros(); 5],
            yielding: vec![yielding; 5],
            ..Ambient::default()
        };
        let reaction = system
            .advance_sampled(&points, &still, 0.1)
            .expect("step")
            .clone();
        for force in &reaction.force {
            assert!((force - Vector3::z() * -3.0).norm() < 1e-11, "{force}");
        }
        system.points(0.0, &mut points);
        points.velocity[2].z
    };
    let (held, free) = (sinking(0.0), sinking(0.02));
    assert!(held < 0.0);
    assert!((free - held + 3.0 * 0.02).abs() < 1e-12, "{free} {held}");
}

#[test]
fn the_explicit_scheme_is_refused() {
    let mut system = system(LinkedScheme::Explicit, crowd(1));
    let mut points = Points::default();
    system.points(0.0, &mut points);
    let ambient = sample(&points, 0.0);
    let refused = system.advance_sampled(&points, &ambient, 1e-3).map(|_| ());
    assert!(
        refused
            .expect_err("explicit")
            .to_string()
            .contains("implicitly")
    );
}
