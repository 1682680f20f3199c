//! Values at fixed points are those of the shape functions, whichever rank holds the element.

use super::{Outcome, ensure};
use fibreflow_coupling::{PointSet, Probes};
use fibreflow_mesh::{BoxElement, BoxMesh, distribute};
use fibreflow_parallel::Communicator;
use std::sync::Arc;

const GRADIENT: [[f64; 3]; 3] = [[0.3, -1.2, 0.7], [2.0, 0.4, -0.9], [-0.5, 1.1, -0.7]];

fn linear(x: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| 0.1 * i as f64 + (0..3).map(|j| GRADIENT[i][j] * x[j]).sum::<f64>())
}

/// A list, a plane and a box that reaches out of the mesh, on a mesh of all kinds of elements.
///
/// # Errors
/// A value that is off, a point that nobody has, a layer that is not written.
pub fn exact_on_any_ranks(communicator: &Communicator) -> Outcome {
    let cube = BoxMesh {
        cells: [5, 4, 6],
        element: BoxElement::Mixed,
        jitter: 0.2,
        seed: 5,
        ..BoxMesh::default()
    };
    let mesh = communicator.is_root().then(|| cube.build()).transpose()?;
    let mesh = Arc::new(distribute(communicator, mesh)?);
    let velocity: Vec<[f64; 4]> = (mesh.nodes.iter())
        .map(|&x| {
            let [u, v, w] = linear(x);
            [u, v, w, 0.0]
        })
        .collect();
    let pressure: Vec<f64> = mesh.nodes.iter().map(|x| 2.0 - x[1]).collect();
    let (corner, middle) = ([1.0; 3], [0.5, 0.25, 0.5]);
    let sets = [
        PointSet::List(vec![middle, corner, [0.0, 0.3, 1.0], [1.2, 0.5, 0.5]]),
        PointSet::Grid {
            origin: [0.0, 0.37, 0.0],
            spacing: [0.1, 1.0, 0.05],
            counts: [11, 1, 21],
        },
        PointSet::Grid {
            origin: [0.05; 3],
            spacing: [0.1, 0.15, 0.11],
            counts: [10, 7, 10],
        },
    ];
    // 1.04 along z is outside the box.
    let (outside, layers) = ([1, 0, 70], [1, 21, 10]);
    for (set, probes) in Probes::new(&mesh, 1.0, &sets).iter().enumerate() {
        ensure(probes.outside() == outside[set], || {
            format!("set {set}: {} points outside", probes.outside())
        })?;
        let ends: Vec<_> = probes.layers().iter().filter(|l| !l.is_empty()).collect();
        let whole = ends.first().map(|l| l.start) == Some(0)
            && ends.last().map(|l| l.end) == Some(layers[set])
            && ends.windows(2).all(|w| w[1].start + 1 == w[0].end);
        ensure(whole, || format!("layers {ends:?}"))?;
        let values = probes.sample(&velocity, &pressure);
        ensure(values.len() == probes.mine().len(), || "length".to_owned())?;
        for (value, index) in values.iter().zip(probes.mine().clone()) {
            let x = place(&sets[set], index);
            if x.iter().any(|x| *x > 1.0 + 1e-9) {
                ensure(value.pressure.is_nan(), || format!("{x:?} has a value"))?;
                continue;
            }
            let wanted = linear(x);
            let mut off = (value.pressure - 2.0 + x[1]).abs();
            for i in 0..3 {
                off = off.max((value.velocity[i] - wanted[i]).abs());
                for j in 0..3 {
                    off = off.max((value.gradient[i][j] - GRADIENT[i][j]).abs());
                }
            }
            ensure(off < 1e-10, || format!("set {set}, {x:?}: off by {off}"))?;
            let [a, b, c] = value.vorticity();
            let spin = (a - 2.0).abs() + (b - 1.2).abs() + (c - 3.2).abs();
            ensure(spin < 1e-9, || format!("vorticity {a} {b} {c}"))?;
        }
    }
    Ok(())
}

fn place(set: &PointSet, index: usize) -> [f64; 3] {
    match set {
        PointSet::List(points) => points[index],
        PointSet::Grid {
            origin,
            spacing,
            counts,
        } => {
            let at = [
                index % counts[0],
                index / counts[0] % counts[1],
                index / counts[0] / counts[1],
            ];
            [0, 1, 2].map(|c| origin[c] + spacing[c] * at[c] as f64)
        }
    }
}
