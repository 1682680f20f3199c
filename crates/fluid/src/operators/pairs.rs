//! Kernels on compressed rows of pairs.

use super::Part;
use crate::rows::{self, largest, nothing};
use fibreflow_mesh::DualGeometry;
use std::sync::Arc;

/// Rows of [`DualGeometry`].
#[derive(Clone, Debug)]
pub(super) struct Pairs {
    pub geometry: Arc<DualGeometry>,
    /// Owned rows that read halo entries; empty when none does.
    pub border: Vec<bool>,
    /// Diffusive weight w of every entry \[m\].
    weights: Vec<f64>,
}

impl Pairs {
    pub fn new(owned: usize, geometry: &Arc<DualGeometry>) -> Self {
        let reads_halo = |i: usize| {
            let columns = &geometry.columns[geometry.row(i)];
            columns.iter().any(|&j| j as usize >= owned)
        };
        let mut border: Vec<bool> = (0..owned).map(reads_halo).collect();
        if !border.contains(&true) {
            border.clear();
        }
        Self {
            geometry: Arc::clone(geometry),
            border,
            weights: geometry.faces.iter().map(|f| f[3]).collect(),
        }
    }

    /// Calls `kernel(row, a_row, b_row)` for the rows of a part and sums up what it returns.
    fn each<A: Send, B: Send>(
        &self,
        part: Part,
        (a, b): (&mut [A], &mut [B]),
        kernel: impl Fn(usize, &mut A, &mut B) -> f64 + Sync,
    ) -> f64 {
        rows::each_pair(a, b, rows::sum, |i, a, b| {
            if part.takes(&self.border, i) {
                kernel(i, a, b)
            } else {
                0.0
            }
        })
    }

    /// See [`super::Operators::gradient`].
    pub fn gradient<A: Send, B: Send>(
        &self,
        part: Part,
        p: &[f64],
        out: (&mut [A], &mut [B]),
        finish: &(impl Fn(usize, f64, [f64; 4], &mut A, &mut B) + Sync),
    ) {
        self.each(part, out, |i, a, b| {
            finish(i, p[i], gradient_row(&self.geometry, p, i), a, b);
            0.0
        });
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
        self.each(part, out, |i, a, b| {
            let range = self.geometry.row(i);
            let (flux, weights) = (&flux[range.clone()], &self.weights[range.clone()]);
            let own = u[i];
            let (mut convection, mut diffusion) = ([0.0; 4], [0.0; 4]);
            let columns = &self.geometry.columns[range];
            for ((&j, f), w) in columns.iter().zip(flux).zip(weights) {
                let (other, f) = (u[j as usize], 0.5 * f);
                for c in 0..4 {
                    convection[c] -= f * (own[c] + other[c]);
                    diffusion[c] += w * (other[c] - own[c]);
                }
            }
            finish(i, own, convection, diffusion, a, b);
            0.0
        });
    }

    /// See [`super::Operators::laplacian`].
    pub fn laplacian(
        &self,
        part: Part,
        x: &[f64],
        [a, b]: [&[f64]; 2],
        out: &mut [f64],
        finish: &(impl Fn(f64, f64, [f64; 2], f64) -> f64 + Sync),
    ) {
        let mut none = nothing(out.len());
        self.each(part, (out, &mut none), |i, out, ()| {
            let range = self.geometry.row(i);
            let own = x[i];
            let mut sum = 0.0;
            for (&j, w) in self.geometry.columns[range.clone()]
                .iter()
                .zip(&self.weights[range])
            {
                sum += w * (x[j as usize] - own);
            }
            *out = finish(own, sum, [a[i], b[i]], *out);
            0.0
        });
    }

    /// See [`super::Operators::lumping_error`].
    pub fn lumping_error<A: Send>(
        &self,
        part: Part,
        x: &[[f64; 4]],
        out: &mut [A],
        finish: &(impl Fn(usize, [f64; 4], [f64; 4], &mut A) + Sync),
    ) {
        let mut none = nothing(out.len());
        self.each(part, (out, &mut none), |i, out, ()| {
            finish(i, x[i], self.lumping_row(x, i), out);
            0.0
        });
    }

    /// See [`super::Operators::lumping_row`].
    pub fn lumping_row(&self, x: &[[f64; 4]], i: usize) -> [f64; 4] {
        let range = self.geometry.row(i);
        // Two-point pairs have no masses.
        let masses = self.geometry.masses.get(range.clone()).unwrap_or(&[]);
        let own = x[i];
        let mut sum = [0.0; 4];
        for (&j, m) in self.geometry.columns[range].iter().zip(masses) {
            let (other, m) = (x[j as usize], f64::from(*m));
            (0..4).for_each(|c| sum[c] += m * (own[c] - other[c]));
        }
        sum
    }

