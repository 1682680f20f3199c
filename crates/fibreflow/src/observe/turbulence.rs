//! Series of turbulence: energy budget, scales, spectrum.

use crate::case::{Case, Schedule};
use crate::clock::Clock;
use crate::error::{ProgramError, agree};
use crate::output::series::Series;
use crate::scene::Scene;
use fibreflow_fluid::{EnergySpectrum, Fluid};
use std::path::Path;

const BUDGET: [&str; 13] = [
    "kinetic_energy",
    "dissipation",
    "eddy_dissipation",
    "eddy_viscosity",
    "power",
    "enstrophy",
    "skewness",
    "fluctuation",
    "kolmogorov_length",
    "taylor_length",
    "taylor_reynolds",
    "large_eddy_length",
    "turnover_time",
];

/// What is asked for; files on rank 0 only.
pub struct TurbulenceSeries {
    budget: Option<(Schedule, Option<Series>)>,
    spectrum: Option<(Schedule, Option<Series>, EnergySpectrum)>,
}

impl TurbulenceSeries {
    /// Opens `series/turbulence.csv` and `series/spectrum.csv`, as far as the case asks for them. Collective.
    ///
    /// # Errors
    /// Files that cannot be written, a mesh without Fourier transform.
    pub fn open(
        case: &Case,
        folder: &Path,
        scene: &Scene,
        resume: Option<u64>,
    ) -> Result<Self, ProgramError> {
        let root = scene.communicator.is_root();
        let open = |name: &str, columns: &[&str]| {
            let path = folder.join("series").join(name);
            let series = root.then(|| Series::open(&path, columns, resume));
            let series = series.transpose();
            series.map_err(|e| ProgramError::output(&path, &e))
        };
        let fluid = scene.flow.fluid();
        let budget = match (&case.output.turbulence, fluid) {
            (Some(schedule), Some(_)) => Some((schedule.clone(), open("turbulence.csv", &BUDGET)?)),
            _ => None,
        };
        let spectrum = match (&case.output.spectrum, fluid) {
            (Some(schedule), Some(fluid)) => {
                let spectrum = agree(&scene.communicator, transform(fluid))?;
                let numbers: Vec<String> =
                    spectrum.wave_numbers().map(|k| format!("{k:?}")).collect();
                let columns: Vec<&str> = numbers.iter().map(String::as_str).collect();
                Some((schedule.clone(), open("spectrum.csv", &columns)?, spectrum))
            }
            _ => None,
        };
        Ok(Self { budget, spectrum })
    }

    /// Lines that are due, or all that are not where `rest`. Collective.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write(&mut self, scene: &Scene, clock: &Clock, rest: bool) -> Result<(), ProgramError> {
        let Some(fluid) = scene.flow.fluid() else {
            return Ok(());
        };
        let put = |series: &mut Option<Series>, values: &[f64]| match series {
            Some(series) => series
                .line(clock.step, clock.time, values)
                .map_err(ProgramError::series),
            None => Ok(()),
        };
        if let Some((schedule, series)) = &mut self.budget
            && clock.is_due(schedule) != rest
        {
            put(series, &budget(fluid))?;
        }
        if let Some((schedule, series, spectrum)) = &mut self.spectrum
            && clock.is_due(schedule) != rest
        {
            put(series, spectrum.of(fluid))?;
        }
        Ok(())
    }

    /// Hands everything to the system.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn flush(&mut self) -> Result<(), ProgramError> {
        let budget = self.budget.as_mut().and_then(|(_, series)| series.as_mut());
        let spectrum = self.spectrum.as_mut().and_then(|(_, s, _)| s.as_mut());
        let mut open = budget.into_iter().chain(spectrum);
        open.try_for_each(|series| series.flush().map_err(ProgramError::series))
    }
}

fn transform(fluid: &Fluid) -> Result<EnergySpectrum, ProgramError> {
    let found = EnergySpectrum::new(fluid).map_err(ProgramError::input)?;
    found.ok_or_else(|| {
        ProgramError::input(
            "`output.spectrum` needs a box of hexahedra of uniform spacings that is periodic in all directions, and a build with the feature `fft`",
        )
    })
}

fn budget(fluid: &Fluid) -> [f64; BUDGET.len()] {
    let budget = fluid.turbulence();
    [
        budget.kinetic_energy,
        budget.dissipation,
        budget.eddy_dissipation,
        budget.eddy_viscosity,
        budget.power,
        budget.enstrophy,
        budget.skewness,
        budget.fluctuation(),
        budget.kolmogorov_length(),
        budget.taylor_length(),
        budget.taylor_reynolds(),
        budget.large_eddy_length(),
        budget.turnover_time(),
    ]
}
