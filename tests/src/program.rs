//! The program under test: case files in a temporary folder, runs, what they leave.

use crate::launch::{self, Ended, Job};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Longest run of a test.
pub const LIMIT: Duration = Duration::from_secs(30);

/// A folder with a case file, and the program to run it.
pub struct Bench {
    folder: tempfile::TempDir,
    program: PathBuf,
}

impl Bench {
    /// A folder with `case.toml`.
    ///
    /// # Panics
    /// Panics when files cannot be written.
    pub fn new(program: &str, case: &str) -> Self {
        let folder = tempfile::tempdir().expect("temporary folder");
        std::fs::write(folder.path().join("case.toml"), case).expect("case file");
        Self {
            folder,
            program: program.into(),
        }
    }

    /// A path in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The command `run case.toml --out NAME` on so many ranks.
    pub fn command(&self, ranks: usize, out: &str) -> Command {
        let mut command = launch::command(&self.program, ranks);
        command.arg("run").arg(self.path("case.toml"));
        command.arg("--out").arg(self.path(out));
        command
    }

    /// Runs to the end; None where there is no `mpirun`.
    pub fn run(&self, ranks: usize, out: &str, arguments: &[&str]) -> Option<Ended> {
        let mut command = self.command(ranks, out);
        command.args(arguments);
        launch::run(command, LIMIT)
    }

    /// Starts a run; None where there is no `mpirun`.
    pub fn start(&self, ranks: usize, out: &str, arguments: &[&str]) -> Option<Job> {
        let mut command = self.command(ranks, out);
        command.args(arguments);
        launch::start(command)
    }

    /// `summary.json` of a run.
    ///
    /// # Panics
    /// Panics when there is none.
    pub fn summary(&self, out: &str) -> serde_json::Value {
        let text = std::fs::read_to_string(self.path(out).join("summary.json")).expect("summary");
        serde_json::from_str(&text).expect("JSON")
    }

    /// Folder of the newest checkpoint of a run.
    ///
    /// # Panics
    /// Panics when there is none.
    pub fn newest_checkpoint(&self, out: &str) -> PathBuf {
        let folder = self.path(out).join("checkpoint");
        let entries = std::fs::read_dir(folder).expect("checkpoints");
        let paths = entries.filter_map(Result::ok).map(|e| e.path());
        let complete = paths.filter(|p: &PathBuf| p.join("index.json").exists());
        complete.max().expect("a complete checkpoint")
    }
}

/// All files of a folder with their content, sorted by name.
///
/// # Panics
/// Panics when they cannot be read.
pub fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<(String, Vec<u8>)> = std::fs::read_dir(folder)
        .expect("folder")
        .filter_map(Result::ok)
        .map(|e| {
            let name = e.file_name().to_string_lossy().into_owned();
            (name, std::fs::read(e.path()).expect("file"))
        })
        .collect();
    files.sort();
    files
}
