//! Beams in contact: statics on a floor, collisions that keep momentum, balance of forces with drag.

use fibreflow_fibre::contact::{ContactSettings, NormalDamping, Wall};
use fibreflow_fibre::{Fibre, FibreSettings, FibreSystem, Material, Vector3};
use fibreflow_parallel::Communicator;

fn contacts(walls: Vec<Wall>, damping: f64, friction: f64) -> ContactSettings {
    ContactSettings {
        damping: NormalDamping::Ratio(damping),
        friction,
        tangential_ratio: 0.5,
        walls,
        ..ContactSettings::new(2e3, 0.02)
    }
}

fn material() -> Material {
    Material::new(0.02, 1e6, 0.3, 1000.0)
}

#[test]
fn two_crossed_fibres_collide_and_keep_momentum_and_energy() {
    let settings = FibreSettings {
        contacts: Some(contacts(Vec::new(), 0.0, 0.0)),
        step_safety: 0.2,
        ..FibreSettings::default()
    };
    let half = Vector3::new(0.5, 0.1, 0.0);
    let low = Fibre::straight(1, material(), -half, half, 8);
    let lift = Vector3::new(0.13, 0.0, 0.05);
    let across = Vector3::new(0.0, 0.5, 0.0);
    let high = Fibre::straight(2, material(), lift - across, lift + across, 8);
    let mut s = FibreSystem::new(Communicator::single(), settings, vec![low, high]).expect("valid");
    for v in &mut s.velocities_mut()[9..] {
        v.z = -1.0;
    }
    let total =
        |s: &FibreSystem| s.energy().total() + s.contacts().expect("on").statistics().stored_energy;
    let (p, l, e) = (s.momentum(), s.angular_momentum(), total(&s));
    let mut touched = false;
    for _ in 0..200 {
        s.advance_free(1e-3).expect("finite");
        touched |= s.contacts().expect("on").statistics().contacts > 0;
    }
    let upper = s.velocities()[9..].iter().map(|v| v.z).sum::<f64>() / 9.0;
    println!(
        "mean velocity of the upper fibre {upper}, energy {:.2e}",
        total(&s) / e - 1.0
    );
    assert!(touched && upper > -0.9);
    assert!((s.momentum() - p).norm() < 1e-12 * p.norm());
    assert!((s.angular_momentum() - l).norm() < 1e-11 * p.norm());
    assert!((total(&s) / e - 1.0).abs() < 1e-2);
}

#[test]
fn a_fibre_comes_to_rest_on_the_floor_under_its_weight() {
    let floor = Wall::plane(Vector3::zeros(), Vector3::z());
    let settings = FibreSettings {
        gravity: Vector3::new(0.0, 0.0, -10.0),
        contacts: Some(contacts(vec![floor], 0.7, 0.4)),
        ..FibreSettings::default()
    };
    let r = material().radius;
    let mut m = material();
    m.retardation = 1e-4;
    let start = Vector3::new(0.0, 0.0, r + 0.01);
    let fibre = Fibre::straight(5, m, start, start + Vector3::new(0.8, 0.0, 0.02), 6);
    let mut s = FibreSystem::new(Communicator::single(), settings, vec![fibre]).expect("valid");
    for _ in 0..300 {
        s.advance_free(1e-2).expect("finite");
    }
    let statistics = s.contacts().expect("on").statistics();
    assert!(statistics.wall_contacts >= 2);
    assert!(s.velocities().iter().all(|v| v.norm() < 1e-3));
    let heights = s.positions().iter().map(|x| x.z - r);
    // The weight of a node sinks it by at most m g/k.
    assert!(
        heights
            .clone()
            .all(|h| h < 0.0 && h > -4.0 * s.mass() / 6.0 * 10.0 / 2e3)
    );
}

/// Enough segments and pairs for every loop to be split, over a thousand sub-steps.
#[test]
fn the_same_for_any_number_of_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("pool");
        let settings = FibreSettings {
            contacts: Some(contacts(Vec::new(), 0.3, 0.3)),
            ..FibreSettings::default()
        };
        let fibres = (0..400)
            .map(|i| {
                let a = 0.7 * i as f64;
                let centre = Vector3::new(0.0, 0.0, 0.045 * i as f64);
                let half = Vector3::new(a.cos(), a.sin(), 0.0) * 0.5;
                Fibre::straight(i, material(), centre - half, centre + half, 8)
            })
            .collect();
        let mut s = FibreSystem::new(Communicator::single(), settings, fibres).expect("valid");
        for i in 0..s.velocities().len() {
            s.velocities_mut()[i].z = if i / 9 % 2 == 0 { 1.0 } else { -1.0 };
        }
        let (mut most, mut substeps) = (0, 0);
        pool.install(|| {
            while substeps < 1000 {
                s.advance_free(2e-3).expect("finite");
                substeps += s.substeps();
                most = most.max(s.contacts().expect("on").statistics().contacts);
            }
        });
        assert!(most > 300, "{most}");
        (s.positions().to_vec(), s.orientations().to_vec())
    };
    assert_eq!(run(1), run(2));
}
