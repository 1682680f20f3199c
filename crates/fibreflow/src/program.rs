//! The commands.

use crate::cli::{Cli, Command, PostCommand};
use crate::error::{FAILED, ProgramError, agree, report, stop_all};
use crate::{check, info, post, run, sweep};
use clap::Parser;
use fibreflow_fibre::linked::LinkedSystem;
use fibreflow_parallel::Communicator;
use std::process::ExitCode;

/// The whole program: starts MPI, does what the command line says; 0, 1 for a failed run, 2 for bad input.
pub fn start() -> ExitCode {
    let cli = Cli::try_parse();
    // A program that MPI has started must not start others.
    if let Ok(Cli {
        command: Command::Sweep(arguments),
    }) = &cli
    {
        return sweep::start(arguments);
    }
    match Communicator::world() {
        Ok(communicator) => ExitCode::from(execute(cli, &communicator)),
        Err(error) => {
            report(&ProgramError::failed(error));
            ExitCode::from(FAILED)
        }
    }
}

fn execute(cli: Result<Cli, clap::Error>, communicator: &Communicator) -> u8 {
    let cli = match cli {
        Ok(cli) => cli,
        Err(error) => {
            if communicator.is_root() {
                // Help and version are errors to clap too; nothing is left to do when they cannot be shown.
                let _ = error.print();
            }
            return error.exit_code() as u8;
        }
    };
    watch_panics(communicator);
    start_threads(communicator);
    let result = dispatch(&cli.command, communicator);
    // The hook holds the communicator, and MPI is finalised when the last one is dropped.
    drop(std::panic::take_hook());
    match result {
        Ok(()) => 0,
        Err(End::Together(error)) => {
            report(&error);
            error.code
        }
        Err(End::Alone(error)) => stop_all(communicator, &error),
    }
}

/// Threads of this rank, of which the one that runs the program is one: parallel loops start at once, without waking
/// another. As many as RAYON_NUM_THREADS says, else what the machine has for each rank.
fn start_threads(communicator: &Communicator) {
    let asked = std::env::var("RAYON_NUM_THREADS").ok();
    let asked = asked.and_then(|text| text.parse().ok()).filter(|&n| n > 0);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = asked.unwrap_or((cores / communicator.size()).max(1));
    // Where threads cannot be had the loops run on the default pool.
    let _ = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .use_current_thread()
        .build_global();
}

/// How an error ends the program.
enum End {
    /// Every rank has it.
    Together(ProgramError),
    /// Perhaps only this rank has it.
    Alone(ProgramError),
}

fn dispatch(command: &Command, communicator: &Communicator) -> Result<(), End> {
    let on_root = |work: &dyn Fn() -> Result<(), ProgramError>| {
        let result = if communicator.is_root() {
            work()
        } else {
            Ok(())
        };
        agree(communicator, result).map_err(End::Together)
    };
    match command {
        Command::Check(arguments) => check::check(arguments, communicator).map_err(End::Together),
        Command::Mesh(arguments) => check::mesh(arguments, communicator).map_err(End::Together),
        Command::Post {
            command: PostCommand::ExtractFloc { run, out },
        } => {
            post::extract(run, out, LinkedSystem::largest_floc, communicator).map_err(End::Together)
        }
        Command::Post {
            command: PostCommand::ExtractFibres { run, out },
        } => post::extract(run, out, LinkedSystem::in_box, communicator).map_err(End::Together),
        Command::Sweep(arguments) => on_root(&|| sweep::sweep(arguments)),
        Command::Info { file } => on_root(&|| info::info(file)),
        Command::Run(arguments) => {
            let prepared = run::prepare(arguments, communicator).map_err(End::Together)?;
            prepared.run().map_err(End::Alone)
        }
    }
}

/// A panic on one rank must not leave the others waiting.
fn watch_panics(communicator: &Communicator) {
    let (communicator, show) = (communicator.clone(), std::panic::take_hook());
    std::panic::set_hook(Box::new(move |details| {
        show(details);
        if communicator.size() > 1 {
            communicator.abort(i32::from(FAILED));
        }
    }));
}
