//! What the user sees, and the same in `run.log`.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::Path;
use std::time::Instant;

/// Lines to the terminal and to the log file; silent on all ranks but the first.
#[derive(Debug)]
pub struct Log {
    file: Option<File>,
    speaks: bool,
    start: Instant,
}

impl Log {
    /// A log of a rank; only the one that `speaks` writes.
    ///
    /// # Errors
    /// Any error of the file system.
    pub fn open(path: &Path, speaks: bool, resume: bool) -> std::io::Result<Self> {
        let file = if speaks {
            let mut options = OpenOptions::new();
            options.create(true).append(resume).truncate(!resume);
            Some(options.write(true).open(path)?)
        } else {
            None
        };
        Ok(Self {
            file,
            speaks,
            start: Instant::now(),
        })
    }

    /// A line for the terminal and the file. A log that cannot be written does not stop a run.
    pub fn line(&mut self, text: &str) {
        if self.speaks {
            let _ = writeln!(std::io::stdout(), "{text}");
            self.note(text);
        }
    }

    /// A line for the file alone.
    pub fn note(&mut self, text: &str) {
        if let Some(file) = &mut self.file {
            let _ = writeln!(file, "[{:10.3}] {text}", self.start.elapsed().as_secs_f64());
        }
    }

    /// Wall time since the log was opened \[s\].
    pub fn elapsed(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }
}

/// Adds a line to a log that another rank may hold; for the error that ends a run.
pub fn append(path: &Path, text: &str) {
    if let Ok(mut file) = OpenOptions::new().append(true).open(path) {
        let _ = writeln!(file, "error: {text}");
    }
}
