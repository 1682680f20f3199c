//! Kernels of the eddy viscosity: gradients of the velocity at nodes, and the divergence of the stress.
//!
//! V ∇·(ν_t (∇u + ∇uᵀ))_i = Σ_j ν_ij w_ij (u_j − u_i) + Σ_j ½(ν_i ∇u_iᵀ + ν_j ∇u_jᵀ)·S_ij: the first part is as compact as the
//! Laplacian, the second the conserving divergence, minus the adjoint of the gradient. What pairs exchange is antisymmetric. ν_ij is the
//! mean of both nodes; where w_ij < 0 their harmonic mean: at most twice the smaller, so that the pair cannot feed more than others take. On two-point meshes
//! ½Σ_j w_ij |u_j − u_i|² ≥ V |G u_i|², so that u·∇·(…) ≤ −Σ V 2ν_t S:S ≤ 0; with ν_t = const and weights of any mesh it
//! is the operator of that viscosity. No stress acts on the boundary by itself: what walls take is booked with their constraints.

use super::lattice::{Lattice, wrapped};
use super::pairs::{Pairs, velocity_gradient_row};
use super::{Form, Operators, Part};
use crate::rows::{self, largest, nothing};

/// ν_t ∂_c u_d in \[d\]\[c\] and ν_t in \[0\]\[3\], at nodes \[m²/s²\], \[m²/s\].
pub(crate) type Stress = [[f64; 4]; 3];

/// ν_ij, see above.
#[inline(always)]
fn between(weight: f64, own: f64, other: f64) -> f64 {
    if weight < 0.0 {
        2.0 * own * other / (own + other).max(f64::MIN_POSITIVE)
    } else {
        0.5 * (own + other)
    }
}

/// Sums of a row.
#[derive(Default)]
struct Sums {
    force: [f64; 4],
    /// Σ ν (w + |w|).
    size: f64,
}

impl Sums {
    /// A pair with area `area` along component d.
    #[inline(always)]
    fn add(&mut self, d: usize, area: f64, own: &Stress, other: &Stress) {
        for c in 0..3 {
            self.force[c] += 0.5 * area * (own[d][c] + other[d][c]);
        }
    }

    #[inline(always)]
    fn diffuse(&mut self, weight: f64, [u, v]: [[f64; 4]; 2], own: &Stress, other: &Stress) {
        let viscosity = between(weight, own[0][3], other[0][3]);
        for c in 0..3 {
            self.force[c] += viscosity * weight * (v[c] - u[c]);
        }
        self.size += viscosity * (weight + weight.abs());
    }
}

impl Operators {
    /// V G u, \[d\]\[c\] = V ∂_d u_c \[m³/s\], handed to `finish(i, ·, out_i)`; `u` is valid.
    pub fn velocity_gradient<A: Send>(
        &self,
        u: &[[f64; 4]],
        out: &mut [A],
        finish: impl Fn(usize, [[f64; 4]; 3], &mut A) + Sync,
    ) {
        match &self.form {
            Form::Rows(pairs) => pairs.velocity_gradient(u, out, &finish),
            Form::Lines(lattice) => lattice.velocity_gradient(u, out, &finish),
        }
    }

    /// V ∇·(ν_t (∇u + ∇uᵀ)) \[m⁴/s²\], handed to `finish(i, ·, a_i, b_i)`; `u` is valid, halo entries of `stress` are brought up to
    /// date. Returns max Σ_j ν_ij (w_ij + |w_ij|)/V_i over the owned rows, a bound of the spectrum \[1/s\].
    pub fn stress_divergence<A: Send, B: Send>(
        &self,
        u: &[[f64; 4]],
        stress: &mut [Stress],
        (a, b): (&mut [A], &mut [B]),
        finish: impl Fn(usize, [f64; 4], &mut A, &mut B) + Sync,
    ) -> f64 {
        let mut rate: f64 = 0.0;
        let inverse = &self.inverse_volumes;
        self.sweep(stress, |stress, part| {
            let found = match &self.form {
                Form::Rows(pairs) => pairs.stress(part, (u, stress), inverse, (a, b), &finish),
                Form::Lines(lattice) => lattice.stress(part, (u, stress), inverse, (a, b), &finish),
            };
            rate = largest(found, rate);
        });
        rate
    }
}

