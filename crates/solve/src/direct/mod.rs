//! Direct solver for tensor-product meshes (NUMERICS section 1).
//!
//! (K_x H_y H_z + H_x K_y H_z + H_x H_y K_z) c + m H_x H_y H_z, with K and H of three [`Line`]s. Two directions are
//! diagonalised, by Fourier transforms where they are uniform and periodic and by their eigenvectors otherwise; in the
//! third a banded system is solved for every mode (Costa 2018; with eigenvectors: Lynch, Rice & Thomas 1964).
//!
//! Planes of the first two directions are transformed one after another and stay in the cache; modes are stored
//! block by block with all their planes, so that a block is swept in the cache as well. Across ranks: nodes are sent
//! to whoever has their plane, planes are transposed to blocks of modes, and back.

mod banded;
mod cost;
#[cfg_attr(not(feature = "fft"), path = "no_fourier.rs")]
mod fourier;
mod plane;
mod slabs;
mod spectrum;
mod waves;

use crate::vectors::{BLOCK, Partials};
use crate::{Preconditioner, SolveError};
use banded::{Banded, LANES};
use fibreflow_mesh::{Line, TensorGrid};
use fibreflow_parallel::{Communicator, Halo};
use plane::{PlaneTransform, Room};
use rayon::prelude::*;
use slabs::{Shares, SlabRoom, Slabs, Transposition};
pub use waves::Waves;

/// Bytes of the planes that are transformed at a time by one thread: they wait in its cache to be dealt out to modes.
const BATCH_BYTES: usize = 1 << 18;

/// Exact inverse of (K_x H_y H_z + H_x K_y H_z + H_x H_y K_z) c + m H_x H_y H_z on the nodes of a tensor grid.
///
/// Rows of nodes on fixed ends are the identity, their couplings taken out, as in [`crate::PairMatrix`]. With m = 0 and
/// no fixed end constants are the null space: they are taken out of the right-hand side, and the answer has mean zero.
pub struct Direct {
    communicator: Communicator,
    owned: usize,
    /// Directions in the order of their roles: inside a plane, across its rows, banded.
    axes: [usize; 3],
    /// First free plane of the banded direction.
    first_plane: usize,
    transform: PlaneTransform,
    banded: Banded,
    /// λ_a + λ_b + m/c, padded to whole blocks.
    eigenvalues: Vec<f64>,
    /// c.
    coefficient: f64,
    singular: bool,
    free_mass: bool,
    /// Steps in a field from a node to the next of its row, row and plane.
    strides: [usize; 3],
    /// The role of the direction with the largest step.
    slowest: usize,
    /// None where this rank holds all nodes in lexicographic order.
    slabs: Option<Slabs>,
    shares: Shares,
    /// Owned nodes on fixed ends.
    fixed: Vec<u32>,
    /// Planes in work at a time.
    batch: usize,
    scalar: Option<Work>,
    vector: Option<Work>,
    partials: Partials<3>,
}

/// Room for right-hand sides of one or three components.
struct Work {
    components: usize,
    /// One a plane of a batch and component.
    rooms: Vec<Room>,
    /// (own block, plane, part, lane).
    modes: Vec<f64>,
    transposition: Transposition,
    slab: Option<SlabRoom>,
}

impl Direct {
    /// The solver with c = 1 and m = `shift` (1/m²). Collective.
    ///
    /// `halo` is that of the mesh of `grid`. `fixed_ends[d]`: the nodes at the low and high end of direction d are
    /// Dirichlet nodes (not of periodic directions).
    ///
    /// # Errors
    /// [`SolveError::Length`] when the lines do not fit the grid, [`SolveError::Eigenvectors`].
    pub fn new(
        halo: &Halo,
        grid: &TensorGrid,
        lines: &[Line; 3],
        fixed_ends: [[bool; 2]; 3],
        shift: f64,
    ) -> Result<Self, SolveError> {
        check_lines(halo, grid, lines)?;
        let axes = roles(lines);
        let [a, b, _] = axes;
        let transform =
            PlaneTransform::new([&lines[a], &lines[b]], [fixed_ends[a], fixed_ends[b]])?;
        let banded = Banded::new(&lines[axes[2]], fixed_ends[axes[2]]);
        Self::assemble((halo, grid), fixed_ends, axes, (transform, banded), shift)
    }

