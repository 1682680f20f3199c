//! VALIDATION B6: 500 fibres of aspect ratio 30 squeezed by a moving wall from 2 % to 12 % of volume; crossings of centre
//! lines, largest overlap, energy budget. Lengths in diameters, the axial wave speed is 100; the argument is the speed of
//! the wall: `cargo run --release -p fibreflow-fibre --example squeeze -- 0.5`

use fibreflow_fibre::contact::{ContactSettings, NormalDamping, Wall};
use fibreflow_fibre::placement::{
    Amount, CentreLine, Orientation, PlacementGroup, Population, Quantity, Region, place,
};
use fibreflow_fibre::{
    Fibre, FibreSettings, FibreSystem, ImplicitSettings, Integrator, Material, PeriodicBox, Vector3,
};
use fibreflow_parallel::Communicator;
use std::error::Error;
use std::f64::consts::PI;
use std::time::Instant;

const COUNT: usize = 500;
const SEGMENTS: usize = 6;
const LENGTH: f64 = 30.0;
const RADIUS: f64 = 0.5;
const EDGE: f64 = 75.0;
const MODULUS: f64 = 1e4;
const FRACTIONS: [f64; 2] = [0.02, 0.12];
const REPORTS: usize = 20;

/// Arguments: speed of the wall, and for the implicit integrator its step over the explicit one.
fn main() -> Result<(), Box<dyn Error>> {
    let solid = COUNT as f64 * PI * RADIUS * RADIUS * LENGTH;
    let height = |fraction: f64| solid / (fraction * EDGE * EDGE);
    let [start, end] = FRACTIONS.map(height);
    let argument = |n: usize| std::env::args().nth(n).map(|r| r.parse()).transpose();
    let speed: f64 = argument(1)?.unwrap_or(0.5);
    let ratio: Option<f64> = argument(2)?;
    let mut fibres = scene(start, speed, ratio.is_some())?;
    let before = fibres.energy().total();
    let interval = (start - end) / speed / REPORTS as f64;
    let explicit = 0.5 * fibres.critical_step();
    let step = ratio.map_or(0.1, |ratio| ratio * explicit);
    let steps = (interval / step).ceil() as usize;
    println!(
        "explicit sub-step {explicit:.3e}, step {:.3e}",
        interval / steps as f64
    );
    let clock = Instant::now();
    println!(
        "fraction contacts overlap/d crossings work kinetic elastic contact dissipated defect/work"
    );
    let mut deepest: f64 = 0.0;
    for report in 1..=REPORTS {
        for _ in 0..steps {
            fibres.advance_free(interval / steps as f64)?;
            let contacts = fibres.contacts().ok_or("no contacts")?;
            deepest = deepest.max(contacts.statistics().max_overlap);
        }
        let contacts = fibres.contacts().ok_or("no contacts")?.statistics();
        let energy = fibres.energy();
        let kept = energy.total() - before + contacts.stored_energy;
        let defect = contacts.wall_work - kept - contacts.dissipated_energy;
        let now = start - speed * interval * report as f64;
        println!(
            "{:.4} {} {:.4} {} {:.5e} {:.3e} {:.3e} {:.3e} {:.5e} {:.2e}",
            solid / (now * EDGE * EDGE),
            contacts.contacts,
            deepest / (2.0 * RADIUS),
            contacts.crossings,
            contacts.wall_work,
            energy.kinetic,
            energy.elastic.total(),
            contacts.stored_energy,
            contacts.dissipated_energy,
            defect / contacts.wall_work,
        );
    }
    println!(
        "{} sub-steps a step, {:.1} s",
        fibres.substeps(),
        clock.elapsed().as_secs_f64()
    );
    Ok(())
}

/// Fibres at rest between a floor and a ceiling that comes down.
fn scene(height: f64, speed: f64, implicit: bool) -> Result<FibreSystem, Box<dyn Error>> {
    let size = Vector3::new(EDGE, EDGE, height);
    let periodic = PeriodicBox {
        origin: Vector3::zeros(),
        lengths: [Some(EDGE), Some(EDGE), None],
    };
    let group = PlacementGroup {
        amount: Amount::Count(COUNT),
        length: Quantity::Constant(LENGTH),
        radius: RADIUS,
        centre_line: CentreLine::Straight,
        segments: SEGMENTS,
        region: Region::Box {
            origin: Vector3::zeros(),
            size,
        },
        gap: 0.0,
        orientation: Orientation::Isotropic,
        seed: 1,
    };
    let mut placed = place(&Population {
        periodic,
        groups: vec![group],
        held: Vec::new(),
    })?;
    let placed = placed.swap_remove(0);
    placed.complete()?;
    let ceiling = Wall {
        velocity: -speed * Vector3::z(),
        ..Wall::plane(height * Vector3::z(), -Vector3::z())
    };
    let contacts = ContactSettings {
        damping: NormalDamping::Ratio(0.3),
        friction: 0.3,
        walls: vec![Wall::plane(Vector3::zeros(), Vector3::z()), ceiling],
        periodic,
        count_crossings: true,
        ..ContactSettings::new(MODULUS * RADIUS, 0.5 * RADIUS)
    };
    let settings = FibreSettings {
        contacts: Some(contacts),
        step_safety: 0.5,
        integrator: if implicit {
            Integrator::Implicit(ImplicitSettings::default())
        } else {
            Integrator::Explicit
        },
        ..FibreSettings::default()
    };
    let material = Material::new(RADIUS, MODULUS, 0.3, 1.0);
    let fibres = placed.fibres.into_iter().zip(0..);
    let fibres = fibres.map(|(fibre, id)| Fibre::new(id, material, fibre.nodes));
    Ok(FibreSystem::new(
        Communicator::single(),
        settings,
        fibres.collect(),
    )?)
}
