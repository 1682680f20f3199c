//! Sign and size of the element map at the vertices.

use crate::ElementKind;

/// Vertex with the smallest scaled Jacobian, that Jacobian \[m³\], and the same divided by the lengths of its edges.
///
/// The apex of a pyramid, where the map is singular, is left out; all vertices of a tetrahedron have the same.
pub(crate) fn smallest_jacobian(kind: ElementKind, x: &[[f64; 3]; 8]) -> (usize, f64, f64) {
    let edge = |a: usize, b: usize| -> [f64; 3] { std::array::from_fn(|c| x[b][c] - x[a][c]) };
    let length = |a: [f64; 3]| a.iter().map(|c| c * c).sum::<f64>().sqrt();
    let at = |&[v, a, b, c]: &[usize; 4]| {
        let (a, b, c) = (edge(v, a), edge(v, b), edge(v, c));
        let cross = [
            b[1] * c[2] - b[2] * c[1],
            b[2] * c[0] - b[0] * c[2],
            b[0] * c[1] - b[1] * c[0],
        ];
        let jacobian: f64 = (0..3).map(|k| a[k] * cross[k]).sum();
        let lengths = length(a) * length(b) * length(c);
        let scaled = if lengths > 0.0 {
            jacobian / lengths
        } else {
            0.0
        };
        (v, jacobian, scaled)
    };
    corners(kind)
        .iter()
        .map(at)
        .min_by(|a, b| a.2.total_cmp(&b.2))
        .unwrap_or((0, 0.0, 0.0))
}

/// Vertex and its three neighbours in right-handed order.
fn corners(kind: ElementKind) -> &'static [[usize; 4]] {
    match kind {
        ElementKind::Tetrahedron => &[[0, 1, 2, 3]],
        ElementKind::Pyramid => &[[0, 1, 3, 4], [1, 2, 0, 4], [2, 3, 1, 4], [3, 0, 2, 4]],
        ElementKind::Prism => &[
            [0, 1, 2, 3],
            [1, 2, 0, 4],
            [2, 0, 1, 5],
            [3, 5, 4, 0],
            [4, 3, 5, 1],
            [5, 4, 3, 2],
        ],
        ElementKind::Hexahedron => &[
            [0, 1, 3, 4],
            [1, 2, 0, 5],
            [2, 3, 1, 6],
            [3, 0, 2, 7],
            [4, 7, 5, 0],
            [5, 4, 6, 1],
            [6, 5, 7, 2],
            [7, 6, 4, 3],
        ],
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// One element of each kind with unit corners.
    pub(crate) fn reference(kind: ElementKind) -> [[f64; 3]; 8] {
        let (o, x, y, z) = ([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        let (xy, xz, yz) = ([1.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]);
        match kind {
            ElementKind::Tetrahedron => [o, x, y, z, o, o, o, o],
            ElementKind::Pyramid => [o, x, xy, y, [0.5, 0.5, 1.0], o, o, o],
            ElementKind::Prism => [o, x, y, z, xz, yz, o, o],
            ElementKind::Hexahedron => [o, x, xy, y, z, xz, [1.0; 3], yz],
        }
    }

    #[test]
    fn jacobians_are_positive_at_every_corner_and_change_sign_in_a_mirror() {
        for kind in ElementKind::ALL {
            let x = reference(kind);
            let (_, _, scaled) = smallest_jacobian(kind, &x);
            assert!(scaled > 0.2, "{}: {scaled}", kind.name());
            let mirrored = x.map(|[x, y, z]| [-x, y, z]);
            assert!(smallest_jacobian(kind, &mirrored).2 < -0.2);
        }
    }
}
