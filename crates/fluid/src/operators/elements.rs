//! Convecting fluxes integrated element by element, on meshes of the Galerkin form.
//!
//! A pair flux ½(u_i + u_j)·S_ij takes the velocity as it is at the two nodes, where the operators around it (gradient,
//! divergence, viscosity) smooth waves across the pair by a factor B < 1. A wave that crosses a mean shear then takes
//! ½(1 + B) of what it should out of it instead of B: up to five times too much, and turbulence with twice the
//! friction. The integrals of [`FluxRule`] are smoothed alike, and their sums are those of the projection.

use crate::rows::{self, largest, nothing, sum};
use fibreflow_mesh::geometry::{FluxRule, face_pairs};
use fibreflow_mesh::{DualGeometry, Image, LocalMesh};

/// Where the entries of rows find what elements and boundary faces give to them.
#[derive(Clone, Debug)]
pub(super) struct Elements {
    /// First flux of every element, length elements + 1; those of the faces follow.
    first: Vec<u32>,
    /// Pairs of boundary faces: nodes and ½ ∮N_i N_j n \[m²\].
    faces: Vec<([u32; 2], [f64; 3])>,
    /// Starts by entry of a row, length entries + 1.
    starts: Vec<u32>,
    /// Twice the place of a flux, plus one where the pair runs backwards from here.
    terms: Vec<u32>,
}

/// A pair of an element or a face: local vertices, and the place of its flux.
type Share = ((u8, u8), u32);

impl Elements {
    /// For the rows of `geometry`, whose pairs are all those of the elements of `mesh`.
    pub fn new(mesh: &LocalMesh, geometry: &DualGeometry) -> Self {
        let kinds = &mesh.elements.kinds;
        let mut first = Vec::with_capacity(kinds.len() + 1);
        let mut end = 0;
        first.push(0);
        for &kind in kinds {
            end += FluxRule::of(kind).pairs().len() as u32;
            first.push(end);
        }
        let mut found: Vec<(u32, u32)> = Vec::new();
        let mut shares: Vec<Share> = Vec::new();
        for (e, &kind) in kinds.iter().enumerate() {
            let places = first[e]..;
            shares.clear();
            shares.extend(FluxRule::of(kind).pairs().iter().copied().zip(places));
            let (nodes, images) = (mesh.elements.nodes(e), mesh.elements.images(e));
            enter(mesh, geometry, (nodes, images), &shares, &mut found);
        }
        let mut faces = Vec::new();
        for face in &mesh.boundary {
            let pairs = face_pairs(face, &mesh.nodes, &mesh.periods);
            shares.clear();
            for (pair, area) in pairs {
                shares.push((pair, end + faces.len() as u32));
                let node = |v: u8| face.nodes[usize::from(v)];
                faces.push(([node(pair.0), node(pair.1)], area));
            }
            enter(
                mesh,
                geometry,
                (&face.nodes, &face.images),
                &shares,
                &mut found,
            );
        }
        let entries = geometry.columns.len();
        let mut starts = vec![0u32; entries + 1];
        found
            .iter()
            .for_each(|(entry, _)| starts[*entry as usize + 1] += 1);
        (0..entries).for_each(|e| starts[e + 1] += starts[e]);
        let mut next = starts.clone();
        let mut terms = vec![0; found.len()];
        // Places ascend: both rows of a pair sum in the same order.
        for (entry, term) in found {
            let next = &mut next[entry as usize];
            terms[*next as usize] = term;
            *next += 1;
        }
        Self {
            first,
            faces,
            starts,
            terms,
        }
    }

    /// Fluxes of elements and faces together.
    pub fn shares(&self) -> usize {
        self.first[self.first.len() - 1] as usize + self.faces.len()
    }

