//! Viscosity of the modes of hexahedra and prisms that are not linear.
//!
//! The exact ∫∇N_a·∇N_b smooths a wave along each direction by (2 + cos kh)/3 in the other two. A consistent mass does the same to the
//! rate of change, so that it cancels; one correction of the lumped mass gives back part of it only, and waves of four
//! nodes in all directions decay at 0.61 of their rate on hexahedra, 0.80 on prisms (1.3 on tetrahedra, whose pairs on a cube are two-point).
//! The rule of the vertices has no such smoothing; between the two lies an energy of the hourglass modes alone, of which [`SHARE`] is added.
//! Modes are taken orthogonal to linear fields, for which nothing changes (Flanagan & Belytschko 1981).

use crate::ElementKind;
use crate::shape::{self, cofactors, dot};

/// Waves of four nodes in one, two and three directions of uniform hexahedra then decay at 1.08, 1.01 and 0.92 of their rate.
pub(super) const SHARE: f64 = 0.4;

/// Most modes of an element.
const MODES: usize = 4;

/// Values of a mode at the vertices.
type Mode = [f64; 8];

/// Adds to `pairs`, the −K_ab of all a < b \[m\], what the modes of an element with vertices `x` \[m\] get. Nothing on
/// tetrahedra and pyramids, nor on elements that are inverted in the middle.
pub(super) fn add(kind: ElementKind, x: &[[f64; 3]; 8], pairs: &mut [f64]) {
    let modes: &[Mode] = match kind {
        ElementKind::Tetrahedron | ElementKind::Pyramid => return,
        ElementKind::Prism => &PRISM,
        ElementKind::Hexahedron => &HEXAHEDRON,
    };
    let vertices = kind.vertices();
    let reference = shape::gradients(kind, shape::centre(kind));
    let mut columns = [[0.0; 3]; 3];
    for (g, x) in reference.iter().zip(x).take(vertices) {
        for k in 0..3 {
            (0..3).for_each(|c| columns[k][c] += g[k] * x[c]);
        }
    }
    let (rows, determinant) = cofactors(&columns);
    if determinant.is_nan() || determinant <= 0.0 {
        return;
    }
    // Gradients of the reference coordinates, their products, and ∇N.
    let dual = rows.map(|row| row.map(|r| r / determinant));
    let metric: [[f64; 3]; 3] = dual.map(|a| dual.map(|b| dot(a, b)));
    let gradient = reference
        .map(|g| -> [f64; 3] { std::array::from_fn(|c| (0..3).map(|k| g[k] * dual[k][c]).sum()) });
    let mut stripped = [[0.0; 8]; MODES];
    for (stripped, mode) in stripped.iter_mut().zip(modes) {
        let along: [f64; 3] =
            std::array::from_fn(|c| (0..vertices).map(|a| mode[a] * x[a][c]).sum());
        for a in 0..vertices {
            stripped[a] = mode[a] - dot(along, gradient[a]);
        }
    }
    let energy = match kind {
        ElementKind::Prism => prism(&metric, 0.5 * determinant),
        _ => hexahedron(&metric, determinant),
    };
    let mut pairs = pairs.iter_mut();
    for a in 0..vertices {
        for (b, w) in (a + 1..vertices).zip(&mut pairs) {
            for (row, left) in energy.iter().zip(&stripped) {
                for (e, right) in row.iter().zip(&stripped) {
                    *w -= SHARE * e * left[a] * right[b];
                }
            }
        }
    }
}

/// Coefficients of ηζ, ζξ, ξη and ξηζ, with coordinates from −1 to 1: an eighth of their values at the vertices.
const HEXAHEDRON: [Mode; 4] = {
    let e = 0.125;
    [
        [e, e, -e, -e, -e, -e, e, e],
        [e, -e, -e, e, -e, e, e, -e],
        [e, -e, e, -e, e, -e, e, -e],
        [-e, e, -e, e, e, -e, e, -e],
    ]
};

/// Halves of d_1 − d_0 and d_2 − d_0, where d is the difference between the two triangles.
const PRISM: [Mode; 2] = [
    [0.5, -0.5, 0.0, -0.5, 0.5, 0.0, 0.0, 0.0],
    [0.5, 0.0, -0.5, -0.5, 0.0, 0.5, 0.0, 0.0],
];

