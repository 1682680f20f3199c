//! Whether two axes have passed through each other.

use crate::Vector3;
use crate::contact::closest::closest_points;

/// Two axes that meet within this fraction of their extent have met.
const MEETING: f64 = 1e-7;

/// How often the axes a and b pass through each other while their ends move evenly from `before` to `after`.
///
/// They can meet only when the four ends lie in a plane: at the roots of the cubic (a₁ − a₀) × (b₁ − b₀)·(b₀ − a₀), of
/// which those count at which it changes sign and the axes are at no distance. Motion within one plane is no crossing.
pub fn crossings(before: &[[Vector3; 2]; 2], after: &[[Vector3; 2]; 2]) -> u32 {
    let travel = |k: usize| {
        let ends = (0..2).map(|end| (after[k][end] - before[k][end]).norm());
        ends.fold(0.0, f64::max)
    };
    if closest_points(&after[0], &after[1]).distance > travel(0) + travel(1) {
        return 0;
    }
    let at = |t: f64| {
        [0, 1].map(|k| [0, 1].map(|end| before[k][end] + (after[k][end] - before[k][end]) * t))
    };
    let volume = |t: f64| {
        let [a, b] = at(t);
        (a[1] - a[0]).cross(&(b[1] - b[0])).dot(&(b[0] - a[0]))
    };
    let meet = |t: f64| {
        let [a, b] = at(t);
        let extent = (a[1] - a[0]).norm() + (b[1] - b[0]).norm();
        closest_points(&a, &b).distance < MEETING * extent
    };
    let turns = turning_points([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].map(volume));
    let mut count = 0;
    for w in turns.windows(2) {
        let (mut low, mut high) = (w[0], w[1]);
        let rising = volume(high) > 0.0;
        if (volume(low) > 0.0) == rising {
            continue;
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if (volume(middle) > 0.0) == rising {
                high = middle;
            } else {
                low = middle;
            }
        }
        count += u32::from(meet(0.5 * (low + high)));
    }
    count
}

/// 0, 1 and the turning points between them of the cubic with the given values at 0, ⅓, ⅔, 1; ascending.
fn turning_points(values: [f64; 4]) -> [f64; 4] {
    let [f0, f1, f2, f3] = values;
    // f = f₀ + c₁t + c₂t² + c₃t³.
    let c1 = 0.5 * (-11.0 * f0 + 18.0 * f1 - 9.0 * f2 + 2.0 * f3);
    let c2 = 4.5 * (2.0 * f0 - 5.0 * f1 + 4.0 * f2 - f3);
    let c3 = 4.5 * (-f0 + 3.0 * f1 - 3.0 * f2 + f3);
    let discriminant = c2 * c2 - 3.0 * c1 * c3;
    if discriminant <= 0.0 {
        return [0.0, 0.0, 1.0, 1.0];
    }
    let q = -(c2 + discriminant.sqrt().copysign(c2));
    let clean = |t: f64| if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) };
    let (first, second) = (clean(q / (3.0 * c3)), clean(c1 / q));
    [0.0, first.min(second), first.max(second), 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn vector(rng: &mut ChaCha8Rng, scale: f64) -> Vector3 {
        Vector3::from_fn(|_, _| scale * rng.random_range(-1.0..1.0))
    }

    #[test]
    fn a_fibre_that_is_pushed_through_another_is_seen() {
        let v = Vector3::new;
        let still = [v(-1.0, 0.0, 0.0), v(1.0, 0.0, 0.0)];
        let across = |z: f64| [v(0.2, -1.0, z), v(0.3, 1.0, z + 0.01)];
        assert_eq!(crossings(&[still, across(0.5)], &[still, across(-0.5)]), 1);
        assert_eq!(crossings(&[still, across(0.5)], &[still, across(0.1)]), 0);
        // Past the end.
        let beside = |z: f64| [v(1.2, -1.0, z), v(1.2, 1.0, z)];
        assert_eq!(crossings(&[still, beside(0.5)], &[still, beside(-0.5)]), 0);
        // Through and back in one move: one end dips and the other rises, the crossing point never touches.
        let tilted = |z: f64| [v(0.0, -1.0, 0.5 - z), v(0.0, 1.0, 0.5 + z)];
        assert_eq!(crossings(&[still, tilted(2.0)], &[still, tilted(-2.0)]), 0);
        // Within a plane.
        let flat = |x: f64| [v(x, -1.0, 0.0), v(x, -0.5, 0.0)];
        assert_eq!(crossings(&[still, flat(0.0)], &[still, flat(0.5)]), 0);
    }

    /// The number of crossings is even exactly when the axes can be told to be linked as before: the sign of the volume
    /// flips where the projections along the shortest way cross. Checked by brute force with many small moves.
    #[test]
    fn the_cubic_agrees_with_small_moves() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let (mut seen, mut twice) = (0, 0);
        for case in 0..3000 {
            let axis = |rng: &mut ChaCha8Rng| [vector(rng, 1.0), vector(rng, 1.0)];
            let before = [axis(&mut rng), axis(&mut rng)];
            let after = [axis(&mut rng), axis(&mut rng)];
            let at = |t: f64| {
                [0, 1].map(|k| [0, 1].map(|e| before[k][e] + (after[k][e] - before[k][e]) * t))
            };
            // A move crosses where the volume flips while the lines meet inside both axes.
            let inside = |t: f64| {
                let [a, b] = at(t);
                let (p, q, w) = (a[1] - a[0], b[1] - b[0], b[0] - a[0]);
                let n = p.cross(&q);
                let (s, t) = (
                    w.cross(&q).dot(&n) / n.norm_squared(),
                    w.cross(&p).dot(&n) / n.norm_squared(),
                );
                let margin = s.min(t).min(1.0 - s).min(1.0 - t);
                (n.dot(&w) > 0.0, margin)
            };
            let steps = 2000;
            let mut expected = 0;
            let mut doubtful = false;
            let mut last = inside(0.0);
            for k in 1..=steps {
                let now = inside(f64::from(k) / f64::from(steps));
                if now.0 != last.0 {
                    doubtful |= now.1.abs() < 0.02 || last.1.abs() < 0.02;
                    doubtful |= (now.1 - last.1).abs() > 0.02;
                    expected += u32::from(now.1 > 0.0);
                }
                last = now;
            }
            if !doubtful {
                let found = crossings(&before, &after);
                assert_eq!(found, expected, "case {case}");
                seen += u32::from(found > 0);
                twice += u32::from(found > 1);
            }
        }
        assert!(seen > 300 && twice > 3, "{seen} {twice}");
    }
}
