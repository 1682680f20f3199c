use super::*;
use crate::measures::{close, element_volume, of_kind, patch_area, path};
use crate::{BoxElement, BoxMesh, ElementKind, validate};
use std::fmt::Write as _;

const FILES: [&str; 6] = [
    "mixed_text.vtu",
    "mixed_zlib.vtu",
    "mixed_appended_raw.vtu",
    "mixed_appended_base64.vtu",
    "mixed_42.vtk",
    "mixed_51.vtk",
];

fn named() -> Options {
    let names = [("11", "bottom"), ("12", "top"), ("13", "sides")];
    Options {
        names: names.map(|(a, b)| (a.into(), b.into())).into(),
        ..Options::default()
    }
}

/// Nodes and the nodes of every element and face by position, whatever their order in the file.
fn sorted(mesh: &Mesh) -> Vec<Vec<[i64; 3]>> {
    let place = |&n: &u32| mesh.nodes[n as usize].map(|x| (x * 1e6).round() as i64);
    let elements = (0..mesh.elements.len()).map(|e| mesh.elements.nodes(e));
    let faces = mesh
        .boundary
        .iter()
        .map(|f| &f.nodes[..f.vertices as usize]);
    let mut all: Vec<Vec<[i64; 3]>> = elements
        .chain(faces)
        .map(|nodes| {
            let mut nodes: Vec<_> = nodes.iter().map(place).collect();
            nodes.sort_unstable();
            nodes
        })
        .collect();
    all.sort_unstable();
    all
}

#[test]
fn every_format_is_the_mesh_that_gmsh_wrote() {
    let gmsh = crate::gmsh::read(&path("mixed.msh")).expect("Gmsh");
    for file in FILES {
        let mesh = read(&path(file), &named()).expect(file);
        assert_eq!(validate(&mesh), Ok(()), "{file}");
        assert_eq!(mesh.patches, ["bottom", "top", "sides"], "{file}");
        assert_eq!(mesh.nodes.len(), gmsh.nodes.len(), "{file}");
        for kind in ElementKind::ALL {
            assert_eq!(of_kind(&mesh, kind), of_kind(&gmsh, kind), "{file}");
        }
        assert_eq!(sorted(&mesh), sorted(&gmsh), "{file}");
        assert!(close(&[element_volume(&mesh)], &[2.5]), "{file}");
        for patch in &mesh.patches {
            let (a, b) = (patch_area(&mesh, patch), patch_area(&gmsh, patch));
            assert!(close(&a, &b), "{file}: {patch} {a:?} {b:?}");
        }
    }
}

/// A legacy file of a mesh without periods; its patches, if wanted, numbered in the array `patch`.
fn legacy(mesh: &Mesh, surfaces: bool) -> String {
    let mut text = "# vtk DataFile Version 3.0\nbox\nASCII\nDATASET UNSTRUCTURED_GRID\n".to_owned();
    let _ = writeln!(text, "POINTS {} double", mesh.nodes.len());
    for [x, y, z] in &mesh.nodes {
        let _ = writeln!(text, "{x} {y} {z}");
    }
    let mut cells: Vec<(u8, Vec<u32>, u16)> = (0..mesh.elements.len())
        .map(|e| {
            let kind = mesh.elements.kinds[e].vtk_type();
            (kind, mesh.elements.nodes(e).to_vec(), 99)
        })
        .collect();
    if surfaces {
        cells.extend(mesh.boundary.iter().map(|f| {
            let count = f.vertices as usize;
            (5 + 4 * (f.vertices - 3), f.nodes[..count].to_vec(), f.patch)
        }));
    }
    let size: usize = cells.iter().map(|c| c.1.len() + 1).sum();
    let _ = writeln!(text, "CELLS {} {size}", cells.len());
    for (_, points, _) in &cells {
        let points: Vec<String> = points.iter().map(u32::to_string).collect();
        let _ = writeln!(text, "{} {}", points.len(), points.join(" "));
    }
    let _ = writeln!(text, "CELL_TYPES {}", cells.len());
    cells.iter().for_each(|c| _ = writeln!(text, "{}", c.0));
    let _ = writeln!(
        text,
        "CELL_DATA {0}\nVECTORS v float\n{1}",
        cells.len(),
        "0 0 0\n".repeat(cells.len())
    );
    text += "SCALARS patch int\nLOOKUP_TABLE default\n";
    cells.iter().for_each(|c| _ = writeln!(text, "{}", c.2));
    text
}

fn mixed_box(periodic: [bool; 3]) -> Mesh {
    let mesh = BoxMesh {
        size: [3.0, 1.0, 0.8],
        cells: [6, 3, 2],
        element: BoxElement::Mixed,
        periodic,
        ..BoxMesh::default()
    };
    mesh.build().expect("box")
}

fn pair(a: &str, b: &str, translation: Option<[f64; 3]>) -> PeriodicPatches {
    PeriodicPatches {
        patches: [a.into(), b.into()],
        translation,
    }
}

