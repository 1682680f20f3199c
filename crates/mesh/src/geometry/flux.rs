//! Fluxes of a field through the dual faces of one element.
//!
//! F_ab = ∫(N_a∇N_b − N_b∇N_a)·(v − ∇ψ) with v = Σ N_c v_c, ψ = Σ N_c ψ_c: half the skew Galerkin operator of convection.
//! Its sums Σ_b F_ab = −∫∇N_a·(v − ∇ψ) are those of ½(v_a + v_b)·S_ab − w_ab (ψ_b − ψ_a) but for the boundary, pair by pair
//! it is not: there v is the mean of two nodes, which a wave across the pair leaves as it is, where the integral
//! smooths it as it smooths everything else.

use super::element::{self, Form, Pair, Point};
use crate::shape::{self, cofactors};
use crate::{BoundaryFace, ElementKind, Periods};
use std::sync::LazyLock;

/// Pairs of vertices of the kind with the most.
const MOST_PAIRS: usize = 28;

/// A Gauss point with, for each direction of the reference element, N_a ∂N_b − N_b ∂N_a of every pair.
struct FluxPoint {
    weight: f64,
    n: [f64; 8],
    gradient: [[f64; 3]; 8],
    pairs: [[f64; MOST_PAIRS]; 3],
}

/// How fluxes of a kind of element are integrated: at the points of S and w, so that sums agree to round-off; on
/// tetrahedra in closed form.
pub struct FluxRule {
    kind: ElementKind,
    pairs: Vec<Pair>,
    points: Vec<FluxPoint>,
}

static RULES: LazyLock<[FluxRule; 4]> = LazyLock::new(|| {
    ElementKind::ALL.map(|kind| {
        let pairs = Form::Galerkin.pairs(kind);
        FluxRule {
            kind,
            points: element::rule(kind)
                .iter()
                .map(|p| FluxPoint::new(p, &pairs))
                .collect(),
            pairs,
        }
    })
});

impl FluxPoint {
    fn new(point: &Point, pairs: &[Pair]) -> Self {
        let (n, g) = (&point.n, &point.gradient);
        let along = |k: usize| {
            let mut row = [0.0; MOST_PAIRS];
            for (value, &(a, b)) in row.iter_mut().zip(pairs) {
                let (a, b) = (a as usize, b as usize);
                *value = n[a] * g[b][k] - n[b] * g[a][k];
            }
            row
        };
        Self {
            weight: point.weight,
            n: *n,
            gradient: *g,
            pairs: [0, 1, 2].map(along),
        }
    }
}

