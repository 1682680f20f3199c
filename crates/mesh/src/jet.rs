//! Interpolation in an element and its transpose, direction by direction: a field that is linear between vertices along
//! each reference coordinate needs 22 operations on vectors in a hexahedron, where sums over shape functions and their
//! gradients need 64.

use crate::ElementKind;
use crate::shape::{gradients, values};

/// The components of a vector, and one that makes four.
pub type Lanes = [f64; 4];

/// A field at a point of an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet {
    /// Σ N_v u_v
    pub value: Lanes,
    /// Σ u_v ∂N_v/∂r_k for the three reference coordinates.
    pub along: [Lanes; 3],
}

#[inline(always)]
fn sum(a: Lanes, b: Lanes) -> Lanes {
    std::array::from_fn(|l| a[l] + b[l])
}

#[inline(always)]
fn minus(a: Lanes, b: Lanes) -> Lanes {
    std::array::from_fn(|l| a[l] - b[l])
}

/// a + s·b
#[inline(always)]
fn add_scaled(a: Lanes, s: f64, b: Lanes) -> Lanes {
    std::array::from_fn(|l| s.mul_add(b[l], a[l]))
}

#[inline(always)]
fn scaled(s: f64, a: Lanes) -> Lanes {
    a.map(|a| s * a)
}

/// Edges of a hexahedron along the first coordinate: (r, s, t) = (·, 0, 0), (·, 1, 0), (·, 0, 1), (·, 1, 1).
const EDGES: [[usize; 2]; 4] = [[0, 1], [3, 2], [4, 5], [7, 6]];

/// The field with values `u(v)` at the vertices, at reference point `r`.
#[inline(always)]
pub fn jet(kind: ElementKind, u: impl Fn(usize) -> Lanes, r: [f64; 3]) -> Jet {
    match kind {
        ElementKind::Hexahedron => {
            let mut edges = [([0.0; 4], [0.0; 4]); 4];
            for (edge, [a, b]) in edges.iter_mut().zip(EDGES) {
                let (a, b) = (u(a), u(b));
                let slope = minus(b, a);
                *edge = (add_scaled(a, r[0], slope), slope);
            }
            let layer = |a: (Lanes, Lanes), b: (Lanes, Lanes)| {
                let (slope, twist) = (minus(b.0, a.0), minus(b.1, a.1));
                (
                    add_scaled(a.0, r[1], slope),
                    [add_scaled(a.1, r[1], twist), slope],
                )
            };
            let (low, high) = (layer(edges[0], edges[1]), layer(edges[2], edges[3]));
            let rise = minus(high.0, low.0);
            let between = |k: usize| add_scaled(low.1[k], r[2], minus(high.1[k], low.1[k]));
            Jet {
                value: add_scaled(low.0, r[2], rise),
                along: [between(0), between(1), rise],
            }
        }
        ElementKind::Tetrahedron => {
            let origin = u(0);
            let along = [1, 2, 3].map(|v| minus(u(v), origin));
            let value = (0..3).fold(origin, |value, k| add_scaled(value, r[k], along[k]));
            Jet { value, along }
        }
        ElementKind::Pyramid | ElementKind::Prism => {
            let (n, gradient) = (values(kind, r), gradients(kind, r));
            let mut jet = Jet {
                value: [0.0; 4],
                along: [[0.0; 4]; 3],
            };
            for v in 0..kind.vertices() {
                let u = u(v);
                jet.value = add_scaled(jet.value, n[v], u);
                for (along, slope) in jet.along.iter_mut().zip(gradient[v]) {
                    *along = add_scaled(*along, slope, u);
                }
            }
            jet
        }
    }
}

/// The value of [`jet`] alone.
#[inline(always)]
pub fn value(kind: ElementKind, u: impl Fn(usize) -> Lanes, r: [f64; 3]) -> Lanes {
    let between = |s: f64, a: Lanes, b: Lanes| add_scaled(a, s, minus(b, a));
    match kind {
        ElementKind::Hexahedron => {
            let edges = EDGES.map(|[a, b]| between(r[0], u(a), u(b)));
            let low = between(r[1], edges[0], edges[1]);
            let high = between(r[1], edges[2], edges[3]);
            between(r[2], low, high)
        }
        _ => jet(kind, u, r).value,
    }
}

/// The transpose of [`jet`]: N_v f + Σ_k g_k ∂N_v/∂r_k at the vertices. They sum to f.
#[inline(always)]
pub fn transpose(kind: ElementKind, f: Lanes, g: [Lanes; 3], r: [f64; 3]) -> [Lanes; 8] {
    let mut vertices = [[0.0; 4]; 8];
    match kind {
        ElementKind::Hexahedron => {
            let parts = |s: f64, f: Lanes| {
                let far = scaled(s, f);
                [minus(f, far), far]
            };
            let ends = |s: f64, f: Lanes, g: Lanes| {
                let far = add_scaled(g, s, f);
                [minus(f, far), far]
            };
            let (f, gr, gs) = (ends(r[2], f, g[2]), parts(r[2], g[0]), parts(r[2], g[1]));
            for layer in 0..2 {
                let f = ends(r[1], f[layer], gs[layer]);
                let gr = parts(r[1], gr[layer]);
                for row in 0..2 {
                    let [near, far] = EDGES[2 * layer + row];
                    [vertices[near], vertices[far]] = ends(r[0], f[row], gr[row]);
                }
            }
        }
        ElementKind::Tetrahedron => {
            vertices[0] = f;
            for k in 0..3 {
                vertices[k + 1] = add_scaled(g[k], r[k], f);
                vertices[0] = minus(vertices[0], vertices[k + 1]);
            }
        }
        ElementKind::Pyramid | ElementKind::Prism => {
            let (n, gradient) = (values(kind, r), gradients(kind, r));
            for v in 0..kind.vertices() {
                let turned = (0..3).map(|k| scaled(gradient[v][k], g[k]));
                vertices[v] = turned.fold(scaled(n[v], f), sum);
            }
        }
    }
    vertices
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::inside;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// By the definition: sums over shape functions and their gradients.
    #[test]
    fn jets_are_sums_over_shape_functions_and_the_transpose_is_theirs() {
        let mut random = ChaCha8Rng::seed_from_u64(8);
        for kind in ElementKind::ALL {
            for _ in 0..100 {
                let r: [f64; 3] = std::array::from_fn(|_| random.random());
                if !inside(kind, r, 0.0) {
                    continue;
                }
                let mut lanes = || -> Lanes { std::array::from_fn(|_| random.random()) };
                let u: [Lanes; 8] = std::array::from_fn(|_| lanes());
                let (f, g) = (lanes(), [lanes(), lanes(), lanes()]);
                let (n, gradient) = (values(kind, r), gradients(kind, r));
                let found = jet(kind, |v| u[v], r);
                let pushed = transpose(kind, f, g, r);
                assert_eq!(value(kind, |v| u[v], r), found.value);
                for l in 0..4 {
                    let expected: f64 = (0..8).map(|v| n[v] * u[v][l]).sum();
                    assert!((found.value[l] - expected).abs() < 1e-14);
                    for k in 0..3 {
                        let expected: f64 = (0..8).map(|v| gradient[v][k] * u[v][l]).sum();
                        assert!((found.along[k][l] - expected).abs() < 1e-14);
                    }
                    for v in 0..8 {
                        let turned: f64 = (0..3).map(|k| gradient[v][k] * g[k][l]).sum();
                        let expected = n[v] * f[l] + turned;
                        assert!((pushed[v][l] - expected).abs() < 1e-14, "{kind:?} {v}");
                    }
                }
            }
        }
    }
}
