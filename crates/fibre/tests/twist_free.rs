//! Fibres without twist unknowns do what full beams do, where nothing twists (validation rows B1, B4, B5).

use fibreflow_fibre::contact::{ContactSettings, NormalDamping, Wall};
use fibreflow_fibre::hydrodynamics::{
    AmbientFlow, DragModel, FluidProperties, SlenderConstants, TorqueModel, cox_aspect_ratio,
};
use fibreflow_fibre::{
    Equilibrium, Fibre, FibreError, FibreSettings, FibreSystem, Hydrodynamics, ImplicitSettings,
    Integrator, Kinematics, Material, Matrix3, Support, Vector3,
};
use fibreflow_parallel::Communicator;
use std::f64::consts::PI;

const ONE_STEP: ImplicitSettings = ImplicitSettings {
    linear: false,
    tolerance: f64::INFINITY,
};

fn material(radius: f64) -> Material {
    let unit = Material::new(radius, 1.0, 0.3, 1.0);
    Material::new(radius, 1.0 / unit.second_moment(), 0.3, 1.0 / unit.area())
}

fn settings(implicit: ImplicitSettings) -> FibreSettings {
    FibreSettings {
        integrator: Integrator::Implicit(implicit),
        ..FibreSettings::default()
    }
}

fn system(fibre: Fibre, settings: FibreSettings) -> FibreSystem {
    FibreSystem::new(Communicator::single(), settings, vec![fibre]).expect("valid fibre")
}

fn cantilever(segments: usize, kinematics: Kinematics, radius: f64) -> Fibre {
    let mut fibre = Fibre::straight(
        3,
        material(radius),
        Vector3::zeros(),
        Vector3::x(),
        segments,
    );
    fibre.supports = vec![Support::clamp(0)];
    fibre.kinematics = kinematics;
    fibre
}

fn tip(s: &FibreSystem) -> Vector3 {
    s.positions()[s.positions().len() - 1]
}

#[test]
fn a_large_load_gives_the_elastica_at_second_order() {
    // Inextensible elastica at PL²/EI = 5 (Bisshopp & Drucker 1945).
    let reference = Vector3::new(0.612_37, 0.713_79, 0.0);
    let error = |segments: usize| {
        let fibre = cantilever(segments, Kinematics::TwistFree, 0.002);
        let mut s = system(fibre, settings(ONE_STEP));
        s.add_load(3, segments, Vector3::y() * 5.0, Vector3::zeros())
            .expect("tip");
        for _ in 0..40 {
            s.advance_free(1e3).expect("finite");
        }
        (tip(&s) - reference).norm()
    };
    let errors = [8, 16, 32].map(error);
    println!("elastica: {errors:?}");
    assert!(errors[2] < 1e-3);
    let order = 0.5 * (errors[0] / errors[2]).log2();
    assert!((1.8..2.3).contains(&order), "{order}");
}

#[test]
fn a_torque_at_the_tip_bends_it_to_a_circle() {
    let n = 32;
    let mut s = system(
        cantilever(n, Kinematics::TwistFree, 0.01),
        settings(ONE_STEP),
    );
    s.add_load(3, n, Vector3::zeros(), Vector3::z() * 1.5)
        .expect("tip");
    for _ in 0..40 {
        s.advance_free(1e3).expect("finite");
    }
    let expected = Vector3::new(1.5_f64.sin(), 1.0 - 1.5_f64.cos(), 0.0) / 1.5;
    let error = (tip(&s) - expected).norm();
    println!("circle: {error:.1e}");
    assert!(error < 2e-2);
    assert!((s.energy().elastic.bending / (0.5 * 1.5 * 1.5) - 1.0).abs() < 0.06);
}

