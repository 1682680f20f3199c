//! Command line.

use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Flexible fibres in incompressible flow, two-way coupled.
#[derive(Debug, Parser)]
#[command(name = "fibreflow", version)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Runs a case.
    Run(RunArguments),
    /// Checks a case file and its mesh without running it.
    Check(CheckArguments),
    /// Builds the mesh of a case, reports its quality and writes it as VTK.
    Mesh(MeshArguments),
    /// Runs a case with other values of some keys, and makes a table of what they give.
    Sweep(SweepArguments),
    /// Makes something of the results of a run.
    Post {
        /// What.
        #[command(subcommand)]
        command: PostCommand,
    },
    /// Says what a file or folder is: case, mesh, checkpoint or run.
    Info {
        /// A `.toml`, `.msh`, `.vtu`, `.vtk` or `.json` file, a run folder, an OpenFOAM case or a checkpoint folder.
        file: PathBuf,
    },
}

/// Arguments of `run`.
#[derive(Debug, Args)]
pub struct RunArguments {
    /// Case file.
    pub case: PathBuf,
    /// Folder for the output [default: runs/NAME, with NAME from the folder of the case file].
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Stop when so many steps are done, counted from the start of the case.
    #[arg(long)]
    pub steps: Option<u64>,
    /// Change a key of the case, as in `fluid.viscosity=1e-3` or `fibres.0.placement.count=10`.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,
    /// Go on from the newest complete checkpoint in the output folder.
    #[arg(long)]
    pub resume: bool,
}

/// Arguments of `sweep`.
#[derive(Debug, Args)]
pub struct SweepArguments {
    /// TOML file with the case and what varies.
    pub file: PathBuf,
    /// Folder for members and tables [default: runs/FOLDER-NAME, with the folder and the name of the file].
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Runs at a time.
    #[arg(long, default_value = "1", value_parser = at_least_one)]
    pub jobs: usize,
    /// Run members again that failed before.
    #[arg(long)]
    pub retry: bool,
}

fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(n) if n > 0 => Ok(n),
        _ => Err("a whole number, at least 1".to_owned()),
    }
}

/// Arguments of `check`.
#[derive(Debug, Args)]
pub struct CheckArguments {
    /// Case file.
    #[arg(required_unless_present = "schema")]
    pub case: Option<PathBuf>,
    /// Change a key of the case.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,
    /// Print the JSON schema of case files, for editors.
    #[arg(long)]
    pub schema: bool,
}

/// Arguments of `mesh`.
#[derive(Debug, Args)]
pub struct MeshArguments {
    /// Case file.
    pub case: PathBuf,
    /// File to write.
    #[arg(long, default_value = "mesh.vtu")]
    pub out: PathBuf,
    /// Change a key of the case.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,
}

/// What to make of the results of a run.
#[derive(Debug, Subcommand)]
pub enum PostCommand {
    /// Writes the largest floc of linked fibres of the newest checkpoint, about the origin, as a file for `placement.kind = "frames"`.
    ExtractFloc {
        /// Folder of the run.
        run: PathBuf,
        /// CSV file to write.
        out: PathBuf,
    },
    /// Writes all linked fibres of the newest checkpoint, each where its middle lies in the periodic box, as such a file.
    ExtractFibres {
        /// Folder of the run.
        run: PathBuf,
        /// CSV file to write.
        out: PathBuf,
    },
}
