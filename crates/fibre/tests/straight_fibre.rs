//! Split constants: what a straight fibre's slip costs in its mean and in its linear part.

use fibreflow_fibre::contact::ContactSettings;
use fibreflow_fibre::hydrodynamics::{
    AmbientFlow, DragModel, FluidProperties, SlenderConstants, TorqueModel,
};
use fibreflow_fibre::{
    Equilibrium, Fibre, FibreSettings, FibreSystem, Hydrodynamics, ImplicitSettings, Inside,
    Integrator, Kinematics, Material, Matrix3, Points, Support, Vector3,
};
use fibreflow_parallel::Communicator;
use std::f64::consts::{LN_2, PI};

fn settings(drag: DragModel, torque: TorqueModel, integrator: Integrator) -> FibreSettings {
    FibreSettings {
        hydrodynamics: Some(Hydrodynamics {
            fluid: FluidProperties {
                density: 1.0,
                viscosity: 1.0,
            },
            drag,
            torque,
            point_spacing: f64::INFINITY,
        }),
        integrator,
        ..FibreSettings::default()
    }
}

const IMPLICIT: Integrator = Integrator::Implicit(ImplicitSettings {
    linear: false,
    tolerance: 1e-3,
});

/// Force on the flow and moment of it about the middle, of a straight fibre of diameter 1 along `axis` whose nodes are all held.
fn held(
    drag: DragModel,
    integrator: Integrator,
    axis: Vector3,
    segments: usize,
    flow: &AmbientFlow,
) -> (Vector3, Vector3) {
    let material = Material::new(0.5, 1e3, 0.3, 1.0);
    let mut fibre = Fibre::straight(0, material, axis * -0.5, axis * 0.5, segments);
    fibre.supports = (0..=segments).map(Support::clamp).collect();
    let settings = settings(drag, TorqueModel::None, integrator);
    let mut s =
        FibreSystem::new(Communicator::single(), settings, vec![fibre]).expect("valid fibre");
    let mut points = Points::default();
    s.points(&mut points);
    let reaction = s.advance_in_flow(flow, 1e-3).expect("finite");
    let pairs = points.position.iter().zip(&reaction.force);
    let torque = pairs.map(|(x, f)| x.cross(f)).sum();
    (reaction.force.iter().sum(), torque)
}

/// Drag across πμL·4/(ln 2r_p + ln 2 − 1/2), torque across πμL³γ̇/3 /(ln 2r_p + ln 2 − 11/6), for any number of segments
/// and either integrator.
#[test]
fn drag_and_torque_are_batchelors() {
    let shear = AmbientFlow::Shear { rate: 1.0 };
    let stream = AmbientFlow::Uniform(Vector3::x());
    for drag in [
        DragModel::SlenderBody(SlenderConstants::Split),
        DragModel::SlenderBody(SlenderConstants::Ends),
    ] {
        for r_p in [10.0, 50.0, 200.0_f64] {
            let logarithm = (2.0 * r_p).ln() + LN_2;
            for segments in [1, 4, 64] {
                for integrator in [Integrator::Explicit, IMPLICIT] {
                    let axis = Vector3::y() * r_p;
                    let (_, torque) = held(drag, integrator, axis, segments, &shear);
                    let expected = PI * r_p.powi(3) / 3.0 / (logarithm - 11.0 / 6.0);
                    // The flow turns about −z, and so does what the fibre does to it about +z.
                    assert!((torque.z / expected - 1.0).abs() < 1e-12, "{torque}");
                    let (force, _) = held(drag, integrator, axis, segments, &stream);
                    let expected = 4.0 * PI * r_p / (logarithm - 0.5);
                    let allowed = match drag {
                        DragModel::SlenderBody(SlenderConstants::Split) => 1e-12,
                        _ => 0.8 / logarithm.powi(2),
                    };
                    let error = (-force.x / expected - 1.0).abs();
                    assert!(error < allowed, "{drag:?} {r_p} {segments}: {error}");
                }
            }
        }
    }
}

