//! What one element gives to its pairs of vertices, volumes and faces.

use crate::jacobian::smallest_jacobian;
use crate::shape::{self, cofactors, cross, dot, minus};
use crate::{BoundaryFace, ElementKind, Periods};
use std::sync::LazyLock;

/// A pair of local vertices a < b.
pub(super) type Pair = (u8, u8);

/// Shape functions of a kind at a Gauss point; entries beyond the vertices are zero.
///
/// Gradients are those on the cube that collapses onto the element, on a tetrahedron those of [`shape`].
pub(super) struct Point {
    pub weight: f64,
    pub n: [f64; 8],
    pub gradient: [[f64; 3]; 8],
}

/// Vertex onto which each corner of the cube (in the order of a hexahedron) collapses, for each kind.
const COLLAPSE: [[usize; 8]; 4] = [
    [0, 1, 2, 2, 3, 3, 3, 3],
    [0, 1, 2, 3, 4, 4, 4, 4],
    [0, 1, 2, 2, 3, 4, 5, 5],
    [0, 1, 2, 3, 4, 5, 6, 7],
];

static RULES: LazyLock<[Vec<Point>; 4]> = LazyLock::new(|| ElementKind::ALL.map(rule));

/// Gauss points that integrate area vectors and volumes exactly: one where the integrands are linear (their gradients
/// are constant), two a direction where they are cubic. The weights of a pyramid are rational: three a direction.
pub(super) fn rule(kind: ElementKind) -> Vec<Point> {
    let gauss = match kind {
        ElementKind::Tetrahedron => {
            let r = shape::centre(kind);
            return vec![Point {
                weight: 1.0 / 6.0,
                n: shape::values(kind, r),
                gradient: shape::gradients(kind, r),
            }];
        }
        ElementKind::Pyramid => {
            let x = 0.5 * 0.6f64.sqrt();
            vec![(-x, 5.0 / 18.0), (0.0, 4.0 / 9.0), (x, 5.0 / 18.0)]
        }
        ElementKind::Prism | ElementKind::Hexahedron => {
            let x = 0.5 / 3f64.sqrt();
            vec![(-x, 0.5), (x, 0.5)]
        }
    };
    let mut points = Vec::new();
    for &(z, wz) in &gauss {
        for &(y, wy) in &gauss {
            for &(x, wx) in &gauss {
                points.push(collapsed(kind, [x + 0.5, y + 0.5, z + 0.5], wx * wy * wz));
            }
        }
    }
    points
}

fn collapsed(kind: ElementKind, r: [f64; 3], weight: f64) -> Point {
    let values = shape::values(ElementKind::Hexahedron, r);
    let gradients = shape::gradients(ElementKind::Hexahedron, r);
    let mut point = Point {
        weight,
        n: [0.0; 8],
        gradient: [[0.0; 3]; 8],
    };
    for (corner, &a) in COLLAPSE[kind as usize].iter().enumerate() {
        point.n[a] += values[corner];
        (0..3).for_each(|k| point.gradient[a][k] += gradients[corner][k]);
    }
    point
}

/// All pairs of vertices of a kind, ascending.
fn all_pairs(kind: ElementKind) -> Vec<Pair> {
    let n = kind.vertices() as u8;
    (0..n)
        .flat_map(|a| (a + 1..n).map(move |b| (a, b)))
        .collect()
}

/// The edges a < b of a hexahedron; of their two faces first the one that runs from a to b, then the other.
static EDGES: LazyLock<Vec<(Pair, [usize; 2])>> = LazyLock::new(|| {
    let faces = ElementKind::Hexahedron.faces();
    let running = |a: usize, b: usize| {
        faces.iter().position(|face| {
            let next = |k: usize| face[(k + 1) % face.len()];
            (0..face.len()).any(|k| face[k] == a && next(k) == b)
        })
    };
    let edge = |&(a, b): &Pair| {
        let (a_to_b, b_to_a) = (running(a.into(), b.into()), running(b.into(), a.into()));
        Some(((a, b), [a_to_b?, b_to_a?]))
    };
    let pairs = all_pairs(ElementKind::Hexahedron);
    pairs.iter().filter_map(edge).collect()
});

/// Which pairs an element has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// Edges of orthogonal hexahedra.
    TwoPoint,
    /// All pairs of vertices.
    Galerkin,
}

