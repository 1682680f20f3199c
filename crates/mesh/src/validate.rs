//! Checks of a whole mesh before anything is computed on it.

use crate::faces::{FaceKey, FaceTable, face_key};
use crate::jacobian::smallest_jacobian;
use crate::{BoundaryFace, Elements, Mesh, MeshError, Periods};
use rayon::prelude::*;

/// Checks that a mesh can be computed on: indices, coordinates, Jacobians, no unused node, faces that fit.
///
/// Every face of an element is shared with exactly one other element (or, across a period, with itself) or lies on
/// exactly one boundary face; every boundary face lies on one element and points out of it.
///
/// # Errors
/// The first defect found, with its place: [`MeshError::Index`], [`MeshError::NotFinite`], [`MeshError::Inverted`],
/// [`MeshError::UnusedNode`], [`MeshError::Face`].
pub fn validate(mesh: &Mesh) -> Result<(), MeshError> {
    indices(mesh)?;
    coordinates(mesh)?;
    jacobians(mesh)?;
    used_nodes(mesh)?;
    faces(mesh)
}

fn coordinates(mesh: &Mesh) -> Result<(), MeshError> {
    let wrong = |x: &[f64; 3]| !x.iter().all(|c| c.is_finite());
    match mesh.nodes.iter().position(wrong) {
        Some(node) => Err(MeshError::NotFinite {
            node: node as u64,
            position: mesh.nodes[node],
        }),
        None => Ok(()),
    }
}

/// Jacobians below this part of the product of their three edges count as zero.
const FLAT: f64 = 1e-12;

fn jacobians(mesh: &Mesh) -> Result<(), MeshError> {
    let elements = &mesh.elements;
    let inverted = (0..elements.len()).into_par_iter().find_map_first(|e| {
        let x = elements.coordinates(e, &mesh.nodes, &mesh.periods);
        let kind = elements.kinds[e];
        let (vertex, jacobian, scaled) = smallest_jacobian(kind, &x);
        (scaled <= FLAT).then(|| MeshError::Inverted {
            element: e as u64,
            kind,
            centre: mean(&x[..kind.vertices()]),
            vertex,
            jacobian,
        })
    });
    inverted.map_or(Ok(()), Err)
}

fn used_nodes(mesh: &Mesh) -> Result<(), MeshError> {
    let mut used = vec![false; mesh.nodes.len()];
    mesh.elements
        .nodes
        .iter()
        .for_each(|&n| used[n as usize] = true);
    match used.iter().position(|u| !u) {
        Some(node) => Err(MeshError::UnusedNode {
            node: node as u64,
            position: mesh.nodes[node],
        }),
        None => Ok(()),
    }
}

fn faces(mesh: &Mesh) -> Result<(), MeshError> {
    let elements = &mesh.elements;
    let table = FaceTable::new(elements, mesh.nodes.len());
    let covered = boundary_faces(mesh, &table)?;
    let problem = (0..elements.len()).into_par_iter().find_map_first(|e| {
        let faces = 0..elements.kinds[e].faces().len();
        faces.into_iter().find_map(|face| {
            let (key, direction) = face_key(elements, e, face);
            let (sides, opposite) = table.sides(elements, key).fold((0, 0), |(all, opposite), s| {
                (all + 1, opposite + usize::from(s.direction != direction))
            });
            let problem = match (sides, opposite, covered[e] >> face & 1 == 1) {
                (1, _, true) | (2, 1, false) => return None,
                (1, ..) => "is neither shared with another element nor on a boundary patch: name the surface it lies on as a patch, or make the elements on both sides meet face to face",
                (2, ..) => "is shared by two elements that lie on the same side of it",
                _ => "is shared by more than two elements",
            };
            let kind = elements.kinds[e].name();
            Some(MeshError::Face {
                patch: None,
                centre: face_centre(elements, e, face, mesh),
                problem: format!("of element {e} ({kind}) {problem}"),
            })
        })
    });
    problem.map_or(Ok(()), Err)
}

