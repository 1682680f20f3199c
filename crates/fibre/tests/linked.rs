//! Linked rigid fibres: conservation, exact limits, restart, threads.

use fibreflow_fibre::contact::Repulsion;
use fibreflow_fibre::hydrodynamics::{AmbientFlow, SpheroidRatio};
use fibreflow_fibre::linked::{Joint, LinkedFibre, LinkedSettings, LinkedSystem};
use fibreflow_fibre::{Fibre, Material, Matrix3, PeriodicBox, Vector3};
use fibreflow_parallel::Communicator;
use rand::{Rng, SeedableRng};
use std::f64::consts::PI;

fn settings() -> LinkedSettings {
    let force = 150.0 * 6.0 * PI * 8.0;
    LinkedSettings {
        viscosity: 1.0,
        spheroid: SpheroidRatio::Bretherton,
        repulsion: Some(Repulsion {
            strength: force,
            decay: 0.05,
            attraction: 0.06 * force,
            attraction_width: 0.17,
            range: 0.66,
            contact_gap: 0.33,
        }),
        friction: [2.0, 1.0],
        skin: 3.0,
        periodic: PeriodicBox::unbounded(),
        shear_rate: 0.0,
    }
}

fn system(settings: LinkedSettings, fibres: Vec<LinkedFibre>) -> LinkedSystem {
    LinkedSystem::new(&Communicator::single(), settings, fibres).expect("fibres")
}

/// Bent fibres of five segments in a cube so small that they touch, every second one with pins.
fn crowd(count: usize, edge: f64, seed: u64) -> Vec<LinkedFibre> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut vector = move || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
    let mut fibre = |k: usize| {
        let (across, along) = (vector(), vector().normalize());
        let normal = along.cross(&across).normalize();
        let mut nodes = vec![vector() * (0.5 * edge)];
        for i in 0..5 {
            let angle = 0.25 * i as f64;
            let step = along * angle.cos() + normal.cross(&along) * angle.sin();
            nodes.push(nodes[i] + step * 16.0);
        }
        let mut beam = Fibre::new(k as u64, Material::new(1.0, 1.0, 0.49, 1.0), nodes);
        beam.material.youngs_modulus =
            16.0 * 38.0 * 8.0 * PI * 512.0 / beam.material.second_moment();
        beam.material.shear_modulus = beam.material.youngs_modulus / 2.98;
        beam.equilibrium = fibreflow_fibre::Equilibrium::Straight;
        // A wide section, so that the stiffnesses of the joints differ.
        beam.material.bending_ratio = if k.is_multiple_of(3) { 0.5 } else { 1.0 };
        beam.section_axis = across;
        let pins = k.is_multiple_of(2);
        let joint = if pins { Joint::Pin } else { Joint::Ball };
        LinkedFibre::new(&beam, joint).expect("a fibre")
    };
    (0..count).map(&mut fibre).collect()
}

fn shear(x: &Vector3, _: f64) -> (Vector3, Matrix3) {
    AmbientFlow::Shear { rate: 1.0 }.at(x)
}

/// Centres and axes of the segments.
fn places(system: &LinkedSystem) -> Vec<[Vector3; 2]> {
    let fibre = |f: usize| {
        let segments = system.offsets()[f]..system.offsets()[f + 1];
        segments.map(move |s| {
            let [a, b] = [s + f, s + f + 1].map(|n| system.nodes()[n]);
            [0.5 * (a + b), (b - a).normalize()]
        })
    };
    (0..system.fibres()).flat_map(fibre).collect()
}

/// What joints, pins and contacts do sums up to nothing: neither does what the flow does.
#[test]
fn no_net_force_or_torque() {
    let mut system = system(settings(), crowd(24, 60.0, 5));
    let (mut rubbing, mut sliding) = (0, 0);
    for _ in 0..20 {
        let before = places(&system);
        system.advance(&shear, 2e-5).expect("a step");
        let (mut force, mut torque) = (Vector3::zeros(), Vector3::zeros());
        let (mut forces, mut torques) = (0.0, 0.0);
        for (s, [centre, axis]) in before.iter().enumerate() {
            let [f, t] = system.drag(s, axis, &shear(centre, 0.0));
            let moment = centre.cross(&f) + t;
            force += f;
            torque += moment;
            forces += f.norm();
            torques += centre.norm() * f.norm() + t.norm();
        }
        assert!(
            force.norm() < 1e-12 * forces,
            "{} of {forces}",
            force.norm()
        );
        assert!(
            torque.norm() < 1e-12 * torques,
            "{} of {torques}",
            torque.norm()
        );
        for touch in system.solved_touches().iter().filter(|t| t.rubs) {
            let limit = touch.push.abs() * if touch.slides { 1.0 } else { 2.0 };
            let size = touch.friction.norm();
            assert!(
                size <= limit * (1.0 + 1e-12)
                    && touch.friction.dot(&touch.normal).abs() < 1e-12 * size.max(1.0)
            );
            rubbing += 1;
            sliding += usize::from(touch.slides);
        }
    }
    println!("{rubbing} contacts, {sliding} of them sliding");
    assert!(sliding > 10 && rubbing > sliding + 10);
}

/// The sides of a joint move together, to round-off.
#[test]
fn joints_hold() {
    let mut system = system(settings(), crowd(6, 60.0, 8));
    for _ in 0..50 {
        let before = places(&system);
        system.advance(&shear, 2e-5).expect("a step");
        let (mut parting, mut fastest) = (0.0_f64, 0.0_f64);
        for s in (0..system.segments() - 1).filter(|s| !(s + 1).is_multiple_of(5)) {
            let side = |s: usize, sign: f64| {
                let [v, w] = system.motion(s);
                fastest = fastest.max(v.norm());
                v + w.cross(&(before[s][1] * (8.0 * sign)))
            };
            let mut side = side;
            parting = parting.max((side(s, 1.0) - side(s + 1, -1.0)).norm());
        }
        assert!(parting < 1e-11 * fastest, "{parting} of {fastest}");
    }
    assert!(
        system.statistics().pin_drift < 1e-7,
        "{:?}",
        system.statistics()
    );
}

