//! Error in time against cost of one and of three pressure solves a step: `solves [N, default 32]`.
//!
//! Taylor–Green vortices on a drift (F1; ν = 0.01, t = 2) on N × N × 1 periodic hexahedra of second and fourth order, and
//! the same flow at rest stirred by a force on a trilinear kernel of one cell that moves with (1, ½): the force of a fibre.
//! L2 error of the velocity, by its root mean square: against the exact answer (vortices), and against the same mesh with
//! a hundredth of the longest step.

use fibreflow_fluid::{Fluid, FluidSettings, Projections, initial::TaylorGreen};
use fibreflow_mesh::{BoxMesh, LocalMesh, geometry};
use std::error::Error;
use std::f64::consts::TAU;
use std::sync::Arc;
use std::time::Instant;

type Failed = Box<dyn Error + Send + Sync>;

const END: f64 = 2.0;
const SCHEMES: [(&str, Projections); 2] = [
    ("one", Projections::Once),
    ("three", Projections::EverySubStep),
];

#[derive(Clone, Copy, PartialEq)]
enum Flow {
    Vortices,
    Stirred,
}

fn main() -> Result<(), Failed> {
    let n = match std::env::args().nth(1) {
        Some(text) => text.parse()?,
        None => 32,
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(|| {
        for flow in [Flow::Vortices, Flow::Stirred] {
            for order in [2, 4] {
                compare(flow, order, n)?;
            }
        }
        Ok(())
    })
}

fn compare(flow: Flow, order: u8, n: usize) -> Result<(), Failed> {
    let name = match flow {
        Flow::Vortices => "vortices",
        Flow::Stirred => "moving force",
    };
    let h = TAU / n as f64;
    let longest = 0.5 * h;
    let (reference, _) = run(flow, order, n, 0.01 * longest, Projections::EverySubStep)?;
    println!(
        "{name}, order {order}, {n} x {n}: against the exact answer {:.2e}",
        exact_error(flow, &reference)
    );
    for part in [1.0, 0.5, 0.25, 0.125] {
        for (solves, scheme) in SCHEMES {
            let (fluid, seconds) = run(flow, order, n, part * longest, scheme)?;
            let square = |u: &[f64; 4]| u.iter().map(|x| x * x).sum::<f64>();
            let pairs = fluid.velocity().iter().zip(reference.velocity());
            let rest: f64 = pairs
                .map(|(a, b)| square(&std::array::from_fn(|c| a[c] - b[c])))
                .sum();
            let all: f64 = reference.velocity().iter().map(square).sum();
            println!(
                "  dt = {:.4} h, {solves:>5} solves: in time {:.2e}, all {:.2e}, {:7.1} ms, {:.0} ns a node and step",
                part * longest / h,
                (rest / all).sqrt(),
                exact_error(flow, &fluid),
                1e3 * seconds,
                1e9 * seconds / (fluid.steps() as f64 * (n * n) as f64),
            );
        }
    }
    Ok(())
}

const VORTICES: TaylorGreen = TaylorGreen {
    amplitude: 1.0,
    wave_number: 1.0,
    drift: [1.0, 1.0],
    kinematic_viscosity: 0.01,
};

/// NaN where no exact answer is known.
fn exact_error(flow: Flow, fluid: &Fluid) -> f64 {
    if flow == Flow::Stirred {
        return f64::NAN;
    }
    let (mut rest, mut all) = (0.0, 0.0);
    for (u, &x) in fluid.velocity().iter().zip(&fluid.mesh().nodes) {
        let exact = VORTICES.velocity(END, x);
        for c in 0..3 {
            rest += (u[c] - exact[c]).powi(2);
            all += (exact[c] - if c < 2 { 1.0 } else { 0.0 }).powi(2);
        }
    }
    (rest / all).sqrt()
}

fn run(
    flow: Flow,
    order: u8,
    n: usize,
    dt: f64,
    projections: Projections,
) -> Result<(Fluid, f64), Failed> {
    let h = TAU / n as f64;
    let mesh = BoxMesh {
        size: [TAU, TAU, h],
        cells: [n, n, 1],
        periodic: [true; 3],
        ..BoxMesh::default()
    };
    let mesh = Arc::new(LocalMesh::single(mesh.build()?));
    let dual = if order == 4 {
        geometry::fourth(&mesh)?
    } else {
        geometry::dual(&mesh)?
    };
    let settings = FluidSettings {
        projections,
        ..FluidSettings::new(1.0, VORTICES.kinematic_viscosity)
    };
    let mut fluid = Fluid::new(mesh, Arc::new(dual), settings)?;
    let amplitude = if flow == Flow::Vortices { 1.0 } else { 0.0 };
    fluid.set_velocity(|x| VORTICES.velocity(0.0, x).map(|u| amplitude * u))?;
    let steps = (END / dt).ceil() as usize;
    let dt = END / steps as f64;
    let start = Instant::now();
    for step in 0..steps {
        if flow == Flow::Stirred {
            stir(&mut fluid, (step as f64 + 0.5) * dt, h);
        }
        fluid.advance(dt)?;
    }
    Ok((fluid, start.elapsed().as_secs_f64()))
}

/// A force of 1 N/m along y, spread trilinearly at (1 + t, 1 + t/2).
fn stir(fluid: &mut Fluid, time: f64, h: f64) {
    let at = [1.0 + time, 1.0 + 0.5 * time];
    let nodes = Arc::clone(fluid.mesh());
    for (f, x) in fluid.body_force_mut().iter_mut().zip(&nodes.nodes) {
        let weight: f64 = (0..2)
            .map(|c| (1.0 - (x[c] - at[c]).abs() / h).max(0.0))
            .product();
        *f = [0.0, weight / (h * h), 0.0, 0.0];
    }
}