/// Half a circle: the split has gone. Between, it goes without a step.
#[test]
fn a_bent_fibre_has_local_drag() {
    let torque = |angle: f64, constants| {
        let nodes = (0..=20).map(|i| {
            let a = angle * (f64::from(i) / 20.0 - 0.5);
            Vector3::new(10.0 / angle * a.sin(), 10.0 / angle * (1.0 - a.cos()), 0.0)
        });
        let mut fibre = Fibre::new(0, Material::new(0.05, 1e3, 0.3, 1.0), nodes.collect());
        fibre.equilibrium = Equilibrium::Placed;
        fibre.supports = (0..=20).map(Support::clamp).collect();
        let drag = DragModel::SlenderBody(constants);
        let settings = settings(drag, TorqueModel::None, Integrator::Explicit);
        let mut s = FibreSystem::new(Communicator::single(), settings, vec![fibre]).expect("valid");
        let mut points = Points::default();
        s.points(&mut points);
        let flow = AmbientFlow::PlanarExtension { rate: 1.0 };
        let reaction = s.advance_in_flow(&flow, 1e-3).expect("finite");
        let pairs = points.position.iter().zip(&reaction.force);
        pairs.map(|(x, f)| x.x * f.x).sum::<f64>()
    };
    let ratio =
        |angle| torque(angle, SlenderConstants::Split) / torque(angle, SlenderConstants::Batchelor);
    assert!((ratio(PI) - 1.0).abs() < 1e-12);
    let straight = ratio(1e-3);
    assert!(straight > 1.3, "{straight}");
    let mut last = straight;
    for k in 1..=60 {
        let now = ratio(0.05 * f64::from(k));
        assert!(
            (now - last).abs() < 0.1 * (straight - 1.0),
            "{k}: {last} {now}"
        );
        last = now;
    }
}

/// What free fibres take the flow loses, also with the part of the drag that ties all points of a fibre.
#[test]
fn split_drag_keeps_momentum() {
    let flow = AmbientFlow::Vortex {
        velocity: 3.0,
        wavelength: 5.0,
    };
    for (drag, integrator) in [
        (
            DragModel::SlenderBody(SlenderConstants::Split),
            Integrator::Explicit,
        ),
        (
            DragModel::Auto(SlenderConstants::Split),
            Integrator::Explicit,
        ),
        (
            DragModel::Auto(SlenderConstants::Ends),
            Integrator::Explicit,
        ),
        (DragModel::Auto(SlenderConstants::Split), IMPLICIT),
    ] {
        for rigid in [false, true] {
            let material = Material::new(0.05, 1e4, 0.3, 5.0);
            let mut fibres: Vec<Fibre> = (0..2)
                .map(|k| {
                    let start = Vector3::new(f64::from(k), 0.3, 0.1);
                    let end = start + Vector3::new(0.8, 1.5, 0.7);
                    Fibre::straight(k as u64, material, start, end, 7)
                })
                .collect();
            for fibre in &mut fibres {
                fibre.kinematics = if rigid {
                    Kinematics::Rigid
                } else {
                    Kinematics::Full
                };
            }
            let settings = settings(drag, TorqueModel::default(), integrator);
            let mut s = FibreSystem::new(Communicator::single(), settings, fibres).expect("valid");
            let start = s.momentum();
            let (mut given, mut size) = (Vector3::zeros(), 0.0);
            for _ in 0..50 {
                let reaction = s.advance_in_flow(&flow, 0.02).expect("finite");
                given += reaction.force.iter().sum::<Vector3>() * 0.02;
                size += reaction.force.iter().map(|f| f.norm()).sum::<f64>() * 0.02;
            }
            let defect = (s.momentum() - start + given).norm() / size;
            println!("{drag:?}, {integrator:?}, rigid {rigid}: defect {defect:.1e}");
            assert!(defect < 1e-13);
        }
    }
}

/// The explicit and the implicit integrator, and a rigid body, agree on a light stiff fibre in a shear flow with split drag.
#[test]
fn integrators_agree_on_split_drag() {
    let turned = |integrator, rigid, dt: f64| {
        let material = Material::new(0.5, 3e6, 0.3, 0.05);
        let axis = Vector3::new(0.2, 1.0, 0.4).normalize() * 20.0;
        let mut fibre = Fibre::straight(0, material, axis * -0.5, axis * 0.5, 6);
        fibre.kinematics = if rigid {
            Kinematics::Rigid
        } else {
            Kinematics::Full
        };
        let split = SlenderConstants::Split;
        let settings = settings(
            DragModel::SlenderBody(split),
            TorqueModel::Jeffery(split),
            integrator,
        );
        let mut s = FibreSystem::new(Communicator::single(), settings, vec![fibre]).expect("valid");
        for _ in 0..(2.0 / dt).round() as usize {
            s.advance_in_flow(&AmbientFlow::Shear { rate: 1.0 }, dt)
                .expect("finite");
        }
        s.end_to_end(0).normalize()
    };
    let body = turned(IMPLICIT, true, 0.01);
    let implicit = turned(IMPLICIT, false, 0.01);
    let explicit = [0.01, 0.005].map(|dt| turned(Integrator::Explicit, false, dt));
    let errors = explicit.map(|e| (e - implicit).norm());
    println!(
        "rigid {:.1e}, explicit {errors:?}",
        (body - implicit).norm()
    );
    assert!((body - implicit).norm() < 1e-3);
    assert!(errors[0] < 5e-3 && errors[1] < 0.6 * errors[0]);
}

