//! `fibreflow run`: set up, loop, summary.

use crate::case::{self, Case};
use crate::checkpoint::{self, CheckpointError};
use crate::cli::RunArguments;
use crate::clock::Clock;
use crate::error::{ProgramError, agree};
use crate::figures::{Figures, Totals, timed};
use crate::observe::{Observers, Stop, restore, watch_signals};
use crate::output::log::Log;
use crate::output::manifest::Manifest;
use crate::scene::Scene;
use crate::{describe, summary};
use fibreflow_fibre::linked::LinkedSystem;
use fibreflow_fibre::{Ambient, FibreSystem, Points};
use fibreflow_parallel::Communicator;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Steps between changes of the fibres' owners; they move less than an element in each.
const SETTLE: u64 = 32;

/// Above this the Runge–Kutta scheme of the fluid is unstable (√3).
const LARGEST_CFL: f64 = 1.73;

/// A case that is set up and ready to run.
pub struct Run {
    case: Case,
    folder: PathBuf,
    scene: Scene,
    clock: Clock,
    observers: Observers,
    log: Log,
    figures: Figures,
    totals: Totals,
}

/// Sets a case up, from its start or from a checkpoint. Collective.
///
/// # Errors
/// Bad input or files that cannot be written; every rank fails then.
pub fn prepare(arguments: &RunArguments, communicator: &Communicator) -> Result<Run, ProgramError> {
    let signal = agree(communicator, watch_signals())?;
    let loaded = case::load(&arguments.case, &arguments.overrides).map_err(ProgramError::from);
    let (case, document) = agree(communicator, loaded)?;
    let case_folder = arguments.case.parent().unwrap_or(Path::new("."));
    let mut scene = Scene::new(&case, &document, case_folder, communicator)?;

    let given = arguments.out.clone();
    let folder = given.unwrap_or_else(|| default_folder(&arguments.case));
    let resumed = arguments.resume;
    agree(communicator, clear(&folder, resumed, communicator))?;
    let path = folder.join("run.log");
    let log = Log::open(&path, communicator.is_root(), resumed);
    let mut log = agree(
        communicator,
        log.map_err(|e| ProgramError::output(&path, &e)),
    )?;
    log.line(&banner(&case, communicator));

    let mut clock = Clock::new(&case.time, &case.output.schedules(), arguments.steps);
    let mut arrays = Vec::new();
    if resumed {
        arrays = resume(&mut scene, &mut clock, &folder, &mut log)?;
    }
    let from = resumed.then_some(clock.step);
    let manifest = Manifest::new(communicator.size(), scene.mesh_checksum, from);
    agree(
        communicator,
        provenance(&case, &manifest, &folder, communicator),
    )?;
    for line in describe::describe(&scene, &case) {
        log.line(&line);
    }
    let kept = resumed.then_some(arrays.as_slice());
    let observers = Observers::new(&case, &folder, &scene, &clock, kept, signal);
    Ok(Run {
        observers: agree(communicator, observers)?,
        case,
        folder,
        scene,
        clock,
        log,
        figures: Figures::default(),
        totals: Totals::default(),
    })
}

