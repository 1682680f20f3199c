//! Loss of stability: Greenhill's twisted rod and Euler's column (validation rows B2, B5).

use fibreflow_fibre::{Equilibrium, Fibre, FibreSettings, FibreSystem, Material, Support, Vector3};
use fibreflow_parallel::Communicator;
use std::f64::consts::PI;

const SEGMENTS: usize = 32;

/// Stiffness so that EI = 1, and a mass of 1 by length.
fn material() -> Material {
    let unit = Material::new(0.02, 1.0, 0.3, 1.0);
    Material::new(0.02, 1.0 / unit.second_moment(), 0.3, 1.0 / unit.area())
}

fn system(fibre: Fibre) -> FibreSystem {
    let settings = FibreSettings::default();
    FibreSystem::new(Communicator::single(), settings, vec![fibre]).expect("valid fibre")
}

/// Pushes the fibre a little across its axis and returns the largest deflection in the last fifth of `time` over that in
/// the first.
fn growth(s: &mut FibreSystem, push: impl Fn(f64) -> f64, time: f64) -> f64 {
    for (i, v) in s.velocities_mut().iter_mut().enumerate() {
        v.y = 1e-6 * push(i as f64 / SEGMENTS as f64);
    }
    let mut largest = [0.0_f64; 5];
    for part in &mut largest {
        for _ in 0..40 {
            s.advance_free(time / 200.0).expect("finite");
            let from_axis = s.positions().iter().map(|x| x.y.hypot(x.z));
            *part = from_axis.fold(*part, f64::max);
        }
    }
    largest[4] / largest[0]
}

/// A rod with clamped ends buckles at a torque GJφ/L of 8.9868 EI/L, twice the root of tan x = x.
#[test]
fn a_twisted_rod_buckles_at_greenhills_torque() {
    let m = material();
    let critical = 8.986_818_9 / (2.0 * m.shear_modulus * m.second_moment());
    let twisted = |ratio: f64| {
        let mut fibre = Fibre::straight(1, m, Vector3::zeros(), Vector3::x(), SEGMENTS);
        fibre.supports = vec![Support::clamp(0), Support::clamp(SEGMENTS)];
        let mut s = system(fibre);
        // A uniform rate of twist: no torque on any inner node.
        for (i, w) in s.angular_velocities_mut().iter_mut().enumerate() {
            w.x = ratio * critical * i as f64 / SEGMENTS as f64;
        }
        s.advance_free(1.0).expect("finite");
        s.angular_velocities_mut().fill(Vector3::zeros());
        growth(&mut s, |x| (x * (1.0 - x)).powi(2), 2.0)
    };
    let (below, above) = (twisted(0.98), twisted(1.02));
    println!("growth at 0.98 and 1.02 of the critical twist: {below:.1}, {above:.1}");
    assert!(below < 5.0 && above > 50.0);
}

/// A column clamped at its foot buckles at π²EI/4L².
#[test]
fn a_compressed_column_buckles_at_eulers_load() {
    let m = material();
    let compressed = |ratio: f64| {
        let load = ratio * PI * PI / 4.0;
        // Placed as the load shortens it, so that no wave runs along it.
        let shorter = 1.0 - load / (m.youngs_modulus * m.area());
        let mut fibre = Fibre::straight(1, m, Vector3::zeros(), Vector3::x() * shorter, SEGMENTS);
        let rest = |i| Vector3::x() * (f64::from(i) / SEGMENTS as f64);
        fibre.equilibrium = Equilibrium::Shape((0..=SEGMENTS as u32).map(rest).collect());
        fibre.supports = vec![Support::clamp(0)];
        let mut s = system(fibre);
        s.add_load(1, SEGMENTS, Vector3::x() * -load, Vector3::zeros())
            .expect("tip");
        growth(&mut s, |x| x * x * (3.0 - x), 20.0)
    };
    let (below, above) = (compressed(0.99), compressed(1.01));
    println!("growth at 0.99 and 1.01 of the critical load: {below:.1}, {above:.1}");
    assert!(below < 5.0 && above > 50.0);
}
