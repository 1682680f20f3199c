//! Averages of a turbulent flow: samples, friction series, profiles.

use crate::case::{Average, Axis, Case, Schedule, Statistics as About};
use crate::clock::Clock;
use crate::error::{ProgramError, agree};
use crate::output::replace_file;
use crate::output::series::Series;
use crate::scene::Scene;
use fibreflow_fluid::{
    Averaging, Friction, LineSpectrum, Statistics, StatisticsReport, StatisticsSettings,
};
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

const COLUMNS: [&str; 6] = [
    "wall_stress",
    "friction_velocity",
    "friction_reynolds_number",
    "bulk_velocity",
    "friction_coefficient",
    "driving_force",
];

/// Blocks of time that the averaging time is cut into where the case does not say.
const BLOCKS: f64 = 20.0;

/// The averages of a run; files on rank 0 only.
pub struct StatisticsOutput {
    schedule: Schedule,
    statistics: Statistics,
    folder: PathBuf,
    series: Option<Series>,
    from: f64,
}

/// What `statistics.json` holds beside the friction.
#[derive(Serialize)]
struct Summary {
    from: f64,
    averaging_time: f64,
    samples: u64,
    blocks: usize,
    block_length: f64,
    half_width: f64,
    wall_stress: f64,
    wall_stress_error: f64,
    friction_velocity: f64,
    friction_reynolds_number: f64,
    bulk_velocity: f64,
    bulk_velocity_error: f64,
    friction_coefficient: f64,
    driving_force: f64,
    stress_residual: f64,
}

impl StatisticsOutput {
    /// Sets the averages up if the case asks for them; a resumed run goes on with those among the lists `kept` of its
    /// checkpoint. Collective.
    ///
    /// # Errors
    /// A mesh without the planes, rings or lines of the case; a checkpoint with others; a file that cannot be written.
    pub fn open(
        case: &Case,
        folder: &Path,
        scene: &Scene,
        clock: &Clock,
        kept: Option<&[(String, Vec<f64>)]>,
    ) -> Result<Option<Self>, ProgramError> {
        let (Some(about), Some(fluid)) = (&case.output.statistics, scene.flow.fluid()) else {
            return Ok(None);
        };
        let statistics = Statistics::new(fluid, settings(about, case.time.end));
        let mut statistics = agree(&scene.communicator, statistics.map_err(ProgramError::input))?;
        if let Some(kept) = kept {
            let restored = statistics.restore(fluid, kept);
            agree(&scene.communicator, restored.map_err(ProgramError::input))?;
        }
        let path = folder.join("series/friction.csv");
        let root = scene.communicator.is_root();
        let resume = kept.map(|_| clock.step);
        let series = root.then(|| Series::open(&path, &COLUMNS, resume));
        Ok(Some(Self {
            schedule: about.schedule(),
            statistics,
            folder: folder.to_owned(),
            series: series
                .transpose()
                .map_err(|e| ProgramError::output(&path, &e))?,
            from: about.from,
        }))
    }

    /// Whether a sample is due after the step just done.
    pub fn is_due(&self, clock: &Clock) -> bool {
        clock.is_due(&self.schedule)
    }