impl Form {
    /// The pairs of an element, in the order in which they are computed.
    pub fn pairs(self, kind: ElementKind) -> Vec<Pair> {
        match self {
            Self::TwoPoint => EDGES.iter().map(|(pair, _)| *pair).collect(),
            Self::Galerkin => all_pairs(kind),
        }
    }
}

/// Vertex with the smallest Jacobian and the smaller of that and of the Jacobian that stopped the integration \[m³\].
pub(super) type Inversion = (usize, f64);

/// What elements give, one after the other.
#[derive(Default)]
pub(super) struct Shares {
    /// (S, w) of every pair.
    pub faces: Vec<[f64; 4]>,
    /// ∫N_a N_b of every pair in the Galerkin form, else none \[m³\].
    pub masses: Vec<f64>,
    /// Volume of every vertex \[m³\].
    pub volumes: Vec<f64>,
}

/// Exact ∫(N_a∇N_b − N_b∇N_a) \[m²\] and −∫∇N_a·∇N_b \[m\] of all pairs a < b, ∫N_a N_b \[m³\] of the pairs and
/// ∫N_a \[m³\].
///
/// Appends one (S, w) and one mass for every pair of vertices and one volume for every vertex. Masses are exact on
/// affine elements; on others they are those of the Gauss points, at which Σ_b N_b = 1 too.
pub(super) fn galerkin(
    kind: ElementKind,
    coordinates: &[[f64; 3]; 8],
    shares: &mut Shares,
) -> Result<(), Inversion> {
    let vertices = kind.vertices();
    let x = shape::relative(kind, coordinates);
    let (first, first_volume) = (shares.faces.len(), shares.volumes.len());
    let pairs = first + vertices * (vertices - 1) / 2;
    shares.faces.resize(pairs, [0.0; 4]);
    shares.masses.resize(pairs, 0.0);
    shares.volumes.resize(first_volume + vertices, 0.0);
    let (faces, masses) = (&mut shares.faces[first..], &mut shares.masses[first..]);
    let volumes = &mut shares.volumes[first_volume..];
    for point in &RULES[kind as usize] {
        let mut columns = [[0.0; 3]; 3];
        for (g, x) in point.gradient.iter().zip(&x).take(vertices) {
            for k in 0..3 {
                for c in 0..3 {
                    columns[k][c] += g[k] * x[c];
                }
            }
        }
        let (rows, determinant) = cofactors(&columns);
        if determinant.is_nan() || determinant <= 0.0 {
            let (vertex, jacobian, _) = smallest_jacobian(kind, coordinates);
            return Err((vertex, jacobian.min(determinant)));
        }
        // det J ∇N_a, with the weight of the point.
        let gradient: [[f64; 3]; 8] = std::array::from_fn(|a| {
            let g = point.gradient[a].map(|g| g * point.weight);
            std::array::from_fn(|c| g[0] * rows[0][c] + g[1] * rows[1][c] + g[2] * rows[2][c])
        });
        let scale = -1.0 / (determinant * point.weight);
        let n = &point.n;
        let volume = point.weight * determinant;
        let mut pairs = faces.iter_mut().zip(&mut *masses);
        for a in 0..vertices {
            volumes[a] += n[a] * volume;
            for (b, (face, mass)) in (a + 1..vertices).zip(&mut pairs) {
                *mass += match kind {
                    // Products of two are not linear: the point at the centre would give V/16.
                    ElementKind::Tetrahedron => volume / 20.0,
                    _ => n[a] * n[b] * volume,
                };
                for c in 0..3 {
                    face[c] += n[a] * gradient[b][c] - n[b] * gradient[a][c];
                }
                face[3] += scale * dot(gradient[a], gradient[b]);
            }
        }
    }
    Ok(())
}

/// Median-dual faces of the edges of an orthogonal hexahedron \[m²\] and eighths of its volume \[m³\].
///
/// A dual face is spanned by the middles of the edge, of its two faces and of the element, so that dual volumes close
/// to round-off however exactly the right angles are met. The weight follows from the whole dual face of an edge and
/// is left zero.
pub(super) fn two_point(coordinates: &[[f64; 3]; 8], shares: &mut Shares) {
    let kind = ElementKind::Hexahedron;
    let x = shape::relative(kind, coordinates);
    let mean = |vertices: &[usize]| -> [f64; 3] {
        let weight = 1.0 / vertices.len() as f64;
        std::array::from_fn(|c| weight * vertices.iter().map(|&v| x[v][c]).sum::<f64>())
    };
    let centre = mean(&[0, 1, 2, 3, 4, 5, 6, 7]);
    let middles: [[f64; 3]; 6] = std::array::from_fn(|face| mean(kind.faces()[face]));
    shares
        .faces
        .extend(EDGES.iter().map(|&((a, b), [a_to_b, b_to_a])| {
            let across = minus(middles[a_to_b], middles[b_to_a]);
            let s = cross(minus(centre, mean(&[a.into(), b.into()])), across);
            [0.5 * s[0], 0.5 * s[1], 0.5 * s[2], 0.0]
        }));
    let (_, volume) = cofactors(&[x[1], x[3], x[4]]);
    shares.volumes.extend([volume / 8.0; 8]);
}

