//! Compressed rows of pairs, gathered over the elements of each row in blocks of rows.

use super::element::{self, Form, Inversion};
use crate::{ElementKind, Image, LocalMesh};
use rayon::prelude::*;
use std::ops::Range;

/// Where and why the assembly stopped; without an inversion the element spans more than one period.
#[derive(Clone, Copy, Debug)]
pub(super) struct Failure {
    pub element: usize,
    pub inversion: Option<Inversion>,
}

/// Rows of consecutive owned nodes; see [`crate::DualGeometry`] for the arrays.
#[derive(Default)]
pub(super) struct Rows {
    pub offsets: Vec<u32>,
    pub columns: Vec<u32>,
    pub images: Vec<Image>,
    pub faces: Vec<[f64; 4]>,
    pub masses: Vec<f32>,
    pub displacements: Vec<[f64; 3]>,
    pub volumes: Vec<f64>,
    pub self_pairs: Vec<(u32, Image, [f64; 4])>,
}

/// Rows of a block: enough that few elements are computed in two blocks, few enough that their pairs stay small.
const BLOCK: usize = 1 << 14;

impl Rows {
    /// All rows of the owned nodes.
    pub fn assemble(mesh: &LocalMesh, form: Form) -> Result<Self, Failure> {
        let assembly = Assembly::new(mesh, form);
        let owned = mesh.owned();
        let blocks: Vec<Result<Self, Failure>> = (0..owned.div_ceil(BLOCK))
            .into_par_iter()
            .map(|b| assembly.block(b * BLOCK..owned.min((b + 1) * BLOCK)))
            .collect();
        if let Some(first) = blocks
            .iter()
            .filter_map(|b| b.as_ref().err())
            .min_by_key(|f| f.element)
        {
            return Err(*first);
        }
        let entries = blocks.iter().flatten().map(|b| b.columns.len()).sum();
        let mut all = Self {
            offsets: Vec::with_capacity(owned + 1),
            columns: Vec::with_capacity(entries),
            images: Vec::with_capacity(entries),
            faces: Vec::with_capacity(entries),
            masses: Vec::with_capacity(match form {
                Form::TwoPoint => 0,
                Form::Galerkin => entries,
            }),
            displacements: Vec::with_capacity(entries),
            volumes: Vec::with_capacity(mesh.total()),
            self_pairs: Vec::new(),
        };
        all.offsets.push(0);
        for mut block in blocks.into_iter().flatten() {
            let start = all.columns.len() as u32;
            let ends = block.offsets.iter().map(|end| end.wrapping_add(start));
            all.offsets.extend(ends);
            all.columns.append(&mut block.columns);
            all.images.append(&mut block.images);
            all.faces.append(&mut block.faces);
            all.masses.append(&mut block.masses);
            all.displacements.append(&mut block.displacements);
            all.volumes.append(&mut block.volumes);
            all.self_pairs.append(&mut block.self_pairs);
        }
        Ok(all)
    }
}

/// The other vertex of a pair, the pair's place in the element, and whether the pair runs backwards from here.
#[derive(Clone, Copy)]
struct Arm {
    to: u8,
    pair: u8,
    backwards: bool,
}

struct Assembly<'a> {
    mesh: &'a LocalMesh,
    form: Form,
    /// Elements of every owned node, ascending; an element appears once for each of its vertices at the node.
    starts: Vec<u32>,
    elements: Vec<u32>,
    /// Arms of every vertex of every kind.
    arms: [Vec<Vec<Arm>>; 4],
    pairs: [usize; 4],
}

/// One contribution to a row: (column's global index and image, place of the pair, column, runs backwards).
type Term = (u64, u32, u32, bool);

impl<'a> Assembly<'a> {
    fn new(mesh: &'a LocalMesh, form: Form) -> Self {
        let (starts, elements) = incidence(mesh);
        let pairs = ElementKind::ALL.map(|kind| form.pairs(kind));
        let arms = ElementKind::ALL.map(|kind| {
            let mut arms = vec![Vec::new(); 8];
            for (pair, &(a, b)) in pairs[kind as usize].iter().enumerate() {
                let arm = |to, backwards| Arm {
                    to,
                    pair: pair as u8,
                    backwards,
                };
                arms[a as usize].push(arm(b, false));
                arms[b as usize].push(arm(a, true));
            }
            arms
        });
        Self {
            mesh,
            form,
            starts,
            elements,
            arms,
            pairs: pairs.map(|p| p.len()),
        }
    }

    fn elements_of(&self, rows: Range<usize>) -> &[u32] {
        &self.elements[self.starts[rows.start] as usize..self.starts[rows.end] as usize]
    }

    fn block(&self, rows: Range<usize>) -> Result<Rows, Failure> {
        let mut elements = self.elements_of(rows.clone()).to_vec();
        elements.sort_unstable();
        elements.dedup();
        let shares = self.shares(&elements)?;
        let mut block = Rows::default();
        let mut terms: Vec<Term> = Vec::new();
        for i in rows {
            terms.clear();
            let mut volume = 0.0;
            let mut last = u32::MAX;
            for &e in self.elements_of(i..i + 1) {
                if e == last {
                    continue;
                }
                last = e;
                let slot = elements.partition_point(|&other| other < e);
                volume += self.terms(i as u32, e as usize, slot, &shares, &mut terms)?;
            }
            block.volumes.push(volume);
            // The place of a pair grows with the element and its pair: both rows of a pair sum in the same order.
            terms.sort_unstable_by_key(|&(key, place, ..)| (key, place));
            self.finish_row(i, &terms, &shares, &mut block);
        }
        Ok(block)
    }

