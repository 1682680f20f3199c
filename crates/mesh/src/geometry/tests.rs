//! Closure, symmetry and linear exactness of the dual geometry on every kind of box.

use super::*;
use crate::{BoxElement, BoxMesh, Stretching};
use std::collections::HashSet;

const KINDS: [BoxElement; 5] = [
    BoxElement::Hexahedron,
    BoxElement::Prism,
    BoxElement::Tetrahedron,
    BoxElement::PyramidHexahedron,
    BoxElement::Mixed,
];

/// Boxes of all elements with walls, mixed periodicity and thin periodic directions; `jitter` on inner nodes.
fn boxes(jitter: f64) -> Vec<BoxMesh> {
    let stretching = [
        Stretching::Tanh(1.5),
        Stretching::Geometric(1.2),
        Stretching::Uniform,
    ];
    let shapes = [
        ([6, 5, 4], [false, false, false]),
        ([5, 4, 3], [true, false, true]),
        ([6, 4, 2], [true, true, true]),
        ([5, 2, 1], [true, true, true]),
        ([5, 1, 3], [false, true, false]),
    ];
    let of_kind = |element| {
        shapes.map(move |(cells, periodic)| BoxMesh {
            origin: [-0.3, 0.2, 1.0],
            size: [1.0, 2.0, 0.7],
            cells,
            stretching,
            periodic,
            element,
            jitter,
            seed: 7,
        })
    };
    KINDS.into_iter().flat_map(of_kind).collect()
}

fn local(mesh: &BoxMesh) -> LocalMesh {
    LocalMesh::single(mesh.build().expect("mesh"))
}

