//! Starts programs, alone or on several ranks, with a time-out: a deadlock is a failing test.

use std::ffi::OsStr;
use std::fs::File;
use std::io::ErrorKind;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How a program ended, and what it printed.
#[derive(Debug)]
pub struct Ended {
    /// Exit status.
    pub status: ExitStatus,
    /// Standard output and error together.
    pub text: String,
}

/// A program that is started and ended by a test.
pub struct Job {
    child: Child,
    what: String,
    output: tempfile::TempDir,
}

/// The command that runs `program` on `ranks` ranks, one thread each; alone without `mpirun` in front.
pub fn command(program: impl AsRef<OsStr>, ranks: usize) -> Command {
    let mut command = if ranks > 1 {
        let mut command = Command::new("mpirun");
        command.args(["--oversubscribe", "--bind-to", "none", "-n"]);
        command.arg(ranks.to_string()).arg(program);
        command
    } else {
        Command::new(program)
    };
    command
        .envs([
            ("RAYON_NUM_THREADS", "1"),
            ("OMPI_ALLOW_RUN_AS_ROOT", "1"),
            ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"),
            ("OMPI_MCA_btl_vader_eager_limit", "65536"),
            // Ranks that wait give their core to the others.
            ("OMPI_MCA_mpi_yield_when_idle", "1"),
        ])
        .stdin(Stdio::null());
    command
}

/// Runs a command to its end; None, with a note, where there is no `mpirun`.
///
/// # Panics
/// Panics when it takes longer than `limit`.
pub fn run(command: Command, limit: Duration) -> Option<Ended> {
    // One job at a time: the ranks of one are already more than most machines that test have cores.
    static ONE: Mutex<()> = Mutex::new(());
    let _guard = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    start(command).map(|job| job.wait(limit))
}

/// Starts a command; None, with a note, where there is no `mpirun`.
///
/// # Panics
/// Panics when it cannot be started for another reason.
pub fn start(mut command: Command) -> Option<Job> {
    let what = format!("{command:?}");
    let output = tempfile::tempdir().expect("temporary folder");
    let file = File::create(output.path().join("output")).expect("output file");
    command
        .stdout(file.try_clone().expect("output file"))
        .stderr(file);
    match command.spawn() {
        Ok(child) => Some(Job {
            child,
            what,
            output,
        }),
        Err(error) if error.kind() == ErrorKind::NotFound && what.contains("mpirun") => {
            eprintln!("skipped: mpirun is not installed");
            None
        }
        Err(error) => panic!("{what}: {error}"),
    }
}

impl Job {
    /// What it has printed so far.
    pub fn text(&self) -> String {
        std::fs::read_to_string(self.output.path().join("output")).unwrap_or_default()
    }

    /// Sends a signal, by name, to the process (`mpirun` hands SIGTERM and SIGUSR1 on to its ranks).
    ///
    /// # Panics
    /// Panics when there is no shell to send it.
    pub fn signal(&self, name: &str) {
        // The shell's own `kill`: the program of that name is not on every machine.
        let line = format!("kill -s {name} {}", self.child.id());
        let sent = Command::new("sh").args(["-c", &line]).status();
        // The process may have ended by itself.
        sent.expect("a shell");
    }

    /// Waits for the end.
    ///
    /// # Panics
    /// Panics when it takes longer than `limit`.
    pub fn wait(mut self, limit: Duration) -> Ended {
        let start = Instant::now();
        while start.elapsed() < limit {
            if let Some(status) = self.child.try_wait().expect("child") {
                return Ended {
                    status,
                    text: self.text(),
                };
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        // On SIGTERM mpirun stops its ranks; killed outright it would leave them running.
        self.signal("TERM");
        std::thread::sleep(Duration::from_secs(2));
        let _ = self.child.kill();
        let _ = self.child.wait();
        panic!(
            "{} did not end within {limit:?}:\n{}",
            self.what,
            self.text()
        );
    }
}
