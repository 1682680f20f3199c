//! Pairs of a tensor-product mesh from one-dimensional operators: S = skew·H·H, w = stiffness·H·H, V = H·H·H.

use crate::{DualGeometry, Image, Line, LocalMesh, MeshError, TensorGrid, TensorLines};
use fibreflow_parallel::block_sum;
use rayon::prelude::*;
use std::collections::HashMap;

pub(super) fn second(grid: TensorGrid) -> TensorLines {
    let lines = lines(&grid, Line::second);
    TensorLines { grid, lines }
}

fn lines(grid: &TensorGrid, line: impl Fn(&[f64], Option<f64>) -> Line) -> [Line; 3] {
    std::array::from_fn(|c| line(&grid.coordinates[c], grid.periods[c]))
}

/// As [`super::dual`], of fourth order where the mesh is smooth (see [`Line::fourth`]): pairs at distances of up to
/// three nodes along the axes. Collective.
///
/// # Errors
/// Those of [`super::dual`]; [`MeshError::NotTensorProduct`]; [`MeshError::Size`] when the halo has too few layers.
pub fn fourth(mesh: &LocalMesh) -> Result<DualGeometry, MeshError> {
    let two_point = super::dual(mesh)?;
    let Some(TensorLines { grid, lines: old }) = two_point.tensor else {
        return Err(MeshError::NotTensorProduct);
    };
    let lines = lines(&grid, Line::fourth);
    let rows = Pairs::new(mesh, &grid, &lines).rows();
    if mesh.halo.communicator().any(rows.is_none()) {
        return Err(MeshError::Size(
            "fourth order reaches three nodes far: distribute the mesh with three halo layers"
                .into(),
        ));
    }
    let rows = rows.unwrap_or_default();
    let product = |lines: &[Line; 3], at: [u32; 3], without: usize| -> f64 {
        let others = (0..3).filter(|&c| c != without);
        others.map(|c| lines[c].norm[at[c] as usize]).product()
    };
    let mut boundary = two_point.boundary;
    for share in &mut boundary {
        let at = grid.indices[share.node as usize];
        for (c, area) in share.area.iter_mut().enumerate() {
            *area *= product(&lines, at, c) / product(&old, at, c);
        }
    }
    let volumes: Vec<f64> = grid
        .indices
        .iter()
        .map(|&at| product(&lines, at, 3))
        .collect();
    let volume = block_sum(mesh.owned(), |range| volumes[range].iter().sum());
    let mut geometry = DualGeometry {
        total_volume: mesh.halo.communicator().sum(volume),
        volumes,
        boundary,
        offsets: vec![0],
        columns: Vec::new(),
        images: Vec::new(),
        faces: Vec::new(),
        masses: Vec::new(),
        displacements: Vec::new(),
        self_pairs: Vec::new(),
        orthogonal: true,
        tensor: Some(TensorLines { grid, lines }),
    };
    for (i, row) in rows.into_iter().enumerate() {
        for entry in row {
            if entry.column as usize == i {
                geometry
                    .self_pairs
                    .push((entry.column, entry.image, entry.face));
                continue;
            }
            geometry.columns.push(entry.column);
            geometry.images.push(entry.image);
            geometry.faces.push(entry.face);
            geometry.displacements.push(entry.displacement);
        }
        geometry.offsets.push(geometry.columns.len() as u32);
    }
    Ok(geometry)
}

struct Entry {
    column: u32,
    image: Image,
    face: [f64; 4],
    displacement: [f64; 3],
}

/// Looks up the pairs of a node.
struct Pairs<'a> {
    mesh: &'a LocalMesh,
    grid: &'a TensorGrid,
    lines: &'a [Line; 3],
    /// (other node, pair, lower end here) by node of every line.
    arms: [Vec<Vec<(u32, u32, bool)>>; 3],
    /// Local node of every place (i, j, k) that the rank holds.
    nodes: HashMap<[u32; 3], u32>,
    /// Lattice vector along every axis and its sign.
    vectors: [(usize, f64); 3],
}

impl<'a> Pairs<'a> {
    fn new(mesh: &'a LocalMesh, grid: &'a TensorGrid, lines: &'a [Line; 3]) -> Self {
        let arms = lines.each_ref().map(|line| {
            let mut arms = vec![Vec::new(); line.len()];
            for (p, pair) in line.pairs.iter().enumerate() {
                let b = line.other(pair);
                arms[pair.a as usize].push((b as u32, p as u32, true));
                arms[b].push((pair.a, p as u32, false));
            }
            arms
        });
        let vectors = [0, 1, 2].map(|c| {
            let vectors = &mesh.periods.vectors;
            let along = (0..3).find(|&k| vectors[k][c] != 0.0);
            along.map_or((c, 1.0), |k| (k, vectors[k][c].signum()))
        });
        Self {
            mesh,
            grid,
            lines,
            arms,
            nodes: grid.indices.iter().copied().zip(0..).collect(),
            vectors,
        }
    }

    /// Rows of the owned nodes, sorted as in [`DualGeometry`]; None when a halo node is missing.
    fn rows(&self) -> Option<Vec<Vec<Entry>>> {
        let owned = 0..self.mesh.owned();
        owned.into_par_iter().map(|i| self.row(i)).collect()
    }

    fn row(&self, i: usize) -> Option<Vec<Entry>> {
        let at = self.grid.indices[i];
        let mut row = Vec::with_capacity(14);
        for c in 0..3 {
            let line = &self.lines[c];
            let others = [(c + 1) % 3, (c + 2) % 3];
            let area: f64 = others
                .map(|o| self.lines[o].norm[at[o] as usize])
                .iter()
                .product();
            for &(other, p, lower) in &self.arms[c][at[c] as usize] {
                let pair = &line.pairs[p as usize];
                let mut place = at;
                place[c] = other;
                let column = *self.nodes.get(&place)?;
                let sign = if lower { 1.0 } else { -1.0 };
                // The pair runs over the end of the line when its higher node has the lower place.
                let wraps = line.other(pair) <= pair.a as usize;
                let (vector, direction) = self.vectors[c];
                let mut shifts = [0i8; 3];
                let mut length = self.grid.coordinates[c][line.other(pair)]
                    - self.grid.coordinates[c][pair.a as usize];
                if wraps {
                    shifts[vector] = (sign * direction) as i8;
                    length += self.grid.periods[c].unwrap_or(0.0);
                }
                let (mut face, mut displacement) = ([0.0; 4], [0.0; 3]);
                face[c] = sign * pair.skew * area;
                face[3] = pair.stiffness * area;
                displacement[c] = sign * length;
                row.push(Entry {
                    column,
                    image: Image::new(shifts),
                    face,
                    displacement,
                });
            }
        }
        let key = |e: &Entry| (self.mesh.global_nodes[e.column as usize], e.image.code());
        row.sort_by_key(key);
        Some(row)
    }
}
