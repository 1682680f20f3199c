//! Transforms of a plane of two directions to modes and back.

use super::fourier::{ComplexLines, RealLines, Scratch};
use super::spectrum;
use crate::SolveError;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use fibreflow_mesh::Line;

/// Planes of `counts[1]` rows of `counts[0]` values to modes: Fourier where a direction is uniform and periodic (the
/// first one then is), else eigenvectors.
///
/// | directions | modes | order |
/// |---|---|---|
/// | Fourier, Fourier | complex, (n_a/2 + 1) × n_b | b fastest |
/// | Fourier, eigenvectors | complex, (n_a/2 + 1) × m_b | a fastest |
/// | eigenvectors, eigenvectors | real, m_a × m_b | a fastest |
/// | without coupling | the values by √(H_a H_b), n_a × n_b, zero at fixed ends | a fastest |
pub(super) struct PlaneTransform {
    pub counts: [usize; 2],
    first: First,
    second: Second,
    /// λ_a + λ_b of every mode.
    pub eigenvalues: Vec<f64>,
    /// Forth and back multiply by the inverse of this and by H of the Fourier directions.
    pub scale: f64,
}

enum First {
    Fourier(RealLines),
    Dense(Mat<f64>),
    Diagonal(Vec<f64>),
}

enum Second {
    Fourier(ComplexLines),
    Dense(Mat<f64>),
    Diagonal(Vec<f64>),
}

/// Room for the transform of one plane.
#[derive(Clone, Debug, Default)]
pub(super) struct Room {
    /// Values, row-major (n_b, n_a).
    pub values: Vec<f64>,
    /// After the first direction, row-major (n_b, ·).
    half: Vec<f64>,
    /// See [`PlaneTransform`]; complex ones interleaved.
    pub modes: Vec<f64>,
    scratch: Scratch,
}

impl PlaneTransform {
    /// Of two lines with their fixed ends. A Fourier direction, if any, must come first.
    pub fn new(lines: [&Line; 2], fixed: [[bool; 2]; 2]) -> Result<Self, SolveError> {
        let counts = lines.map(Line::len);
        let mut scale = 1.0;
        let mut fourier = |line: &Line| {
            let (eigenvalues, norm) = spectrum::fourier(line)?;
            scale /= norm * line.len() as f64;
            Some(eigenvalues)
        };
        let lines_a = RealLines::new(counts[0]).and_then(|t| Some((t, fourier(lines[0])?)));
        let (first, a) = match lines_a {
            Some((transform, mut eigenvalues)) => {
                eigenvalues.truncate(counts[0] / 2 + 1);
                (First::Fourier(transform), eigenvalues)
            }
            None => {
                let (eigenvalues, vectors) = spectrum::dense(lines[0], fixed[0])?;
                (First::Dense(vectors), eigenvalues)
            }
        };
        let lines_b = match first {
            First::Fourier(_) => {
                ComplexLines::new(counts[1]).and_then(|t| Some((t, fourier(lines[1])?)))
            }
            First::Dense(_) | First::Diagonal(_) => None,
        };
        let (second, b, b_is_fastest) = match lines_b {
            Some((transform, eigenvalues)) => (Second::Fourier(transform), eigenvalues, true),
            None => {
                let (eigenvalues, vectors) = spectrum::dense(lines[1], fixed[1])?;
                (Second::Dense(vectors), eigenvalues, false)
            }
        };
        let eigenvalues = if b_is_fastest {
            a.iter()
                .flat_map(|a| b.iter().map(move |b| a + b))
                .collect()
        } else {
            b.iter()
                .flat_map(|b| a.iter().map(move |a| a + b))
                .collect()
        };
        Ok(Self {
            counts,
            first,
            second,
            eigenvalues,
            scale,
        })
    }

