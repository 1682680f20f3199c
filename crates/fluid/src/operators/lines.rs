//! Kernels on a [`Lattice`]: one pass over the lines, blocks of lines to threads.
//!
//! Scalars are worked on in chunks of a line: sums of a chunk stay in registers and the nearest cache while one neighbouring
//! line after another is added, every one of them a contiguous slice. (`axis & 3`: no bounds to check.)

use super::Part;
use super::lattice::{Lattice, MOST_ALONG, MOST_ARMS, wrapped};
use crate::rows::{largest, nothing, sum};

/// Nodes a task.
const BLOCK: usize = 1024;

/// Nodes of a chunk.
const CHUNK: usize = 64;

type Chunk = [f64; CHUNK];

/// What a task works on: lines from `first` on, their fluxes where it writes them, their part of two fields.
struct Task<'a, A, B> {
    first: usize,
    flux: &'a mut [f64],
    a: &'a mut [A],
    b: &'a mut [B],
}

impl Lattice {
    /// Calls `kernel(line, its fluxes, its parts of a and b)` for every owned line of a part and combines what it returns,
    /// over a tree that depends on the number of lines alone. `flux` is empty where none are written.
    pub fn each<A: Send, B: Send>(
        &self,
        part: Part,
        flux: &mut [f64],
        (a, b): (&mut [A], &mut [B]),
        combine: impl Fn(f64, f64) -> f64 + Copy + Sync,
        kernel: impl Fn(usize, &mut [f64], &mut [A], &mut [B]) -> f64 + Sync,
    ) -> f64 {
        let whole = Task {
            first: 0,
            flux,
            a,
            b,
        };
        let kernel = |line, flux: &mut [f64], a: &mut [A], b: &mut [B]| {
            if part.takes(&self.border, line) {
                kernel(line, flux, a, b)
            } else {
                0.0
            }
        };
        self.split(self.lines(), whole, combine, &kernel)
    }

    fn split<A: Send, B: Send>(
        &self,
        lines: usize,
        task: Task<'_, A, B>,
        combine: impl Fn(f64, f64) -> f64 + Copy + Sync,
        kernel: &(impl Fn(usize, &mut [f64], &mut [A], &mut [B]) -> f64 + Sync),
    ) -> f64 {
        let Task { first, flux, a, b } = task;
        let fluxes = |from: usize, to: usize| (self.slots[to] - self.slots[from]) as usize;
        if lines > 1 && lines * self.length > BLOCK {
            let middle = lines / 2;
            let (a_left, a_right) = a.split_at_mut(middle * self.length);
            let (b_left, b_right) = b.split_at_mut(middle * self.length);
            let cut = fluxes(first, first + middle).min(flux.len());
            let (flux_left, flux_right) = flux.split_at_mut(cut);
            let left = Task {
                first,
                flux: flux_left,
                a: a_left,
                b: b_left,
            };
            let right = Task {
                first: first + middle,
                flux: flux_right,
                a: a_right,
                b: b_right,
            };
            let (left, right) = rayon::join(
                || self.split(middle, left, combine, kernel),
                || self.split(lines - middle, right, combine, kernel),
            );
            return combine(left, right);
        }
        let mut total = 0.0;
        let mut rest = flux;
        let nodes = a.chunks_mut(self.length).zip(b.chunks_mut(self.length));
        for (line, (a, b)) in (first..).zip(nodes) {
            let cut = fluxes(line, line + 1).min(rest.len());
            let (own, others) = rest.split_at_mut(cut);
            total = combine(total, kernel(line, own, a, b));
            rest = others;
        }
        total
    }

    /// See [`super::Operators::gradient`].
    pub fn gradient<A: Send, B: Send>(
        &self,
        part: Part,
        p: &[f64],
        out: (&mut [A], &mut [B]),
        finish: &(impl Fn(usize, f64, [f64; 4], &mut A, &mut B) + Sync),
    ) {
        self.each(part, &mut [], out, sum, |line, _, a, b| {
            let first = line * self.length;
            for (start, count) in self.chunks() {
                let mut sums = [[0.0; CHUNK]; 3];
                self.add_gradient(line, start, p, &mut sums);
                let (a, b) = (&mut a[start..][..count], &mut b[start..][..count]);
                for k in 0..count {
                    let gradient = [sums[0][k], sums[1][k], sums[2][k], 0.0];
                    let i = first + start + k;
                    finish(i, p[i], gradient, &mut a[k], &mut b[k]);
                }
            }
            0.0
        });
    }