/// Mean squares of η, ηζ are 1 at the vertices and 1/3, 1/9 exactly.
fn hexahedron(metric: &[[f64; 3]; 3], volume: f64) -> [[f64; MODES]; MODES] {
    // Of coordinates that run from −1 to 1.
    let along: [f64; 3] = std::array::from_fn(|k| 4.0 * metric[k][k]);
    let all: f64 = along.iter().sum();
    let mut energy = [[0.0; MODES]; MODES];
    for k in 0..3 {
        energy[k][k] = 2.0 / 3.0 * volume * (all - along[k]);
    }
    energy[3][3] = 8.0 / 9.0 * volume * all;
    energy
}

/// The mode ζ d, d = q_1 (r − 1/3) + q_2 (s − 1/3): ∇u = ζ ∇d + 2d ∇t. Mean squares of ζ are 1 and 1/3, those of d a third and a
/// twelfth of Σ d_a² = ⅔ (q_1² + q_2² − q_1 q_2).
fn prism(metric: &[[f64; 3]; 3], volume: f64) -> [[f64; MODES]; MODES] {
    let mut energy = [[0.0; MODES]; MODES];
    let across = 4.0 * metric[2][2] / 6.0;
    for (i, row) in energy.iter_mut().enumerate().take(2) {
        for (j, e) in row.iter_mut().enumerate().take(2) {
            let share = if i == j { across } else { -0.5 * across };
            *e = volume * (2.0 / 3.0 * metric[i][j] + share);
        }
    }
    energy
}

#[cfg(test)]
mod tests {
    use super::super::element::{self, Shares};
    use super::*;

    /// The whole of it leaves pairs along edges and across triangles only.
    #[test]
    fn right_elements_become_two_point() {
        for kind in [ElementKind::Hexahedron, ElementKind::Prism] {
            let size = [0.7, 1.1, 0.4];
            let mut x = [[0.0; 3]; 8];
            for (x, r) in x.iter_mut().zip(shape::vertices(kind)) {
                *x = std::array::from_fn(|c| size[c] * r[c]);
            }
            let mut shares = Shares::default();
            element::galerkin(kind, &x, &mut shares).expect("upright");
            let n = kind.vertices();
            let mut pairs = shares.faces.iter().zip(&shares.stiffening);
            for a in 0..n {
                for (b, (face, more)) in (a + 1..n).zip(&mut pairs) {
                    let apart = (0..3).filter(|&c| x[a][c] != x[b][c]).count();
                    let in_triangle = kind == ElementKind::Prism && x[a][2] == x[b][2];
                    let whole = face[3] + more / SHARE;
                    let wanted = apart == 1 && (whole > 0.01) || in_triangle || whole.abs() < 1e-14;
                    assert!(wanted, "{kind:?}, {a} {b}: {whole:e}");
                    assert!(apart == 1 || in_triangle || face[3].abs() > 1e-3);
                }
            }
        }
    }

    /// Energy of any field, zero for linear ones, on twisted elements.
    #[test]
    fn linear_fields_feel_nothing_and_others_lose_energy() {
        for kind in [ElementKind::Hexahedron, ElementKind::Prism] {
            let n = kind.vertices();
            let mut x = [[0.0; 3]; 8];
            for (a, (x, r)) in x.iter_mut().zip(shape::vertices(kind)).enumerate() {
                let shift = |c: usize| 0.17 * (1.0 + (7 * a + 3 * c) as f64).sin();
                *x = std::array::from_fn(|c| r[c] + shift(c));
            }
            let mut pairs = vec![0.0; n * (n - 1) / 2];
            add(kind, &x, &mut pairs);
            let energy = |u: &dyn Fn(usize) -> f64| {
                let mut pairs = pairs.iter();
                let mut sum = 0.0;
                for a in 0..n {
                    for (b, w) in (a + 1..n).zip(&mut pairs) {
                        sum += w * (u(a) - u(b)).powi(2);
                    }
                }
                sum
            };
            let linear = energy(&|a| 0.3 * x[a][0] - 1.2 * x[a][1] + 0.5 * x[a][2] + 2.0);
            assert!(linear.abs() < 1e-14, "{kind:?}: {linear:e}");
            for seed in 0..20 {
                let noise = energy(&|a| (1.0 + (11 * seed + 5 * a) as f64).sin());
                assert!(noise > 1e-3, "{kind:?}: {noise:e}");
            }
        }
    }
}
