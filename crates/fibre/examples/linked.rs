//! Cost of linked fibres: cargo run --release -p fibreflow-fibre --example linked -- SCHEME FIBRES STEP STEPS [WARM]
//!
//! SCHEME is explicit or implicit; helical fibres of five segments, r_p = 75, nL³ = 20, S^eff = 0.05, μ = 20 in a sheared box, as S 3.3.1.
//! WARM is a strain that is passed before, by implicit steps of 2e-3. Prints segment-steps per second of processor time (set RAYON_NUM_THREADS=1), contacts per fibre, sweeps a step.

use fibreflow_fibre::contact::Repulsion;
use fibreflow_fibre::hydrodynamics::AmbientFlow;
use fibreflow_fibre::linked::{Joint, LinkedFibre, LinkedScheme, LinkedSettings, LinkedSystem};
use fibreflow_fibre::placement::{
    Amount, CentreLine, Orientation, PlacementGroup, Population, Quantity, Region, place,
};
use fibreflow_fibre::{Fibre, Material, PeriodicBox, Vector3};
use fibreflow_parallel::Communicator;
use std::f64::consts::PI;

const HALF: f64 = 15.0;
const SEGMENTS: usize = 5;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize, or: f64| arguments.get(k).map_or(Ok(or), |a| a.parse());
    let scheme = match arguments.first().map(String::as_str) {
        Some("explicit") => LinkedScheme::Explicit,
        _ => LinkedScheme::Implicit,
    };
    let (fibres, step, steps, warm) = (
        number(1, 450.0)?,
        number(2, 2e-3)?,
        number(3, 100.0)?,
        number(4, 0.0)?,
    );
    let length = 2.0 * HALF * SEGMENTS as f64;
    let edge = length * (fibres / 20.0).cbrt();
    let periodic = PeriodicBox {
        origin: Vector3::zeros(),
        lengths: [Some(edge); 3],
    };
    let placed = place(&Population {
        periodic,
        held: Vec::new(),
        groups: vec![PlacementGroup {
            amount: Amount::Count(fibres as usize),
            orientation: Orientation::Isotropic,
            length: Quantity::Constant(length),
            radius: 1.0,
            centre_line: CentreLine::Chain {
                bend: 0.8,
                turn: 0.7,
            },
            segments: SEGMENTS,
            region: Region::Box {
                origin: Vector3::zeros(),
                size: Vector3::repeat(edge),
            },
            gap: 0.1,
            seed: 1,
        }],
    })?;
    let stiffness = 0.05 * length.powi(4);
    let made = placed[0].fibres.iter().enumerate().map(|(k, fibre)| {
        let mut material = Material::new(1.0, 1.0, 0.5, 1.0);
        material.youngs_modulus = stiffness / material.second_moment();
        material.shear_modulus = material.youngs_modulus / 3.0;
        LinkedFibre::new(
            &Fibre::new(k as u64, material, fibre.nodes.clone()),
            Joint::Ball,
        )
    });
    let made = made.collect::<Result<Vec<_>, _>>()?;
    let settings = |scheme| LinkedSettings {
        repulsion: Some(Repulsion {
            strength: 150.0 * 6.0 * PI * HALF,
            decay: 0.05,
            attraction: 0.0,
            attraction_width: 1.0,
            range: 0.66,
            contact_gap: 0.33,
        }),
        friction: [20.0, 0.0],
        periodic,
        shear_rate: 1.0,
        ..LinkedSettings::new(scheme, 1.0, 2.0)
    };
    let communicator = Communicator::single();
    let flow = |x: &Vector3, _: f64| AmbientFlow::Shear { rate: 1.0 }.at(x);
    let mut system = LinkedSystem::new(&communicator, settings(LinkedScheme::Implicit), made)?;
    for _ in 0..(warm / 2e-3) as usize {
        system.advance(&flow, 2e-3)?;
    }
    let state = system.state();
    let mut system = LinkedSystem::new(&communicator, settings(scheme), Vec::new())?;
    system.restore(state)?;
    let (mut sub_steps, mut sweeps) = (0, 0);
    let start = processor_time();
    for _ in 0..steps as usize {
        system.advance(&flow, step)?;
        let figures = system.statistics();
        sub_steps += figures.steps;
        sweeps += figures.sweeps;
    }
    let seconds = processor_time() - start;
    let figures = system.statistics();
    println!(
        "{scheme:?}: {} segments, {:.3e} segment-steps/s, {:.3e} s a strain, {:.2} contacts a fibre, overlap {:.3}, sub-steps {:.2}, sweeps {:.1} a step",
        system.segments(),
        system.segments() as f64 * steps / seconds,
        seconds / (steps * step),
        2.0 * figures.contacts as f64 / fibres,
        figures.max_overlap,
        sub_steps as f64 / steps,
        sweeps as f64 / steps
    );
    Ok(())
}

/// Processor time of all threads so far \[s\], from Linux's ticks of 10 ms; other work on the machine does not count.
fn processor_time() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat.rsplit(')').next().unwrap_or_default();
    let ticks = fields
        .split_whitespace()
        .nth(11)
        .and_then(|t| t.parse::<f64>().ok());
    ticks.map_or(f64::NAN, |t| 0.01 * t)
}