/// A bent fibre that springs and tumbles freely: the answer of the full beam, momentum kept, order two.
#[test]
fn free_flight_is_that_of_the_full_beam() {
    let build = |kinematics: Kinematics, n: usize, radius: f64| {
        let node = |i: usize| {
            let a = 0.8 * i as f64 / n as f64;
            Vector3::new(a.sin() / 0.8, (1.0 - a.cos()) / 0.8, 0.1 * a)
        };
        let mut fibre = Fibre::new(3, material(radius), (0..=n).map(node).collect());
        fibre.equilibrium = Equilibrium::Straight;
        fibre.kinematics = kinematics;
        let mut s = system(fibre, settings(ONE_STEP));
        let positions = s.positions().to_vec();
        for (v, x) in s.velocities_mut().iter_mut().zip(&positions) {
            *v = Vector3::new(0.1, 0.0, 0.7).cross(x) + Vector3::y();
        }
        for w in s.angular_velocities_mut() {
            *w = Vector3::new(0.1, 0.0, 0.7);
        }
        s
    };
    let run = |kinematics: Kinematics, n: usize, radius: f64, steps: usize| {
        let mut s = build(kinematics, n, radius);
        let (p, l) = (s.momentum(), s.angular_momentum());
        for _ in 0..steps {
            s.advance_free(0.2 / steps as f64).expect("finite");
        }
        assert!((s.momentum() - p).norm() < 1e-9 * p.norm());
        let turned = (s.angular_momentum() - l).norm() / l.norm();
        (s.positions().to_vec(), turned)
    };
    let distance = |a: &[Vector3], b: &[Vector3]| {
        let all = a.iter().zip(b).map(|(x, y)| (x - y).norm());
        all.fold(0.0, f64::max)
    };
    let (full, _) = run(Kinematics::Full, 32, 0.01, 800);
    let (chain, turned) = run(Kinematics::TwistFree, 32, 0.01, 800);
    let apart = distance(&full, &chain);
    println!("free flight: {apart:.1e}, angular momentum {turned:.1e}");
    assert!(apart < 1e-3 && turned < 1e-4);
    let (coarse, _) = run(Kinematics::TwistFree, 6, 0.05, 6400);
    let errors = [400, 800].map(|n| distance(&run(Kinematics::TwistFree, 6, 0.05, n).0, &coarse));
    println!("in the step: {errors:?}");
    assert!((3.0..6.0).contains(&(errors[0] / errors[1])));
}

fn water(spacing: f64, constants: SlenderConstants) -> Hydrodynamics {
    Hydrodynamics {
        fluid: FluidProperties {
            density: 1000.0,
            viscosity: 1e-3,
        },
        drag: DragModel::SlenderBody(constants),
        torque: TorqueModel::Jeffery(constants),
        point_spacing: spacing,
    }
}

/// B4, the history of a ringing clamped fibre in an oscillating flow of 20 steps a period.
#[test]
fn a_stiff_fibre_follows_an_oscillating_flow() {
    let history = |kinematics: Kinematics, parts: usize, implicit: ImplicitSettings| {
        let (step, period, diameter) = (1e-4, 2e-3, 24e-6);
        let length = 50.0 * diameter;
        let m = Material::new(0.5 * diameter, 20e9, 0.3, 2300.0);
        let mut fibre = Fibre::straight(3, m, Vector3::zeros(), Vector3::x() * length, 32);
        fibre.supports = vec![Support::clamp(0)];
        fibre.kinematics = kinematics;
        let mut s = system(
            fibre,
            FibreSettings {
                hydrodynamics: Some(water(f64::INFINITY, SlenderConstants::Batchelor)),
                ..settings(implicit)
            },
        );
        let part = step / parts as f64;
        let mut deflections = Vec::new();
        for k in 0..100 * parts {
            let flow = |_: &Vector3, moment: f64| {
                let phase = 2.0 * PI * (k as f64 + moment) * part / period;
                (Vector3::y() * 0.05 * phase.sin(), Matrix3::zeros())
            };
            s.advance_in(&flow, part).expect("finite");
            if (k + 1) % parts == 0 {
                deflections.push(tip(&s).y / length);
            }
        }
        deflections
    };
    let converged = history(Kinematics::Full, 64, ONE_STEP);
    let controlled = history(Kinematics::TwistFree, 1, ImplicitSettings::default());
    let square: f64 = converged.iter().map(|y| y * y).sum();
    let pairs = converged.iter().zip(&controlled);
    let apart: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
    let error = (apart / square).sqrt();
    println!("history: {error:.1e}");
    assert!(error < 1e-2);
}