/// Jeffery (1922): tan φ = r tan(γ̇t/(r + 1/r)) from the gradient's direction on, r = 0.7 ℓ/b.
#[test]
fn a_single_segment_follows_its_orbit() {
    let nodes = vec![Vector3::new(0.0, -10.0, 0.0), Vector3::new(0.0, 10.0, 0.0)];
    let beam = Fibre::new(0, Material::new(1.0, 1.0, 0.3, 1.0), nodes);
    let fibre = LinkedFibre::new(&beam, Joint::Ball).expect("a fibre");
    let mut errors = [4e-3, 2e-3].map(|step: f64| {
        let mut system = system(settings(), vec![fibre.clone()]);
        let ratio: f64 = 7.0;
        let steps = (6.0 / step).round() as usize;
        for _ in 0..steps {
            system.advance(&shear, step).expect("a step");
        }
        let axis = system.nodes()[1] - system.nodes()[0];
        let found = axis.x.atan2(axis.y);
        let angle = 6.0 / (ratio + 1.0 / ratio);
        (found - (ratio * angle.tan()).atan()).abs()
    });
    println!("{errors:?}");
    assert!(errors[1] < 1e-5);
    errors[1] /= errors[0];
    assert!((0.2..0.3).contains(&errors[1]), "second order: {errors:?}");
}

/// A bent fibre straightens; what its joints lose, the fluid takes.
#[test]
fn elastic_energy_goes_into_the_fluid() {
    let mut fibre = crowd(1, 10.0, 1).remove(0);
    fibre.joint = Joint::Ball;
    let mut system = system(settings(), vec![fibre]);
    let still = |_: &Vector3, _: f64| (Vector3::zeros(), Matrix3::zeros());
    let first = system.statistics().elastic_energy;
    let mut work = 0.0;
    let (mut before, mut last) = (places(&system), 0.0);
    for step in 0..400 {
        system.advance(&still, 1e-4).expect("a step");
        let mut power = 0.0;
        for (s, [centre, axis]) in before.iter().enumerate() {
            let [f, t] = system.drag(s, axis, &still(centre, 0.0));
            let [v, w] = system.motion(s);
            power += f.dot(&v) + t.dot(&w);
        }
        // Adams and Bashforth's weights, as the motion has them.
        work += 1e-4
            * if step == 0 {
                power
            } else {
                1.5 * power - 0.5 * last
            };
        last = power;
        before = places(&system);
    }
    let left = system.statistics().elastic_energy;
    println!("{first} to {left}, {work} taken");
    assert!(left < 0.5 * first);
    assert!(
        (first - left + work).abs() < 1e-3 * first,
        "{}",
        first - left + work
    );
}

fn words(system: &LinkedSystem) -> Vec<u64> {
    let records = system.state().records.into_iter();
    records.flat_map(|r| r.words).collect()
}

fn in_box() -> LinkedSettings {
    LinkedSettings {
        periodic: PeriodicBox {
            origin: Vector3::zeros(),
            lengths: [Some(120.0); 3],
        },
        shear_rate: 1.0,
        ..settings()
    }
}

/// In a sheared box, with contacts across its faces.
#[test]
fn a_restored_system_goes_on_bit_by_bit() {
    let run = |system: &mut LinkedSystem, steps: usize| {
        for _ in 0..steps {
            system.advance(&shear, 2e-5).expect("a step");
        }
    };
    let mut whole = system(in_box(), crowd(40, 120.0, 2));
    run(&mut whole, 30);
    let state = whole.state();
    run(&mut whole, 30);
    let mut resumed = system(in_box(), crowd(3, 120.0, 4));
    resumed.restore(state).expect("a state");
    run(&mut resumed, 30);
    assert!(words(&whole) == words(&resumed));
    assert!(!whole.solved_touches().is_empty());
}

#[test]
fn threads_do_not_change_the_bits() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads").install(|| {
            let mut system = system(in_box(), crowd(150, 120.0, 6));
            for _ in 0..10 {
                system.advance(&shear, 1e-6).expect("a step");
            }
            words(&system)
        })
    };
    assert!(run(1) == run(2));
}

/// Shifting all fibres by whole periods of the sheared box, each by its own, changes nothing but their place.
#[test]
fn images_in_a_sheared_box_are_alike() {
    let fibres = crowd(40, 120.0, 2);
    let mut moved = fibres.clone();
    for (k, fibre) in moved.iter_mut().enumerate() {
        let periods = Vector3::new((k % 3) as f64 - 1.0, (k % 2) as f64, -((k % 4) as f64));
        fibre.centre += periods * 120.0;
    }
    let [a, b] = [fibres, moved].map(|fibres| {
        let mut system = system(in_box(), fibres);
        for _ in 0..50 {
            system.advance(&shear, 2e-5).expect("a step");
        }
        system
    });
    assert_eq!(a.touches().len(), b.touches().len());
    let turned = (0..a.segments()).map(|s| a.frame(s).angle_to(&b.frame(s)));
    let largest = turned.fold(0.0, f64::max);
    assert!(largest < 1e-9, "{largest}");
    assert!(
        a.solved_touches()
            .iter()
            .any(|t| t.image_velocity != Vector3::zeros())
    );
}
