//! What watches a run: series, pictures, checkpoints, progress.

mod fibres;
mod linked;
mod loads;
mod network;
mod progress;
mod samples;
mod save;
mod series;
mod statistics;
mod stress;
mod turbulence;
mod vtk;

pub use loads::{LoadSummary, PatchSummary, loads};
pub use save::{restore, snapshot};

use crate::case::{Case, Output};
use crate::checkpoint;
use crate::clock::Clock;
use crate::error::ProgramError;
use crate::figures::Figures;
use crate::output::log::Log;
use crate::scene::Scene;
use fibres::FibreSeries;
use linked::StructureSeries;
use loads::LoadSeries;
use network::NetworkSeries;
use progress::Progress;
use samples::SampleOutput;
use series::AllSeries;
use statistics::StatisticsOutput;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use turbulence::TurbulenceSeries;
use vtk::VtkOutput;

/// Why a run stops before its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// It does not.
    GoOn,
    /// SIGTERM, SIGINT or SIGUSR1.
    Signal,
    /// The wall-time limit of the case.
    WallTime,
}

/// From now on SIGTERM, SIGINT and SIGUSR1 set the flag that is returned; a second SIGINT ends the program at once.
///
/// # Errors
/// A system that does not let signals be watched.
pub fn watch_signals() -> Result<Arc<AtomicBool>, ProgramError> {
    use signal_hook::consts::{SIGINT, SIGTERM, SIGUSR1};
    let flag = Arc::new(AtomicBool::new(false));
    let failed = |e| ProgramError::failed(format!("signals cannot be watched: {e}"));
    let again = signal_hook::flag::register_conditional_shutdown(SIGINT, 130, flag.clone());
    again.map_err(failed)?;
    for number in [SIGTERM, SIGINT, SIGUSR1] {
        signal_hook::flag::register(number, flag.clone()).map_err(failed)?;
    }
    Ok(flag)
}

/// All observers of a run.
pub struct Observers {
    output: Output,
    folder: PathBuf,
    series: AllSeries,
    loads: Option<LoadSeries>,
    fibres: Option<FibreSeries>,
    structure: Option<StructureSeries>,
    network: NetworkSeries,
    statistics: Option<StatisticsOutput>,
    samples: Option<SampleOutput>,
    turbulence: TurbulenceSeries,
    vtk: VtkOutput,
    progress: Progress,
    signal: Arc<AtomicBool>,
    last_checkpoint: Option<u64>,
    resumed: bool,
    /// A step has been done.
    moved: bool,
}

