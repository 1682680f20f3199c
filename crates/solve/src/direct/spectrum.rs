//! Eigenvalues and eigenvectors of one direction: K v = λ H v.

use crate::SolveError;
use faer::{Mat, Side};
use fibreflow_mesh::Line;
use std::f64::consts::TAU;

/// How much the dual lengths and weights of a periodic line may differ to count as uniform: what it costs is one step
/// of refinement.
const UNIFORM: f64 = 1e-8;

/// Eigenvalues of the modes exp(2πi k a/n), k = 0 … n − 1, and the dual length \[m\]; None unless the line is periodic
/// and uniform.
pub(super) fn fourier(line: &Line) -> Option<(Vec<f64>, f64)> {
    let n = line.len();
    let mean = |values: &mut dyn Iterator<Item = f64>| -> Option<f64> {
        let values: Vec<f64> = values.collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let uniform = values.len() == n
            && values
                .iter()
                .all(|v| (v - mean).abs() <= UNIFORM * mean.abs());
        uniform.then_some(mean)
    };
    if !line.periodic || n == 0 {
        return None;
    }
    let norm = mean(&mut line.norm.iter().copied())?;
    let mut eigenvalues = vec![0.0; n];
    for distance in 1..=3 {
        let pairs = line.pairs.iter().filter(|p| p.distance == distance);
        if pairs.clone().next().is_none() {
            continue;
        }
        let stiffness = mean(&mut pairs.map(|p| p.stiffness))?;
        for (k, value) in eigenvalues.iter_mut().enumerate() {
            // 2 − 2 cos θ without cancellation; the angle reduced in integers.
            let turns = (k * distance as usize % n) as f64 / n as f64;
            let sine = (0.5 * TAU * turns).sin();
            *value += 4.0 * sine * sine * stiffness / norm;
        }
    }
    Some((eigenvalues, norm))
}

/// Eigenvalues, ascending, and eigenvectors V with VᵀHV = 1, one a column; rows of fixed ends are zero.
///
/// Without fixed ends the first pair is the constant and zero, exactly.
pub(super) fn dense(line: &Line, fixed: [bool; 2]) -> Result<(Vec<f64>, Mat<f64>), SolveError> {
    let first = usize::from(fixed[0]);
    let free = (line.len() - first).saturating_sub(usize::from(fixed[1]));
    let place = |i: usize| i.checked_sub(first).filter(|&i| i < free);
    let root: Vec<f64> = line.norm.iter().map(|h| h.sqrt()).collect();
    let mut matrix = Mat::<f64>::zeros(free, free);
    for pair in &line.pairs {
        let [a, b] = [pair.a as usize, line.other(pair)];
        if a == b {
            continue;
        }
        for (i, j) in [(a, b), (b, a)] {
            if let Some(row) = place(i) {
                matrix[(row, row)] += pair.stiffness / line.norm[i];
                if let Some(column) = place(j) {
                    matrix[(row, column)] -= pair.stiffness / (root[i] * root[j]);
                }
            }
        }
    }
    let failed = |_| SolveError::Eigenvectors { unknowns: free };
    let pairs = matrix.self_adjoint_eigen(Side::Lower).map_err(failed)?;
    let mut vectors = Mat::zeros(line.len(), free);
    for mode in 0..free {
        for i in 0..free {
            vectors[(first + i, mode)] = pairs.U()[(i, mode)] / root[first + i];
        }
    }
    let mut eigenvalues: Vec<f64> = (0..free)
        .map(|mode| rayleigh(line, &vectors, mode))
        .collect();
    if fixed == [false; 2] && free > 0 {
        let constant = line.norm.iter().sum::<f64>().sqrt().recip();
        (0..free).for_each(|i| vectors[(i, 0)] = constant);
        eigenvalues[0] = 0.0;
    }
    Ok((eigenvalues, vectors))
}

/// vᵀKv / vᵀHv from differences along the pairs: small eigenvalues keep their digits on lines of any stretching.
fn rayleigh(line: &Line, vectors: &Mat<f64>, mode: usize) -> f64 {
    let energy = |pair: &fibreflow_mesh::LinePair| {
        let jump = vectors[(pair.a as usize, mode)] - vectors[(line.other(pair), mode)];
        pair.stiffness * jump * jump
    };
    let weight = |(i, h): (usize, &f64)| h * vectors[(i, mode)] * vectors[(i, mode)];
    let energy: f64 = line.pairs.iter().map(energy).sum();
    energy / line.norm.iter().enumerate().map(weight).sum::<f64>()
}
