//! Cost of a segment sub-step, best of five: free, with internal damping, and in a flow.
//! `RAYON_NUM_THREADS=1 cargo run --release -p fibreflow-fibre --example speed`

use fibreflow_fibre::hydrodynamics::{AmbientFlow, DragModel, FluidProperties, TorqueModel};
use fibreflow_fibre::{
    Fibre, FibreError, FibreSettings, FibreSystem, Hydrodynamics, Material, Vector3,
};
use fibreflow_parallel::Communicator;
use std::time::Instant;

fn main() -> Result<(), FibreError> {
    for (count, segments) in [(1000, 16), (100_000, 10)] {
        for (name, retardation, flow) in [
            ("free", 0.0, false),
            ("damped", 1e-7, false),
            ("drag", 0.0, true),
        ] {
            let mut material = Material::new(1e-5, 1e9, 0.3, 1000.0);
            material.retardation = retardation;
            let fibre = |i: usize| {
                let place = Vector3::new(0.0, 0.0, 1e-4 * i as f64);
                Fibre::straight(
                    i as u64,
                    material,
                    place,
                    place + Vector3::x() * 1e-3,
                    segments,
                )
            };
            let settings = FibreSettings {
                hydrodynamics: flow.then_some(Hydrodynamics {
                    fluid: FluidProperties {
                        density: 1000.0,
                        viscosity: 1e-3,
                    },
                    drag: DragModel::default(),
                    torque: TorqueModel::default(),
                    point_spacing: f64::INFINITY,
                }),
                ..FibreSettings::default()
            };
            let fibres = (0..count).map(fibre).collect();
            let mut s = FibreSystem::new(Communicator::single(), settings, fibres)?;
            for (i, v) in s.velocities_mut().iter_mut().enumerate() {
                v.y = 1e-3 * (i as f64).sin();
            }
            let dt = s.critical_step() * if count > 10_000 { 20.0 } else { 500.0 };
            let mut seconds = f64::INFINITY;
            for _ in 0..5 {
                let start = Instant::now();
                if flow {
                    s.advance_in_flow(&AmbientFlow::Shear { rate: 10.0 }, dt)?;
                } else {
                    s.advance_free(dt)?;
                }
                seconds = seconds.min(start.elapsed().as_secs_f64());
            }
            let work = s.segment_substeps() as f64;
            println!(
                "{count} fibres of {segments}, {name}: {:.1} ns a segment sub-step, {:.2} million a second, {} sub-steps",
                1e9 * seconds / work,
                1e-6 * work / seconds,
                s.substeps()
            );
        }
    }
    Ok(())
}
