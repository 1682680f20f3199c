//! Cost of a step, in ns per node, on one thread: `cargo run --release -p fibreflow-fluid --example cost [cells]`.

use fibreflow_fluid::{
    BoundaryCondition, Fluid, FluidError, FluidSettings, Forcing, Kernels, PressurePreconditioner,
    initial,
};
use fibreflow_mesh::{BoxElement, BoxMesh, LocalMesh, Stretching, geometry, renumber};
use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

const STEPS: usize = 20;

/// Turbulent start of a wall-stretched channel with `n` cells in each direction.
fn channel(n: usize, element: BoxElement, change: FluidSettings) -> Result<Fluid, Box<dyn Error>> {
    let size = [4.0, 2.0, 2.0];
    let mut mesh = BoxMesh {
        size,
        cells: [n; 3],
        periodic: [true, false, true],
        stretching: [
            Stretching::Uniform,
            Stretching::Tanh(2.0),
            Stretching::Uniform,
        ],
        element,
        ..BoxMesh::default()
    }
    .build()?;
    renumber(&mut mesh)?;
    let mesh = Arc::new(LocalMesh::single(mesh));
    let dual = Arc::new(geometry::dual(&mesh)?);
    let settings = FluidSettings {
        boundary: vec![BoundaryCondition::WALL; mesh.patches.len()],
        forcing: Forcing::BulkVelocity {
            direction: [1.0, 0.0, 0.0],
            value: 1.0,
        },
        ..change
    };
    let mut fluid = Fluid::new(mesh, dual, settings)?;
    let start = initial::PerturbedChannel {
        origin: [0.0; 3],
        size,
        stream: 0,
        across: 1,
        mean: 1.0,
        profile: initial::MeanProfile::Turbulent,
        intensity: 0.2,
        seed: 1,
    };
    fluid.set_velocity(start.field())?;
    Ok(fluid)
}

/// What the kernels cost on their own, with the bandwidth they reach.
fn print_kernels(fluid: &mut Fluid) {
    let nodes = fluid.mesh().owned() as f64;
    let (mut bytes, mut seconds) = (0.0, 0.0);
    for cost in fluid.kernel_costs(7) {
        let runs = cost.runs_per_step as f64;
        bytes += runs * cost.bytes_per_node;
        seconds += runs * cost.seconds;
        println!(
            "    {:<40} x {} {:6.1} ns a node, {:4.0} bytes, {:5.1} GB/s",
            cost.name,
            cost.runs_per_step,
            cost.seconds * 1e9 / nodes,
            cost.bytes_per_node,
            cost.bytes_per_node * nodes / cost.seconds * 1e-9,
        );
    }
    println!(
        "    {:<40}     {:6.1} ns a node, {bytes:4.0} bytes, {:5.1} GB/s",
        "sum over a step",
        seconds * 1e9 / nodes,
        bytes * nodes / seconds * 1e-9,
    );
}

fn main() -> Result<(), Box<dyn Error>> {
    let n = match std::env::args().nth(1) {
        Some(text) => text.parse()?,
        None => 32,
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let plain = FluidSettings::new(1.0, 1.0 / 2800.0);
    let general = FluidSettings {
        kernels: Kernels::Rows,
        preconditioner: PressurePreconditioner::Amg,
        ..plain.clone()
    };
    for (name, element, settings) in [
        (
            "hexahedra, as chosen",
            BoxElement::Hexahedron,
            plain.clone(),
        ),
        (
            "hexahedra, rows of pairs",
            BoxElement::Hexahedron,
            FluidSettings {
                kernels: Kernels::Rows,
                ..plain.clone()
            },
        ),
        ("hexahedra, as general", BoxElement::Hexahedron, general),
        ("tetrahedra", BoxElement::Tetrahedron, plain),
    ] {
        for cleaning_cycles in [settings.cleaning_cycles, 0] {
            let settings = FluidSettings {
                cleaning_cycles,
                ..settings.clone()
            };
            let mut fluid = channel(n, element, settings)?;
            let nodes = fluid.mesh().owned();
            let (mut predict, mut project) = (0.0, 0.0);
            let (mut viscous, mut poisson) = (0, 0);
            pool.install(|| -> Result<(), FluidError> {
                for step in 0..STEPS + 5 {
                    let dt = fluid.suggest_dt(0.5, 1.0);
                    let start = Instant::now();
                    let prediction = fluid.predict(dt)?;
                    let middle = Instant::now();
                    let solve = fluid.project(dt)?;
                    // The first steps have no history for the initial guess.
                    if step >= 5 {
                        predict += (middle - start).as_secs_f64();
                        project += middle.elapsed().as_secs_f64();
                        viscous += prediction.iterations.iter().sum::<usize>();
                        poisson += solve.iterations;
                    }
                }
                Ok(())
            })?;
            let cost = |seconds: f64| seconds * 1e9 / (nodes * STEPS) as f64;
            let mean = |count: usize| count as f64 / STEPS as f64;
            println!(
                "{name}, {nodes} nodes, {cleaning_cycles} cleaning cycles: predict {:.0} ns ({:.1} viscous \
                 iterations), project {:.0} ns ({:.1} Poisson iterations), sum {:.0} ns per node and step",
                cost(predict),
                mean(viscous),
                cost(project),
                mean(poisson),
                cost(predict + project),
            );
            if cleaning_cycles > 0 {
                pool.install(|| print_kernels(&mut fluid));
            }
        }
    }
    Ok(())
}
