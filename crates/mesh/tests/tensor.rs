//! Tensor-product meshes are found under any numbering, refused when they are none, and made of lines.

use fibreflow_mesh::{
    BoxElement, BoxMesh, DualGeometry, Line, LocalMesh, Mesh, Stretching, TensorGrid, geometry,
};
use rand::seq::SliceRandom;
use rand::{SeedableRng, rngs::StdRng};

fn boxes() -> Vec<BoxMesh> {
    let stretching = [
        Stretching::Tanh(1.5),
        Stretching::Geometric(3.0),
        Stretching::Uniform,
    ];
    [
        ([6, 5, 4], [false, false, false]),
        ([5, 7, 3], [true, false, true]),
        ([6, 4, 2], [true, true, true]),
        ([5, 2, 1], [true, true, true]),
        ([5, 1, 3], [false, true, false]),
        ([2, 1, 1], [false, false, true]),
    ]
    .into_iter()
    .map(|(cells, periodic)| BoxMesh {
        origin: [-0.3, 0.2, 1.0],
        size: [1.0, 2.0, 0.7],
        cells,
        stretching,
        periodic,
        ..BoxMesh::default()
    })
    .collect()
}

/// The same mesh with its nodes and elements in a random order.
fn shuffled(mesh: &Mesh) -> Mesh {
    let mut generator = StdRng::seed_from_u64(5);
    let mut name: Vec<u32> = (0..mesh.nodes.len() as u32).collect();
    name.shuffle(&mut generator);
    let mut order: Vec<usize> = (0..mesh.elements.len()).collect();
    order.shuffle(&mut generator);
    let mut other = mesh.clone();
    for (i, &k) in name.iter().enumerate() {
        other.nodes[k as usize] = mesh.nodes[i];
    }
    other.elements = fibreflow_mesh::Elements::default();
    for e in order {
        let nodes: Vec<u32> = mesh
            .elements
            .nodes(e)
            .iter()
            .map(|&n| name[n as usize])
            .collect();
        other
            .elements
            .push(mesh.elements.kinds[e], &nodes, mesh.elements.images(e));
    }
    for face in &mut other.boundary {
        let corners = face.nodes.iter_mut().take(face.vertices.into());
        corners.for_each(|n| *n = name[*n as usize]);
    }
    other
}

fn lines(grid: &TensorGrid) -> [Line; 3] {
    std::array::from_fn(|c| Line::second(&grid.coordinates[c], grid.periods[c]))
}

/// Largest deviation of the dual geometry from the product of the lines, relative to each entry.
fn deviation(mesh: &LocalMesh, dual: &DualGeometry, grid: &TensorGrid) -> f64 {
    let lines = lines(grid);
    let counts = grid.counts();
    let mut worst = 0.0f64;
    let mut compare = |found: f64, expected: f64, scale: f64| {
        worst = worst.max((found - expected).abs() / scale);
    };
    let across = |at: [u32; 3], axis: usize| -> f64 {
        let others = (0..3).filter(|&c| c != axis);
        others.map(|c| lines[c].norm[at[c] as usize]).product()
    };
    let mut pair = |i: usize, d: [f64; 3], face: [f64; 4]| {
        let axis = (0..3)
            .max_by(|&a, &b| d[a].abs().total_cmp(&d[b].abs()))
            .expect("three axes");
        let (at, n) = (grid.indices[i], counts[axis] as u32);
        let a = if d[axis] > 0.0 {
            at[axis]
        } else {
            (at[axis] + n - 1) % n
        };
        let pair = lines[axis].pairs.iter().find(|p| p.a == a).expect("pair");
        let area = across(at, axis);
        for c in 0..3 {
            let along = if c == axis {
                d[axis].signum() * pair.skew * area
            } else {
                0.0
            };
            compare(face[c], along, area);
        }
        let w = pair.stiffness * area;
        compare(face[3], w, w);
    };
    for i in 0..mesh.owned() {
        for e in dual.row(i) {
            pair(i, dual.displacements[e], dual.faces[e]);
        }
    }
    for &(i, image, face) in &dual.self_pairs {
        pair(i as usize, mesh.periods.shift(image), face);
    }
    for i in 0..mesh.owned() {
        let at = grid.indices[i];
        let volume: f64 = (0..3).map(|c| lines[c].norm[at[c] as usize]).product();
        compare(dual.volumes[i], volume, volume);
    }
    for share in &dual.boundary {
        let at = grid.indices[share.node as usize];
        let axis = (0..3)
            .find(|&c| share.area[c].abs() > 1e-8)
            .expect("a face across an axis");
        let sign = if at[axis] == 0 { -1.0 } else { 1.0 };
        let area = across(at, axis);
        compare(share.area[axis], sign * area, area);
    }
    worst
}