    /// See [`super::Operators::divergence`].
    pub fn divergence<A: Send, B: Send>(
        &self,
        part: Part,
        u: &[[f64; 4]],
        out: (&mut [A], &mut [B]),
        finish: &(impl Fn(usize, f64, &mut A, &mut B) + Sync),
    ) -> f64 {
        let geometry = &*self.geometry;
        self.each(part, out, |i, a, b| {
            let range = geometry.row(i);
            let entries = geometry.columns[range.clone()].iter();
            let own = u[i];
            let (mut sum, mut size) = (0.0, 0.0);
            for (&j, s) in entries.zip(&geometry.faces[range]) {
                let flux = interpolated(own, u[j as usize], s);
                sum += flux;
                size += flux.abs();
            }
            finish(i, sum, a, b);
            size * size
        })
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
        let geometry = &*self.geometry;
        let through = |s: &[f64; 4]| (0..3).map(|c| frame[c] * s[c]).sum::<f64>();
        rows::with_entries(&geometry.offsets, flux, out, largest, |i, flux, a, b| {
            let range = geometry.row(i);
            let (columns, faces) = (&geometry.columns[range.clone()], &geometry.faces[range]);
            let (own, level) = (u[i], psi[i]);
            let (mut gradient, mut size) = ([0.0; 4], 0.0);
            for ((flux, &j), s) in flux.iter_mut().zip(columns).zip(faces) {
                let step = psi[j as usize] - level;
                *flux = interpolated(own, u[j as usize], s) - through(s) - s[3] * step;
                size += flux.abs();
                (0..3).for_each(|c| gradient[c] += 0.5 * step * s[c]);
            }
            finish(i, own, level, gradient, a, b);
            0.5 * size * inverse[i]
        })
    }

    /// See [`super::Operators::subtract_pair_gradient`].
    pub fn subtract_pair_gradient(
        &self,
        p: &[f64],
        coefficient: &(impl Fn(usize, usize, &[f64; 4]) -> f64 + Sync),
        flux: &mut [f64],
        inverse: &[f64],
    ) -> f64 {
        let geometry = &*self.geometry;
        let rows = inverse.len();
        let out = (&mut nothing(rows)[..], &mut nothing(rows)[..]);
        rows::with_entries(&geometry.offsets, flux, out, largest, |i, flux, (), ()| {
            let range = geometry.row(i);
            let entries = geometry.columns[range.clone()].iter();
            let mut size = 0.0;
            for ((flux, &j), s) in flux.iter_mut().zip(entries).zip(&geometry.faces[range]) {
                let j = j as usize;
                *flux -= coefficient(i, j, s) * s[3] * (p[j] - p[i]);
                size += flux.abs();
            }
            0.5 * size * inverse[i]
        })
    }
}

/// V G p of one row; `p` is valid.
#[inline(always)]
pub(super) fn gradient_row(geometry: &DualGeometry, p: &[f64], i: usize) -> [f64; 4] {
    let range = geometry.row(i);
    let faces = &geometry.faces[range.clone()];
    let mut sum = [0.0; 4];
    let own = p[i];
    for (&j, s) in geometry.columns[range].iter().zip(faces) {
        let step = 0.5 * (p[j as usize] - own);
        (0..3).for_each(|c| sum[c] += step * s[c]);
    }
    sum
}

/// V G u of one row, \[d\]\[c\] = V ∂_d u_c; `u` is valid.
#[inline(always)]
pub(super) fn velocity_gradient_row(
    geometry: &DualGeometry,
    u: &[[f64; 4]],
    i: usize,
) -> [[f64; 4]; 3] {
    let range = geometry.row(i);
    let faces = &geometry.faces[range.clone()];
    let (own, mut sum) = (u[i], [[0.0; 4]; 3]);
    for (&j, s) in geometry.columns[range].iter().zip(faces) {
        let other = u[j as usize];
        for (d, sum) in sum.iter_mut().enumerate() {
            let half = 0.5 * s[d];
            (0..4).for_each(|c| sum[c] += half * (other[c] - own[c]));
        }
    }
    sum
}

/// ½(u_i + u_j)·S_ij, antisymmetric bitwise.
#[inline(always)]
fn interpolated(u: [f64; 4], v: [f64; 4], s: &[f64; 4]) -> f64 {
    let x = (u[0] + v[0]) * s[0];
    let y = (u[1] + v[1]) * s[1];
    let z = (u[2] + v[2]) * s[2];
    0.5 * (x + y + z)
}
