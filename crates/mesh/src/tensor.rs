//! Recognises meshes whose nodes are the tensor product of three coordinate lists.

use crate::{ElementKind, LocalMesh};

/// A mesh whose nodes are the tensor product of three coordinate lists, in any numbering and on any distribution.
#[derive(Clone, Debug, PartialEq)]
pub struct TensorGrid {
    /// Ascending coordinates of every direction \[m\]; periodic directions without the repeated end.
    pub coordinates: [Vec<f64>; 3],
    /// Length of the periodic directions \[m\].
    pub periods: [Option<f64>; 3],
    /// (i, j, k) of every local node, owned then halo.
    pub indices: Vec<[u32; 3]>,
}

impl TensorGrid {
    /// The grid of a mesh; None unless all elements are axis-parallel boxes that fill a complete lattice, with every
    /// node and every cell there once. Collective; the same on every rank, and no rank gets an array of the length of
    /// the mesh.
    ///
    /// Nodes of a plane may differ by 1e-8 of the smallest spacing beside them and by 4e-12 of their coordinates (what
    /// generators write), as in the two-point geometry.
    pub fn detect(mesh: &LocalMesh) -> Option<Self> {
        let communicator = mesh.halo.communicator();
        let on_all = |found: bool| !communicator.any(!found);
        let axes = Axes::new(mesh);
        let spacings = axes.as_ref().and_then(|_| spacings(mesh));
        let local = spacings.and_then(|spacings| local_planes(mesh, &spacings));
        if !on_all(local.is_some()) {
            return None;
        }
        let (axes, local) = (axes?, local?);
        let planes = local.map(|planes| {
            let mut all = communicator.all_gather(&planes.0).concat();
            all.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
            Planes::merged(all)
        });
        let counts = planes.each_ref().map(|p| p.0.len());
        let cells: [usize; 3] =
            std::array::from_fn(|c| counts[c] - usize::from(axes.periods[c].is_none()));
        let complete = product(counts) == mesh.total_nodes as u64
            && product(cells) == mesh.total_elements as u64
            && planes.iter().zip(axes.periods).all(|(p, l)| p.fit(l));
        // The same numbers on every rank: no vote needed.
        if !complete {
            return None;
        }
        let indices: Option<Vec<[u32; 3]>> = mesh
            .nodes
            .iter()
            .map(|x| {
                let at = [0, 1, 2].map(|c| planes[c].find(x[c]));
                Some([at[0]?, at[1]?, at[2]?])
            })
            .collect();
        let cell_indices = indices
            .as_ref()
            .and_then(|indices| axes.cells(mesh, indices, counts, cells));
        if !on_all(cell_indices.is_some()) {
            return None;
        }
        let (indices, cell_indices) = (indices?, cell_indices?);
        let owned = &indices[..mesh.owned()];
        let nodes_once = each_once(mesh, owned, counts);
        if !(each_once(mesh, &cell_indices, cells) && nodes_once) {
            return None;
        }
        Some(Self {
            coordinates: planes.map(|p| p.0.iter().map(|&[a, b, _]| 0.5 * (a + b)).collect()),
            periods: axes.periods,
            indices,
        })
    }

    /// Directions from the fastest to the slowest when nodes of these numbers are in lexicographic order; of several such
    /// orders (in directions of one node) the one that starts with the longest. `numbers` has one for every local node.
    pub fn numbering(&self, numbers: &[u64]) -> Option<[usize; 3]> {
        const ORDERS: [[usize; 3]; 6] = [
            [0, 1, 2],
            [0, 2, 1],
            [1, 0, 2],
            [1, 2, 0],
            [2, 0, 1],
            [2, 1, 0],
        ];
        let counts = self.counts().map(|n| n as u64);
        let fits = |axes: &[usize; 3]| {
            let mut nodes = numbers.iter().zip(&self.indices);
            nodes.all(|(&number, at)| {
                let [i, j, k] = axes.map(|c| u64::from(at[c]));
                number == i + counts[axes[0]] * (j + counts[axes[1]] * k)
            })
        };
        let fitting = ORDERS.into_iter().filter(fits);
        fitting.min_by_key(|axes| std::cmp::Reverse(counts[axes[0]]))
    }

    /// Number of nodes in every direction.
    pub fn counts(&self) -> [usize; 3] {
        self.coordinates.each_ref().map(Vec::len)
    }
}

fn product(counts: [usize; 3]) -> u64 {
    counts.iter().map(|&n| n as u64).product()
}