impl Run {
    /// The time loop. Collective.
    ///
    /// # Errors
    /// A stage that fails, on the ranks that see it; the last complete checkpoint stays.
    fn advance(&mut self) -> Result<Stop, ProgramError> {
        let Self {
            scene,
            clock,
            observers,
            log,
            totals,
            figures,
            ..
        } = self;
        let (mut points, mut ambient) = (Points::default(), Ambient::default());
        let mut stop = Stop::GoOn;
        observers.start(scene, clock, log)?;
        while stop == Stop::GoOn
            && let Some(dt) = clock.advance(scene.flow.suggest_step(&self.case.time))
        {
            *figures = Figures::before(scene, dt);
            if clock.step.is_multiple_of(SETTLE) {
                scene.settle()?;
            }
            let times = &mut totals.timings;
            // The order parameter in the present flow, then its force on it.
            let report = timed(&mut times.phase, || scene.flow.advance_phase(dt))?;
            figures.phase(report);
            match &mut scene.fibres {
                None if scene.linked.is_some() => {
                    let spread = scene.advance_linked(&mut points, &mut ambient, dt, times)?;
                    figures.spread(spread);
                    // Convect, diffuse, project.
                    let report = timed(&mut times.fluid, || scene.flow.advance(dt, true))?;
                    figures.fluid(report, scene.flow.convects());
                }
                Some(fibres) if scene.flow.iterates() => {
                    // Forces that fit fibres and flow, then both move.
                    let flow = &mut scene.flow;
                    let step =
                        flow.advance_together(fibres, &mut points, &mut ambient, dt, times)?;
                    figures.together(step);
                }
                Some(fibres) => {
                    // u, ∇u at every hydrodynamic point: the adjoint of spread.
                    timed(&mut times.sample, || {
                        (scene.flow).sample(fibres, &mut points, &mut ambient, dt)
                    })?;
                    // Sub-steps with implicit drag; the reaction is the impulse that the fibres took.
                    timed(&mut times.fibres, || {
                        fibres.advance(&ambient, dt).map(|_| ())
                    })?;
                    // Volume-weighted, momentum-conserving.
                    let spread = timed(&mut times.spread, || {
                        scene.flow.spread(fibres, &points, &ambient, dt)
                    })?;
                    figures.spread(spread);
                    // Convect, diffuse, project.
                    let report = timed(&mut times.fluid, || scene.flow.advance(dt, true))?;
                    figures.fluid(report, scene.flow.convects());
                }
                None => {
                    let report = timed(&mut times.fluid, || scene.flow.advance(dt, false))?;
                    figures.fluid(report, scene.flow.convects());
                }
            }
            scene.break_up()?;
            figures.after(scene);
            totals.add(figures);
            let watched = &mut totals.timings.output;
            stop = timed(watched, || observers.observe(scene, clock, figures, log))?;
        }
        totals.close(scene, &ambient);
        observers.finish(scene, clock, figures, stop, log)?;
        Ok(stop)
    }

    /// Runs to the end and writes the summary. Collective.
    ///
    /// # Errors
    /// A failure, on the ranks that see it.
    pub fn run(mut self) -> Result<(), ProgramError> {
        let stop = self.advance().map_err(|error| self.explained(error))?;
        let wall = self.log.elapsed();
        let summary = summary::of(
            &self.scene,
            &self.case,
            &self.clock,
            &self.totals,
            stop,
            &self.folder,
            wall,
        );
        summary::write(&summary, &self.folder, &self.scene.communicator)?;
        self.log.line(&summary::closing(&summary, stop));
        Ok(())
    }

    /// True on the first rank that calls it, which leaves the message in `error.txt` and the log.
    fn speaks(&self, message: &str) -> bool {
        let path = self.folder.join("error.txt");
        let first = match File::create_new(path) {
            Ok(mut file) => {
                // The message is shown in any case.
                let _ = file.write_all(message.as_bytes());
                true
            }
            Err(error) => error.kind() != std::io::ErrorKind::AlreadyExists,
        };
        if first {
            crate::output::log::append(&self.folder.join("run.log"), message);
        }
        first
    }

    /// The error with step, likely cause and what is left, also in the log.
    fn explained(&self, error: ProgramError) -> ProgramError {
        // Another rank has what there is to say.
        let Some(message) = &error.message else {
            return error;
        };
        let (step, time, cfl) = (self.clock.step, self.clock.time, self.figures.cfl);
        let cause = if error.unwritten {
            "likely causes: a full disk, or a folder that was removed".to_owned()
        } else if self.scene.flow.convects() && (cfl.is_nan() || cfl > LARGEST_CFL) {
            format!(
                "likely cause: the Courant number {cfl:.3} of the step; take a smaller `time.step`, or give `time.cfl`"
            )
        } else if self.scene.fibre_count > 0 {
            "likely causes: fibres that are driven too hard for the step (a smaller `time.max_step`), or contacts that are too stiff".to_owned()
        } else {
            "likely causes: a mesh of poor quality (see `fibreflow mesh`), or boundary conditions that do not fit".to_owned()
        };
        let message = format!(
            "the run stopped in step {step} (time {time:.6e} s): {message}\n{cause}\ncheckpoints written before stay valid; `--resume` goes on from the last"
        );
        ProgramError {
            message: self.speaks(&message).then_some(message),
            ..error
        }
    }
}

