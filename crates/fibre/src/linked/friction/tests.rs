use super::*;
use crate::hydrodynamics::SpheroidRatio;
use crate::linked::fibre::Joint;
use crate::{Matrix3, Quaternion};
use rand::{Rng, SeedableRng};

/// A cluster of four segments with contacts 1–4, 2–3 and 3–4 (S app. C), at random angles and arms.
fn cluster() -> (Vec<Chain>, Vec<Segment>, Vec<Touch>) {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let mut vector = || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
    let mobility = Mobility::new(8.0, 1.0, 0.3, SpheroidRatio::Bretherton);
    let chain = Chain {
        id: 0,
        radius: 1.0,
        half_length: 8.0,
        own: mobility.force,
        mobility,
        bending: [1.0; 2],
        twisting: 1.0,
        joint: Joint::Ball,
        weight: Vector3::zeros(),
        centre: Vector3::zeros(),
        rate: Vector3::zeros(),
    };
    let mut segment = |k: u32| Segment {
        chain: k,
        index: k,
        first: true,
        centre: vector(),
        frame: Quaternion::identity(),
        equilibrium: Quaternion::identity(),
        axis: vector().normalize(),
        felt: [Vector3::zeros(); 2],
        velocity: vector(),
        spin: vector(),
        joint_force: Vector3::zeros(),
        pin_torque: Vector3::zeros(),
        rate: nalgebra::Quaternion::identity(),
    };
    let segments = (0..4).map(&mut segment).collect();
    let mut touch = |a: u32, b: u32| Touch {
        segments: [a, b],
        along: [0.0; 2],
        ends: [0; 2],
        distance: 2.0,
        gap: 0.0,
        normal: vector().normalize(),
        push: 1.0,
        repulsion: 0.0,
        rubs: true,
        friction: Vector3::zeros(),
        slides: false,
        arms: [vector() * 4.0, vector() * 4.0],
        shift: Vector3::zeros(),
        image_velocity: vector(),
    };
    let touches = vec![touch(0, 3), touch(1, 2), touch(2, 3)];
    (vec![chain; 4], segments, touches)
}

fn group(chains: &[Chain], segments: &[Segment], touches: &[Touch]) -> Group {
    let mut groups = Groups::default();
    groups.sort(touches, segments.len());
    assert_eq!((groups.count(), groups.members.len()), (1, 4));
    Group::new(0, touches, &groups, chains, segments)
}

/// The matrix of S app. C, block by block: direct contributions J − J', and the cases II, III and IV of S table 2.2.
#[test]
fn the_worked_example_of_the_matrix() {
    let (chains, segments, touches) = cluster();
    let group = group(&chains, &segments, &touches);
    let tilde = |v: &Vector3| v.cross_matrix();
    let tensor = |part: usize, s: usize| {
        let m = &chains[s].mobility;
        let zero = Vector3::zeros();
        let columns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|unit| {
            let slips = if part == 0 {
                [unit, zero]
            } else {
                [zero, unit]
            };
            m.drag(&segments[s].axis, &slips[0], &slips[1])[part]
        });
        let resistance = Matrix3::from_columns(&columns);
        resistance.try_inverse().expect("a resistance")
    };
    // J_ik = A_i⁻¹ − G_ij C_i⁻¹ G_ik, seen at the contact with j; J' is minus that.
    let j = |s: usize, here: &Vector3, there: &Vector3| {
        tensor(0, s) - tilde(here) * tensor(1, s) * tilde(there)
    };
    let [g14, g41] = touches[0].arms;
    let [g23, g32] = touches[1].arms;
    let [g34, g43] = touches[2].arms;
    let expected = [
        [
            Some(j(0, &g14, &g14) + j(3, &g41, &g41)),
            None,
            Some(j(3, &g41, &g43)),
        ],
        [
            None,
            Some(j(1, &g23, &g23) + j(2, &g32, &g32)),
            Some(-j(2, &g32, &g34)),
        ],
        [
            Some(j(3, &g43, &g41)),
            Some(-j(2, &g34, &g32)),
            Some(j(2, &g34, &g34) + j(3, &g43, &g43)),
        ],
    ];
    for column in 0..3 {
        for unit in [Vector2::x(), Vector2::y()] {
            let mut force = vec![Vector2::zeros(); 3];
            force[column] = unit;
            let mut found = vec![Vector2::zeros(); 3];
            group.apply(&force, &mut found);
            for row in 0..3 {
                let block = expected[row][column].unwrap_or_else(Matrix3::zeros);
                let whole = block * group.contacts[column].force(&unit);
                let wanted = group.contacts[row].components(&whole);
                let scale = tensor(0, 0).norm();
                assert!(
                    (found[row] - wanted).norm() < 1e-13 * scale,
                    "block {row}, {column}: {} and {wanted}",
                    found[row]
                );
            }
        }
    }
}

#[test]
fn what_sticks_does_not_slide_and_what_slides_has_its_force() {
    let (chains, segments, touches) = cluster();
    let group = group(&chains, &segments, &touches);
    for (coefficients, least) in [([1e6, 0.0], 0), ([2.0, 1.0], 1), ([0.5, 0.5], 1)] {
        let answer = group.solve(coefficients);
        let force: Vec<Vector2<f64>> = (answer.iter().zip(&group.contacts))
            .map(|((f, _), c)| c.components(f))
            .collect();
        let mut moved = vec![Vector2::zeros(); 3];
        group.apply(&force, &mut moved);
        let sliding = answer.iter().filter(|(_, slides)| *slides).count();
        assert!(sliding >= least, "{coefficients:?}: {answer:?}");
        for (k, contact) in group.contacts.iter().enumerate() {
            let speed = (moved[k] + contact.components(&contact.sliding)).norm();
            let (size, slides) = (force[k].norm(), answer[k].1);
            if slides {
                let wanted = coefficients[1] * contact.push;
                assert!((size - wanted).abs() < 1e-12 * wanted);
            } else {
                assert!(speed < 1e-12 && size <= coefficients[0] * contact.push);
            }
        }
    }
}
