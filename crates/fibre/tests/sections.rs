//! Sections that are not round, not even, or give way to shear; shapes that are wound (validation rows B1, B2).

use fibreflow_fibre::placement::CentreLine;
use fibreflow_fibre::{
    Equilibrium, Fibre, FibreError, FibreSettings, FibreSystem, ImplicitSettings, Integrator,
    Material, Support, Vector3,
};
use fibreflow_parallel::Communicator;

fn material(radius: f64) -> Material {
    let unit = Material::new(radius, 1.0, 0.3, 1.0);
    Material::new(radius, 1.0 / unit.second_moment(), 0.3, 1.0 / unit.area())
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

fn system(fibre: Fibre, settings: FibreSettings) -> Result<FibreSystem, FibreError> {
    FibreSystem::new(Communicator::single(), settings, vec![fibre])
}

fn clamped(material: Material, segments: usize) -> Fibre {
    let mut fibre = Fibre::straight(3, material, Vector3::zeros(), Vector3::x(), segments);
    fibre.supports = vec![Support::clamp(0)];
    fibre
}

/// Where the last node of a held fibre comes to rest under a force, less where it was.
fn deflection(fibre: Fibre, force: Vector3) -> Vector3 {
    let last = fibre.nodes.len() - 1;
    let start = fibre.nodes[last];
    let mut s = system(fibre, implicit()).expect("valid");
    s.add_load(3, last, force, Vector3::zeros()).expect("tip");
    for _ in 0..20 {
        s.advance_free(1e4).expect("finite");
    }
    s.positions()[last] - start
}

/// w = ∫ P (L − x)²/EI(x) dx with EI ∝ r⁴: for r from a to b over the unit length, closed by parts.
#[test]
fn a_tapered_cantilever_bends_by_the_integral_of_its_compliance() {
    let (taper, load, radius) = (0.5, 1e-4, 0.01);
    let r = |x: f64| (2.0 + 2.0 * (taper - 1.0) * x) / (1.0 + taper);
    let n = 20_000;
    let middle = |k: usize| (k as f64 + 0.5) / f64::from(n);
    let sum: f64 = (0..n as usize)
        .map(|k| (1.0 - middle(k)).powi(2) / r(middle(k)).powi(4))
        .sum();
    let expected = load * sum / f64::from(n);
    let error = |segments: usize| {
        let mut fibre = clamped(material(radius), segments);
        fibre.taper = taper;
        (deflection(fibre, Vector3::y() * load).y / expected - 1.0).abs()
    };
    let errors = [8, 16, 32].map(error);
    println!("tapered: {errors:?}");
    assert!(errors[2] < 1e-3);
    let order = (errors[0] / errors[2]).log2() / 2.0;
    assert!((1.9..2.2).contains(&order), "{order}");
}

#[test]
fn a_tapered_fibre_weighs_what_it_is_made_of() {
    let mut fibre = Fibre::straight(3, material(0.01), Vector3::zeros(), Vector3::x(), 200);
    fibre.taper = 0.25;
    let mut settings = implicit();
    settings.gravity = Vector3::z() * -2.0;
    let mut s = system(fibre, settings).expect("valid");
    let momentum = |s: &FibreSystem| s.momentum().z;
    let before = momentum(&s);
    s.advance_free(0.5).expect("finite");
    // ∫ r² dx of a frustum: (a² + ab + b²)/3 with a + b = 2.
    let (a, b) = (2.0 / 1.25, 0.5 / 1.25);
    let mass = (a * a + a * b + b * b) / 3.0;
    let found = before - momentum(&s);
    assert!((found / mass - 1.0).abs() < 1e-4, "{found} {mass}");
}

/// A load across neither axis bends a flat section askew: PL³/3EI of each axis by itself.
#[test]
fn a_flat_section_bends_by_its_two_stiffnesses() {
    let (ratio, load, segments) = (4.0, 1e-4, 16);
    let mut flat = material(0.01);
    flat.bending_ratio = ratio;
    let [along, across] = [2.0 * ratio / (1.0 + ratio), 2.0 / (1.0 + ratio)];
    for turn in [0.0_f64, 0.7, 2.0] {
        let axis = Vector3::new(0.3, turn.cos(), turn.sin());
        let other = Vector3::new(0.0, -turn.sin(), turn.cos());
        let mut fibre = clamped(flat, segments);
        fibre.section_axis = axis;
        let force = Vector3::new(0.0, 1.0, 0.5) * load;
        let moved = deflection(fibre, force);
        for (direction, stiffness) in [(axis, along), (other, across)] {
            let direction = Vector3::new(0.0, direction.y, direction.z);
            let expected = force.dot(&direction) / (3.0 * stiffness);
            let found = moved.dot(&direction);
            assert!(
                (found - expected).abs() < 1e-3 * expected.abs().max(1e-5),
                "{turn}: {found} {expected}"
            );
        }
    }
}

/// Bent by its whole length, a flat section follows the elastica of its own stiffness in either plane.
#[test]
fn a_flat_section_bends_far_like_a_round_one_of_its_stiffness() {
    let tip = |ratio: f64, axis: Vector3, load: f64| {
        let mut flat = material(0.002);
        flat.bending_ratio = ratio;
        let mut fibre = clamped(flat, 32);
        fibre.section_axis = axis;
        deflection(fibre, Vector3::y() * load)
    };
    let round = tip(1.0, Vector3::zeros(), 5.0);
    for (axis, stiffness) in [(Vector3::y(), 1.5), (Vector3::z(), 0.5)] {
        let moved = tip(3.0, axis, 5.0 * stiffness);
        let error = (moved - round).norm();
        println!("stiffness {stiffness}: {error:.1e}");
        assert!(error < 2e-3, "{moved} {round}");
    }
}

#[test]
fn explicit_and_implicit_steps_know_the_same_flat_tapered_section() {
    let run = |settings: FibreSettings, steps: usize| {
        let mut flat = material(0.05);
        flat.bending_ratio = 2.5;
        flat.shear = true;
        let mut fibre = clamped(flat, 6);
        fibre.taper = 0.6;
        fibre.section_axis = Vector3::new(0.0, 1.0, 1.0);
        let mut s = system(fibre, settings).expect("valid");
        s.add_load(3, 6, Vector3::y() * 0.3, Vector3::zeros())
            .expect("tip");
        for _ in 0..steps {
            s.advance_free(0.5 / steps as f64).expect("finite");
        }
        s.positions()[6]
    };
    let explicit = run(FibreSettings::default(), 1000);
    let implicit = run(implicit(), 4000);
    println!("{explicit} {implicit}");
    assert!(explicit.z.abs() > 0.01, "it bends askew: {explicit}");
    assert!((explicit - implicit).norm() < 2e-4 * (explicit - Vector3::x()).norm());
}

/// PL³/3EI + PL/κGA: exact at the nodes of a shear-flexible element.
#[test]
fn a_short_beam_gives_way_to_shear() {
    let (radius, load) = (0.2, 1e-5);
    let mut short = material(radius);
    let bending = 1.0 / 3.0;
    let poisson = 0.3;
    let kappa = 6.0 * (1.0 + poisson) / (7.0 + 6.0 * poisson);
    let shear = 1.0 / (kappa * short.shear_modulus * short.area());
    assert!(shear > 0.05 * bending);
    for segments in [1, 4] {
        let stiff = deflection(clamped(short, segments), Vector3::y() * load).y;
        assert!((stiff / (load * bending) - 1.0).abs() < 1e-6);
        short.shear = true;
        let soft = deflection(clamped(short, segments), Vector3::y() * load).y;
        short.shear = false;
        let expected = load * (bending + shear);
        assert!((soft / expected - 1.0).abs() < 1e-6, "{soft} {expected}");
    }
}

#[test]
fn a_flat_section_must_know_its_axis() {
    let mut flat = material(0.01);
    flat.bending_ratio = 2.0;
    let mut fibre = clamped(flat, 4);
    fibre.section_axis = Vector3::x() * 3.0;
    let refused = system(fibre, implicit()).err();
    assert!(matches!(refused, Some(FibreError::SectionAxis { .. })));
}

fn helix(radius: f64, pitch: f64, length: f64, segments: usize) -> Vec<Vector3> {
    CentreLine::Helix { radius, pitch }.nodes(length, segments)
}

/// A wound and twisted shape is at rest, and a fibre that is placed straight winds itself up to it.
#[test]
fn a_helix_stays_and_a_straight_fibre_winds_up_to_it() {
    let nodes = helix(0.1, 0.25, 2.0, 60);
    let mut resting = Fibre::new(3, material(0.01), nodes.clone());
    resting.twist = 1.5;
    let mut s = system(resting, FibreSettings::default()).expect("valid");
    s.advance_free(0.1).expect("finite");
    let moved = s
        .positions()
        .iter()
        .zip(&nodes)
        .map(|(x, y)| (x - y).norm());
    assert!(moved.fold(0.0, f64::max) < 1e-10);

    let mut placed = Fibre::straight(3, material(0.01), Vector3::zeros(), Vector3::x() * 2.0, 60);
    placed.material.retardation = 0.1;
    placed.equilibrium = Equilibrium::Shape(nodes.clone());
    let mut settings = implicit();
    settings.integrator = Integrator::Implicit(ImplicitSettings {
        linear: false,
        tolerance: 1e-2,
    });
    let mut s = system(placed, settings).expect("valid");
    for _ in 0..200 {
        s.advance_free(0.02).expect("finite");
    }
    for _ in 0..10 {
        s.advance_free(10.0).expect("finite");
    }
    let gap = |nodes: &[Vector3], k: usize| (nodes[k + 20] - nodes[k]).norm();
    for k in [0, 17, 40] {
        let (found, wanted) = (gap(s.positions(), k), gap(&nodes, k));
        assert!((found / wanted - 1.0).abs() < 1e-6, "{found} {wanted}");
    }
    // It may still spin, which pulls it a little.
    println!("wound up: {:?}", s.energy());
    assert!(s.energy().elastic.total() < 1e-6);
}

/// A close-coiled spring gives way by twist alone: F/δ = GJ/(2πR³ n) (Wahl). Of many coils, pulled along its axis at
/// ends that are kept from turning.
#[test]
fn a_helix_is_a_spring() {
    let (radius, coils, wire) = (0.05, 8.0, 2e-3);
    let pitch = 0.02 * radius;
    let turn = (std::f64::consts::TAU * radius).hypot(pitch);
    let m = material(wire);
    let torsion = 2.0 * m.shear_modulus * m.second_moment();
    let stiffness = torsion / (std::f64::consts::TAU * radius.powi(3) * coils);
    let error = |segments: usize| {
        let mut nodes = helix(radius, pitch, coils * turn, segments);
        // The load acts on the axis, through an arm from the last coil, as it does from the first.
        let last = nodes[segments];
        let first = nodes[0];
        nodes.insert(0, Vector3::new(first.x, 0.0, 0.0));
        nodes.push(Vector3::new(last.x, 0.0, 0.0));
        let mut fibre = Fibre::new(3, m, nodes);
        fibre.supports = vec![
            Support::clamp(0),
            Support {
                node: segments + 2,
                translation: false,
                rotation: true,
            },
        ];
        let force = 1e-3 * stiffness * radius;
        deflection(fibre, Vector3::x() * force).x * stiffness / force
    };
    let found = error(320);
    println!("spring: {found}");
    assert!((found - 1.0).abs() < 0.1, "{found}");
}
