//! The series of directions and shapes of the fibres.

use super::stress::{StressColumns, inside};
use crate::case::{Case, Observables, Schedule};
use crate::clock::Clock;
use crate::error::ProgramError;
use crate::output::series::Series;
use crate::scene::Scene;
use fibreflow_fibre::contact::ContactSystem;
use fibreflow_fibre::{Budget, FOURTH, FibreSystem, Inside, Shear};
use std::path::Path;

const AXES: [&str; 3] = ["x", "y", "z"];
const SECOND: [[usize; 2]; 6] = [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]];

const ENERGY: [&str; 10] = [
    "kinetic",
    "elastic",
    "contact",
    "loads",
    "walls",
    "flow",
    "drag",
    "material",
    "contact_loss",
    "residual",
];

/// `series/orientation.csv`, `series/shape.csv`, `series/energy.csv` and `series/stress.csv`; the files on rank 0 only.
pub struct FibreSeries {
    about: Observables,
    shear: Shear,
    inside: Inside,
    schedule: Schedule,
    orientation: Option<Series>,
    shape: Option<Series>,
    energy: Option<Series>,
    stress: Option<Series>,
    /// What the stress is made of, if the case asks for it.
    parts: Option<StressColumns>,
}

impl FibreSeries {
    /// Opens the files if the case asks for them.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn open(
        case: &Case,
        folder: &Path,
        scene: &Scene,
        resume: Option<u64>,
    ) -> Result<Option<Self>, ProgramError> {
        let (Some(about), Some(_)) = (&case.output.observables, &scene.fibres) else {
            return Ok(None);
        };
        let open = |name: &str, columns: Vec<String>, wanted: bool| {
            let path = folder.join("series").join(name);
            let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
            let here = wanted && scene.communicator.is_root();
            let series = here.then(|| Series::open(&path, &columns, resume));
            series
                .transpose()
                .map_err(|e| ProgramError::output(&path, &e))
        };
        let shear = Shear::new(&about.flow.into(), &about.gradient.into());
        let parts = about.stress.then(|| StressColumns::new(case, scene, shear));
        let columns = parts.as_ref().map_or_else(Vec::new, StressColumns::names);
        Ok(Some(Self {
            stress: open("stress.csv", columns, about.stress)?,
            parts,
            shear,
            inside: inside(case),
            schedule: about.schedule(&case.output.series),
            orientation: open("orientation.csv", orientation_columns(about), true)?,
            shape: open("shape.csv", shape_columns(about), true)?,
            energy: open(
                "energy.csv",
                ENERGY.map(str::to_owned).to_vec(),
                about.energy,
            )?,
            about: about.clone(),
        }))
    }

    /// Whether a line is due after the step just done.
    pub fn is_due(&self, clock: &Clock) -> bool {
        clock.is_due(&self.schedule)
    }

    /// A line in each. Collective.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&mut self, scene: &Scene, clock: &Clock) -> Result<(), ProgramError> {
        let Some(fibres) = &scene.fibres else {
            return Ok(());
        };
        let orientation = self.orientation_values(fibres);
        let shape = shape_values(&self.about, fibres, scene.fibre_count);
        let energy = fibres.budget().map_or_else(Vec::new, energy_values);
        let stress = self.parts.as_ref().map(|p| p.values(scene, fibres));
        let stress = stress.unwrap_or_default();
        let lines = [
            (&mut self.orientation, orientation),
            (&mut self.shape, shape),
            (&mut self.energy, energy),
            (&mut self.stress, stress),
        ];
        for (series, values) in lines {
            if let Some(series) = series {
                let written = series.line(clock.step, clock.time, &values);
                written.map_err(ProgramError::series)?;
            }
        }
        Ok(())
    }

    /// Hands everything to the system.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn flush(&mut self) -> Result<(), ProgramError> {
        let files = [
            &mut self.orientation,
            &mut self.shape,
            &mut self.energy,
            &mut self.stress,
        ];
        let mut files = files.into_iter().flatten();
        files
            .try_for_each(Series::flush)
            .map_err(ProgramError::series)
    }

    fn orientation_values(&self, fibres: &FibreSystem) -> Vec<f64> {
        let (shear, inside, bins) = (&self.shear, &self.inside, self.about.bins);
        let moments = fibres.orientation_moments(inside);
        let mut values: Vec<f64> = SECOND.map(|[i, j]| moments.second[(i, j)]).to_vec();
        values.extend(moments.fourth);
        let (orbits, mean) = fibres.orbit_distribution(shear, inside, bins);
        values.push(mean);
        values.extend(orbits.density);
        values.extend(fibres.phase_distribution(shear, inside, bins).density);
        values
    }
}

fn numbered(name: &str, bins: usize) -> impl Iterator<Item = String> {
    (1..=bins).map(move |k| format!("{name}_{k}"))
}

fn orientation_columns(about: &Observables) -> Vec<String> {
    let named = |indices: &[usize]| {
        let letters = indices.iter().map(|&i| AXES[i]);
        format!("a_{}", letters.collect::<String>())
    };
    let mut columns: Vec<String> = SECOND.iter().map(|i| named(i)).collect();
    columns.extend(FOURTH.iter().map(|i| named(i)));
    columns.push("orbit_mean".to_owned());
    columns.extend(numbered("orbit", about.bins));
    columns.extend(numbered("phase", about.bins));
    columns
}

fn shape_columns(about: &Observables) -> Vec<String> {
    let mut columns = vec!["contacts_per_fibre".to_owned()];
    columns.extend(numbered("extension", about.bins));
    columns.push("extension_beyond".to_owned());
    columns.extend(numbered("curvature", about.bins));
    columns.push("curvature_beyond".to_owned());
    columns.extend(numbered("lag", about.bins));
    columns.extend(numbered("correlation", about.bins));
    columns
}

fn shape_values(about: &Observables, fibres: &FibreSystem, count: usize) -> Vec<f64> {
    let contacts = fibres.contacts().map(ContactSystem::statistics);
    let contacts = contacts.unwrap_or_default();
    // A pair is a contact of both.
    let touched = 2 * contacts.contacts + contacts.wall_contacts;
    let mut values = vec![touched as f64 / count.max(1) as f64];
    let extension = fibres.extension_distribution(about.bins);
    let curvature = fibres.curvature_distribution(about.curvature_max, about.bins);
    for histogram in [extension, curvature] {
        values.extend(histogram.density);
        values.push(histogram.beyond);
    }
    let correlation = fibres.tangent_correlation(about.bins);
    values.extend(correlation.iter().map(|c| c[0]));
    values.extend(correlation.iter().map(|c| c[1]));
    values
}

fn energy_values(budget: Budget) -> Vec<f64> {
    vec![
        budget.kinetic,
        budget.elastic,
        budget.contact,
        budget.loads,
        budget.walls,
        budget.flow,
        budget.drag,
        budget.material,
        budget.contact_loss,
        budget.residual(),
    ]
}
