//! Shape functions of the four element kinds and their inverse map.
//!
//! Reference domains (vertex order as [`ElementKind`]): tetrahedron r, s, t ≥ 0, r + s + t ≤ 1; pyramid 0 ≤ t ≤ 1,
//! 0 ≤ r, s ≤ 1 − t with the apex at (0, 0, 1) and rational functions (Bedrosian 1992), so that a pyramid on a
//! parallelogram is mapped linearly; prism r, s ≥ 0, r + s ≤ 1, 0 ≤ t ≤ 1; hexahedron \[0, 1\]³. Functions sum to one
//! and reproduce linear fields; entries beyond the kind's vertices are zero.

use crate::ElementKind;
use crate::jet::{Lanes, Polynomial};

/// Shape functions at a point of an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// N_a \[−\].
    pub n: [f64; 8],
    /// ∇N_a in physical space \[1/m\].
    pub gradient: [[f64; 3]; 8],
}

/// Newton steps before the inverse map gives up.
const STEPS: usize = 40;
/// Reference step after which one more quadratic step would be round-off.
const CONVERGED: f64 = 1e-8;
/// Distance to the apex below which its direction-dependent gradient is replaced by the one on the axis.
const APEX: f64 = 1e-12;

/// Values N_a at reference point `r`.
pub fn values(kind: ElementKind, r: [f64; 3]) -> [f64; 8] {
    let [r, s, t] = r;
    match kind {
        ElementKind::Tetrahedron => [1.0 - r - s - t, r, s, t, 0.0, 0.0, 0.0, 0.0],
        ElementKind::Pyramid => {
            let (q, [x, y]) = pyramid(r, s, t);
            [
                q * (1.0 - x) * (1.0 - y),
                q * x * (1.0 - y),
                q * x * y,
                q * (1.0 - x) * y,
                t,
                0.0,
                0.0,
                0.0,
            ]
        }
        ElementKind::Prism => {
            let (o, u) = (1.0 - r - s, 1.0 - t);
            [o * u, r * u, s * u, o * t, r * t, s * t, 0.0, 0.0]
        }
        ElementKind::Hexahedron => {
            let (a, b, c) = (1.0 - r, 1.0 - s, 1.0 - t);
            let square = [a * b, r * b, r * s, a * s];
            std::array::from_fn(|k| square[k % 4] * if k < 4 { c } else { t })
        }
    }
}

/// Gradients ∂N_a/∂(r, s, t) at reference point `r`.
pub fn gradients(kind: ElementKind, r: [f64; 3]) -> [[f64; 3]; 8] {
    let [r, s, t] = r;
    let mut g = [[0.0; 3]; 8];
    match kind {
        ElementKind::Tetrahedron => {
            g[0] = [-1.0; 3];
            (0..3).for_each(|k| g[k + 1][k] = 1.0);
        }
        ElementKind::Pyramid => {
            let (_, [x, y]) = pyramid(r, s, t);
            g[0] = [y - 1.0, x - 1.0, x * y - 1.0];
            g[1] = [1.0 - y, -x, -x * y];
            g[2] = [y, x, x * y];
            g[3] = [-y, 1.0 - x, -x * y];
            g[4] = [0.0, 0.0, 1.0];
        }
        ElementKind::Prism => {
            let triangle = [
                (1.0 - r - s, [-1.0, -1.0]),
                (r, [1.0, 0.0]),
                (s, [0.0, 1.0]),
            ];
            for (k, (n, [dr, ds])) in triangle.into_iter().enumerate() {
                g[k] = [dr * (1.0 - t), ds * (1.0 - t), -n];
                g[k + 3] = [dr * t, ds * t, n];
            }
        }
        ElementKind::Hexahedron => {
            let (a, b, c) = (1.0 - r, 1.0 - s, 1.0 - t);
            let square = [a * b, r * b, r * s, a * s];
            let along_r = [-b, b, s, -s];
            let along_s = [-a, -r, r, a];
            for k in 0..4 {
                g[k] = [along_r[k] * c, along_s[k] * c, -square[k]];
                g[k + 4] = [along_r[k] * t, along_s[k] * t, square[k]];
            }
        }
    }
    g
}

/// 1 − t and the coordinates (r, s)/(1 − t) on the collapsed cube; the axis at the apex.
fn pyramid(r: f64, s: f64, t: f64) -> (f64, [f64; 2]) {
    let q = 1.0 - t;
    if q.abs() < APEX {
        (q, [0.5, 0.5])
    } else {
        (q, [r / q, s / q])
    }
}

