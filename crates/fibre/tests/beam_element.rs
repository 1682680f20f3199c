//! The beam element: forces are the gradient of the energy, and nothing changes under rigid motion.

use fibreflow_fibre::beam::{Motion, Pose, Segment, SegmentForce};
use fibreflow_fibre::{Quaternion, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

struct Case {
    segment: Segment,
    position: [Vector3; 2],
    orientation: [Quaternion; 2],
}

fn vector(rng: &mut ChaCha8Rng, size: f64) -> Vector3 {
    Vector3::from_fn(|_, _| rng.random_range(-size..=size))
}

/// A segment with natural curvature and twist that gives way to shear, flat, anywhere in space, its ends turned by up to about `strain` radians.
fn case(rng: &mut ChaCha8Rng, strain: f64) -> Case {
    let turn = |rng: &mut ChaCha8Rng, size| Quaternion::from_scaled_axis(vector(rng, size));
    let segment = Segment {
        rest_length: 0.7,
        axial: 2.0,
        radius: 0.1,
        bending: 1.3,
        mutual: 0.8,
        flatness: 0.4,
        torsion: 0.9,
        retardation: 0.2,
        start_frame: turn(rng, 0.5),
        end_frame: turn(rng, 0.5),
    };
    let frame = turn(rng, 3.0);
    let start = vector(rng, 2.0);
    let stretch = 1.0 + rng.random_range(-0.2..0.2);
    let length = segment.rest_length * stretch;
    let orientation = [segment.start_frame, segment.end_frame]
        .map(|offset| frame * turn(rng, strain / 1.7) * offset.inverse());
    Case {
        segment,
        position: [start, start + frame * Vector3::new(length, 0.0, 0.0)],
        orientation,
    }
}

fn poses(c: &Case) -> (Pose<'_>, Pose<'_>) {
    let pose = |i: usize| Pose {
        position: &c.position[i],
        orientation: &c.orientation[i],
    };
    (pose(0), pose(1))
}

fn energy(c: &Case) -> f64 {
    let (a, b) = poses(c);
    c.segment.energy(a, b).total()
}

fn force(c: &Case) -> SegmentForce {
    let (a, b) = poses(c);
    c.segment.elastic_force(a, b)
}

/// Derivative by fourth-order central differences.
fn slope(f: impl Fn(f64) -> f64) -> f64 {
    let h = 1e-3;
    (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)
}

#[test]
fn force_and_torque_are_the_gradient_of_the_energy() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for strain in [1e-3, 0.1, 0.5, 1.2] {
        for _ in 0..50 {
            let c = case(&mut rng, strain);
            let f = force(&c);
            let scale = f.force.norm() + f.start_torque.norm() + f.end_torque.norm();
            for axis in 0..3 {
                let e = Vector3::ith(axis, 1.0);
                let moved = |node: usize, s: f64| {
                    let mut position = c.position;
                    position[node] += e * s;
                    energy(&Case {
                        position,
                        ..case_of(&c)
                    })
                };
                let turned = |node: usize, s: f64| {
                    let mut orientation = c.orientation;
                    orientation[node] = Quaternion::from_scaled_axis(e * s) * orientation[node];
                    energy(&Case {
                        orientation,
                        ..case_of(&c)
                    })
                };
                for (value, expected) in [
                    (-slope(|s| moved(0, s)), -f.force[axis]),
                    (-slope(|s| moved(1, s)), f.force[axis]),
                    (-slope(|s| turned(0, s)), f.start_torque[axis]),
                    (-slope(|s| turned(1, s)), f.end_torque[axis]),
                ] {
                    assert!(
                        (value - expected).abs() < 1e-7 * scale.max(1e-3),
                        "strain {strain}: {value} {expected}"
                    );
                }
            }
        }
    }
}

fn case_of(c: &Case) -> Case {
    Case {
        segment: c.segment,
        position: c.position,
        orientation: c.orientation,
    }
}

