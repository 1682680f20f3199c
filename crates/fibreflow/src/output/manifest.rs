//! Provenance, written before the run: what ran, built how, on what.

use serde::Serialize;

/// What is needed to repeat a run. Names no host, user or path.
#[derive(Clone, Debug, Serialize)]
pub struct Manifest {
    /// Version of the program.
    pub version: &'static str,
    /// Commit it was built from; `unknown` outside a checkout.
    pub git_commit: &'static str,
    /// Build profile.
    pub profile: &'static str,
    /// Cargo features.
    pub features: Vec<&'static str>,
    /// Processor model.
    pub cpu: String,
    /// Ranks.
    pub ranks: usize,
    /// Threads of each rank.
    pub threads: usize,
    /// Checksum over node coordinates and elements; null without a mesh.
    pub mesh_checksum: Option<String>,
    /// Step from which the run was resumed.
    pub resumed_from_step: Option<u64>,
}

impl Manifest {
    /// What this program and machine are.
    pub fn new(ranks: usize, mesh_checksum: Option<u64>, resumed_from_step: Option<u64>) -> Self {
        let features = [
            ("mpi", cfg!(feature = "mpi")),
            ("hdf5-static", cfg!(feature = "hdf5-static")),
        ];
        Self {
            version: env!("CARGO_PKG_VERSION"),
            git_commit: env!("FIBREFLOW_GIT_COMMIT"),
            profile: env!("FIBREFLOW_PROFILE"),
            features: features.iter().filter(|f| f.1).map(|f| f.0).collect(),
            cpu: cpu_model(),
            ranks,
            threads: rayon::current_num_threads(),
            mesh_checksum: mesh_checksum.map(|c| format!("{c:016x}")),
            resumed_from_step,
        }
    }

    /// As indented JSON.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }
}

fn cpu_model() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = info.lines().find(|l| l.starts_with("model name"));
    let model = line.and_then(|l| l.split(':').nth(1)).map(str::trim);
    model.unwrap_or(std::env::consts::ARCH).to_owned()
}

/// FNV-1a: a checksum that needs no crate and is the same everywhere.
pub fn checksum(state: u64, bytes: &[u8]) -> u64 {
    let mix = |h: u64, b: &u8| (h ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3);
    bytes.iter().fold(state, mix)
}

/// Start of [`checksum`].
pub const CHECKSUM_START: u64 = 0xcbf2_9ce4_8422_2325;
