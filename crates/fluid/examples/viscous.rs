//! Cost of implicit diffusion on a channel with thin cells, one thread: `viscous [cells a side, default 48]`.
//!
//! Largest spacing about 1000 times the smallest (tanh), Courant number 0.5, first half of a step (`predict`) with
//! diffusion along lines, by direct solves of the whole operator and by conjugate gradients with the diagonal.

use fibreflow_fluid::{BoundaryCondition, Diffusion, Fluid, FluidSettings, Projections, initial};
use fibreflow_mesh::{BoxMesh, LocalMesh, Stretching, geometry};
use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

const STEPS: usize = 10;
const SIZE: [f64; 3] = [4.0, 2.0, 2.0];

type Failed = Box<dyn Error + Send + Sync>;

fn main() -> Result<(), Failed> {
    let n = match std::env::args().nth(1) {
        Some(text) => text.parse()?,
        None => 48,
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(|| {
        for order in [2, 4] {
            for (name, diffusion, lines) in [
                ("lines", Diffusion::Auto, true),
                ("whole, direct", Diffusion::Implicit, true),
                ("whole, CG", Diffusion::Implicit, false),
            ] {
                measure(name, channel(n, order, diffusion, lines)?)?;
            }
        }
        Ok(())
    })
}

fn channel(n: usize, order: u8, diffusion: Diffusion, lines: bool) -> Result<Fluid, Failed> {
    let mesh = BoxMesh {
        size: SIZE,
        cells: [n; 3],
        periodic: [true, false, true],
        stretching: [
            Stretching::Uniform,
            Stretching::Tanh(4.2),
            Stretching::Uniform,
        ],
        ..BoxMesh::default()
    };
    let mesh = Arc::new(LocalMesh::single(mesh.build()?));
    let mut dual = match order {
        4 => geometry::fourth(&mesh)?,
        _ => geometry::dual(&mesh)?,
    };
    if let Some(tensor) = &dual.tensor {
        let y = tensor.grid.coordinates[1].windows(2).map(|y| y[1] - y[0]);
        let (low, high) = y.fold((f64::INFINITY, 0.0), |(low, high), h| {
            (h.min(low), h.max(high))
        });
        println!("order {order}: spacing ratio {:.0}", high / low);
    }
    if !lines {
        dual.tensor = None;
    }
    let settings = FluidSettings {
        boundary: vec![BoundaryCondition::WALL; 2],
        diffusion,
        projections: Projections::Once,
        ..FluidSettings::new(1.0, 1.0 / 2800.0)
    };
    let mut fluid = Fluid::new(mesh, Arc::new(dual), settings)?;
    let start = initial::PerturbedChannel {
        origin: [0.0; 3],
        size: SIZE,
        stream: 0,
        across: 1,
        mean: 1.0,
        profile: initial::MeanProfile::Laminar,
        intensity: 0.2,
        seed: 1,
    };
    fluid.set_velocity(start.field())?;
    Ok(fluid)
}

fn measure(name: &str, mut fluid: Fluid) -> Result<(), Failed> {
    let nodes = fluid.mesh().owned();
    let (mut seconds, mut iterations, mut last) = (0.0, 0, None);
    for step in 0..STEPS + 2 {
        let dt = fluid.suggest_dt(0.5, 1.0);
        let start = Instant::now();
        let prediction = fluid.predict(dt)?;
        // The first steps set up what later ones use.
        if step >= 2 {
            seconds += start.elapsed().as_secs_f64();
            iterations += prediction.iterations.iter().sum::<usize>();
        }
        last = Some(prediction.diffusion);
        fluid.project(dt)?;
    }
    if let Some(choice) = last {
        println!(
            "  {name}: predict {:.0} ns a node and step, {:.1} iterations; {choice}",
            seconds * 1e9 / (nodes * STEPS) as f64,
            iterations as f64 / STEPS as f64,
        );
    }
    Ok(())
}
