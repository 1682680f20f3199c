//! Fibres in given flows: momentum balance, terminal velocity, Jeffery orbits (validation row C2, one-way).

use fibreflow_fibre::hydrodynamics::{
    AmbientFlow, DragModel, FluidProperties, SlenderConstants, TorqueModel, cox_aspect_ratio,
};
use fibreflow_fibre::{
    Equilibrium, Fibre, FibreError, FibreSettings, FibreSystem, Hydrodynamics, Material, Points,
    Support, Vector3,
};
use fibreflow_parallel::Communicator;
use std::f64::consts::PI;

const SLENDER: DragModel = DragModel::SlenderBody(SlenderConstants::Batchelor);

fn hydrodynamics(drag: DragModel, torque: TorqueModel) -> Hydrodynamics {
    Hydrodynamics {
        fluid: FluidProperties {
            density: 1.0,
            viscosity: 1.0,
        },
        drag,
        torque,
        point_spacing: f64::INFINITY,
    }
}

fn settings(drag: DragModel, torque: TorqueModel) -> FibreSettings {
    FibreSettings {
        hydrodynamics: Some(hydrodynamics(drag, torque)),
        ..FibreSettings::default()
    }
}

fn system(fibres: Vec<Fibre>, settings: FibreSettings) -> FibreSystem {
    FibreSystem::new(Communicator::single(), settings, fibres).expect("valid fibres")
}

fn helix(id: u64, segments: usize) -> Fibre {
    let nodes = (0..=segments)
        .map(|i| {
            let a = 0.3 * i as f64;
            Vector3::new(a.cos(), a.sin() + id as f64, 0.2 * a)
        })
        .collect();
    let mut fibre = Fibre::new(id, Material::new(0.05, 1e4, 0.3, 5.0), nodes);
    fibre.equilibrium = Equilibrium::Straight;
    fibre
}

#[test]
fn what_the_fibres_gain_the_fluid_and_the_outside_lose() {
    let flow = AmbientFlow::Vortex {
        velocity: 3.0,
        wavelength: 5.0,
    };
    for drag in [SLENDER, DragModel::InfiniteCylinder, DragModel::default()] {
        let mut settings = settings(drag, TorqueModel::default());
        settings.gravity = Vector3::new(0.0, 0.0, -2.0);
        settings.buoyant_density = 1.0;
        if let Some(law) = &mut settings.hydrodynamics {
            law.point_spacing = 0.1;
        }
        let mut s = system(vec![helix(4, 9), helix(1, 5)], settings);
        s.add_load(
            4,
            9,
            Vector3::new(0.3, 0.0, 0.1),
            Vector3::new(0.0, 0.1, 0.0),
        )
        .expect("tip");
        let start = s.momentum();
        let (mut given, mut outside, mut size) = (Vector3::zeros(), Vector3::zeros(), 0.0);
        let dt = 0.02;
        for _ in 0..50 {
            let applied = s.applied_force();
            let reaction = s.advance_in_flow(&flow, dt).expect("finite");
            given += reaction.force.iter().sum::<Vector3>() * dt;
            size += reaction.force.iter().map(|f| f.norm()).sum::<f64>() * dt;
            outside += applied * dt;
        }
        let defect = (s.momentum() - start + given - outside).norm() / size;
        println!("{drag:?}: defect {defect:.1e}");
        assert!(defect < 1e-13);
    }
}

/// A straight rigid fibre that settles level or upright reaches (weight per length)/ζ, and stays there with a mass so
/// small that it is at its terminal velocity at once.
#[test]
fn terminal_velocity_is_exact_also_without_inertia() {
    for density in [1.0, 1e-3] {
        for (axis, normal) in [(Vector3::x(), true), (Vector3::z(), false)] {
            let material = Material::new(0.02, 1e7, 0.3, density);
            let fibre = Fibre::straight(0, material, Vector3::zeros(), axis, 6);
            let mut settings = settings(SLENDER, TorqueModel::Kunhappan);
            settings.gravity = Vector3::new(0.0, 0.0, -3.0);
            let mut s = system(vec![fibre], settings);
            s.advance_in_flow(&AmbientFlow::Quiescent, 0.05)
                .expect("finite");
            s.advance_in_flow(&AmbientFlow::Quiescent, 0.05)
                .expect("finite");
            let r = SlenderConstants::Batchelor.resistance(25.0, 1.0);
            let zeta = if normal { r.normal } else { r.axial };
            let expected = -3.0 * density * material.area() / zeta;
            let mean = s.momentum().z / s.mass();
            assert!((mean / expected - 1.0).abs() < 1e-9, "{mean} {expected}");
        }
    }
}

