//! `fibreflow info`: what a file or folder is.

use crate::case;
use crate::error::ProgramError;
use fibreflow_mesh::{ElementKind, Mesh, foam, gmsh, vtk};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

/// Describes a case, mesh, run or checkpoint in a few lines.
///
/// # Errors
/// A file that cannot be read or is none of these.
pub fn info(path: &Path) -> Result<(), ProgramError> {
    let extension = path.extension().and_then(|e| e.to_str());
    let text = match extension {
        Some("toml") => about_case(path)?,
        Some("msh") => about_mesh(&gmsh::read(path)?),
        Some("vtu" | "vtk") => about_mesh(&vtk::read(path, &vtk::Options::default())?),
        Some("polyMesh") => about_mesh(&foam::read(path)?),
        Some("json") => read(path)?,
        _ if path.join("summary.json").exists() => read(&path.join("summary.json"))?,
        _ if path.join("index.json").exists() => read(&path.join("index.json"))?,
        _ if path.join("checkpoint").is_dir() => about_checkpoints(&path.join("checkpoint"))?,
        _ if path.ends_with("polyMesh") || path.join("constant/polyMesh").is_dir() => {
            about_mesh(&foam::read(path)?)
        }
        _ if path.ends_with("checkpoint") && path.is_dir() => about_checkpoints(path)?,
        _ => {
            return Err(ProgramError::input(format!(
                "{} is none of: case file (.toml), mesh (.msh, .vtu, .vtk, polyMesh), summary or manifest (.json), run folder, checkpoint folder",
                path.display()
            )));
        }
    };
    // A closed pipe is no error of ours.
    let _ = writeln!(std::io::stdout(), "{}", text.trim_end());
    Ok(())
}

fn read(path: &Path) -> Result<String, ProgramError> {
    let failed = |e| ProgramError::input(format!("{}: {e}", path.display()));
    std::fs::read_to_string(path).map_err(failed)
}

fn about_case(path: &Path) -> Result<String, ProgramError> {
    let (case, _) = case::load(path, &[])?;
    toml::to_string(&case).map_err(ProgramError::failed)
}

fn about_mesh(mesh: &Mesh) -> String {
    let mut text = format!(
        "{} nodes, {} elements:",
        mesh.nodes.len(),
        mesh.elements.len()
    );
    for kind in ElementKind::ALL {
        let count = mesh.elements.kinds.iter().filter(|k| **k == kind).count();
        if count > 0 {
            let _ = write!(text, " {count} {}", kind.name());
        }
    }
    for (index, patch) in mesh.patches.iter().enumerate() {
        let faces = mesh
            .boundary
            .iter()
            .filter(|f| usize::from(f.patch) == index)
            .count();
        let _ = write!(text, "\npatch {patch}: {faces} faces");
    }
    for vector in mesh.periods.vectors.iter().filter(|v| **v != [0.0; 3]) {
        let _ = write!(text, "\nperiodic: {vector:?} m");
    }
    let verdict = match fibreflow_mesh::validate(mesh) {
        Ok(()) => "valid".to_owned(),
        Err(e) => e.to_string(),
    };
    let _ = write!(text, "\n{verdict}");
    text
}

fn about_checkpoints(folder: &Path) -> Result<String, ProgramError> {
    let failed = |e: std::io::Error| ProgramError::input(format!("{}: {e}", folder.display()));
    let entries = std::fs::read_dir(folder).map_err(failed)?;
    let mut lines: Vec<String> = entries
        .filter_map(Result::ok)
        .map(|entry| {
            let complete = entry.path().join("index.json").exists();
            let state = if complete { "complete" } else { "not complete" };
            format!("{}: {state}", entry.file_name().to_string_lossy())
        })
        .collect();
    lines.sort();
    Ok(lines.join("\n"))
}
