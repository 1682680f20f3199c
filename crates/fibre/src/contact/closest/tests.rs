use super::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

type Axis = [Vector3; 2];

fn vector(rng: &mut ChaCha8Rng) -> Vector3 {
    Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0))
}

/// Two axes of one of the kinds that go wrong in closest-point routines, by `kind` modulo ten.
fn pair(rng: &mut ChaCha8Rng, kind: usize) -> (Axis, Axis) {
    let a = [vector(rng), vector(rng)];
    let p = a[1] - a[0];
    let on_a = a[0] + p * rng.random_range(-0.5..1.5);
    let length = 10f64.powf(rng.random_range(-6.0..0.5)) * [1.0, -1.0][rng.random_range(0..2)];
    let tilt = vector(rng) * 10f64.powf(rng.random_range(-15.0..-1.0));
    let b = match kind % 10 {
        0 => [vector(rng), vector(rng)],
        // Parallel, beside each other or one behind the other.
        1 => {
            let start = on_a + vector(rng);
            [start, start + p * length]
        }
        // Collinear, with or without a common part.
        2 => [on_a, on_a + p * length],
        // A common end.
        3 => {
            let end = a[rng.random_range(0..2)];
            let other = end + vector(rng) * length;
            [[end, other], [other, end]][rng.random_range(0..2)]
        }
        // An end on the other axis.
        4 => {
            let foot = a[0] + p * rng.random_range(0.0..1.0);
            [foot, foot + vector(rng) * length]
        }
        // Crossing at any angle, down to the nearly parallel.
        5 => {
            let foot = a[0] + p * rng.random_range(0.0..1.0);
            let half = (p + tilt) * length;
            [foot - half * rng.random_range(0.0..1.0), foot + half]
        }
        // Nearly parallel, beside each other.
        6 => {
            let start = on_a + vector(rng);
            [start, start + (p + tilt) * length]
        }
        // Nearly collinear.
        7 => [on_a + tilt, on_a + p * length],
        // No length.
        8 => [on_a; 2],
        // Very different lengths.
        _ => {
            let start = vector(rng);
            [start, start + vector(rng) * length]
        }
    };
    match rng.random_range(0..40) {
        0 => ([a[0]; 2], b),
        1 => (b, a),
        _ => (a, b),
    }
}

/// Point of an axis nearest to x.
fn foot(x: &Vector3, b: &Axis) -> Vector3 {
    let q = b[1] - b[0];
    let square = q.norm_squared();
    if square == 0.0 {
        return b[0];
    }
    b[0] + q * ((x - b[0]).dot(&q) / square).clamp(0.0, 1.0)
}

/// Smallest distance by exhaustion: each of the four ends with the other axis, and a search between the ends of a.
fn exhaustive_distance(a: &Axis, b: &Axis) -> f64 {
    let ends = a.iter().map(|x| (x - foot(x, b)).norm());
    let ends = ends.chain(b.iter().map(|x| (x - foot(x, a)).norm()));
    ends.fold(searched_distance(a, b), f64::min)
}