    /// With K of direction `axis` only: (H H K c + m H H H), a banded solve for every line. As [`Direct::new`]
    /// otherwise; m > 0. Collective.
    ///
    /// # Errors
    /// [`SolveError::Length`] when the lines do not fit the grid.
    pub fn along(
        axis: usize,
        halo: &Halo,
        grid: &TensorGrid,
        lines: &[Line; 3],
        fixed_ends: [[bool; 2]; 3],
        shift: f64,
    ) -> Result<Self, SolveError> {
        check_lines(halo, grid, lines)?;
        let others = [[1, 2], [0, 2], [0, 1]][axis];
        let transform =
            PlaneTransform::diagonal(others.map(|d| &lines[d]), others.map(|d| fixed_ends[d]));
        let mut banded = Banded::new(&lines[axis], fixed_ends[axis]);
        banded.shared = true;
        let axes = [others[0], others[1], axis];
        Self::assemble((halo, grid), fixed_ends, axes, (transform, banded), shift)
    }

    fn assemble(
        (halo, grid): (&Halo, &TensorGrid),
        fixed_ends: [[bool; 2]; 3],
        axes: [usize; 3],
        (transform, banded): (PlaneTransform, Banded),
        shift: f64,
    ) -> Result<Self, SolveError> {
        let (counts, [a, b, c]) = (grid.counts(), axes);
        let modes = transform.eigenvalues.len();
        let shares = Shares::new(halo.communicator(), banded.size(), modes.div_ceil(LANES));
        let first_plane = usize::from(fixed_ends[c][0]);
        let is_fixed = |at: [u32; 3]| {
            let end = |d: usize| {
                let (at, last) = (at[d] as usize, counts[d] - 1);
                (fixed_ends[d][0] && at == 0) || (fixed_ends[d][1] && at == last)
            };
            (0..3).any(end)
        };
        let owned_indices = &grid.indices[..halo.owned()];
        let lexicographic = |(i, at): (usize, &[u32; 3])| {
            let [x, y, z] = at.map(|k| k as usize);
            i == x + counts[0] * (y + counts[1] * z)
        };
        let whole =
            halo.communicator().size() == 1 && owned_indices.iter().enumerate().all(lexicographic);
        let (slabs, strides) = if whole {
            let natural = [1, counts[0], counts[0] * counts[1]];
            (None, axes.map(|axis| natural[axis]))
        } else {
            let area = counts[a] * counts[b];
            let place = |i: usize| {
                let at = owned_indices[i].map(|k| k as usize);
                let plane = at[c].checked_sub(first_plane)?;
                (plane < banded.size()).then_some((plane, at[a] + counts[a] * at[b]))
            };
            let slabs = Slabs::new(halo, &shares, area, place);
            (Some(slabs), [1, counts[a], area])
        };
        let long = (0..2).filter(|&role| counts[axes[role]] > 1 && strides[role] >= strides[2]);
        let slowest = long.max_by_key(|&role| strides[role]).unwrap_or(2);
        let bytes = 32 * counts[a] * counts[b];
        let mut direct = Self {
            communicator: halo.communicator().clone(),
            owned: halo.owned(),
            axes,
            first_plane,
            batch: rayon::current_num_threads() * (BATCH_BYTES / bytes).max(1),
            eigenvalues: vec![1.0; modes.div_ceil(LANES) * LANES],
            transform,
            banded,
            coefficient: 1.0,
            singular: false,
            free_mass: fixed_ends == [[false; 2]; 3],
            strides,
            slowest,
            slabs,
            shares,
            fixed: (0..halo.owned() as u32)
                .filter(|&i| is_fixed(owned_indices[i as usize]))
                .collect(),
            scalar: None,
            vector: None,
            partials: Partials::default(),
        };
        direct.set(shift, 1.0);
        Ok(direct)
    }

