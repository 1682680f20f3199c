//! What a run writes: VTK, series, log, summary, manifest.

pub mod grid;
pub mod image;
pub mod log;
pub mod manifest;
pub mod series;
pub mod vtk;

use std::fs::File;
use std::io::Write;
use std::path::Path;

/// Writes a small file so that a reader sees the old or the new one, never half of it.
///
/// # Errors
/// Any error of the file system.
pub fn replace_file(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut name = path.as_os_str().to_owned();
    name.push(".partial");
    let mut file = File::create(&name)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    std::fs::rename(&name, path)
}
