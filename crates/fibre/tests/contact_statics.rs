//! VALIDATION B6: fibres that touch, in equilibrium and sliding, and the budget of their energies.

use fibreflow_fibre::contact::{
    ContactSettings, Lubrication, LubricationModel, NormalDamping, Repulsion, VanDerWaals, Wall,
};
use fibreflow_fibre::hydrodynamics::{
    AmbientFlow, DragModel, FluidProperties, SlenderConstants, TorqueModel,
};
use fibreflow_fibre::{
    Equilibrium, Fibre, FibreSettings, FibreSystem, Hydrodynamics, Material, PeriodicBox, Support,
    Vector3,
};
use fibreflow_parallel::Communicator;
use std::f64::consts::PI;

const RADIUS: f64 = 0.02;
const STIFFNESS: f64 = 2e4;

fn contacts(damping: f64, friction: f64) -> ContactSettings {
    ContactSettings {
        damping: NormalDamping::Ratio(damping),
        friction,
        ..ContactSettings::new(STIFFNESS, 0.02)
    }
}

fn material(modulus: f64) -> Material {
    Material::new(RADIUS, modulus, 0.3, 1000.0)
}

fn system(contacts: ContactSettings, gravity: Vector3, fibres: Vec<Fibre>) -> FibreSystem {
    in_liquid(30.0, contacts, gravity, fibres)
}

fn in_liquid(
    viscosity: f64,
    contacts: ContactSettings,
    gravity: Vector3,
    fibres: Vec<Fibre>,
) -> FibreSystem {
    let fluid = FluidProperties {
        density: 1.0,
        viscosity,
    };
    let settings = FibreSettings {
        gravity,
        hydrodynamics: Some(Hydrodynamics {
            fluid,
            drag: DragModel::SlenderBody(SlenderConstants::Batchelor),
            torque: TorqueModel::None,
            point_spacing: f64::INFINITY,
        }),
        contacts: Some(contacts),
        step_safety: 0.35,
        ..FibreSettings::default()
    };
    FibreSystem::new(Communicator::single(), settings, fibres).expect("valid")
}

fn run(s: &mut FibreSystem, time: f64, steps: usize) {
    for _ in 0..steps {
        s.advance_free(time / steps as f64).expect("finite");
    }
}

/// In a viscous liquid at rest.
fn settle(s: &mut FibreSystem, time: f64, steps: usize) {
    for _ in 0..steps {
        s.advance_in_flow(&AmbientFlow::Quiescent, time / steps as f64)
            .expect("finite");
    }
}

fn speed(s: &FibreSystem) -> f64 {
    s.velocities().iter().map(|v| v.norm()).fold(0.0, f64::max)
}

/// Two beams clamped at both ends that cross in the middle with an overlap g: F = g/(2L³/192EI + 1/k).
#[test]
fn crossed_beams_press_each_other_as_springs_in_series() {
    let (half, overlap) = (0.5, 1e-3);
    let material = material(1e8);
    let beam = |id, along: Vector3, z: f64| {
        let lift = z * Vector3::z();
        let mut fibre = Fibre::straight(id, material, lift - along * half, lift + along * half, 31);
        fibre.supports = vec![Support::clamp(0), Support::clamp(31)];
        fibre
    };
    let height = 2.0 * RADIUS - overlap;
    let fibres = vec![beam(0, Vector3::x(), 0.0), beam(1, Vector3::y(), height)];
    let mut s = system(contacts(0.3, 0.0), Vector3::zeros(), fibres);
    settle(&mut s, 1.0, 300);
    let bending = material.youngs_modulus * material.second_moment();
    let compliance = 2.0 * (2.0 * half).powi(3) / (192.0 * bending) + 1.0 / STIFFNESS;
    let expected = overlap / compliance;
    let found = s.contacts().expect("on").statistics().max_overlap * STIFFNESS;
    println!(
        "crossed: force {found} instead of {expected}, speed {:.1e}",
        speed(&s)
    );
    assert!(speed(&s) < 1e-4);
    assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
}

