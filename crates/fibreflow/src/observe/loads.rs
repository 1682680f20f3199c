//! The series of forces on patches.

use crate::case::{Case, Coefficients, Loads, Schedule};
use crate::clock::Clock;
use crate::error::ProgramError;
use crate::output::series::Series;
use crate::scene::Scene;
use fibreflow_fluid::{Fluid, PatchLoad};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

const COLUMNS: [&str; 10] = [
    "pressure_x",
    "pressure_y",
    "pressure_z",
    "viscous_x",
    "viscous_y",
    "viscous_z",
    "torque_x",
    "torque_y",
    "torque_z",
    "flux",
];

/// Series of the loads; the file on rank 0 only.
pub struct LoadSeries {
    about: Loads,
    schedule: Schedule,
    /// Indices and names of the patches.
    patches: Vec<(usize, String)>,
    file: Option<Series>,
}

/// Loads at the end of a run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct LoadSummary {
    /// By patch.
    #[serde(flatten)]
    pub patches: BTreeMap<String, PatchSummary>,
    /// Drag and lift coefficients of the patches together, where the case asks for them.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub coefficients: BTreeMap<&'static str, f64>,
}

/// Load on a patch.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PatchSummary {
    /// Pressure part of the force \[N\].
    pub pressure: [f64; 3],
    /// Viscous part of the force \[N\].
    pub viscous: [f64; 3],
    /// Torque about the point of the case \[N·m\].
    pub torque: [f64; 3],
    /// Flow out of the domain \[m³/s\].
    pub flux: f64,
}

impl LoadSeries {
    /// Opens `series/loads.csv` if the case asks for it.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn open(
        case: &Case,
        folder: &Path,
        scene: &Scene,
        resume: Option<u64>,
    ) -> Result<Option<Self>, ProgramError> {
        let (Some(about), Some(fluid)) = (&case.output.loads, scene.flow.fluid()) else {
            return Ok(None);
        };
        let patches = chosen(about, fluid);
        let path = folder.join("series/loads.csv");
        let columns = columns(about, &patches);
        let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
        let root = scene.communicator.is_root();
        let file = root.then(|| Series::open(&path, &columns, resume));
        let file = file.transpose();
        Ok(Some(Self {
            schedule: about.schedule(&case.output.series),
            about: about.clone(),
            patches,
            file: file.map_err(|e| ProgramError::output(&path, &e))?,
        }))
    }

    /// Whether a line is due after the step just done.
    pub fn is_due(&self, clock: &Clock) -> bool {
        clock.is_due(&self.schedule)
    }

    /// A line. Collective.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&mut self, scene: &Scene, clock: &Clock) -> Result<(), ProgramError> {
        let Some(fluid) = scene.flow.fluid() else {
            return Ok(());
        };
        let loads = fluid.patch_loads(self.about.about);
        let mut line = Vec::with_capacity(COLUMNS.len() * self.patches.len() + 2);
        for (index, _) in &self.patches {
            let load = &loads[*index];
            line.extend(load.pressure);
            line.extend(load.viscous);
            line.extend(load.torque());
            line.push(load.flux);
        }
        let sum = total(&loads, &self.patches);
        line.extend(coefficients(&self.about, &sum, fluid).map(|(_, value)| value));
        let Some(file) = &mut self.file else {
            return Ok(());
        };
        file.line(clock.step, clock.time, &line)
            .map_err(ProgramError::series)
    }

    /// Hands everything to the system.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn flush(&mut self) -> Result<(), ProgramError> {
        let flushed = self.file.as_mut().map(Series::flush);
        flushed
            .transpose()
            .map(|_| ())
            .map_err(ProgramError::series)
    }
}

/// Loads now, for the summary; None where the case does not ask for them. Collective.
pub fn loads(scene: &Scene, case: &Case) -> Option<LoadSummary> {
    let (about, fluid) = (case.output.loads.as_ref()?, scene.flow.fluid()?);
    let loads = fluid.patch_loads(about.about);
    let patches = chosen(about, fluid);
    let sum = total(&loads, &patches);
    let summary = |(index, name): &(usize, String)| {
        let load = &loads[*index];
        let summary = PatchSummary {
            pressure: load.pressure,
            viscous: load.viscous,
            torque: load.torque(),
            flux: load.flux,
        };
        (name.clone(), summary)
    };
    Some(LoadSummary {
        patches: patches.iter().map(summary).collect(),
        coefficients: coefficients(about, &sum, fluid).collect(),
    })
}

/// The patches that are meant, in the order of the case or of the mesh.
fn chosen(about: &Loads, fluid: &Fluid) -> Vec<(usize, String)> {
    let all = &fluid.mesh().patches;
    let index = |name: &String| all.iter().position(|p| p == name);
    let named = if about.patches.is_empty() {
        all
    } else {
        &about.patches
    };
    let found = named.iter().filter_map(|n| Some((index(n)?, n.clone())));
    found.collect()
}

fn columns(about: &Loads, patches: &[(usize, String)]) -> Vec<String> {
    // Names of groups in mesh files may hold anything.
    let plain = |name: &str| name.replace([',', '"', '\n', '\r'], "_");
    let each = patches.iter().flat_map(|(_, name)| {
        let name = plain(name);
        COLUMNS.map(|column| format!("{name}_{column}"))
    });
    let mut columns: Vec<String> = each.collect();
    let names = about.coefficients.iter().flat_map(directions);
    columns.extend(names.map(|(name, _)| name.to_owned()));
    columns
}

fn total(loads: &[PatchLoad], patches: &[(usize, String)]) -> PatchLoad {
    let chosen = patches.iter().map(|(index, _)| &loads[*index]);
    chosen.fold(PatchLoad::default(), |sum, load| sum.plus(load))
}

/// Names and directions of the coefficients.
fn directions(about: &Coefficients) -> impl Iterator<Item = (&'static str, [f64; 3])> + use<> {
    let drag = ("drag_coefficient", about.drag);
    let lift = about.lift.map(|lift| ("lift_coefficient", lift));
    std::iter::once(drag).chain(lift)
}

fn coefficients(
    about: &Loads,
    sum: &PatchLoad,
    fluid: &Fluid,
) -> impl Iterator<Item = (&'static str, f64)> {
    let (force, density) = (sum.force(), fluid.settings().density);
    about.coefficients.iter().flat_map(move |c| {
        let scale = 0.5 * density * c.velocity * c.velocity * c.area;
        directions(c).map(move |(name, direction)| {
            let length = direction.iter().map(|d| d * d).sum::<f64>().sqrt();
            let along: f64 = (0..3).map(|k| force[k] * direction[k]).sum();
            (name, along / (length * scale))
        })
    })
}