#[test]
fn lines_make_the_two_point_geometry() {
    for case in boxes() {
        let mesh = case.build().expect("mesh");
        for mesh in [shuffled(&mesh), mesh] {
            let mesh = LocalMesh::single(mesh);
            let grid = TensorGrid::detect(&mesh).expect("a tensor grid");
            for c in 0..3 {
                let end = usize::from(!case.periodic[c]);
                assert_eq!(grid.coordinates[c].len(), case.cells[c] + end);
                assert_eq!(grid.periods[c], case.periodic[c].then_some(case.size[c]));
            }
            for (x, at) in mesh.nodes.iter().zip(&grid.indices) {
                (0..3).for_each(|c| assert_eq!(x[c], grid.coordinates[c][at[c] as usize]));
            }
            let dual = geometry::dual(&mesh).expect("dual");
            let worst = deviation(&mesh, &dual, &grid);
            assert!(worst < 2e-13, "{case:?}: {worst:e}");
        }
    }
}

#[test]
fn nodes_placed_to_twelve_digits_are_found() {
    for case in boxes() {
        let mut mesh = shuffled(&case.build().expect("mesh"));
        for (i, x) in mesh.nodes.iter_mut().flatten().enumerate() {
            *x += 1e-12 * (i as f64 * 0.7).sin();
        }
        let grid = TensorGrid::detect(&LocalMesh::single(mesh)).expect("a tensor grid");
        assert_eq!(grid.counts().iter().product::<usize>(), grid.indices.len());
    }
}

#[test]
fn one_moved_node_is_seen() {
    for case in boxes() {
        let mesh = shuffled(&case.build().expect("mesh"));
        for axis in 0..3 {
            let mut planes: Vec<f64> = mesh.nodes.iter().map(|x| x[axis]).collect();
            planes.sort_unstable_by(f64::total_cmp);
            planes.dedup();
            planes.push(case.origin[axis] + case.size[axis]);
            let gaps = planes.windows(2).map(|x| x[1] - x[0]).filter(|&h| h > 0.0);
            let spacing = gaps.fold(f64::INFINITY, f64::min);
            for share in [1e-6, 0.3] {
                let mut moved = mesh.clone();
                let node = moved.nodes.len() / 2;
                moved.nodes[node][axis] += share * spacing;
                let found = TensorGrid::detect(&LocalMesh::single(moved));
                assert_eq!(found, None, "{case:?}: axis {axis}, {share} moved");
            }
        }
    }
}

#[test]
fn an_incomplete_lattice_is_refused() {
    let mesh = BoxMesh {
        cells: [4, 3, 2],
        ..BoxMesh::default()
    };
    let mut lacking = mesh.build().expect("mesh");
    // The nodes of a box, but a cell is not there.
    let whole = std::mem::take(&mut lacking.elements);
    for e in 1..whole.len() {
        let kind = whole.kinds[e];
        lacking.elements.push(kind, whole.nodes(e), whole.images(e));
    }
    assert_eq!(
        TensorGrid::detect(&LocalMesh::single(lacking.clone())),
        None
    );
    // As many cells as a box, but one of them twice.
    let (kind, nodes) = (whole.kinds[5], whole.nodes(5));
    lacking.elements.push(kind, nodes, whole.images(5));
    assert_eq!(TensorGrid::detect(&LocalMesh::single(lacking)), None);
}

#[test]
fn other_meshes_are_refused() {
    let cube = BoxMesh {
        cells: [5, 4, 4],
        ..BoxMesh::default()
    };
    let detect = |mesh: Mesh| TensorGrid::detect(&LocalMesh::single(mesh));
    for element in [
        BoxElement::Tetrahedron,
        BoxElement::Prism,
        BoxElement::Mixed,
    ] {
        let mesh = BoxMesh {
            element,
            ..cube.clone()
        };
        assert_eq!(detect(mesh.build().expect("mesh")), None);
    }
    let jittered = BoxMesh {
        jitter: 0.1,
        ..cube.clone()
    };
    assert_eq!(detect(jittered.build().expect("mesh")), None);
    // Orthogonal hexahedra, but turned.
    let mut turned = cube.build().expect("mesh");
    for x in &mut turned.nodes {
        *x = [0.6 * x[0] - 0.8 * x[1], 0.8 * x[0] + 0.6 * x[1], x[2]];
    }
    assert_eq!(detect(turned), None);
    // An axis-parallel mesh of the right number of nodes whose planes do not run through: one end sheared in steps.
    let mut stepped = cube.build().expect("mesh");
    for x in &mut stepped.nodes {
        x[1] *= 1.0 + x[0];
    }
    assert_eq!(detect(stepped), None);
}
