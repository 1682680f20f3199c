//! Checkpoints: one HDF5 file a rank, and an index that is written last and alone makes them complete.
//!
//! `checkpoint/step_00000100/rank_0000.h5 … index.json`. Node fields are keyed by global node, pair fields are stored
//! row by row in the order of the dual geometry (by global column and image, so rows do not depend on the ranks), and
//! fibres are keyed by their global id: a run resumes on any number of ranks. On the same number of ranks nothing is
//! moved, and the run goes on bit by bit.

mod file;
mod index;
mod records;

pub use index::{newest, write};
pub use records::Records;

use fibreflow_parallel::Communicator;

/// A field on nodes: `width` numbers for every owned node.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeField {
    /// Name.
    pub name: String,
    /// Numbers per node.
    pub width: usize,
    /// Node by node.
    pub values: Vec<f64>,
}

/// A field on the pairs of owned nodes, in row order.
#[derive(Clone, Debug, PartialEq)]
pub struct PairField {
    /// Name.
    pub name: String,
    /// Row by row.
    pub values: Vec<f64>,
}

/// All that one rank saves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// Global index of every owned node.
    pub nodes: Vec<u64>,
    /// Fields on owned nodes.
    pub node_fields: Vec<NodeField>,
    /// Entries in the row of every owned node.
    pub row_lengths: Vec<u32>,
    /// Fields on pairs.
    pub pair_fields: Vec<PairField>,
    /// Fibres by global id, each a list of words.
    pub fibres: Records,
    /// Named numbers, the same on every rank.
    pub scalars: Vec<(String, f64)>,
    /// Named lists that belong to no rank; the first rank writes them, all get them back.
    pub arrays: Vec<(String, Vec<f64>)>,
    /// Step, the same on every rank.
    pub step: u64,
}

/// Why a checkpoint could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file system refused.
    #[error("{path}: {source}")]
    File {
        /// Which file.
        path: String,
        /// What it said.
        source: std::io::Error,
    },
    /// HDF5 refused.
    #[error("{path}: {reason}")]
    Hdf5 {
        /// Which file.
        path: String,
        /// What it said.
        reason: String,
    },
    /// Files are missing or damaged.
    #[error("checkpoint {path} is not complete: {reason}")]
    Incomplete {
        /// Which checkpoint.
        path: String,
        /// What is wrong.
        reason: String,
    },
    /// There is none.
    #[error("there is no checkpoint to resume from in {path}")]
    Nothing {
        /// Where they were looked for.
        path: String,
    },
    /// The checkpoint is of another case.
    #[error("checkpoint {path} does not fit this case: {reason}")]
    Foreign {
        /// Which checkpoint.
        path: String,
        /// What differs.
        reason: String,
    },
    /// Another rank failed; it has the reason.
    #[error("a checkpoint failed on another rank")]
    OtherRank,
}

impl Snapshot {
    /// The same state laid out for the nodes of this rank, gathered from `pieces` that any ranks have read. Collective.
    ///
    /// `nodes` are the global indices of the nodes this rank owns. Fibres stay with the rank that read them, in the
    /// order of their ids.
    ///
    /// # Errors
    /// [`CheckpointError::Foreign`] when a node is in no piece.
    pub fn redistributed(
        pieces: Vec<Self>,
        nodes: &[u64],
        communicator: &Communicator,
        path: &str,
    ) -> Result<Self, CheckpointError> {
        let foreign = |reason: String| CheckpointError::Foreign {
            path: path.to_owned(),
            reason,
        };
        let mut read = Records::default();
        let mut layout = pieces.first().map(Self::layout).unwrap_or_default();
        for piece in &pieces {
            piece.pack(&mut read);
        }
        // A rank that read nothing learns the layout from the first.
        layout = share_layout(communicator, layout);
        let mine = read.redistribute(nodes, communicator);
        if communicator.any(mine.is_none()) {
            return Err(foreign("it lacks nodes of this mesh".to_owned()));
        }
        let mut fibres = Records::default();
        for piece in pieces {
            fibres.extend(&piece.fibres);
        }
        fibres.sort();
        let mut result = layout.clone();
        result.nodes = nodes.to_vec();
        result.fibres = fibres;
        result
            .unpack(&mine.unwrap_or_default())
            .ok_or_else(|| foreign("a node's record has the wrong length".to_owned()))?;
        Ok(result)
    }

    /// Names, widths and scalars without the data.
    fn layout(&self) -> Self {
        let node = |f: &NodeField| NodeField {
            name: f.name.clone(),
            width: f.width,
            values: Vec::new(),
        };
        let pair = |f: &PairField| PairField {
            name: f.name.clone(),
            values: Vec::new(),
        };
        Self {
            node_fields: self.node_fields.iter().map(node).collect(),
            pair_fields: self.pair_fields.iter().map(pair).collect(),
            scalars: self.scalars.clone(),
            step: self.step,
            ..Self::default()
        }
    }