/// True for a hexahedron whose opposite edges are equal and whose angles are right.
///
/// To 1e-8 of its shortest edge and 4e-12 of its coordinates, because mesh generators place nodes no better.
pub(super) fn is_orthogonal(kind: ElementKind, coordinates: &[[f64; 3]; 8]) -> bool {
    if kind != ElementKind::Hexahedron {
        return false;
    }
    let x = shape::relative(kind, coordinates);
    let axes = [x[1], x[3], x[4]];
    let lengths = axes.map(|a| dot(a, a).sqrt());
    let shortest = lengths.iter().fold(f64::INFINITY, |m, &l| m.min(l));
    let largest = coordinates
        .iter()
        .flatten()
        .fold(0.0, |m: f64, c| m.max(c.abs()));
    let tolerance = 1e-8 * shortest + 4e-12 * largest;
    // Vertices of the parallelepiped spanned by the edges at vertex 0.
    let corners = [
        (2, [1, 1, 0]),
        (5, [1, 0, 1]),
        (6, [1, 1, 1]),
        (7, [0, 1, 1]),
    ];
    let is_parallelepiped = corners.iter().all(|(v, bits)| {
        (0..3).all(|c| {
            let expected: f64 = (0..3).map(|k| f64::from(bits[k]) * axes[k][c]).sum();
            (x[*v][c] - expected).abs() <= tolerance
        })
    });
    let is_square =
        |a: usize, b: usize| dot(axes[a], axes[b]).abs() <= tolerance * lengths[a].max(lengths[b]);
    is_parallelepiped
        && is_square(0, 1)
        && is_square(1, 2)
        && is_square(2, 0)
        && cofactors(&axes).1 > 0.0
}

/// Share of every vertex in a boundary face \[m²\]: ∮N_a n, exact on bilinear (non-planar) quadrilaterals; in the
/// two-point form the quadrilateral of the vertex, the middles of its edges and the middle of the face.
pub(super) fn face_shares(
    form: Form,
    face: &BoundaryFace,
    nodes: &[[f64; 3]],
    periods: &Periods,
) -> [[f64; 3]; 4] {
    let x = face_vertices(face, nodes, periods);
    if face.vertices == 3 {
        let share = cross(x[1], x[2]).map(|s| s / 6.0);
        return [share, share, share, [0.0; 3]];
    }
    if form == Form::TwoPoint {
        let middle = std::array::from_fn(|c| 0.25 * x.iter().map(|x| x[c]).sum::<f64>());
        return std::array::from_fn(|v| {
            let across = minus(x[(v + 3) % 4], x[(v + 1) % 4]);
            cross(minus(middle, x[v]), across).map(|s| 0.25 * s)
        });
    }
    let mut shares = [[0.0; 3]; 4];
    for (n, normal) in quadrilateral_points(&x) {
        for v in 0..4 {
            (0..3).for_each(|c| shares[v][c] += n[v] * normal[c]);
        }
    }
    shares
}

/// Vertices of a boundary face \[m\], relative to the first.
fn face_vertices(face: &BoundaryFace, nodes: &[[f64; 3]], periods: &Periods) -> [[f64; 3]; 4] {
    let corner = |v: usize| -> [f64; 3] {
        let (x, shift) = (nodes[face.nodes[v] as usize], periods.shift(face.images[v]));
        std::array::from_fn(|c| x[c] + shift[c])
    };
    let origin = corner(0);
    let mut x = [[0.0; 3]; 4];
    (1..face.vertices.into()).for_each(|v| x[v] = minus(corner(v), origin));
    x
}

