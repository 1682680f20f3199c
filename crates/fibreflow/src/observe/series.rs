//! The CSV series of a run.

use crate::case::Case;
use crate::clock::Clock;
use crate::error::ProgramError;
use crate::figures::Figures;
use crate::output::series::Series;
use crate::scene::Scene;
use fibreflow_coupling::Beads;
use fibreflow_fibre::FibreSystem;
use fibreflow_fibre::contact::ContactSystem;
use fibreflow_fibre::linked::LinkedSystem;
use fibreflow_fluid::{Fluid, PhaseField};
use std::path::Path;

const FLUID: [&str; 14] = [
    "dt",
    "cfl",
    "divergence_max",
    "poisson_iterations",
    "momentum_iterations",
    "kinetic_energy",
    "bulk_velocity_x",
    "bulk_velocity_y",
    "bulk_velocity_z",
    "driving_force_x",
    "driving_force_y",
    "driving_force_z",
    "outside_points",
    "momentum_defect",
];
const FIBRES: [&str; 16] = [
    "substeps",
    "kinetic_energy",
    "stretching_energy",
    "bending_energy",
    "torsion_energy",
    "momentum_x",
    "momentum_y",
    "momentum_z",
    "mean_curvature",
    "contacts",
    "wall_contacts",
    "max_overlap",
    "contact_energy",
    "contact_loss",
    "wall_work",
    "crossings",
];
const LINKED: [&str; 7] = [
    "contacts",
    "contacts_per_fibre",
    "sliding",
    "overlaps",
    "max_overlap",
    "elastic_energy",
    "pin_drift",
];
const TRACK: [&str; 9] = [
    "centre_x",
    "centre_y",
    "centre_z",
    "end_x",
    "end_y",
    "end_z",
    "end_to_end_x",
    "end_to_end_y",
    "end_to_end_z",
];

const PHASE: [&str; 9] = [
    "order_parameter",
    "free_energy",
    "bulk_energy",
    "solid_energy",
    "gradient_energy",
    "dissipation",
    "lowest",
    "highest",
    "in_drops",
];

/// Series of fluid, fibres and tracked fibres; files on rank 0 only.
pub struct AllSeries {
    fluid: Option<Series>,
    phase: Option<Series>,
    beads: Option<Series>,
    fibres: Option<Series>,
    tracks: Vec<(u64, Option<Series>)>,
}

