use super::*;
use crate::measures::{boundary_faces, close, element_volume, enclosed, of_kind, patch_area, path};
use crate::{ElementKind, validate};

fn mesh(name: &str) -> Mesh {
    read(&path(name)).expect("mesh")
}

#[test]
fn all_four_kinds_with_patches_that_point_outwards() {
    let mesh = mesh("mixed.msh");
    assert_eq!(
        ElementKind::ALL.map(|kind| of_kind(&mesh, kind)),
        [106, 4, 14, 8]
    );
    assert_eq!(mesh.patches, ["bottom", "top", "sides"]);
    assert_eq!(validate(&mesh), Ok(()));
    assert!(close(&[element_volume(&mesh)], &[2.5]));
    assert!(close(&patch_area(&mesh, "bottom"), &[0.0, 0.0, -1.0]));
    assert!(close(&patch_area(&mesh, "top"), &[0.0, 0.0, 1.0]));
    let faces = mesh.patches.iter().flat_map(|p| boundary_faces(&mesh, p));
    let faces: Vec<_> = faces.collect();
    assert!(close(&[enclosed(faces.iter().map(Vec::as_slice))], &[2.5]));
}

#[test]
fn text_and_binary_are_the_same_mesh() {
    for name in ["mixed", "periodic"] {
        let text = mesh(&format!("{name}.msh"));
        let binary = mesh(&format!("{name}_binary.msh"));
        assert_eq!(text.elements.nodes, binary.elements.nodes);
        assert_eq!(text.elements.images, binary.elements.images);
        assert_eq!(text.boundary, binary.boundary);
        assert_eq!(text.patches, binary.patches);
        assert_eq!(text.periods, binary.periods);
        let pairs = text.nodes.iter().zip(&binary.nodes);
        assert!(pairs.into_iter().all(|(a, b)| close(a, b)));
    }
}

#[test]
fn periodic_copies_are_one_node() {
    let mesh = mesh("periodic.msh");
    assert_eq!(
        mesh.periods.vectors,
        [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]]
    );
    assert_eq!(mesh.patches, ["bottom", "top"]);
    assert_eq!(validate(&mesh), Ok(()));
    assert!(close(&[element_volume(&mesh)], &[2.0]));
    // Every node lies in the half-open cell: the far sides are copies, their edges copies of copies.
    let inside = |x: &[f64; 3]| x[0] < 2.0 - 1e-6 && x[1] < 1.0 - 1e-6;
    assert!(mesh.nodes.iter().all(inside));
    let corner = |x: &&[f64; 3]| x[0].abs() < 1e-9 && x[1].abs() < 1e-9;
    let corners = mesh.nodes.iter().filter(corner).count();
    assert!(corners >= 3, "{corners} nodes on the vertical edge");
    let doubly = crate::Image::new([1, 1, 0]);
    assert!(mesh.elements.images.contains(&doubly));
    assert!(close(&patch_area(&mesh, "top"), &[0.0, 0.0, 2.0]));
}

#[test]
fn a_slab_one_element_thick_joins_its_nodes_to_themselves() {
    let mesh = mesh("slab.msh");
    assert_eq!(mesh.patches, ["left", "right", "walls"]);
    assert_eq!(validate(&mesh), Ok(()));
    assert_eq!((mesh.nodes.len(), mesh.elements.len()), (12, 6));
    assert!(close(&[element_volume(&mesh)], &[0.5]));
    assert!(close(&patch_area(&mesh, "right"), &[0.25, 0.0, 0.0]));
    for e in 0..6 {
        let mut nodes = mesh.elements.nodes(e).to_vec();
        nodes.sort_unstable();
        assert!(nodes.chunks(2).all(|pair| pair[0] == pair[1]));
    }
}

#[test]
fn an_inverted_element_is_found_where_it_is() {
    let bad = mesh("inverted.msh");
    let good = mesh("periodic.msh");
    let x = good.elements.coordinates(4, &good.nodes, &good.periods);
    let expected: [f64; 3] =
        std::array::from_fn(|c| x[..4].iter().map(|v| v[c]).sum::<f64>() / 4.0);
    match validate(&bad) {
        Err(MeshError::Inverted {
            element: 4,
            kind: ElementKind::Tetrahedron,
            centre,
            ..
        }) => assert!(close(&centre, &expected)),
        other => panic!("{other:?}"),
    }
}

fn refused(text: &str) -> String {
    parse("a.msh", text.as_bytes())
        .expect_err("refused")
        .to_string()
}

/// A tetrahedron; `$Elements` as given.
fn tetrahedron(elements: &str) -> String {
    format!(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 4 1 4\n3 1 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n$Elements\n{elements}\n$EndElements\n"
    )
}

#[test]
fn what_is_not_supported_is_named_with_what_to_do() {
    assert!(refused("").contains("empty"));
    assert!(refused("hello").contains("line 1"));
    let old = refused("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n");
    assert!(
        old.contains("2.2") && old.contains("-format msh41"),
        "{old}"
    );
    let quadratic = refused(&tetrahedron("1 1 1 1\n3 1 11 1\n1 1 2 3 4 1 2 3 4 1 2"));
    assert!(quadratic.contains("ElementOrder = 1"), "{quadratic}");
    assert!(quadratic.contains("$Elements, line 18"), "{quadratic}");
    assert!(refused(&tetrahedron("1 1 1 1\n2 1 2 1\n1 1 2 3")).contains("gmsh -3"));
    assert!(refused(&tetrahedron("1 1 1 1\n3 1 4 1\n1 1 2 3 9")).contains("node 9"));
    assert!(refused(&tetrahedron("1 1 1 1\n3 1 4 1\n1 1 2 3")).contains("not the number"));
    assert!(refused(&tetrahedron("1 99999999 1 1\n3 1 4 99999999\n")).contains("more than"));
    let split = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PartitionedEntities\n";
    assert!(refused(split).contains("partitioned"));
    let missing = read(&path("no_such.msh")).expect_err("missing").to_string();
    assert!(missing.contains("no_such.msh"), "{missing}");
}

#[test]
fn unused_nodes_are_left_out_and_sections_without_use_skipped() {
    let text = tetrahedron("1 1 1 1\n3 1 4 1\n1 1 2 3 4")
        .replace(
            "$Nodes\n1 4 1 4\n3 1 0 4\n1\n",
            "$Comments\nany text $Nodes\n$EndComments\n$Nodes\n1 5 1 9\n3 1 0 5\n9\n1\n",
        )
        .replace("4\n0 0 0\n", "4\n7 7 7\n0 0 0\n");
    let mesh = parse("a.msh", text.as_bytes()).expect("mesh");
    assert_eq!(mesh.nodes.len(), 4);
    assert_eq!(mesh.nodes[0], [0.0; 3]);
    assert!(matches!(
        validate(&mesh),
        Err(MeshError::Face { patch: None, .. })
    ));
}

#[test]
fn a_damaged_file_is_an_error_and_no_panic() {
    for name in [
        "mixed.msh",
        "periodic.msh",
        "mixed_binary.msh",
        "periodic_binary.msh",
    ] {
        let bytes = std::fs::read(path(name)).expect("file");
        for length in (1..bytes.len() - 20).step_by(311) {
            // Cut between sections, what is left may be a mesh.
            let _ = parse(name, &bytes[..length]);
            let mut damaged = bytes.clone();
            damaged[length] ^= 0x55;
            let _ = parse(name, &damaged).map(|mesh| validate(&mesh));
        }
        let half = bytes.len() / 2;
        assert!(parse(name, &bytes[..half]).is_err());
    }
}