    /// Takes new m ≥ 0 \[–\] and c > 0, for instance of an implicit viscous step; does not allocate.
    pub fn set(&mut self, mass: f64, coefficient: f64) {
        let shift = mass / coefficient;
        for (sum, pair) in self.eigenvalues.iter_mut().zip(&self.transform.eigenvalues) {
            *sum = pair + shift;
        }
        self.coefficient = coefficient;
        self.singular = self.free_mass && shift == 0.0;
        let mut own = self.shares.own_blocks();
        let first = own.start == 0 && !own.is_empty();
        if self.banded.shared && !own.is_empty() {
            own = 0..1;
        }
        let eigenvalues = &self.eigenvalues[own.start * LANES..own.end * LANES];
        self.banded.factorise(eigenvalues, self.singular && first);
    }

    /// Which ends of the directions are fixed, when the fixed nodes (total length) are whole ends of directions that
    /// are not periodic, and nothing else. Collective.
    pub fn fixed_ends(halo: &Halo, grid: &TensorGrid, fixed: &[bool]) -> Option<[[bool; 2]; 3]> {
        let counts = grid.counts();
        let owned = grid.indices[..halo.owned()].iter().zip(fixed);
        let at_end = |at: &[u32; 3], d: usize, end: usize| {
            grid.periods[d].is_none() && at[d] as usize == [0, counts[d] - 1][end]
        };
        let mut ends = [[false; 2]; 3];
        for d in 0..3 {
            for end in 0..2 {
                let mut nodes = owned.clone().filter(|(at, _)| at_end(at, d, end));
                let free = nodes.any(|(_, &fixed)| !fixed);
                ends[d][end] = grid.periods[d].is_none() && !halo.communicator().any(free);
            }
        }
        let on_ends =
            |at: &[u32; 3]| (0..6).any(|k| ends[k / 2][k % 2] && at_end(at, k / 2, k % 2));
        let inside = owned.clone().any(|(at, &fixed)| fixed && !on_ends(at));
        (!halo.communicator().any(inside)).then_some(ends)
    }

    /// How each direction is solved, for instance "x: FFT, y: tridiagonal, z: FFT".
    pub fn describe(&self) -> String {
        let [a, b] = self.transform.names();
        let names = [a, b, self.banded.name()];
        let mut directions: Vec<_> = self.axes.into_iter().zip(names).collect();
        directions.sort_unstable();
        let name = |(axis, name): &(usize, &str)| format!("{}: {name}", ["x", "y", "z"][*axis]);
        directions.iter().map(name).collect::<Vec<_>>().join(", ")
    }

    /// Floating-point operations of a solve of one component on all ranks.
    pub fn operations(&self) -> f64 {
        let planes = self.banded.size() as f64;
        let lanes = if self.transform.is_complex() {
            2.0
        } else {
            1.0
        };
        let modes = lanes * self.transform.eigenvalues.len() as f64;
        planes * (2.0 * self.transform.operations() + modes * self.banded.operations())
    }

    /// x = A⁻¹ b on owned nodes; both have owned length or longer. Collective; allocates the first time only.
    pub fn solve(&mut self, rhs: &[f64], x: &mut [f64]) {
        let mut work = self.scalar.take().unwrap_or_else(|| self.work(1));
        self.run(&mut work, [1, 1], &rhs[..self.owned], &mut x[..self.owned]);
        self.scalar = Some(work);
    }

    /// The same for the three components of vectors; the fourth lane of `x` becomes zero.
    pub fn solve_vectors(&mut self, rhs: &[[f64; 4]], x: &mut [[f64; 4]]) {
        let mut work = self.vector.take().unwrap_or_else(|| self.work(3));
        let rhs = bytemuck::cast_slice(&rhs[..self.owned]);
        let x = &mut x[..self.owned];
        x.fill([0.0; 4]);
        self.run(&mut work, [4, 3], rhs, bytemuck::cast_slice_mut(x));
        self.vector = Some(work);
    }

    fn work(&self, components: usize) -> Work {
        let parts = self.parts(components);
        let planes = self.banded.size();
        let area = self.transform.counts[0] * self.transform.counts[1];
        let batch = self.batch.min(self.shares.own_planes().len());
        let rooms = (0..batch * components).map(|_| self.transform.room());
        let slabs = self.slabs.as_ref();
        Work {
            components,
            rooms: rooms.collect(),
            modes: vec![0.0; self.shares.own_blocks().len() * planes * parts * LANES],
            transposition: Transposition::new(&self.shares, parts),
            slab: slabs.map(|slabs| slabs.room(&self.shares, area, components)),
        }
    }

