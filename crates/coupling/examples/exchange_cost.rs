//! Time of a segment and step to sample and spread with the kernel of one element, beside one segment a node: the channel of
//! `cases/quickstart` with 1,336 straight fibres of 16 segments that drift. Before each part 48 MB are swept, more than caches hold.
//! `cargo run --release -p fibreflow-coupling --example exchange_cost [hexahedra|jittered|tetrahedra] [STEPS] [middle]`

use fibreflow_coupling::{Coupling, Kernel};
use fibreflow_fibre::hydrodynamics::{DragModel, FluidProperties, TorqueModel};
use fibreflow_fibre::{
    Ambient, Fibre, FibreSettings, FibreSystem, Hydrodynamics, Material, Points, Reaction,
};
use fibreflow_mesh::{BoxElement, BoxMesh, LocalMesh, Stretching, geometry};
use fibreflow_parallel::Communicator;
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

const SIZE: [f64; 3] = [0.03, 0.02, 0.015];
const FIBRES: u64 = 1336;
const SEGMENTS: usize = 16;
const LENGTH: f64 = 4e-3;
const DIAMETER: f64 = 1e-4;
const STEP: f64 = 4.8e-4;
/// Numbers swept between steps: 48 MB.
const SWEPT: usize = 6_000_000;

fn fibres() -> Result<FibreSystem, Box<dyn Error>> {
    let settings = FibreSettings {
        hydrodynamics: Some(Hydrodynamics {
            fluid: FluidProperties {
                density: 1000.0,
                viscosity: 0.01,
            },
            drag: DragModel::default(),
            torque: TorqueModel::default(),
            point_spacing: f64::INFINITY,
        }),
        ..FibreSettings::default()
    };
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let material = Material::new(0.5 * DIAMETER, 8e3, 0.3, 1000.0);
    let fibre = |id| {
        let mut number = || random.random_range(-1.0..1.0);
        let direction = Vector3::new(number(), number(), number()).normalize();
        let reach = 0.5 * LENGTH * direction;
        let mut centre: Vector3<f64> = Vector3::zeros();
        for c in 0..3 {
            // Inside the walls.
            let free = SIZE[c] - if c == 1 { 2.0 * reach[c].abs() } else { 0.0 };
            centre[c] = 0.5 * (SIZE[c] + number() * free);
        }
        Fibre::straight(id, material, centre - reach, centre + reach, SEGMENTS)
    };
    let fibres = (0..FIBRES).map(fibre).collect();
    Ok(FibreSystem::new(Communicator::single(), settings, fibres)?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let kind = arguments.next().unwrap_or("hexahedra".to_owned());
    let steps: usize = arguments.next().map_or(Ok(200), |n| n.parse())?;
    let kernel = match arguments.next().as_deref() {
        None => Kernel::Element,
        Some("middle") => Kernel::Middle,
        Some(_) => return Err("middle, or nothing".into()),
    };
    let (element, jitter) = match kind.as_str() {
        "hexahedra" => (BoxElement::Hexahedron, 0.0),
        "jittered" => (BoxElement::Hexahedron, 0.2),
        "tetrahedra" => (BoxElement::Tetrahedron, 0.0),
        _ => return Err("hexahedra, jittered or tetrahedra".into()),
    };
    let mesh = BoxMesh {
        size: SIZE,
        cells: [36, 32, 18],
        stretching: [
            Stretching::Uniform,
            Stretching::Tanh(1.5),
            Stretching::Uniform,
        ],
        periodic: [true, false, true],
        element,
        jitter,
        ..BoxMesh::default()
    };
    let mesh = Arc::new(LocalMesh::single(mesh.build()?));
    let geometry = Arc::new(geometry::dual(&mesh)?);
    let velocity: Vec<[f64; 4]> = (mesh.nodes.iter())
        .map(|x| {
            let y = x[1] / SIZE[1];
            [3.0 * y * (1.0 - y), 0.01 * (900.0 * x[0]).sin(), 0.02, 0.0]
        })
        .collect();
    let slope: Vec<[f64; 4]> = velocity.iter().map(|u| u.map(|u| 0.1 * u)).collect();
    let free = vec![false; mesh.owned()];
    let mut coupling = Coupling::with_kernel(mesh.clone(), geometry, free, kernel)?;
    let mut fibres = fibres()?;
    for (i, v) in fibres.velocities_mut().iter_mut().enumerate() {
        *v = Vector3::new(0.4, 0.0, 1e-2 * (i / 17 % 7) as f64);
    }
    let (mut points, mut ambient) = (Points::default(), Ambient::default());
    let mut reaction = Reaction::default();
    let mut body_force = vec![[0.0; 4]; mesh.total()];
    let mut swept = vec![0.0; SWEPT];
    let mut times = [Vec::new(), Vec::new()];
    let mut check = 0.0;
    for step in 0..steps {
        swept.iter_mut().for_each(|x| *x += 1.0);
        let start = Instant::now();
        fibres.points_after(step as f64 * STEP, &mut points);
        coupling.sample_met(&velocity, Some(&slope), &points, STEP, false, &mut ambient)?;
        times[0].push(start.elapsed().as_secs_f64());
        let drag = |u: &Vector3<f64>| 1e-6 * u;
        reaction.force.clear();
        reaction.force.extend(ambient.velocity.iter().map(drag));
        reaction.torque.clear();
        reaction.torque.extend(ambient.change.iter().map(drag));
        swept.iter_mut().for_each(|x| *x += 1.0);
        let start = Instant::now();
        let report = coupling.spread(&reaction, &mut body_force)?;
        times[1].push(start.elapsed().as_secs_f64());
        check += report.force.x + report.torque.z;
    }
    println!("{kind}, {steps} steps; check {check:.15e}");
    for (name, mut times) in ["sample", "spread"].into_iter().zip(times) {
        times.sort_by(f64::total_cmp);
        let each = 1e9 / (FIBRES as f64 * SEGMENTS as f64);
        let [least, tenth, middle] = [0, steps / 10, steps / 2].map(|k| each * times[k]);
        println!(
            "{name}: {least:.1} ns a segment and step at least, {tenth:.1} in a tenth, {middle:.1} in half of the steps"
        );
    }
    Ok(())
}
