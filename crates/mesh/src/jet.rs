//! Interpolation in an element and its transpose by polynomials of the reference coordinates. Their coefficients are
//! found once for all points in an element: differences of the values at its vertices, direction by direction. A point of
//! a hexahedron then takes 11 operations on vectors, where sums over shape functions and their gradients take 64.

use crate::ElementKind;
use crate::shape::{gradients, values};
use wide::f64x4;

/// The components of a vector, and one that makes four, in a register.
pub type Lanes = f64x4;

/// A field at a point of an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet {
    /// Σ N_v u_v
    pub value: Lanes,
    /// Σ u_v ∂N_v/∂r_k for the three reference coordinates.
    pub along: [Lanes; 3],
}

/// a + s·b
#[inline(always)]
fn add_scaled(a: Lanes, s: f64, b: Lanes) -> Lanes {
    Lanes::splat(s).mul_add(b, a)
}

/// Vertices of a hexahedron by the bits of their reference coordinates, r + 2s + 4t.
const CORNERS: [usize; 8] = [0, 1, 3, 2, 4, 5, 7, 6];

/// A field in an element that is given by its values at the vertices.
///
/// Coefficients of the monomials r^i s^j t^k at i + 2j + 4k, i, j, k = 0, 1: all of them in a hexahedron, those without rs
/// in a prism, the linear ones in a tetrahedron. Of a pyramid, whose functions are rational, the values themselves.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Polynomial {
    coefficients: [Lanes; 8],
    kind: ElementKind,
}

/// Zero everywhere.
impl Default for Polynomial {
    fn default() -> Self {
        Self {
            coefficients: [Lanes::ZERO; 8],
            kind: ElementKind::Hexahedron,
        }
    }
}

impl Polynomial {
    /// The field with values `u(v)` at the vertices.
    #[inline(always)]
    pub fn new(kind: ElementKind, u: impl Fn(usize) -> Lanes) -> Self {
        let mut c = [Lanes::ZERO; 8];
        match kind {
            ElementKind::Hexahedron => {
                for (c, v) in c.iter_mut().zip(CORNERS) {
                    *c = u(v);
                }
                for step in [1, 2, 4] {
                    for k in (0..8).filter(|k| k & step != 0) {
                        c[k] -= c[k - step];
                    }
                }
            }
            ElementKind::Prism => {
                let [low, high] = [0, 3].map(|first| {
                    let origin = u(first);
                    [1, 2].map(|v| u(first + v) - origin)
                });
                c[0] = u(0);
                [c[1], c[2]] = low;
                c[4] = u(3) - c[0];
                c[5] = high[0] - low[0];
                c[6] = high[1] - low[1];
            }
            ElementKind::Tetrahedron => {
                c[0] = u(0);
                for (v, k) in [(1, 1), (2, 2), (3, 4)] {
                    c[k] = u(v) - c[0];
                }
            }
            ElementKind::Pyramid => {
                for (v, c) in c.iter_mut().enumerate().take(kind.vertices()) {
                    *c = u(v);
                }
            }
        }
        Self {
            coefficients: c,
            kind,
        }
    }

    /// Value and slopes at reference point `r`.
    #[inline(always)]
    pub fn jet(&self, r: [f64; 3]) -> Jet {
        let c = &self.coefficients;
        match self.kind {
            ElementKind::Hexahedron | ElementKind::Prism => {
                let level = |k: usize| add_scaled(c[k], r[2], c[k + 4]);
                let (p0, p1, p2, p3) = (level(0), level(1), level(2), level(3));
                let along_s = add_scaled(p2, r[0], p3);
                let row = add_scaled(p0, r[0], p1);
                let (near, far) = (add_scaled(c[4], r[0], c[5]), add_scaled(c[6], r[0], c[7]));
                Jet {
                    value: add_scaled(row, r[1], along_s),
                    along: [
                        add_scaled(p1, r[1], p3),
                        along_s,
                        add_scaled(near, r[1], far),
                    ],
                }
            }
            ElementKind::Tetrahedron => Jet {
                value: self.value(r),
                along: [c[1], c[2], c[4]],
            },
            ElementKind::Pyramid => {
                let gradient = gradients(self.kind, r);
                let mut along = [Lanes::ZERO; 3];
                for (v, u) in c.iter().enumerate().take(self.kind.vertices()) {
                    for (along, slope) in along.iter_mut().zip(gradient[v]) {
                        *along = add_scaled(*along, slope, *u);
                    }
                }
                let value = self.value(r);
                Jet { value, along }
            }
        }
    }

    /// The value of [`Polynomial::jet`] alone.
    #[inline(always)]
    pub fn value(&self, r: [f64; 3]) -> Lanes {
        let c = &self.coefficients;
        match self.kind {
            ElementKind::Hexahedron | ElementKind::Prism => {
                let level = |k: usize| add_scaled(c[k], r[2], c[k + 4]);
                let along_s = add_scaled(level(2), r[0], level(3));
                add_scaled(add_scaled(level(0), r[0], level(1)), r[1], along_s)
            }
            ElementKind::Tetrahedron => {
                let along_r = add_scaled(c[0], r[0], c[1]);
                add_scaled(add_scaled(along_r, r[1], c[2]), r[2], c[4])
            }
            ElementKind::Pyramid => {
                let vertices = values(self.kind, r).into_iter().zip(c);
                vertices.fold(Lanes::ZERO, |sum, (n, u)| add_scaled(sum, n, *u))
            }
        }
    }
}

