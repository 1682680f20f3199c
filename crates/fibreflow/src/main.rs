//! Flexible fibres in incompressible flow, two-way coupled.

use std::process::ExitCode;

fn main() -> ExitCode {
    fibreflow::start()
}
