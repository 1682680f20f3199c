//! One rank's HDF5 file.

use super::{CheckpointError, NodeField, PairField, Records, Snapshot};
use hdf5::types::VarLenUnicode;
use std::path::Path;

const ARRAYS: &str = "arrays";

/// Bytes and checksum of a finished file, for the index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seal {
    pub bytes: u64,
    pub crc: u32,
}

/// Writes a snapshot and brings it to the disk.
pub fn write(path: &Path, snapshot: &Snapshot) -> Result<Seal, CheckpointError> {
    write_hdf5(path, snapshot).map_err(|e| refused(path, &e))?;
    let failed = |source| CheckpointError::File {
        path: path.display().to_string(),
        source,
    };
    std::fs::File::open(path)
        .and_then(|f| f.sync_all())
        .map_err(failed)?;
    seal(path)
}

/// Length and checksum of a file.
pub fn seal(path: &Path) -> Result<Seal, CheckpointError> {
    let bytes = std::fs::read(path).map_err(|source| CheckpointError::File {
        path: path.display().to_string(),
        source,
    })?;
    let mut crc = flate2::Crc::new();
    crc.update(&bytes);
    Ok(Seal {
        bytes: bytes.len() as u64,
        crc: crc.sum(),
    })
}

/// Reads a snapshot.
pub fn read(path: &Path) -> Result<Snapshot, CheckpointError> {
    let snapshot = read_hdf5(path).map_err(|e| refused(path, &e))?;
    snapshot.ok_or_else(|| CheckpointError::Hdf5 {
        path: path.display().to_string(),
        reason: "its arrays do not fit together".to_owned(),
    })
}

fn refused(path: &Path, error: &hdf5::Error) -> CheckpointError {
    CheckpointError::Hdf5 {
        path: path.display().to_string(),
        reason: error.to_string(),
    }
}

fn write_hdf5(path: &Path, snapshot: &Snapshot) -> hdf5::Result<()> {
    let file = hdf5::File::create(path)?;
    put_scalar(&file, "step", snapshot.step)?;

    let nodes = file.create_group("nodes")?;
    put(&nodes, "global_index", &snapshot.nodes)?;
    put(&nodes, "row_length", &snapshot.row_lengths)?;
    let fields = nodes.create_group("fields")?;
    for (k, field) in snapshot.node_fields.iter().enumerate() {
        let shape = (snapshot.nodes.len(), field.width);
        let dataset = fields
            .new_dataset::<f64>()
            .shape(shape)
            .create(key(k).as_str())?;
        dataset.write_raw(&field.values)?;
        put_name(&dataset, &field.name)?;
    }
    let pairs = file.create_group("pairs")?;
    for (k, field) in snapshot.pair_fields.iter().enumerate() {
        let dataset = put(&pairs, &key(k), &field.values)?;
        put_name(&dataset, &field.name)?;
    }

    let fibres = file.create_group("fibres")?;
    let (ids, offsets, words) = snapshot.fibres.parts();
    put(&fibres, "id", ids)?;
    put(&fibres, "offset", offsets)?;
    put(&fibres, "words", words)?;

    let scalars = file.create_group("scalars")?;
    for (name, value) in &snapshot.scalars {
        put_scalar(&scalars, name, *value)?;
    }
    let arrays = file.create_group(ARRAYS)?;
    for (k, (name, values)) in snapshot.arrays.iter().enumerate() {
        let dataset = put(&arrays, &key(k), values)?;
        put_name(&dataset, name)?;
    }
    file.flush()
}

fn read_hdf5(path: &Path) -> hdf5::Result<Option<Snapshot>> {
    let file = hdf5::File::open(path)?;
    let nodes = file.group("nodes")?;
    let fields = nodes.group("fields")?;
    let mut node_fields = Vec::new();
    for name in sorted_members(&fields)? {
        let dataset = fields.dataset(&name)?;
        node_fields.push(NodeField {
            name: name_of(&dataset)?,
            width: dataset.shape().get(1).copied().unwrap_or(1),
            values: dataset.read_raw()?,
        });
    }
    let pairs = file.group("pairs")?;
    let mut pair_fields = Vec::new();
    for name in sorted_members(&pairs)? {
        let dataset = pairs.dataset(&name)?;
        pair_fields.push(PairField {
            name: name_of(&dataset)?,
            values: dataset.read_raw()?,
        });
    }
    let fibres = file.group("fibres")?;
    let words = |name| fibres.dataset(name)?.read_raw::<u64>();
    let Some(records) = Records::from_parts(words("id")?, words("offset")?, words("words")?) else {
        return Ok(None);
    };
    let group = file.group("scalars")?;
    let mut scalars = Vec::new();
    for name in group.attr_names()? {
        let value = group.attr(&name)?.read_scalar::<f64>()?;
        scalars.push((name, value));
    }
    let mut arrays = Vec::new();
    // Checkpoints of versions without statistics have no such group.
    if file.link_exists(ARRAYS) {
        let group = file.group(ARRAYS)?;
        for name in sorted_members(&group)? {
            let dataset = group.dataset(&name)?;
            arrays.push((name_of(&dataset)?, dataset.read_raw()?));
        }
    }
    let snapshot = Snapshot {
        nodes: nodes.dataset("global_index")?.read_raw()?,
        node_fields,
        row_lengths: nodes.dataset("row_length")?.read_raw()?,
        pair_fields,
        fibres: records,
        scalars,
        arrays,
        step: file.attr("step")?.read_scalar()?,
    };
    Ok(fits(&snapshot).then_some(snapshot))
}

fn fits(snapshot: &Snapshot) -> bool {
    let nodes = snapshot.nodes.len();
    let pairs: usize = snapshot.row_lengths.iter().map(|&n| n as usize).sum();
    let node_fields = snapshot.node_fields.iter();
    let pair_fields = snapshot.pair_fields.iter();
    snapshot.row_lengths.len() == nodes
        && node_fields
            .map(|f| (f.values.len(), f.width))
            .all(|(n, w)| n == nodes * w)
        && pair_fields.map(|f| f.values.len()).all(|n| n == pairs)
}

/// Datasets are numbered, so that fields come back in the order in which they were saved.
fn key(k: usize) -> String {
    format!("{k:03}")
}

fn sorted_members(group: &hdf5::Group) -> hdf5::Result<Vec<String>> {
    let mut names = group.member_names()?;
    names.sort();
    Ok(names)
}

fn put<T: hdf5::H5Type>(
    group: &hdf5::Group,
    name: &str,
    values: &[T],
) -> hdf5::Result<hdf5::Dataset> {
    let dataset = group.new_dataset::<T>().shape(values.len()).create(name)?;
    dataset.write_raw(values)?;
    Ok(dataset)
}

fn put_scalar<T: hdf5::H5Type>(group: &hdf5::Group, name: &str, value: T) -> hdf5::Result<()> {
    group.new_attr::<T>().create(name)?.write_scalar(&value)
}

fn put_name(dataset: &hdf5::Dataset, name: &str) -> hdf5::Result<()> {
    let text: VarLenUnicode = name.parse().map_err(|_| "a name with a zero byte")?;
    dataset
        .new_attr::<VarLenUnicode>()
        .create("name")?
        .write_scalar(&text)
}

fn name_of(dataset: &hdf5::Dataset) -> hdf5::Result<String> {
    Ok(dataset
        .attr("name")?
        .read_scalar::<VarLenUnicode>()?
        .to_string())
}
