//! Meshes for the checks.

use fibreflow_mesh::{ElementKind, Image, Mesh};

/// A unit cube of n³ hexahedra, periodic in z.
pub fn cube(n: usize) -> Mesh {
    let mut mesh = Mesh::default();
    mesh.periods.vectors[2] = [0.0, 0.0, 1.0];
    let h = 1.0 / n as f64;
    for k in 0..n {
        for j in 0..=n {
            for i in 0..=n {
                mesh.nodes.push([i as f64 * h, j as f64 * h, k as f64 * h]);
            }
        }
    }
    let node = |i, j, k| (i + (n + 1) * (j + (n + 1) * (k % n))) as u32;
    for k in 0..n {
        for j in 0..n {
            for i in 0..n {
                let square = |k| {
                    [
                        node(i, j, k),
                        node(i + 1, j, k),
                        node(i + 1, j + 1, k),
                        node(i, j + 1, k),
                    ]
                };
                let nodes = [square(k), square(k + 1)].concat();
                let top = Image::new([0, 0, i8::from(k + 1 == n)]);
                let images = [[Image::ZERO; 4], [top; 4]].concat();
                mesh.elements.push(ElementKind::Hexahedron, &nodes, &images);
            }
        }
    }
    mesh
}
