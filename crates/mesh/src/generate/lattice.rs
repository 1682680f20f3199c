//! The grid of vertices under a box mesh: node numbers, periodic images, positions.

use crate::{BoxMesh, Image, MeshError, Stretching};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

impl Stretching {
    /// Positions of the n + 1 grid planes on \[0, 1\], see [`Stretching`].
    pub(super) fn planes(self, n: usize) -> Vec<f64> {
        let mut planes: Vec<f64> = (0..=n)
            .map(|i| {
                let s = i as f64 / n as f64;
                match self {
                    Self::Uniform => s,
                    Self::Tanh(beta) => 0.5 * (1.0 + (beta * (2.0 * s - 1.0)).tanh() / beta.tanh()),
                    // expm1 stays exact as the ratio tends to one.
                    Self::Geometric(1.0) => s,
                    Self::Geometric(ratio) => {
                        (i as f64 * ratio.ln()).exp_m1() / (n as f64 * ratio.ln()).exp_m1()
                    }
                }
            })
            .collect();
        planes[n] = 1.0;
        planes
    }

    pub(super) fn is_valid(self) -> bool {
        match self {
            Self::Uniform => true,
            Self::Tanh(beta) => beta.is_finite() && beta > 0.0,
            Self::Geometric(ratio) => ratio.is_finite() && ratio > 0.0,
        }
    }
}

/// Vertices (i, j, k), x fastest; the last plane of a periodic direction is the image of the first.
pub(super) struct Lattice {
    pub cells: [usize; 3],
    periodic: [bool; 3],
    /// Distinct planes of every direction.
    planes: [usize; 3],
    /// Coordinates of all planes \[m\].
    coordinates: [Vec<f64>; 3],
}

impl Lattice {
    pub fn new(mesh: &BoxMesh) -> Result<Self, MeshError> {
        let coordinates: [Vec<f64>; 3] = std::array::from_fn(|a| {
            let planes = mesh.stretching[a].planes(mesh.cells[a]);
            let place = |s: f64| mesh.origin[a] + mesh.size[a] * s;
            planes.into_iter().map(place).collect()
        });
        if !coordinates
            .iter()
            .all(|c| c.windows(2).all(|w| w[0] < w[1]))
        {
            return Err(MeshError::Parameter {
                name: "stretching",
                value: format!("{:?}", mesh.stretching),
                expected: "cells of positive size: stretch less or use fewer cells".into(),
            });
        }
        Ok(Self {
            cells: mesh.cells,
            periodic: mesh.periodic,
            planes: std::array::from_fn(|a| mesh.cells[a] + usize::from(!mesh.periodic[a])),
            coordinates,
        })
    }

    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.planes.iter().product()
    }

    /// Node and image of a vertex, each index 0…cells.
    pub fn vertex(&self, at: [usize; 3]) -> (u32, Image) {
        let wraps: [bool; 3] = std::array::from_fn(|a| at[a] == self.planes[a]);
        let [i, j, k] = std::array::from_fn(|a| if wraps[a] { 0 } else { at[a] });
        let node = i + self.planes[0] * (j + self.planes[1] * k);
        (node as u32, Image::new(wraps.map(i8::from)))
    }

    /// Nodes and images of a cell's corners; bit d of a corner's index is its place along direction d.
    pub fn corners(&self, cell: [usize; 3]) -> [(u32, Image); 8] {
        std::array::from_fn(|c| self.vertex(std::array::from_fn(|d| cell[d] + (c >> d & 1))))
    }

    /// The cell beyond a side (0–5: x_min, x_max, y_min …); none beyond a boundary.
    pub fn neighbour(&self, mut at: [usize; 3], side: usize) -> Option<[usize; 3]> {
        let (a, n) = (side / 2, self.cells[side / 2]);
        let last = if side.is_multiple_of(2) { 0 } else { n - 1 };
        if at[a] == last && !self.periodic[a] {
            return None;
        }
        let step = if side.is_multiple_of(2) { n - 1 } else { 1 };
        at[a] = (at[a] + step) % n;
        Some(at)
    }

    /// Positions of the nodes \[m\].
    pub fn positions(&self) -> Vec<[f64; 3]> {
        let [x, y, z] = &self.coordinates;
        let mut nodes = Vec::with_capacity(self.len());
        for &z in &z[..self.planes[2]] {
            for &y in &y[..self.planes[1]] {
                nodes.extend(x[..self.planes[0]].iter().map(|&x| [x, y, z]));
            }
        }
        nodes
    }

    /// Random displacements of the nodes: uniform within ± `fraction` of the smaller neighbouring spacing; none for
    /// nodes on a boundary and none along a periodic direction with one cell.
    pub fn displacements(&self, fraction: f64, seed: u64) -> Vec<[f64; 3]> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let reach: [Vec<f64>; 3] = std::array::from_fn(|a| self.reach(a, fraction));
        let on_boundary = |at: [usize; 3]| {
            (0..3).any(|a| !self.periodic[a] && (at[a] == 0 || at[a] == self.cells[a]))
        };
        let mut displacements = Vec::with_capacity(self.len());
        for k in 0..self.planes[2] {
            for j in 0..self.planes[1] {
                for i in 0..self.planes[0] {
                    let at = [i, j, k];
                    let draw: [f64; 3] = std::array::from_fn(|_| random.random_range(-1.0..=1.0));
                    displacements.push(if on_boundary(at) {
                        [0.0; 3]
                    } else {
                        std::array::from_fn(|a| draw[a] * reach[a][at[a]])
                    });
                }
            }
        }
        displacements
    }

    fn reach(&self, a: usize, fraction: f64) -> Vec<f64> {
        let (n, x) = (self.cells[a], &self.coordinates[a]);
        let spacing = |cell: usize| x[cell + 1] - x[cell];
        (0..self.planes[a])
            .map(|i| match (self.periodic[a], i) {
                (true, _) if n == 1 => 0.0,
                (true, 0) => fraction * spacing(0).min(spacing(n - 1)),
                (false, 0) => 0.0,
                (false, i) if i == n => 0.0,
                (_, i) => fraction * spacing(i - 1).min(spacing(i)),
            })
            .collect()
    }
}