impl Observers {
    /// Opens the files of a run in `folder`, to be stopped by `signal`; a run resumed at `clock` keeps what is there up
    /// to then, and has the lists `kept` of its checkpoint. Collective.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn new(
        case: &Case,
        folder: &Path,
        scene: &Scene,
        clock: &Clock,
        kept: Option<&[(String, Vec<f64>)]>,
        signal: Arc<AtomicBool>,
    ) -> Result<Self, ProgramError> {
        let resumed = kept.is_some();
        Ok(Self {
            output: case.output.clone(),
            series: AllSeries::open(case, folder, scene, resumed.then_some(clock.step))?,
            loads: LoadSeries::open(case, folder, scene, resumed.then_some(clock.step))?,
            fibres: FibreSeries::open(case, folder, scene, resumed.then_some(clock.step))?,
            structure: StructureSeries::open(case, folder, scene, resumed.then_some(clock.step))?,
            network: NetworkSeries::open(case, folder, resumed.then_some(clock.step))?,
            statistics: StatisticsOutput::open(case, folder, scene, clock, kept)?,
            samples: SampleOutput::open(case, folder, scene, resumed.then_some(clock))?,
            turbulence: TurbulenceSeries::open(case, folder, scene, resumed.then_some(clock.step))?,
            vtk: VtkOutput::new(
                folder,
                scene,
                case.output.vortices,
                resumed.then_some(clock.time),
            )?,
            progress: Progress::new(clock),
            folder: folder.to_owned(),
            signal,
            last_checkpoint: None,
            resumed,
            moved: false,
        })
    }

    /// The state before the first step. Collective.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn start(
        &mut self,
        scene: &Scene,
        clock: &Clock,
        log: &mut Log,
    ) -> Result<(), ProgramError> {
        if !self.resumed {
            self.series.write(scene, clock, &Figures::default())?;
            self.network.write(scene, clock)?;
            if let Some(fibres) = &mut self.fibres {
                fibres.write(scene, clock)?;
            }
            if let Some(structure) = &mut self.structure {
                structure.write(scene, clock)?;
            }
            self.turbulence.write(scene, clock, false)?;
            self.turbulence.write(scene, clock, true)?;
            self.vtk.write(scene, clock)?;
            if let Some(samples) = &mut self.samples {
                samples.write(scene, clock)?;
            }
        }
        for (name, count) in self.samples.iter().flat_map(SampleOutput::outside) {
            log.line(&format!(
                "warning: {count} points of `output.samples` \"{name}\" are outside the mesh: their values are NaN"
            ));
        }
        self.progress.start(log);
        Ok(())
    }

    /// After every step: writes what is due. Collective.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn observe(
        &mut self,
        scene: &Scene,
        clock: &Clock,
        figures: &Figures,
        log: &mut Log,
    ) -> Result<Stop, ProgramError> {
        self.moved = true;
        if clock.is_due(&self.output.series) {
            self.series.write(scene, clock, figures)?;
            self.network.write(scene, clock)?;
        }
        if let Some(loads) = self.loads.as_mut().filter(|l| l.is_due(clock)) {
            loads.write(scene, clock)?;
        }
        if let Some(fibres) = self.fibres.as_mut().filter(|f| f.is_due(clock)) {
            fibres.write(scene, clock)?;
        }
        if let Some(structure) = self.structure.as_mut().filter(|s| s.is_due(clock)) {
            structure.write(scene, clock)?;
        }
        if let Some(statistics) = self.statistics.as_mut().filter(|s| s.is_due(clock)) {
            statistics.sample(scene, clock)?;
        }
        if let Some(samples) = &mut self.samples {
            samples.write(scene, clock)?;
        }
        self.turbulence.write(scene, clock, false)?;
        if clock.is_due(&self.output.vtk) {
            self.vtk.write(scene, clock)?;
        }
        self.progress.note_diffusion(clock, figures, log);
        if self.progress.show(clock, figures, log) {
            self.flush()?;
        }
        let stop = self.stop(scene, log);
        if clock.is_due(&self.output.checkpoint) || stop != Stop::GoOn {
            self.save(scene, clock, log)?;
        }
        Ok(stop)
    }

    /// After the last step. A run that was `stop`ped on the way adds no line of its own to its series: gone on with, they
    /// are those of a run that was not, and means over them too. Collective.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn finish(
        &mut self,
        scene: &Scene,
        clock: &Clock,
        figures: &Figures,
        stop: Stop,
        log: &mut Log,
    ) -> Result<(), ProgramError> {
        self.progress.last(clock, figures, log);
        if self.moved && stop == Stop::GoOn {
            self.last_lines(scene, clock, figures)?;
        }
        self.flush()?;
        if self.moved && !clock.is_due(&self.output.vtk) {
            self.vtk.write(scene, clock)?;
        }
        if self.moved {
            self.save(scene, clock, log)?;
        }
        Ok(())
    }

    /// The end of every series that has no line of this step yet. Collective.
    fn last_lines(
        &mut self,
        scene: &Scene,
        clock: &Clock,
        figures: &Figures,
    ) -> Result<(), ProgramError> {
        if !clock.is_due(&self.output.series) {
            self.series.write(scene, clock, figures)?;
            self.network.write(scene, clock)?;
        }
        if let Some(loads) = self.loads.as_mut().filter(|l| !l.is_due(clock)) {
            loads.write(scene, clock)?;
        }
        if let Some(fibres) = self.fibres.as_mut().filter(|f| !f.is_due(clock)) {
            fibres.write(scene, clock)?;
        }
        if let Some(structure) = self.structure.as_mut().filter(|s| !s.is_due(clock)) {
            structure.write(scene, clock)?;
        }
        self.turbulence.write(scene, clock, true)
    }

    fn flush(&mut self) -> Result<(), ProgramError> {
        self.series.flush()?;
        self.network.flush()?;
        self.turbulence.flush()?;
        self.loads.as_mut().map_or(Ok(()), LoadSeries::flush)?;
        self.fibres.as_mut().map_or(Ok(()), FibreSeries::flush)?;
        self.structure
            .as_mut()
            .map_or(Ok(()), StructureSeries::flush)?;
        self.samples.as_mut().map_or(Ok(()), SampleOutput::flush)?;
        self.statistics
            .as_mut()
            .map_or(Ok(()), StatisticsOutput::flush)
    }

    fn save(&mut self, scene: &Scene, clock: &Clock, log: &mut Log) -> Result<(), ProgramError> {
        if self.last_checkpoint == Some(clock.step) {
            return Ok(());
        }
        // A resumed series must not miss what came before the checkpoint.
        self.flush()?;
        let root = self.folder.join("checkpoint");
        let mut state = snapshot(scene, clock);
        if let Some(statistics) = &mut self.statistics {
            statistics.write(scene)?;
            state.arrays = statistics.state(scene);
        }
        checkpoint::write(&root, &state, &scene.communicator)?;
        self.last_checkpoint = Some(clock.step);
        log.note(&format!("checkpoint at step {}", clock.step));
        Ok(())
    }

    /// The same on every rank.
    fn stop(&self, scene: &Scene, log: &Log) -> Stop {
        let signal = self.signal.load(Ordering::Relaxed);
        let late = self
            .output
            .wall_time_limit
            .is_some_and(|limit| log.elapsed() > limit);
        let reason = f64::from(u8::from(late)).max(2.0 * f64::from(u8::from(signal)));
        match scene.communicator.max(reason) {
            r if r >= 2.0 => Stop::Signal,
            r if r >= 1.0 => Stop::WallTime,
            _ => Stop::GoOn,
        }
    }
}