impl AllSeries {
    /// Opens `series/fluid.csv`, `series/phase.csv`, `series/beads.csv`, `series/fibres.csv` and `series/fibre_ID.csv`, as far as the case has them.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn open(
        case: &Case,
        folder: &Path,
        scene: &Scene,
        resume: Option<u64>,
    ) -> Result<Self, ProgramError> {
        let root = scene.communicator.is_root();
        let open = |name: &str, columns: &[&str], wanted: bool| {
            let path = folder.join("series").join(name);
            let series = (root && wanted).then(|| Series::open(&path, columns, resume));
            series
                .transpose()
                .map_err(|e| ProgramError::output(&path, &e))
        };
        let mut tracks = Vec::new();
        for &id in &case.output.track {
            tracks.push((id, open(&format!("fibre_{id}.csv"), &TRACK, true)?));
        }
        let beads = scene.flow.beads();
        let names = beads.map_or_else(Vec::new, |b| bead_columns(b, scene.flow.phase().is_some()));
        let columns: Vec<&str> = names.iter().map(String::as_str).collect();
        Ok(Self {
            fluid: open("fluid.csv", &FLUID, scene.flow.fluid().is_some())?,
            phase: open("phase.csv", &PHASE, scene.flow.phase().is_some())?,
            beads: open("beads.csv", &columns, scene.flow.beads().is_some())?,
            fibres: match &scene.linked {
                Some(_) => open("fibres.csv", &LINKED, true)?,
                None => open("fibres.csv", &FIBRES, scene.fibres.is_some())?,
            },
            tracks,
        })
    }

    /// One line in each. Collective.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write(
        &mut self,
        scene: &Scene,
        clock: &Clock,
        figures: &Figures,
    ) -> Result<(), ProgramError> {
        if let Some(fluid) = scene.flow.fluid() {
            put(&mut self.fluid, clock, &fluid_values(fluid, clock, figures))?;
            if let Some(phase) = scene.flow.phase() {
                let values = phase_values(&phase.field, fluid, figures);
                put(&mut self.phase, clock, &values)?;
            }
            if let Some(beads) = scene.flow.beads() {
                let mut values = bead_values(beads);
                if let Some(phase) = scene.flow.phase() {
                    values.extend(beads.wetted(fluid, &phase.field));
                }
                put(&mut self.beads, clock, &values)?;
            }
        }
        if let Some(fibres) = &scene.fibres {
            let mut values = fibre_values(fibres);
            scene.communicator.sum_slice(&mut values);
            let [sums @ .., curvature, length] = values;
            let mut line = vec![figures.substeps as f64];
            line.extend(sums);
            line.push(if length > 0.0 {
                curvature / length
            } else {
                0.0
            });
            let contacts = fibres.contacts().map(ContactSystem::statistics);
            let contacts = contacts.unwrap_or_default();
            let counts = [contacts.contacts, contacts.wall_contacts];
            line.extend(counts.map(|n| n as f64));
            line.extend([
                contacts.max_overlap,
                contacts.stored_energy,
                contacts.dissipated_energy,
                contacts.wall_work,
                contacts.crossings as f64,
            ]);
            put(&mut self.fibres, clock, &line)?;
            for (id, series) in &mut self.tracks {
                let mut values = track_values(fibres, *id);
                scene.communicator.sum_slice(&mut values);
                put(series, clock, &values)?;
            }
        }
        if let Some(linked) = &scene.linked {
            put(&mut self.fibres, clock, &linked_values(linked))?;
            for (id, series) in &mut self.tracks {
                put(series, clock, &linked_track(linked, *id))?;
            }
        }
        Ok(())
    }

    /// Hands everything to the system.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn flush(&mut self) -> Result<(), ProgramError> {
        let tracks = self.tracks.iter_mut().map(|(_, s)| s);
        for series in [
            &mut self.fluid,
            &mut self.phase,
            &mut self.beads,
            &mut self.fibres,
        ]
        .into_iter()
        .chain(tracks)
        .flatten()
        {
            series.flush().map_err(ProgramError::series)?;
        }
        Ok(())
    }
}

fn put(series: &mut Option<Series>, clock: &Clock, values: &[f64]) -> Result<(), ProgramError> {
    match series {
        Some(series) => series
            .line(clock.step, clock.time, values)
            .map_err(ProgramError::series),
        None => Ok(()),
    }
}

fn fluid_values(fluid: &Fluid, clock: &Clock, figures: &Figures) -> Vec<f64> {
    let mut values = vec![
        clock.dt,
        figures.cfl,
        figures.divergence,
        figures.poisson_iterations as f64,
        figures.momentum_iterations as f64,
        fluid.kinetic_energy(),
    ];
    values.extend(fluid.bulk_velocity());
    values.extend(fluid.driving_force());
    values.extend([figures.outside as f64, figures.momentum_defect]);
    values
}

/// ∫ψ, free energy, what diffusion takes from it, smallest and largest ψ, what is in drops of fluid A.
fn phase_values(field: &PhaseField, fluid: &Fluid, figures: &Figures) -> [f64; PHASE.len()] {
    let energy = field.energy(fluid);
    let psi = &field.order_parameter()[..fluid.mesh().owned()];
    let communicator = fluid.mesh().halo.communicator();
    let lowest = psi.iter().copied().fold(f64::INFINITY, f64::min);
    let highest = psi.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    [
        field.integral(fluid),
        energy.total(),
        energy.bulk,
        energy.solid,
        energy.gradient,
        figures.phase.dissipation,
        communicator.min(lowest),
        communicator.max(highest),
        field.in_drops(fluid),
    ]
}

