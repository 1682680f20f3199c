//! Shape functions and their inverse map on distorted elements.

use super::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Reference coordinates of the vertices.
fn vertices(kind: ElementKind) -> Vec<[f64; 3]> {
    let (o, x, y, z) = ([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let (xy, xz, yz) = ([1.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]);
    match kind {
        ElementKind::Tetrahedron => vec![o, x, y, z],
        ElementKind::Pyramid => vec![o, x, xy, y, z],
        ElementKind::Prism => vec![o, x, y, z, xz, yz],
        ElementKind::Hexahedron => vec![o, x, xy, y, z, xz, [1.0; 3], yz],
    }
}

/// An element with every vertex moved by up to `amount`, stretched, scaled and far from the origin.
fn distorted(kind: ElementKind, amount: f64, random: &mut ChaCha8Rng) -> [[f64; 3]; 8] {
    let mut x = [[0.0; 3]; 8];
    for (x, v) in x.iter_mut().zip(vertices(kind)) {
        let moved = v.map(|v| v + random.random_range(-amount..=amount));
        *x = [
            2.0 + 1e-3 * moved[0],
            -1.0 + 1e-2 * moved[1],
            3e-3 * moved[2],
        ];
    }
    x
}

/// A point of the reference domain, pulled towards the centre by `margin`.
fn random_point(kind: ElementKind, margin: f64, random: &mut ChaCha8Rng) -> [f64; 3] {
    loop {
        let r: [f64; 3] = std::array::from_fn(|_| random.random_range(0.0..1.0));
        if inside(kind, r, 0.0) {
            let centre = centre(kind);
            return std::array::from_fn(|k| r[k] + margin * (centre[k] - r[k]));
        }
    }
}

#[test]
fn functions_are_one_at_their_vertex_and_sum_to_one() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for kind in ElementKind::ALL {
        for (v, r) in vertices(kind).into_iter().enumerate() {
            let n = values(kind, r);
            for a in 0..8 {
                assert_eq!(n[a], f64::from(u8::from(a == v)), "{} {v} {a}", kind.name());
            }
        }
        for _ in 0..50 {
            let r = random_point(kind, 0.0, &mut random);
            assert!((values(kind, r).iter().sum::<f64>() - 1.0).abs() < 1e-15);
            let g = gradients(kind, r);
            for k in 0..3 {
                assert!(g.iter().map(|g| g[k]).sum::<f64>().abs() < 1e-15);
            }
        }
    }
}

#[test]
fn gradients_are_the_derivatives_of_the_values() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let h = 1e-6;
    for kind in ElementKind::ALL {
        for _ in 0..50 {
            let r = random_point(kind, 0.1, &mut random);
            let g = gradients(kind, r);
            for k in 0..3 {
                let (mut low, mut high) = (r, r);
                low[k] -= h;
                high[k] += h;
                let (low, high) = (values(kind, low), values(kind, high));
                for a in 0..8 {
                    let slope = (high[a] - low[a]) / (2.0 * h);
                    assert!((slope - g[a][k]).abs() < 1e-8, "{} {a} {k}", kind.name());
                }
            }
        }
    }
}

#[test]
fn linear_fields_are_reproduced_with_their_gradient() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let slope = [0.3, -2.0, 1.1];
    for kind in ElementKind::ALL {
        for _ in 0..50 {
            let x = distorted(kind, 0.15, &mut random);
            let r = random_point(kind, 0.0, &mut random);
            let weights = physical(kind, &x, r);
            let p = position(kind, &x, r);
            let value: f64 = (0..8).map(|a| weights.n[a] * dot(slope, x[a])).sum();
            assert!((value - dot(slope, p)).abs() < 1e-14);
            for c in 0..3 {
                // Relative to the first vertex: sums of gradients of 1e3 with positions of 1 lose three digits.
                let g: f64 = (0..kind.vertices())
                    .map(|a| weights.gradient[a][c] * dot(slope, minus(x[a], x[0])))
                    .sum();
                assert!(
                    (g - slope[c]).abs() < 1e-12,
                    "{}: {g} {}",
                    kind.name(),
                    slope[c]
                );
            }
        }
    }
}