    /// Writes F_ij of u − ∇ψ, (u, ψ) = `at` a node, by way of `shares`. Returns max ½ Σ_j |F_ij|/V_i \[1/s\].
    pub fn fluxes(
        &self,
        mesh: &LocalMesh,
        geometry: &DualGeometry,
        at: impl Fn(usize) -> [f64; 4] + Sync,
        shares: &mut [f64],
        flux: &mut [f64],
        inverse: &[f64],
    ) -> f64 {
        let (elements, periods) = (&mesh.elements, &mesh.periods);
        let (of_elements, of_faces) = shares.split_at_mut(shares.len() - self.faces.len());
        let (mut none, mut nought) = (nothing(elements.len()), nothing(elements.len()));
        let out = (&mut none[..], &mut nought[..]);
        rows::with_entries(&self.first, of_elements, out, sum, |e, shares, (), ()| {
            let mut field = [[0.0; 4]; 8];
            for (field, &node) in field.iter_mut().zip(elements.nodes(e)) {
                *field = at(node as usize);
            }
            let x = elements.coordinates(e, &mesh.nodes, periods);
            FluxRule::of(elements.kinds[e]).fluxes(&x, &field, shares);
            0.0
        });
        rows::each(of_faces, |f, share| {
            let ([a, b], area) = self.faces[f];
            let (u, v) = (at(a as usize), at(b as usize));
            *share = (0..3).map(|c| area[c] * (v[c] - u[c])).sum();
        });
        let (shares, owned) = (&*shares, inverse.len());
        let (mut none, mut nought) = (nothing(owned), nothing(owned));
        let out = (&mut none[..], &mut nought[..]);
        rows::with_entries(&geometry.offsets, flux, out, largest, |i, flux, (), ()| {
            let mut size = 0.0;
            for (flux, e) in flux.iter_mut().zip(geometry.row(i)) {
                let terms = &self.terms[self.starts[e] as usize..self.starts[e + 1] as usize];
                *flux = 0.0;
                for &term in terms {
                    let share = shares[term as usize / 2];
                    *flux += if term.is_multiple_of(2) {
                        share
                    } else {
                        -share
                    };
                }
                size += flux.abs();
            }
            0.5 * size * inverse[i]
        })
    }
}

