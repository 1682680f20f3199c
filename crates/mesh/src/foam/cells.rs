//! Cells of an OpenFOAM mesh from their faces.

use crate::ElementKind;

/// Cells on the two sides of every face; faces of patches have no neighbour.
pub(super) struct Sides {
    pub owner: Vec<i64>,
    pub neighbour: Vec<i64>,
}

/// A cell of a face, and whether the face points out of it.
type Side = (u32, bool);

/// Kinds and vertices of all cells, in the order of the file.
pub(super) fn elements(
    points: &[[f64; 3]],
    faces: &[Vec<u32>],
    sides: &Sides,
) -> Result<(Vec<ElementKind>, Vec<u32>), String> {
    if sides.owner.len() != faces.len() || sides.neighbour.len() > faces.len() {
        let (n, m) = (faces.len(), sides.owner.len());
        return Err(format!("there are {n} faces and {m} owners"));
    }
    let all = sides.owner.iter().chain(&sides.neighbour);
    let cells = all.copied().max().map_or(0, |last| last + 1);
    if cells <= 0 || cells > faces.len() as i64 {
        return Err(format!("{cells} cells cannot have {} faces", faces.len()));
    }
    let of_face = |face: usize| -> [Option<Side>; 2] {
        let side = |cell: Option<&i64>, out| {
            let cell = cell.filter(|c| **c >= 0);
            cell.map(|&c| (c as u32, out))
        };
        [
            side(sides.owner.get(face), true),
            side(sides.neighbour.get(face), false),
        ]
    };
    // Faces by cell.
    let mut offsets = vec![0usize; cells as usize + 1];
    let each = |visit: &mut dyn FnMut(usize, Side)| {
        for face in 0..faces.len() {
            of_face(face)
                .into_iter()
                .flatten()
                .for_each(|s| visit(face, s));
        }
    };
    each(&mut |_, (cell, _)| offsets[cell as usize + 1] += 1);
    (0..cells as usize).for_each(|c| offsets[c + 1] += offsets[c]);
    let mut next = offsets.clone();
    let mut of_cell = vec![(0u32, false); offsets[cells as usize]];
    each(&mut |face, (cell, out)| {
        of_cell[next[cell as usize]] = (face as u32, out);
        next[cell as usize] += 1;
    });
    let (mut kinds, mut vertices) = (Vec::new(), Vec::new());
    let mut around = Vec::new();
    for cell in 0..cells as usize {
        around.clear();
        for &(face, out) in &of_cell[offsets[cell]..offsets[cell + 1]] {
            let mut corners = faces[face as usize].clone();
            if !out {
                corners.reverse();
            }
            around.push(corners);
        }
        let (kind, corners) = element(&around).ok_or_else(|| unknown(cell, points, &around))?;
        kinds.push(kind);
        vertices.extend(&corners[..kind.vertices()]);
    }
    Ok((kinds, vertices))
}

fn unknown(cell: usize, points: &[[f64; 3]], around: &[Vec<u32>]) -> String {
    let corners = || around.iter().flatten();
    let count = corners().count().max(1) as f64;
    let centre: [f64; 3] =
        std::array::from_fn(|c| corners().map(|&p| points[p as usize][c]).sum::<f64>() / count);
    let sizes: Vec<String> = around.iter().map(|f| f.len().to_string()).collect();
    format!(
        "cell {cell} around {centre:?} is no tetrahedron, pyramid, prism or hexahedron: its faces have {} points. Polyhedra and hanging nodes (snappyHexMesh, polyDualMesh) are not supported",
        sizes.join(", ")
    )
}

/// The element with these faces, which point out of it, each listed from any corner.
fn element(faces: &[Vec<u32>]) -> Option<(ElementKind, [u32; 8])> {
    let triangles = faces.iter().filter(|f| f.len() == 3).count();
    let quadrilaterals = faces.iter().filter(|f| f.len() == 4).count();
    if triangles + quadrilaterals != faces.len() {
        return None;
    }
    let (kind, of_base) = match (triangles, quadrilaterals) {
        (4, 0) => (ElementKind::Tetrahedron, 3),
        (4, 1) => (ElementKind::Pyramid, 4),
        (2, 3) => (ElementKind::Prism, 3),
        (0, 6) => (ElementKind::Hexahedron, 4),
        _ => return None,
    };
    let base = faces.iter().position(|f| f.len() == of_base)?;
    let mut corners = [u32::MAX; 8];
    // The base of an element looks into it.
    let inwards = faces[base].iter().rev();
    corners.iter_mut().zip(inwards).for_each(|(a, &b)| *a = b);
    let others = || faces.iter().enumerate().filter(|(k, _)| *k != base);
    let in_base = |point: &u32| faces[base].contains(point);
    let above = of_base..kind.vertices();
    for (k, at) in above.enumerate() {
        // Off the base, joined to corner k; of a tetrahedron and a pyramid the only one.
        let joined = others().find_map(|(_, face)| {
            let place = face.iter().position(|p| *p == corners[k])?;
            let count = face.len();
            let beside = [face[(place + 1) % count], face[(place + count - 1) % count]];
            beside.into_iter().find(|p| !in_base(p))
        })?;
        corners[at] = joined;
    }
    let mut distinct = corners[..kind.vertices()].to_vec();
    distinct.sort_unstable();
    distinct.dedup();
    let known = |p: &u32| distinct.binary_search(p).is_ok();
    let fits = distinct.len() == kind.vertices() && faces.iter().flatten().all(known);
    fits.then_some((kind, corners))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Faces of every kind, rotated, come back as the same element.
    #[test]
    fn elements_are_found_from_their_faces() {
        for kind in ElementKind::ALL {
            let faces = kind.faces().iter().enumerate();
            let faces: Vec<Vec<u32>> = faces
                .map(|(k, face)| {
                    let mut face: Vec<u32> = face.iter().map(|&v| 10 + v as u32).collect();
                    let turn = k % face.len();
                    face.rotate_left(turn);
                    face
                })
                .rev()
                .collect();
            let (found, corners) = element(&faces).expect("element");
            assert_eq!(found, kind);
            // The faces of what is found are those given, and point the same way.
            let cycle = |face: &[u32]| {
                let least = (0..face.len()).min_by_key(|&k| face[k]).unwrap_or(0);
                let mut face = face.to_vec();
                face.rotate_left(least);
                face
            };
            let mut given: Vec<Vec<u32>> = faces.iter().map(|f| cycle(f)).collect();
            let own = kind.faces().iter();
            let mut own: Vec<Vec<u32>> = own
                .map(|f| cycle(&f.iter().map(|&v| corners[v]).collect::<Vec<_>>()))
                .collect();
            given.sort();
            own.sort();
            assert_eq!(given, own, "{}", kind.name());
        }
    }

    #[test]
    fn a_hexahedron_with_a_divided_face_is_none() {
        let mut faces: Vec<Vec<u32>> = (ElementKind::Hexahedron.faces().iter())
            .map(|face| face.iter().map(|&v| v as u32).collect())
            .collect();
        let [a, b, c, d] = faces.remove(0)[..] else {
            panic!("a quadrilateral");
        };
        faces.extend([vec![a, b, c], vec![a, c, d]]);
        assert_eq!(element(&faces), None);
    }
}
