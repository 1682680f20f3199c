//! Fibres break at their strength, and nothing but the tie is lost.

use fibreflow_fibre::contact::{ContactSettings, NormalDamping};
use fibreflow_fibre::{
    Equilibrium, Fibre, FibreSettings, FibreSystem, ImplicitSettings, Integrator, Kinematics,
    Material, Support, Vector3,
};
use fibreflow_parallel::Communicator;

fn material(strength: f64) -> Material {
    Material {
        strength,
        ..Material::new(0.01, 1e6, 0.3, 1000.0)
    }
}

fn system(fibres: Vec<Fibre>, settings: FibreSettings) -> FibreSystem {
    FibreSystem::new(Communicator::single(), settings, fibres).expect("valid")
}

fn implicit() -> FibreSettings {
    FibreSettings {
        integrator: Integrator::Implicit(ImplicitSettings {
            linear: false,
            tolerance: f64::INFINITY,
        }),
        ..FibreSettings::default()
    }
}

/// Under a load P at the tip of a cantilever the first inner node bends most: it breaks at 4P(L − h)/(πr³) = strength.
#[test]
fn a_cantilever_breaks_beside_its_clamp_at_the_load_of_its_strength() {
    let n = 10;
    for kinematics in [Kinematics::Full, Kinematics::TwistFree] {
        let breaks_under = |share: f64| {
            let strength = 1e3;
            let m = material(strength);
            let mut fibre = Fibre::straight(5, m, Vector3::zeros(), Vector3::x(), n);
            fibre.supports = vec![Support::clamp(0)];
            fibre.kinematics = kinematics;
            let load = strength * std::f64::consts::PI * m.radius.powi(3) / 4.0 / 0.9;
            let mut s = system(vec![fibre], implicit());
            s.add_load(5, n, Vector3::y() * (load * share), Vector3::zeros())
                .expect("tip");
            for _ in 0..20 {
                s.advance_free(1e4).expect("finite");
            }
            let count = s.break_up().expect("ids");
            (count, s)
        };
        assert_eq!(breaks_under(0.98).0, 0, "{kinematics:?}");
        let (count, s) = breaks_under(1.02);
        assert_eq!(count, 1, "{kinematics:?}");
        let lengths: Vec<usize> = s.offsets().windows(2).map(|o| o[1] - o[0]).collect();
        assert_eq!(lengths, [2, n]);
        assert_eq!([s.id(0), s.id(1)], [5, 6]);
        // The second part carries the load away, the first one stays.
        let mut s = s;
        s.advance_free(1.0).expect("finite");
        assert!(s.velocities()[s.velocities().len() - 1].y > 0.0);
        assert!(s.positions()[1].y.abs() < 1e-3);
    }
}

#[test]
fn a_pulled_fibre_breaks_at_its_tensile_strength() {
    let m = material(1e4);
    let n = 6;
    for (share, expected) in [(0.99, 0), (1.01, 1)] {
        let mut fibre = Fibre::straight(0, m, Vector3::zeros(), Vector3::x(), n);
        fibre.supports = vec![Support::clamp(0)];
        let mut s = system(vec![fibre], implicit());
        let pull = Vector3::x() * (1e4 * m.area() * share);
        s.add_load(0, n, pull, Vector3::zeros()).expect("tip");
        for _ in 0..10 {
            s.advance_free(1e4).expect("finite");
        }
        assert_eq!(s.break_up().expect("ids"), expected);
    }
}

/// A bent fibre that snaps open breaks on the way: mass and momentum stay, no energy comes from nowhere, parts that were one do
/// not push each other away, and a resumed run is the same.
#[test]
fn breaking_loses_neither_mass_nor_momentum() {
    let n = 12;
    let build = |strength: f64| {
        let node = |i: usize| {
            let a = 1.5 * i as f64 / n as f64;
            Vector3::new(a.sin() / 1.5, (1.0 - a.cos()) / 1.5, 0.0)
        };
        let mut fibre = Fibre::new(2, material(strength), (0..=n).map(node).collect());
        fibre.equilibrium = Equilibrium::Straight;
        let other = Fibre::straight(
            1,
            material(f64::INFINITY),
            Vector3::new(0.0, 0.0, 0.5),
            Vector3::new(1.0, 0.0, 0.5),
            4,
        );
        let settings = FibreSettings {
            contacts: Some(ContactSettings {
                damping: NormalDamping::Ratio(0.1),
                friction: 0.3,
                ..ContactSettings::new(1e4, 0.01)
            }),
            budget: true,
            ..FibreSettings::default()
        };
        let mut s = system(vec![fibre, other], settings);
        let rotation = Vector3::new(0.0, 0.0, 3.0);
        let positions = s.positions().to_vec();
        for (v, x) in s.velocities_mut().iter_mut().zip(&positions) {
            *v = rotation.cross(x);
        }
        s
    };
    let run = |s: &mut FibreSystem, steps: usize| {
        let mut breaks = 0;
        for _ in 0..steps {
            s.advance_free(1e-3).expect("finite");
            breaks += s.break_up().expect("ids");
        }
        breaks
    };
    let total =
        |s: &FibreSystem| s.energy().total() + s.contacts().expect("on").statistics().stored_energy;
    // E κ r = 1.5e4 where it is bent.
    let mut s = build(1.2e4);
    let (mass, momentum, energy) = (s.mass(), s.momentum(), total(&s));
    let first = run(&mut s, 5);
    assert!(first >= 1, "{first}");
    assert!((s.mass() / mass - 1.0).abs() < 1e-13);
    assert!((s.momentum() - momentum).norm() < 1e-11 * momentum.norm());
    println!("breaks {first}, energy {} of {energy}", total(&s));
    assert!(total(&s) < 1.002 * energy && total(&s) > 0.95 * energy);
    let mut resumed = build(1.2e4);
    resumed.restore(s.state()).expect("own record");
    let more = run(&mut s, 40);
    assert_eq!(run(&mut resumed, 40), more);
    assert_eq!(s.positions(), resumed.positions());
    assert_eq!(s.fibres(), 2 + first + more);
    assert!((s.momentum() - momentum).norm() < 1e-9 * momentum.norm());
    assert!(total(&s) < 1.005 * energy, "{} {energy}", total(&s));
    let budget = s.budget().expect("on");
    println!("budget {:e} of {:e}", budget.residual(), budget.largest());
    // Masses are lumped anew at every break.
    assert!(budget.residual().abs() < 4e-3 * energy);
}

#[test]
fn without_a_strength_nothing_breaks() {
    let mut fibre = Fibre::straight(
        0,
        material(f64::INFINITY),
        Vector3::zeros(),
        Vector3::x(),
        4,
    );
    fibre.nodes[2].y = 0.4;
    fibre.equilibrium = Equilibrium::Straight;
    let mut s = system(vec![fibre], implicit());
    assert_eq!(s.break_up().expect("ids"), 0);
}
