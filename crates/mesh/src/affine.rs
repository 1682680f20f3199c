//! Elements whose map from the reference domain is linear: every tetrahedron, parallelepipeds, prisms and pyramids on
//! parallelograms with straight sides. A point is found in them by one product instead of Newton's method.

use crate::ElementKind;
use crate::jet::Lanes;
use crate::shape::{self, cofactors, minus, relative};

/// r = J⁻¹ (x − x₀): of an element with a linear map, or its tangent at the centre of another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// ∂(r, s, t)/∂x_c \[1/m\] and x₀_c \[m\], for the three c.
    columns: [[f64; 4]; 3],
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
        Some(Self::new(
            rows.map(|row| row.map(|c| c / determinant)),
            coordinates[0],
        ))
    }

    /// The tangent at the centre of an element with vertices `coordinates` \[m\]; not finite where that is flat.
    pub fn tangent(kind: ElementKind, coordinates: &[[f64; 3]; 8]) -> Self {
        let r = shape::centre(kind);
        let mut tangent = Self::new(
            shape::inverse_jacobian(kind, coordinates, r),
            shape::position(kind, coordinates, r),
        );
        let columns = shape::jacobian(kind, coordinates, r);
        for (c, column) in tangent.columns.iter_mut().enumerate() {
            column[3] -= (0..3).map(|k| r[k] * columns[k][c]).sum::<f64>();
        }
        tangent
    }

    fn new(rows: [[f64; 3]; 3], origin: [f64; 3]) -> Self {
        let column = |c: usize| [rows[0][c], rows[1][c], rows[2][c], origin[c]];
        Self {
            columns: [0, 1, 2].map(column),
        }
    }

    /// Reference point of a physical point \[m\], inside or outside.
    #[inline(always)]
    pub fn locate(&self, point: [f64; 3]) -> [f64; 3] {
        let [a, b, c] = self.columns;
        let [x, y, z] = minus(point, [a[3], b[3], c[3]]).map(Lanes::splat);
        let [a, b, c] = [a, b, c].map(Lanes::from);
        let [r, s, t, _] = z.mul_add(c, y.mul_add(b, x * a)).to_array();
        [r, s, t]
    }

    /// Columns ∂(r, s, t)/∂x_c of J⁻¹ \[1/m\] in the first three of four.
    #[inline(always)]
    pub fn columns(&self) -> &[[f64; 4]; 3] {
        &self.columns
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
                let rows = shape::inverse_jacobian(kind, &x, r);
                for (c, column) in affine.columns().iter().enumerate() {
                    for k in 0..3 {
                        assert!((column[k] - rows[k][c]).abs() < 1e-11);
                    }
                }
                let tangent = Affine::tangent(kind, &x).locate(point);
                for c in 0..3 {
                    assert!((tangent[c] - r[c]).abs() < 1e-12, "{kind:?} {c}");
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