/// Appends (entry, term) for both rows of pairs of an element or a face, as far as they are owned; pairs of a node with
/// its own image are left out, as rows leave them.
fn enter(
    mesh: &LocalMesh,
    geometry: &DualGeometry,
    (nodes, images): (&[u32], &[Image]),
    shares: &[Share],
    found: &mut Vec<(u32, u32)>,
) {
    for &((a, b), place) in shares {
        for (a, b, backwards) in [(a, b, 0), (b, a, 1)] {
            let (a, b) = (usize::from(a), usize::from(b));
            let (i, j) = (nodes[a] as usize, nodes[b]);
            if i >= mesh.owned() || i == j as usize {
                continue;
            }
            let row = geometry.row(i);
            let key = |j: u32, image: Image| (mesh.global_nodes[j as usize], image.code());
            // An image that the assembly refused has stopped the program there.
            let image = images[a].to(images[b]).unwrap_or(Image::ZERO);
            let wanted = key(j, image);
            let columns = row
                .clone()
                .map(|e| key(geometry.columns[e], geometry.images[e]));
            if let Some(e) = columns.clone().position(|key| key == wanted) {
                found.push(((row.start + e) as u32, 2 * place + backwards));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Operators;
    use crate::Kernels;
    use crate::rows::nothing;
    use fibreflow_mesh::{BoxElement, BoxMesh, LocalMesh, geometry};
    use std::f64::consts::PI;
    use std::sync::Arc;

    fn operators(mesh: &BoxMesh) -> (LocalMesh, Operators) {
        let mesh = LocalMesh::single(mesh.build().expect("a mesh"));
        let dual = Arc::new(geometry::dual(&mesh).expect("geometry"));
        let operators = Operators::new(&mesh, &dual, Kernels::Auto);
        (mesh, operators)
    }

    fn integrated(
        (mesh, operators): &(LocalMesh, Operators),
        at: impl Fn(usize) -> [f64; 4] + Sync,
    ) -> Vec<f64> {
        let mut shares = vec![0.0; operators.shares()];
        let mut flux = vec![0.0; operators.flux_length()];
        operators
            .integrate(mesh, at, &mut shares, &mut flux)
            .expect("pairs of the Galerkin form");
        flux
    }

    #[test]
    fn rows_sum_to_what_the_projection_solves_for_also_at_boundaries() {
        for element in [
            BoxElement::Hexahedron,
            BoxElement::Tetrahedron,
            BoxElement::Prism,
            BoxElement::Mixed,
        ] {
            let mesh = BoxMesh {
                size: [1.0, 0.4, 0.9],
                cells: [10, 4, 4],
                periodic: [false, true, false],
                jitter: 0.2,
                element,
                ..BoxMesh::default()
            };
            let both = operators(&mesh);
            let (mesh, operators) = &both;
            let wave = |k: usize| (1.0 + 5.0 * k as f64).sin();
            let u: Vec<[f64; 4]> = (0..mesh.total())
                .map(|i| [wave(3 * i), wave(3 * i + 1), wave(3 * i + 2), 0.0])
                .collect();
            let psi: Vec<f64> = (0..mesh.total()).map(|i| 0.1 * wave(7 * i)).collect();
            let flux = integrated(&both, |i| [u[i][0], u[i][1], u[i][2], psi[i]]);
            let mut pairs = vec![0.0; flux.len()];
            let (mut a, mut b) = (nothing(mesh.owned()), nothing(mesh.owned()));
            let out = (&mut a[..], &mut b[..]);
            operators.correct(
                (&u, [0.0; 3]),
                &psi,
                &mut pairs,
                out,
                |_, _, _, _, (), ()| (),
            );
            let size = pairs.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
            for i in 0..mesh.owned() {
                let sum = operators.flux_sum(&flux, i) - operators.flux_sum(&pairs, i);
                assert!(sum.abs() < 1e-13 * size, "{element:?} {i}: {sum:e}");
            }
            let dual = &operators.geometry;
            for i in 0..mesh.owned() {
                for e in dual.row(i) {
                    let (j, back) = (dual.columns[e] as usize, dual.images[e].opposite());
                    let mut row = dual.row(j);
                    let other =
                        row.find(|&o| dual.columns[o] as usize == i && dual.images[o] == back);
                    assert_eq!(other.map(|o| -flux[o]), Some(flux[e]), "{element:?}");
                }
            }
        }
    }

    /// A wave v = cos(πz/h) across the shear U = y: pairs would take ½(1 + B) v out of it, B = 1/3.
    #[test]
    fn a_wave_takes_out_of_a_shear_what_its_smoothed_velocity_takes() {
        for element in [BoxElement::Hexahedron, BoxElement::Prism] {
            // Hexahedra that are a little off count as general.
            let (jitter, tolerance) = match element {
                BoxElement::Hexahedron => (1e-6, 1e-4),
                _ => (0.0, 1e-12),
            };
            let mesh = BoxMesh {
                size: [4.0, 4.0, 8.0],
                cells: [4, 4, 8],
                periodic: [true, false, true],
                element,
                jitter,
                ..BoxMesh::default()
            };
            let both = operators(&mesh);
            let (mesh, operators) = &both;
            let v = |i: usize| (PI * mesh.nodes[i][2]).cos();
            let flux = integrated(&both, |i| [0.0, v(i), 0.0, 0.0]);
            let dual = &operators.geometry;
            for i in (0..mesh.owned()).filter(|&i| (mesh.nodes[i][1] - 2.0).abs() < 0.5) {
                let [x, y, z] = mesh.nodes[i];
                // −Σ ½(U_i + U_j) F_ij, the sum of F being that of a wave along y: zero.
                let taken: f64 = dual
                    .row(i)
                    .map(|e| 0.5 * (2.0 * y + dual.displacements[e][1]) * flux[e])
                    .sum();
                let wanted = dual.volumes[i] * v(i) / 3.0;
                assert!(
                    (taken - wanted).abs() < tolerance,
                    "{element:?} ({x}, {y}, {z}): {taken} {wanted}"
                );
            }
        }
    }
}
