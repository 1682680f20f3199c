//! Spectra along lines of equally spaced nodes in a periodic direction, or around circles.

use super::AROUND;
use super::bins::Bins;
use crate::{Fluid, FluidError};
use fibreflow_parallel::Communicator;
use rayon::prelude::*;
use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};
use std::f64::consts::TAU;
use std::sync::Arc;

/// u₁², u₂², u₃² and u₁u₂ by wavenumber.
pub(super) const PRODUCTS: usize = 4;

/// Share of the spacing by which nodes of a line may be off their place.
const OFF: f64 = 1e-6;

/// Share of a bin's volume that may not lie on circles where it has spectra around.
const BARE: f64 = 1e-6;

/// Lines along one axis or around, each whole on the rank that transforms it, and the sums of their spectra.
pub(super) struct Lines {
    /// Axis, or [`AROUND`].
    pub axis: usize,
    /// Length of the period \[m\]; around: 2π.
    pub length: f64,
    /// Nodes of a line.
    pub count: usize,
    /// Owned nodes by the rank that they go to.
    leaving: Vec<Vec<u32>>,
    /// By the rank that they come from, where values belong: line × count + place; none where they are on no line.
    arriving: Vec<Vec<Option<u32>>>,
    /// Bins that consist of lines.
    pub bins: Vec<usize>,
    /// Bin and share of the bin's volume of every line of this rank.
    lines: Vec<(u32, f64)>,
    transform: Arc<dyn RealToComplex<f64>>,
    /// This rank's part of the weighted sums: bin, product, wavenumber.
    pub sums: Vec<f64>,
}

impl Lines {
    /// Collective.
    ///
    /// # Errors
    /// A direction that is not periodic, or a mesh that is not equally spaced along it; around: no rings, or none of circles.
    pub fn new(fluid: &Fluid, bins: &Bins, axis: usize) -> Result<Self, FluidError> {
        let mesh = fluid.mesh();
        let communicator = mesh.halo.communicator();
        let name = ["x", "y", "z", "the circles"][axis];
        let refused = |why: &str| FluidError::Statistics {
            problem: format!("spectra along {name}: {why}"),
        };
        let (length, leaving, received) = if axis == AROUND {
            let Some(around) = bins.around() else {
                return Err(refused("nodes are not averaged in rings"));
            };
            let (leaving, received) = send_keys(fluid, bins, 1e-8 * bins.extent, around);
            (TAU, leaving, received)
        } else {
            let along = |v: &[f64; 3]| v[axis] != 0.0 && (0..3).all(|c| c == axis || v[c] == 0.0);
            let period = mesh.periods.vectors.iter().find(|v| along(v));
            let Some(length) = period.map(|v| v[axis].abs()) else {
                return Err(refused("the mesh is not periodic in this direction"));
            };
            let turned = |x: [f64; 3]| [x[(axis + 1) % 3], x[(axis + 2) % 3], x[axis]];
            let (leaving, received) = send_keys(fluid, bins, 1e-8 * length, turned);
            (length, leaving, received)
        };
        let nodes = sorted(&received);
        let even: Vec<&[Node]> = nodes
            .chunk_by(|(a, ..), (b, ..)| a[..2] == b[..2])
            .filter(|line| is_even(line, length))
            .collect();
        let longest = even.iter().map(|line| line.len()).max().unwrap_or(0);
        let count = communicator.max(longest as f64) as usize;
        let placed = place(&received, &even, count);
        let left = placed.lines.len() * count != nodes.len();
        // In the middle of a pipe nodes lie on no circles.
        if axis != AROUND && communicator.any(left) {
            return Err(refused(
                "the nodes are not on lines of equal spacing, all of as many nodes, that lie in planes or rings",
            ));
        }
        let mut covered = vec![0.0; bins.len()];
        for &(bin, volume) in &placed.lines {
            covered[bin as usize] += volume;
        }
        communicator.sum_slice(&mut covered);
        let whole = |&bin: &usize| covered[bin] > (1.0 - BARE) * bins.volumes[bin];
        let of_lines: Vec<usize> = (0..bins.len()).filter(whole).collect();
        if of_lines.is_empty() {
            return Err(refused(
                "no ring consists of circles of equally spaced nodes",
            ));
        }
        let share = |&(bin, volume): &(u32, f64)| (bin, volume / bins.volumes[bin as usize]);
        Ok(Self {
            axis,
            length,
            count,
            leaving,
            arriving: placed.slots,
            bins: of_lines,
            lines: placed.lines.iter().map(share).collect(),
            transform: RealFftPlanner::new().plan_fft_forward(count),
            sums: vec![0.0; bins.len() * PRODUCTS * (count / 2 + 1)],
        })
    }

