//! Which elements share a face, periodic images included.

use crate::{Elements, Image};

/// A face as a cycle of vertices, whatever its starting vertex, direction and translation by whole periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FaceKey([u64; 4]);

impl FaceKey {
    /// Key and direction: two faces with one key and opposite directions are the two sides of one face.
    pub fn new(nodes: &[u32], images: &[Image]) -> (Self, bool) {
        let count = nodes.len();
        let shifts: [[i8; 3]; 4] = std::array::from_fn(|k| images[k.min(count - 1)].shifts());
        let lowest: [i8; 3] =
            std::array::from_fn(|c| shifts.iter().map(|s| s[c]).min().unwrap_or(0));
        // Node and shift relative to the lowest of the face, each 0…2, in one number.
        let vertex = |k: usize| {
            let k = k % count;
            let digits = (0..3).rev();
            let shift = digits.fold(0, |code, c| 4 * code + (shifts[k][c] - lowest[c]) as u64);
            u64::from(nodes[k]) << 6 | shift
        };
        let first = (0..count).min_by_key(|&k| vertex(k)).unwrap_or(0);
        let (next, last) = (vertex(first + 1), vertex(first + count - 1));
        let opposite = if count == 4 {
            vertex(first + 2)
        } else {
            u64::MAX
        };
        let key = [vertex(first), next.min(last), next.max(last), opposite];
        (Self(key), next < last)
    }

    fn lowest_node(self) -> usize {
        (self.0[0] >> 6) as usize
    }

    /// 29 bits that nearly always differ between faces with the same lowest vertex.
    fn fingerprint(self) -> u32 {
        let [_, low, high, opposite] = self.0;
        let mixed = low ^ high.rotate_left(21) ^ opposite.rotate_left(42);
        (mixed.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 35) as u32
    }
}

/// One side of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Side {
    pub element: u32,
    /// Index into `kind.faces()`.
    pub face: u8,
    /// Direction of the face as the element lists it, see [`FaceKey::new`].
    pub direction: bool,
}

/// All faces of all elements, found by their lowest node.
pub(crate) struct FaceTable {
    offsets: Vec<u32>,
    /// Element, and fingerprint of the key with the face in its lowest three bits.
    sides: Vec<(u32, u32)>,
}

impl FaceTable {
    pub fn new(elements: &Elements, nodes: usize) -> Self {
        let mut offsets = vec![0u32; nodes + 1];
        for_each_face(elements, |_, _, key| offsets[key.lowest_node() + 1] += 1);
        (0..nodes).for_each(|i| offsets[i + 1] += offsets[i]);
        let mut next = offsets.clone();
        let mut sides = vec![(0, 0); offsets[nodes] as usize];
        for_each_face(elements, |element, face, key| {
            let at = &mut next[key.lowest_node()];
            sides[*at as usize] = (element as u32, key.fingerprint() << 3 | face as u32);
            *at += 1;
        });
        Self { offsets, sides }
    }

    /// The sides of the face with this key, in element order: two inside the domain, one on its boundary.
    pub fn sides<'a>(
        &'a self,
        elements: &'a Elements,
        key: FaceKey,
    ) -> impl Iterator<Item = Side> + 'a {
        let node = key.lowest_node();
        let range = self.offsets[node] as usize..self.offsets[node + 1] as usize;
        let fingerprint = key.fingerprint();
        let alike = move |side: &&(u32, u32)| side.1 >> 3 == fingerprint;
        let alike = self.sides[range].iter().filter(alike);
        alike.filter_map(move |&(element, mark)| {
            let face = (mark & 7) as u8;
            let (other, direction) = face_key(elements, element as usize, face.into());
            (other == key).then_some(Side {
                element,
                face,
                direction,
            })
        })
    }
}

/// Key and direction of face `face` of element `e`.
pub(crate) fn face_key(elements: &Elements, e: usize, face: usize) -> (FaceKey, bool) {
    let vertices = elements.kinds[e].faces()[face];
    let (nodes, images) = (elements.nodes(e), elements.images(e));
    let mut of_face = ([0; 4], [Image::ZERO; 4]);
    for (k, &v) in vertices.iter().enumerate() {
        of_face.0[k] = nodes[v];
        of_face.1[k] = images[v];
    }
    FaceKey::new(&of_face.0[..vertices.len()], &of_face.1[..vertices.len()])
}

fn for_each_face(elements: &Elements, mut visit: impl FnMut(usize, usize, FaceKey)) {
    for e in 0..elements.len() {
        for face in 0..elements.kinds[e].faces().len() {
            visit(e, face, face_key(elements, e, face).0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ElementKind;

    #[test]
    fn a_key_ignores_start_direction_and_translation() {
        let o = Image::ZERO;
        let (x, back) = (Image::new([1, 0, 0]), Image::new([-1, 0, 0]));
        let (key, direction) = FaceKey::new(&[5, 9, 2, 7], &[o, x, x, o]);
        assert_eq!(FaceKey::new(&[2, 7, 5, 9], &[x, o, o, x]), (key, direction));
        assert_eq!(
            FaceKey::new(&[7, 2, 9, 5], &[o, x, x, o]),
            (key, !direction)
        );
        assert_eq!(
            FaceKey::new(&[5, 9, 2, 7], &[back, o, o, back]),
            (key, direction)
        );
        assert_ne!(FaceKey::new(&[5, 9, 2, 7], &[o, x, o, o]).0, key);
        assert_ne!(FaceKey::new(&[5, 2, 9, 7], &[o, x, x, o]).0, key);
        assert_ne!(FaceKey::new(&[5, 9, 2], &[o, x, x]).0, key);
    }

    #[test]
    fn a_cube_periodic_in_all_directions_shares_each_face_with_itself() {
        let mut elements = Elements::default();
        let corner = |v: usize| {
            let x = [0, 1, 1, 0][v % 4];
            let y = [0, 0, 1, 1][v % 4];
            Image::new([x, y, (v / 4) as i8])
        };
        let images: [Image; 8] = std::array::from_fn(corner);
        elements.push(ElementKind::Hexahedron, &[0; 8], &images);
        let table = FaceTable::new(&elements, 1);
        for face in 0..6 {
            let (key, direction) = face_key(&elements, 0, face);
            let sides: Vec<Side> = table.sides(&elements, key).collect();
            assert_eq!(sides.len(), 2);
            assert!(
                sides
                    .iter()
                    .any(|s| s.face as usize == face && s.direction == direction)
            );
            assert!(
                sides
                    .iter()
                    .any(|s| s.face as usize != face && s.direction != direction)
            );
        }
    }
}
