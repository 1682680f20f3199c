//! The last direction: one banded system a mode, factorised once, swept for many modes at a time.
//!
//! The matrix of a mode of eigenvalue λ is K + λH of the line. Nodes come in the order of the line; on a periodic line
//! the last P rows take all that wraps and are stored in full ("border"), so that L keeps the shape of K:
//!
//! y_c = b_c − Σ_d l_{c,d} y_{c−d},  y_border −= w_c y_c;   x_c = y_c/D_c − Σ_d l_{c+d,d} x_{c+d} − Σ w_c x_border.

use fibreflow_mesh::Line;
use rayon::prelude::*;

/// Modes that are swept together.
pub(super) const LANES: usize = 32;

type Lanes = [f64; LANES];

/// K + λH of the free nodes of a line, for blocks of [`LANES`] eigenvalues λ.
#[derive(Clone, Debug)]
pub(super) struct Banded {
    /// Free nodes.
    size: usize,
    /// Largest distance of a pair.
    width: usize,
    /// Rows of the border.
    border: usize,
    /// Diagonal of K.
    diagonal: Vec<f64>,
    /// H.
    norm: Vec<f64>,
    /// K_{c,c−d} at `[c·width + d − 1]`.
    below: Vec<f64>,
    /// K_{r,c} of the border rows r, at `[r·size + c]`.
    full: Vec<f64>,
    /// Coupling of the first and last free node to fixed ones \[1/m\].
    ends: [f64; 2],
    /// Of every block and node: 1/D, then l_1 … l_P, then w of the border rows; only 1/D of a tridiagonal matrix.
    factor: Vec<Lanes>,
    /// One factor serves all blocks: their eigenvalues are the same.
    pub shared: bool,
}

impl Banded {
    /// Of the nodes of `line` that are not fixed ends.
    pub fn new(line: &Line, fixed: [bool; 2]) -> Self {
        let first = usize::from(fixed[0]);
        let size = (line.len() - first).saturating_sub(usize::from(fixed[1]));
        let width = line.pairs.iter().map(|p| p.distance as usize).max();
        let width = width.unwrap_or(1);
        let border = if line.periodic { width.min(size) } else { 0 };
        let mut banded = Self {
            size,
            width,
            border,
            diagonal: vec![0.0; size],
            norm: line.norm[first..first + size].to_vec(),
            below: vec![0.0; size * width],
            full: vec![0.0; border * size],
            ends: [0.0; 2],
            factor: Vec::new(),
            shared: false,
        };
        for pair in &line.pairs {
            let places = [pair.a as usize, line.other(pair)].map(|i| i.wrapping_sub(first));
            if places[0] != places[1] {
                banded.couple(places, pair.stiffness);
            }
        }
        banded
    }

    fn couple(&mut self, [a, b]: [usize; 2], stiffness: f64) {
        for (free, other) in [(a, b), (b, a)] {
            if free < self.size {
                self.diagonal[free] += stiffness;
                if other >= self.size {
                    // Below the first free node the place has wrapped round.
                    self.ends[usize::from(other == self.size)] += stiffness;
                }
            }
        }
        let (low, high) = (a.min(b), a.max(b));
        if high >= self.size {
            return;
        }
        match (high + self.border).checked_sub(self.size) {
            Some(row) => self.full[row * self.size + low] -= stiffness,
            None => self.below[high * self.width + high - low - 1] -= stiffness,
        }
    }

    /// Free nodes.
    pub fn size(&self) -> usize {
        self.size
    }

