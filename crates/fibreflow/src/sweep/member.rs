//! One member: what its folder says of it, and its run.

use super::file::{Member, Sweep};
use crate::error::ProgramError;
use crate::output::replace_file;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How often a run is looked after.
const PAUSE: Duration = Duration::from_millis(20);

/// How a member stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It ran to its end.
    Done,
    /// Its run failed, with this to say.
    Failed(String),
    /// It was stopped, by a signal or its wall-time limit.
    Unfinished,
}

/// How members are started.
pub struct Launch<'a> {
    /// This program.
    pub program: PathBuf,
    /// Threads of one run, where the environment does not say.
    pub threads: usize,
    /// Whether members that failed before run again.
    pub retry: bool,
    /// Set when everything is to stop.
    pub stop: &'a AtomicBool,
}

impl Launch<'_> {
    /// Runs a member from where it is to its end, unless it is there already.
    ///
    /// # Errors
    /// Files that cannot be written, a program that cannot be started; not a run that fails.
    pub fn bring_to_end(
        &self,
        sweep: &Sweep,
        member: &Member,
        folder: &Path,
    ) -> Result<Outcome, ProgramError> {
        let output = |path: &Path| {
            let path = path.to_owned();
            move |e| ProgramError::output(&path, &e)
        };
        std::fs::create_dir_all(folder).map_err(output(folder))?;
        let path = folder.join("lock");
        let lock = File::create(&path).map_err(output(&path))?;
        // A run holds the lock as its input: one that a killed sweep has left is waited for.
        lock.lock().map_err(output(&path))?;

        let wanted = folder.join("member.toml");
        let same = std::fs::read_to_string(&wanted).is_ok_and(|text| text == member.resolved);
        if !same {
            // What is here is of another case.
            for name in ["member.toml", "summary.json", "failure.txt"] {
                remove(&folder.join(name)).map_err(output(folder))?;
            }
            let _ = std::fs::remove_dir_all(folder.join("checkpoint"));
            replace_file(&wanted, member.resolved.as_bytes()).map_err(output(&wanted))?;
        }
        if ended(folder) {
            return Ok(Outcome::Done);
        }
        let failure = folder.join("failure.txt");
        if let (Ok(why), false) = (std::fs::read_to_string(&failure), self.retry) {
            return Ok(Outcome::Failed(why));
        }
        remove(&failure).map_err(output(&failure))?;

        let complaint = folder.join("stderr.txt");
        let errors = File::create(&complaint).map_err(output(&complaint))?;
        let mut command = Command::new(&self.program);
        command.arg("run").arg(&sweep.case).arg("--out").arg(folder);
        for text in &member.overrides {
            command.arg("--set").arg(text);
        }
        if has_checkpoint(folder) {
            command.arg("--resume");
        }
        if std::env::var_os("RAYON_NUM_THREADS").is_none() {
            command.env("RAYON_NUM_THREADS", self.threads.to_string());
        }
        let child = command.stdin(lock).stdout(Stdio::null()).stderr(errors);
        let child = child.spawn().map_err(|e| {
            ProgramError::failed(format!("{} does not start: {e}", self.program.display()))
        })?;
        let status = self.wait(child)?;
        if ended(folder) {
            return Ok(Outcome::Done);
        }
        if status.success() || self.stop.load(Ordering::Relaxed) {
            return Ok(Outcome::Unfinished);
        }
        let said = std::fs::read_to_string(&complaint).unwrap_or_default();
        let why = match said.trim() {
            "" => status.to_string(),
            text => text.trim_start_matches("error: ").to_owned(),
        };
        replace_file(&failure, why.as_bytes()).map_err(output(&failure))?;
        Ok(Outcome::Failed(why))
    }

    /// Waits for the end of a run, which is asked to stop when everything is to.
    fn wait(&self, mut child: Child) -> Result<ExitStatus, ProgramError> {
        let failed = |e| ProgramError::failed(format!("a run cannot be waited for: {e}"));
        let mut asked = false;
        loop {
            if let Some(status) = child.try_wait().map_err(failed)? {
                return Ok(status);
            }
            if self.stop.load(Ordering::Relaxed) && !asked {
                asked = true;
                // The shell's own `kill`: the program of that name is not on every machine.
                let line = format!("kill {}", child.id());
                let asking = Command::new("sh").args(["-c", &line]).status();
                if !asking.is_ok_and(|status| status.success()) {
                    child.kill().map_err(failed)?;
                }
            }
            std::thread::sleep(PAUSE);
        }
    }
}

/// Whether a run went to its end.
fn ended(folder: &Path) -> bool {
    let text = std::fs::read_to_string(folder.join("summary.json")).unwrap_or_default();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
    summary["stopped_by"] == "end"
}

fn has_checkpoint(folder: &Path) -> bool {
    let entries = std::fs::read_dir(folder.join("checkpoint"));
    let mut entries = entries.into_iter().flatten().flatten();
    entries.any(|entry| entry.path().join("index.json").exists())
}

/// Removes a file that may be absent.
fn remove(path: &Path) -> std::io::Result<()> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(e),
        _ => Ok(()),
    }
}
