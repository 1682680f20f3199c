//! `fibreflow check` and `fibreflow mesh`.

use crate::case::{self, json_schema};
use crate::cli::{CheckArguments, MeshArguments};
use crate::describe::describe;
use crate::error::{ProgramError, agree};
use crate::forecast::forecast;
use crate::groups::groups;
use crate::output::grid::Grid;
use crate::scene::{Scene, build_mesh};
use fibreflow_parallel::Communicator;
use std::path::Path;

/// Checks a case: file, mesh, boundaries, initial field, fibres; then says how good the mesh is and what the run will cost.
/// Collective.
///
/// # Errors
/// What is wrong with it.
pub fn check(arguments: &CheckArguments, communicator: &Communicator) -> Result<(), ProgramError> {
    if arguments.schema {
        let text = serde_json::to_string_pretty(&json_schema()).unwrap_or_default();
        say(communicator, &text);
        return Ok(());
    }
    let Some(path) = &arguments.case else {
        return Err(ProgramError::input("a case file is needed"));
    };
    let loaded = case::load(path, &arguments.overrides).map_err(ProgramError::from);
    let (case, document) = agree(communicator, loaded)?;
    let mut scene = Scene::new(&case, &document, folder_of(path), communicator)?;
    say(communicator, &format!("{} is valid", path.display()));
    for line in describe(&scene, &case)
        .into_iter()
        .chain(groups(&scene, &case))
    {
        say(communicator, &line);
    }
    if let Some(fluid) = scene.flow.fluid() {
        let report = fibreflow_mesh::quality(fluid.mesh(), fluid.geometry());
        say(communicator, report.to_string().trim_end());
        for line in forecast(&mut scene, &case, &report)? {
            say(communicator, &line);
        }
    }
    Ok(())
}

/// Builds the mesh of a case, reports its quality and writes it. Collective.
///
/// # Errors
/// What is wrong with the case or its mesh; a file that cannot be written.
pub fn mesh(arguments: &MeshArguments, communicator: &Communicator) -> Result<(), ProgramError> {
    let loaded = case::load(&arguments.case, &arguments.overrides).map_err(ProgramError::from);
    let (case, document) = agree(communicator, loaded)?;
    let built = build_mesh(&case, &document, folder_of(&arguments.case), communicator)?;
    let Some(mesh) = built else {
        return Err(ProgramError::input(format!(
            "{} has no `[mesh]`",
            arguments.case.display()
        )));
    };
    let report = fibreflow_mesh::quality(&mesh.local, &mesh.geometry);
    say(communicator, report.to_string().trim_end());
    let path = if communicator.size() == 1 {
        arguments.out.clone()
    } else {
        arguments
            .out
            .with_extension(format!("{}.vtu", communicator.rank()))
    };
    let written = Grid::new(&mesh.local).piece(Vec::new()).write(&path);
    agree(
        communicator,
        written.map_err(|e| ProgramError::output(&path, &e)),
    )?;
    say(communicator, &format!("written: {}", path.display()));
    Ok(())
}

fn folder_of(case: &Path) -> &Path {
    case.parent().unwrap_or(Path::new("."))
}

fn say(communicator: &Communicator, text: &str) {
    use std::io::Write;
    if communicator.is_root() {
        // A closed pipe is no error of ours.
        let _ = writeln!(std::io::stdout(), "{text}");
    }
}
