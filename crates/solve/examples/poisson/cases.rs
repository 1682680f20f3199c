//! The meshes.

use fibreflow_mesh::{BoxElement, BoxMesh, Mesh, MeshError, Stretching};

/// A box, and whether slivers are made in it.
pub struct Case {
    mesh: BoxMesh,
    slivers: bool,
}

impl Case {
    /// The mesh, as it comes.
    pub fn build(&self) -> Result<Mesh, MeshError> {
        let mut mesh = self.mesh.build()?;
        if self.slivers {
            make_slivers(&mut mesh);
        }
        Ok(mesh)
    }
}

/// Every case with its name: kind of mesh and cells a side.
pub fn all() -> Vec<(&'static str, Case)> {
    let case = |mesh| Case {
        mesh,
        slivers: false,
    };
    let small_tetrahedra = || tetrahedra(40, 1.0);
    vec![
        ("uniform-64", case(channel(64, Stretching::Uniform))),
        ("tanh-20-96", case(channel(96, wall(96, 20.0)))),
        ("tanh-50-96", case(channel(96, wall(96, 50.0)))),
        ("tanh-20-128", case(channel(128, wall(128, 20.0)))),
        ("tanh-50-128", case(channel(128, wall(128, 50.0)))),
        ("ratio-1000-64", case(channel(64, ratio(64, 1000.0)))),
        ("tetrahedra-67", case(tetrahedra(67, 1.0))),
        ("tetrahedra-flat-20-67", case(tetrahedra(67, 0.05))),
        ("tetrahedra-flat-100-67", case(tetrahedra(67, 0.01))),
        (
            "tetrahedra-slivers-67",
            Case {
                mesh: tetrahedra(67, 1.0),
                slivers: true,
            },
        ),
        ("uniform-32", case(channel(32, Stretching::Uniform))),
        ("ratio-1000-32", case(channel(32, ratio(32, 1000.0)))),
        ("tetrahedra-40", case(small_tetrahedra())),
        (
            "tetrahedra-slivers-40",
            Case {
                mesh: small_tetrahedra(),
                slivers: true,
            },
        ),
        ("hexahedra-jittered-48", case(jittered(48))),
        ("uniform-128", case(channel(128, Stretching::Uniform))),
    ]
}

/// Unit cube with walls across y, periodic otherwise.
fn channel(cells: usize, stretching: Stretching) -> BoxMesh {
    BoxMesh {
        cells: [cells; 3],
        periodic: [true, false, true],
        stretching: [Stretching::Uniform, stretching, Stretching::Uniform],
        ..BoxMesh::default()
    }
}

fn jittered(cells: usize) -> BoxMesh {
    BoxMesh {
        jitter: 0.2,
        seed: 3,
        ..channel(cells, Stretching::Uniform)
    }
}

fn tetrahedra(cells: usize, height: f64) -> BoxMesh {
    BoxMesh {
        element: BoxElement::Tetrahedron,
        size: [1.0, height, 1.0],
        ..jittered(cells)
    }
}

/// The longest cell `span` times the shortest.
fn ratio(cells: usize, span: f64) -> Stretching {
    Stretching::Geometric(span.powf(1.0 / (cells - 1) as f64))
}

/// Cells at the wall `aspect` times as long as high.
fn wall(cells: usize, aspect: f64) -> Stretching {
    let spacing = 1.0 / cells as f64;
    let first = |beta: f64| 0.5 * (1.0 - (beta * (1.0 - 2.0 * spacing)).tanh() / beta.tanh());
    let (mut low, mut high) = (1e-3, 10.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if first(middle) * aspect > spacing {
            low = middle;
        } else {
            high = middle;
        }
    }
    Stretching::Tanh(low)
}

/// Flattens one tetrahedron around every 27th node to a hundredth of its height, which stretches its neighbours. Nodes on
/// patches stay, and those whose other tetrahedra would turn over or are flattened already.
fn make_slivers(mesh: &mut Mesh) {
    const LEFT: f64 = 0.01;
    let mut around = vec![Vec::new(); mesh.nodes.len()];
    for element in 0..mesh.elements.len() {
        for &node in mesh.elements.nodes(element) {
            around[node as usize].push(element);
        }
    }
    let mut stays = vec![false; mesh.nodes.len()];
    for node in mesh
        .boundary
        .iter()
        .flat_map(|face| &face.nodes[..face.vertices as usize])
    {
        stays[*node as usize] = true;
    }
    for node in (13..mesh.nodes.len()).step_by(27) {
        let near = |&e: &usize| mesh.elements.nodes(e).iter().any(|&n| stays[n as usize]);
        if around[node].iter().any(near) {
            continue;
        }
        let height = height(mesh, around[node][node % around[node].len()], node);
        let before = mesh.nodes[node];
        mesh.nodes[node] = std::array::from_fn(|c| before[c] - (1.0 - LEFT) * height[c]);
        if around[node].iter().all(|&e| volume(mesh, e) > 0.0) {
            stays[node] = true;
        } else {
            mesh.nodes[node] = before;
        }
    }
}

/// From the opposite face of a tetrahedron to one of its nodes, along the face's normal.
fn height(mesh: &Mesh, element: usize, node: usize) -> [f64; 3] {
    let x = mesh
        .elements
        .coordinates(element, &mesh.nodes, &mesh.periods);
    let nodes = mesh.elements.nodes(element);
    let apex = nodes.iter().position(|&n| n as usize == node).unwrap_or(0);
    let [a, b, c] = [1, 2, 3].map(|k| x[(apex + k) % 4]);
    let normal = cross(minus(b, a), minus(c, a));
    let factor = dot(normal, minus(x[apex], a)) / dot(normal, normal);
    normal.map(|n| factor * n)
}

fn volume(mesh: &Mesh, element: usize) -> f64 {
    let x = mesh
        .elements
        .coordinates(element, &mesh.nodes, &mesh.periods);
    let [a, b, c] = [1, 2, 3].map(|k| minus(x[k], x[0]));
    dot(cross(a, b), c) / 6.0
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| a[c] - b[c])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| a[(c + 1) % 3] * b[(c + 2) % 3] - a[(c + 2) % 3] * b[(c + 1) % 3])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
