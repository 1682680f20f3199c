//! Discrete operators on node pairs, as gathers over rows (NUMERICS section 1; K 3.3).
//!
//! | operator | formula, for node i over its pairs j |
//! |---|---|
//! | divergence | Σ_j F_ij + F_b,  F_ij = ½(u_i + u_j)·S_ij |
//! | gradient | V_i G p_i = Σ_j ½(p_i + p_j) S_ij + p_i B_i = ½(Σ_j S_ij p_j + B_i p_i),  B_i the boundary area |
//! | convection | C(F)u_i = Σ_j ½(u_i + u_j) F_ij + u_i F_b: uᵀC(F)u = ½ Σ |u|² F_b when ΣF = 0 |
//! | Laplacian | V_i L u_i = Σ_j w_ij (u_j − u_i) |
//!
//! Every pair term is antisymmetric bitwise, so that what leaves one volume enters the other and Σ V_i G p_i = Σ B_i p_i.

use crate::rows;
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
    /// Nodes on the boundary and their total area B \[m²\], ascending.
    boundary: Vec<(u32, [f64; 3])>,
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
        let shares = geometry.boundary.chunk_by(|a, b| a.node == b.node);
        let area = |s: &[fibreflow_mesh::BoundaryNode]| {
            let total = std::array::from_fn(|c| s.iter().map(|b| b.area[c]).sum());
            (s[0].node, total)
        };
        Self {
            geometry: Arc::clone(geometry),
            halo: mesh.halo.clone(),
            border,
            weights: geometry.faces.iter().map(|f| f[3]).collect(),
            boundary: shares.map(area).collect(),
        }
    }

    /// Dual volumes of the owned nodes \[m³\].
    pub fn volumes(&self) -> &[f64] {
        &self.geometry.volumes[..self.halo.owned()]
    }

    /// Runs `kernel(field, row, a_row, b_row)` over all owned rows; those that need no halo run while it is brought up
    /// to date.
    fn sweep<T: Portable, A: Send, B: Send>(
        &self,
        field: &mut [T],
        (a, b): (&mut [A], &mut [B]),
        kernel: impl Fn(&[T], usize, &mut A, &mut B) + Sync,
    ) {
        if self.border.is_empty() {
            self.halo.update_while(field, |f| {
                rows::each_pair(a, b, |i, a, b| kernel(f, i, a, b));
            });
            return;
        }
        let part = |f: &[T], a: &mut [A], b: &mut [B], wanted: bool| {
            rows::each_pair(a, b, |i, a, b| {
                if self.border[i] == wanted {
                    kernel(f, i, a, b);
                }
            });
        };
        self.halo.update_while(field, |f| part(f, a, b, false));
        part(field, a, b, true);
    }

    /// As [`Operators::sweep`], with `kernel` also writing the entries of its row.
    fn sweep_entries<T: Portable, O: Send>(
        &self,
        field: &mut [T],
        entries: &mut [f64],
        out: &mut [O],
        kernel: impl Fn(&[T], usize, &mut [f64], &mut O) + Sync,
    ) {
        let offsets = &self.geometry.offsets;
        if self.border.is_empty() {
            self.halo.update_while(field, |f| {
                rows::with_entries(offsets, entries, out, |i, e, o| kernel(f, i, e, o));
            });
            return;
        }
        let part = |f: &[T], entries: &mut [f64], out: &mut [O], wanted: bool| {
            rows::with_entries(offsets, entries, out, |i, e, o| {
                if self.border[i] == wanted {
                    kernel(f, i, e, o);
                }
            });
        };
        self.halo
            .update_while(field, |f| part(f, entries, out, false));
        part(field, entries, out, true);
    }

    /// V G p of a scalar field (halo entries are brought up to date) \[field·m²\].
    pub fn gradient(&self, p: &mut [f64], out: &mut [[f64; 4]]) {
        // A vector of units takes no memory.
        let mut nothing = vec![(); out.len()];
        self.sweep(p, (out, &mut nothing), |p, i, out, ()| {
            *out = self.gradient_row(p, i);
        });
        for &(i, area) in &self.boundary {
            let half = 0.5 * p[i as usize];
            let out = &mut out[i as usize];
            (0..3).for_each(|c| out[c] += half * area[c]);
        }
    }

    /// ½ Σ_j S_ij p_j.
    #[inline(always)]
    fn gradient_row(&self, p: &[f64], i: usize) -> [f64; 4] {
        let range = self.geometry.row(i);
        let faces = &self.geometry.faces[range.clone()];
        let mut sum = [0.0; 4];
        for (&j, s) in self.geometry.columns[range].iter().zip(faces) {
            let p = 0.5 * p[j as usize];
            (0..3).for_each(|c| sum[c] += p * s[c]);
        }
        sum
    }

    /// −Σ_j ½(u_i + u_j) F_ij \[m⁴/s²\] and Σ_j w_ij (u_j − u_i) \[m²/s\], handed to `finish(i, ·, ·, a_i, b_i)`.
    pub fn convection_diffusion<A: Send, B: Send>(
        &self,
        flux: &[f64],
        u: &mut [[f64; 4]],
        out: (&mut [A], &mut [B]),
        finish: impl Fn(usize, [f64; 4], [f64; 4], &mut A, &mut B) + Sync,
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
            finish(i, convection, diffusion, a, b);
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

    /// Pair fluxes ½(u_i + u_j)·S_ij − w_ij (q_j − q_i) of a velocity and a valid scalar q;
    /// `out_i` = (Σ_j F_ij, Σ_j |F_ij|).
    pub fn interpolate_flux(
        &self,
        u: &mut [[f64; 4]],
        q: &[f64],
        flux: &mut [f64],
        out: &mut [[f64; 2]],
    ) {
        let geometry = &*self.geometry;
        self.sweep_entries(u, flux, out, |u, i, flux, out| {
            let range = geometry.row(i);
            let (columns, faces) = (&geometry.columns[range.clone()], &geometry.faces[range]);
            let (own, level) = (u[i], q[i]);
            *out = [0.0; 2];
            for ((flux, &j), s) in flux.iter_mut().zip(columns).zip(faces) {
                *flux = pair_flux(own, u[j as usize], level, q[j as usize], s);
                out[0] += *flux;
                out[1] += flux.abs();
            }
        });
    }

    /// Σ_j F_ij of the fluxes of [`Operators::interpolate_flux`] \[m³/s\].
    pub fn divergence(&self, u: &mut [[f64; 4]], q: &[f64], out: &mut [f64]) {
        let geometry = &*self.geometry;
        let mut nothing = vec![(); out.len()];
        self.sweep(u, (out, &mut nothing), |u, i, out, ()| {
            let range = geometry.row(i);
            let entries = geometry.columns[range.clone()].iter();
            let (own, level) = (u[i], q[i]);
            *out = 0.0;
            for (&j, s) in entries.zip(&geometry.faces[range]) {
                *out += pair_flux(own, u[j as usize], level, q[j as usize], s);
            }
        });
    }

    /// F −= w (ψ_j − ψ_i) and `out` = V G ψ; ψ is valid.
    pub fn correct(&self, psi: &[f64], flux: &mut [f64], out: &mut [[f64; 4]]) {
        let geometry = &*self.geometry;
        rows::with_entries(&geometry.offsets, flux, out, |i, flux, out| {
            let range = geometry.row(i);
            let (columns, faces) = (&geometry.columns[range.clone()], &geometry.faces[range]);
            let own = psi[i];
            *out = [0.0; 4];
            for ((flux, &j), s) in flux.iter_mut().zip(columns).zip(faces) {
                let other = psi[j as usize];
                *flux -= s[3] * (other - own);
                (0..3).for_each(|c| out[c] += 0.5 * other * s[c]);
            }
        });
        for &(i, area) in &self.boundary {
            let half = 0.5 * psi[i as usize];
            (0..3).for_each(|c| out[i as usize][c] += half * area[c]);
        }
    }

    /// Σ_j F_ij of one row.
    pub fn flux_sum(&self, flux: &[f64], i: usize) -> f64 {
        flux[self.geometry.row(i)].iter().sum()
    }
}

/// ½(u_i + u_j)·S_ij − w_ij (q_j − q_i), antisymmetric bitwise.
#[inline(always)]
fn pair_flux(u: [f64; 4], v: [f64; 4], q: f64, r: f64, s: &[f64; 4]) -> f64 {
    let x = (u[0] + v[0]) * s[0];
    let y = (u[1] + v[1]) * s[1];
    let z = (u[2] + v[2]) * s[2];
    0.5 * (x + y + z) - s[3] * (r - q)
}