    /// V G p of a chunk, component by component.
    #[inline(always)]
    fn add_gradient(&self, line: usize, start: usize, p: &[f64], sums: &mut [Chunk; 3]) {
        let here = &p[self.nodes(line)];
        let count = CHUNK.min(self.length - start);
        let own = &here[start..][..count];
        let norm = &self.norm[start..][..count];
        let area = 0.5 * self.areas[line];
        for along in &self.along {
            let (mut next, mut previous) = ([0.0; CHUNK], [0.0; CHUNK]);
            around(
                here,
                start,
                along.step,
                (&mut next[..count], &mut previous[..count]),
                |&v| v,
            );
            let (after, before) = (
                &along.skew[start..][..count],
                &along.skew_before[start..][..count],
            );
            let sum = &mut sums[self.axis][..count];
            for k in 0..count {
                sum[k] +=
                    area * (after[k] * (next[k] - own[k]) + before[k] * (own[k] - previous[k]));
            }
        }
        for arm in self.arms(line) {
            let other = &p[arm.start as usize + start..][..count];
            let half = 0.5 * arm.sign * arm.skew;
            let sum = &mut sums[arm.axis as usize][..count];
            for k in 0..count {
                sum[k] += half * norm[k] * (other[k] - own[k]);
            }
        }
    }

    /// See [`super::Operators::laplacian`].
    pub fn laplacian(
        &self,
        part: Part,
        x: &[f64],
        given: [&[f64]; 2],
        out: &mut [f64],
        finish: &(impl Fn(f64, f64, [f64; 2], f64) -> f64 + Sync),
    ) {
        let mut none = nothing(out.len());
        self.each(part, &mut [], (out, &mut none), sum, |line, _, out, _| {
            let here = &x[self.nodes(line)];
            for (start, count) in self.chunks() {
                let own = &here[start..][..count];
                let norm = &self.norm[start..][..count];
                let (mut inner, mut outer) = ([0.0; CHUNK], [0.0; CHUNK]);
                for along in &self.along {
                    let (mut next, mut previous) = ([0.0; CHUNK], [0.0; CHUNK]);
                    let both = (&mut next[..count], &mut previous[..count]);
                    around(here, start, along.step, both, |&v| v);
                    let after = &along.stiffness[start..][..count];
                    let before = &along.stiffness_before[start..][..count];
                    for k in 0..count {
                        inner[k] +=
                            after[k] * (next[k] - own[k]) + before[k] * (previous[k] - own[k]);
                    }
                }
                for arm in self.arms(line) {
                    let other = &x[arm.start as usize + start..][..count];
                    for k in 0..count {
                        outer[k] += arm.stiffness * (other[k] - own[k]);
                    }
                }
                let area = self.areas[line];
                let first = line * self.length + start;
                let [a, b] = given.map(|field| &field[first..][..count]);
                let out = &mut out[start..][..count];
                for k in 0..count {
                    let laplacian = area * inner[k] + norm[k] * outer[k];
                    out[k] = finish(own[k], laplacian, [a[k], b[k]], out[k]);
                }
            }
            0.0
        });
    }

    /// See [`super::Operators::divergence`].
    pub fn divergence<A: Send, B: Send>(
        &self,
        part: Part,
        u: &[[f64; 4]],
        out: (&mut [A], &mut [B]),
        finish: &(impl Fn(usize, f64, &mut A, &mut B) + Sync),
    ) -> f64 {
        self.each(part, &mut [], out, sum, |line, _, a, b| {
            let here = &u[self.nodes(line)];
            let mut squares = 0.0;
            for (start, count) in self.chunks() {
                let own = &here[start..][..count];
                let norm = &self.norm[start..][..count];
                let (mut sums, mut sizes) = ([0.0; CHUNK], [0.0; CHUNK]);
                let (axis, area) = (self.axis & 3, 0.5 * self.areas[line]);
                for along in &self.along {
                    let (mut next, mut previous) = ([0.0; CHUNK], [0.0; CHUNK]);
                    around(
                        here,
                        start,
                        along.step,
                        (&mut next[..count], &mut previous[..count]),
                        |u| u[axis],
                    );
                    let (after, before) = (
                        &along.skew[start..][..count],
                        &along.skew_before[start..][..count],
                    );
                    for k in 0..count {
                        let out = area * after[k] * (own[k][axis] + next[k]);
                        let back = area * before[k] * (own[k][axis] + previous[k]);
                        sums[k] += out - back;
                        sizes[k] += out.abs() + back.abs();
                    }
                }
                for arm in self.arms(line) {
                    let other = &u[arm.start as usize + start..][..count];
                    let (axis, half) = (arm.axis as usize & 3, 0.5 * arm.sign * arm.skew);
                    for k in 0..count {
                        let flux = half * norm[k] * (own[k][axis] + other[k][axis]);
                        sums[k] += flux;
                        sizes[k] += flux.abs();
                    }
                }
                let first = line * self.length + start;
                let (a, b) = (&mut a[start..][..count], &mut b[start..][..count]);
                for k in 0..count {
                    finish(first + k, sums[k], &mut a[k], &mut b[k]);
                    squares += sizes[k] * sizes[k];
                }
            }
            squares
        })
    }

