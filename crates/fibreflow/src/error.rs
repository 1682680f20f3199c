//! Errors of the program: what is shown, which exit code, and how all ranks come to the same end.

use crate::case::CaseError;
use crate::checkpoint::CheckpointError;
use fibreflow_coupling::CouplingError;
use fibreflow_fibre::FibreError;
use fibreflow_fluid::FluidError;
use fibreflow_mesh::MeshError;
use fibreflow_parallel::Communicator;

/// Exit code of a run that failed.
pub const FAILED: u8 = 1;
/// Exit code of bad input.
pub const BAD_INPUT: u8 = 2;

/// An error that ends the program.
#[derive(Debug)]
pub struct ProgramError {
    /// One paragraph for the user; None on ranks that leave it to another to speak.
    pub message: Option<String>,
    /// Exit code: [`FAILED`] or [`BAD_INPUT`].
    pub code: u8,
    /// What the run found could not be kept; nothing is wrong with the run itself.
    pub unwritten: bool,
}

impl ProgramError {
    /// Something in the case, mesh or checkpoint is wrong.
    pub fn input(message: impl std::fmt::Display) -> Self {
        Self {
            message: Some(message.to_string()),
            code: BAD_INPUT,
            unwritten: false,
        }
    }

    /// The run itself failed.
    pub fn failed(message: impl std::fmt::Display) -> Self {
        Self {
            message: Some(message.to_string()),
            code: FAILED,
            unwritten: false,
        }
    }

    /// A file could not be written.
    pub fn output(path: &std::path::Path, error: &std::io::Error) -> Self {
        Self::unwritten(format!("{} cannot be written: {error}", path.display()))
    }

    /// A line of a series could not be written.
    pub fn series(error: std::io::Error) -> Self {
        Self::unwritten(format!("a series cannot be written: {error}"))
    }

    fn unwritten(message: String) -> Self {
        Self {
            unwritten: true,
            ..Self::failed(message)
        }
    }
}

impl From<Box<CaseError>> for ProgramError {
    fn from(error: Box<CaseError>) -> Self {
        Self::input(error.render().trim().trim_start_matches("× "))
    }
}

impl From<MeshError> for ProgramError {
    fn from(error: MeshError) -> Self {
        Self::input(error)
    }
}

impl From<FluidError> for ProgramError {
    fn from(error: FluidError) -> Self {
        Self::failed(error)
    }
}

impl From<FibreError> for ProgramError {
    fn from(error: FibreError) -> Self {
        Self::failed(error)
    }
}

impl From<CouplingError> for ProgramError {
    fn from(error: CouplingError) -> Self {
        Self::failed(error)
    }
}

impl From<CheckpointError> for ProgramError {
    fn from(error: CheckpointError) -> Self {
        Self::failed(error)
    }
}

/// The result, or an error on every rank when any rank has one; the lowest of those speaks. Collective.
///
/// # Errors
/// An error of this or another rank, with the largest code of any.
pub fn agree<T>(
    communicator: &Communicator,
    result: Result<T, ProgramError>,
) -> Result<T, ProgramError> {
    let rank = communicator.rank() as f64;
    let failed = result.is_err();
    let speaker = communicator.min(if failed { rank } else { f64::INFINITY });
    if speaker == f64::INFINITY {
        return result;
    }
    let code = result.as_ref().err().map_or(0, |e| e.code);
    let code = communicator.max(f64::from(code)) as u8;
    let unwritten = result.as_ref().err().is_some_and(|e| e.unwritten);
    let own = result.err().and_then(|e| e.message);
    let message = own.filter(|_| speaker == rank);
    Err(ProgramError {
        message,
        code,
        unwritten,
    })
}

/// Ends every rank after an error that perhaps only this one has seen. A rank that has nothing to say leaves the one
/// that has the time to say it.
pub fn stop_all(communicator: &Communicator, error: &ProgramError) -> ! {
    report(error);
    if error.message.is_none() {
        std::thread::sleep(std::time::Duration::from_secs(10));
    }
    communicator.abort(i32::from(error.code))
}

/// Shows the message, if this rank is the one to speak.
pub fn report(error: &ProgramError) {
    if let Some(message) = &error.message {
        use std::io::Write;
        // Nothing is left to be done when even this fails.
        let _ = writeln!(std::io::stderr(), "error: {message}");
    }
}