/// S of a straight fibre in a linear flow G: held, L³/12 of the traceless symmetric part of p (Z G p); free, where it turns
/// with the flow across itself, ζ∥L³/12 (p·E·p)(pp − I/3) (Batchelor 1971, K 6.1).
#[test]
fn particle_stress_is_that_of_slender_bodies() {
    let (r_p, rate) = (50.0_f64, 2.0);
    let p = Vector3::new(0.6, 0.64, 0.48);
    let mut gradient = Matrix3::zeros();
    gradient[(0, 1)] = rate;
    let traceless = |s: Matrix3| {
        let s = (s + s.transpose()) * 0.5;
        s - Matrix3::from_diagonal_element(s.trace() / 3.0)
    };
    for constants in [SlenderConstants::Batchelor, SlenderConstants::Split] {
        let zeta = constants
            .linear_part(r_p, 1.0)
            .unwrap_or(constants.resistance(r_p, 1.0));
        for (is_held, integrator) in [
            (true, Integrator::Explicit),
            (true, IMPLICIT),
            (false, IMPLICIT),
        ] {
            let material = Material::new(0.5, 1e3, 0.3, 1e-6);
            // Away from the origin: the mean slip and its force must not count.
            let centre = if is_held {
                Vector3::new(3.0, -40.0, 7.0)
            } else {
                Vector3::zeros()
            };
            let half = p * (0.5 * r_p);
            let mut fibre = Fibre::straight(0, material, centre - half, centre + half, 6);
            fibre.kinematics = if is_held {
                Kinematics::Full
            } else {
                Kinematics::Rigid
            };
            if is_held {
                fibre.supports = (0..=6).map(Support::clamp).collect();
            }
            let drag = DragModel::SlenderBody(constants);
            let settings = settings(drag, TorqueModel::None, integrator);
            let mut s =
                FibreSystem::new(Communicator::single(), settings, vec![fibre]).expect("valid");
            // The second step has no start in it.
            for _ in 0..2 {
                s.advance_in_flow(&AmbientFlow::Shear { rate }, 1e-5)
                    .expect("finite");
            }
            let volume = r_p.powi(3) / 12.0;
            let expected = if is_held {
                traceless(p * zeta.force(&p, &(gradient * p)).transpose() * volume)
            } else {
                traceless(p * p.transpose() * (zeta.axial * volume * p.dot(&(gradient * p))))
            };
            let error =
                (s.particle_stress(&Inside::EVERYWHERE) - expected).norm() / expected.norm();
            println!("{constants:?}, held {is_held}: {error:.1e}");
            assert!(error < if is_held { 1e-12 } else { 1e-3 });
            assert!((p.transpose() * s.particle_stress(&Inside::EVERYWHERE) * p)[0] > 0.0);
        }
    }
}

/// Two fibres pressed on each other by a flow, in the joint implicit step: the part of rank three is in its matrix too. At a low mass drag is
/// most of the matrix; without that part the iteration would have to find it.
#[test]
fn touching_fibres_with_split_drag_keep_momentum() {
    let material = Material::new(0.02, 1e6, 0.3, 1e-3);
    let half = Vector3::new(0.5, 0.0, 0.1);
    let low = Fibre::straight(1, material, -half, half, 8);
    let (lift, across) = (Vector3::new(0.13, 0.05, 0.0), Vector3::new(0.1, 0.0, 0.5));
    let high = Fibre::straight(2, material, lift - across, lift + across, 8);
    let split = DragModel::SlenderBody(SlenderConstants::Split);
    let mut settings = settings(split, TorqueModel::default(), IMPLICIT);
    settings.contacts = Some(ContactSettings::new(2e3, 0.02));
    let mut s = FibreSystem::new(Communicator::single(), settings, vec![low, high]).expect("valid");
    let flow = AmbientFlow::PlanarExtension { rate: 1.0 };
    let (start, mut given, mut size) = (s.momentum(), Vector3::zeros(), 0.0);
    let mut touched = false;
    for _ in 0..40 {
        let reaction = s.advance_in_flow(&flow, 0.02).expect("an answer");
        given += reaction.force.iter().sum::<Vector3>() * 0.02;
        size += reaction.force.iter().map(|f| f.norm()).sum::<f64>() * 0.02;
        touched |= s.contacts().expect("on").statistics().contacts > 0;
    }
    let defect = (s.momentum() - start + given).norm() / size;
    println!("touching: defect {defect:.1e}");
    assert!(touched && defect < 1e-7);
}