    /// Pairs and volumes of the elements of a block.
    fn shares(&self, elements: &[u32]) -> Result<Shares, Failure> {
        let mut shares = Shares::default();
        for &e in elements {
            let e = e as usize;
            let kind = self.mesh.elements.kinds[e];
            let x = self
                .mesh
                .elements
                .coordinates(e, &self.mesh.nodes, &self.mesh.periods);
            let given = &mut shares.given;
            shares.pair_starts.push(given.faces.len() as u32);
            shares.volume_starts.push(given.volumes.len() as u32);
            match self.form {
                Form::TwoPoint => element::two_point(&x, given),
                Form::Galerkin => {
                    element::galerkin(kind, &x, given).map_err(|inversion| Failure {
                        element: e,
                        inversion: Some(inversion),
                    })?;
                }
            }
            debug_assert_eq!(
                given.faces.len(),
                shares.pair_starts[shares.pair_starts.len() - 1] as usize
                    + self.pairs[kind as usize]
            );
        }
        Ok(shares)
    }

    /// Appends what element `e` gives to row `i` and returns its share of the dual volume.
    fn terms(
        &self,
        i: u32,
        e: usize,
        slot: usize,
        shares: &Shares,
        terms: &mut Vec<Term>,
    ) -> Result<f64, Failure> {
        let elements = &self.mesh.elements;
        let (nodes, images) = (elements.nodes(e), elements.images(e));
        let arms = &self.arms[elements.kinds[e] as usize];
        let mut volume = 0.0;
        for (a, _) in nodes.iter().enumerate().filter(|(_, node)| **node == i) {
            volume += shares.given.volumes[shares.volume_starts[slot] as usize + a];
            for arm in &arms[a] {
                let b = arm.to as usize;
                let image = if images[a] == images[b] {
                    Image::ZERO
                } else {
                    images[a].to(images[b]).ok_or(Failure {
                        element: e,
                        inversion: None,
                    })?
                };
                let key = self.mesh.global_nodes[nodes[b] as usize] << 5 | u64::from(image.code());
                let place = shares.pair_starts[slot] + u32::from(arm.pair);
                terms.push((key, place, nodes[b], arm.backwards));
            }
        }
        Ok(volume)
    }

    /// Sums the sorted terms of row `i`.
    fn finish_row(&self, i: usize, terms: &[Term], shares: &Shares, block: &mut Rows) {
        for group in terms.chunk_by(|a, b| a.0 == b.0) {
            let (key, _, j, _) = group[0];
            let image = Image::from_code((key & 31) as u8).unwrap_or(Image::ZERO);
            let (mut face, mut mass) = ([0.0; 4], 0.0);
            for &(_, place, _, backwards) in group {
                let share = shares.given.faces[place as usize];
                mass += shares.given.masses.get(place as usize).unwrap_or(&0.0);
                let sign = if backwards { -1.0 } else { 1.0 };
                (0..3).for_each(|c| face[c] += sign * share[c]);
                face[3] += share[3];
            }
            let d = self.displacement(i, j as usize, image);
            if self.form == Form::TwoPoint {
                let along = face[0] * d[0] + face[1] * d[1] + face[2] * d[2];
                face[3] = along / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
            }
            if j as usize == i {
                block.self_pairs.push((j, image, face));
            } else {
                block.columns.push(j);
                block.images.push(image);
                block.faces.push(face);
                if self.form == Form::Galerkin {
                    block.masses.push(mass as f32);
                }
                block.displacements.push(d);
            }
        }
        block.offsets.push(block.columns.len() as u32);
    }

    /// x_j + shift − x_i, computed from the node with the smaller global index, so that both rows agree bitwise.
    fn displacement(&self, i: usize, j: usize, image: Image) -> [f64; 3] {
        let (x, global) = (&self.mesh.nodes, &self.mesh.global_nodes);
        let from = |i: usize, j: usize, image: Image| -> [f64; 3] {
            let shift = self.mesh.periods.shift(image);
            std::array::from_fn(|c| x[j][c] + shift[c] - x[i][c])
        };
        if i == j {
            self.mesh.periods.shift(image)
        } else if global[i] < global[j] {
            from(i, j, image)
        } else {
            from(j, i, image.opposite()).map(|d| -d)
        }
    }
}

/// Pairs and vertex volumes of the elements of a block, with their starts.
#[derive(Default)]
struct Shares {
    pair_starts: Vec<u32>,
    volume_starts: Vec<u32>,
    given: element::Shares,
}

/// Elements of every owned node by counting sort, ascending.
fn incidence(mesh: &LocalMesh) -> (Vec<u32>, Vec<u32>) {
    let owned = mesh.owned();
    let mut starts = vec![0u32; owned + 1];
    let is_owned = |node: &&u32| (**node as usize) < owned;
    for &node in mesh.elements.nodes.iter().filter(is_owned) {
        starts[node as usize + 1] += 1;
    }
    (0..owned).for_each(|i| starts[i + 1] += starts[i]);
    let mut next = starts.clone();
    let mut elements = vec![0; starts[owned] as usize];
    for e in 0..mesh.elements.len() {
        for &node in mesh.elements.nodes(e).iter().filter(is_owned) {
            elements[next[node as usize] as usize] = e as u32;
            next[node as usize] += 1;
        }
    }
    (starts, elements)
}