    /// See [`super::Operators::convection_diffusion`].
    pub fn convection_diffusion<A: Send, B: Send>(
        &self,
        part: Part,
        flux: &[f64],
        u: &[[f64; 4]],
        out: (&mut [A], &mut [B]),
        finish: &(impl Fn(usize, [f64; 4], [f64; 4], [f64; 4], &mut A, &mut B) + Sync),
    ) {
        self.each(part, &mut [], out, sum, |line, _, a, b| {
            // One neighbour and four arms, two and eight: second and fourth order away from the ends, unrolled.
            let fields = (flux, u);
            match (self.along.len(), self.arms(line).len()) {
                (0..=1, 0..=4) => self.transport::<1, 4, A, B>(line, fields, (a, b), finish),
                (0..=2, 0..=8) => self.transport::<2, 8, A, B>(line, fields, (a, b), finish),
                _ => {
                    self.transport::<MOST_ALONG, MOST_ARMS, A, B>(line, fields, (a, b), finish);
                }
            }
            0.0
        });
    }

    /// A line with at most K distances inside it and N arms.
    #[inline(always)]
    fn transport<const K: usize, const N: usize, A, B>(
        &self,
        line: usize,
        (flux, u): (&[f64], &[[f64; 4]]),
        (a, b): (&mut [A], &mut [B]),
        finish: &impl Fn(usize, [f64; 4], [f64; 4], [f64; 4], &mut A, &mut B),
    ) {
        let n = self.length;
        let (first, area) = (line * n, self.areas[line]);
        let here = &u[first..][..n];
        // What is missing to K and N takes part with weight zero.
        let arms = self.arms(line);
        let others: [&[[f64; 4]]; N] = std::array::from_fn(|k| {
            let start = arms.get(k).map_or(first, |arm| arm.start as usize);
            &u[start..][..n]
        });
        let outer_flux: [&[f64]; N] = std::array::from_fn(|k| {
            let start = arms.get(k).map_or(0, |arm| arm.slot as usize);
            &flux[start..][..n]
        });
        let halves: [f64; N] = std::array::from_fn(|k| arms.get(k).map_or(0.0, |a| 0.5 * a.sign));
        let stiffness: [f64; N] = std::array::from_fn(|k| arms.get(k).map_or(0.0, |a| a.stiffness));
        let steps: [usize; K] = std::array::from_fn(|k| self.along.get(k).map_or(0, |l| l.step));
        let inner_flux: [&[f64]; K] = std::array::from_fn(|k| match self.along.get(k) {
            Some(_) => self.inner(line, k, flux),
            None => &self.zeros,
        });
        let inner_stiffness: [[&[f64]; 2]; K] = std::array::from_fn(|k| match self.along.get(k) {
            Some(along) => [&along.stiffness[..n], &along.stiffness_before[..n]],
            None => [&self.zeros[..n]; 2],
        });
        let norm = &self.norm[..n];
        let (a, b) = (&mut a[..n], &mut b[..n]);
        for i in 0..n {
            let own = here[i];
            let (mut convection, mut inner, mut outer) = ([0.0; 4], [0.0; 4], [0.0; 4]);
            for k in 0..K {
                let (next, previous) = (wrapped(i + steps[k], n), wrapped(i + n - steps[k], n));
                let (out, back) = (0.5 * inner_flux[k][i], 0.5 * inner_flux[k][previous]);
                let (above, below) = (here[next], here[previous]);
                let [after, before] = inner_stiffness[k].map(|s| s[i]);
                for c in 0..4 {
                    convection[c] -= out * (own[c] + above[c]) - back * (own[c] + below[c]);
                    inner[c] += after * (above[c] - own[c]) + before * (below[c] - own[c]);
                }
            }
            for k in 0..N {
                let other = others[k][i];
                let half = halves[k] * outer_flux[k][i];
                for c in 0..4 {
                    convection[c] -= half * (own[c] + other[c]);
                    outer[c] += stiffness[k] * (other[c] - own[c]);
                }
            }
            let diffusion = std::array::from_fn(|c| area * inner[c] + norm[i] * outer[c]);
            finish(first + i, own, convection, diffusion, &mut a[i], &mut b[i]);
        }
    }

