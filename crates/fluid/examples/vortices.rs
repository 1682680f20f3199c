//! Taylor–Green vortices carried by a drift (F1) on every kind of element: L2 error of the velocity at t = 2 by the exact
//! root mean square without drift, with lumped and with corrected mass.
//!
//! `cargo run --release -p fibreflow-fluid --example vortices [cells ...]`

use fibreflow_fluid::{Fluid, FluidSettings, Mass, initial::TaylorGreen};
use fibreflow_mesh::{BoxElement, BoxMesh, LocalMesh, geometry};
use std::error::Error;
use std::f64::consts::TAU;
use std::sync::Arc;

const FLOW: TaylorGreen = TaylorGreen {
    amplitude: 1.0,
    wave_number: 1.0,
    drift: [1.0, 1.0],
    kinematic_viscosity: 0.01,
};

const END: f64 = 2.0;

const KINDS: [BoxElement; 5] = [
    BoxElement::Hexahedron,
    BoxElement::Tetrahedron,
    BoxElement::Prism,
    BoxElement::PyramidHexahedron,
    BoxElement::Mixed,
];

fn error(element: BoxElement, n: usize, jitter: f64, mass: Mass) -> Result<f64, Box<dyn Error>> {
    let h = TAU / n as f64;
    let mesh = BoxMesh {
        size: [TAU, TAU, h],
        cells: [n, n, 1],
        periodic: [true; 3],
        element,
        jitter,
        seed: 3,
        ..BoxMesh::default()
    };
    let mesh = Arc::new(LocalMesh::single(mesh.build()?));
    let dual = Arc::new(geometry::dual(&mesh)?);
    let settings = FluidSettings {
        mass,
        ..FluidSettings::new(1.0, FLOW.kinematic_viscosity)
    };
    let mut fluid = Fluid::new(mesh, dual, settings)?;
    fluid.set_velocity(|x| FLOW.velocity(0.0, x))?;
    // Small against the error of space.
    let steps = (END / (0.16 * h)).ceil();
    for _ in 0..steps as usize {
        fluid.advance(END / steps)?;
    }
    let (mut square, mut size) = (0.0, 0.0);
    for i in 0..fluid.mesh().owned() {
        let volume = fluid.geometry().volumes[i];
        let (u, exact) = (
            fluid.velocity()[i],
            FLOW.velocity(END, fluid.mesh().nodes[i]),
        );
        let [a, b] = FLOW.drift;
        for (c, drift) in [a, b, 0.0].into_iter().enumerate() {
            square += volume * (u[c] - exact[c]).powi(2);
            size += volume * (exact[c] - drift).powi(2);
        }
    }
    Ok((square / size).sqrt())
}

fn main() -> Result<(), Box<dyn Error>> {
    let given: Result<Vec<usize>, _> = std::env::args().skip(1).map(|n| n.parse()).collect();
    let mut sizes = given?;
    if sizes.is_empty() {
        sizes = vec![16, 32, 64, 128];
    }
    for element in KINDS {
        for jitter in [0.0, 0.2] {
            for mass in [Mass::Lumped, Mass::Corrected] {
                print!("{element:?}, jitter {jitter}, {mass:?}:");
                for &n in &sizes {
                    print!(" {:.2e}", error(element, n, jitter, mass)?);
                }
                println!();
            }
        }
    }
    Ok(())
}
