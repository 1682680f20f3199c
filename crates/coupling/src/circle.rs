//! How bent a row of points is.

use fibreflow_fibre::{Matrix3, Vector3};

/// Smallest square of the width across a row of points by that along it at which a circle is told from round-off.
const STRAIGHT: f64 = 1e-14;

/// Radius of the circle of least squares (Kåsa 1976; L appendix C) through points \[m\] in the plane that is nearest to them; infinite for
/// points on a line, and for fewer than three.
pub fn radius_of_circle(points: &[Vector3]) -> f64 {
    let count = points.len().max(1) as f64;
    let mean = points.iter().sum::<Vector3>() / count;
    let arms: Vec<Vector3> = points.iter().map(|x| x - mean).collect();
    let spread: Matrix3 = arms.iter().map(|a| a * a.transpose()).sum();
    let eigen = spread.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let [along, across] = [order[0], order[1]];
    let [longest, width] = [eigen.eigenvalues[along], eigen.eigenvalues[across]];
    if points.len() < 3 || width <= STRAIGHT * longest {
        return f64::INFINITY;
    }
    // Moments in the principal axes of the plane, where ⟨uv⟩ = 0.
    let [mut centre_u, mut centre_v] = [0.0, 0.0];
    for arm in &arms {
        let [u, v] = [along, across].map(|k| eigen.eigenvectors.column(k).dot(arm));
        centre_u += 0.5 * u * (u * u + v * v) / longest;
        centre_v += 0.5 * v * (u * u + v * v) / width;
    }
    (centre_u * centre_u + centre_v * centre_v + (longest + width) / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use fibreflow_fibre::Quaternion;

    fn arc(radius: f64, angle: f64, count: usize) -> Vec<Vector3> {
        let turn = Quaternion::from_euler_angles(0.4, -1.1, 2.0);
        let at = |k: usize| angle * k as f64 / (count - 1) as f64;
        (0..count)
            .map(|k| turn * Vector3::new(at(k).cos(), at(k).sin(), 0.0) * radius)
            .map(|x| x + Vector3::new(3.0, 1.0, -7.0))
            .collect()
    }

    #[test]
    fn arcs_have_their_radius() {
        for (angle, count, bound) in [(6.0, 9, 1e-14), (1.0, 6, 1e-13), (0.01, 3, 1e-9)] {
            let found = radius_of_circle(&arc(2.5, angle, count));
            assert!((found / 2.5 - 1.0).abs() < bound, "{found}");
        }
    }

    #[test]
    fn a_line_has_none() {
        let line: Vec<Vector3> = (0..6)
            .map(|k| Vector3::new(1.0, 2.0, -0.5) * k as f64)
            .collect();
        assert_eq!(radius_of_circle(&line), f64::INFINITY);
        assert_eq!(radius_of_circle(&line[..2]), f64::INFINITY);
        assert_eq!(radius_of_circle(&[]), f64::INFINITY);
    }
}
