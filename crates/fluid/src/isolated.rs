//! Nodes of given velocity whose neighbours all have given velocities too: what flows through their volumes is decided
//! by boundary data alone, and may not sum to zero.
//!
//! At the corners of a driven cavity the lid draws ½ U·S out of a volume into which nothing flows. No nodal velocity can
//! change that, and a pressure that tries grows without end. The rest r_i = Σ_j F*_ij + F_b of such a node is therefore
//! handed to its neighbours, whose continuity the flow can meet, as a pressure of this node alone would do it: F*_ij gets
//! w_ij (s_j − s_i) with s_i = r_i/Σ_j w_ij, and s_j = 0 at other nodes. Fluxes through the boundary instead (a leaky
//! cavity) leave an error of first order, and closing the lid's own flux drives the flow too hard on coarse meshes.

use crate::operators::Operators;
use fibreflow_mesh::LocalMesh;

/// The isolated nodes that this rank knows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Isolated {
    /// Ascending, so that owned nodes come first; how many are owned.
    nodes: Vec<u32>,
    owned: usize,
    /// Total: s \[m²/s\].
    shares: Vec<f64>,
    /// Owned nodes of given velocity, then isolated ones, each with marks (total) of those that tell them a gradient.
    layers: [(Vec<u32>, Vec<bool>); 2],
}

impl Isolated {
    /// `fixed` marks nodes of given velocity (total length), see [`crate::boundary::Boundary::prescribed`]. Collective.
    pub fn new(mesh: &LocalMesh, operators: &Operators, fixed: &[bool]) -> Self {
        let geometry = &*operators.geometry;
        let size = |e: usize| {
            let [x, y, z, _] = geometry.faces[e];
            (x * x + y * y + z * z).sqrt()
        };
        let is_isolated = |i: usize| {
            let area: f64 = geometry.row(i).map(size).sum();
            let mut row = geometry.row(i);
            fixed[i] && row.all(|e| fixed[geometry.columns[e] as usize] || size(e) < 1e-9 * area)
        };
        let mut marks: Vec<u8> = (0..mesh.owned())
            .map(|i| u8::from(is_isolated(i)))
            .collect();
        marks.resize(mesh.total(), 0);
        mesh.halo.update(&mut marks);
        let nodes: Vec<u32> = (0..mesh.total() as u32)
            .filter(|&i| marks[i as usize] > 0)
            .collect();
        let owned_of = |mark: &dyn Fn(usize) -> bool| -> Vec<u32> {
            let owned = 0..mesh.owned();
            owned.filter(|&i| mark(i)).map(|i| i as u32).collect()
        };
        let isolated: Vec<bool> = marks.iter().map(|&mark| mark > 0).collect();
        let beside = owned_of(&|i| fixed[i] && !isolated[i]);
        let alone = owned_of(&|i| isolated[i]);
        Self {
            layers: [
                (beside, fixed.iter().map(|f| !f).collect()),
                (alone, isolated.iter().map(|i| !i).collect()),
            ],
            owned: nodes.partition_point(|&i| (i as usize) < mesh.owned()),
            nodes,
            shares: vec![0.0; mesh.total()],
        }
    }

    /// s from given velocities (valid) and, for a node, the flux through its boundary. Collective.
    pub fn update(
        &mut self,
        mesh: &LocalMesh,
        operators: &Operators,
        velocity: &[[f64; 4]],
        through: impl Fn(u32) -> f64,
    ) {
        let geometry = &*operators.geometry;
        for &node in &self.nodes[..self.owned] {
            let i = node as usize;
            let (mut rest, mut weights) = (through(node), 0.0);
            for e in geometry.row(i) {
                let (other, s) = (velocity[geometry.columns[e] as usize], geometry.faces[e]);
                let flux = (0..3).map(|c| 0.5 * (velocity[i][c] + other[c]) * s[c]);
                rest += flux.sum::<f64>();
                weights += s[3];
            }
            self.shares[i] = rest / weights;
        }
        mesh.halo.update(&mut self.shares);
    }

    /// Gradients (total length, valid) at nodes of given velocity from their neighbours inside, at isolated nodes from
    /// theirs: a linear field has its own everywhere then, and G alone is not exact there on simplices. Collective.
    pub fn smooth(&self, mesh: &LocalMesh, operators: &Operators, gradient: &mut [[f64; 4]]) {
        for (nodes, sources) in &self.layers {
            for &node in nodes {
                let geometry = &*operators.geometry;
                let (mut sum, mut size) = ([0.0; 4], 0.0);
                for e in geometry.row(node as usize) {
                    let j = geometry.columns[e] as usize;
                    if sources[j] {
                        size += 1.0;
                        (0..3).for_each(|c| sum[c] += gradient[j][c]);
                    }
                }
                if size > 0.0 {
                    gradient[node as usize] = sum.map(|s| s / size);
                }
            }
            mesh.halo.update(gradient);
        }
    }

    /// q −= s (total length).
    pub fn subtract_from(&self, q: &mut [f64]) {
        for &i in &self.nodes {
            q[i as usize] -= self.shares[i as usize];
        }
    }
}
