//! `fibreflow post`: what is made of the results of a run.

use crate::case;
use crate::checkpoint;
use crate::error::{ProgramError, agree};
use crate::scene::{linked_settings, prescribed_box};
use fibreflow_fibre::linked::LinkedSystem;
use fibreflow_fibre::{FibreRecord, FibreState, Vector3};
use fibreflow_parallel::Communicator;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

/// Some fibres of the newest checkpoint of a run, and where their middles are, as a file of frames. Collective.
///
/// # Errors
/// A run without linked fibres, without a checkpoint; a file that cannot be written.
pub fn extract(
    run: &Path,
    out: &Path,
    which: impl Fn(&LinkedSystem) -> Vec<(usize, Vector3)>,
    communicator: &Communicator,
) -> Result<(), ProgramError> {
    let loaded = case::load(&run.join("case.toml"), &[]).map_err(ProgramError::from);
    let (case, _) = agree(communicator, loaded)?;
    let Some(settings) = linked_settings(&case, prescribed_box(&case)) else {
        let message = format!("{} has no linked fibres", run.display());
        return Err(ProgramError::input(message));
    };
    let found = checkpoint::newest(&run.join("checkpoint"), &[], communicator, |_| ());
    let (snapshot, _) = agree(communicator, found.map_err(ProgramError::input))?;
    let record = |(id, words): (u64, &[u64])| FibreRecord {
        id,
        words: words.to_vec(),
    };
    let state = FibreState {
        records: snapshot.fibres.iter().map(record).collect(),
        scalars: snapshot.scalars,
    };
    let mut system =
        LinkedSystem::new(communicator, settings, Vec::new()).map_err(ProgramError::input)?;
    system.restore(state).map_err(ProgramError::input)?;
    let fibres = which(&system);
    let mut text = String::from("fibre,x,y,z,q0,q1,q2,q3\n");
    for (fibre, middle) in &fibres {
        let nodes = &system.nodes()[system.offsets()[*fibre] + fibre..];
        let segments = system.offsets()[*fibre]..system.offsets()[fibre + 1];
        let shift = middle - system.centre(*fibre);
        for (k, s) in segments.enumerate() {
            let x = (nodes[k] + nodes[k + 1]) * 0.5 + shift;
            let q = system.frame(s);
            // A string takes all that is written.
            let _ = writeln!(
                text,
                "{fibre},{:e},{:e},{:e},{},{},{},{}",
                x.x, x.y, x.z, q.w, q.i, q.j, q.k
            );
        }
    }
    std::fs::write(out, text).map_err(|e| ProgramError::output(out, &e))?;
    // A closed pipe is no error of ours.
    let _ = writeln!(
        std::io::stdout(),
        "{}: {} of {} fibres, at {:.6e} s",
        out.display(),
        fibres.len(),
        system.fibres(),
        system.time()
    );
    Ok(())
}