/// Sums over points in an element that become values at its vertices: the transpose of [`Polynomial`].
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Moments {
    /// By monomials as the coefficients there; of a pyramid by vertices.
    sums: [Lanes; 8],
    kind: ElementKind,
}

impl Moments {
    /// No points yet.
    #[inline(always)]
    pub fn new(kind: ElementKind) -> Self {
        let sums = [Lanes::ZERO; 8];
        Self { sums, kind }
    }

    /// Adds f times the value and g_k times the slopes at reference point `r`.
    #[inline(always)]
    pub fn add(&mut self, f: Lanes, g: [Lanes; 3], r: [f64; 3]) {
        self.add_all(std::iter::once((f, g, r)));
    }

    /// As [`Moments::add`] for many points, the sums in registers.
    #[inline(always)]
    pub fn add_all(&mut self, points: impl Iterator<Item = (Lanes, [Lanes; 3], [f64; 3])>) {
        let mut m = self.sums;
        match self.kind {
            ElementKind::Hexahedron | ElementKind::Prism => {
                for (f, g, r) in points {
                    let p1 = add_scaled(g[0], r[0], f);
                    let p2 = add_scaled(g[1], r[1], f);
                    // Both parts of rs: s (r f + g_r) + r g_s.
                    let p3 = add_scaled(r[0] * g[1], r[1], p1);
                    m[0] += f;
                    m[1] += p1;
                    m[2] += p2;
                    m[3] += p3;
                    m[4] += add_scaled(g[2], r[2], f);
                    m[5] += add_scaled(r[0] * g[2], r[2], p1);
                    m[6] += add_scaled(r[1] * g[2], r[2], p2);
                    m[7] += add_scaled(r[0] * r[1] * g[2], r[2], p3);
                }
            }
            ElementKind::Tetrahedron => {
                for (f, g, r) in points {
                    m[0] += f;
                    for (k, g, r) in [(1, g[0], r[0]), (2, g[1], r[1]), (4, g[2], r[2])] {
                        m[k] += add_scaled(g, r, f);
                    }
                }
            }
            ElementKind::Pyramid => {
                for (f, g, r) in points {
                    let (n, gradient) = (values(self.kind, r), gradients(self.kind, r));
                    for (v, m) in m.iter_mut().enumerate().take(self.kind.vertices()) {
                        *m = add_scaled(*m, n[v], f);
                        (0..3).for_each(|k| *m = add_scaled(*m, gradient[v][k], g[k]));
                    }
                }
            }
        }
        self.sums = m;
    }

    /// Σ N_v f + Σ_k g_k ∂N_v/∂r_k over the points, at the vertices. They sum to Σ f.
    #[inline(always)]
    pub fn vertices(&self) -> [Lanes; 8] {
        let mut m = self.sums;
        match self.kind {
            ElementKind::Hexahedron => {
                for step in [1, 2, 4] {
                    for k in (0..8).filter(|k| k & step != 0) {
                        m[k - step] -= m[k];
                    }
                }
                // The order of the vertices is its own inverse.
                CORNERS.map(|k| m[k])
            }
            ElementKind::Prism => {
                let low = [m[1] - m[5], m[2] - m[6]];
                let first = m[0] - m[4] - low[0] - low[1];
                let fourth = m[4] - m[5] - m[6];
                let none = Lanes::ZERO;
                [first, low[0], low[1], fourth, m[5], m[6], none, none]
            }
            ElementKind::Tetrahedron => {
                m[0] = m[0] - m[1] - m[2] - m[4];
                m[3] = m[4];
                m[4] = Lanes::ZERO;
                m
            }
            ElementKind::Pyramid => m,
        }
    }
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
                let mut lanes = || -> [f64; 4] { std::array::from_fn(|_| random.random()) };
                let u: [[f64; 4]; 8] = std::array::from_fn(|_| lanes());
                let (f, g) = (lanes(), [lanes(), lanes(), lanes()]);
                let (n, gradient) = (values(kind, r), gradients(kind, r));
                let field = Polynomial::new(kind, |v| u[v].into());
                let found = field.jet(r);
                let mut moments = Moments::new(kind);
                moments.add(f.into(), g.map(Lanes::from), r);
                let pushed = moments.vertices().map(Lanes::to_array);
                assert_eq!(field.value(r), found.value);
                let value = found.value.to_array();
                let along = found.along.map(Lanes::to_array);
                for l in 0..4 {
                    let expected: f64 = (0..8).map(|v| n[v] * u[v][l]).sum();
                    assert!((value[l] - expected).abs() < 1e-14);
                    for k in 0..3 {
                        let expected: f64 = (0..8).map(|v| gradient[v][k] * u[v][l]).sum();
                        assert!((along[k][l] - expected).abs() < 1e-14);
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
