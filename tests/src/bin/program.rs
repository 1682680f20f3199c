//! The program itself, built here so that tests can start it.

use std::process::ExitCode;

fn main() -> ExitCode {
    fibreflow::start()
}