    /// For instance "tridiagonal, periodic".
    pub fn name(&self) -> &'static str {
        match (self.width, self.border) {
            (1, 0) => "tridiagonal",
            (1, _) => "tridiagonal, periodic",
            (_, 0) => "banded",
            _ => "banded, periodic",
        }
    }

    /// Floating-point operations a node and right-hand side.
    pub fn operations(&self) -> f64 {
        1.0 + 4.0 * (self.width + self.border) as f64
    }

    fn is_tridiagonal(&self) -> bool {
        self.width == 1 && self.border == 0
    }

    fn entries(&self) -> usize {
        if self.is_tridiagonal() {
            1
        } else {
            1 + self.width + self.border
        }
    }

    /// Factorises for the eigenvalues, whose number is a multiple of [`LANES`]; the first block of them will do when the
    /// factor is shared. With `singular` the first is zero and
    /// the constant its null vector: the last node of that mode is put to zero. Allocates the first time only.
    pub fn factorise(&mut self, eigenvalues: &[f64], singular: bool) {
        let length = self.entries() * self.size;
        let mut factor = std::mem::take(&mut self.factor);
        factor.resize(eigenvalues.len() / LANES * length, [0.0; LANES]);
        if length > 0 {
            factor
                .par_chunks_mut(length)
                .zip(eigenvalues.as_chunks::<LANES>().0)
                .for_each(|(factor, eigenvalues)| {
                    if self.is_tridiagonal() {
                        self.factorise_tridiagonal(factor, eigenvalues);
                    } else {
                        self.factorise_banded(factor, eigenvalues);
                    }
                });
        }
        if singular && let Some(last) = factor.get_mut(self.entries() * (self.size - 1)) {
            last[0] = 0.0;
        }
        self.factor = factor;
    }

    /// Pivots as (what the row has in excess of its coupling to the next) + coupling: sums of positive numbers only,
    /// so every digit counts on lines of any stretching.
    fn factorise_tridiagonal(&self, factor: &mut [Lanes], eigenvalues: &Lanes) {
        let mut excess = [0.0; LANES];
        for c in 0..self.size {
            let low = -self.below[c];
            let high = match self.below.get(c + 1) {
                Some(below) => -below,
                None => self.ends[1],
            };
            for lane in 0..LANES {
                let carried = match c {
                    0 => self.ends[0],
                    _ => low * excess[lane] / (excess[lane] + low),
                };
                excess[lane] = eigenvalues[lane] * self.norm[c] + carried;
                let pivot = excess[lane] + high;
                factor[c][lane] = if pivot > 0.0 { 1.0 / pivot } else { 0.0 };
            }
        }
    }

    fn factorise_banded(&self, factor: &mut [Lanes], eigenvalues: &Lanes) {
        let (entries, inner) = (self.entries(), self.size - self.border);
        let diagonal = |c: usize| -> Lanes {
            std::array::from_fn(|k| self.diagonal[c] + eigenvalues[k] * self.norm[c])
        };
        // L_{c,j} of a row of the band, and L_{r,j} of a border row, as they are stored.
        let band = |c: usize, j: usize| c * entries + (c - j);
        let wide = |r: usize, j: usize| j * entries + 1 + self.width + r;
        for c in 0..inner {
            let first = c.saturating_sub(self.width);
            let mut pivot = diagonal(c);
            for j in first..c {
                // D_j L_cj.
                let mut scaled = [self.below[c * self.width + c - j - 1]; LANES];
                for k in first.max(j.saturating_sub(self.width))..j {
                    let (a, b, d) = (factor[band(c, k)], factor[band(j, k)], factor[k * entries]);
                    (0..LANES).for_each(|i| scaled[i] -= a[i] * b[i] / d[i]);
                }
                let inverse = factor[j * entries];
                let entry = &mut factor[band(c, j)];
                for i in 0..LANES {
                    entry[i] = scaled[i] * inverse[i];
                    pivot[i] -= scaled[i] * entry[i];
                }
            }
            factor[c * entries] = pivot.map(f64::recip);
        }
        for r in 0..self.border {
            let row = inner + r;
            let mut pivot = diagonal(row);
            for j in 0..row {
                let mut scaled = [self.full[r * self.size + j]; LANES];
                let first = if j < inner {
                    j.saturating_sub(self.width)
                } else {
                    0
                };
                for k in first..j {
                    let a = factor[wide(r, k)];
                    let b = factor[if j < inner {
                        band(j, k)
                    } else {
                        wide(j - inner, k)
                    }];
                    let d = factor[k * entries];
                    (0..LANES).for_each(|i| scaled[i] -= a[i] * b[i] / d[i]);
                }
                let inverse = factor[j * entries];
                let entry = &mut factor[wide(r, j)];
                for i in 0..LANES {
                    entry[i] = scaled[i] * inverse[i];
                    pivot[i] -= scaled[i] * entry[i];
                }
            }
            factor[row * entries] = pivot.map(f64::recip);
        }
    }

    /// Solves in place: `values` holds, block by block and node by node, `parts` right-hand sides of [`LANES`] modes.
    pub fn solve(&self, values: &mut [f64], parts: usize) {
        let length = self.size * parts;
        let (values, _) = values.as_chunks_mut::<LANES>();
        if length == 0 {
            return;
        }
        let entries = self.entries() * self.size;
        values
            .par_chunks_mut(length)
            .enumerate()
            .for_each(|(block, values)| {
                let first = if self.shared { 0 } else { block * entries };
                let factor = &self.factor[first..first + entries];
                if self.is_tridiagonal() {
                    self.sweep_tridiagonal(values, factor, parts);
                } else {
                    self.sweep_banded(values, factor, parts);
                }
            });
    }

    fn sweep_tridiagonal(&self, values: &mut [Lanes], factor: &[Lanes], parts: usize) {
        for c in 0..self.size {
            let (before, here) = values.split_at_mut(c * parts);
            let (inverse, below) = (&factor[c], self.below[c]);
            if c == 0 {
                here[..parts].iter_mut().for_each(|v| multiply(v, inverse));
                continue;
            }
            for (value, last) in here[..parts].iter_mut().zip(&before[(c - 1) * parts..]) {
                for i in 0..LANES {
                    value[i] = inverse[i] * (value[i] - below * last[i]);
                }
            }
        }
        for c in (0..self.size.saturating_sub(1)).rev() {
            let (here, after) = values.split_at_mut((c + 1) * parts);
            let (inverse, below) = (&factor[c], self.below[c + 1]);
            for (value, next) in here[c * parts..].iter_mut().zip(&after[..parts]) {
                for i in 0..LANES {
                    value[i] -= below * inverse[i] * next[i];
                }
            }
        }
    }

    fn sweep_banded(&self, values: &mut [Lanes], factor: &[Lanes], parts: usize) {
        let (entries, inner) = (self.entries(), self.size - self.border);
        for c in 0..self.size {
            let factor = &factor[c * entries..][..entries];
            if c < inner {
                let (before, here) = values.split_at_mut(c * parts);
                for d in 1..=self.width.min(c) {
                    let source = &before[(c - d) * parts..][..parts];
                    subtract(here, source, &factor[d]);
                }
            }
            let (before, after) = values.split_at_mut((c + 1) * parts);
            let source = &before[c * parts..];
            for r in (c + 1).saturating_sub(inner)..self.border {
                let to = (inner + r - c - 1) * parts;
                subtract(&mut after[to..], source, &factor[1 + self.width + r]);
            }
        }
        for c in (0..self.size).rev() {
            let (before, after) = values.split_at_mut((c + 1) * parts);
            let here = &mut before[c * parts..];
            here.iter_mut()
                .for_each(|v| multiply(v, &factor[c * entries]));
            for d in (1..=self.width).take_while(|d| c + d < inner) {
                let source = &after[(d - 1) * parts..][..parts];
                subtract(here, source, &factor[(c + d) * entries + d]);
            }
            for r in (c + 1).saturating_sub(inner)..self.border {
                let source = &after[(inner + r - c - 1) * parts..][..parts];
                subtract(here, source, &factor[c * entries + 1 + self.width + r]);
            }
        }
    }
}

fn multiply(values: &mut Lanes, factor: &Lanes) {
    (0..LANES).for_each(|i| values[i] *= factor[i]);
}

/// values −= factor · source, for each of the sources.
fn subtract(values: &mut [Lanes], source: &[Lanes], factor: &Lanes) {
    for (value, source) in values.iter_mut().zip(source) {
        (0..LANES).for_each(|i| value[i] -= factor[i] * source[i]);
    }
}