/// Smallest distance by bisection for the sign of the slope along a; the distance to a convex set is convex. The slope
/// is taken between a's point and the axis b, with the part along b left out, which keeps its digits near the parallel.
fn searched_distance(a: &Axis, b: &Axis) -> f64 {
    let (p, q) = (a[1] - a[0], b[1] - b[0]);
    let square = q.norm_squared();
    let across = |v: &Vector3| match square {
        0.0 => *v,
        _ => v - q * (v.dot(&q) / square),
    };
    let p_across = across(&p);
    let rises = |s: f64| {
        let x = a[0] + p * s;
        let t = (x - b[0]).dot(&q) / square;
        if square > 0.0 && (0.0..=1.0).contains(&t) {
            across(&(x - b[0])).dot(&p_across) > 0.0
        } else {
            (x - foot(&x, b)).dot(&p) > 0.0
        }
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if rises(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    let x = a[0] + p * (0.5 * (low + high));
    (x - foot(&x, b)).norm()
}

#[test]
fn distances_agree_with_an_exhaustive_search() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut worst = [0.0_f64; 10];
    for case in 0..100_000 {
        let (a, b) = pair(&mut rng, case);
        let found = closest_points(&a, &b);
        assert!((0.0..=1.0).contains(&found.s) && (0.0..=1.0).contains(&found.t));
        let on_a = a[0] + (a[1] - a[0]) * found.s;
        let on_b = b[0] + (b[1] - b[0]) * found.t;
        assert!((on_b - on_a - found.separation).norm() < 1e-14);
        let difference = (found.distance - exhaustive_distance(&a, &b)).abs();
        worst[case % 10] = worst[case % 10].max(difference);
        assert!(
            difference < 1e-10,
            "case {case}: {} differs by {difference:e} for {a:?} {b:?}",
            found.distance
        );
    }
    println!("largest difference by kind {worst:?}");
}

#[test]
fn special_cases_are_exact() {
    let v = Vector3::new;
    let check = |a: Axis, b: Axis, s: f64, t: f64, distance: f64| {
        let found = closest_points(&a, &b);
        assert_eq!((found.s, found.t, found.distance), (s, t, distance));
    };
    let x_axis = [v(0.0, 0.0, 0.0), v(4.0, 0.0, 0.0)];
    // Crossing.
    check(
        x_axis,
        [v(1.0, -1.0, 3.0), v(1.0, 3.0, 3.0)],
        0.25,
        0.25,
        3.0,
    );
    // Parallel: centre of the common part 2..4, also against the direction.
    check(
        x_axis,
        [v(2.0, 1.0, 0.0), v(10.0, 1.0, 0.0)],
        0.75,
        0.125,
        1.0,
    );
    check(
        x_axis,
        [v(10.0, 1.0, 0.0), v(2.0, 1.0, 0.0)],
        0.75,
        0.875,
        1.0,
    );
    // Parallel, one behind the other.
    check(x_axis, [v(7.0, 4.0, 0.0), v(9.0, 4.0, 0.0)], 1.0, 0.0, 5.0);
    // End to end, end to side.
    check(x_axis, [v(5.0, 0.0, 0.0), v(6.0, 1.0, 0.0)], 1.0, 0.0, 1.0);
    check(x_axis, [v(1.0, 2.0, 0.0), v(1.0, 5.0, 0.0)], 0.25, 0.0, 2.0);
    // Points.
    let point = [v(1.0, 2.0, 0.0); 2];
    check(x_axis, point, 0.25, 0.5, 2.0);
    check(point, x_axis, 0.5, 0.25, 2.0);
    check(point, [v(1.0, 2.0, 6.0); 2], 0.5, 0.5, 6.0);
    // The same axis, and intersecting axes.
    check(x_axis, x_axis, 0.5, 0.5, 0.0);
    check(
        x_axis,
        [v(1.0, -1.0, 0.0), v(1.0, 1.0, 0.0)],
        0.25,
        0.5,
        0.0,
    );
}

/// Turning through the parallel, the exact closest point jumps from end to end; the contact point must not.
#[test]
fn contact_points_move_continuously_through_the_parallel() {
    let a = [Vector3::new(-5.0, 0.0, 0.0), Vector3::new(5.0, 0.0, 0.0)];
    let (reach, overlap) = (2.0, 0.02);
    let at = |yaw: f64, pitch: f64| {
        let half = 4.0 * Vector3::new(yaw.cos() * pitch.cos(), yaw.sin(), pitch.sin());
        let middle = Vector3::new(1.5, 0.0, reach - overlap);
        let b = [middle - half, middle + half];
        contact_points(&a, &b, reach).expect("touching")
    };
    let mut largest: f64 = 0.0;
    let mut jump: f64 = 0.0;
    for (yaw_rate, pitch_rate) in [(1.0, 0.0), (0.0, 1.0), (0.3, 1.0), (1.0, 1e-3)] {
        let steps = 40_000;
        let angle = |k: i32| 0.01 * f64::from(k) / f64::from(steps);
        let mut before = at(yaw_rate * angle(-steps), pitch_rate * angle(-steps));
        for k in 1 - steps..=steps {
            let now = at(yaw_rate * angle(k), pitch_rate * angle(k));
            largest = largest.max((now.s - before.s).abs());
            jump = jump.max((now.distance - before.distance).abs());
            before = now;
        }
    }
    assert!(largest < 1e-3, "the contact point jumped by {largest}");
    assert!(jump < 1e-5, "the overlap jumped by {jump}");
    // The exact point does jump.
    let exact = |pitch: f64| {
        let half = 4.0 * Vector3::new(pitch.cos(), 0.0, pitch.sin());
        let middle = Vector3::new(1.5, 0.0, reach - overlap);
        closest_points(&a, &[middle - half, middle + half]).s
    };
    assert!((exact(1e-6) - exact(-1e-6)).abs() > 0.5);
}

#[test]
fn contact_points_of_crossing_axes_are_the_closest() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..10_000 {
        let a = [vector(&mut rng), vector(&mut rng)];
        let b = [vector(&mut rng), vector(&mut rng)];
        let exact = closest_points(&a, &b);
        let reach = exact.distance * 1.01;
        let found = contact_points(&a, &b, reach).expect("touching");
        assert!(found.distance > exact.distance - 1e-14);
        let overlap = reach - exact.distance;
        assert!(reach - found.distance > 0.7 * overlap);
    }
    let a = [Vector3::zeros(), Vector3::x()];
    let apart = [Vector3::y(), Vector3::new(1.0, 1.0, 0.0)];
    assert!(contact_points(&a, &apart, 1.0).is_none());
    let broken = [Vector3::y(), Vector3::repeat(f64::NAN)];
    assert!(contact_points(&a, &broken, 1.0).is_none());
}