    /// Real numbers of a mode and plane.
    fn parts(&self, components: usize) -> usize {
        components * if self.transform.is_complex() { 2 } else { 1 }
    }

    fn run(&mut self, work: &mut Work, shape: [usize; 2], rhs: &[f64], x: &mut [f64]) {
        let planes = self.banded.size();
        let mean = if self.singular && !self.transform.is_fourier() {
            self.mean(rhs, shape)
        } else {
            [0.0; 3]
        };
        match (&self.slabs, &mut work.slab) {
            (Some(slabs), Some(room)) => {
                slabs.gather(&self.shares, room, rhs, shape);
                let values = std::mem::take(&mut room.values);
                self.to_modes(work, &values, shape[1], &mean);
                if let Some(room) = &mut work.slab {
                    room.values = values;
                }
            }
            _ => {
                let skipped = self.first_plane * self.strides[2] * shape[0];
                self.to_modes(work, &rhs[skipped.min(rhs.len())..], shape[0], &mean);
            }
        }
        let Work {
            modes,
            transposition,
            ..
        } = work;
        transposition.bring_to_modes(&self.shares, planes, modes);
        let parts = self.parts(shape[1]);
        let in_first_mode = self.singular && self.transform.is_fourier();
        if in_first_mode {
            self.take_mean_out(modes, parts);
        }
        self.banded.solve(modes, parts);
        if in_first_mode {
            self.take_mean_out(modes, parts);
        }
        transposition.bring_to_planes(&self.shares, planes, modes);
        match (&self.slabs, work.slab.take()) {
            (Some(slabs), Some(mut room)) => {
                self.to_values(work, &mut room.values, shape[1]);
                slabs.scatter(&self.shares, &mut room, x, shape);
                work.slab = Some(room);
            }
            _ => {
                let skipped = self.first_plane * self.strides[2] * shape[0];
                let skipped = skipped.min(x.len());
                self.to_values(work, &mut x[skipped..], shape[0]);
            }
        }
        for &i in &self.fixed {
            let i = i as usize * shape[0];
            x[i..i + shape[1]].copy_from_slice(&rhs[i..i + shape[1]]);
        }
        if self.singular && !self.transform.is_fourier() {
            let mean = self.mean(x, shape);
            for (component, mean) in mean.into_iter().enumerate().take(shape[1]) {
                let values = x.iter_mut().skip(component).step_by(shape[0]);
                values.for_each(|v| *v -= mean);
            }
        }
    }

    /// Transforms the planes of this rank, batch by batch, and deals them out to blocks of modes.
    fn to_modes(&self, work: &mut Work, values: &[f64], width: usize, mean: &[f64; 3]) {
        let Work {
            components,
            rooms,
            modes,
            transposition,
            ..
        } = work;
        let components = *components;
        let (own, all) = (self.shares.own_planes(), self.banded.size());
        let parts = self.parts(components);
        let scale = self.transform.scale / self.coefficient;
        for first in own.clone().step_by(self.batch) {
            let planes = first..own.end.min(first + self.batch);
            let rooms = &mut rooms[..planes.len() * components];
            rooms.par_iter_mut().enumerate().for_each(|(k, room)| {
                let (plane, component) = (planes.start + k / components, k % components);
                let plane = plane - self.local_origin();
                self.read(
                    values,
                    [width, component, plane],
                    mean[component],
                    &mut room.values,
                );
                self.transform.forward(room);
            });
            for (rank, blocks) in self.shares.blocks.iter().enumerate() {
                let (target, origin, stride) = if rank == self.shares.rank() {
                    (&mut modes[..], 0, all)
                } else {
                    let mut messages = transposition.theirs.iter_mut();
                    match messages.find(|(r, _)| *r == rank) {
                        Some((_, message)) => (&mut message[..], own.start, own.len()),
                        None => continue,
                    }
                };
                let blocks = target
                    .par_chunks_exact_mut(stride * parts * LANES)
                    .zip(blocks.clone());
                blocks.for_each(|(block, index)| {
                    for (k, room) in rooms.iter().enumerate() {
                        let (plane, component) = (first + k / components, k % components);
                        let part = (plane - origin) * parts + component * parts / components;
                        self.split(&room.modes, index, scale, &mut block[part * LANES..]);
                    }
                });
            }
        }
    }