/// Bit f of entry e: face f of element e lies on a boundary face.
fn boundary_faces(mesh: &Mesh, table: &FaceTable) -> Result<Vec<u8>, MeshError> {
    let mut covered = vec![0u8; mesh.elements.len()];
    for face in &mesh.boundary {
        let count = face.vertices as usize;
        let (key, direction) = FaceKey::new(&face.nodes[..count], &face.images[..count]);
        let mut sides = table.sides(&mesh.elements, key);
        let problem = match (sides.next(), sides.next()) {
            (None, _) => "belongs to no element",
            (Some(_), Some(_)) => {
                "lies between two elements: walls inside the domain are not supported"
            }
            (Some(side), None) if side.direction != direction => "points into the domain",
            (Some(side), None) => {
                let (of_element, bit) = (&mut covered[side.element as usize], 1 << side.face);
                if *of_element & bit == 0 {
                    *of_element |= bit;
                    continue;
                }
                "is listed twice"
            }
        };
        return Err(MeshError::Face {
            patch: Some(mesh.patches[face.patch as usize].clone()),
            centre: boundary_centre(face, &mesh.nodes, &mesh.periods),
            problem: problem.into(),
        });
    }
    Ok(covered)
}

fn face_centre(elements: &Elements, e: usize, face: usize, mesh: &Mesh) -> [f64; 3] {
    let x = elements.coordinates(e, &mesh.nodes, &mesh.periods);
    let vertices = elements.kinds[e].faces()[face];
    let of_face: Vec<[f64; 3]> = vertices.iter().map(|&v| x[v]).collect();
    mean(&of_face)
}

fn boundary_centre(face: &BoundaryFace, nodes: &[[f64; 3]], periods: &Periods) -> [f64; 3] {
    let vertex = |k: usize| -> [f64; 3] {
        let shift = periods.shift(face.images[k]);
        std::array::from_fn(|c| nodes[face.nodes[k] as usize][c] + shift[c])
    };
    let vertices: Vec<[f64; 3]> = (0..face.vertices as usize).map(vertex).collect();
    mean(&vertices)
}

fn mean(points: &[[f64; 3]]) -> [f64; 3] {
    std::array::from_fn(|c| points.iter().map(|p| p[c]).sum::<f64>() / points.len() as f64)
}

