//! `fibreflow sweep`: runs of one case with other values, and a table of what they give.
//!
//! Every member is a `fibreflow run` in a process of its own, so that one that fails takes no other with it. What is done is
//! told from what members leave in their folders: the same command goes on after a sweep was stopped.

mod file;
mod member;
mod steady;
mod table;

use crate::cli::SweepArguments;
use crate::error::{ProgramError, report};
use crate::observe::watch_signals;
use file::Sweep;
use member::{Launch, Outcome};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use table::{Row, Table};

/// The whole command; 0, 1 where members failed or a signal came, 2 for bad input.
pub fn start(arguments: &SweepArguments) -> ExitCode {
    match sweep(arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            report(&error);
            ExitCode::from(error.code)
        }
    }
}

/// Runs the members that are not done, and writes the tables.
///
/// # Errors
/// A file that is wrong, members that failed or were stopped, files that cannot be written.
pub fn sweep(arguments: &SweepArguments) -> Result<(), ProgramError> {
    refuse_ranks()?;
    let sweep = Sweep::load(&arguments.file)?;
    let given = arguments.out.clone();
    let out = given.unwrap_or_else(|| default_folder(&arguments.file));
    std::fs::create_dir_all(&out).map_err(|e| ProgramError::output(&out, &e))?;
    let stop = watch_signals()?;
    let program = std::env::current_exe();
    let program = program.map_err(|e| ProgramError::failed(format!("where is fibreflow? {e}")))?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let launch = Launch {
        program,
        threads: (cores / arguments.jobs).max(1),
        retry: arguments.retry,
        stop: &stop,
    };
    say(&format!(
        "{} members of {}, {} at a time, in {}",
        sweep.members.len(),
        sweep.case.display(),
        arguments.jobs,
        out.display()
    ));
    let table = Mutex::new(Table::new(&sweep, &out));
    let result = run_all(&sweep, &out, arguments.jobs, &launch, &table);
    let table = table.into_inner().unwrap_or_else(PoisonError::into_inner);
    result?;
    if stop.load(Ordering::Relaxed) {
        return Err(ProgramError::failed(
            "stopped by a signal; the same command goes on",
        ));
    }
    let [failed, unfinished] = table.counts();
    say(&format!("{}", out.join("results.csv").display()));
    if failed + unfinished == 0 {
        return Ok(());
    }
    Err(ProgramError::failed(format!(
        "{failed} of {} members failed, {unfinished} are not at their end: see {}",
        sweep.members.len(),
        out.join("members.csv").display()
    )))
}

/// Brings all members to their end, so many at a time; the first error that is not a member's own stops them.
fn run_all(
    sweep: &Sweep,
    out: &Path,
    jobs: usize,
    launch: &Launch<'_>,
    table: &Mutex<Table<'_>>,
) -> Result<(), ProgramError> {
    let (next, broken) = (AtomicUsize::new(0), AtomicBool::new(false));
    let first_error = Mutex::new(None);
    let count = sweep.members.len();
    let one = |k: usize| -> Result<(), ProgramError> {
        let member = &sweep.members[k];
        let folder = out.join("members").join(&member.name);
        let outcome = launch.bring_to_end(sweep, member, &folder)?;
        let row = Row::of(sweep, outcome, &folder)?;
        let told = match &row.outcome {
            Outcome::Done => "done".to_owned(),
            Outcome::Failed(why) => format!("failed: {why}"),
            Outcome::Unfinished => "stopped".to_owned(),
        };
        say(&format!("[{}/{count}] {}: {told}", k + 1, member.name));
        let mut table = table.lock().unwrap_or_else(PoisonError::into_inner);
        table.put(k, row);
        table.write()
    };
    let work = || {
        while !broken.load(Ordering::Relaxed) && !launch.stop.load(Ordering::Relaxed) {
            let k = next.fetch_add(1, Ordering::Relaxed);
            if k >= count {
                break;
            }
            if let Err(error) = one(k) {
                broken.store(true, Ordering::Relaxed);
                let mut first = first_error.lock().unwrap_or_else(PoisonError::into_inner);
                first.get_or_insert(error);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            scope.spawn(work);
        }
    });
    let error = first_error.into_inner();
    match error.unwrap_or_else(PoisonError::into_inner) {
        Some(error) => Err(error),
        None => Ok(()),
    }
}

/// Members start as programs of their own, which a rank of a larger job may not do.
fn refuse_ranks() -> Result<(), ProgramError> {
    let ranks = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS"];
    let several = |name: &str| {
        let size = std::env::var(name).ok().and_then(|n| n.parse::<u32>().ok());
        size.is_some_and(|n| n > 1)
    };
    if ranks.into_iter().any(several) {
        return Err(ProgramError::input(
            "`fibreflow sweep` starts runs of its own: start it without mpirun, with `--jobs N` for N runs at a time",
        ));
    }
    Ok(())
}

/// `runs/FOLDER-NAME` with the folder and the name of the file.
fn default_folder(file: &Path) -> PathBuf {
    let absolute = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
    let folder = absolute.parent().and_then(Path::file_name);
    let parts = [folder, absolute.file_stem()];
    let names: Vec<_> = (parts.into_iter().flatten())
        .map(|name| name.to_string_lossy().into_owned())
        .collect();
    Path::new("runs").join(names.join("-"))
}

fn say(line: &str) {
    use std::io::Write;
    // A closed pipe is no error of ours.
    let _ = writeln!(std::io::stdout(), "{line}");
}