fn dot(a: [f64; 3], b: &[f64]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// For every node: Σ S + boundary, Σ|S|, V·gradient and Laplacian of a·x (self-pairs included), Σ|w||d|.
fn check_rows(mesh: &LocalMesh, dual: &DualGeometry, a: [f64; 3], case: &BoxMesh) {
    let n = mesh.owned();
    let (mut closure, mut gradient) = (vec![[0.0; 3]; n], vec![[0.0; 3]; n]);
    let (mut area, mut laplacian, mut weight) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let mut add = |i: usize, face: &[f64; 4], d: [f64; 3]| {
        for c in 0..3 {
            closure[i][c] += face[c];
            gradient[i][c] += 0.5 * face[c] * dot(a, &d);
        }
        area[i] += dot([face[0], face[1], face[2]], face).sqrt();
        laplacian[i] += face[3] * dot(a, &d);
        weight[i] += face[3].abs() * dot(d, &d).sqrt();
    };
    for i in 0..n {
        for e in dual.row(i) {
            add(i, &dual.faces[e], dual.displacements[e]);
        }
    }
    for &(i, image, face) in &dual.self_pairs {
        add(i as usize, &face, mesh.periods.shift(image));
    }
    let mut is_interior = vec![true; n];
    for share in &dual.boundary {
        is_interior[share.node as usize] = false;
        (0..3).for_each(|c| closure[share.node as usize][c] += share.area[c]);
    }
    let mut interior = 0;
    for i in 0..n {
        let open = closure[i].iter().fold(0.0, |m: f64, s| m.max(s.abs()));
        assert!(
            open <= 1e-13 * area[i],
            "{case:?}: node {i} open by {open:e} of {:e}",
            area[i]
        );
        if is_interior[i] {
            interior += 1;
            for c in 0..3 {
                let error = gradient[i][c] / dual.volumes[i] - a[c];
                assert!(
                    error.abs() < 1e-12,
                    "{case:?}: gradient of node {i} off by {error:e}"
                );
            }
            let scale = 1e-13 * weight[i];
            assert!(
                laplacian[i].abs() < scale,
                "{case:?}: Laplacian {:e}",
                laplacian[i]
            );
        }
    }
    assert!(interior > 0, "{case:?} tests nothing");
}

#[test]
fn area_vectors_close_and_linear_fields_are_exact() {
    for jitter in [0.0, 0.2] {
        for case in boxes(jitter) {
            let mesh = local(&case);
            let dual = dual(&mesh).expect("dual");
            assert_eq!(
                dual.orthogonal,
                case.element == BoxElement::Hexahedron && jitter == 0.0,
                "{case:?}"
            );
            check_rows(&mesh, &dual, [0.3, -1.1, 0.7], &case);
        }
    }
}

#[test]
fn pairs_of_fourth_order_close_and_are_exact_for_linear_fields() {
    let shapes = [
        ([10, 9, 8], [false, true, false]),
        ([9, 12, 1], [true, false, true]),
        ([12, 2, 8], [true, true, true]),
    ];
    for (cells, periodic) in shapes {
        let case = BoxMesh {
            cells,
            periodic,
            ..boxes(0.0)[0].clone()
        };
        let mesh = local(&case);
        let dual = fourth(&mesh).expect("tensor product");
        check_rows(&mesh, &dual, [0.3, -1.1, 0.7], &case);
        let volume: f64 = case.size.iter().product();
        assert!((dual.total_volume / volume - 1.0).abs() < 1e-13, "{case:?}");
        assert!(dual.volumes.iter().all(|&v| v > 0.0), "{case:?}");
        let longest = (0..mesh.owned()).map(|i| dual.row(i).len()).max();
        assert!(longest >= Some(6), "{case:?}: {longest:?} neighbours");
    }
    let jittered = local(&boxes(0.2)[0]);
    assert_eq!(fourth(&jittered).err(), Some(MeshError::NotTensorProduct));
}

#[test]
fn dual_volumes_are_positive_and_fill_the_box() {
    for jitter in [0.0, 0.2] {
        for case in boxes(jitter) {
            let dual = dual(&local(&case)).expect("dual");
            let volume: f64 = case.size.iter().product();
            assert!((dual.total_volume / volume - 1.0).abs() < 1e-13, "{case:?}");
            assert!(dual.volumes.iter().all(|&v| v > 0.0), "{case:?}");
        }
    }
}

#[test]
fn pairs_are_antisymmetric_bitwise() {
    for case in boxes(0.2).into_iter().chain(boxes(0.0)) {
        let mesh = local(&case);
        let dual = dual(&mesh).expect("dual");
        for i in 0..mesh.owned() {
            let mut keys = HashSet::new();
            for e in dual.row(i) {
                let (j, image) = (dual.columns[e] as usize, dual.images[e]);
                assert!(keys.insert((j, image)), "{case:?}: pair {i} {j} twice");
                let back = dual
                    .row(j)
                    .find(|&b| dual.columns[b] as usize == i && dual.images[b] == image.opposite())
                    .expect("a pair seen from both sides");
                let (f, g) = (dual.faces[e], dual.faces[back]);
                assert_eq!([f[0], f[1], f[2], f[3]], [-g[0], -g[1], -g[2], g[3]]);
                let mass = |e: usize| dual.masses.get(e);
                assert_eq!(mass(e), mass(back));
                assert_eq!(mass(e).is_none(), dual.orthogonal);
                let opposite = dual.displacements[back].map(|d| -d);
                assert_eq!(dual.displacements[e], opposite);
            }
            let keys: Vec<_> = dual
                .row(i)
                .map(|e| (dual.columns[e], dual.images[e]))
                .collect();
            assert!(keys.is_sorted());
        }
    }
}

#[test]
fn thin_periodic_directions_keep_their_pairs() {
    let case = BoxMesh {
        cells: [4, 2, 1],
        size: [1.0, 1.0, 0.25],
        periodic: [true; 3],
        ..BoxMesh::default()
    };
    let dual = dual(&local(&case)).expect("dual");
    assert!(dual.orthogonal);
    for i in 0..8 {
        // Two neighbours along x; the one along y twice, with opposite displacements; itself along z.
        assert_eq!(dual.row(i).len(), 4);
        let other = (i + 4) % 8;
        let twice: Vec<f64> = dual
            .row(i)
            .filter(|&e| dual.columns[e] as usize == other)
            .map(|e| dual.displacements[e][1])
            .collect();
        assert_eq!(twice.len(), 2);
        assert_eq!(twice[0], -twice[1]);
        assert_eq!(twice[0].abs(), 0.5);
    }
    assert_eq!(dual.self_pairs.len(), 16);
    for &(_, image, face) in &dual.self_pairs {
        let shift = f64::from(image.shifts()[2]);
        assert_eq!(shift.abs(), 1.0);
        // Face 0.25 x 0.5 across z at distance 0.25.
        assert_eq!(face, [0.0, 0.0, 0.125 * shift, 0.5]);
    }
}

#[test]
fn orthogonal_hexahedra_have_seven_points() {
    let case = BoxMesh {
        cells: [3, 3, 3],
        size: [3.0, 6.0, 1.5],
        ..BoxMesh::default()
    };
    let dual = dual(&local(&case)).expect("dual");
    let centre = 1 + 4 * (1 + 4);
    let faces: Vec<[f64; 4]> = dual.row(centre).map(|e| dual.faces[e]).collect();
    assert_eq!(faces.len(), 6);
    // Spacings 1, 2, 0.5: |S|/|d| = 1·2/0.5 along z, 1·0.5/2 along y, 2·0.5/1 along x.
    assert_eq!(faces[0], [0.0, 0.0, -2.0, 4.0]);
    assert_eq!(faces[1], [0.0, -0.5, 0.0, 0.25]);
    assert_eq!(faces[2], [-1.0, 0.0, 0.0, 1.0]);
    assert_eq!(dual.volumes[centre], 1.0);
}

#[test]
fn a_generator_that_places_nodes_to_twelve_digits_keeps_seven_points_and_closure() {
    let case = BoxMesh {
        cells: [5, 5, 5],
        stretching: [Stretching::Tanh(2.0); 3],
        ..BoxMesh::default()
    };
    let mut mesh = local(&case);
    for (i, x) in mesh.nodes.iter_mut().flatten().enumerate() {
        *x += 1e-12 * (i as f64 * 0.7).sin();
    }
    let dual = dual(&mesh).expect("dual");
    assert!(dual.orthogonal);
    let mut open = vec![[0.0; 3]; mesh.owned()];
    for i in 0..mesh.owned() {
        for face in &dual.faces[dual.row(i)] {
            (0..3).for_each(|c| open[i][c] += face[c]);
        }
    }
    for share in &dual.boundary {
        (0..3).for_each(|c| open[share.node as usize][c] += share.area[c]);
    }
    // The smallest dual faces have 5e-4 m².
    assert!(open.iter().flatten().all(|s| s.abs() < 1e-16), "{open:?}");
}

#[test]
fn tetrahedra_have_the_median_dual() {
    let case = BoxMesh {
        cells: [3, 3, 3],
        element: BoxElement::Tetrahedron,
        jitter: 0.2,
        seed: 3,
        ..BoxMesh::default()
    };
    let mesh = local(&case);
    let dual = dual(&mesh).expect("dual");
    let mut volumes = vec![0.0; mesh.owned()];
    let mut areas = vec![[0.0; 3]; dual.columns.len()];
    for e in 0..mesh.elements.len() {
        let x = mesh.elements.coordinates(e, &mesh.nodes, &mesh.periods);
        let nodes = mesh.elements.nodes(e);
        let mean = |vertices: &[usize]| -> [f64; 3] {
            std::array::from_fn(|c| {
                vertices.iter().map(|&v| x[v][c]).sum::<f64>() / vertices.len() as f64
            })
        };
        let volume = crate::jacobian::smallest_jacobian(ElementKind::Tetrahedron, &x).1 / 6.0;
        nodes
            .iter()
            .for_each(|&n| volumes[n as usize] += volume / 4.0);
        // Even permutations of the vertices: the dual face of a, b is a–b edge, face and cell centroids.
        for [a, b, c, d] in [
            [0, 1, 2, 3],
            [0, 2, 3, 1],
            [0, 3, 1, 2],
            [1, 2, 0, 3],
            [1, 3, 2, 0],
            [2, 3, 0, 1],
        ] {
            let (edge, cell) = (mean(&[a, b]), mean(&[0, 1, 2, 3]));
            let across = crate::shape::minus(mean(&[a, b, d]), mean(&[a, b, c]));
            let s = crate::shape::cross(crate::shape::minus(cell, edge), across).map(|s| 0.5 * s);
            for (i, j, sign) in [(a, b, 1.0), (b, a, -1.0)] {
                let (i, j) = (nodes[i] as usize, nodes[j]);
                let entry = dual.row(i).find(|&k| dual.columns[k] == j).expect("entry");
                (0..3).for_each(|k| areas[entry][k] += sign * s[k]);
            }
        }
    }
    for (area, face) in areas.iter().zip(&dual.faces) {
        for c in 0..3 {
            assert!((area[c] - face[c]).abs() < 1e-14, "{area:?} {face:?}");
        }
    }
    for (volume, expected) in dual.volumes.iter().zip(&volumes) {
        assert!((volume - expected).abs() < 1e-15);
    }
}

#[test]
fn sheared_hexahedra_take_the_galerkin_form() {
    let mut mesh = local(&BoxMesh {
        cells: [4, 4, 4],
        ..BoxMesh::default()
    });
    for x in &mut mesh.nodes {
        x[0] += 0.4 * x[1] + 0.2 * x[2];
    }
    let dual = dual(&mesh).expect("dual");
    assert!(!dual.orthogonal);
    check_rows(&mesh, &dual, [1.0, 2.0, 3.0], &BoxMesh::default());
    for i in 0..mesh.owned() {
        let energy: f64 = dual.row(i).map(|e| dual.faces[e][3]).sum();
        assert!(energy > 0.0);
    }
}

#[test]
fn an_inverted_element_is_named() {
    let mut mesh = BoxMesh {
        cells: [3, 3, 3],
        ..BoxMesh::default()
    }
    .build()
    .expect("mesh");
    let centre = 1 + 4 * (1 + 4);
    mesh.nodes[centre][0] = 1.4;
    match dual(&LocalMesh::single(mesh)) {
        Err(MeshError::Inverted { kind, jacobian, .. }) => {
            assert_eq!(kind, ElementKind::Hexahedron);
            assert!(jacobian <= 0.0);
        }
        other => panic!("{:?}", other.map(|d| d.total_volume)),
    }
}

#[test]
fn results_do_not_depend_on_the_thread_count() {
    let case = BoxMesh {
        cells: [30, 30, 25],
        jitter: 0.1,
        ..BoxMesh::default()
    };
    let mesh = local(&case);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("pool").install(|| dual(&mesh).expect("dual"))
    };
    let (one, three) = (with(1), with(3));
    assert_eq!(one.offsets, three.offsets);
    assert_eq!(one.columns, three.columns);
    assert_eq!(one.faces, three.faces);
    assert_eq!(one.total_volume.to_bits(), three.total_volume.to_bits());
}
