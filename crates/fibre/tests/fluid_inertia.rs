//! Added mass and the acceleration of the flow: free fall, a stream that speeds up, vibration in a liquid.

use fibreflow_fibre::hydrodynamics::{AmbientFlow, DragModel, FluidProperties, TorqueModel};
use fibreflow_fibre::{
    Fibre, FibreError, FibreSettings, FibreSystem, Hydrodynamics, ImplicitSettings, Integrator,
    Kinematics, Material, Matrix3, Support, Vector3,
};
use fibreflow_parallel::Communicator;

const SOLID: f64 = 2.0;
const LIQUID: f64 = 3.0;
const IMPLICIT: Integrator = Integrator::Implicit(ImplicitSettings {
    linear: false,
    tolerance: 1e-4,
});

fn settings(drag: DragModel, integrator: Integrator, fluid_inertia: bool) -> FibreSettings {
    FibreSettings {
        hydrodynamics: Some(Hydrodynamics {
            fluid: FluidProperties {
                density: LIQUID,
                viscosity: 1e-3,
            },
            drag,
            torque: TorqueModel::None,
            point_spacing: f64::INFINITY,
        }),
        integrator,
        fluid_inertia,
        ..FibreSettings::default()
    }
}

fn system(fibre: Fibre, settings: FibreSettings) -> FibreSystem {
    FibreSystem::new(Communicator::single(), settings, vec![fibre]).expect("a valid fibre")
}

fn straight(along: Vector3, modulus: f64, segments: usize) -> Fibre {
    let material = Material::new(0.01, modulus, 0.3, SOLID);
    Fibre::straight(0, material, along * -0.5, along * 0.5, segments)
}

/// Without drag, a straight fibre falls with g along itself and with g ρ_s/(ρ_s + ρ_f) across (its weight whole: buoyancy is another setting).
#[test]
fn a_fibre_falls_with_the_mass_it_carries() {
    for (integrator, kinematics) in [
        (Integrator::Explicit, Kinematics::Full),
        (IMPLICIT, Kinematics::Full),
        (IMPLICIT, Kinematics::TwistFree),
    ] {
        for (along, expected) in [
            (Vector3::z(), 1.0),
            (Vector3::x(), SOLID / (SOLID + LIQUID)),
        ] {
            let mut settings = settings(DragModel::None, integrator, true);
            settings.gravity = Vector3::new(0.0, 0.0, -4.0);
            let mut fibre = straight(along, 1e6, 8);
            fibre.kinematics = kinematics;
            let mut s = system(fibre, settings);
            for _ in 0..10 {
                s.advance_in_flow(&AmbientFlow::Quiescent, 1e-3)
                    .expect("an answer");
            }
            let fallen = s.momentum().z / s.mass() / (-4.0 * 0.01);
            println!("{integrator:?}, {kinematics:?}, along {along:?}: {fallen}");
            assert!((fallen / expected - 1.0).abs() < 2e-3);
        }
    }
}

/// One as heavy as the liquid goes with a stream that speeds up, however it lies, with no drag at all; without the fluid's inertia it
/// stays.
#[test]
fn a_fibre_as_heavy_as_the_liquid_goes_with_the_stream() {
    let along = Vector3::new(0.6, 0.0, 0.8);
    for integrator in [Integrator::Explicit, IMPLICIT] {
        for inertia in [false, true] {
            let mut fibre = straight(along, 1e6, 8);
            fibre.material.density = LIQUID;
            let mut s = system(fibre, settings(DragModel::None, integrator, inertia));
            let dt = 1e-3;
            for k in 0..10 {
                let speed = move |moment: f64| 3.0 * dt * (f64::from(k) + moment);
                s.advance_in(
                    &|_, moment| (Vector3::x() * speed(moment), Matrix3::zeros()),
                    dt,
                )
                .expect("an answer");
            }
            let part = s.momentum() / s.mass() / (3.0 * 10.0 * dt);
            let expected = if inertia {
                Vector3::x()
            } else {
                Vector3::zeros()
            };
            assert!((part - expected).norm() < 2e-3, "{integrator:?}: {part}");
        }
    }
}

/// The frequency of a clamped fibre falls by √(ρ_s/(ρ_s + ρ_f)).
#[test]
fn a_fibre_vibrates_more_slowly_in_a_liquid() {
    let period = |(integrator, kinematics), inertia, dt: f64| {
        let mut fibre = straight(Vector3::x(), 1e4, 12);
        fibre.kinematics = kinematics;
        fibre.supports = vec![Support::clamp(0)];
        let mut s = system(fibre, settings(DragModel::None, integrator, inertia));
        let nodes = s.velocities().len();
        for (i, v) in s.velocities_mut().iter_mut().enumerate() {
            let x = i as f64 / (nodes - 1) as f64;
            *v = Vector3::z() * 1e-3 * x * x * (6.0 - 4.0 * x + x * x);
        }
        let (mut time, mut last, mut crossings) = (0.0, 0.0, Vec::new());
        while crossings.len() < 3 {
            s.advance_in_flow(&AmbientFlow::Quiescent, dt)
                .expect("an answer");
            let tip = s.positions()[nodes - 1].z;
            time += dt;
            if last * tip < 0.0 {
                crossings.push(time - dt * tip / (tip - last));
            }
            last = tip;
        }
        crossings[2] - crossings[0]
    };
    // ω = 3.516 √(EI/m)/L², √(EI/m) = ½ r √(E/ρ).
    let dry = 2.0 * std::f64::consts::PI / (3.516 * 0.005 * (1e4 / SOLID).sqrt());
    for kind in [
        (Integrator::Explicit, Kinematics::Full),
        (IMPLICIT, Kinematics::Full),
        (IMPLICIT, Kinematics::TwistFree),
    ] {
        let ratio = period(kind, true, dry / 400.0) / dry;
        let expected = ((SOLID + LIQUID) / SOLID).sqrt();
        println!("{kind:?}: {ratio} {expected}");
        assert!((period(kind, false, dry / 400.0) / dry - 1.0).abs() < 5e-3);
        assert!((ratio / expected - 1.0).abs() < 5e-3);
    }
}

/// What the fibre gains the flow loses, added mass and pressure gradient with it.
#[test]
fn the_fluids_inertia_keeps_momentum() {
    let flow = AmbientFlow::Vortex {
        velocity: 0.3,
        wavelength: 1.5,
    };
    for integrator in [Integrator::Explicit, IMPLICIT] {
        let fibre = straight(Vector3::new(0.6, 0.5, 0.62), 1e4, 7);
        let mut s = system(fibre, settings(DragModel::default(), integrator, true));
        let (start, dt) = (s.momentum(), 0.01);
        let (mut given, mut size) = (Vector3::zeros(), 0.0);
        for _ in 0..40 {
            let reaction = s.advance_in_flow(&flow, dt).expect("an answer");
            given += reaction.force.iter().sum::<Vector3>() * dt;
            size += reaction.force.iter().map(|f| f.norm()).sum::<f64>() * dt;
        }
        let defect = (s.momentum() - start + given).norm() / size;
        println!("{integrator:?}: defect {defect:.1e}");
        assert!(defect < 1e-12);
    }
}

#[test]
fn a_rigid_fibre_with_the_fluids_inertia_is_refused() {
    let mut fibre = straight(Vector3::x(), 1e4, 4);
    fibre.kinematics = Kinematics::Rigid;
    let settings = settings(DragModel::None, IMPLICIT, true);
    let made = FibreSystem::new(Communicator::single(), settings, vec![fibre]);
    assert!(matches!(made, Err(FibreError::RigidInertia { fibre: 0 })));
}
