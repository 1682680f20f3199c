//! Which checkpoints are complete, and how one becomes so.

use super::{CheckpointError, Snapshot, file};
use fibreflow_parallel::Communicator;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Complete checkpoints that are kept.
const KEPT: usize = 2;

/// Changes with the layout of what a checkpoint holds; 2: fibre records say whether a fibre is rigid.
const FORMAT: u32 = 5;

#[derive(Debug, Serialize, Deserialize)]
struct Index {
    format: u32,
    step: u64,
    files: Vec<Entry>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Entry {
    name: String,
    bytes: u64,
    crc32: u32,
}

fn folder_of(root: &Path, step: u64) -> PathBuf {
    root.join(format!("step_{step:08}"))
}

fn at(path: &Path) -> impl Fn(std::io::Error) -> CheckpointError {
    let path = path.display().to_string();
    move |source| CheckpointError::File {
        path: path.clone(),
        source,
    }
}

/// Writes a checkpoint into `root` and forgets older ones but the last two. Collective.
///
/// # Errors
/// [`CheckpointError`]; the checkpoint is then not complete and the one before it stays.
pub fn write(
    root: &Path,
    snapshot: &Snapshot,
    communicator: &Communicator,
) -> Result<(), CheckpointError> {
    let folder = folder_of(root, snapshot.step);
    let index = folder.join("index.json");
    let prepare = || {
        std::fs::create_dir_all(&folder).map_err(at(&folder))?;
        match std::fs::remove_file(&index) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(at(&index)(e)),
            _ => Ok(()),
        }
    };
    agree(
        communicator,
        if communicator.is_root() {
            prepare()
        } else {
            Ok(())
        },
    )?;

    let name = |rank: usize| format!("rank_{rank:04}.h5");
    let written = file::write(&folder.join(name(communicator.rank())), snapshot);
    let (result, seal) = match written {
        Ok(seal) => (Ok(()), [seal.bytes, u64::from(seal.crc)]),
        Err(e) => (Err(e), [0, 0]),
    };
    agree(communicator, result)?;
    let seals = communicator.all_gather(&seal);

    let finish = || {
        let entry = |(rank, seal): (usize, Vec<u64>)| Entry {
            name: name(rank),
            bytes: seal[0],
            crc32: seal[1] as u32,
        };
        let content = Index {
            format: FORMAT,
            step: snapshot.step,
            files: seals.into_iter().enumerate().map(entry).collect(),
        };
        let text = serde_json::to_string_pretty(&content).unwrap_or_default() + "\n";
        crate::output::replace_file(&index, text.as_bytes()).map_err(at(&index))?;
        for path in [folder.as_path(), root] {
            let sync = std::fs::File::open(path).and_then(|f| f.sync_all());
            sync.map_err(at(path))?;
        }
        forget_old(root)
    };
    agree(
        communicator,
        if communicator.is_root() {
            finish()
        } else {
            Ok(())
        },
    )
}

/// Removes what is older than the complete checkpoints that are kept.
fn forget_old(root: &Path) -> Result<(), CheckpointError> {
    let complete = |p: &&PathBuf| p.join("index.json").exists();
    let folders = folders(root)?;
    let Some(oldest) = folders.iter().filter(complete).nth(KEPT - 1) else {
        return Ok(());
    };
    for folder in folders.iter().filter(|f| *f < oldest) {
        std::fs::remove_dir_all(folder).map_err(at(folder))?;
    }
    Ok(())
}

/// Checkpoint folders, newest first.
fn folders(root: &Path) -> Result<Vec<PathBuf>, CheckpointError> {
    let entries = match std::fs::read_dir(root) {
        Ok(entries) => entries,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(e) => return Err(at(root)(e)),
    };
    let step = |path: &PathBuf| {
        let name = path.file_name()?.to_str()?;
        name.strip_prefix("step_")?.parse::<u64>().ok()
    };
    let paths = entries.filter_map(Result::ok).map(|e| e.path());
    let mut found: Vec<PathBuf> = paths.filter(|p| step(p).is_some()).collect();
    found.sort_by_key(|p| std::cmp::Reverse(step(p)));
    Ok(found)
}

/// Reads the newest complete checkpoint in `root`, and says whether records moved between ranks. Collective.
///
/// `nodes`: global indices of the nodes this rank owns. A checkpoint that is not complete is passed over in favour of
/// the one before; `passed_over` is told why.
///
/// # Errors
/// [`CheckpointError::Nothing`] without a checkpoint, [`CheckpointError::Incomplete`] when none is complete, and
/// whatever reading a complete one gives.
pub fn newest(
    root: &Path,
    nodes: &[u64],
    communicator: &Communicator,
    mut passed_over: impl FnMut(&CheckpointError),
) -> Result<(Snapshot, bool), CheckpointError> {
    let folders = folders(root)?;
    let mut last = CheckpointError::Nothing {
        path: root.display().to_string(),
    };
    for folder in folders {
        match agree(communicator, verify(&folder, communicator)) {
            Ok(files) => return read(&folder, files, nodes, communicator),
            Err(e) => {
                passed_over(&e);
                last = e;
            }
        }
    }
    Err(last)
}

