//! The program: case file, time loop, output, checkpoint.

pub mod case;
pub mod checkpoint;
pub mod output;