/// Jeffery's period with every set of constants, torque on; the fluid gets what the fibre takes.
#[test]
fn a_stiff_fibre_keeps_jefferys_period() {
    for constants in [SlenderConstants::Batchelor, SlenderConstants::Split] {
        let (ratio, rate, segments) = (20.0, 10.0, 8);
        let diameter = 5e-5;
        let length = ratio * diameter;
        let m = Material::new(0.5 * diameter, 1e9, 0.3, 1000.0);
        let start = Vector3::new(0.0, -0.5 * length, 0.0);
        let mut fibre = Fibre::straight(3, m, start, -start, segments);
        fibre.kinematics = Kinematics::TwistFree;
        let mut law = water(f64::INFINITY, constants);
        law.fluid.viscosity = 1.0;
        let mut s = system(
            fibre,
            FibreSettings {
                hydrodynamics: Some(law),
                ..settings(ONE_STEP)
            },
        );
        let r = cox_aspect_ratio(ratio);
        let period = 2.0 * PI * (r + 1.0 / r) / rate;
        let step = 0.02 / rate;
        let (mut time, mut angle, mut last) = (0.0, 0.0, PI / 2.0);
        let flow = AmbientFlow::Shear { rate };
        while angle < PI {
            let before = s.momentum();
            let reaction = s.advance_in_flow(&flow, step).expect("finite");
            let given: Vector3 = reaction.force.iter().sum();
            let size: f64 = reaction.force.iter().map(|f| f.norm()).sum();
            let gap = (s.momentum() - before + given * step).norm();
            assert!(gap < 1e-12 * size * step, "{gap}");
            let e = s.end_to_end(0);
            let now = e.y.atan2(e.x);
            let turned = (last - now).rem_euclid(PI);
            (angle, last, time) = (angle + turned, now, time + step);
            if angle >= PI {
                time -= step * (angle - PI) / turned;
            }
        }
        let error = 2.0 * time / period - 1.0;
        println!("{constants:?}: period off by {error:.1e}");
        assert!(error.abs() < 5e-3);
    }
}

/// Dropped on a floor, in the sub-steps of the contact: it lies there, and a resumed run is the same.
#[test]
fn it_touches_a_floor_and_resumes_bitwise() {
    let build = || {
        let m = Material::new(0.02, 1e6, 0.3, 500.0);
        let start = Vector3::new(0.0, 0.0, 0.05);
        let end = Vector3::new(0.5, 0.0, 0.12);
        let mut fibre = Fibre::straight(3, m, start, end, 6);
        fibre.kinematics = Kinematics::TwistFree;
        let settings = FibreSettings {
            gravity: Vector3::z() * -10.0,
            contacts: Some(ContactSettings {
                damping: NormalDamping::Ratio(0.5),
                friction: 0.3,
                tangential_ratio: 0.5,
                walls: vec![Wall::plane(Vector3::zeros(), Vector3::z())],
                ..ContactSettings::new(1e3, 0.02)
            }),
            ..FibreSettings::default()
        };
        system(fibre, settings)
    };
    let run = |s: &mut FibreSystem, steps: usize| {
        for _ in 0..steps {
            s.advance_free(2e-3).expect("finite");
        }
    };
    let mut s = build();
    run(&mut s, 50);
    let mut resumed = build();
    resumed.restore(s.state()).expect("own record");
    run(&mut s, 450);
    run(&mut resumed, 450);
    assert_eq!(s.positions(), resumed.positions());
    assert!(
        s.positions().iter().all(|x| (x.z - 0.02).abs() < 2e-3),
        "{:?}",
        s.positions()
    );
    assert!(s.energy().kinetic < 1e-6);
}

#[test]
fn what_twists_cannot_be_twist_free() {
    let refused = |change: &dyn Fn(&mut Fibre)| {
        let mut fibre = cantilever(4, Kinematics::TwistFree, 0.01);
        change(&mut fibre);
        let made = FibreSystem::new(Communicator::single(), settings(ONE_STEP), vec![fibre]);
        matches!(made.err(), Some(FibreError::TwistFree { fibre: 3, .. }))
    };
    assert!(!refused(&|_| ()));
    assert!(refused(&|f| f.nodes[2].y += 0.1));
    assert!(refused(&|f| f.twist = 0.2));
    assert!(refused(&|f| {
        f.material.bending_ratio = 2.0;
        f.section_axis = Vector3::y();
    }));
    assert!(refused(&|f| f.material.shear = true));
}
