//! Angles between faces and the lines that join the centres of their elements, by which cell-centred codes judge a mesh.

use crate::LocalMesh;
use crate::faces::{FaceTable, face_key};

/// Largest and mean angle over all inner faces \[degrees\]; zero where there are none. The same on any number of ranks. Collective.
pub(crate) fn face_angles(mesh: &LocalMesh) -> [f64; 2] {
    let elements = &mesh.elements;
    let table = FaceTable::new(elements, mesh.total());
    let (mut largest, mut sums) = (0.0f64, [0.0; 2]);
    for e in 0..elements.len() {
        for (f, vertices) in elements.kinds[e].faces().iter().enumerate() {
            // The rank of its lowest node counts a face; it has the elements on both sides.
            let nodes = vertices.iter().map(|&v| elements.nodes(e)[v]);
            let lowest = nodes.min_by_key(|&n| mesh.global_nodes[n as usize]);
            if lowest.is_none_or(|n| n as usize >= mesh.owned()) {
                continue;
            }
            let mut sides = table.sides(elements, face_key(elements, e, f).0);
            let (Some(a), Some(b)) = (sides.next(), sides.next()) else {
                continue;
            };
            if (a.element as usize, a.face as usize) != (e, f) {
                continue;
            }
            let [here, there] =
                [a, b].map(|s| Seen::new(mesh, s.element as usize, s.face as usize));
            // Across a period the neighbour is where its face is this one.
            let line: [f64; 3] = std::array::from_fn(|c| here.outwards[c] - there.outwards[c]);
            let dot = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|c| a[c] * b[c]).sum::<f64>();
            let cosine =
                dot(&line, &here.area) / (dot(&line, &line) * dot(&here.area, &here.area)).sqrt();
            let angle = cosine.clamp(-1.0, 1.0).acos().to_degrees();
            largest = largest.max(angle);
            sums[0] += angle;
            sums[1] += 1.0;
        }
    }
    let communicator = mesh.halo.communicator();
    communicator.sum_slice(&mut sums);
    [communicator.max(largest), sums[0] / sums[1].max(1.0)]
}

/// A face of an element.
struct Seen {
    /// Area vector out of the element \[m²\].
    area: [f64; 3],
    /// From the centre of the element to that of the face \[m\].
    outwards: [f64; 3],
}

impl Seen {
    fn new(mesh: &LocalMesh, e: usize, face: usize) -> Self {
        let x = mesh.elements.coordinates(e, &mesh.nodes, &mesh.periods);
        let kind = mesh.elements.kinds[e];
        let vertices = kind.faces()[face];
        let (a, b, c) = (x[vertices[0]], x[vertices[1]], x[vertices[2]]);
        let d = vertices.get(3).map_or(a, |&v| x[v]);
        let (u, v): ([f64; 3], [f64; 3]) = (
            std::array::from_fn(|k| c[k] - a[k]),
            std::array::from_fn(|k| {
                if vertices.len() == 4 {
                    d[k] - b[k]
                } else {
                    c[k] - b[k]
                }
            }),
        );
        let area = std::array::from_fn(|k| {
            let (m, n) = ((k + 1) % 3, (k + 2) % 3);
            0.5 * (u[m] * v[n] - u[n] * v[m])
        });
        let mean = |points: &[[f64; 3]], k: usize| {
            points.iter().map(|p| p[k]).sum::<f64>() / points.len() as f64
        };
        let corners: Vec<[f64; 3]> = vertices.iter().map(|&v| x[v]).collect();
        let outwards = std::array::from_fn(|k| mean(&corners, k) - mean(&x[..kind.vertices()], k));
        Self { area, outwards }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BoxMesh, Mesh};

    fn angles(mesh: Mesh) -> [f64; 2] {
        face_angles(&LocalMesh::single(mesh))
    }

    /// A box sheared by 45° along x: all faces across y, half of three kinds of equal number, are off by that.
    #[test]
    fn a_sheared_box_is_off_by_its_angle() {
        for periodic in [[true; 3], [true, false, true]] {
            let mesh = BoxMesh {
                cells: [3, 4, 2],
                size: [3.0, 4.0, 2.0],
                periodic,
                ..BoxMesh::default()
            };
            let mut mesh = mesh.build().expect("box");
            let [largest, mean] = angles(mesh.clone());
            assert!(largest < 1e-6 && mean < 1e-6);
            mesh.nodes.iter_mut().for_each(|x| x[0] += x[1]);
            mesh.periods.vectors[1][0] = mesh.periods.vectors[1][1];
            let [largest, mean] = angles(mesh);
            assert!((largest - 45.0).abs() < 1e-6, "{largest}");
            // Faces across x lean too: their normal keeps to the shear, the line of centres to x.
            let across_y = if periodic[1] { 24.0 } else { 18.0 };
            let expected = 45.0 * (24.0 + across_y) / (48.0 + across_y);
            assert!((mean - expected).abs() < 1e-6, "{mean} {expected}");
        }
    }
}