    /// See [`super::Operators::correct`].
    pub fn correct<A: Send, B: Send>(
        &self,
        (u, frame, psi): (&[[f64; 4]], [f64; 3], &[f64]),
        flux: &mut [f64],
        inverse: &[f64],
        out: (&mut [A], &mut [B]),
        finish: &(impl Fn(usize, [f64; 4], f64, [f64; 4], &mut A, &mut B) + Sync),
    ) -> f64 {
        self.each(Part::All, flux, out, largest, |line, flux, a, b| {
            let mut rate = 0.0;
            for (start, count) in self.chunks() {
                let (mut sizes, mut sums) = ([0.0; CHUNK], [[0.0; CHUNK]; 3]);
                self.add_gradient(line, start, psi, &mut sums);
                self.write_fluxes(line, start, (u, frame, psi), flux, &mut sizes);
                let first = line * self.length + start;
                let (a, b) = (&mut a[start..][..count], &mut b[start..][..count]);
                for k in 0..count {
                    let i = first + k;
                    let gradient = [sums[0][k], sums[1][k], sums[2][k], 0.0];
                    finish(i, u[i], psi[i], gradient, &mut a[k], &mut b[k]);
                }
                let inverse = &inverse[first..][..count];
                for k in 0..count {
                    sizes[k] *= 0.5 * inverse[k];
                }
                rate = largest(rate, largest_of(&sizes));
            }
            rate
        })
    }

    /// [½(u_i + u_j) − c]·S_ij − w_ij (ψ_j − ψ_i) of a chunk, and the sum of the magnitudes by node.
    #[inline(always)]
    fn write_fluxes(
        &self,
        line: usize,
        start: usize,
        (u, frame, psi): (&[[f64; 4]], [f64; 3], &[f64]),
        flux: &mut [f64],
        sizes: &mut Chunk,
    ) {
        let nodes = self.nodes(line);
        let (here, level) = (&u[nodes.clone()], &psi[nodes]);
        let count = CHUNK.min(self.length - start);
        let own_level = &level[start..][..count];
        let mut own = [[0.0; CHUNK]; 4];
        for (k, u) in here[start..][..count].iter().enumerate() {
            (0..3).for_each(|c| own[c][k] = u[c]);
        }
        let norm = &self.norm[start..][..count];
        let (axis, area) = (self.axis & 3, self.areas[line]);
        let along_own = &own[axis][..count];
        let twice = [2.0 * frame[0], 2.0 * frame[1], 2.0 * frame[2], 0.0];
        for (place, along) in self.along.iter().enumerate() {
            let (mut next, mut previous) = ([0.0; CHUNK], [0.0; CHUNK]);
            let (mut above, mut below) = ([0.0; CHUNK], [0.0; CHUNK]);
            around(
                here,
                start,
                along.step,
                (&mut next[..count], &mut previous[..count]),
                |u| u[axis],
            );
            around(
                level,
                start,
                along.step,
                (&mut above[..count], &mut below[..count]),
                |&v| v,
            );
            let slots = &mut flux[place * self.length + start..][..count];
            let (skew, stiffness) = (
                &along.skew[start..][..count],
                &along.stiffness[start..][..count],
            );
            let (skew_before, stiffness_before) = (
                &along.skew_before[start..][..count],
                &along.stiffness_before[start..][..count],
            );
            for k in 0..count {
                let out = area
                    * (0.5 * skew[k] * (along_own[k] + next[k] - twice[axis])
                        - stiffness[k] * (above[k] - own_level[k]));
                let back = area
                    * (0.5 * skew_before[k] * (previous[k] + along_own[k] - twice[axis])
                        - stiffness_before[k] * (own_level[k] - below[k]));
                slots[k] = out;
                sizes[k] += out.abs() + back.abs();
            }
        }
        let base = self.slots[line];
        for arm in self.arms(line) {
            let from = arm.start as usize + start;
            let (other, other_level) = (&u[from..][..count], &psi[from..][..count]);
            let axis = arm.axis as usize & 3;
            let own = &own[axis][..count];
            let value = |k: usize| {
                let carried = 0.5 * arm.skew * (own[k] + other[k][axis] - twice[axis]);
                norm[k] * (carried - arm.sign * arm.stiffness * (other_level[k] - own_level[k]))
            };
            if arm.writes {
                let slots = &mut flux[(arm.slot - base) as usize + start..][..count];
                for k in 0..count {
                    slots[k] = value(k);
                    sizes[k] += slots[k].abs();
                }
            } else {
                for k in 0..count {
                    sizes[k] += value(k).abs();
                }
            }
        }
    }