    /// Of two lines whose K is left out: every mode is a node.
    pub fn diagonal(lines: [&Line; 2], fixed: [[bool; 2]; 2]) -> Self {
        let roots = |line: &Line, fixed: [bool; 2]| {
            let mut roots: Vec<f64> = line.norm.iter().map(|h| h.sqrt().recip()).collect();
            if let ([.., last], true) = (&mut roots[..], fixed[1]) {
                *last = 0.0;
            }
            if let ([first, ..], true) = (&mut roots[..], fixed[0]) {
                *first = 0.0;
            }
            roots
        };
        let counts = lines.map(Line::len);
        Self {
            counts,
            first: First::Diagonal(roots(lines[0], fixed[0])),
            second: Second::Diagonal(roots(lines[1], fixed[1])),
            eigenvalues: vec![0.0; counts[0] * counts[1]],
            scale: 1.0,
        }
    }

    /// True when a mode is a complex number.
    pub fn is_complex(&self) -> bool {
        matches!(self.first, First::Fourier(_))
    }

    /// True when constants are in the first mode only.
    pub fn is_fourier(&self) -> bool {
        matches!(self.second, Second::Fourier(_))
    }

    /// What the directions are transformed by.
    pub fn names(&self) -> [&'static str; 2] {
        let first = match self.first {
            First::Fourier(_) => "FFT",
            First::Dense(_) => "eigenvectors",
            First::Diagonal(_) => "uncoupled",
        };
        let second = match self.second {
            Second::Fourier(_) => "FFT",
            Second::Dense(_) => "eigenvectors",
            Second::Diagonal(_) => "uncoupled",
        };
        [first, second]
    }

    /// Floating-point operations of one transform: 5 n log₂ n of a complex Fourier transform, half of it for a real
    /// one, 2 n m of a product with eigenvectors.
    pub fn operations(&self) -> f64 {
        let [n_a, n_b] = self.counts.map(|n| n as f64);
        let lanes = if self.is_complex() { 2.0 } else { 1.0 };
        let first = match &self.first {
            First::Fourier(_) => 2.5 * n_a * n_a.log2() * n_b,
            First::Dense(v) => 2.0 * n_a * v.ncols() as f64 * n_b,
            First::Diagonal(_) => n_a * n_b,
        };
        let rows = lanes * self.width() as f64;
        let second = match &self.second {
            Second::Fourier(_) => 0.5 * rows * 5.0 * n_b * n_b.log2(),
            Second::Dense(v) => 2.0 * n_b * v.ncols() as f64 * rows,
            Second::Diagonal(_) => n_a * n_b,
        };
        first + second
    }

    /// Modes of the first direction.
    fn width(&self) -> usize {
        match &self.first {
            First::Fourier(_) => self.counts[0] / 2 + 1,
            First::Dense(vectors) => vectors.ncols(),
            First::Diagonal(roots) => roots.len(),
        }
    }

    /// Room for one plane.
    pub fn room(&self) -> Room {
        let lanes = if self.is_complex() { 2 } else { 1 };
        let first = match &self.first {
            First::Fourier(lines) => lines.scratch(),
            First::Dense(_) | First::Diagonal(_) => 0,
        };
        let second = match &self.second {
            Second::Fourier(lines) => lines.scratch(),
            Second::Dense(_) | Second::Diagonal(_) => 0,
        };
        Room {
            values: vec![0.0; self.counts[0] * self.counts[1]],
            half: vec![0.0; lanes * self.width() * self.counts[1]],
            modes: vec![0.0; lanes * self.eigenvalues.len()],
            scratch: vec![Default::default(); first.max(second)],
        }
    }

