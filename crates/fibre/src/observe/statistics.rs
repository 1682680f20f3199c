//! Statistics of directions and shapes over all fibres of all ranks, by sums alone.

use super::Inside;
use crate::hydrodynamics::cox_aspect_ratio;
use crate::placement::orbit_constant;
use crate::{FibreSystem, Matrix3, Vector3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Components of the symmetric ⟨pppp⟩ that are independent, as indices.
pub const FOURTH: [[usize; 4]; 15] = [
    [0, 0, 0, 0],
    [0, 0, 0, 1],
    [0, 0, 0, 2],
    [0, 0, 1, 1],
    [0, 0, 1, 2],
    [0, 0, 2, 2],
    [0, 1, 1, 1],
    [0, 1, 1, 2],
    [0, 1, 2, 2],
    [0, 2, 2, 2],
    [1, 1, 1, 1],
    [1, 1, 1, 2],
    [1, 1, 2, 2],
    [1, 2, 2, 2],
    [2, 2, 2, 2],
];

/// Moments of the directions p of the segments, weighted by their rest lengths (Advani & Tucker 1987).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OrientationMoments {
    /// ⟨pp⟩.
    pub second: Matrix3,
    /// ⟨pppp⟩ in the order of [`FOURTH`].
    pub fourth: [f64; 15],
}

/// Axes of a simple shear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shear {
    /// Unit direction of the flow.
    pub flow: Vector3,
    /// Unit direction of the velocity gradient, across that of the flow.
    pub gradient: Vector3,
}

impl Shear {
    /// From two directions that are not parallel; of the gradient's, the part across the flow counts.
    pub fn new(flow: &Vector3, gradient: &Vector3) -> Self {
        let flow = flow.normalize();
        let gradient = (gradient - flow * flow.dot(gradient)).normalize();
        Self { flow, gradient }
    }

    /// Unit direction of the vorticity's axis, flow × gradient.
    pub fn vorticity(&self) -> Vector3 {
        self.flow.cross(&self.gradient)
    }
}

/// Probability density over equal bins.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    /// Upper end of the last bin; the first begins at 0.
    pub high: f64,
    /// Density in every bin; times the width of a bin, and with `beyond`, the sum is one.
    pub density: Vec<f64>,
    /// Fraction above `high`.
    pub beyond: f64,
}

impl Histogram {
    /// From weights in the bins and, last, beyond them. Zero where there is no weight.
    fn new(high: f64, mut weights: Vec<f64>) -> Self {
        let total: f64 = weights.iter().sum();
        let beyond = weights.pop().unwrap_or(0.0);
        let (share, width) = (
            1.0 / total.max(f64::MIN_POSITIVE),
            high / weights.len() as f64,
        );
        Self {
            high,
            density: weights.iter().map(|w| w * share / width).collect(),
            beyond: beyond * share,
        }
    }
}

/// The bin of a value, `bins` for what is beyond. A value on an edge belongs to the bin above, but for the last edge.
fn bin(value: f64, high: f64, bins: usize) -> usize {
    let place = value / high * bins as f64;
    if place > bins as f64 + EDGE {
        return bins;
    }
    ((place + EDGE) as usize).min(bins - 1)
}

/// Part of a bin by which rounding may move a value.
const EDGE: f64 = 1e-6;

/// Fibres whose contributions are added one after another.
const BLOCK: usize = 128;

impl FibreSystem {
    /// Sums of what each fibre adds to `width` numbers, over all ranks. The order does not depend on the threads.
    fn sums(&self, width: usize, add: impl Fn(usize, &mut [f64]) + Sync) -> Vec<f64> {
        let fibres = self.fibres();
        let blocks: Vec<Vec<f64>> = (0..fibres.div_ceil(BLOCK))
            .into_par_iter()
            .map(|block| {
                let mut sums = vec![0.0; width];
                let end = ((block + 1) * BLOCK).min(fibres);
                (block * BLOCK..end).for_each(|f| add(f, &mut sums));
                sums
            })
            .collect();
        let mut total = vec![0.0; width];
        for sums in blocks {
            total.iter_mut().zip(sums).for_each(|(t, s)| *t += s);
        }
        self.communicator.sum_slice(&mut total);
        total
    }

    /// Chords of the segments of a local fibre \[m\].
    fn chords(&self, fibre: usize) -> impl Iterator<Item = Vector3> {
        let nodes = &self.motion.position[self.model.node_range(fibre)];
        nodes.windows(2).map(|w| w[1] - w[0])
    }

    /// Moments of the directions of all segments of the fibres `inside`. Collective.
    pub fn orientation_moments(&self, inside: &Inside) -> OrientationMoments {
        let sums = self.sums(22, |fibre, sums| {
            if !inside.holds(&self.centre(fibre)) {
                return;
            }
            let segments = &self.model.segments[self.model.segment_range(fibre)];
            for (chord, segment) in self.chords(fibre).zip(segments) {
                let (p, weight) = (chord.normalize(), segment.rest_length);
                sums[0] += weight;
                for (sum, (i, j)) in sums[1..7].iter_mut().zip(SECOND) {
                    *sum += weight * p[i] * p[j];
                }
                for (sum, [i, j, k, l]) in sums[7..].iter_mut().zip(FOURTH) {
                    *sum += weight * p[i] * p[j] * p[k] * p[l];
                }
            }
        });
        let length = sums[0].max(f64::MIN_POSITIVE);
        let mut moments = OrientationMoments::default();
        for (sum, (i, j)) in sums[1..7].iter().zip(SECOND) {
            moments.second[(i, j)] = sum / length;
            moments.second[(j, i)] = sum / length;
        }
        for (moment, sum) in moments.fourth.iter_mut().zip(&sums[7..]) {
            *moment = sum / length;
        }
        moments
    }