/// Checks that every index points into its array and that the arrays fit each other.
///
/// # Errors
/// [`MeshError::Empty`], [`MeshError::Index`] or [`MeshError::Size`].
pub(crate) fn indices(mesh: &Mesh) -> Result<(), MeshError> {
    let elements = &mesh.elements;
    if elements.is_empty() || mesh.nodes.is_empty() {
        return Err(MeshError::Empty);
    }
    let vertices: usize = elements.kinds.iter().map(|k| k.vertices()).sum();
    let ends = elements.offsets.windows(2).map(|w| w[1] - w[0]);
    let fits = elements.offsets.len() == elements.len() + 1
        && elements.nodes.len() == vertices
        && elements.images.len() == vertices
        && ends
            .zip(&elements.kinds)
            .all(|(n, k)| n as usize == k.vertices());
    if !fits {
        return Err(MeshError::Size(
            "the element arrays do not fit each other".into(),
        ));
    }
    let check = |what, index, refers_to, value: u64, limit| {
        let error = MeshError::Index {
            what,
            index,
            refers_to,
            value,
            limit,
        };
        if value < limit as u64 {
            Ok(())
        } else {
            Err(error)
        }
    };
    for e in 0..elements.len() {
        for &node in elements.nodes(e) {
            check("element", e, "node", node.into(), mesh.nodes.len())?;
        }
    }
    for (f, face) in mesh.boundary.iter().enumerate() {
        let patch = face.patch.into();
        check("boundary face", f, "patch", patch, mesh.patches.len())?;
        if !(3..=4).contains(&face.vertices) {
            return Err(MeshError::Size(format!(
                "boundary face {f} has {} vertices; 3 or 4 are supported",
                face.vertices
            )));
        }
        for &node in &face.nodes[..face.vertices as usize] {
            check("boundary face", f, "node", node.into(), mesh.nodes.len())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jacobian::tests::reference;
    use crate::{ElementKind, Image};

    /// A mesh of one element whose faces are all on one patch.
    fn alone(kind: ElementKind) -> Mesh {
        let count = kind.vertices();
        let mut mesh = Mesh {
            nodes: reference(kind)[..count].to_vec(),
            patches: vec!["all".into()],
            ..Mesh::default()
        };
        let nodes: Vec<u32> = (0..count as u32).collect();
        mesh.elements.push(kind, &nodes, &[Image::ZERO; 8][..count]);
        for face in kind.faces() {
            let mut nodes = [0; 4];
            nodes
                .iter_mut()
                .zip(*face)
                .for_each(|(n, &v)| *n = v as u32);
            mesh.boundary.push(BoundaryFace {
                patch: 0,
                vertices: face.len() as u8,
                nodes,
                images: [Image::ZERO; 4],
            });
        }
        mesh
    }

    #[test]
    fn one_element_of_each_kind_is_a_mesh() {
        for kind in ElementKind::ALL {
            assert_eq!(validate(&alone(kind)), Ok(()), "{}", kind.name());
        }
    }

    #[test]
    fn an_inverted_element_is_named_with_its_place() {
        for kind in ElementKind::ALL {
            let mut mesh = alone(kind);
            // Every kind has vertices 0, 1 and the one above 0; push vertex 1 through the opposite side.
            mesh.nodes[1][0] = -1.0;
            let Err(MeshError::Inverted {
                element,
                jacobian,
                kind: named,
                ..
            }) = validate(&mesh)
            else {
                panic!("{} is accepted", kind.name());
            };
            assert_eq!((element, named), (0, kind));
            assert!(jacobian < 0.0);
        }
        let mut mesh = alone(ElementKind::Tetrahedron);
        mesh.nodes[3] = [0.3, 0.3, 0.0];
        let flat = validate(&mesh).expect_err("flat").to_string();
        assert!(flat.contains("element 0 (tetrahedron)"), "{flat}");
        assert!(flat.contains("3.250000e-1"), "{flat}");
    }

    fn face_problem(mesh: &Mesh) -> String {
        match validate(mesh) {
            Err(MeshError::Face { patch, problem, .. }) => format!("{patch:?} {problem}"),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn faces_that_do_not_fit_are_named() {
        let prism = || alone(ElementKind::Prism);
        let mut mesh = prism();
        mesh.boundary.pop();
        assert!(face_problem(&mesh).contains("element 0 (prism) is neither shared"));
        let mut mesh = prism();
        mesh.boundary[0].nodes.swap(0, 1);
        assert!(face_problem(&mesh).contains("points into the domain"));
        let mut mesh = prism();
        mesh.boundary.push(mesh.boundary[2]);
        assert!(face_problem(&mesh).contains("\"all\") is listed twice"));
        let mut mesh = prism();
        mesh.boundary[1].nodes = [0, 1, 5, 0];
        assert!(face_problem(&mesh).contains("belongs to no element"));
        let mut mesh = prism();
        mesh.elements
            .push(ElementKind::Prism, &[0, 1, 2, 3, 4, 5], &[Image::ZERO; 6]);
        assert!(face_problem(&mesh).contains("lies between two elements"));
        mesh.boundary.clear();
        assert!(face_problem(&mesh).contains("same side"));
    }

    #[test]
    fn unused_and_infinite_nodes_are_named() {
        let mut mesh = alone(ElementKind::Hexahedron);
        mesh.nodes.push([1.0, 2.0, 3.0]);
        assert!(matches!(
            validate(&mesh),
            Err(MeshError::UnusedNode { node: 8, .. })
        ));
        mesh.nodes[2][1] = f64::NAN;
        assert!(matches!(
            validate(&mesh),
            Err(MeshError::NotFinite { node: 2, .. })
        ));
    }

    #[test]
    fn a_box_of_one_element_periodic_in_two_directions_is_closed() {
        let image = |v: usize| Image::new([[0, 1, 1, 0][v % 4], [0, 0, 1, 1][v % 4], 0]);
        let mut mesh = Mesh {
            nodes: vec![[0.0; 3], [0.0, 0.0, 1.0]],
            patches: vec!["low".into(), "high".into()],
            ..Mesh::default()
        };
        mesh.periods.vectors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]];
        let images: [Image; 8] = std::array::from_fn(image);
        mesh.elements
            .push(ElementKind::Hexahedron, &[0, 0, 0, 0, 1, 1, 1, 1], &images);
        for (patch, order) in [[0, 3, 2, 1], [0, 1, 2, 3]].into_iter().enumerate() {
            mesh.boundary.push(BoundaryFace {
                patch: patch as u16,
                vertices: 4,
                nodes: [patch as u32; 4],
                images: order.map(image),
            });
        }
        assert_eq!(validate(&mesh), Ok(()));
    }
}
