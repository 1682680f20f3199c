//! Discrete operators on node pairs, as gathers over rows (NUMERICS section 1; K 3.3).
//!
//! | operator | formula, for node i over its pairs j |
//! |---|---|
//! | divergence | Σ_j F_ij + F_b,  F_ij = ½(u_i + u_j)·S_ij |
//! | gradient | V_i G p_i = Σ_j ½(p_i + p_j) S_ij + p_i B_i = ½ Σ_j (p_j − p_i) S_ij, as Σ_j S_ij + B_i = 0 |
//! | convection | C(F)u_i = Σ_j ½(u_i + u_j) F_ij + u_i F_b: uᵀC(F)u = ½ Σ |u|² F_b when ΣF = 0 |
//! | Laplacian | V_i L u_i = Σ_j w_ij (u_j − u_i) |
//!
//! Pair fluxes are antisymmetric bitwise, so that what leaves one volume enters the other.
//!
//! The time scheme reaches pairs only through these methods. Each is one pass over the rows that hands its sums to
//! `finish(i, …, &mut a[i], &mut b[i])`, which writes what the scheme needs of them: no sum is stored to be read again.

use crate::rows::{self, largest, nothing};
use fibreflow_mesh::{DualGeometry, LocalMesh};
use fibreflow_parallel::{Halo, Portable};
use std::sync::Arc;

/// The pairs of a rank with what the kernels read often in compact form.
#[derive(Clone, Debug)]
pub(crate) struct Operators {
    pub geometry: Arc<DualGeometry>,
    halo: Halo,
    /// Owned rows that read halo entries; empty when none does.
    border: Vec<bool>,
    /// Diffusive weight w of every entry \[m\].
    weights: Vec<f64>,
    /// 1/V of the owned nodes \[1/m³\].
    inverse_volumes: Vec<f64>,
}