    /// Wavenumbers of the transform.
    pub fn waves(&self) -> usize {
        self.count / 2 + 1
    }

    /// Adds the spectra of the velocity, times `weight`. Collective.
    pub fn sample(&mut self, fluid: &Fluid, bins: &Bins, weight: f64) {
        let (mesh, velocity) = (fluid.mesh(), fluid.velocity());
        let value = |&i: &u32| {
            let (u, x) = (velocity[i as usize], mesh.nodes[i as usize]);
            bins.local(x, [u[0], u[1], u[2]])
        };
        let outgoing = (self.leaving.iter())
            .map(|nodes| nodes.iter().map(value).collect())
            .collect();
        let incoming: Vec<Vec<[f64; 3]>> = mesh.halo.communicator().exchange(outgoing);
        let (count, waves) = (self.count, self.waves());
        let mut values = vec![0.0; self.lines.len() * 3 * count];
        for (slots, incoming) in self.arriving.iter().zip(&incoming) {
            let placed = slots.iter().zip(incoming);
            for (slot, u) in placed.filter_map(|(slot, u)| slot.map(|slot| (slot as usize, u))) {
                let (line, place) = (slot / count, slot % count);
                (0..3).for_each(|c| values[(3 * line + c) * count + place] = u[c]);
            }
        }
        let transform = &self.transform;
        let spectra: Vec<Vec<Complex<f64>>> = values
            .par_chunks_mut(3 * count)
            .map(|line| transform_line(transform.as_ref(), line, count))
            .collect();
        let scale = 1.0 / (count * count) as f64;
        for (&(bin, share), spectrum) in self.lines.iter().zip(&spectra) {
            let start = bin as usize * PRODUCTS * waves;
            let sums = &mut self.sums[start..start + PRODUCTS * waves];
            for k in 0..waves {
                let alone = k == 0 || 2 * k == count;
                let factor = weight * share * scale * if alone { 1.0 } else { 2.0 };
                let u = [0, 1, 2].map(|c| spectrum[c * waves + k]);
                for c in 0..3 {
                    sums[c * waves + k] += factor * u[c].norm_sqr();
                }
                sums[3 * waves + k] += factor * (u[0] * u[1].conj()).re;
            }
        }
    }
}

/// Transforms of the three components of a line.
fn transform_line(
    transform: &dyn RealToComplex<f64>,
    line: &mut [f64],
    count: usize,
) -> Vec<Complex<f64>> {
    let waves = count / 2 + 1;
    let mut spectrum = vec![Complex::default(); 3 * waves];
    let mut scratch = transform.make_scratch_vec();
    for (values, out) in line
        .chunks_exact_mut(count)
        .zip(spectrum.chunks_exact_mut(waves))
    {
        // The lengths are those of the plan.
        let _ = transform.process_with_scratch(values, out, &mut scratch);
    }
    spectrum
}

/// What a node says of itself: its line by two rounded coordinates, its place along it, its volume \[m³\], its bin.
type Key = [u64; 5];

/// A key, the rank that it came from and its number there.
type Node = (Key, usize, usize);

