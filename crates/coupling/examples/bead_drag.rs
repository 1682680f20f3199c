//! Drag of a fixed disc or sphere in a periodic square or cubic array (Sangani & Acrivos 1982) against the screening length ℓ, the width ξ
//! of the profile and the resolution: where the recommended ℓ comes from.
//! `cargo run --release -p fibreflow-coupling --example bead_drag [2|3]`

use fibreflow_coupling::smooth_profile::{BeadNodes, Profile};
use fibreflow_fluid::{BodyMotion, Fluid, FluidSettings, Inertia};
use fibreflow_mesh::{BoxMesh, LocalMesh, geometry};
use std::f64::consts::PI;
use std::sync::Arc;

/// A periodic box of unit spacing.
fn fluid(cells: [usize; 3]) -> Fluid {
    let mesh = BoxMesh {
        size: cells.map(|n| n as f64),
        cells,
        periodic: [true; 3],
        ..BoxMesh::default()
    };
    let local = LocalMesh::single(mesh.build().expect("box"));
    let geometry = geometry::dual(&local).expect("geometry");
    let settings = FluidSettings {
        inertia: Inertia::Steady,
        ..FluidSettings::new(1.0, 1.0)
    };
    Fluid::new(Arc::new(local), Arc::new(geometry), settings).expect("fluid")
}

/// Drag by μU, of a disc of unit depth or a sphere, by the part of the volume that it takes.
fn exact(radius: f64, cells: [usize; 3]) -> f64 {
    let side = cells[0] as f64;
    if cells[2] == 1 {
        let c = PI * (radius / side).powi(2);
        4.0 * PI / (-0.5 * c.ln() - 0.738 + c - 0.887 * c.powi(2) + 2.038 * c.powi(3))
    } else {
        let c = 4.0 / 3.0 * PI * (radius / side).powi(3);
        let bracket = 1.0 - 1.7601 * c.cbrt() + c - 1.5593 * c.powi(2) + 3.9799 * c.powf(8.0 / 3.0)
            - 3.0734 * c.powf(10.0 / 3.0);
        6.0 * PI * radius / bracket
    }
}

fn main() {
    let solid = std::env::args().nth(1).is_some_and(|a| a == "3");
    println!(
        "r_b/Δ, ξ/Δ, ℓ/ξ: drag by that of an array, mean and spread over positions, iterations"
    );
    let sizes = if solid {
        [(5.0, [32, 32, 32]), (6.0, [40, 40, 40])]
    } else {
        [(6.0, [48, 48, 1]), (12.0, [96, 96, 1])]
    };
    for (radius, cells) in sizes {
        for width in [1.0, 1.5, 2.0, 3.0] {
            let ratios = if solid {
                [0.75, 0.85, 0.9, 0.95]
            } else {
                [0.6, 0.75, 0.9, 1.05]
            };
            for ratio in ratios {
                let mut fluid = fluid(cells);
                let profile = Profile {
                    radius,
                    width,
                    cutoff: if solid { 5.0 } else { 4.0 } * width,
                };
                let nodes = BeadNodes::new(fluid.mesh(), profile);
                let (mut drags, mut iterations) = (Vec::new(), 0);
                for offset in [[0.0, 0.0], [0.5, 0.0], [0.3, 0.4]] {
                    let centre = [14.0 + offset[0], 14.0 + offset[1], 0.2];
                    let motion = BodyMotion::Given {
                        velocity: [1.0, 0.0, 0.0],
                        spin: [0.0; 3],
                    };
                    let parts = nodes.parts(&[centre]);
                    let held = fluid.set_bodies(ratio * width, parts, vec![motion], Vec::new());
                    held.expect("bodies");
                    iterations = fluid.advance(1.0).expect("step").poisson_iterations;
                    let force = fluid.body_states()[0].force[0];
                    drags.push(-force / exact(radius, cells));
                }
                let mean = drags.iter().sum::<f64>() / 3.0;
                let spread = drags.iter().map(|d| (d - mean).abs()).fold(0.0, f64::max);
                println!("{radius}, {width}, {ratio}: {mean:.4} ± {spread:.4}, {iterations}");
            }
        }
    }
}
