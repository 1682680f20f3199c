//! Drag of a held disc in a periodic square array (Sangani & Acrivos 1982) against the screening length ℓ, the width ξ of the profile and
//! the resolution: what the recommended ℓ comes from. `cargo run --release -p fibreflow-coupling --example bead_drag`

use fibreflow_coupling::smooth_profile::{BeadNodes, Profile};
use fibreflow_fluid::{BodyMotion, Fluid, FluidSettings, Inertia};
use fibreflow_mesh::{BoxMesh, LocalMesh, geometry};
use std::sync::Arc;

fn fluid(cells: usize) -> Fluid {
    let n = cells as f64;
    let mesh = BoxMesh {
        size: [n, n, 1.0],
        cells: [cells, cells, 1],
        periodic: [true; 3],
        ..BoxMesh::default()
    };
    let mesh = mesh.build().expect("box");
    let local = LocalMesh::single(mesh);
    let geometry = geometry::dual(&local).expect("geometry");
    let settings = FluidSettings {
        inertia: Inertia::Steady,
        ..FluidSettings::new(1.0, 1.0)
    };
    Fluid::new(Arc::new(local), Arc::new(geometry), settings).expect("fluid")
}

fn main() {
    println!(
        "r_b/Δ, ξ/Δ, ℓ/ξ, drag by that of an array of discs: mean over positions, spread, iterations"
    );
    for (radius, cells) in [(6.0, 48), (12.0, 96)] {
        let share = std::f64::consts::PI * radius * radius / (cells * cells) as f64;
        let bracket =
            -0.5 * share.ln() - 0.738 + share - 0.887 * share.powi(2) + 2.038 * share.powi(3);
        let exact = 4.0 * std::f64::consts::PI / bracket;
        for width in [1.0, 1.5, 2.0, 3.0] {
            for ratio in [0.75, 1.0, 1.25, 1.5, 2.0] {
                let mut fluid = fluid(cells);
                let profile = Profile {
                    radius,
                    width,
                    cutoff: 4.0 * width,
                };
                let nodes = BeadNodes::new(fluid.mesh(), profile);
                let (mut drags, mut iterations) = (Vec::new(), 0);
                for offset in [[0.0, 0.0], [0.5, 0.0], [0.3, 0.4]] {
                    let centre = [20.0 + offset[0], 20.0 + offset[1], 0.0];
                    let motion = BodyMotion::Given {
                        velocity: [1.0, 0.0, 0.0],
                        spin: [0.0; 3],
                    };
                    let parts = nodes.parts(&[centre]);
                    fluid
                        .set_bodies(ratio * width, parts, vec![motion], Vec::new())
                        .expect("bodies");
                    iterations = fluid.advance(1.0).expect("step").poisson_iterations;
                    drags.push(-fluid.body_states()[0].force[0] / exact);
                }
                let mean = drags.iter().sum::<f64>() / 3.0;
                let spread = drags.iter().map(|d| (d - mean).abs()).fold(0.0, f64::max);
                println!("{radius}, {width}, {ratio}: {mean:.4} ± {spread:.4}, {iterations}");
            }
        }
    }
}
