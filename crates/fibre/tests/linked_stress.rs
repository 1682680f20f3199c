//! Particle stress of linked fibres beside formulas: rods, flows without strain, turned axes, contacts.

use fibreflow_fibre::contact::Repulsion;
use fibreflow_fibre::linked::{Joint, LinkedFibre, LinkedScheme, LinkedSettings, LinkedSystem};
use fibreflow_fibre::{Fibre, Material, Matrix3, Quaternion, Shear, Vector3};
use fibreflow_parallel::Communicator;
use std::f64::consts::PI;

const HALF: f64 = 10.0;

fn settings(scheme: LinkedScheme) -> LinkedSettings {
    LinkedSettings {
        repulsion: Some(Repulsion {
            strength: 9e3,
            decay: 0.05,
            attraction: 0.0,
            attraction_width: 0.17,
            range: 0.66,
            contact_gap: 0.33,
        }),
        friction: [2.0, 1.0],
        ..LinkedSettings::new(scheme, 1.0, 3.0)
    }
}

/// A straight fibre of equal segments of half-length 10 and radius 1.
fn rod(id: u64, middle: Vector3, along: Vector3, segments: usize) -> LinkedFibre {
    let along = along.normalize() * (2.0 * HALF);
    let start = middle - along * (0.5 * segments as f64);
    let nodes = (0..=segments).map(|k| start + along * k as f64).collect();
    let beam = Fibre::new(id, Material::new(1.0, 1e3, 0.3, 1.0), nodes);
    LinkedFibre::new(&beam, Joint::Ball).expect("a fibre")
}

fn after_a_step(
    scheme: LinkedScheme,
    fibres: Vec<LinkedFibre>,
    gradient: &Matrix3,
) -> LinkedSystem {
    let one = Communicator::single();
    let mut system = LinkedSystem::new(&one, settings(scheme), fibres).expect("fibres");
    let flow = |x: &Vector3, _: f64| (gradient * x, *gradient);
    system.advance(&flow, 1e-6).expect("a step");
    system
}

fn stress(system: &LinkedSystem, gradient: &Matrix3) -> [Matrix3; 2] {
    system.particle_stress(&|x, _| (gradient * x, *gradient))
}

fn even(m: Matrix3) -> Matrix3 {
    let even = (m + m.transpose()) * 0.5;
    even - Matrix3::identity() * (even.trace() / 3.0)
}

fn shear() -> Matrix3 {
    let mut gradient = Matrix3::zeros();
    gradient[(0, 1)] = 1.0;
    gradient
}

/// A flow without symmetry.
fn general() -> Matrix3 {
    Matrix3::new(0.3, 1.0, -0.2, 0.4, -0.7, 0.6, 0.1, -0.9, 0.4)
}

const DIRECTIONS: [[f64; 3]; 4] = [
    [1.0, -1.0, 0.0],
    [0.3, 0.8, -0.5],
    [-0.9, 0.1, 0.4],
    [0.2, 0.3, 1.0],
];

/// A free rod turns as the spheroid of r_e = 0.7 r_p (Jeffery 1922); what it then resists, by S 2.102.
#[test]
fn a_free_rod_in_shear() {
    let zeta = 4.0 * PI / (2.0 * HALF).ln();
    let ratio = (0.7 * HALF).powi(2);
    let bretherton = (ratio - 1.0) / (ratio + 1.0);
    for gradient in [shear(), general()] {
        let strain = (gradient + gradient.transpose()) * 0.5;
        let spin = (gradient - gradient.transpose()) * 0.5;
        for direction in DIRECTIONS {
            let p = Vector3::from(direction).normalize();
            let turning = spin * p + (strain * p - p * p.dot(&(strain * p))) * bretherton;
            let slip = gradient * p - turning;
            let moment = (slip - p * (0.5 * p.dot(&slip))) * (zeta * HALF.powi(3) / 1.5);
            let expected = even(p * moment.transpose());
            let fibre = rod(0, Vector3::new(3.0, -4.0, 5.0), p, 1);
            let system = after_a_step(LinkedScheme::Explicit, vec![fibre], &gradient);
            let [drag, contact] = stress(&system, &gradient);
            let error = (drag - expected).norm() / expected.norm();
            assert!(error < 1e-11, "{direction:?}: {error:e}");
            assert_eq!(contact, Matrix3::zeros());
            assert!((drag - drag.transpose()).norm() == 0.0 && drag.trace().abs() < 1e-11);
            let axes = Shear::new(&Vector3::x(), &Vector3::y());
            let alignment = (p.x * p.y).powi(2);
            assert!((system.alignment(&axes) - alignment).abs() < 1e-5);
        }
    }
}