impl FluxRule {
    /// The rule of a kind.
    pub fn of(kind: ElementKind) -> &'static Self {
        &RULES[kind as usize]
    }

    /// Pairs of vertices a < b, in the order of the fluxes.
    pub fn pairs(&self) -> &[(u8, u8)] {
        &self.pairs
    }

    /// F_ab \[m³/s\] of the pairs of an element with vertices `coordinates` \[m\], from (v, ψ) \[m/s, m²/s\] at the vertices.
    #[inline]
    pub fn fluxes(&self, coordinates: &[[f64; 3]; 8], field: &[[f64; 4]; 8], fluxes: &mut [f64]) {
        match self.kind {
            ElementKind::Tetrahedron => fluxes.copy_from_slice(&tetrahedron(coordinates, field)),
            ElementKind::Pyramid => self.integrate::<5, 10>(coordinates, field, fluxes),
            ElementKind::Prism => self.integrate::<6, 15>(coordinates, field, fluxes),
            ElementKind::Hexahedron => self.integrate::<8, 28>(coordinates, field, fluxes),
        }
    }

    /// As [`FluxRule::fluxes`] for V vertices and P pairs.
    #[inline(always)]
    fn integrate<const V: usize, const P: usize>(
        &self,
        coordinates: &[[f64; 3]; 8],
        field: &[[f64; 4]; 8],
        out: &mut [f64],
    ) {
        // (x, y, z, ψ), relative to the first vertex.
        let mut place = [[0.0; 4]; V];
        for a in 1..V {
            (0..3).for_each(|c| place[a][c] = coordinates[a][c] - coordinates[0][c]);
            place[a][3] = field[a][3] - field[0][3];
        }
        let mut fluxes = [0.0; P];
        for point in &self.points {
            let (mut along, mut v) = ([[0.0; 4]; 3], [0.0; 4]);
            for a in 0..V {
                for (along, g) in along.iter_mut().zip(point.gradient[a]) {
                    (0..4).for_each(|c| along[c] = g.mul_add(place[a][c], along[c]));
                }
                (0..4).for_each(|c| v[c] = point.n[a].mul_add(field[a][c], v[c]));
            }
            let columns = along.map(|[x, y, z, _]| [x, y, z]);
            let (rows, determinant) = cofactors(&columns);
            let inverse = determinant.recip();
            // v − ∇ψ; times det J its components along the reference directions.
            let carried: [f64; 3] = std::array::from_fn(|c| {
                let slope: f64 = (0..3).map(|k| rows[k][c] * along[k][3]).sum();
                v[c] - inverse * slope
            });
            let through = rows.map(|row| point.weight * shape::dot(row, carried));
            let [r, s, t] = &point.pairs;
            for p in 0..P {
                let ahead = through[0].mul_add(r[p], fluxes[p]);
                fluxes[p] = through[2].mul_add(t[p], through[1].mul_add(s[p], ahead));
            }
        }
        out.copy_from_slice(&fluxes);
    }
}

/// F_ab = t_a·R_b − t_b·R_a with R_a = det J ∇N_a and t_a = ∫N_a (v − ∇ψ)/det J = ((v_a + Σ v_c)/20 − ∇ψ/4)/6.
#[inline(always)]
fn tetrahedron(coordinates: &[[f64; 3]; 8], field: &[[f64; 4]; 8]) -> [f64; 6] {
    let edge = |a: usize| shape::minus(coordinates[a], coordinates[0]);
    let (rows, determinant) = cofactors(&[edge(1), edge(2), edge(3)]);
    let rise = |a: usize| (field[a][3] - field[0][3]) / (24.0 * determinant);
    let rises = [rise(1), rise(2), rise(3)];
    let common: [f64; 3] = std::array::from_fn(|c| {
        let sum = (field[0][c] + field[1][c]) + (field[2][c] + field[3][c]);
        sum / 120.0 - (0..3).map(|k| rises[k] * rows[k][c]).sum::<f64>()
    });
    let t: [[f64; 3]; 4] =
        std::array::from_fn(|a| std::array::from_fn(|c| common[c] + field[a][c] / 120.0));
    let r = |a: usize| match a {
        0 => std::array::from_fn(|c| -(rows[0][c] + rows[1][c] + rows[2][c])),
        _ => rows[a - 1],
    };
    let flux = |a: usize, b: usize| shape::dot(t[a], r(b)) - shape::dot(t[b], r(a));
    [
        flux(0, 1),
        flux(0, 2),
        flux(0, 3),
        flux(1, 2),
        flux(1, 3),
        flux(2, 3),
    ]
}