    /// A sample, and a line of the friction. Collective.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn sample(&mut self, scene: &Scene, clock: &Clock) -> Result<(), ProgramError> {
        let Some(fluid) = scene.flow.fluid() else {
            return Ok(());
        };
        self.statistics.sample(fluid, clock.time);
        let f = self.statistics.friction_now(fluid);
        let values = [
            f.wall_stress,
            f.friction_velocity,
            f.reynolds_number,
            f.bulk_velocity,
            f.coefficient,
            f.driving_force,
        ];
        let line = |s: &mut Series| s.line(clock.step, clock.time, &values);
        self.series
            .as_mut()
            .map_or(Ok(()), line)
            .map_err(ProgramError::series)
    }

    /// Hands everything to the system.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn flush(&mut self) -> Result<(), ProgramError> {
        let flushed = self.series.as_mut().map(Series::flush);
        flushed
            .transpose()
            .map(|_| ())
            .map_err(ProgramError::series)
    }

    /// What a checkpoint keeps. Collective.
    pub fn state(&self, scene: &Scene) -> Vec<(String, Vec<f64>)> {
        let fluid = scene.flow.fluid();
        fluid.map_or_else(Vec::new, |fluid| self.statistics.state(fluid))
    }

    /// Profiles, spectra and summary so far. Collective.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&mut self, scene: &Scene) -> Result<(), ProgramError> {
        let report = scene.flow.fluid().and_then(|f| self.statistics.report(f));
        let Some(report) = report else {
            return Ok(());
        };
        let written = if scene.communicator.is_root() {
            self.files(&report)
        } else {
            Ok(())
        };
        agree(&scene.communicator, written)
    }

    fn files(&self, report: &StatisticsReport) -> Result<(), ProgramError> {
        let folder = self.folder.join("profiles");
        std::fs::create_dir_all(&folder).map_err(|e| ProgramError::output(&folder, &e))?;
        let summary = serde_json::to_string_pretty(&self.summary(report)).unwrap_or_default();
        let mut files = vec![
            (self.folder.join("statistics.json"), summary + "\n"),
            (folder.join("statistics.csv"), profiles(report)),
        ];
        for spectrum in &report.spectra {
            let name = ["x", "y", "z", "around"][spectrum.axis];
            let (energy, correlation) = lines(spectrum, &report.positions);
            files.push((folder.join(format!("spectrum_{name}.csv")), energy));
            files.push((folder.join(format!("correlation_{name}.csv")), correlation));
        }
        for (path, text) in files {
            replace_file(&path, text.as_bytes()).map_err(|e| ProgramError::output(&path, &e))?;
        }
        Ok(())
    }

    fn summary(&self, report: &StatisticsReport) -> Summary {
        let f: Friction = report.friction;
        Summary {
            from: self.from,
            averaging_time: report.time,
            samples: report.samples,
            blocks: report.blocks.0,
            block_length: report.blocks.1,
            half_width: report.extent,
            wall_stress: f.wall_stress,
            wall_stress_error: f.wall_stress_error,
            friction_velocity: f.friction_velocity,
            friction_reynolds_number: f.reynolds_number,
            bulk_velocity: f.bulk_velocity,
            bulk_velocity_error: f.bulk_velocity_error,
            friction_coefficient: f.coefficient,
            driving_force: f.driving_force,
            stress_residual: f.stress_residual,
        }
    }
}

fn settings(about: &About, end: f64) -> StatisticsSettings {
    let axis = |axis: Axis| axis as usize;
    StatisticsSettings {
        averaging: match about.average {
            Average::Planes {
                normal,
                flow,
                symmetric,
            } => Averaging::Planes {
                normal: axis(normal),
                flow: axis(flow),
                symmetric,
            },
            Average::Rings { axis: a, centre } => Averaging::Rings {
                axis: axis(a),
                centre,
            },
        },
        from: about.from,
        block: about.block.unwrap_or((end - about.from) / BLOCKS),
        spectra: about.spectra.iter().map(|&line| line as usize).collect(),
    }
}

/// A line for every bin: position, then every quantity with its sampling error where there is one. Numbers read back bit by bit.
fn profiles(report: &StatisticsReport) -> String {
    let mut text = "position".to_owned();
    for column in &report.columns {
        let _ = write!(text, ",{0},{0}_error", column.name);
    }
    for (bin, position) in report.positions.iter().enumerate() {
        let _ = write!(text, "\n{position:?}");
        for column in &report.columns {
            let _ = write!(text, ",{:?},", column.values[bin]);
            if let Some(error) = column.errors.get(bin) {
                let _ = write!(text, "{error:?}");
            }
        }
    }
    text.push('\n');
    text
}

/// Spectra and correlations, a line for every bin and wavenumber or separation.
fn lines(spectrum: &LineSpectrum, positions: &[f64]) -> (String, String) {
    let table = |header: &str, at: &[f64], products: &[Vec<f64>; 4]| {
        let mut text = header.to_owned();
        for (bin, position) in spectrum.bins.iter().map(|&b| positions[b]).enumerate() {
            for (k, place) in at.iter().enumerate() {
                let _ = write!(text, "{position:?},{place:?}");
                for product in products {
                    let _ = write!(text, ",{:?}", product[bin * at.len() + k]);
                }
                text.push('\n');
            }
        }
        text
    };
    (
        table(
            "position,wavenumber,e_uu,e_vv,e_ww,e_uv\n",
            &spectrum.wavenumbers,
            &spectrum.spectra,
        ),
        table(
            "position,separation,r_uu,r_vv,r_ww,r_uv\n",
            &spectrum.separations,
            &spectrum.correlations,
        ),
    )
}