#[test]
fn rigid_motion_changes_no_energy_and_turns_the_forces() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..100 {
        let c = case(&mut rng, 0.8);
        let q = Quaternion::from_scaled_axis(vector(&mut rng, 3.0));
        let shift = vector(&mut rng, 1.0);
        let moved = Case {
            segment: c.segment,
            position: c.position.map(|x| q * x + shift),
            orientation: c.orientation.map(|o| q * o),
        };
        assert!((energy(&moved) - energy(&c)).abs() < 1e-13);
        let (f, g) = (force(&c), force(&moved));
        assert!((q * f.force - g.force).norm() < 1e-12);
        assert!((q * f.start_torque - g.start_torque).norm() < 1e-12);
        assert!((q * f.end_torque - g.end_torque).norm() < 1e-12);
        // No net torque: internal forces keep angular momentum.
        let arm = c.position[1] - c.position[0];
        let net = f.start_torque + f.end_torque + arm.cross(&f.force);
        assert!(net.norm() < 1e-13, "{net}");
    }
}

/// In a plane and for small angles: M = (EI/l)(4α + 2β), twist torque GJ τ/l, axial force EA ε.
#[test]
fn small_strains_give_the_euler_bernoulli_beam() {
    let segment = Segment {
        rest_length: 0.7,
        axial: 2.0,
        radius: 0.1,
        bending: 1.3,
        mutual: 1.3,
        flatness: 0.0,
        torsion: 0.9,
        retardation: 0.0,
        start_frame: Quaternion::identity(),
        end_frame: Quaternion::identity(),
    };
    let (alpha, beta, twist, stretch) = (2e-6, -3e-6, 5e-6, 4e-6);
    let c = Case {
        segment,
        position: [Vector3::zeros(), Vector3::new(0.7 + stretch, 0.0, 0.0)],
        orientation: [
            Quaternion::from_scaled_axis(Vector3::new(0.0, 0.0, alpha)),
            Quaternion::from_scaled_axis(Vector3::new(twist, 0.0, beta)),
        ],
    };
    let f = force(&c);
    let start = -1.3 * (4.0 * alpha + 2.0 * beta);
    let end = -1.3 * (2.0 * alpha + 4.0 * beta);
    let tolerance = 1e-3 * 1e-6;
    assert!((f.start_torque - Vector3::new(0.9 * twist, 0.0, start)).norm() < tolerance);
    assert!((f.end_torque - Vector3::new(-0.9 * twist, 0.0, end)).norm() < tolerance);
    let shear = -(start + end) / 0.7;
    assert!((f.force - Vector3::new(-2.0 * stretch, shear, 0.0)).norm() < tolerance);
}

#[test]
fn a_twist_of_nearly_half_a_turn_is_seen_whole() {
    let mut c = case(&mut ChaCha8Rng::seed_from_u64(3), 0.0);
    let turn = Quaternion::from_scaled_axis(Vector3::new(3.0, 0.0, 0.0));
    let frame = c.orientation[1] * c.segment.end_frame;
    // The other sign of the same rotation must not matter.
    let turned = frame * turn * c.segment.end_frame.inverse();
    for orientation in [turned, Quaternion::new_unchecked(-turned.into_inner())] {
        c.orientation[1] = orientation;
        let (a, b) = poses(&c);
        let e = c.segment.energy(a, b);
        assert!((e.torsion - 0.5 * 0.9 * 9.0).abs() < 1e-12, "{e:?}");
        assert!(e.bending.abs() < 1e-12);
    }
}

#[test]
fn viscous_force_dissipates_and_ignores_rigid_motion() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for _ in 0..100 {
        let c = case(&mut rng, 0.5);
        let (a, b) = poses(&c);
        let (v, w) = (vector(&mut rng, 1.0), vector(&mut rng, 1.0));
        let rigid = c.position.map(|x| v + w.cross(&x));
        let still = c.segment.viscous_force(
            a,
            b,
            Motion {
                velocity: &rigid[0],
                angular_velocity: &w,
            },
            Motion {
                velocity: &rigid[1],
                angular_velocity: &w,
            },
        );
        let size = still.force.norm() + still.start_torque.norm() + still.end_torque.norm();
        assert!(size < 1e-13);
        let velocity = [vector(&mut rng, 1.0), vector(&mut rng, 1.0)];
        let spin = [vector(&mut rng, 1.0), vector(&mut rng, 1.0)];
        let motion = |i: usize| Motion {
            velocity: &velocity[i],
            angular_velocity: &spin[i],
        };
        let f = c.segment.viscous_force(a, b, motion(0), motion(1));
        let power = f.force.dot(&(velocity[1] - velocity[0]))
            + f.start_torque.dot(&spin[0])
            + f.end_torque.dot(&spin[1]);
        assert!(power < 0.0);
        let arm = c.position[1] - c.position[0];
        let net = f.start_torque + f.end_torque + arm.cross(&f.force);
        assert!(net.norm() < 1e-13);
    }
}