/// Which lattice vector runs along each axis.
struct Axes {
    /// Lattice vector of an axis and the sign with which it runs along it.
    vectors: [Option<(usize, i64)>; 3],
    periods: [Option<f64>; 3],
}

impl Axes {
    /// None when a lattice vector is not parallel to an axis, or two are to the same.
    fn new(mesh: &LocalMesh) -> Option<Self> {
        let mut axes = Self {
            vectors: [None; 3],
            periods: [None; 3],
        };
        for (k, vector) in mesh.periods.vectors.iter().enumerate() {
            if !mesh.periods.is_periodic(k) {
                continue;
            }
            let axis = (0..3).max_by(|&a, &b| vector[a].abs().total_cmp(&vector[b].abs()))?;
            let length = vector[axis].abs();
            let parallel = (0..3).all(|c| c == axis || vector[c].abs() <= 1e-12 * length);
            if !parallel || axes.vectors[axis].is_some() {
                return None;
            }
            axes.vectors[axis] = Some((k, if vector[axis] < 0.0 { -1 } else { 1 }));
            axes.periods[axis] = Some(length);
        }
        Some(axes)
    }

    /// Lattice indices of the elements that this rank owns; None when one is not a cell of the lattice.
    fn cells(
        &self,
        mesh: &LocalMesh,
        indices: &[[u32; 3]],
        counts: [usize; 3],
        cells: [usize; 3],
    ) -> Option<Vec<[u32; 3]>> {
        let mut owned = Vec::new();
        for e in 0..mesh.elements.len() {
            let vertices = mesh.elements.nodes(e).iter().zip(mesh.elements.images(e));
            let (mut low, mut high) = ([i64::MAX; 3], [i64::MIN; 3]);
            for (&node, image) in vertices {
                for c in 0..3 {
                    let shift = self.vectors[c].map_or(0, |(k, sign)| {
                        sign * i64::from(image.shifts()[k]) * counts[c] as i64
                    });
                    let at = i64::from(indices[node as usize][c]) + shift;
                    low[c] = low[c].min(at);
                    high[c] = high[c].max(at);
                }
            }
            // That all eight corners of this box are there is known already.
            if (0..3).any(|c| high[c] - low[c] != 1) {
                return None;
            }
            if mesh.owned_elements[e] {
                owned.push(std::array::from_fn(|c| {
                    low[c].rem_euclid(cells[c] as i64) as u32
                }));
            }
        }
        Some(owned)
    }
}

/// Smallest extent in every direction of the elements at each owned node \[m\]; None unless all elements are
/// axis-parallel boxes.
fn spacings(mesh: &LocalMesh) -> Option<Vec<[f64; 3]>> {
    let owned = mesh.owned();
    let mut spacings = vec![[f64::INFINITY; 3]; owned];
    for e in 0..mesh.elements.len() {
        if mesh.elements.kinds[e] != ElementKind::Hexahedron {
            return None;
        }
        let x = mesh.elements.coordinates(e, &mesh.nodes, &mesh.periods);
        let mut corners = [0u8; 8];
        let mut extent = [0.0; 3];
        for c in 0..3 {
            let values = x.map(|x| x[c]);
            let low = values.iter().fold(f64::INFINITY, |m, &v| m.min(v));
            let high = values.iter().fold(f64::NEG_INFINITY, |m, &v| m.max(v));
            extent[c] = high - low;
            let tolerance = tolerance(extent[c], low.abs().max(high.abs()));
            for (corner, value) in corners.iter_mut().zip(values) {
                if high - value <= tolerance {
                    *corner |= 1 << c;
                } else if value - low > tolerance {
                    return None;
                }
            }
        }
        let all = corners.iter().fold(0u32, |set, &corner| set | 1 << corner);
        if all != 0xff {
            return None;
        }
        for &node in mesh.elements.nodes(e) {
            if let Some(spacing) = spacings.get_mut(node as usize) {
                (0..3).for_each(|c| spacing[c] = spacing[c].min(extent[c]));
            }
        }
    }
    let touched = spacings.iter().flatten().all(|s| s.is_finite());
    touched.then_some(spacings)
}

/// How far apart two coordinates \[m\] of the same plane may be, given the spacing beside it and their size.
fn tolerance(spacing: f64, size: f64) -> f64 {
    1e-8 * spacing + 4e-12 * size
}

/// Planes of one direction, ascending: (lowest coordinate, highest coordinate, smallest spacing) \[m\].
#[derive(Default)]
struct Planes(Vec<[f64; 3]>);

