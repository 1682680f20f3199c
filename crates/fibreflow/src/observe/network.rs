//! The series of piston and grips.

use crate::case::{Case, Grips};
use crate::clock::Clock;
use crate::error::ProgramError;
use crate::output::series::Series;
use crate::scene::Scene;
use std::path::Path;

/// `series/piston.csv` and `series/grips.csv` of cases with linked fibres that have them.
pub struct NetworkSeries {
    piston: Option<Series>,
    grips: Option<(Grips, Series)>,
}

impl NetworkSeries {
    /// Opens the files that the case asks for.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn open(case: &Case, folder: &Path, resume: Option<u64>) -> Result<Self, ProgramError> {
        let open = |name: &str, columns: &[&str]| {
            let path = folder.join("series").join(name);
            let series = Series::open(&path, columns, resume);
            series.map_err(|e| ProgramError::output(&path, &e))
        };
        let piston = case.piston.as_ref().map(|_| {
            let columns = ["travelled", "speed", "load"];
            open("piston.csv", &columns)
        });
        let grips = case.grips.as_ref().map(|grips| {
            let columns = ["elongation", "tension", "lower", "upper", "gripped"];
            open("grips.csv", &columns).map(|series| (grips.clone(), series))
        });
        Ok(Self {
            piston: piston.transpose()?,
            grips: grips.transpose()?,
        })
    }

    /// A line of each.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&mut self, scene: &Scene, clock: &Clock) -> Result<(), ProgramError> {
        let Some(linked) = &scene.linked else {
            return Ok(());
        };
        if let Some(series) = &mut self.piston {
            let [travelled, speed] = linked.piston();
            let values = [travelled, speed, linked.piston_load()];
            let written = series.line(clock.step, clock.time, &values);
            written.map_err(ProgramError::series)?;
        }
        if let Some((about, series)) = &mut self.grips {
            let pull = |plane: u8| {
                let held = linked.grips().iter().filter(|g| g.plane == plane);
                held.map(|g| g.force).sum::<f64>()
            };
            let values = [
                2.0 * about.speed * clock.time,
                linked.tension(),
                pull(0),
                pull(1),
                linked.grips().len() as f64,
            ];
            let written = series.line(clock.step, clock.time, &values);
            written.map_err(ProgramError::series)?;
        }
        Ok(())
    }

    /// Hands everything to the system.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn flush(&mut self) -> Result<(), ProgramError> {
        let grips = self.grips.as_mut().map(|(_, series)| series);
        let mut open = self.piston.iter_mut().chain(grips);
        open.try_for_each(Series::flush)
            .map_err(ProgramError::series)
    }
}
