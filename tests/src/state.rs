//! The state that a run has saved, gathered on one rank whatever the ranks of the run.

use fibreflow::checkpoint::{self, Snapshot};
use fibreflow_fibre::{FibreRecord, FibreSettings, FibreState, FibreSystem};
use fibreflow_parallel::Communicator;
use std::path::Path;

/// Velocity and pressure by global node, positions of fibre nodes by fibre.
pub struct State {
    /// All that was saved.
    pub snapshot: Snapshot,
    /// Velocity components of all nodes \[m/s\].
    pub velocity: Vec<f64>,
    /// Coordinates of all fibre nodes \[m\].
    pub fibres: Vec<f64>,
}

impl State {
    /// From the newest complete checkpoint of a run with so many fluid nodes.
    ///
    /// # Panics
    /// Panics when there is none or it cannot be read.
    pub fn of(run: &Path, nodes: usize) -> Self {
        let communicator = Communicator::single();
        let ids: Vec<u64> = (0..nodes as u64).collect();
        let root = run.join("checkpoint");
        let (mut snapshot, _) =
            checkpoint::newest(&root, &ids, &communicator, |_| ()).expect("checkpoint");
        snapshot.fibres.sort();
        let field = |name: &str| snapshot.node_fields.iter().find(|f| f.name.contains(name));
        let velocity = field("velocity").expect("velocity").values.clone();
        let record = |(id, words): (u64, &[u64])| FibreRecord {
            id,
            words: words.to_vec(),
        };
        let records = snapshot.fibres.iter().map(record).collect();
        let mut system = FibreSystem::new(communicator, FibreSettings::default(), Vec::new())
            .expect("an empty system");
        let scalars = snapshot.scalars.clone();
        system
            .restore(FibreState { records, scalars })
            .expect("records");
        let fibres = system
            .positions()
            .iter()
            .flat_map(|x| [x.x, x.y, x.z])
            .collect();
        Self {
            snapshot,
            velocity,
            fibres,
        }
    }

    /// Largest difference of velocities and of fibre positions, each by the largest value.
    ///
    /// # Panics
    /// Panics when the states are not of the same size.
    pub fn difference(&self, other: &Self) -> [f64; 2] {
        [
            relative(&self.velocity, &other.velocity),
            relative(&self.fibres, &other.fibres),
        ]
    }

    /// What differs in any bit, by name.
    pub fn bits_that_differ(&self, other: &Self) -> Vec<String> {
        let (a, b) = (&self.snapshot, &other.snapshot);
        let mut names = Vec::new();
        let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        for (f, g) in a.node_fields.iter().zip(&b.node_fields) {
            if bits(&f.values) != bits(&g.values) {
                names.push(f.name.clone());
            }
        }
        for (f, g) in a.pair_fields.iter().zip(&b.pair_fields) {
            if bits(&f.values) != bits(&g.values) {
                names.push(f.name.clone());
            }
        }
        for (f, g) in a.scalars.iter().zip(&b.scalars) {
            if f.0 != g.0 || f.1.to_bits() != g.1.to_bits() {
                names.push(format!("{} = {:e} and {:e}", f.0, f.1, g.1));
            }
        }
        if a.fibres != b.fibres {
            names.push("fibres".into());
        }
        names
    }
}

fn relative(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "states of different size");
    let largest = a.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let apart = a.iter().zip(b).map(|(x, y)| (x - y).abs());
    apart.fold(0.0, f64::max) / largest
}
