//! Random distortion that crushes no element.

use super::lattice::Lattice;
use crate::jacobian::smallest_jacobian;
use crate::{Elements, Mesh};
use rayon::prelude::*;

/// Smallest scaled Jacobian of an element, relative to the undistorted one, below which displacements are halved.
const CRUSHED: f64 = 0.05;

/// Places the nodes of the lattice, moved by up to `fraction` of the spacing, and the centres of the divided cells.
pub(super) fn place(
    mesh: &mut Mesh,
    lattice: &Lattice,
    centres: &[[usize; 3]],
    fraction: f64,
    seed: u64,
) {
    mesh.nodes = lattice.positions();
    add_centres(mesh, lattice, centres);
    if fraction == 0.0 {
        return;
    }
    let at_rest = mesh.nodes.clone();
    let mut displacements = lattice.displacements(fraction, seed);
    loop {
        mesh.nodes.truncate(lattice.len());
        for (i, node) in mesh.nodes.iter_mut().enumerate() {
            *node = std::array::from_fn(|c| at_rest[i][c] + displacements[i][c]);
        }
        add_centres(mesh, lattice, centres);
        let crushed = crushed(mesh, &at_rest);
        if crushed.is_empty() {
            return;
        }
        for node in nodes_to_calm(&mesh.elements, lattice, centres, &crushed) {
            displacements[node as usize] = displacements[node as usize].map(|d| 0.5 * d);
        }
    }
}

fn add_centres(mesh: &mut Mesh, lattice: &Lattice, centres: &[[usize; 3]]) {
    for &cell in centres {
        let mut mean = [0.0; 3];
        for (node, image) in lattice.corners(cell) {
            let (x, shift) = (mesh.nodes[node as usize], mesh.periods.shift(image));
            (0..3).for_each(|c| mean[c] += 0.125 * (x[c] + shift[c]));
        }
        mesh.nodes.push(mean);
    }
}

/// Elements whose scaled Jacobian is below [`CRUSHED`] of the one at rest.
fn crushed(mesh: &Mesh, at_rest: &[[f64; 3]]) -> Vec<usize> {
    let elements = &mesh.elements;
    (0..elements.len())
        .into_par_iter()
        .filter(|&e| {
            let scaled = |nodes| {
                let x = elements.coordinates(e, nodes, &mesh.periods);
                smallest_jacobian(elements.kinds[e], &x).2
            };
            scaled(&mesh.nodes) < CRUSHED * scaled(at_rest)
        })
        .collect()
}

/// Vertices of the crushed elements; for a centre the corners of its cell. Ascending, each once.
fn nodes_to_calm(
    elements: &Elements,
    lattice: &Lattice,
    centres: &[[usize; 3]],
    crushed: &[usize],
) -> Vec<u32> {
    let mut nodes = Vec::new();
    for &node in crushed.iter().flat_map(|&e| elements.nodes(e)) {
        match (node as usize).checked_sub(lattice.len()) {
            Some(centre) => nodes.extend(lattice.corners(centres[centre]).map(|(node, _)| node)),
            None => nodes.push(node),
        }
    }
    nodes.sort_unstable();
    nodes.dedup();
    nodes
}
