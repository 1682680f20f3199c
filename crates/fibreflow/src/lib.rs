//! The program: case file, time loop, output, checkpoint.

pub mod case;
