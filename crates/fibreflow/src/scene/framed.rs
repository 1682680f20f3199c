//! Linked fibres from files: the middles of their segments and their frames.

use super::csv::Csv;
use crate::case::{FibreGroup, Quantity};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::path::Path;

/// A fibre by its segments.
#[derive(Clone, Debug, Default)]
pub struct Framed {
    /// Mean of the middles of the segments \[m\].
    pub centre: Vector3<f64>,
    /// Frames: the x axis turned into that of a segment.
    pub frames: Vec<UnitQuaternion<f64>>,
}

impl Framed {
    /// Nodes of a fibre with the length of the group \[m\].
    pub fn nodes(&self, group: &FibreGroup) -> Vec<Vector3<f64>> {
        let length = group.length.as_ref().and_then(Quantity::nominal);
        let step = length.unwrap_or(0.0) / self.frames.len() as f64;
        let mut nodes = vec![Vector3::zeros()];
        let mut middle = Vector3::zeros();
        for frame in &self.frames {
            let (node, along) = (nodes[nodes.len() - 1], frame * Vector3::x() * step);
            middle += node + along * 0.5;
            nodes.push(node + along);
        }
        let shift = self.centre - middle / self.frames.len() as f64;
        nodes.iter().map(|x| x + shift).collect()
    }
}

const COLUMNS: [&str; 8] = ["fibre", "x", "y", "z", "q0", "q1", "q2", "q3"];

/// The fibres of a CSV file in the order of their numbers.
///
/// # Errors
/// What is wrong with the file.
pub fn read(path: &Path) -> Result<Vec<Framed>, String> {
    let table = Csv::read(path, &COLUMNS)?;
    let mut columns = Vec::new();
    for name in COLUMNS {
        let column = table.column(name);
        columns.push(column.ok_or_else(|| format!("line 1: the column {name} is missing"))?);
    }
    let mut fibres: BTreeMap<i64, Framed> = BTreeMap::new();
    for line in 0..table.len() {
        let at = |c: usize| columns[c][line];
        if at(0).fract() != 0.0 || at(0).abs() > 1e15 {
            return Err(format!("`{}` is no number of a fibre", at(0)));
        }
        let q = Quaternion::new(at(4), at(5), at(6), at(7));
        if (q.norm() - 1.0).abs() > 1e-6 {
            return Err(format!(
                "line {}: the Euler parameters have no norm of 1",
                line + 2
            ));
        }
        let fibre = fibres.entry(at(0) as i64).or_default();
        fibre.centre += Vector3::new(at(1), at(2), at(3));
        fibre.frames.push(UnitQuaternion::new_normalize(q));
    }
    let mut all: Vec<Framed> = fibres.into_values().collect();
    for fibre in &mut all {
        fibre.centre /= fibre.frames.len() as f64;
    }
    Ok(all)
}