/// `runs/NAME`, with NAME from the folder of the case file, or the file itself where that says nothing.
fn default_folder(case: &Path) -> PathBuf {
    let folder = case.parent().and_then(Path::file_name);
    let name = folder
        .or_else(|| case.file_stem())
        .unwrap_or(case.as_os_str());
    Path::new("runs").join(name)
}

/// Makes the folders; a new run clears away what an earlier one left.
fn clear(folder: &Path, resume: bool, communicator: &Communicator) -> Result<(), ProgramError> {
    if !communicator.is_root() {
        return Ok(());
    }
    // Only what an earlier run has written goes away; what is absent is as good as removed.
    if folder.join("manifest.json").exists() {
        for name in ["summary.json", "statistics.json", "error.txt"] {
            let _ = std::fs::remove_file(folder.join(name));
        }
        if !resume {
            for name in [
                "fluid",
                "fibres",
                "beads",
                "series",
                "profiles",
                "samples",
                "checkpoint",
                "pictures",
            ] {
                let _ = std::fs::remove_dir_all(folder.join(name));
            }
            for name in ["fluid.pvd", "fibres.pvd", "beads.pvd"] {
                let _ = std::fs::remove_file(folder.join(name));
            }
        }
    }
    for name in ["fluid", "fibres", "beads", "series", "checkpoint"] {
        let path = folder.join(name);
        std::fs::create_dir_all(&path).map_err(|e| ProgramError::output(&path, &e))?;
    }
    Ok(())
}

/// Resolved case and manifest, written before the first step.
fn provenance(
    case: &Case,
    manifest: &Manifest,
    folder: &Path,
    communicator: &Communicator,
) -> Result<(), ProgramError> {
    if !communicator.is_root() {
        return Ok(());
    }
    let resolved = toml::to_string(case)
        .map_err(|e| ProgramError::failed(format!("the resolved case cannot be written: {e}")))?;
    for (name, text) in [
        ("case.toml", resolved),
        ("manifest.json", manifest.to_json()),
    ] {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|e| ProgramError::output(&path, &e))?;
    }
    Ok(())
}

/// Scene and clock as the newest checkpoint has them; returns its lists that belong to no rank.
fn resume(
    scene: &mut Scene,
    clock: &mut Clock,
    folder: &Path,
    log: &mut Log,
) -> Result<Vec<(String, Vec<f64>)>, ProgramError> {
    let nodes = scene.owned_nodes();
    let root = folder.join("checkpoint");
    let warn = |e: &CheckpointError| {
        if !matches!(e, CheckpointError::OtherRank) {
            log.line(&format!("warning: {e}; trying the one before"));
        }
    };
    let found = checkpoint::newest(&root, &nodes, &scene.communicator, warn);
    let (mut snapshot, moved) = agree(&scene.communicator, found.map_err(ProgramError::input))?;
    let arrays = std::mem::take(&mut snapshot.arrays);
    let restored = restore(scene, clock, snapshot);
    agree(&scene.communicator, restored)?;
    let linked = scene.linked.as_ref().map_or(0, LinkedSystem::fibres);
    let fibres = scene.fibres.as_ref().map_or(linked, FibreSystem::fibres);
    scene.fibre_count = scene.communicator.sum_count(fibres);
    if moved {
        let settled = scene.settle();
        agree(&scene.communicator, settled)?;
    }
    log.line(&format!(
        "resumed at step {}, time {:.6e} s",
        clock.step, clock.time
    ));
    Ok(arrays)
}

fn banner(case: &Case, communicator: &Communicator) -> String {
    let (version, commit) = (env!("CARGO_PKG_VERSION"), env!("FIBREFLOW_GIT_COMMIT"));
    let (ranks, threads) = (communicator.size(), rayon::current_num_threads());
    let title = if case.about.title.is_empty() {
        "no title"
    } else {
        &case.about.title
    };
    format!("fibreflow {version} ({commit}), ranks × threads: {ranks} × {threads}\n{title}")
}
