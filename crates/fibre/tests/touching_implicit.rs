//! Touching fibres in implicit steps: momentum, no energy from collisions, statics, threads (validation row B6).

use fibreflow_fibre::contact::{ContactSettings, NormalDamping, Wall};
use fibreflow_fibre::{
    Fibre, FibreSettings, FibreSystem, ImplicitSettings, Integrator, Material, Vector3,
};
use fibreflow_parallel::Communicator;

fn settings(walls: Vec<Wall>, damping: f64, friction: f64) -> FibreSettings {
    FibreSettings {
        contacts: Some(ContactSettings {
            damping: NormalDamping::Ratio(damping),
            friction,
            tangential_ratio: 0.5,
            walls,
            count_crossings: true,
            ..ContactSettings::new(2e3, 0.02)
        }),
        integrator: Integrator::Implicit(ImplicitSettings::default()),
        ..FibreSettings::default()
    }
}

fn material() -> Material {
    Material::new(0.02, 1e6, 0.3, 1000.0)
}

fn system(fibres: Vec<Fibre>, settings: FibreSettings) -> FibreSystem {
    FibreSystem::new(Communicator::single(), settings, fibres).expect("valid")
}

/// Two fibres that cross at a distance; the upper one comes down.
fn collision(settings: FibreSettings) -> FibreSystem {
    let half = Vector3::new(0.5, 0.1, 0.0);
    let low = Fibre::straight(1, material(), -half, half, 8);
    let lift = Vector3::new(0.13, 0.0, 0.05);
    let across = Vector3::new(0.0, 0.5, 0.0);
    let high = Fibre::straight(2, material(), lift - across, lift + across, 8);
    let mut s = system(vec![low, high], settings);
    for v in &mut s.velocities_mut()[9..] {
        v.z = -1.0;
    }
    s
}

#[test]
fn a_collision_keeps_momentum_and_gains_no_energy_at_any_step() {
    let total =
        |s: &FibreSystem| s.energy().total() + s.contacts().expect("on").statistics().stored_energy;
    for (step, friction) in [(1e-3, 0.0), (1e-2, 0.3), (0.1, 0.3), (1.0, 0.3)] {
        let mut s = collision(settings(Vec::new(), 0.0, friction));
        let (p, mut e) = (s.momentum(), total(&s));
        let mut touched = false;
        for _ in 0..60 {
            s.advance_free(step).expect("an answer");
            let now = total(&s);
            assert!(now < e * (1.0 + 1e-6), "step {step}: {now} {e}");
            e = now;
            touched |= s.contacts().expect("on").statistics().contacts > 0;
        }
        let statistics = s.contacts().expect("on").statistics();
        let upper = s.velocities()[9..].iter().map(|v| v.z).sum::<f64>() / 9.0;
        let gap = (s.momentum() - p).norm() / p.norm();
        println!(
            "step {step}: upper fibre {upper}, crossings {}, momentum {gap:.1e}",
            statistics.crossings
        );
        assert!(touched && upper > -0.9 && statistics.crossings == 0);
        assert!(gap < 1e-8);
    }
}

/// At a small step the answer is that of the explicit integrator.
#[test]
fn a_small_step_gives_what_the_explicit_integrator_gives() {
    let run = |integrator: Integrator, step: f64| {
        let mut s = collision(FibreSettings {
            integrator,
            step_safety: 0.2,
            ..settings(Vec::new(), 0.5, 0.3)
        });
        for _ in 0..(0.03 / step) as usize {
            s.advance_free(step).expect("an answer");
        }
        s.positions().to_vec()
    };
    let reference = run(Integrator::Explicit, 1e-3);
    let error = |step: f64| {
        let found = run(Integrator::Implicit(ImplicitSettings::default()), step);
        let pairs = found.iter().zip(&reference);
        pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
    };
    let errors = [1e-4, 5e-5, 2.5e-5].map(error);
    // The explicit answer is itself this far from its limit.
    println!("{errors:?}");
    assert!(errors.iter().all(|error| *error < 1e-4));
}

#[test]
fn a_fibre_comes_to_rest_on_the_floor_in_large_steps() {
    let floor = Wall::plane(Vector3::zeros(), Vector3::z());
    let mut m = material();
    m.retardation = 1e-4;
    let r = m.radius;
    let start = Vector3::new(0.0, 0.0, r + 0.01);
    let fibre = Fibre::straight(5, m, start, start + Vector3::new(0.8, 0.0, 0.02), 6);
    let mut s = system(
        vec![fibre],
        FibreSettings {
            gravity: Vector3::new(0.0, 0.0, -10.0),
            ..settings(vec![floor], 0.7, 0.4)
        },
    );
    for _ in 0..60 {
        s.advance_free(5e-2).expect("an answer");
    }
    let statistics = s.contacts().expect("on").statistics();
    assert!(statistics.wall_contacts >= 2);
    assert!(s.velocities().iter().all(|v| v.norm() < 1e-5));
    let mut heights = s.positions().iter().map(|x| x.z - r);
    assert!(heights.all(|h| h < 0.0 && h > -4.0 * s.mass() / 6.0 * 10.0 / 2e3));
    let pressed = s.contacts().expect("on").wall_forces()[0];
    println!("on the floor {pressed:?}, weight {}", 10.0 * s.mass());
    assert!((pressed.z + 10.0 * s.mass()).abs() < 1e-4 * 10.0 * s.mass());
}

/// Friction holds a fibre on an incline below the angle of friction and lets it slide above.
#[test]
fn friction_holds_below_its_angle() {
    let slope = |angle: f64| {
        let normal = Vector3::new(-angle.sin(), 0.0, angle.cos());
        let along = Vector3::new(angle.cos(), 0.0, angle.sin());
        let floor = Wall::plane(Vector3::zeros(), normal);
        let start = normal * material().radius;
        let fibre = Fibre::straight(5, material(), start, start + along * 0.5, 4);
        let mut s = system(
            vec![fibre],
            FibreSettings {
                gravity: Vector3::new(0.0, 0.0, -10.0),
                ..settings(vec![floor], 0.7, 0.4)
            },
        );
        let centre = s.centre(0);
        for _ in 0..100 {
            s.advance_free(1e-2).expect("an answer");
        }
        (s.centre(0) - centre).dot(&along)
    };
    let critical = 0.4_f64.atan();
    let (below, above) = (slope(0.99 * critical), slope(1.01 * critical));
    println!("moved along the slope: {below:e} below, {above:e} above");
    assert!(below.abs() < 1e-2 && above < -2e-2);
}

#[test]
fn the_same_for_any_number_of_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("pool");
        let fibres = (0..60)
            .map(|i| {
                let a = 0.7 * i as f64;
                let centre = Vector3::new(0.0, 0.0, 0.05 * i as f64);
                let half = Vector3::new(a.cos(), a.sin(), 0.0) * 0.5;
                Fibre::straight(i, material(), centre - half, centre + half, 8)
            })
            .collect();
        let mut s = system(fibres, settings(Vec::new(), 0.3, 0.3));
        for i in 0..s.velocities().len() {
            s.velocities_mut()[i].z = -20.0 * s.positions()[i].z;
        }
        let mut most = 0;
        pool.install(|| {
            for _ in 0..10 {
                s.advance_free(2e-3).expect("an answer");
                most = most.max(s.contacts().expect("on").statistics().contacts);
            }
        });
        assert!(most > 10, "{most}");
        assert_eq!(s.contacts().expect("on").statistics().crossings, 0);
        s.positions().to_vec()
    };
    assert_eq!(run(1), run(3));
}