/// Two fibres on top of each other on a floor: the upper one rests on the lower with its weight, both on the floor.
#[test]
fn parallel_fibres_carry_their_weights() {
    let m = material(1e7);
    let fibre = |id, z: f64| {
        let start = Vector3::new(0.0, 0.0, z);
        Fibre::straight(id, m, start, start + Vector3::new(1.0, 0.0, 0.0), 8)
    };
    let mut laws = contacts(0.5, 0.3);
    laws.walls = vec![Wall::plane(Vector3::zeros(), Vector3::z())];
    let fibres = vec![fibre(0, RADIUS), fibre(1, 3.0 * RADIUS)];
    let mut s = system(laws, Vector3::new(0.0, 0.0, -10.0), fibres);
    settle(&mut s, 2.0, 400);
    let weight = 10.0 * 1000.0 * m.area() / 8.0;
    let statistics = s.contacts().expect("on").statistics();
    assert_eq!(statistics.contacts, 8 + 2 * 7);
    let middle = |fibre: usize| s.positions()[9 * fibre + 4].z;
    let floor = RADIUS - middle(0);
    assert!(
        (floor / (2.0 * weight / STIFFNESS) - 1.0).abs() < 0.02,
        "{floor}"
    );
    // Half segments beside each other share the load with whole ones, so the upper overlap is smaller.
    let pair = 2.0 * RADIUS - (middle(1) - middle(0));
    assert!(
        pair > 0.2 * weight / STIFFNESS && pair < weight / STIFFNESS,
        "{pair}"
    );
    let side = s.positions().iter().map(|x| x.y.abs()).fold(0.0, f64::max);
    assert!(side < 1e-9 && speed(&s) < 1e-6, "{side} {}", speed(&s));
}

/// A force pushes one fibre with its end against the end of another.
#[test]
fn end_on_the_force_goes_through() {
    let m = material(1e7);
    let mut held = Fibre::straight(0, m, Vector3::zeros(), Vector3::x(), 4);
    held.supports = vec![Support::clamp(0)];
    let start = Vector3::new(1.0 + 2.0 * RADIUS, 0.0, 0.0);
    let pushed = Fibre::straight(1, m, start, start + Vector3::x(), 4);
    let mut s = system(contacts(0.5, 0.0), Vector3::zeros(), vec![held, pushed]);
    let force = 2.0;
    s.add_load(1, 4, Vector3::new(-force, 0.0, 0.0), Vector3::zeros())
        .expect("node");
    settle(&mut s, 0.5, 200);
    let statistics = s.contacts().expect("on").statistics();
    let overlap = statistics.max_overlap;
    assert_eq!(statistics.contacts, 1);
    // At the ends of two axes a contact has the share exp(−½).
    let expected = force / (STIFFNESS * f64::exp(-0.5));
    assert!((overlap / expected - 1.0).abs() < 1e-3, "{overlap}");
    let shortened = 1.0 - s.positions()[4].x;
    let expected = force / (m.youngs_modulus * m.area());
    assert!((shortened / expected - 1.0).abs() < 1e-2, "{shortened}");
}

/// An overhand knot that wants to be straight, pulled at its ends: a trefoil, cut where it is farthest out, with tails.
fn knot(stiffness: f64) -> FibreSystem {
    let (nodes, tail, gap) = (90, 24, 0.25);
    let curve = |t: f64| {
        let x = t.sin() + 2.0 * (2.0 * t).sin();
        let y = t.cos() - 2.0 * (2.0 * t).cos();
        0.1 * Vector3::new(x, y, -(3.0 * t).sin())
    };
    let at = |k: usize| {
        let t = PI / 3.0 + gap + 2.0 * (PI - gap) * k as f64 / nodes as f64;
        curve(t)
    };
    let (first, last) = (at(0) - at(1), at(nodes) - at(nodes - 1));
    let mut places: Vec<Vector3> = (0..tail)
        .map(|k| at(0) + first * (tail - k) as f64)
        .collect();
    places.extend((0..=nodes).map(at));
    places.extend((1..=tail).map(|k| at(nodes) + last * k as f64));
    let end = places.len() - 1;
    let fibre = Fibre {
        equilibrium: Equilibrium::Straight,
        ..Fibre::new(0, material(3e4), places)
    };
    let mut laws = contacts(0.5, 0.3);
    laws.normal_stiffness = stiffness;
    laws.count_crossings = true;
    let mut s = in_liquid(1.0, laws, Vector3::zeros(), vec![fibre]);
    for (node, pull) in [(0, first), (end, last)] {
        let force = 0.6 * pull.normalize();
        s.add_load(0, node, force, Vector3::zeros()).expect("node");
    }
    s
}

#[test]
fn a_pulled_knot_does_not_pass_through_itself() {
    let mut s = knot(500.0);
    settle(&mut s, 2.0, 200);
    let statistics = s.contacts().expect("on").statistics();
    println!("knot: {statistics:?}");
    assert_eq!(statistics.crossings, 0);
    assert!(statistics.contacts >= 3);
    assert!(statistics.max_overlap < 0.5 * RADIUS);
    // What does not push back is passed through, and the count says so.
    let mut ghost = knot(1e-9);
    settle(&mut ghost, 2.0, 200);
    assert!(ghost.contacts().expect("on").statistics().crossings > 0);
}

