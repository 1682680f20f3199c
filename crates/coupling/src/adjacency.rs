//! Face neighbours of the elements of one rank, through periodic boundaries too.

use crate::fetch::fetch;
use crate::lattice::Shift;
use fibreflow_mesh::{Elements, Image};

/// What lies behind a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Neighbour {
    /// Local element.
    pub element: u32,
    /// A point at x + n·lattice in this element is at x + (n + shift)·lattice in the neighbour.
    pub shift: [i8; 3],
}

/// Neighbours of every face of every element, in the order of `ElementKind::faces`.
#[derive(Debug)]
pub(crate) struct Adjacency {
    offsets: Vec<u32>,
    neighbours: Vec<Option<Neighbour>>,
}

/// A face up to translation: sorted (node, image relative to the first), unused places at the end.
type Key = [(u32, [i8; 3]); 4];

struct Face {
    key: Key,
    /// Image of the first vertex of the key.
    base: [i8; 3],
    element: u32,
    slot: u32,
}

impl Adjacency {
    pub fn new(elements: &Elements) -> Self {
        let mut offsets = vec![0];
        let mut faces = Vec::new();
        for e in 0..elements.len() {
            for vertices in elements.kinds[e].faces() {
                let (key, base) = key(elements.nodes(e), elements.images(e), vertices);
                faces.push(Face {
                    key,
                    base,
                    element: e as u32,
                    slot: faces.len() as u32,
                });
            }
            offsets.push(faces.len() as u32);
        }
        let mut neighbours = vec![None; faces.len()];
        faces.sort_unstable_by_key(|face| (face.key, face.slot));
        for pair in faces
            .chunk_by(|a, b| a.key == b.key)
            .filter(|group| group.len() == 2)
        {
            let (a, b) = (&pair[0], &pair[1]);
            let shift: [i8; 3] = std::array::from_fn(|k| b.base[k] - a.base[k]);
            neighbours[a.slot as usize] = Some(Neighbour {
                element: b.element,
                shift,
            });
            neighbours[b.slot as usize] = Some(Neighbour {
                element: a.element,
                shift: shift.map(|s| -s),
            });
        }
        Self {
            offsets,
            neighbours,
        }
    }

    /// Lets the neighbours of element `e` come near.
    #[inline(always)]
    pub fn fetch(&self, e: usize) {
        if let [first, .., last] = self.of(e) {
            fetch(first);
            fetch(last);
        }
    }

    /// Neighbours of element `e`, one for each face; None at the end of the domain or of what this rank holds.
    pub fn of(&self, e: usize) -> &[Option<Neighbour>] {
        &self.neighbours[self.offsets[e] as usize..self.offsets[e + 1] as usize]
    }
}

/// Adds a step between neighbours to a shift.
pub(crate) fn stepped(shift: Shift, step: [i8; 3]) -> Shift {
    std::array::from_fn(|k| shift[k] + i32::from(step[k]))
}

fn key(nodes: &[u32], images: &[Image], vertices: &[usize]) -> (Key, [i8; 3]) {
    let mut key = [(u32::MAX, [0; 3]); 4];
    for (place, &v) in key.iter_mut().zip(vertices) {
        *place = (nodes[v], images[v].shifts());
    }
    // Sorting by (node, image) does not depend on a common translation.
    key[..vertices.len()].sort_unstable();
    let base = key[0].1;
    for place in &mut key[..vertices.len()] {
        place.1 = std::array::from_fn(|k| place.1[k] - base[k]);
    }
    (key, base)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fibreflow_mesh::ElementKind;

    /// One hexahedron that is its own neighbour in all three directions.
    #[test]
    fn a_periodic_box_of_one_element_neighbours_itself() {
        let mut elements = Elements::default();
        let corner = |i, j, k| Image::new([i, j, k]);
        let images = [
            corner(0, 0, 0),
            corner(1, 0, 0),
            corner(1, 1, 0),
            corner(0, 1, 0),
            corner(0, 0, 1),
            corner(1, 0, 1),
            corner(1, 1, 1),
            corner(0, 1, 1),
        ];
        elements.push(ElementKind::Hexahedron, &[0; 8], &images);
        let adjacency = Adjacency::new(&elements);
        // Faces in the order -z, +z, -y, +x, +y, -x: leaving through +x the point moves one period back.
        let expected = [
            [0, 0, 1],
            [0, 0, -1],
            [0, 1, 0],
            [-1, 0, 0],
            [0, -1, 0],
            [1, 0, 0],
        ];
        for (found, shift) in adjacency.of(0).iter().zip(expected) {
            assert_eq!(*found, Some(Neighbour { element: 0, shift }));
        }
    }

    #[test]
    fn two_tetrahedra_share_one_face() {
        let mut elements = Elements::default();
        let zero = [Image::ZERO; 4];
        elements.push(ElementKind::Tetrahedron, &[0, 1, 2, 3], &zero);
        elements.push(ElementKind::Tetrahedron, &[2, 1, 4, 3], &zero);
        let adjacency = Adjacency::new(&elements);
        let count = |e: usize| adjacency.of(e).iter().flatten().count();
        assert_eq!((count(0), count(1)), (1, 1));
        // The face 1-2-3 is the third of the first element.
        assert_eq!(adjacency.of(0)[2].map(|n| n.element), Some(1));
    }
}
