//! A mesh seen as a straight circular pipe along x, y or z.

use super::inertia::bounds;
use fibreflow_mesh::LocalMesh;

/// Extents of a mesh, by which it is a pipe along any of the three directions.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pipe {
    low: [f64; 3],
    high: [f64; 3],
    /// Largest distance of a node from the middle line along each direction \[m\].
    radius: [f64; 3],
    /// Period along each direction, zero where there is none \[m\].
    period: [f64; 3],
}

impl Pipe {
    /// Of a mesh. Collective.
    pub fn new(mesh: &LocalMesh) -> Self {
        let [low, high] = bounds(mesh);
        let distance = |x: &[f64; 3], along: usize| {
            let off = |c: usize| x[c] - 0.5 * (low[c] + high[c]);
            off((along + 1) % 3).hypot(off((along + 2) % 3))
        };
        let largest = |along: usize| {
            let distances = mesh.nodes.iter().map(|x| distance(x, along));
            let communicator = mesh.halo.communicator();
            communicator.max(distances.fold(0.0, f64::max))
        };
        Self {
            low,
            high,
            radius: [0, 1, 2].map(largest),
            period: [0, 1, 2].map(|c| mesh.periods.vectors[c][c]),
        }
    }

    /// Centre of the first section, radius and length of the pipe along a direction \[m\].
    pub fn along(&self, axis: usize) -> ([f64; 3], f64, f64) {
        let mut origin = std::array::from_fn(|c| 0.5 * (self.low[c] + self.high[c]));
        origin[axis] = self.low[axis];
        let length = match self.period[axis] {
            0.0 => self.high[axis] - self.low[axis],
            period => period,
        };
        (origin, self.radius[axis], length)
    }
}