/// Number of files of a complete checkpoint; every rank checks its share of them.
fn verify(folder: &Path, communicator: &Communicator) -> Result<usize, CheckpointError> {
    let incomplete = |reason: String| CheckpointError::Incomplete {
        path: folder.display().to_string(),
        reason,
    };
    let text = std::fs::read_to_string(folder.join("index.json"))
        .map_err(|e| incomplete(format!("index.json: {e}")))?;
    let index: Index =
        serde_json::from_str(&text).map_err(|e| incomplete(format!("index.json: {e}")))?;
    if index.files.is_empty() || index.format != FORMAT {
        return Err(incomplete("index.json has an unknown format".to_owned()));
    }
    for k in share(communicator, index.files.len()) {
        let entry = &index.files[k];
        let found = file::seal(&folder.join(&entry.name)).map_err(|e| incomplete(e.to_string()))?;
        if (found.bytes, found.crc) != (entry.bytes, entry.crc32) {
            let name = &entry.name;
            return Err(incomplete(format!(
                "{name} is damaged ({} of {} bytes, or another checksum)",
                found.bytes, entry.bytes
            )));
        }
    }
    Ok(index.files.len())
}

fn share(communicator: &Communicator, files: usize) -> impl Iterator<Item = usize> + use<> {
    (communicator.rank()..files).step_by(communicator.size())
}

fn read(
    folder: &Path,
    files: usize,
    nodes: &[u64],
    communicator: &Communicator,
) -> Result<(Snapshot, bool), CheckpointError> {
    let one = |k: usize| file::read(&folder.join(format!("rank_{k:04}.h5")));
    let pieces: Result<Vec<Snapshot>, _> = share(communicator, files).map(one).collect();
    let mut pieces = agree(communicator, pieces)?;
    let arrays = share_arrays(&mut pieces, communicator);
    let same = pieces.len() == 1 && pieces[0].nodes == nodes;
    let stays = files == communicator.size() && !communicator.any(!same);
    let snapshot = if stays {
        pieces.swap_remove(0)
    } else {
        let path = folder.display().to_string();
        Snapshot::redistributed(pieces, nodes, communicator, &path)?
    };
    Ok((Snapshot { arrays, ..snapshot }, !stays))
}

/// Lists of the first file, which the first rank reads, on all ranks. Collective.
fn share_arrays(pieces: &mut [Snapshot], communicator: &Communicator) -> Vec<(String, Vec<f64>)> {
    let mine = pieces.first_mut().map(|p| std::mem::take(&mut p.arrays));
    let mine = mine.unwrap_or_default();
    let names: Vec<(&str, usize)> = mine.iter().map(|(n, v)| (n.as_str(), v.len())).collect();
    let names = serde_json::to_vec(&names).unwrap_or_default();
    let names = communicator.broadcast(0, names);
    let words = mine.iter().flat_map(|(_, v)| v);
    let words = words.flat_map(|v| v.to_le_bytes()).collect();
    let words = communicator.broadcast(0, words);
    let names: Vec<(String, usize)> = serde_json::from_slice(&names).unwrap_or_default();
    let mut values = words
        .chunks_exact(8)
        .map(|w| f64::from_le_bytes(std::array::from_fn(|k| w[k])));
    let shared = names.into_iter();
    shared
        .map(|(name, length)| (name, values.by_ref().take(length).collect()))
        .collect()
}

/// The result, or an error on every rank when any has one. Collective.
fn agree<T>(
    communicator: &Communicator,
    result: Result<T, CheckpointError>,
) -> Result<T, CheckpointError> {
    let failed = communicator.any(result.is_err());
    match result {
        Ok(_) if failed => Err(CheckpointError::OtherRank),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checkpoint::tests::snapshot;

    fn kept(root: &Path) -> Vec<String> {
        let name = |p: &PathBuf| p.file_name().map(|n| n.to_string_lossy().into_owned());
        folders(root)
            .expect("folders")
            .iter()
            .filter_map(name)
            .collect()
    }

    #[test]
    fn the_newest_whole_one_is_read_back_bit_by_bit() {
        let folder = tempfile::tempdir().expect("folder");
        let (root, c) = (folder.path(), Communicator::single());
        let mut state = snapshot(0..20);
        state.arrays = vec![
            ("sums".into(), vec![0.1, -2.0, 1.0 / 3.0]),
            ("none".into(), vec![]),
        ];
        for step in [10, 20, 30] {
            state.step = step;
            write(root, &state, &c).expect("written");
        }
        assert_eq!(kept(root), ["step_00000030", "step_00000020"]);
        let (read, moved) = newest(root, &state.nodes, &c, |e| panic!("{e}")).expect("read");
        assert!(!moved && read == state);
        let mut backwards = state.nodes.clone();
        backwards.reverse();
        let (read, moved) = newest(root, &backwards, &c, |e| panic!("{e}")).expect("read");
        assert!(moved && read.arrays == state.arrays);
        assert_eq!(read.node_fields[0].values[..3], [19.0, 0.1 * 19.0, -19.0]);
    }

    #[test]
    fn a_damaged_one_is_passed_over_and_named() {
        let folder = tempfile::tempdir().expect("folder");
        let (root, c) = (folder.path(), Communicator::single());
        let mut state = snapshot(0..20);
        for step in [10, 20, 30] {
            state.step = step;
            write(root, &state, &c).expect("written");
        }
        std::fs::remove_file(folder_of(root, 30).join("index.json")).expect("removed");
        let mut complaints = Vec::new();
        let read =
            newest(root, &state.nodes, &c, |e| complaints.push(e.to_string())).expect("read");
        assert_eq!((read.0.step, complaints.len()), (20, 1));

        let victim = folder_of(root, 20).join("rank_0000.h5");
        let mut bytes = std::fs::read(&victim).expect("read");
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        std::fs::write(&victim, bytes).expect("written");
        let error = newest(root, &state.nodes, &c, |_| ()).expect_err("both are damaged");
        assert!(
            error.to_string().contains("rank_0000.h5 is damaged"),
            "{error}"
        );
    }
}
