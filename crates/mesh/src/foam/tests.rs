use super::*;
use crate::measures::{close, element_volume, of_kind, patch_area, path};
use crate::{ElementKind, validate};

#[test]
fn text_and_binary_are_the_mesh_that_gmsh_wrote() {
    let gmsh = crate::gmsh::read(&path("mixed.msh")).expect("Gmsh");
    for form in ["text", "binary"] {
        let mesh = read(&path(&format!("mixed_{form}.polyMesh"))).expect(form);
        assert_eq!(validate(&mesh), Ok(()), "{form}");
        assert_eq!(mesh.patches, ["bottom", "sides", "top"]);
        assert_eq!(mesh.nodes.len(), gmsh.nodes.len());
        for kind in ElementKind::ALL {
            assert_eq!(of_kind(&mesh, kind), of_kind(&gmsh, kind), "{form}");
        }
        // Coordinates went through text of twelve digits.
        assert!((element_volume(&mesh) - 2.5).abs() < 1e-10);
        for patch in &mesh.patches {
            let (a, b) = (patch_area(&mesh, patch), patch_area(&gmsh, patch));
            assert!(
                (0..3).all(|c| (a[c] - b[c]).abs() < 1e-10),
                "{patch} {a:?} {b:?}"
            );
        }
        let mut places = [mesh, gmsh.clone()].map(|mesh| {
            let round = |x: &[f64; 3]| x.map(|x| (x * 1e6).round() as i64);
            mesh.nodes.iter().map(round).collect::<Vec<_>>()
        });
        places.iter_mut().for_each(|p| p.sort_unstable());
        assert_eq!(places[0], places[1]);
    }
}

#[test]
fn cyclic_patches_are_a_period_and_empty_ones_patches() {
    for form in ["text", "binary"] {
        let mesh = read(&path(&format!("box_{form}.polyMesh"))).expect(form);
        assert_eq!(validate(&mesh), Ok(()), "{form}");
        assert_eq!(mesh.periods.vectors, [[2.0, 0.0, 0.0], [0.0; 3], [0.0; 3]]);
        assert_eq!(mesh.patches, ["walls", "frontAndBack"]);
        assert_eq!((mesh.nodes.len(), mesh.elements.len()), (4 * 4 * 3, 24));
        assert!(close(&[element_volume(&mesh)], &[1.0]));
        assert!(close(&patch_area(&mesh, "walls"), &[0.0; 3]));
    }
}

/// A copy of the periodic box with text replaced in one of its files.
fn changed(file: &str, from: &str, to: &str) -> String {
    let folder = tempfile::tempdir().expect("folder");
    for name in ["points", "faces", "owner", "neighbour", "boundary"] {
        let text = std::fs::read_to_string(path("box_text.polyMesh").join(name)).expect("text");
        let text = if name == file {
            assert!(text.contains(from), "{from}");
            text.replacen(from, to, 1)
        } else {
            text
        };
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    let result = read(folder.path()).and_then(|mesh| validate(&mesh));
    result.map_or_else(|e| e.to_string(), |()| "accepted".to_owned())
}

#[test]
fn what_is_wrong_is_named() {
    for (file, from, to, wanted) in [
        (
            "boundary",
            "neighbourPatch  right",
            "neighbourPatch  rigth",
            "no patch `rigth`",
        ),
        ("boundary", "cyclic;", "cyclicAMI;", "is cyclicAMI"),
        ("boundary", "wall;", "processor;", "reconstructParMesh"),
        (
            "boundary",
            "startFace       58;",
            "startFace       58",
            "`startFace` does not end",
        ),
        ("points", "(2 0 0)", "(2 0.1 0)", "no periodic copies"),
        (
            "points",
            "(2 0 0)",
            "(2 x 0)",
            "`x` where a number should be",
        ),
        ("points", "FoamFile", "FoamFiles", "no OpenFOAM file"),
        ("faces", "4(", "3(", "where `)` should be"),
        ("faces", "4(1 ", "4(77777 ", "point 77777"),
        ("owner", "\n0\n0\n0\n", "\n0\n0\n1\n", "cell 0 around"),
    ] {
        let message = changed(file, from, to);
        assert!(message.contains(wanted), "{file}, {to}: {message}");
    }
    let nowhere = read(&path("no_such_case"))
        .map(|_| ())
        .expect_err("nothing")
        .to_string();
    assert!(nowhere.contains("constant/polyMesh"), "{nowhere}");
}

/// A hexahedron of which one face is divided: a polyhedron.
#[test]
fn a_polyhedron_is_named_with_its_place() {
    let folder = tempfile::tempdir().expect("folder");
    let header = "FoamFile { version 2.0; format ascii; }\n";
    for (name, text) in [
        (
            "points",
            "8((0 0 0)(1 0 0)(1 1 0)(0 1 0)(0 0 1)(1 0 1)(1 1 1)(0 1 1))",
        ),
        (
            "faces",
            "7(3(0 2 1) 3(0 3 2) 4(4 5 6 7) 4(0 1 5 4) 4(1 2 6 5) 4(2 3 7 6) 4(3 0 4 7))",
        ),
        ("owner", "7{0}"),
        ("neighbour", "0()"),
        ("boundary", "1(all { type patch; nFaces 7; startFace 0; })"),
    ] {
        std::fs::write(folder.path().join(name), format!("{header}{text}")).expect("written");
    }
    let message = read(folder.path())
        .map(|_| ())
        .expect_err("refused")
        .to_string();
    assert!(
        message.contains("cell 0 around [0.5") && message.contains("3, 3, 4, 4"),
        "{message}"
    );
}

#[test]
fn a_damaged_file_is_an_error_and_no_panic() {
    for form in ["text", "binary"] {
        for name in ["points", "faces", "owner", "neighbour", "boundary"] {
            let whole = path(&format!("box_{form}.polyMesh"));
            let folder = tempfile::tempdir().expect("folder");
            for file in ["points", "faces", "owner", "neighbour", "boundary"] {
                std::fs::copy(whole.join(file), folder.path().join(file)).expect("copied");
            }
            let bytes = std::fs::read(whole.join(name)).expect("file");
            for at in (1..bytes.len()).step_by(53) {
                let mut damaged = bytes.clone();
                damaged[at] ^= 0x55;
                std::fs::write(folder.path().join(name), damaged).expect("written");
                let _ = read(folder.path()).map(|mesh| validate(&mesh));
            }
            std::fs::write(folder.path().join(name), &bytes[..bytes.len() / 2]).expect("written");
            assert!(read(folder.path()).is_err(), "{name}");
        }
    }
}