#[test]
fn a_fibre_moves_and_turns_with_a_rigidly_turning_fluid() {
    // The vorticity of a shear flow with its strain taken off is not an AmbientFlow; turn it by hand.
    let omega = Vector3::new(0.2, -0.5, 1.0);
    let mut s = system(vec![helix(2, 8)], settings(SLENDER, TorqueModel::Kunhappan));
    let mut points = Points::default();
    let mut ambient = fibreflow_fibre::Ambient::default();
    for _ in 0..400 {
        s.points(&mut points);
        ambient.velocity = points.position.iter().map(|x| omega.cross(x)).collect();
        ambient.gradient = vec![omega.cross_matrix(); points.position.len()];
        s.advance(&ambient, 0.02).expect("finite");
    }
    for w in s.angular_velocities() {
        assert!((w - omega).norm() < 0.05, "{w}");
    }
}

#[test]
fn a_flow_of_the_wrong_size_or_without_a_law_is_refused() {
    let mut s = system(vec![helix(0, 4)], settings(SLENDER, TorqueModel::None));
    let result = s.advance(&fibreflow_fibre::Ambient::default(), 0.1);
    assert!(matches!(
        result,
        Err(FibreError::AmbientSize {
            points: 8,
            given: 0
        })
    ));
    let mut s = system(vec![helix(0, 4)], FibreSettings::default());
    let result = s.advance_in_flow(&AmbientFlow::Quiescent, 0.1);
    assert!(matches!(result, Err(FibreError::NoHydrodynamics)));
}

/// Half an orbit's time over Jeffery's with Cox's equivalent aspect ratio, of a straight stiff fibre of unit diameter
/// in a shear flow of unit rate.
fn period_ratio(aspect_ratio: f64, segments: usize, torque: TorqueModel, dt: f64) -> f64 {
    let axis = Vector3::y() * aspect_ratio;
    let stiff = {
        let zeta = SlenderConstants::Batchelor
            .resistance(aspect_ratio, 1.0)
            .normal;
        // ζγ̇L⁴/EI = 10: far from buckling at 306.
        let bending = zeta * aspect_ratio.powi(4) / 10.0;
        bending / Material::new(0.5, 1.0, 0.3, 1.0).second_moment()
    };
    let material = Material::new(0.5, stiff, 0.3, 0.2);
    let fibre = Fibre::straight(0, material, -axis / 2.0, axis / 2.0, segments);
    let mut s = system(vec![fibre], settings(SLENDER, torque));
    let angle = |s: &FibreSystem| {
        let r = s.end_to_end(0);
        r.x.atan2(r.y)
    };
    // From the flow direction +x through −y to −x: the time of half a turn, start-up left out.
    let (mut time, mut first, mut last) = (0.0, None, angle(&s));
    loop {
        s.advance_in_flow(&AmbientFlow::Shear { rate: 1.0 }, dt)
            .expect("finite");
        let now = angle(&s);
        // Upright crossings: φ = ±π/2 are aligned with the flow; take φ = 1 and φ = 1 − π.
        for target in [1.0, 1.0 - PI] {
            let (a, b) = (last - target, now - target);
            if a < 0.0 && b >= 0.0 && b - a < 1.0 {
                let crossing = time + dt * a / (a - b);
                if let Some(first) = first {
                    let r = cox_aspect_ratio(aspect_ratio);
                    return (crossing - first) / (PI * (r + 1.0 / r));
                }
                first = Some(crossing);
            }
        }
        last = now;
        time += dt;
        assert!(time < 1e3);
    }
}

#[test]
fn a_stiff_fibre_tumbles_with_jefferys_period_for_any_number_of_segments() {
    for aspect_ratio in [20.0, 50.0] {
        let ratios =
            [4, 8, 16].map(|n| period_ratio(aspect_ratio, n, TorqueModel::default(), 0.05));
        println!("r_p = {aspect_ratio}: period over Jeffery's {ratios:?}");
        for ratio in ratios {
            assert!((ratio - 1.0).abs() < 0.01);
            assert!((ratio / ratios[0] - 1.0).abs() < 0.01);
        }
    }
}

/// K's constants make the fibre look shorter: r_e ≈ 18 where Cox has 31 at r_p = 50 (Batchelor's drag).
#[test]
fn kunhappans_constants_tumble_faster() {
    let ratio = period_ratio(50.0, 8, TorqueModel::Kunhappan, 0.05);
    println!("r_p = 50, K's constants: period over Jeffery's {ratio}");
    assert!(ratio > 0.5 && ratio < 0.65);
}