/// Pairs of vertices of a boundary face with ½ ∮N_a N_b n \[m²\]: times v_b − v_a it is what pair sums of interpolated
/// velocities hold and those of [`FluxRule::fluxes`] do not.
pub fn face_pairs(
    face: &BoundaryFace,
    nodes: &[[f64; 3]],
    periods: &Periods,
) -> Vec<((u8, u8), [f64; 3])> {
    let points = element::face_points(face, nodes, periods);
    let vertices = face.vertices;
    let pairs = (0..vertices).flat_map(|a| (a + 1..vertices).map(move |b| (a, b)));
    let area = |(a, b): (u8, u8)| {
        let mut area = [0.0; 3];
        for (n, normal) in &points {
            let share = 0.5 * n[a as usize] * n[b as usize];
            (0..3).for_each(|c| area[c] += share * normal[c]);
        }
        ((a, b), area)
    };
    pairs.map(area).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Image;
    use crate::jacobian::tests::reference;

    fn wave(k: usize) -> f64 {
        (1.0 + 5.0 * k as f64).sin()
    }

    /// A warped element of a kind, and (v, ψ) at its vertices.
    fn warped(kind: ElementKind) -> ([[f64; 3]; 8], [[f64; 4]; 8]) {
        let mut x = reference(kind);
        for (k, x) in x[..kind.vertices()].iter_mut().flatten().enumerate() {
            *x += 0.15 * wave(k);
        }
        let field = std::array::from_fn(|a| std::array::from_fn(|c| wave(100 + 4 * a + c)));
        (x, field)
    }

    #[test]
    fn sums_are_those_of_pairs_with_what_the_boundary_adds() {
        for kind in ElementKind::ALL {
            let (x, field) = warped(kind);
            let n = kind.vertices();
            let rule = FluxRule::of(kind);
            let mut fluxes = vec![0.0; rule.pairs().len()];
            rule.fluxes(&x, &field, &mut fluxes);
            let mut given = element::Shares::default();
            element::galerkin(kind, &x, &mut given).expect("positive");
            let mut differences = vec![0.0; n];
            let mut add = |(a, b): (usize, usize), flux: f64| {
                differences[a] += flux;
                differences[b] -= flux;
            };
            for (p, &(a, b)) in rule.pairs().iter().enumerate() {
                let (a, b) = (usize::from(a), usize::from(b));
                let (u, v, s) = (field[a], field[b], given.faces[p]);
                let across: f64 = (0..3).map(|c| 0.5 * (u[c] + v[c]) * s[c]).sum();
                add((a, b), fluxes[p] - (across - s[3] * (v[3] - u[3])));
            }
            for corners in kind.faces() {
                let mut face = BoundaryFace {
                    patch: 0,
                    vertices: corners.len() as u8,
                    nodes: [0; 4],
                    images: [Image::ZERO; 4],
                };
                (0..corners.len()).for_each(|v| face.nodes[v] = corners[v] as u32);
                for ((a, b), area) in face_pairs(&face, &x, &Periods::default()) {
                    let (a, b) = (corners[usize::from(a)], corners[usize::from(b)]);
                    let rise = |c: usize| field[b][c] - field[a][c];
                    add((a, b), (0..3).map(|c| area[c] * rise(c)).sum());
                }
            }
            for difference in differences {
                assert!(difference.abs() < 1e-14, "{}: {difference:e}", kind.name());
            }
        }
    }

    /// A uniform field gives what pairs give, pair by pair, on any element.
    #[test]
    fn a_uniform_field_goes_through_the_dual_faces() {
        for kind in ElementKind::ALL {
            let (x, _) = warped(kind);
            let (u, slope) = ([0.3, -1.1, 0.7], [0.4, 0.9, -0.2]);
            let field = std::array::from_fn(|a| [u[0], u[1], u[2], shape::dot(slope, x[a])]);
            let rule = FluxRule::of(kind);
            let mut fluxes = vec![0.0; rule.pairs().len()];
            rule.fluxes(&x, &field, &mut fluxes);
            let mut given = element::Shares::default();
            element::galerkin(kind, &x, &mut given).expect("positive");
            for (flux, [x, y, z, _]) in fluxes.iter().zip(&given.faces) {
                let wanted = shape::dot([0, 1, 2].map(|c| u[c] - slope[c]), [*x, *y, *z]);
                assert!(
                    (flux - wanted).abs() < 1e-14,
                    "{}: {flux} {wanted}",
                    kind.name()
                );
            }
        }
    }
}