    /// The way back.
    fn to_values(&self, work: &mut Work, values: &mut [f64], width: usize) {
        let Work {
            components,
            rooms,
            modes,
            transposition,
            ..
        } = work;
        let components = *components;
        let (own, all) = (self.shares.own_planes(), self.banded.size());
        let parts = self.parts(components);
        for first in own.clone().step_by(self.batch) {
            let planes = first..own.end.min(first + self.batch);
            let rooms = &mut rooms[..planes.len() * components];
            rooms.par_iter_mut().enumerate().for_each(|(k, room)| {
                let (plane, component) = (planes.start + k / components, k % components);
                for (rank, blocks) in self.shares.blocks.iter().enumerate() {
                    let (source, origin, stride) = if rank == self.shares.rank() {
                        (&modes[..], 0, all)
                    } else {
                        let mut messages = transposition.theirs.iter();
                        match messages.find(|(r, _)| *r == rank) {
                            Some((_, message)) => (&message[..], own.start, own.len()),
                            None => continue,
                        }
                    };
                    let part = (plane - origin) * parts + component * parts / components;
                    let blocks = source
                        .chunks_exact(stride * parts * LANES)
                        .zip(blocks.clone());
                    for (block, index) in blocks {
                        self.join(&block[part * LANES..], index, &mut room.modes);
                    }
                }
                self.transform.inverse(room);
            });
            let origin = planes.start - self.local_origin();
            self.write(rooms, components, origin, width, values);
        }
    }

    /// First plane of what [`Direct::read`] reads.
    fn local_origin(&self) -> usize {
        match self.slabs {
            Some(_) => self.shares.own_planes().start,
            None => 0,
        }
    }

    /// A plane of a component, less `mean`.
    fn read(
        &self,
        field: &[f64],
        [width, component, plane]: [usize; 3],
        mean: f64,
        values: &mut [f64],
    ) {
        let [along, across, planes] = self.strides.map(|s| s * width);
        let first = component + plane * planes;
        let n_a = self.transform.counts[0];
        for (b, row) in values.chunks_exact_mut(n_a).enumerate() {
            let source = &field[first + b * across..];
            if along == 1 {
                row.iter_mut().zip(source).for_each(|(v, s)| *v = s - mean);
            } else {
                let source = source.iter().step_by(along);
                row.iter_mut().zip(source).for_each(|(v, s)| *v = s - mean);
            }
        }
    }

    /// The planes of a batch from `origin` on into a field, in parallel over its slowest direction.
    fn write(
        &self,
        rooms: &[Room],
        components: usize,
        origin: usize,
        width: usize,
        field: &mut [f64],
    ) {
        let strides = self.strides.map(|s| s * width);
        let [along, across, planes] = strides;
        let [n_a, n_b] = self.transform.counts;
        let slices = field.par_chunks_mut(strides[self.slowest]).enumerate();
        slices.for_each(|(s, field)| {
            for (k, room) in rooms.iter().enumerate() {
                let (plane, component) = (origin + k / components, k % components);
                let start = component + plane * planes;
                let (rows, columns, first) = match self.slowest {
                    0 => (0..n_b, s..(s + 1).min(n_a), start),
                    1 => (s..(s + 1).min(n_b), 0..n_a, start),
                    _ if plane == s => (0..n_b, 0..n_a, component),
                    _ => continue,
                };
                for b in rows.clone() {
                    let row = &room.values[b * n_a..][columns.clone()];
                    let to = &mut field[first + (b - rows.start) * across..];
                    if along == 1 {
                        to[..row.len()].copy_from_slice(row);
                    } else {
                        let to = to.iter_mut().step_by(along);
                        to.zip(row).for_each(|(to, v)| *to = *v);
                    }
                }
            }
        });
    }