/// Owned nodes by the rank that holds their line, and the keys that arrived from every rank; `turned` gives the two coordinates of a
/// line, which are rounded to `grain`, and the place along it. Collective.
fn send_keys(
    fluid: &Fluid,
    bins: &Bins,
    grain: f64,
    turned: impl Fn([f64; 3]) -> [f64; 3],
) -> (Vec<Vec<u32>>, Vec<Vec<Key>>) {
    let mesh = fluid.mesh();
    let communicator = mesh.halo.communicator();
    let volumes = fluid.operators.volumes();
    // Coordinates of a line differ by round-off; an offset keeps round numbers away from the edges of the rounding.
    let round = |x: f64| ((x / grain + 0.381_966).floor() as i64) as u64;
    let mut leaving: Vec<Vec<u32>> = vec![Vec::new(); communicator.size()];
    let mut keys: Vec<Vec<Key>> = vec![Vec::new(); communicator.size()];
    for (i, (x, v)) in mesh.nodes.iter().zip(volumes).enumerate() {
        let [a, b, along] = turned(*x);
        let line = [round(a), round(b)];
        let home = (mixed(line) % communicator.size() as u64) as usize;
        leaving[home].push(i as u32);
        let [a, b] = line;
        keys[home].push([a, b, along.to_bits(), v.to_bits(), u64::from(bins.of[i])]);
    }
    (leaving, communicator.exchange(keys))
}

/// Spreads lines over ranks (finaliser of SplitMix64).
fn mixed([a, b]: [u64; 2]) -> u64 {
    let mut z = a ^ b.rotate_left(32) ^ 0x9e37_79b9_7f4a_7c15;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Where the nodes that arrived belong.
struct Placed {
    slots: Vec<Vec<Option<u32>>>,
    /// Bin and volume \[m³\].
    lines: Vec<(u32, f64)>,
}

/// Line after line, each in its order.
fn sorted(received: &[Vec<Key>]) -> Vec<Node> {
    let mut order: Vec<Node> = Vec::new();
    for (rank, keys) in received.iter().enumerate() {
        order.extend(keys.iter().enumerate().map(|(k, &key)| (key, rank, k)));
    }
    order.sort_unstable_by(|(a, ..), (b, ..)| {
        let along = || f64::from_bits(a[2]).total_cmp(&f64::from_bits(b[2]));
        (a[0], a[1]).cmp(&(b[0], b[1])).then_with(along)
    });
    order
}

/// The nodes of a line are equally spaced over a period, and in one bin.
fn is_even(line: &[Node], length: f64) -> bool {
    let (start, ..) = line[0];
    let (origin, spacing) = (f64::from_bits(start[2]), length / line.len() as f64);
    line.iter().enumerate().all(|(k, (key, ..))| {
        let off = f64::from_bits(key[2]) - origin - k as f64 * spacing;
        key[4] == start[4] && off.abs() < OFF * spacing
    })
}

/// The lines of `count` nodes.
fn place(received: &[Vec<Key>], even: &[&[Node]], count: usize) -> Placed {
    let mut placed = Placed {
        slots: received.iter().map(|r| vec![None; r.len()]).collect(),
        lines: Vec::new(),
    };
    for line in even.iter().filter(|line| line.len() == count) {
        let number = placed.lines.len();
        for (k, &(_, rank, at)) in line.iter().enumerate() {
            placed.slots[rank][at] = Some((number * count + k) as u32);
        }
        let volume = line.iter().map(|(key, ..)| f64::from_bits(key[3])).sum();
        placed.lines.push((line[0].0[4] as u32, volume));
    }
    placed
}

impl std::fmt::Debug for Lines {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        (f.debug_struct("Lines"))
            .field("axis", &self.axis)
            .field("count", &self.count)
            .finish_non_exhaustive()
    }
}

/// Sum of spectra that is one function of the separation: Σ_k E_k cos(2πk m/N), m = 0…N/2.
pub(super) fn correlation(spectrum: &[f64], count: usize) -> Vec<f64> {
    let inverse = RealFftPlanner::new().plan_fft_inverse(count);
    let half = |(k, e): (usize, &f64)| {
        let alone = k == 0 || 2 * k == count;
        Complex::new(if alone { *e } else { 0.5 * e }, 0.0)
    };
    let mut input: Vec<Complex<f64>> = spectrum.iter().enumerate().map(half).collect();
    let mut output = vec![0.0; count];
    // The lengths are those of the plan.
    let _ = inverse.process(&mut input, &mut output);
    output.truncate(count / 2 + 1);
    output
}

/// Sum over ranks, in place. Collective.
pub(super) fn reduced(sums: &[f64], communicator: &Communicator) -> Vec<f64> {
    let mut all = sums.to_vec();
    communicator.sum_slice(&mut all);
    all
}
