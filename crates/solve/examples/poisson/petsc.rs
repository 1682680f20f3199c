//! PETSc's binary format: big-endian 32-bit integers and doubles, a matrix by rows (AIJ), then a vector.

use crate::Outcome;
use fibreflow_mesh::{DualGeometry, LocalMesh};
use std::fs::File;
use std::io::{BufWriter, Write};

const MATRIX: i32 = 1_211_216;
const VECTOR: i32 = 1_211_214;

/// The matrix of the diffusive weights and the right-hand side, on one rank.
pub fn write(path: &str, mesh: &LocalMesh, dual: &DualGeometry, rhs: &[f64]) -> Outcome {
    let nodes = rhs.len();
    if mesh.total() != nodes {
        return Err("only one rank can write the matrix".into());
    }
    let row = |i: usize| {
        let entries = dual.row(i);
        let weights = dual.faces[entries.clone()].iter().map(|f| f[3]);
        let pairs = dual.columns[entries]
            .iter()
            .map(|&j| j as usize)
            .zip(weights);
        let mut row: Vec<(usize, f64)> = pairs.filter(|&(j, w)| j != i && w != 0.0).collect();
        row.push((i, -row.iter().map(|e| e.1).sum::<f64>()));
        row.sort_by_key(|e| e.0);
        row
    };
    let mut file = BufWriter::new(File::create(path)?);
    let entries = (0..nodes).map(|i| row(i).len()).sum::<usize>();
    for number in [MATRIX, nodes as i32, nodes as i32, entries as i32] {
        file.write_all(&number.to_be_bytes())?;
    }
    for i in 0..nodes {
        file.write_all(&(row(i).len() as i32).to_be_bytes())?;
    }
    for (j, _) in (0..nodes).flat_map(row) {
        file.write_all(&(j as i32).to_be_bytes())?;
    }
    for (_, w) in (0..nodes).flat_map(row) {
        file.write_all(&(-w).to_be_bytes())?;
    }
    for number in [VECTOR, nodes as i32] {
        file.write_all(&number.to_be_bytes())?;
    }
    for value in rhs {
        file.write_all(&value.to_be_bytes())?;
    }
    Ok(file.flush()?)
}
