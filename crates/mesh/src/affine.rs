//! Elements whose map from the reference domain is linear: every tetrahedron, parallelepipeds, prisms and pyramids on
//! parallelograms with straight sides. A point is found in them by one product instead of Newton's method.

use crate::ElementKind;
use crate::shape::{self, Weights, cofactors, dot, minus, relative};

/// r = J⁻¹ (x − x₀).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    origin: [f64; 3],
    /// Rows of J⁻¹ \[1/m\].
    inverse: [[f64; 3]; 3],
}

impl Affine {
    /// Of an element with vertices `coordinates` \[m\]; none where a vertex is off the linear map by more than the
    /// round-off of its coordinates, or the element is flat.
    pub fn of(kind: ElementKind, coordinates: &[[f64; 3]; 8]) -> Option<Self> {
        let reference = shape::vertices(kind);
        let x = relative(kind, coordinates);
        let columns = [0, 1, 2].map(|k| {
            let unit: [f64; 3] = std::array::from_fn(|c| if c == k { 1.0 } else { 0.0 });
            let vertex = reference.iter().position(|r| *r == unit);
            vertex.map_or([0.0; 3], |v| x[v])
        });
        let largest = coordinates[..kind.vertices()].as_flattened();
        let largest = largest.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let off = |(r, x): (&[f64; 3], &[f64; 3])| {
            let linear = |c: usize| (0..3).map(|k| r[k] * columns[k][c]).sum::<f64>();
            (0..3).any(|c| (x[c] - linear(c)).abs() > 8.0 * f64::EPSILON * largest)
        };
        let (rows, determinant) = cofactors(&columns);
        if reference.iter().zip(&x).any(off) || determinant.abs() < f64::MIN_POSITIVE {
            return None;
        }
        Some(Self {
            origin: coordinates[0],
            inverse: rows.map(|row| row.map(|c| c / determinant)),
        })
    }

    /// Reference point of a physical point \[m\], inside or outside.
    pub fn locate(&self, point: [f64; 3]) -> [f64; 3] {
        let x = minus(point, self.origin);
        self.inverse.map(|row| dot(row, x))
    }

    /// Values and physical gradients at reference point `r`, as [`shape::physical`].
    pub fn weights(&self, kind: ElementKind, r: [f64; 3]) -> Weights {
        let [a, b, c] = &self.inverse;
        let gradient = shape::gradients(kind, r)
            .map(|g| std::array::from_fn(|k| g[0] * a[k] + g[1] * b[k] + g[2] * c[k]));
        Weights {
            n: shape::values(kind, r),
            gradient,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINDS: [ElementKind; 4] = [
        ElementKind::Tetrahedron,
        ElementKind::Pyramid,
        ElementKind::Prism,
        ElementKind::Hexahedron,
    ];

    fn mapped(kind: ElementKind) -> [[f64; 3]; 8] {
        let columns = [[0.3, 0.1, -0.05], [-0.1, 0.4, 0.02], [0.05, -0.08, 0.2]];
        let mut x = [[0.0; 3]; 8];
        for (x, r) in x.iter_mut().zip(shape::vertices(kind)) {
            let at = |c: usize| (0..3).map(|k| r[k] * columns[k][c]).sum::<f64>();
            *x = [2.0 + at(0), -1.0 + at(1), 5.0 + at(2)];
        }
        x
    }

    #[test]
    fn linear_maps_are_inverted_as_by_newton() {
        for kind in KINDS {
            let x = mapped(kind);
            let affine = Affine::of(kind, &x).expect("linear");
            for r in [[0.2, 0.3, 0.1], [0.05, 0.6, 0.3], [1.4, -0.3, 0.8]] {
                let point = shape::position(kind, &x, r);
                let found = affine.locate(point);
                let newton = shape::locate(kind, &x, point).expect("an answer");
                for c in 0..3 {
                    assert!((found[c] - newton[c]).abs() < 1e-12, "{kind:?} {c}");
                }
                let (a, b) = (affine.weights(kind, r), shape::physical(kind, &x, r));
                for v in 0..kind.vertices() {
                    assert!((a.n[v] - b.n[v]).abs() < 1e-14);
                    for c in 0..3 {
                        assert!((a.gradient[v][c] - b.gradient[v][c]).abs() < 1e-11);
                    }
                }
            }
        }
    }

    #[test]
    fn bent_elements_are_refused() {
        for kind in KINDS {
            let mut x = mapped(kind);
            x[kind.vertices() - 1][0] += 1e-9;
            let bends = kind == ElementKind::Prism || kind == ElementKind::Hexahedron;
            assert_eq!(Affine::of(kind, &x).is_none(), bends, "{kind:?}");
        }
        let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let mut x = [[0.0; 3]; 8];
        x[..3].copy_from_slice(&flat);
        assert_eq!(Affine::of(ElementKind::Tetrahedron, &x), None);
    }
}