    /// From `values` to `modes`; destroys `values`.
    pub fn forward(&self, room: &mut Room) {
        let ([n_a, n_b], width) = (self.counts, self.width());
        match &self.first {
            First::Fourier(lines) => {
                lines.forward(&mut room.values, &mut room.half, &mut room.scratch);
            }
            First::Dense(vectors) => {
                let values = MatRef::from_row_major_slice(&room.values, n_b, n_a);
                let half = MatMut::from_row_major_slice_mut(&mut room.half, n_b, width);
                matmul(half, Accum::Replace, values, vectors, 1.0, Par::Seq);
            }
            First::Diagonal(roots) => scale_columns(roots, &room.values, &mut room.half),
        }
        match &self.second {
            Second::Fourier(lines) => {
                transpose(&room.half, &mut room.modes, n_b, width);
                lines.forward(&mut room.modes, &mut room.scratch);
            }
            Second::Dense(vectors) => {
                let columns = room.half.len() / n_b;
                let half = MatRef::from_row_major_slice(&room.half, n_b, columns);
                let modes =
                    MatMut::from_row_major_slice_mut(&mut room.modes, vectors.ncols(), columns);
                matmul(
                    modes,
                    Accum::Replace,
                    vectors.transpose(),
                    half,
                    1.0,
                    Par::Seq,
                );
            }
            Second::Diagonal(roots) => scale_rows(roots, &room.half, &mut room.modes),
        }
    }

    /// From `modes` to `values`; destroys `modes`.
    pub fn inverse(&self, room: &mut Room) {
        let ([n_a, n_b], width) = (self.counts, self.width());
        match &self.second {
            Second::Fourier(lines) => {
                lines.inverse(&mut room.modes, &mut room.scratch);
                transpose(&room.modes, &mut room.half, width, n_b);
            }
            Second::Dense(vectors) => {
                let columns = room.half.len() / n_b;
                let modes = MatRef::from_row_major_slice(&room.modes, vectors.ncols(), columns);
                let half = MatMut::from_row_major_slice_mut(&mut room.half, n_b, columns);
                matmul(half, Accum::Replace, vectors, modes, 1.0, Par::Seq);
            }
            Second::Diagonal(roots) => scale_rows(roots, &room.modes, &mut room.half),
        }
        match &self.first {
            First::Fourier(lines) => {
                lines.inverse(&mut room.half, &mut room.values, &mut room.scratch);
            }
            First::Dense(vectors) => {
                let half = MatRef::from_row_major_slice(&room.half, n_b, width);
                let values = MatMut::from_row_major_slice_mut(&mut room.values, n_b, n_a);
                matmul(
                    values,
                    Accum::Replace,
                    half,
                    vectors.transpose(),
                    1.0,
                    Par::Seq,
                );
            }
            First::Diagonal(roots) => scale_columns(roots, &room.half, &mut room.values),
        }
    }
}

fn scale_columns(scale: &[f64], from: &[f64], to: &mut [f64]) {
    let rows = from
        .chunks_exact(scale.len())
        .zip(to.chunks_exact_mut(scale.len()));
    for (from, to) in rows {
        for ((to, from), scale) in to.iter_mut().zip(from).zip(scale) {
            *to = scale * from;
        }
    }
}

fn scale_rows(scale: &[f64], from: &[f64], to: &mut [f64]) {
    let columns = from.len() / scale.len();
    let rows = from.chunks_exact(columns).zip(to.chunks_exact_mut(columns));
    for ((from, to), scale) in rows.zip(scale) {
        to.iter_mut()
            .zip(from)
            .for_each(|(to, from)| *to = scale * from);
    }
}

/// Complex `to` (columns, rows) from `from` (rows, columns), in blocks that fit a cache line a row.
fn transpose(from: &[f64], to: &mut [f64], rows: usize, columns: usize) {
    let (from, to) = (from.as_chunks::<2>().0, to.as_chunks_mut::<2>().0);
    const BLOCK: usize = 8;
    for first_row in (0..rows).step_by(BLOCK) {
        let last_row = rows.min(first_row + BLOCK);
        for first in (0..columns).step_by(BLOCK) {
            for column in first..columns.min(first + BLOCK) {
                for row in first_row..last_row {
                    to[column * rows + row] = from[row * columns + column];
                }
            }
        }
    }
}