/// The gradient (g_d, g_a, g_b) = (−force, −start torque, −end torque) as nine numbers.
fn gradient(c: &Case) -> [f64; 9] {
    let f = force(c);
    let parts = [-f.force, -f.start_torque, -f.end_torque];
    std::array::from_fn(|i| parts[i / 3][i % 3])
}

#[test]
fn the_tangent_is_the_derivative_of_the_gradient_and_symmetric() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for strain in [1e-3, 0.1, 0.5, 1.2] {
        for _ in 0..50 {
            let c = case(&mut rng, strain);
            let (a, b) = poses(&c);
            let (same, k) = c.segment.elastic_stiffness(a, b);
            let f = force(&c);
            for (x, y) in [
                (same.force, f.force),
                (same.start_torque, f.start_torque),
                (same.end_torque, f.end_torque),
            ] {
                assert!((x - y).norm() < 1e-12);
            }
            let (ad, bd, ba) = (k.da.transpose(), k.db.transpose(), k.ab.transpose());
            let blocks = [[k.dd, k.da, k.db], [ad, k.aa, k.ab], [bd, ba, k.bb]];
            let matrix = |i: usize, j: usize| blocks[i / 3][j / 3][(i % 3, j % 3)];
            let size = (0..9).map(|i| matrix(i, i).abs()).fold(0.0, f64::max);
            for j in 0..9 {
                let e = Vector3::ith(j % 3, 1.0);
                let moved = |s: f64| {
                    let mut moved = case_of(&c);
                    match j / 3 {
                        0 => moved.position[1] += e * s,
                        node => {
                            let q = &mut moved.orientation[node - 1];
                            *q = Quaternion::from_scaled_axis(e * s) * *q;
                        }
                    }
                    gradient(&moved)
                };
                for i in 0..9 {
                    let expected = slope(|s| moved(s)[i]);
                    assert!(
                        (matrix(i, j) - expected).abs() < 1e-7 * size,
                        "strain {strain}, ({i}, {j}): {} {expected}",
                        matrix(i, j)
                    );
                }
            }
            // Rotations do not commute: the skew part of a frame's own block is half the cross matrix of its gradient.
            let skew = |m: &fibreflow_fibre::Matrix3| (m - m.transpose()) * 0.5;
            for (block, torque) in [(&k.aa, f.start_torque), (&k.bb, f.end_torque)] {
                let own = torque.cross_matrix() * 0.5;
                assert!(
                    (skew(block) - own).norm() < 1e-12 * size,
                    "{block} {torque}"
                );
            }
            assert!(skew(&k.dd).norm() < 1e-12 * size);
        }
    }
}

#[test]
fn damping_is_minus_the_derivative_of_the_viscous_force() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let c = case(&mut rng, 0.5);
    let (a, b) = poses(&c);
    let k = c.segment.damping(a, b);
    let (ad, bd, ba) = (k.da.transpose(), k.db.transpose(), k.ab.transpose());
    let blocks = [[k.dd, k.da, k.db], [ad, k.aa, k.ab], [bd, ba, k.bb]];
    for j in 0..9 {
        let e = Vector3::ith(j % 3, 1.0);
        let unit = |part: usize| if j / 3 == part { e } else { Vector3::zeros() };
        let still = Vector3::zeros();
        let f = c.segment.viscous_force(
            a,
            b,
            Motion {
                velocity: &still,
                angular_velocity: &unit(1),
            },
            Motion {
                velocity: &unit(0),
                angular_velocity: &unit(2),
            },
        );
        for (i, part) in [f.force, f.start_torque, f.end_torque].iter().enumerate() {
            let column = blocks[i][j / 3].column(j % 3) + part;
            assert!(column.norm() < 1e-13, "{i} {j}: {column}");
        }
    }
}