/// Planes through the owned nodes; None when there are more than a complete lattice could have.
fn local_planes(mesh: &LocalMesh, spacings: &[[f64; 3]]) -> Option<[Planes; 3]> {
    let mut planes: [Planes; 3] = Default::default();
    let mut last = [0; 3];
    for (x, spacing) in mesh.nodes.iter().zip(spacings) {
        for c in 0..3 {
            planes[c].add(x[c], spacing[c], &mut last[c]);
        }
        if product(planes.each_ref().map(|p| p.0.len())) > mesh.total_nodes as u64 {
            return None;
        }
    }
    Some(planes)
}

impl Planes {
    /// Adds a coordinate; `hint` is the plane of the last one.
    fn add(&mut self, x: f64, spacing: f64, hint: &mut usize) {
        let takes = |plane: &[f64; 3]| {
            let tolerance = tolerance(spacing.min(plane[2]), x.abs());
            x >= plane[0] - tolerance && x <= plane[1] + tolerance
        };
        let found = match self.0.get(*hint) {
            Some(plane) if takes(plane) => Some(*hint),
            _ => {
                let next = self.0.partition_point(|plane| plane[0] <= x);
                let candidates = [next.wrapping_sub(1), next];
                let found = candidates
                    .into_iter()
                    .find(|&k| self.0.get(k).is_some_and(takes));
                if found.is_none() {
                    self.0.insert(next, [x, x, spacing]);
                    *hint = next;
                    return;
                }
                found
            }
        };
        if let Some(k) = found {
            let plane = &mut self.0[k];
            *plane = [plane[0].min(x), plane[1].max(x), plane[2].min(spacing)];
            *hint = k;
        }
    }

    /// From the planes of all ranks, ascending.
    fn merged(all: Vec<[f64; 3]>) -> Self {
        let mut merged: Vec<[f64; 3]> = Vec::new();
        for [low, high, spacing] in all {
            match merged.last_mut() {
                Some(last) if low - last[1] <= tolerance(spacing.min(last[2]), low.abs()) => {
                    *last = [last[0], last[1].max(high), last[2].min(spacing)];
                }
                _ => merged.push([low, high, spacing]),
            }
        }
        Self(merged)
    }

    /// True when the nodes of every plane agree within the tolerance and all planes lie within one period.
    fn fit(&self, period: Option<f64>) -> bool {
        let flat = |&[low, high, spacing]: &[f64; 3]| {
            high - low <= 2.0 * tolerance(spacing, low.abs().max(high.abs()))
        };
        let span = match (self.0.first(), self.0.last()) {
            (Some(first), Some(last)) => last[1] - first[0],
            _ => return false,
        };
        self.0.iter().all(flat) && period.is_none_or(|period| span < period)
    }

    /// The plane of a coordinate.
    fn find(&self, x: f64) -> Option<u32> {
        let next = self.0.partition_point(|plane| plane[0] <= x);
        // A halo node may lie below the plane of the owned ones by round-off.
        let near = |k: usize| {
            let plane = self.0.get(k)?;
            let tolerance = tolerance(plane[2], x.abs());
            (x >= plane[0] - tolerance && x <= plane[1] + tolerance).then_some(k as u32)
        };
        near(next.wrapping_sub(1)).or_else(|| near(next))
    }
}

/// True when `indices` of all ranks name every place of the lattice once. Collective: the lattice is dealt out in
/// blocks, and every rank checks its block.
fn each_once(mesh: &LocalMesh, indices: &[[u32; 3]], counts: [usize; 3]) -> bool {
    let communicator = mesh.halo.communicator();
    let block = product(counts).div_ceil(communicator.size() as u64).max(1);
    let mut outgoing = vec![Vec::new(); communicator.size()];
    for &[i, j, k] in indices {
        let [i, j, k] = [i, j, k].map(u64::from);
        let place = i + counts[0] as u64 * (j + counts[1] as u64 * k);
        outgoing[(place / block) as usize].push((place % block) as u32);
    }
    let mine = block * communicator.rank() as u64;
    let size = product(counts).saturating_sub(mine).min(block);
    let mut seen = vec![false; size as usize];
    let mut count = 0;
    for place in communicator.exchange(outgoing).into_iter().flatten() {
        let twice = std::mem::replace(&mut seen[place as usize], true);
        count += u64::from(!twice);
    }
    !communicator.any(count != size)
}