/// Of the beams, and of every bead its place, velocity, spin and the force of the fluids on it; of every chain its radius and, with two
/// fluids, the part of it that fluid A wets.
fn bead_columns(beads: &Beads, two_fluids: bool) -> Vec<String> {
    const BEAD: [&str; 12] = [
        "x", "y", "z", "u", "v", "w", "spin_x", "spin_y", "spin_z", "force_x", "force_y", "force_z",
    ];
    let of = |k: usize| BEAD.iter().map(move |name| format!("bead_{k}_{name}"));
    let mut columns = vec!["elastic_energy".to_owned()];
    columns.extend((0..beads.beads().len()).flat_map(of));
    let chains = 0..beads.offsets().len() - 1;
    columns.extend(chains.clone().map(|k| format!("chain_{k}_radius")));
    if two_fluids {
        columns.extend(chains.map(|k| format!("chain_{k}_wetted")));
    }
    columns
}

fn bead_values(beads: &Beads) -> Vec<f64> {
    let mut values = vec![beads.elastic_energy()];
    for bead in beads.beads() {
        for vector in [bead.position, bead.velocity, bead.spin, bead.force] {
            values.extend(vector.iter());
        }
    }
    values.extend(beads.radii());
    values
}

/// Energies, momentum, and the sums of curvature × length and of length for the mean.
fn fibre_values(fibres: &FibreSystem) -> [f64; 9] {
    let energy = fibres.energy();
    let momentum = fibres.momentum();
    let (mut curvature, mut length) = (0.0, 0.0);
    let mut inner = Vec::new();
    for fibre in 0..fibres.fibres() {
        fibres.curvature(fibre, &mut inner);
        let weight = fibres.length(fibre);
        let count = inner.len().max(1) as f64;
        curvature += weight * inner.iter().map(|k| k.norm()).sum::<f64>() / count;
        length += weight;
    }
    [
        energy.kinetic,
        energy.elastic.stretching,
        energy.elastic.bending,
        energy.elastic.torsion,
        momentum.x,
        momentum.y,
        momentum.z,
        curvature,
        length,
    ]
}

fn linked_values(linked: &LinkedSystem) -> [f64; 7] {
    let figures = linked.statistics();
    let contacts = figures.contacts as f64;
    [
        contacts,
        // A pair is a contact of both.
        2.0 * contacts / linked.fibres().max(1) as f64,
        figures.sliding as f64,
        figures.overlaps as f64,
        figures.max_overlap,
        figures.elastic_energy,
        figures.pin_drift,
    ]
}

fn linked_track(linked: &LinkedSystem, id: u64) -> [f64; 9] {
    let Some(fibre) = (0..linked.fibres()).find(|f| linked.id(*f) == id) else {
        return [0.0; 9];
    };
    let segments = [0, 1].map(|k| linked.offsets()[fibre + k]);
    let [start, end] = segments.map(|s| linked.nodes()[s + fibre]);
    let vectors = [linked.centre(fibre), end, end - start];
    std::array::from_fn(|k| vectors[k / 3][k % 3])
}

/// Zeros on ranks that do not own the fibre.
fn track_values(fibres: &FibreSystem, id: u64) -> [f64; 9] {
    let Some(fibre) = fibres.find(id) else {
        return [0.0; 9];
    };
    let end = fibres.positions()[fibres.offsets()[fibre + 1] - 1];
    let mut values = [0.0; 9];
    let vectors = [fibres.centre(fibre), end, fibres.end_to_end(fibre)];
    for (slot, value) in values.iter_mut().zip(vectors.iter().flat_map(|v| v.iter())) {
        *slot = *value;
    }
    values
}