impl Operators {
    pub fn new(mesh: &LocalMesh, geometry: &Arc<DualGeometry>) -> Self {
        let owned = mesh.owned();
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
            halo: mesh.halo.clone(),
            border,
            weights: geometry.faces.iter().map(|f| f[3]).collect(),
            inverse_volumes: geometry.volumes[..owned]
                .iter()
                .map(|v| v.recip())
                .collect(),
        }
    }

    /// Dual volumes of the owned nodes \[m³\].
    pub fn volumes(&self) -> &[f64] {
        &self.geometry.volumes[..self.halo.owned()]
    }

    /// 1/V of the owned nodes \[1/m³\].
    pub fn inverse_volumes(&self) -> &[f64] {
        &self.inverse_volumes
    }

    /// Length of a field of pair fluxes.
    pub fn flux_length(&self) -> usize {
        self.geometry.columns.len()
    }

    /// Runs `kernel(field, row, a_row, b_row)` over all owned rows; those that need no halo run while it is brought up
    /// to date. What the kernel returns is summed up.
    fn sweep<T: Portable, A: Send, B: Send>(
        &self,
        field: &mut [T],
        (a, b): (&mut [A], &mut [B]),
        kernel: impl Fn(&[T], usize, &mut A, &mut B) -> f64 + Sync,
    ) -> f64 {
        let mut total = 0.0;
        if self.border.is_empty() {
            self.halo.update_while(field, |f| {
                total = rows::each_pair(a, b, rows::sum, |i, a, b| kernel(f, i, a, b));
            });
            return total;
        }
        let part = |f: &[T], a: &mut [A], b: &mut [B], wanted: bool| {
            rows::each_pair(a, b, rows::sum, |i, a, b| {
                if self.border[i] == wanted {
                    kernel(f, i, a, b)
                } else {
                    0.0
                }
            })
        };
        self.halo
            .update_while(field, |f| total = part(f, a, b, false));
        total + part(field, a, b, true)
    }

    /// V G p of a scalar field (halo entries are brought up to date) \[field·m²\], handed with p_i to
    /// `finish(i, p_i, ·, a_i, b_i)`.
    pub fn gradient<A: Send, B: Send>(
        &self,
        p: &mut [f64],
        out: (&mut [A], &mut [B]),
        finish: impl Fn(usize, f64, [f64; 4], &mut A, &mut B) + Sync,
    ) {
        self.sweep(p, out, |p, i, a, b| {
            finish(i, p[i], self.gradient_row(p, i), a, b);
            0.0
        });
    }

    /// V G p of one row; `p` is valid.
    #[inline(always)]
    pub fn gradient_row(&self, p: &[f64], i: usize) -> [f64; 4] {
        let range = self.geometry.row(i);
        let faces = &self.geometry.faces[range.clone()];
        let mut sum = [0.0; 4];
        let own = p[i];
        for (&j, s) in self.geometry.columns[range].iter().zip(faces) {
            let step = 0.5 * (p[j as usize] - own);
            (0..3).for_each(|c| sum[c] += step * s[c]);
        }
        sum
    }

    /// −Σ_j ½(u_i + u_j) F_ij \[m⁴/s²\] and Σ_j w_ij (u_j − u_i) \[m²/s\], handed with u_i to
    /// `finish(i, u_i, ·, ·, a_i, b_i)`.
    pub fn convection_diffusion<A: Send, B: Send>(
        &self,
        flux: &[f64],
        u: &mut [[f64; 4]],
        out: (&mut [A], &mut [B]),
        finish: impl Fn(usize, [f64; 4], [f64; 4], [f64; 4], &mut A, &mut B) + Sync,
    ) {
        self.sweep(u, out, |u, i, a, b| {
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

    /// Σ_j w_ij (u_j − u_i) of one row; `u` is valid.
    pub fn diffusion_row(&self, u: &[[f64; 4]], i: usize) -> [f64; 4] {
        let range = self.geometry.row(i);
        let mut sum = [0.0; 4];
        for (&j, w) in self.geometry.columns[range.clone()]
            .iter()
            .zip(&self.weights[range])
        {
            (0..4).for_each(|c| sum[c] += w * (u[j as usize][c] - u[i][c]));
        }
        sum
    }

    /// Σ_j w_ij (x_j − x_i) of a scalar, handed with x_i to `finish(i, x_i, ·, a_i)`.
    pub fn laplacian<A: Send>(
        &self,
        x: &mut [f64],
        out: &mut [A],
        finish: impl Fn(usize, f64, f64, &mut A) + Sync,
    ) {
        let mut none = nothing(out.len());
        self.sweep(x, (out, &mut none), |x, i, out, ()| {
            let range = self.geometry.row(i);
            let own = x[i];
            let mut sum = 0.0;
            for (&j, w) in self.geometry.columns[range.clone()]
                .iter()
                .zip(&self.weights[range])
            {
                sum += w * (x[j as usize] - own);
            }
            finish(i, own, sum, out);
            0.0
        });
    }

    /// Σ_j F*_ij of the interpolated fluxes ½(u_i + u_j)·S_ij \[m³/s\], handed to `finish(i, ·, a_i, b_i)`. Returns
    /// Σ_i (Σ_j |F*_ij|)² over the owned rows: what round-off is measured against.
    pub fn divergence<A: Send, B: Send>(
        &self,
        u: &mut [[f64; 4]],
        out: (&mut [A], &mut [B]),
        finish: impl Fn(usize, f64, &mut A, &mut B) + Sync,
    ) -> f64 {
        let geometry = &*self.geometry;
        self.sweep(u, out, |u, i, a, b| {
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

    /// Writes the fluxes F_ij = ½(u_i + u_j)·S_ij − w_ij (ψ_j − ψ_i) and hands u_i, ψ_i and V G ψ to
    /// `finish(i, u_i, ψ_i, ·, a_i, b_i)`; `u` and `psi` are valid. Returns max ½ Σ_j |F_ij|/V_i over the owned rows \[1/s\].
    pub fn correct<A: Send, B: Send>(
        &self,
        u: &[[f64; 4]],
        psi: &[f64],
        flux: &mut [f64],
        out: (&mut [A], &mut [B]),
        finish: impl Fn(usize, [f64; 4], f64, [f64; 4], &mut A, &mut B) + Sync,
    ) -> f64 {
        let geometry = &*self.geometry;
        let inverse = &self.inverse_volumes;
        rows::with_entries(&geometry.offsets, flux, out, largest, |i, flux, a, b| {
            let range = geometry.row(i);
            let (columns, faces) = (&geometry.columns[range.clone()], &geometry.faces[range]);
            let (own, level) = (u[i], psi[i]);
            let (mut gradient, mut size) = ([0.0; 4], 0.0);
            for ((flux, &j), s) in flux.iter_mut().zip(columns).zip(faces) {
                let step = psi[j as usize] - level;
                *flux = interpolated(own, u[j as usize], s) - s[3] * step;
                size += flux.abs();
                (0..3).for_each(|c| gradient[c] += 0.5 * step * s[c]);
            }
            finish(i, own, level, gradient, a, b);
            0.5 * size * inverse[i]
        })
    }

    /// F −= c_ij w_ij (p_j − p_i) with c_ij = `coefficient`(i, j, (S, w)) symmetric; p is valid. Returns
    /// max ½ Σ_j |F_ij|/V_i over the owned rows \[1/s\].
    pub fn subtract_pair_gradient(
        &self,
        p: &[f64],
        coefficient: impl Fn(usize, usize, &[f64; 4]) -> f64 + Sync,
        flux: &mut [f64],
    ) -> f64 {
        let geometry = &*self.geometry;
        let rows = self.halo.owned();
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
            0.5 * size * self.inverse_volumes[i]
        })
    }

    /// Σ_j F_ij of one row.
    pub fn flux_sum(&self, flux: &[f64], i: usize) -> f64 {
        flux[self.geometry.row(i)].iter().sum()
    }

    /// Σ_j `value`(w_ij) of every owned row.
    pub fn weight_sums(&self, value: impl Fn(f64) -> f64) -> Vec<f64> {
        let row = |i| self.weights[self.geometry.row(i)].iter();
        let sum = |i| row(i).map(|&w| value(w)).sum();
        (0..self.halo.owned()).map(sum).collect()
    }
}

/// ½(u_i + u_j)·S_ij, antisymmetric bitwise.
#[inline(always)]
fn interpolated(u: [f64; 4], v: [f64; 4], s: &[f64; 4]) -> f64 {
    let x = (u[0] + v[0]) * s[0];
    let y = (u[1] + v[1]) * s[1];
    let z = (u[2] + v[2]) * s[2];
    0.5 * (x + y + z)
}