#[test]
fn without_surfaces_the_sides_of_a_box_are_patches_and_may_be_periodic() {
    let whole = mixed_box([false; 3]);
    let text = legacy(&whole, false);
    let mesh = parse("box.vtk", text.as_bytes(), &Options::default()).expect("mesh");
    assert_eq!(validate(&mesh), Ok(()));
    assert_eq!(
        mesh.patches,
        ["x_max", "x_min", "y_max", "y_min", "z_max", "z_min"]
    );
    for patch in &mesh.patches {
        assert!(close(&patch_area(&mesh, patch), &patch_area(&whole, patch)));
    }
    let options = Options {
        periodic: vec![
            pair("x_min", "x_max", None),
            pair("z_max", "z_min", Some([0.0, 0.0, -0.8])),
        ],
        names: [("y_min".into(), "floor".into())].into(),
        ..Options::default()
    };
    for surfaces in [false, true] {
        let mut options = options.clone();
        if surfaces {
            options.names = (whole.patches.iter().enumerate())
                .map(|(k, name)| (k.to_string(), name.replace("y_min", "floor")))
                .collect();
        }
        let text = legacy(&whole, surfaces);
        let mesh = parse("box.vtk", text.as_bytes(), &options).expect("mesh");
        let expected = mixed_box([true, false, true]);
        assert_eq!(validate(&mesh), Ok(()));
        assert_eq!(mesh.periods, expected.periods);
        let mut patches = mesh.patches.clone();
        patches.sort();
        assert_eq!(patches, ["floor", "y_max"]);
        assert_eq!(mesh.nodes.len(), expected.nodes.len());
        assert_eq!(sorted(&mesh), sorted(&expected));
        assert!(close(&[element_volume(&mesh)], &[2.4]));
    }
}

#[test]
fn wedges_of_either_direction_are_the_same() {
    let text = |order: &str| {
        format!(
            "# vtk DataFile Version 2.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 6 float\n0 0 0 1 0 0 0 1 0 0 0 1 1 0 1 0 1 1\nCELLS 1 7\n6 {order}\nCELL_TYPES 1\n13\n"
        )
    };
    for order in ["0 1 2 3 4 5", "0 2 1 3 5 4"] {
        let mesh = parse("w.vtk", text(order).as_bytes(), &Options::default()).expect("mesh");
        assert_eq!(validate(&mesh), Ok(()), "{order}");
        assert_eq!(mesh.patches.len(), 5, "{:?}", mesh.patches);
        assert!(close(&[element_volume(&mesh)], &[0.5]));
    }
}

fn refused(text: &str, options: &Options) -> String {
    parse("a.vtk", text.as_bytes(), options)
        .map(|_| ())
        .expect_err("refused")
        .to_string()
}

#[test]
fn what_is_wrong_is_named() {
    let any = Options::default();
    let text = legacy(&mixed_box([false; 3]), true);
    let with = |periodic| Options {
        periodic: vec![periodic],
        ..Options::default()
    };
    let names = |from: &str| Options {
        names: [(from.into(), "wall".into())].into(),
        ..Options::default()
    };
    for (text, options, wanted) in [
        ("hello".to_owned(), any.clone(), "this is no VTK file"),
        (
            text.replace("UNSTRUCTURED", "STRUCTURED"),
            any.clone(),
            "STRUCTURED_GRID",
        ),
        (
            text.replace("CELL_TYPES", "CELL_TIPES"),
            any.clone(),
            "CELL_TIPES",
        ),
        (
            text.replacen("\n12\n", "\n25\n", 1),
            any.clone(),
            "cell 0: VTK cell type 25",
        ),
        (
            text.replacen("\n12\n", "\n10\n", 1),
            any.clone(),
            "has 4 points, not 8",
        ),
        (
            text.clone(),
            names("7"),
            "no surface `7` to name; there are `0`, `1`",
        ),
        (
            text.clone(),
            with(pair("surface_0", "inlet", None)),
            "no patch `inlet`",
        ),
        (
            text.clone(),
            with(pair("surface_0", "surface_2", None)),
            "no periodic copies",
        ),
        (
            text.clone(),
            with(pair("surface_0", "surface_1", Some([2.5, 0.0, 0.0]))),
            "has no partner",
        ),
        (
            text.clone(),
            Options {
                array: Some("zone".into()),
                ..Options::default()
            },
            "no cell array `zone` with one number a cell; there are `patch`",
        ),
        (
            "<VTKFile type=\"PolyData\"></VTKFile>".into(),
            any.clone(),
            "UnstructuredGrid",
        ),
        (
            "<VTKFile type=\"UnstructuredGrid\" compressor=\"vtkLZ4DataCompressor\"></VTKFile>"
                .into(),
            any.clone(),
            "LZ4",
        ),
        (
            "<VTKFile type=\"UnstructuredGrid\"></VTKFile>".into(),
            any,
            "0 pieces",
        ),
    ] {
        let message = refused(&text, &options);
        assert!(
            message.contains(wanted) && message.starts_with("a.vtk"),
            "{message}"
        );
    }
}

#[test]
fn a_damaged_file_is_an_error_and_no_panic() {
    for name in FILES {
        let bytes = std::fs::read(path(name)).expect("file");
        for length in (1..bytes.len() - 20).step_by(97) {
            let _ = parse(name, &bytes[..length], &named());
            let mut damaged = bytes.clone();
            damaged[length] ^= 0x55;
            let _ = parse(name, &damaged, &named()).map(|mesh| validate(&mesh));
        }
        assert!(
            parse(name, &bytes[..bytes.len() / 2], &named()).is_err(),
            "{name}"
        );
    }
}
