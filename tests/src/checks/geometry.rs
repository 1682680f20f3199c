//! The dual geometry on several ranks.

use super::{Outcome, ensure, meshes};
use fibreflow_mesh::{
    BoxElement, BoxMesh, DualGeometry, LocalMesh, Mesh, MeshError, distribute, distribute_from,
    geometry,
};
use fibreflow_parallel::Communicator;

/// Rows, volumes and boundary shares of every rank are those of one rank, pair by pair and bit by bit.
pub fn same_on_any_ranks(communicator: &Communicator) -> Outcome {
    for (element, periodic, cells) in [
        (BoxElement::Hexahedron, [true, false, false], [7, 5, 6]),
        (BoxElement::Hexahedron, [true, false, true], [9, 6, 1]),
        (BoxElement::Tetrahedron, [true, true, false], [5, 4, 4]),
        (BoxElement::Prism, [true, true, true], [5, 2, 6]),
        (BoxElement::Mixed, [true, false, true], [7, 3, 4]),
    ] {
        for jitter in [0.0, 0.2] {
            let mesh = BoxMesh {
                cells,
                element,
                periodic,
                jitter,
                size: [1.0, 0.7, 1.3],
                seed: 5,
                ..BoxMesh::default()
            };
            compare(communicator, || mesh.build())
                .map_err(|error| format!("{element:?} {periodic:?} jitter {jitter}: {error}"))?;
        }
    }
    for name in ["mixed", "periodic", "slab"] {
        compare(communicator, || meshes::gmsh(name))
            .map_err(|error| format!("{name}.msh: {error}"))?;
    }
    Ok(())
}

fn compare(communicator: &Communicator, build: impl Fn() -> Result<Mesh, MeshError>) -> Outcome {
    let whole = distribute(&Communicator::single(), Some(build()?))?;
    let expected = geometry::dual(&whole)?;
    let part = distribute_from(communicator, build)?;
    let found = geometry::dual(&part)?;
    ensure(part.owned() < whole.owned(), || {
        "one rank owns the mesh".into()
    })?;
    ensure(found.orthogonal == expected.orthogonal, || {
        "the ranks chose another form".into()
    })?;
    let relative = found.total_volume / expected.total_volume - 1.0;
    ensure(relative.abs() < 1e-14, || {
        format!("the volume is off by {relative:e}")
    })?;
    for (i, &global) in part.global_nodes.iter().enumerate() {
        let (a, b) = (found.volumes[i], expected.volumes[global as usize]);
        ensure(a.to_bits() == b.to_bits(), || {
            format!("dual volume of node {global}: {a:e}, on one rank {b:e}")
        })?;
    }
    for i in 0..part.owned() {
        let global = part.global_nodes[i] as usize;
        let (a, b) = (row(&part, &found, i), row(&whole, &expected, global));
        ensure(a == b, || {
            format!("row of node {global}: {a:x?}, on one rank {b:x?}")
        })?;
    }
    Ok(())
}

/// Everything about a node, as global indices and bit patterns.
#[derive(PartialEq, Debug)]
struct Row {
    pairs: Vec<(u64, u8, [u64; 4], [u64; 3])>,
    own_images: Vec<(u8, [u64; 4])>,
    boundary: Vec<(u16, [u64; 3])>,
}

fn row(mesh: &LocalMesh, geometry: &DualGeometry, i: usize) -> Row {
    let own_images = geometry.self_pairs.iter().filter(|p| p.0 as usize == i);
    let boundary = geometry.boundary.iter().filter(|b| b.node as usize == i);
    let pair = |e: usize| {
        (
            mesh.global_nodes[geometry.columns[e] as usize],
            geometry.images[e].code(),
            geometry.faces[e].map(f64::to_bits),
            geometry.displacements[e].map(f64::to_bits),
        )
    };
    Row {
        pairs: geometry.row(i).map(pair).collect(),
        own_images: own_images
            .map(|(_, image, face)| (image.code(), face.map(f64::to_bits)))
            .collect(),
        boundary: boundary
            .map(|b| (b.patch, b.area.map(f64::to_bits)))
            .collect(),
    }
}

/// An element that one rank alone sees inverted stops all ranks.
pub fn inverted_elements_stop_all(communicator: &Communicator) -> Outcome {
    let mesh = distribute_from(communicator, || {
        let mut mesh = meshes::cube(6)?;
        let corner = mesh.elements.nodes(0)[0] as usize;
        mesh.nodes[corner] = [0.5; 3];
        Ok(mesh)
    })?;
    match geometry::dual(&mesh) {
        Err(MeshError::Inverted { element: 0, .. }) => Ok(()),
        Err(other) => Err(other.into()),
        Ok(_) => Err("an inverted element was accepted".into()),
    }
}