/// A fibre of several segments on an incline: it sticks below tan α = μ and slides above.
#[test]
fn a_fibre_on_an_incline_starts_to_slide_at_coulombs_angle() {
    let friction = 0.3;
    let slide = |slope: f64| {
        let angle = slope.atan();
        let m = material(1e7);
        let weight = 10.0 * 1000.0 * m.area() / 6.0;
        let start = Vector3::new(0.0, 0.0, RADIUS - weight * angle.cos() / STIFFNESS);
        let fibre = Fibre::straight(0, m, start, start + Vector3::x(), 6);
        let mut laws = contacts(0.8, friction);
        laws.walls = vec![Wall::plane(Vector3::zeros(), Vector3::z())];
        let gravity = 10.0 * Vector3::new(angle.sin(), 0.0, -angle.cos());
        let mut s = system(laws, gravity, vec![fibre]);
        // It slides a little before it settles.
        run(&mut s, 1.0, 200);
        let start = s.velocities()[3].x;
        run(&mut s, 0.3, 60);
        (s.velocities()[3].x - start) / 0.3
    };
    assert!(slide(0.995 * friction).abs() < 1e-4);
    let slope: f64 = 1.05 * friction;
    let expected = 10.0 * (slope.atan().sin() - friction * slope.atan().cos());
    let found = slide(slope);
    println!("incline: {found} instead of {expected}");
    assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
    assert!(slide(1.01 * friction) > 0.5 * 10.0 * 0.01 * friction * 0.95);
}

/// A wall squeezes a small heap: its work is found again as energy kept and lost.
fn budget(change: impl Fn(&mut ContactSettings)) -> (f64, f64) {
    let edge = 1.2;
    let fibre = |i: u64| {
        let a = 0.9 * i as f64;
        let place = Vector3::new(0.37 * i as f64, 0.21 * i as f64, 0.04 + 0.046 * i as f64);
        let half = Vector3::new(a.cos(), a.sin(), 0.0) * 0.25;
        let m = Material::new(RADIUS, 1e6, 0.3, 1000.0);
        Fibre::straight(i, m, place - half, place + half, 4)
    };
    let ceiling = Wall {
        velocity: -0.5 * Vector3::z(),
        ..Wall::plane(1.0 * Vector3::z(), -Vector3::z())
    };
    let mut laws = contacts(0.3, 0.3);
    laws.walls = vec![Wall::plane(Vector3::zeros(), Vector3::z()), ceiling];
    laws.periodic = PeriodicBox {
        origin: Vector3::zeros(),
        lengths: [Some(edge), Some(edge), None],
    };
    change(&mut laws);
    let mut s = system(laws, Vector3::zeros(), (0..20).map(fibre).collect());
    // Forces at a distance hold energy from the start.
    s.advance_free(1e-5).expect("finite");
    let kept = |s: &FibreSystem| {
        let c = s.contacts().expect("on").statistics();
        let energy = s.energy().total() + c.stored_energy;
        (energy + c.dissipated_energy - c.wall_work, c.wall_work)
    };
    let start = kept(&s).0;
    run(&mut s, 1.2, 240);
    let (end, work) = kept(&s);
    println!(
        "work {work:.4e}, defect {:.1e}, {:?}",
        (end - start) / work,
        s.contacts().expect("on").statistics()
    );
    ((end - start) / work, work)
}

#[test]
fn the_budget_of_a_squeeze_closes() {
    let (defect, work) = budget(|_| ());
    assert!(work > 0.0 && defect.abs() < 0.01, "{defect}");
    let (defect, _) = budget(|laws| {
        laws.repulsion = Some(Repulsion {
            strength: 2.0,
            decay: 0.1 * RADIUS,
            attraction: 0.1,
            attraction_width: 0.2 * RADIUS,
            range: RADIUS,
            contact_gap: 0.2 * RADIUS,
        });
    });
    assert!(defect.abs() < 0.01, "{defect}");
    let (defect, _) = budget(|laws| {
        laws.van_der_waals = Some(VanDerWaals {
            hamaker: 1e-4,
            closest: 0.05 * RADIUS,
            range: RADIUS,
        });
    });
    assert!(defect.abs() < 0.01, "{defect}");
    let (defect, _) = budget(|laws| {
        laws.lubrication = Some(Lubrication {
            viscosity: 0.1,
            roughness: 0.02 * RADIUS,
            range: RADIUS,
            model: LubricationModel::Cylinders,
        });
    });
    assert!(defect.abs() < 0.01, "{defect}");
}
