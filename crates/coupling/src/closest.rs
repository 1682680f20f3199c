//! Closest points on element faces, and back into reference domains.

use fibreflow_mesh::ElementKind;
use nalgebra::Vector3;

/// Closest point to `p` on a face of three or four vertices (a quadrilateral is cut along its first diagonal).
pub(crate) fn on_face(p: &Vector3<f64>, face: &[Vector3<f64>]) -> Vector3<f64> {
    let first = on_triangle(p, &face[0], &face[1], &face[2]);
    if face.len() == 3 {
        return first;
    }
    let second = on_triangle(p, &face[0], &face[2], &face[3]);
    if (second - p).norm_squared() < (first - p).norm_squared() {
        second
    } else {
        first
    }
}

/// Brings reference coordinates into the reference domain of `fibreflow_mesh::shape`.
pub(crate) fn in_reference(kind: ElementKind, r: [f64; 3]) -> [f64; 3] {
    let [a, b, c] = r.map(|x| x.clamp(0.0, 1.0));
    match kind {
        ElementKind::Tetrahedron => {
            let sum = (a + b + c).max(1.0);
            [a / sum, b / sum, c / sum]
        }
        ElementKind::Pyramid => [a.min(1.0 - c), b.min(1.0 - c), c],
        ElementKind::Prism => {
            let sum = (a + b).max(1.0);
            [a / sum, b / sum, c]
        }
        ElementKind::Hexahedron => [a, b, c],
    }
}

/// Closest point on a triangle by the Voronoi regions of its features (Ericson 2005, section 5.1.5).
fn on_triangle(
    p: &Vector3<f64>,
    a: &Vector3<f64>,
    b: &Vector3<f64>,
    c: &Vector3<f64>,
) -> Vector3<f64> {
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (ab.dot(&(p - a)), ac.dot(&(p - a)));
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    let (d3, d4) = (ab.dot(&(p - b)), ac.dot(&(p - b)));
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + d1 / (d1 - d3) * ab;
    }
    let (d5, d6) = (ab.dot(&(p - c)), ac.dot(&(p - c)));
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + d2 / (d2 - d6) * ac;
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
    }
    let sum = va + vb + vc;
    a + vb / sum * ab + vc / sum * ac
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    #[test]
    fn no_sampled_point_of_the_face_is_closer() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let face = [
            Vector3::new(0.0, 0.0, 0.0),
            Vector3::new(1.0, 0.1, 0.0),
            Vector3::new(1.2, 0.9, 0.3),
            Vector3::new(-0.1, 1.1, 0.1),
        ];
        for _ in 0..200 {
            let p = Vector3::from_fn(|_, _| rng.random_range(-2.0..3.0));
            for corners in [&face[..3], &face[..]] {
                let best = (on_face(&p, corners) - p).norm();
                for triangle in [[0, 1, 2], [0, 2, corners.len() - 1]] {
                    for _ in 0..50 {
                        let (s, t): (f64, f64) = (rng.random(), rng.random());
                        let (s, t) = if s + t > 1.0 {
                            (1.0 - s, 1.0 - t)
                        } else {
                            (s, t)
                        };
                        let [a, b, c] = triangle.map(|k| corners[k]);
                        let q = a + s * (b - a) + t * (c - a);
                        assert!((q - p).norm() >= best - 1e-12);
                    }
                }
            }
        }
    }
}