/// Shape functions and weighted normals \[m²\] of a boundary face at points that integrate N_a N_b n exactly.
pub(super) fn face_points(
    face: &BoundaryFace,
    nodes: &[[f64; 3]],
    periods: &Periods,
) -> Vec<([f64; 4], [f64; 3])> {
    let x = face_vertices(face, nodes, periods);
    if face.vertices == 4 {
        return quadrilateral_points(&x).to_vec();
    }
    // The middles of the edges, exact for products of two linear functions.
    let third = cross(x[1], x[2]).map(|s| s / 6.0);
    let middle = |opposite: usize| {
        let n = std::array::from_fn(|v| if v == opposite || v == 3 { 0.0 } else { 0.5 });
        (n, third)
    };
    (0..3).map(middle).collect()
}

/// As [`face_points`] for a bilinear quadrilateral.
fn quadrilateral_points(x: &[[f64; 3]; 4]) -> [([f64; 4], [f64; 3]); 4] {
    let gauss = [0.5 - 0.5 / 3f64.sqrt(), 0.5 + 0.5 / 3f64.sqrt()];
    let along = |a: [f64; 3], b: [f64; 3], c: [f64; 3], d: [f64; 3], t: f64| {
        std::array::from_fn(|k| (1.0 - t) * (b[k] - a[k]) + t * (d[k] - c[k]))
    };
    std::array::from_fn(|point| {
        let (r, s) = (gauss[point % 2], gauss[point / 2]);
        let normal = cross(
            along(x[0], x[1], x[3], x[2], s),
            along(x[0], x[3], x[1], x[2], r),
        );
        let n = [(1.0 - r) * (1.0 - s), r * (1.0 - s), r * s, (1.0 - r) * s];
        (n, normal.map(|c| 0.25 * c))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jacobian::tests::reference;

    /// Points and weights of the collapsed cube in the reference coordinates of [`shape`], 2 × 8 a direction.
    fn fine_rule(kind: ElementKind) -> Vec<([f64; 3], f64)> {
        let gauss = |i: usize| {
            let offset = if i.is_multiple_of(2) { -0.5 } else { 0.5 } / 3f64.sqrt();
            ((i / 2) as f64 + 0.5 + offset) / 8.0
        };
        let mut rule = Vec::new();
        for i in 0..4096 {
            let [x, y, z] = [gauss(i % 16), gauss(i / 16 % 16), gauss(i / 256)];
            let (r, jacobian) = match kind {
                ElementKind::Tetrahedron => (
                    [x * (1.0 - y) * (1.0 - z), y * (1.0 - z), z],
                    (1.0 - y) * (1.0 - z) * (1.0 - z),
                ),
                ElementKind::Pyramid => ([x * (1.0 - z), y * (1.0 - z), z], (1.0 - z) * (1.0 - z)),
                ElementKind::Prism => ([x * (1.0 - y), y, z], 1.0 - y),
                ElementKind::Hexahedron => ([x, y, z], 1.0),
            };
            rule.push((r, jacobian / 4096.0));
        }
        rule
    }

    #[test]
    fn pairs_and_volumes_are_the_integrals_of_the_shape_functions() {
        for kind in ElementKind::ALL {
            let n = kind.vertices();
            let mut x = reference(kind);
            for (i, x) in x[..n].iter_mut().flatten().enumerate() {
                *x += 0.15 * (1.0 + 5.0 * i as f64).sin();
            }
            let mut found = Shares::default();
            galerkin(kind, &x, &mut found).expect("positive");
            let Shares { faces, volumes, .. } = found;
            let (mut areas, mut weights) = (vec![[0.0; 3]; faces.len()], vec![0.0; faces.len()]);
            let mut shares = vec![0.0; n];
            for (r, weight) in fine_rule(kind) {
                let at = shape::physical(kind, &x, r);
                let columns = std::array::from_fn(|k| {
                    let g = shape::gradients(kind, r);
                    std::array::from_fn(|c| (0..n).map(|a| g[a][k] * x[a][c]).sum())
                });
                let dv = weight * cofactors(&columns).1;
                (0..n).for_each(|a| shares[a] += dv * at.n[a]);
                for (p, (a, b)) in all_pairs(kind).into_iter().enumerate() {
                    let (a, b) = (a as usize, b as usize);
                    for c in 0..3 {
                        areas[p][c] +=
                            dv * (at.n[a] * at.gradient[b][c] - at.n[b] * at.gradient[a][c]);
                    }
                    weights[p] -= dv * dot(at.gradient[a], at.gradient[b]);
                }
            }
            let largest = faces.iter().fold(0.0, |m: f64, f| m.max(f[3].abs()));
            for (p, face) in faces.iter().enumerate() {
                for c in 0..3 {
                    assert!((face[c] - areas[p][c]).abs() < 1e-13, "{} {p}", kind.name());
                }
                let error = (face[3] - weights[p]).abs() / largest;
                assert!(
                    error < 0.02,
                    "{}: {p} {} {}",
                    kind.name(),
                    face[3],
                    weights[p]
                );
            }
            for (volume, share) in volumes.iter().zip(shares) {
                assert!((volume - share).abs() < 1e-14, "{}", kind.name());
            }
        }
    }

    /// To the error of the two points a direction of a prism, as for its w: products of three functions and the Jacobian of the
    /// collapsed cube are of degree four there.
    #[test]
    fn fluxes_are_the_integrals_of_the_field_between_shape_functions() {
        for kind in ElementKind::ALL {
            let n = kind.vertices();
            let affine =
                |[a, b, c]: [f64; 3]| [a + 0.3 * b - 0.2 * c, 0.8 * b + 0.1 * c, 1.3 * c + 0.4 * a];
            let x = reference(kind).map(affine);
            let wave = |k: usize| (1.0 + 5.0 * k as f64).sin();
            let field: [[f64; 4]; 8] =
                std::array::from_fn(|a| std::array::from_fn(|c| wave(4 * a + c)));
            let pairs = all_pairs(kind);
            let (mut found, mut wanted) = (vec![0.0; pairs.len()], vec![0.0; pairs.len()]);
            crate::geometry::FluxRule::of(kind).fluxes(&x, &field, &mut found);
            for (r, weight) in fine_rule(kind) {
                let at = shape::physical(kind, &x, r);
                let columns = std::array::from_fn(|k| {
                    let g = shape::gradients(kind, r);
                    std::array::from_fn(|c| (0..n).map(|a| g[a][k] * x[a][c]).sum())
                });
                let dv = weight * cofactors(&columns).1;
                let carried: [f64; 3] = std::array::from_fn(|c| {
                    let term = |a: usize| at.n[a] * field[a][c] - at.gradient[a][c] * field[a][3];
                    (0..n).map(term).sum()
                });
                for (wanted, &(a, b)) in wanted.iter_mut().zip(&pairs) {
                    let (a, b) = (usize::from(a), usize::from(b));
                    *wanted += dv
                        * (at.n[a] * dot(at.gradient[b], carried)
                            - at.n[b] * dot(at.gradient[a], carried));
                }
            }
            let largest = wanted.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
            let limit = match kind {
                ElementKind::Prism => 0.02,
                _ => 2e-5,
            };
            for (found, wanted) in found.iter().zip(&wanted) {
                let error = (found - wanted).abs() / largest;
                assert!(
                    error < limit,
                    "{}: {found} {wanted}, {largest}",
                    kind.name()
                );
            }
        }
    }

    /// On affine elements exact, on warped ones within 1 % of the volume.
    #[test]
    fn masses_are_the_integrals_of_products_of_shape_functions() {
        for kind in ElementKind::ALL {
            let n = kind.vertices();
            for (warp, limit) in [(0.0, 1e-5), (0.15, 1e-2)] {
                let mut x = reference(kind);
                for (i, x) in x[..n].iter_mut().enumerate() {
                    let [a, b, c] = *x;
                    *x = [a + 0.3 * b - 0.2 * c, 0.8 * b + 0.1 * c, 1.3 * c + 0.4 * a];
                    for (k, x) in x.iter_mut().enumerate() {
                        *x += warp * (1.0 + 5.0 * (3 * i + k) as f64).sin();
                    }
                }
                let mut found = Shares::default();
                galerkin(kind, &x, &mut found).expect("positive");
                let mut masses = vec![0.0; found.masses.len()];
                for (r, weight) in fine_rule(kind) {
                    let (values, g) = (shape::values(kind, r), shape::gradients(kind, r));
                    let columns = std::array::from_fn(|k| {
                        std::array::from_fn(|c| (0..n).map(|a| g[a][k] * x[a][c]).sum())
                    });
                    let dv = weight * cofactors(&columns).1;
                    for (mass, (a, b)) in masses.iter_mut().zip(all_pairs(kind)) {
                        *mass += dv * values[a as usize] * values[b as usize];
                    }
                }
                let volume: f64 = found.volumes.iter().sum();
                for (found, wanted) in found.masses.iter().zip(&masses) {
                    let error = (found - wanted).abs() / volume;
                    assert!(error < limit, "{}, warp {warp}: {error:e}", kind.name());
                }
            }
        }
    }
}