/// True when `r` is in the reference domain, enlarged by `tolerance` (reference units) on every face.
pub fn inside(kind: ElementKind, r: [f64; 3], tolerance: f64) -> bool {
    let [r, s, t] = r;
    let unit = |x: f64| x >= -tolerance && x <= 1.0 + tolerance;
    match kind {
        ElementKind::Tetrahedron => {
            r >= -tolerance && s >= -tolerance && t >= -tolerance && r + s + t <= 1.0 + tolerance
        }
        ElementKind::Pyramid => {
            let top = 1.0 - t + tolerance;
            unit(t) && r >= -tolerance && s >= -tolerance && r <= top && s <= top
        }
        ElementKind::Prism => {
            r >= -tolerance && s >= -tolerance && r + s <= 1.0 + tolerance && unit(t)
        }
        ElementKind::Hexahedron => unit(r) && unit(s) && unit(t),
    }
}

/// The face, in the order of [`ElementKind::faces`], that a reference point lies farthest behind.
pub fn exit(kind: ElementKind, r: [f64; 3]) -> usize {
    let [r, s, t] = r;
    let farthest = |behind: &[f64]| {
        let faces = behind.iter().enumerate();
        let farther = |a: (usize, f64), b: (usize, f64)| if b.1 > a.1 { b } else { a };
        faces
            .fold((0, f64::NEG_INFINITY), |a, (f, &b)| farther(a, (f, b)))
            .0
    };
    match kind {
        ElementKind::Tetrahedron => farthest(&[-t, -s, r + s + t - 1.0, -r]),
        ElementKind::Pyramid => farthest(&[-t, -s, r + t - 1.0, s + t - 1.0, -r]),
        ElementKind::Prism => farthest(&[-t, t - 1.0, -s, r + s - 1.0, -r]),
        ElementKind::Hexahedron => farthest(&[-t, t - 1.0, -s, r - 1.0, s - 1.0, -r]),
    }
}

/// The map from the reference domain to an element, in the form that takes many points.
#[derive(Clone, Copy, Debug)]
pub struct Map {
    /// First vertex \[m\].
    origin: [f64; 3],
    /// Place relative to it, so that round-off scales with the element.
    from_origin: Polynomial,
}

impl Map {
    /// Of an element with vertices `coordinates` \[m\].
    #[inline]
    pub fn new(kind: ElementKind, coordinates: &[[f64; 3]; 8]) -> Self {
        let x = padded(kind, coordinates);
        Self {
            origin: coordinates[0],
            from_origin: Polynomial::new(kind, |v| x[v]),
        }
    }

    /// Physical point of reference point `r` \[m\]: Σ N_a x_a.
    #[inline]
    pub fn position(&self, r: [f64; 3]) -> [f64; 3] {
        let from = three(self.from_origin.value(r));
        std::array::from_fn(|c| self.origin[c] + from[c])
    }

    /// Rows ∇r, ∇s, ∇t of J⁻¹ \[1/m\] at reference point `r`.
    #[inline]
    pub fn inverse_jacobian(&self, r: [f64; 3]) -> [[f64; 3]; 3] {
        let columns = self.from_origin.jet(r).along.map(three);
        let (rows, determinant) = cofactors(&columns);
        rows.map(|row| row.map(|c| c / determinant))
    }

    /// Reference point of a physical point \[m\], by Newton's method from `start`; as [`locate`].
    #[inline]
    pub fn locate_from(&self, point: [f64; 3], start: [f64; 3]) -> Option<[f64; 3]> {
        let target = minus(point, self.origin);
        let mut r = start;
        let mut here = self.from_origin.jet(r);
        let mut residual = minus(target, three(here.value));
        for _ in 0..STEPS {
            let (cofactors, determinant) = cofactors(&here.along.map(three));
            let step: [f64; 3] = std::array::from_fn(|k| dot(cofactors[k], residual) / determinant);
            let length = step.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
            if !length.is_finite() {
                return None;
            }
            let mut fraction = 1.0;
            let old = dot(residual, residual);
            let start = r;
            loop {
                r = std::array::from_fn(|k| start[k] + fraction * step[k]);
                if length < CONVERGED {
                    return Some(r);
                }
                here = self.from_origin.jet(r);
                residual = minus(target, three(here.value));
                if dot(residual, residual) < old {
                    break;
                }
                fraction *= 0.5;
                if fraction < 1e-3 {
                    return None;
                }
            }
        }
        None
    }
}