#[test]
fn locate_inverts_the_map_on_distorted_elements() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    for kind in ElementKind::ALL {
        for _ in 0..500 {
            let x = distorted(kind, 0.15, &mut random);
            let r = random_point(kind, 0.0, &mut random);
            let found = locate(kind, &x, position(kind, &x, r)).expect("a point inside");
            for k in 0..3 {
                // Coordinates of 2 in an element of 1e-3 carry r to 1e-13 only.
                assert!(
                    (found[k] - r[k]).abs() < 1e-11,
                    "{} {found:?} {r:?}",
                    kind.name()
                );
            }
        }
    }
}

#[test]
fn vertices_are_located() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for kind in ElementKind::ALL {
        let x = distorted(kind, 0.1, &mut random);
        for (v, r) in vertices(kind).into_iter().enumerate() {
            let found = locate(kind, &x, x[v]).expect("a vertex");
            assert!(inside(kind, found, 1e-9), "{} {v} {found:?}", kind.name());
            let n = values(kind, found);
            assert!((n[v] - 1.0).abs() < 1e-9, "{} {v} {n:?} {r:?}", kind.name());
        }
    }
}

#[test]
fn points_outside_are_refused() {
    let mut random = ChaCha8Rng::seed_from_u64(6);
    for kind in ElementKind::ALL {
        let (mut refused, mut tried) = (0, 0);
        for _ in 0..200 {
            let x = distorted(kind, 0.1, &mut random);
            let middle = position(kind, &x, centre(kind));
            for face in kind.faces() {
                // Just beyond the middle of a face, and far beyond it.
                let on_face: [f64; 3] = std::array::from_fn(|c| {
                    let corners = face.iter().map(|&v| vertices(kind)[v][c]);
                    corners.sum::<f64>() / face.len() as f64
                });
                let on_face = position(kind, &x, on_face);
                for beyond in [1e-6, 0.3, 5.0, 1e3] {
                    let point =
                        std::array::from_fn(|c| on_face[c] + beyond * (on_face[c] - middle[c]));
                    tried += 1;
                    let is_inside = locate(kind, &x, point).is_some_and(|r| inside(kind, r, 1e-9));
                    refused += usize::from(!is_inside);
                }
            }
        }
        assert_eq!(refused, tried, "{}", kind.name());
    }
}

#[test]
fn points_nearby_are_mapped_outside_not_lost() {
    // A walk from element to element leaves through the face that the reference point is beyond.
    let mut random = ChaCha8Rng::seed_from_u64(7);
    for kind in ElementKind::ALL {
        for _ in 0..100 {
            let x = distorted(kind, 0.1, &mut random);
            let middle = position(kind, &x, centre(kind));
            let corner = x[random.random_range(0..kind.vertices())];
            let point = std::array::from_fn(|c| corner[c] + 0.5 * (corner[c] - middle[c]));
            let r = locate(kind, &x, point).expect("a reference point outside");
            assert!(!inside(kind, r, 1e-3), "{}", kind.name());
        }
    }
}

#[test]
fn a_point_before_a_face_has_left_through_it() {
    for kind in ElementKind::ALL {
        let (corners, centre) = (vertices(kind), centre(kind));
        for (f, face) in kind.faces().iter().enumerate() {
            let middle =
                |k: usize| face.iter().map(|&v| corners[v][k]).sum::<f64>() / face.len() as f64;
            let before = [0, 1, 2].map(|k| centre[k] + 1.5 * (middle(k) - centre[k]));
            assert!(!inside(kind, before, 0.0));
            assert_eq!(exit(kind, before), f, "{} {f}", kind.name());
        }
    }
}