impl Pairs {
    fn velocity_gradient<A: Send>(
        &self,
        u: &[[f64; 4]],
        out: &mut [A],
        finish: &(impl Fn(usize, [[f64; 4]; 3], &mut A) + Sync),
    ) {
        rows::each(out, |i, out| {
            finish(i, velocity_gradient_row(&self.geometry, u, i), out);
        });
    }

    fn stress<A: Send, B: Send>(
        &self,
        part: Part,
        (u, stress): (&[[f64; 4]], &[Stress]),
        inverse: &[f64],
        (a, b): (&mut [A], &mut [B]),
        finish: &(impl Fn(usize, [f64; 4], &mut A, &mut B) + Sync),
    ) -> f64 {
        rows::each_pair(a, b, largest, |i, a, b| {
            if !part.takes(&self.border, i) {
                return 0.0;
            }
            let range = self.geometry.row(i);
            let faces = &self.geometry.faces[range.clone()];
            let mut sums = Sums::default();
            for (&j, s) in self.geometry.columns[range].iter().zip(faces) {
                let j = j as usize;
                let (own, other) = (&stress[i], &stress[j]);
                sums.diffuse(s[3], [u[i], u[j]], own, other);
                (0..3).for_each(|d| sums.add(d, s[d], own, other));
            }
            finish(i, sums.force, a, b);
            sums.size * inverse[i]
        })
    }
}

impl Lattice {
    fn velocity_gradient<A: Send>(
        &self,
        u: &[[f64; 4]],
        out: &mut [A],
        finish: &(impl Fn(usize, [[f64; 4]; 3], &mut A) + Sync),
    ) {
        let mut none = nothing(out.len());
        let out = (out, &mut none[..]);
        self.each(Part::All, &mut [], out, largest, |line, _, out, _| {
            let n = self.length;
            let (first, half_area) = (line * n, 0.5 * self.areas[line]);
            let here = &u[first..][..n];
            for (i, out) in out.iter_mut().enumerate() {
                let own = here[i];
                let mut sums = [[0.0; 4]; 3];
                let mut add = |axis: usize, half: f64, other: [f64; 4]| {
                    (0..4).for_each(|c| sums[axis][c] += half * (other[c] - own[c]));
                };
                for along in &self.along {
                    let next = wrapped(i + along.step, n);
                    let previous = wrapped(i + n - along.step, n);
                    add(self.axis, half_area * along.skew[i], here[next]);
                    add(self.axis, -half_area * along.skew_before[i], here[previous]);
                }
                for arm in self.arms(line) {
                    let half = 0.5 * arm.sign * arm.skew * self.norm[i];
                    add(arm.axis as usize, half, u[arm.start as usize + i]);
                }
                finish(first + i, sums, out);
            }
            0.0
        });
    }

    fn stress<A: Send, B: Send>(
        &self,
        part: Part,
        (u, stress): (&[[f64; 4]], &[Stress]),
        inverse: &[f64],
        out: (&mut [A], &mut [B]),
        finish: &(impl Fn(usize, [f64; 4], &mut A, &mut B) + Sync),
    ) -> f64 {
        self.each(part, &mut [], out, largest, |line, _, a, b| {
            let n = self.length;
            let (first, area) = (line * n, self.areas[line]);
            let mut rate: f64 = 0.0;
            for (i, (a, b)) in a.iter_mut().zip(b).enumerate() {
                let node = first + i;
                let (own, velocity) = (&stress[node], u[node]);
                let mut sums = Sums::default();
                let mut pair = |axis: usize, face: f64, weight: f64, j: usize| {
                    sums.diffuse(weight, [velocity, u[j]], own, &stress[j]);
                    sums.add(axis, face, own, &stress[j]);
                };
                for along in &self.along {
                    let next = first + wrapped(i + along.step, n);
                    let previous = first + wrapped(i + n - along.step, n);
                    let (after, before) = (along.stiffness[i], along.stiffness_before[i]);
                    pair(self.axis, area * along.skew[i], area * after, next);
                    let face = -area * along.skew_before[i];
                    pair(self.axis, face, area * before, previous);
                }
                for arm in self.arms(line) {
                    let (face, weight) = (arm.sign * arm.skew, arm.stiffness * self.norm[i]);
                    let j = arm.start as usize + i;
                    pair(arm.axis as usize, face * self.norm[i], weight, j);
                }
                finish(node, sums.force, a, b);
                rate = rate.max(sums.size * inverse[node]);
            }
            rate
        })
    }
}