/// Physical point of reference point `r` \[m\]: Σ N_a x_a.
pub fn position(kind: ElementKind, coordinates: &[[f64; 3]; 8], r: [f64; 3]) -> [f64; 3] {
    Map::new(kind, coordinates).position(r)
}

/// Values and physical gradients J⁻ᵀ ∂N_a at reference point `r` of an element with vertices `coordinates` \[m\].
pub fn physical(kind: ElementKind, coordinates: &[[f64; 3]; 8], r: [f64; 3]) -> Weights {
    let rows = inverse_jacobian(kind, coordinates, r);
    let gradient = gradients(kind, r)
        .map(|g| std::array::from_fn(|c| (0..3).map(|k| g[k] * rows[k][c]).sum()));
    Weights {
        n: values(kind, r),
        gradient,
    }
}

/// Rows ∇r, ∇s, ∇t of J⁻¹ \[1/m\] at reference point `r` of an element with vertices `coordinates` \[m\].
#[inline]
pub fn inverse_jacobian(
    kind: ElementKind,
    coordinates: &[[f64; 3]; 8],
    r: [f64; 3],
) -> [[f64; 3]; 3] {
    Map::new(kind, coordinates).inverse_jacobian(r)
}

/// Columns ∂x/∂r, ∂x/∂s, ∂x/∂t \[m\].
#[inline(always)]
pub(crate) fn jacobian(
    kind: ElementKind,
    coordinates: &[[f64; 3]; 8],
    r: [f64; 3],
) -> [[f64; 3]; 3] {
    (Map::new(kind, coordinates).from_origin.jet(r))
        .along
        .map(three)
}

/// Reference point of a physical point \[m\], by Newton's method from the centre (one step where the map is linear).
///
/// The answer may lie outside the element: ask [`inside`]. None when no answer is found, as may happen for points far
/// from a distorted element.
pub fn locate(kind: ElementKind, coordinates: &[[f64; 3]; 8], point: [f64; 3]) -> Option<[f64; 3]> {
    Map::new(kind, coordinates).locate_from(point, centre(kind))
}

/// Reference point at the mean of the vertices.
pub fn centre(kind: ElementKind) -> [f64; 3] {
    match kind {
        ElementKind::Tetrahedron => [0.25; 3],
        ElementKind::Pyramid => [0.4, 0.4, 0.2],
        ElementKind::Prism => [1.0 / 3.0, 1.0 / 3.0, 0.5],
        ElementKind::Hexahedron => [0.5; 3],
    }
}

/// Reference points of the vertices.
pub fn vertices(kind: ElementKind) -> &'static [[f64; 3]] {
    match kind {
        ElementKind::Tetrahedron => &[
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        ],
        ElementKind::Pyramid => &[
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        ],
        ElementKind::Prism => &[
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 1.0],
            [0.0, 1.0, 1.0],
        ],
        ElementKind::Hexahedron => &[
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 1.0],
            [1.0, 1.0, 1.0],
            [0.0, 1.0, 1.0],
        ],
    }
}

/// Vertices relative to the first one, so that round-off scales with the element and not with its place.
pub(crate) fn relative(kind: ElementKind, coordinates: &[[f64; 3]; 8]) -> [[f64; 3]; 8] {
    padded(kind, coordinates).map(three)
}

#[inline(always)]
fn padded(kind: ElementKind, coordinates: &[[f64; 3]; 8]) -> [Lanes; 8] {
    let mut x = [Lanes::ZERO; 8];
    for a in 1..kind.vertices() {
        let [u, v, w] = minus(coordinates[a], coordinates[0]);
        x[a] = [u, v, w, 0.0].into();
    }
    x
}

#[inline(always)]
fn three(x: Lanes) -> [f64; 3] {
    let [u, v, w, _] = x.to_array();
    [u, v, w]
}

/// Rows of the inverse Jacobian times its determinant, and the determinant.
#[inline(always)]
pub(crate) fn cofactors(columns: &[[f64; 3]; 3]) -> ([[f64; 3]; 3], f64) {
    let [a, b, c] = *columns;
    let rows = [cross(b, c), cross(c, a), cross(a, b)];
    (rows, dot(a, rows[0]))
}

#[inline(always)]
pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline(always)]
pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[cfg(test)]
mod tests;
