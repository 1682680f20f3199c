//! The series of structure and stress of linked fibres.

use super::stress::COMPONENTS;
use crate::case::{Case, Observables, Schedule};
use crate::clock::Clock;
use crate::error::ProgramError;
use crate::output::series::Series;
use crate::scene::{Flow, Scene};
use fibreflow_fibre::{Shear, Vector3};
use std::path::Path;

/// Columns after the stress: means over the contacts of the last step, energy of the joints, how they are bent and how segments lie.
const BESIDE_STRESS: [&str; 6] = [
    "normal_force",
    "friction_force",
    "sliding",
    "elastic_energy",
    "bending",
    "alignment",
];

/// `series/structure.csv`: contacts of a fibre, flocs, pair distribution, stress.
pub struct StructureSeries {
    about: Observables,
    schedule: Schedule,
    shear: Shear,
    /// Of the box \[m³\]; None without stress.
    volume: Option<f64>,
    viscosity: f64,
    series: Series,
}

impl StructureSeries {
    /// Opens the file if the case has linked fibres and asks for it.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn open(
        case: &Case,
        folder: &Path,
        scene: &Scene,
        resume: Option<u64>,
    ) -> Result<Option<Self>, ProgramError> {
        let (Some(about), Some(_)) = (&case.output.observables, &scene.linked) else {
            return Ok(None);
        };
        let volume = case.domain().map(|d| d.size.iter().product());
        let volume = volume.filter(|_| about.stress);
        let mut columns: Vec<String> = ["contacts_per_fibre", "flocs", "largest_floc"]
            .map(str::to_owned)
            .to_vec();
        if about.pair_distance.is_some() {
            columns.extend((1..=about.bins).map(|k| format!("g_{k}")));
        }
        if volume.is_some() {
            for part in ["particle", "contact"] {
                columns.extend(COMPONENTS.map(|(name, ..)| format!("{part}_{name}")));
            }
            columns.extend(["n1", "n2", "eta_sp"].map(str::to_owned));
            columns.extend(BESIDE_STRESS.map(str::to_owned));
        }
        let path = folder.join("series").join("structure.csv");
        let names: Vec<&str> = columns.iter().map(String::as_str).collect();
        let series = Series::open(&path, &names, resume);
        Ok(Some(Self {
            schedule: about.schedule(&case.output.series),
            shear: Shear::new(&about.flow.into(), &about.gradient.into()),
            viscosity: case.ambient.as_ref().map_or(0.0, |a| a.viscosity),
            about: about.clone(),
            volume,
            series: series.map_err(|e| ProgramError::output(&path, &e))?,
        }))
    }

    /// Whether a line is due after the step just done.
    pub fn is_due(&self, clock: &Clock) -> bool {
        clock.is_due(&self.schedule)
    }

    /// A line.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&mut self, scene: &Scene, clock: &Clock) -> Result<(), ProgramError> {
        let Some(linked) = &scene.linked else {
            return Ok(());
        };
        let statistics = linked.statistics();
        let contacts = statistics.contacts as f64;
        let (flocs, largest) = linked.floc_sizes();
        // A pair is a contact of both.
        let each = 2.0 * contacts / linked.fibres().max(1) as f64;
        let mut values = vec![each, flocs as f64, largest];
        if let Some(distance) = self.about.pair_distance {
            let found = linked.pair_distribution(distance, self.about.bins);
            values.extend(found.map_err(ProgramError::failed)?);
        }
        if let (Some(volume), Flow::Prescribed(flow)) = (self.volume, &scene.flow) {
            let [drag, contact] = linked
                .particle_stress(&|x, _| flow.at(x))
                .map(|s| s / volume);
            for part in [&drag, &contact] {
                values.extend(COMPONENTS.map(|(_, i, j)| part[(i, j)]));
            }
            let total = drag + contact;
            let (along, up) = (self.shear.flow, self.shear.gradient);
            let normal = |axis: &Vector3| axis.dot(&(total * axis));
            let across = self.shear.vorticity();
            values.push(normal(&along) - normal(&up));
            values.push(normal(&up) - normal(&across));
            let gradient = flow.mean_gradient();
            let strain = (gradient + gradient.transpose()) * self.viscosity;
            let viscous = along.dot(&(strain * up));
            let shear = along.dot(&(total * up));
            values.push(if viscous == 0.0 { 0.0 } else { shear / viscous });
            let loads = linked.contact_loads();
            values.extend([
                loads.normal,
                loads.friction,
                loads.sliding,
                statistics.elastic_energy,
                linked.mean_bending(),
                linked.alignment(&self.shear),
            ]);
        }
        let written = self.series.line(clock.step, clock.time, &values);
        written.map_err(ProgramError::series)
    }

    /// Hands everything to the system.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn flush(&mut self) -> Result<(), ProgramError> {
        self.series.flush().map_err(ProgramError::series)
    }
}