#[test]
fn a_held_fibre_bends_and_stays_held() {
    let mut fibre = Fibre::straight(
        0,
        Material::new(0.02, 1e7, 0.3, 10.0),
        Vector3::zeros(),
        Vector3::y(),
        16,
    );
    fibre.supports = vec![Support::clamp(0)];
    let mut s = system(vec![fibre], settings(SLENDER, TorqueModel::default()));
    let u = 1e-3;
    let flow = AmbientFlow::Uniform(Vector3::new(u, 0.0, 0.0));
    for _ in 0..60 {
        s.advance_in_flow(&flow, 0.05).expect("finite");
    }
    assert_eq!(s.positions()[0], Vector3::zeros());
    let m = *s.material(0);
    let load = SlenderConstants::Batchelor.resistance(25.0, 1.0).normal * u;
    let expected = load / (8.0 * m.bending_stiffness());
    let relative = s.positions()[16].x / expected - 1.0;
    println!("deflection under uniform drag, relative error {relative:.2e}");
    assert!(relative.abs() < 5e-3);
}

/// A rigid spheroid of aspect ratio r keeps C = tan θ √(r² cos² φ + sin² φ)/r on its orbit (φ from the gradient
/// direction, θ from the vorticity): a stiff fibre in space must too, up to
/// its inertia and the step (linear in both: 1.2e-2 for ten times the density, 1.2e-1 γ̇Δt).
#[test]
fn a_stiff_fibre_keeps_its_orbit_in_space() {
    let (r_p, zeta) = (
        20.0,
        SlenderConstants::Batchelor.resistance(20.0, 1.0).normal,
    );
    let bending = zeta * f64::powi(r_p, 4) / 10.0;
    let stiff = bending / Material::new(0.5, 1.0, 0.3, 1.0).second_moment();
    let axis = Vector3::new(0.3, 0.5, 0.8).normalize() * r_p;
    let material = Material::new(0.5, stiff, 0.3, 0.02);
    let fibre = Fibre::straight(0, material, -axis / 2.0, axis / 2.0, 6);
    let mut s = system(vec![fibre], settings(SLENDER, TorqueModel::default()));
    let r = cox_aspect_ratio(r_p);
    let constant = |p: Vector3| (p.x * p.x + p.y * p.y * r * r).sqrt() / (r * p.z);
    let first = constant(s.end_to_end(0));
    let mut worst = 0.0_f64;
    for _ in 0..2500 {
        s.advance_in_flow(&AmbientFlow::Shear { rate: 1.0 }, 0.02)
            .expect("finite");
        worst = worst.max((constant(s.end_to_end(0)) / first - 1.0).abs());
    }
    println!("orbit constant {first:.3}, drifts by at most {worst:.1e} in half an orbit");
    assert!(worst < 6e-3);
}

/// Steel-stiff, feather-light and heavy fibres, thrown into a fast flow: bounded by the flow.
#[test]
fn hard_cases_stay_bounded() {
    for (density, modulus) in [(1.0, 1e11), (1e4, 1e11), (1.0, 1e5), (1e3, 1e9)] {
        let material = Material::new(1e-5, modulus, 0.3, density);
        let place = |i: usize| Vector3::new(0.0, 1e-4 * i as f64, 2e-5 * (i * i) as f64);
        let fibre = Fibre::new(9, material, (0..=8).map(place).collect());
        let mut law = hydrodynamics(DragModel::default(), TorqueModel::default());
        law.fluid = FluidProperties {
            density: 1e3,
            viscosity: 1e-3,
        };
        let settings = FibreSettings {
            hydrodynamics: Some(law),
            ..FibreSettings::default()
        };
        let mut s = system(vec![fibre], settings);
        let length = s.length(0);
        for round in 0..20 {
            // The flow turns round in every step: slip jumps.
            let u = if round % 2 == 0 { 5.0 } else { -5.0 };
            let flow = AmbientFlow::Uniform(Vector3::new(u, 0.3 * u, 0.0));
            s.advance_in_flow(&flow, 2e-6).expect("finite");
        }
        let fastest = s.velocities().iter().map(|v| v.norm()).fold(0.0, f64::max);
        assert!(fastest < 10.0, "{density} {modulus}: {fastest}");
        assert!(s.end_to_end(0).norm() < 1.1 * length);
    }
}