    /// Distribution of C/(1 + C) with Jeffery's orbit constant C of the end-to-end direction in a shear, Cox's
    /// equivalent aspect ratio, and the mean; of the fibres `inside`. Collective.
    ///
    /// C = tan θ √(r_e² cos² φ + sin² φ)/r_e (K 6.10, whose root lacks a square), θ from the vorticity's axis.
    pub fn orbit_distribution(
        &self,
        shear: &Shear,
        inside: &Inside,
        bins: usize,
    ) -> (Histogram, f64) {
        let vorticity = shear.vorticity();
        let mut sums = self.sums(bins + 2, |fibre, sums| {
            if !inside.holds(&self.centre(fibre)) {
                return;
            }
            let end = self.end_to_end(fibre);
            let across = [&shear.flow, &shear.gradient, &vorticity].map(|axis| end.dot(axis));
            let ratio = self.length(fibre) / (2.0 * self.material(fibre).radius);
            let constant = orbit_constant(&across.into(), cox_aspect_ratio(ratio));
            // 1 in the plane of shear, where C is infinite.
            let bounded = 1.0 - 1.0 / (1.0 + constant);
            sums[bin(bounded, 1.0, bins)] += 1.0;
            sums[bins + 1] += bounded;
        });
        let sum = sums.pop().unwrap_or(0.0);
        let fibres: f64 = sums.iter().sum();
        (Histogram::new(1.0, sums), sum / fibres.max(1.0))
    }

    /// Distribution from 0 to π of the angle φ of the end-to-end direction, in the plane of shear, from the gradient's
    /// direction towards that of the flow; a fibre has no head, so φ and φ + π are one. Of the fibres `inside`. Collective.
    ///
    /// Jeffery's is r_e/(π (r_e² cos² φ + sin² φ)), twice K 6.9 (Mason & Manley 1956), which goes to 2π.
    pub fn phase_distribution(&self, shear: &Shear, inside: &Inside, bins: usize) -> Histogram {
        let weights = self.sums(bins + 1, |fibre, sums| {
            if inside.holds(&self.centre(fibre)) {
                let end = self.end_to_end(fibre);
                let angle = end.dot(&shear.flow).atan2(end.dot(&shear.gradient));
                sums[bin(angle.rem_euclid(PI), PI, bins).min(bins - 1)] += 1.0;
            }
        });
        Histogram::new(PI, weights)
    }

    /// Distribution of the end-to-end distance by the stress-free length. Collective.
    pub fn extension_distribution(&self, bins: usize) -> Histogram {
        let weights = self.sums(bins + 1, |fibre, sums| {
            let extension = self.end_to_end(fibre).norm() / self.length(fibre);
            sums[bin(extension, 1.0, bins)] += 1.0;
        });
        Histogram::new(1.0, weights)
    }

    /// Distribution of κL at the inner nodes, curvature times length, up to `high`. Collective.
    pub fn curvature_distribution(&self, high: f64, bins: usize) -> Histogram {
        let weights = self.sums(bins + 1, |fibre, sums| {
            let mut inner = Vec::new();
            self.curvature(fibre, &mut inner);
            for curvature in &inner {
                sums[bin(curvature.norm() * self.length(fibre), high, bins)] += 1.0;
            }
        });
        Histogram::new(high, weights)
    }

    /// Mean of t(s)·t(s + x) over segments whose middles are x apart along the fibre, in bins of x/L from 0 to 1, and the
    /// mean x/L of every bin. Zero where no two segments are that far apart. Collective.
    ///
    /// The work is quadratic in the segments of a fibre.
    pub fn tangent_correlation(&self, bins: usize) -> Vec<[f64; 2]> {
        let sums = self.sums(3 * bins, |fibre, sums| {
            let segments = &self.model.segments[self.model.segment_range(fibre)];
            let mut start = 0.0;
            let along = self.chords(fibre).zip(segments).map(|(chord, segment)| {
                let middle = start + 0.5 * segment.rest_length;
                start += segment.rest_length;
                (middle / self.length(fibre), chord.normalize())
            });
            let along: Vec<(f64, Vector3)> = along.collect();
            for (i, (middle, tangent)) in along.iter().enumerate() {
                for (other, second) in &along[i..] {
                    let lag = other - middle;
                    let slot = 3 * bin(lag, 1.0, bins).min(bins - 1);
                    sums[slot] += 1.0;
                    sums[slot + 1] += lag;
                    sums[slot + 2] += tangent.dot(second);
                }
            }
        });
        let mean = |s: &[f64]| [s[1], s[2]].map(|sum| sum / s[0].max(1.0));
        sums.chunks_exact(3).map(mean).collect()
    }
}

const SECOND: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