    /// One record a node: its node fields, then its rows.
    fn pack(&self, records: &mut Records) {
        let mut start = 0;
        for (i, &node) in self.nodes.iter().enumerate() {
            let row = start..start + self.row_lengths.get(i).map_or(0, |&n| n as usize);
            start = row.end;
            let fields = self.node_fields.iter();
            let values = fields.flat_map(|f| &f.values[i * f.width..(i + 1) * f.width]);
            let rows = self.pair_fields.iter().flat_map(|f| &f.values[row.clone()]);
            records.push(node, values.chain(rows).map(|v| v.to_bits()));
        }
    }

    fn unpack(&mut self, records: &Records) -> Option<()> {
        let width: usize = self.node_fields.iter().map(|f| f.width).sum();
        let pairs = self.pair_fields.len();
        for (_, words) in records.iter() {
            let rest = words.len().checked_sub(width)?;
            let row = rest.checked_div(pairs).unwrap_or(0);
            if row * pairs != rest {
                return None;
            }
            let mut values = words.iter().map(|&w| f64::from_bits(w));
            for field in &mut self.node_fields {
                field.values.extend(values.by_ref().take(field.width));
            }
            for field in &mut self.pair_fields {
                field.values.extend(values.by_ref().take(row));
            }
            self.row_lengths.push(row as u32);
        }
        Some(())
    }
}

/// The layout of the first rank that has one; ranks that read no file have none.
fn share_layout(communicator: &Communicator, layout: Snapshot) -> Snapshot {
    let text: Vec<(&str, usize)> = layout
        .node_fields
        .iter()
        .map(|f| (f.name.as_str(), f.width))
        .collect();
    let pairs: Vec<&str> = layout.pair_fields.iter().map(|f| f.name.as_str()).collect();
    let scalars: Vec<(&str, u64)> = layout
        .scalars
        .iter()
        .map(|(n, v)| (n.as_str(), v.to_bits()))
        .collect();
    // Rank 0 reads file 0, which always exists.
    let bytes = serde_json::to_vec(&(text, pairs, scalars, layout.step)).unwrap_or_default();
    let bytes = communicator.broadcast(0, bytes);
    type Shared = (Vec<(String, usize)>, Vec<String>, Vec<(String, u64)>, u64);
    let Ok((nodes, pairs, scalars, step)) = serde_json::from_slice::<Shared>(&bytes) else {
        return layout;
    };
    let node = |(name, width)| NodeField {
        name,
        width,
        values: Vec::new(),
    };
    let pair = |name| PairField {
        name,
        values: Vec::new(),
    };
    Snapshot {
        node_fields: nodes.into_iter().map(node).collect(),
        pair_fields: pairs.into_iter().map(pair).collect(),
        scalars: scalars
            .into_iter()
            .map(|(n, v)| (n, f64::from_bits(v)))
            .collect(),
        step,
        ..Snapshot::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn snapshot(nodes: std::ops::Range<u64>) -> Snapshot {
        let mut snapshot = Snapshot {
            nodes: nodes.clone().collect(),
            step: 7,
            scalars: vec![("time".into(), 0.1 + 0.2)],
            ..Snapshot::default()
        };
        let mut velocity = Vec::new();
        let mut flux = Vec::new();
        for n in nodes {
            velocity.extend([n as f64, 0.1 * n as f64, -(n as f64)]);
            snapshot.row_lengths.push(1 + (n % 3) as u32);
            flux.extend((0..=n % 3).map(|k| (n * 10 + k) as f64 / 7.0));
            snapshot
                .fibres
                .push(100 + n, [n, n + 1].into_iter().take(1 + n as usize % 2));
        }
        snapshot.node_fields.push(NodeField {
            name: "velocity".into(),
            width: 3,
            values: velocity,
        });
        snapshot.pair_fields.push(PairField {
            name: "flux".into(),
            values: flux,
        });
        snapshot
    }

    #[test]
    fn pieces_of_two_ranks_become_one_in_any_node_order() {
        let whole = snapshot(0..9);
        let pieces = vec![snapshot(5..9), snapshot(0..5)];
        let communicator = Communicator::single();
        let joined = Snapshot::redistributed(pieces, &whole.nodes, &communicator, "here")
            .expect("all there");
        assert_eq!(joined, whole);
    }

    #[test]
    fn a_missing_node_is_an_error() {
        let wanted: Vec<u64> = (0..9).collect();
        let error = Snapshot::redistributed(
            vec![snapshot(0..8)],
            &wanted,
            &Communicator::single(),
            "here",
        );
        assert!(matches!(error, Err(CheckpointError::Foreign { .. })));
    }
}
