//! The program: case file, time loop, output, checkpoint.

pub mod case;
pub mod checkpoint;
pub mod clock;
pub mod error;
pub mod figures;
pub mod observe;
pub mod output;
pub mod run;
pub mod scene;
pub mod summary;

mod check;
mod cli;
mod describe;
mod forecast;
mod groups;
mod info;
mod post;
mod program;
mod sweep;

pub use program::start;