    /// See [`super::Operators::subtract_pair_gradient`].
    pub fn subtract_pair_gradient(
        &self,
        p: &[f64],
        coefficient: &(impl Fn(usize, usize, &[f64; 4]) -> f64 + Sync),
        flux: &mut [f64],
        inverse: &[f64],
    ) -> f64 {
        let n = self.length;
        let owned = inverse.len();
        let step = |i: usize, j: usize, axis: usize, skew: f64, stiffness: f64| {
            let mut face = [0.0; 4];
            face[axis] = skew;
            face[3] = stiffness;
            coefficient(i, j, &face) * stiffness * (p[j] - p[i])
        };
        let out = (&mut nothing(owned)[..], &mut nothing(owned)[..]);
        self.each(Part::All, flux, out, largest, |line, flux, _, _| {
            let (first, area) = (line * n, self.areas[line]);
            for (place, along) in self.along.iter().enumerate() {
                for i in (0..n).filter(|&i| along.skew[i] != 0.0) {
                    let (skew, stiffness) = (area * along.skew[i], area * along.stiffness[i]);
                    let (from, to) = (first + i, first + wrapped(i + along.step, n));
                    flux[place * n + i] -= step(from, to, self.axis, skew, stiffness);
                }
            }
            for arm in self.arms(line).iter().filter(|arm| arm.writes) {
                let slots = &mut flux[(arm.slot - self.slots[line]) as usize..][..n];
                for (i, slot) in slots.iter_mut().enumerate() {
                    let (skew, stiffness) = (self.norm[i] * arm.skew, self.norm[i] * arm.stiffness);
                    let (from, to) = (first + i, arm.start as usize + i);
                    *slot -= arm.sign * step(from, to, arm.axis.into(), skew, stiffness);
                }
            }
            0.0
        });
        let flux = &*flux;
        let out = (&mut nothing(owned)[..], &mut nothing(owned)[..]);
        self.each(Part::All, &mut [], out, largest, |line, _, _, _| {
            self.nodes(line).fold(0.0, |rate, i| {
                let mut size = 0.0;
                self.pairs_of(i, |_, _, _, slot| size += flux[slot].abs());
                largest(rate, 0.5 * size * inverse[i])
            })
        })
    }

    /// (start, length) of the chunks of a line.
    fn chunks(&self) -> impl Iterator<Item = (usize, usize)> {
        let n = self.length;
        (0..n)
            .step_by(CHUNK)
            .map(move |start| (start, CHUNK.min(n - start)))
    }
}

/// The largest of a chunk, in eight lanes; a NaN wins.
fn largest_of(values: &Chunk) -> f64 {
    let mut lanes = [0.0; 8];
    for group in values.as_chunks::<8>().0 {
        for k in 0..8 {
            lanes[k] = largest(group[k], lanes[k]);
        }
    }
    lanes.into_iter().fold(0.0, largest)
}

/// Of the nodes of a line from `start` on: the values `step` further on and further back, modulo its length.
#[inline(always)]
fn around<T>(
    line: &[T],
    start: usize,
    step: usize,
    (next, previous): (&mut [f64], &mut [f64]),
    value: impl Fn(&T) -> f64,
) {
    let n = line.len();
    for (out, first) in [
        (next, wrapped(start + step, n)),
        (previous, wrapped(start + n - step, n)),
    ] {
        let before_end = (n - first).min(out.len());
        let (head, rest) = out.split_at_mut(before_end);
        head.iter_mut()
            .zip(&line[first..])
            .for_each(|(out, v)| *out = value(v));
        rest.iter_mut()
            .zip(line)
            .for_each(|(out, v)| *out = value(v));
    }
}