    /// Modes of a block out of those of a plane: real parts, then imaginary parts.
    fn split(&self, modes: &[f64], block: usize, scale: f64, to: &mut [f64]) {
        if self.transform.is_complex() {
            let modes = &modes.as_chunks::<2>().0[block * LANES..];
            let (real, rest) = to.split_at_mut(LANES);
            let parts = real.iter_mut().zip(rest);
            for ((re, im), mode) in parts.zip(modes) {
                (*re, *im) = (scale * mode[0], scale * mode[1]);
            }
        } else {
            let modes = &modes[block * LANES..];
            let to = to[..LANES].iter_mut();
            to.zip(modes).for_each(|(to, mode)| *to = scale * mode);
        }
    }

    fn join(&self, from: &[f64], block: usize, modes: &mut [f64]) {
        if self.transform.is_complex() {
            let modes = &mut modes.as_chunks_mut::<2>().0[block * LANES..];
            let (real, rest) = from.split_at(LANES);
            let parts = real.iter().zip(rest);
            for ((&re, &im), mode) in parts.zip(modes) {
                *mode = [re, im];
            }
        } else {
            let modes = &mut modes[block * LANES..];
            let from = from[..LANES].iter();
            modes
                .iter_mut()
                .zip(from)
                .for_each(|(mode, from)| *mode = *from);
        }
    }

    /// Makes the mean of the first mode over its planes zero.
    fn take_mean_out(&self, modes: &mut [f64], parts: usize) {
        let planes = self.banded.size();
        let own = self.shares.own_blocks();
        if own.start > 0 || own.is_empty() {
            return;
        }
        let block = &mut modes[..planes * parts * LANES];
        for part in (0..parts).step_by(2) {
            let column = || (part * LANES..).step_by(parts * LANES).take(planes);
            let mean = column().map(|k| block[k]).sum::<f64>() / planes as f64;
            column().for_each(|k| block[k] -= mean);
        }
    }

    /// Mean of every component over the nodes of all ranks.
    fn mean(&mut self, field: &[f64], [width, components]: [usize; 2]) -> [f64; 3] {
        let parts = field.par_chunks(BLOCK * width).map(|block| {
            let mut sums = [0.0; 3];
            for (component, sum) in sums.iter_mut().enumerate().take(components) {
                *sum = block.iter().skip(component).step_by(width).sum();
            }
            sums
        });
        let [x, y, z] = self.partials.sum(parts);
        let mut sums = [x, y, z, self.owned as f64];
        self.communicator.sum_slice(&mut sums);
        std::array::from_fn(|c| sums[c] / sums[3].max(1.0))
    }
}

/// The directions inside a plane, across its rows and banded: the largest direction that no Fourier transform takes is
/// banded, else the larger of y and z; Fourier transforms come first.
fn roles(lines: &[Line; 3]) -> [usize; 3] {
    let fourier = lines
        .each_ref()
        .map(|line| spectrum::fourier(line).is_some());
    let others = (0..3).filter(|&d| !fourier[d]);
    let banded = others.max_by_key(|&d| lines[d].len());
    let banded = banded.unwrap_or(if lines[2].len() >= lines[1].len() {
        2
    } else {
        1
    });
    let mut rest = [0, 1, 2].into_iter().filter(|&d| d != banded);
    let (low, high) = (rest.next().unwrap_or(0), rest.next().unwrap_or(1));
    let long = |d: usize| fourier[d] && lines[d].len() > 1;
    let swap = (fourier[high] && !fourier[low]) || (long(high) && !long(low));
    if swap {
        [high, low, banded]
    } else {
        [low, high, banded]
    }
}

fn check_lines(halo: &Halo, grid: &TensorGrid, lines: &[Line; 3]) -> Result<(), SolveError> {
    for (line, &expected) in lines.iter().zip(&grid.counts()) {
        check_length("line", line.len(), expected)?;
    }
    check_length("indices of the grid", grid.indices.len(), halo.total())
}

fn check_length(what: &'static str, found: usize, expected: usize) -> Result<(), SolveError> {
    if found == expected {
        return Ok(());
    }
    Err(SolveError::Length {
        what,
        found,
        expected,
    })
}

impl Preconditioner<f64> for Direct {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        self.solve(r, z);
    }
}

impl Preconditioner<[f64; 4]> for Direct {
    fn apply(&mut self, r: &[[f64; 4]], z: &mut [[f64; 4]]) {
        self.solve_vectors(r, z);
    }
}