/// Joints carry what stretches: five segments in a row resist it as one rod of their length with their resistance by length.
#[test]
fn a_row_of_segments_is_one_rod() {
    let zeta = 4.0 * PI / (2.0 * HALF).ln();
    let long = 5.0 * HALF;
    for scheme in [LinkedScheme::Explicit, LinkedScheme::Implicit] {
        for direction in DIRECTIONS {
            let p = Vector3::from(direction).normalize();
            let fibre = rod(0, Vector3::zeros(), p, 5);
            let gradient = general();
            let system = after_a_step(scheme, vec![fibre], &gradient);
            let [drag, _] = stress(&system, &gradient);
            // p·S·p less the third of the trace that goes: ½ζ (2/3) ℓ³ p·E·p (1 − 1/3).
            let stretched = 0.5 * zeta * long.powi(3) / 1.5 * p.dot(&(gradient * p)) / 1.5;
            let found = p.dot(&(drag * p));
            assert!(
                (found / stretched - 1.0).abs() < 1e-8,
                "{scheme:?} {direction:?}: {found} {stretched}"
            );
            assert!(system.mean_bending() < 1e-4);
        }
    }
}

/// Nothing flows, or all of it turns: no stress.
#[test]
fn no_strain_no_stress() {
    let turning = Vector3::new(0.4, -0.8, 0.3).cross_matrix();
    for (gradient, limit) in [(Matrix3::zeros(), 1e-12), (turning, 1e-9)] {
        let fibre = rod(0, Vector3::zeros(), Vector3::new(1.0, 2.0, 0.5), 5);
        let system = after_a_step(LinkedScheme::Explicit, vec![fibre], &gradient);
        let [drag, contact] = stress(&system, &gradient);
        assert!(drag.norm() <= limit, "{:e}", drag.norm());
        assert_eq!(contact, Matrix3::zeros());
    }
}

/// A pile of rods that press and rub.
fn pile(turn: &Quaternion) -> Vec<LinkedFibre> {
    let place = |k: usize| {
        let angle = 0.9 * k as f64;
        let along = Vector3::new(angle.cos(), angle.sin(), 0.05);
        let middle = Vector3::new(
            (2.1 * k as f64).sin(),
            (1.3 * k as f64).cos(),
            2.1 * k as f64,
        );
        rod(k as u64, turn * (middle * 1.01), turn * along, 2)
    };
    (0..6).map(place).collect()
}

/// Axes turned: the stress turns with them.
#[test]
fn stress_turns_with_the_axes() {
    let turn = Quaternion::from_euler_angles(0.4, -1.1, 2.0);
    let matrix = turn.to_rotation_matrix().into_inner();
    let back = |m: Matrix3| matrix.transpose() * m * matrix;
    for scheme in [LinkedScheme::Explicit, LinkedScheme::Implicit] {
        let gradient = general();
        let system = after_a_step(scheme, pile(&Quaternion::identity()), &gradient);
        let turned_flow = matrix * gradient * matrix.transpose();
        let turned = after_a_step(scheme, pile(&turn), &turned_flow);
        let [drag, contact] = stress(&system, &gradient);
        let [turned_drag, turned_contact] = stress(&turned, &turned_flow).map(back);
        assert!(contact.norm() > 1.0, "the pile presses: {}", contact.norm());
        assert!((drag - turned_drag).norm() < 1e-6 * drag.norm());
        assert!((contact - turned_contact).norm() < 1e-6 * contact.norm());
    }
}

/// Contacts press fibres against the fluid's drag: the stress of the contacts is that of the net drag at the middles.
#[test]
fn contacts_are_what_drag_balances() {
    for scheme in [LinkedScheme::Explicit, LinkedScheme::Implicit] {
        let gradient = general();
        let system = after_a_step(scheme, pile(&Quaternion::identity()), &gradient);
        let mut sum = Matrix3::zeros();
        for f in 0..system.fibres() {
            let range = system.offsets()[f]..system.offsets()[f + 1];
            let (mut middle, mut force) = (Vector3::zeros(), Vector3::zeros());
            for s in range.clone() {
                let [centre, _] = system.felt(s);
                middle += centre / range.len() as f64;
                force += system.drag(s, &(gradient * centre, gradient))[0];
            }
            sum += middle * force.transpose();
        }
        let [_, contact] = stress(&system, &gradient);
        let error = (contact - even(sum)).norm() / contact.norm();
        assert!(error < 1e-9, "{scheme:?}: {error:e}");

        let loads = system.contact_loads();
        assert!(loads.contacts >= 5 && loads.normal > 0.0, "{loads:?}");
        assert!((0.0..=1.0).contains(&loads.sliding), "{loads:?}");
        let limit = 2.0 * loads.normal * (1.0 + 1e-9);
        assert!(loads.friction > 0.0 && loads.friction < limit, "{loads:?}");
    }
}
