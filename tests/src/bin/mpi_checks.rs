//! `mpirun -n N mpi_checks <name>`: runs one check on all ranks; exits non-zero with a message when it fails.

use fibreflow_parallel::Communicator;
use fibreflow_tests::checks::{CHECKS, Check};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

fn main() -> ExitCode {
    let name = std::env::args().nth(1).unwrap_or_default();
    let Some(&(_, check)) = CHECKS.iter().find(|(known, _)| *known == name) else {
        let names: Vec<&str> = CHECKS.iter().map(|(name, _)| *name).collect();
        eprintln!("no check `{name}`; there are {}", names.join(", "));
        return ExitCode::FAILURE;
    };
    match Communicator::world() {
        Ok(communicator) => run(&communicator, check),
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// A rank that fails stops the others, which would wait for it for ever.
fn run(communicator: &Communicator, check: Check) -> ExitCode {
    let outcome = catch_unwind(AssertUnwindSafe(|| check(communicator)));
    let failure = match outcome {
        Ok(Ok(())) => {
            communicator.barrier();
            return ExitCode::SUCCESS;
        }
        Ok(Err(error)) => error.to_string(),
        Err(_) => "panicked".to_owned(),
    };
    eprintln!(
        "rank {} of {}: {failure}",
        communicator.rank(),
        communicator.size()
    );
    communicator.abort(1)
}
