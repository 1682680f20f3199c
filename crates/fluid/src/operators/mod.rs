//! Discrete operators on node pairs, as gathers over rows (NUMERICS section 1; K 3.3).
//!
//! | operator | formula, for node i over its pairs j |
//! |---|---|
//! | divergence | Σ_j F_ij + F_b,  F_ij = ½(u_i + u_j)·S_ij |
//! | gradient | V_i G p_i = Σ_j ½(p_i + p_j) S_ij + p_i B_i = ½ Σ_j (p_j − p_i) S_ij, as Σ_j S_ij + B_i = 0 |
//! | convection | C(F)u_i = Σ_j ½(u_i + u_j) F_ij + u_i F_b: uᵀC(F)u = ½ Σ |u|² F_b when ΣF = 0 |
//! | Laplacian | V_i L u_i = Σ_j w_ij (u_j − u_i) |
//! | lumping error | (V − M)u_i = Σ_j m_ij (u_i − u_j) |
//!
//! Pair fluxes are antisymmetric bitwise, so that what leaves one volume enters the other. Those that convect on meshes of
//! the Galerkin form are integrals over the elements ([`elements`]) with the same sums.
//!
//! The time scheme reaches pairs only through these methods. Each is one pass over the nodes that hands its sums to
//! `finish(i, …, &mut a[i], &mut b[i])`, which writes what the scheme needs of them: no sum is stored to be read again.
//! Pairs are read from compressed rows ([`pairs`]) or, on tensor-product meshes, from neighbouring lines at constant
//! strides ([`lattice`], [`lines`]); the two differ by round-off.

mod elements;
mod lattice;
mod lines;
mod pairs;
mod stress;

use crate::Kernels;
use elements::Elements;
use fibreflow_mesh::{DualGeometry, LocalMesh};
use fibreflow_parallel::{Communicator, Halo, Portable};
use lattice::Lattice;
use pairs::Pairs;
use std::sync::Arc;
pub(crate) use stress::Stress;

/// The pairs of a rank with what the kernels read often in compact form.
#[derive(Clone, Debug)]
pub(crate) struct Operators {
    pub geometry: Arc<DualGeometry>,
    halo: Halo,
    form: Form,
    /// Where pairs are those of the Galerkin form.
    elements: Option<Arc<Elements>>,
    /// Some rows read halo entries.
    cut: bool,
    /// 1/V of the owned nodes \[1/m³\].
    inverse_volumes: Vec<f64>,
}

/// How pairs are read.
#[derive(Clone, Debug)]
enum Form {
    Rows(Pairs),
    Lines(Lattice),
}

/// Which rows a pass takes: those that read halo entries wait until these have come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    All,
    Inner,
    Border,
}

impl Part {
    /// Whether row or line `i` is taken; `border` marks those that read halo entries.
    #[inline(always)]
    fn takes(self, border: &[bool], i: usize) -> bool {
        match self {
            Self::All => true,
            Self::Inner => !border[i],
            Self::Border => border[i],
        }
    }
}

impl Operators {
    pub fn new(mesh: &LocalMesh, geometry: &Arc<DualGeometry>, kernels: Kernels) -> Self {
        let lattice = match kernels {
            Kernels::Auto => Lattice::new(mesh, geometry),
            Kernels::Rows => None,
        };
        let form = match lattice {
            Some(lattice) => Form::Lines(lattice),
            None => Form::Rows(Pairs::new(mesh.owned(), geometry)),
        };
        let border = match &form {
            Form::Rows(pairs) => &pairs.border,
            Form::Lines(lattice) => &lattice.border,
        };
        Self {
            geometry: Arc::clone(geometry),
            halo: mesh.halo.clone(),
            cut: !border.is_empty(),
            elements: (!geometry.orthogonal).then(|| Arc::new(Elements::new(mesh, geometry))),
            form,
            inverse_volumes: geometry.volumes[..mesh.owned()]
                .iter()
                .map(|v| v.recip())
                .collect(),
        }
    }

    /// True where pairs are read from lines.
    pub fn on_lines(&self) -> bool {
        matches!(self.form, Form::Lines(_))
    }

    /// Dual volumes of the owned nodes \[m³\].
    pub fn volumes(&self) -> &[f64] {
        &self.geometry.volumes[..self.halo.owned()]
    }

    /// 1/V of the owned nodes \[1/m³\].
    pub fn inverse_volumes(&self) -> &[f64] {
        &self.inverse_volumes
    }

    pub fn communicator(&self) -> &Communicator {
        self.halo.communicator()
    }

    /// Length of a field of pair fluxes.
    pub fn flux_length(&self) -> usize {
        match &self.form {
            Form::Rows(_) => self.geometry.columns.len(),
            Form::Lines(lattice) => lattice.flux_length(),
        }
    }

    /// Entries of rows that a pass reads: none on lines.
    pub fn entries_read(&self) -> usize {
        match &self.form {
            Form::Rows(_) => self.geometry.columns.len(),
            Form::Lines(_) => 0,
        }
    }

    /// Pair fluxes by entry of [`DualGeometry`].
    pub fn to_entries(&self, flux: &[f64]) -> Vec<f64> {
        match &self.form {
            Form::Rows(_) => flux.to_vec(),
            Form::Lines(lattice) => {
                let mut entries = vec![0.0; self.geometry.columns.len()];
                lattice.entries(&self.geometry, |e, slot, sign| {
                    entries[e] = sign * flux[slot]
                });
                entries
            }
        }
    }

    /// The reverse of [`Operators::to_entries`].
    pub fn take_entries(&self, entries: &[f64], flux: &mut [f64]) {
        match &self.form {
            Form::Rows(_) => flux.copy_from_slice(entries),
            Form::Lines(lattice) => {
                lattice.entries(&self.geometry, |e, slot, sign| {
                    flux[slot] = sign * entries[e]
                });
            }
        }
    }

    /// Runs `pass` over all owned rows, those that need no halo while it is brought up to date.
    fn sweep<T: Portable>(&self, field: &mut [T], mut pass: impl FnMut(&[T], Part)) {
        if !self.cut {
            self.halo.update_while(field, |f| pass(f, Part::All));
            return;
        }
        self.halo.update_while(field, |f| pass(f, Part::Inner));
        pass(field, Part::Border);
    }

    /// V G p of a scalar field (halo entries are brought up to date) \[field·m²\], handed with p_i to
    /// `finish(i, p_i, ·, a_i, b_i)`.
    pub fn gradient<A: Send, B: Send>(
        &self,
        p: &mut [f64],
        (a, b): (&mut [A], &mut [B]),
        finish: impl Fn(usize, f64, [f64; 4], &mut A, &mut B) + Sync,
    ) {
        self.sweep(p, |p, part| match &self.form {
            Form::Rows(pairs) => pairs.gradient(part, p, (a, b), &finish),
            Form::Lines(lattice) => lattice.gradient(part, p, (a, b), &finish),
        });
    }

    /// V G p of one row; `p` is valid.
    pub fn gradient_row(&self, p: &[f64], i: usize) -> [f64; 4] {
        pairs::gradient_row(&self.geometry, p, i)
    }

    /// −Σ_j ½(u_i + u_j) F_ij \[m⁴/s²\] and Σ_j w_ij (u_j − u_i) \[m²/s\], handed with u_i to
    /// `finish(i, u_i, ·, ·, a_i, b_i)`.
    pub fn convection_diffusion<A: Send, B: Send>(
        &self,
        flux: &[f64],
        u: &mut [[f64; 4]],
        (a, b): (&mut [A], &mut [B]),
        finish: impl Fn(usize, [f64; 4], [f64; 4], [f64; 4], &mut A, &mut B) + Sync,
    ) {
        self.sweep(u, |u, part| match &self.form {
            Form::Rows(pairs) => pairs.convection_diffusion(part, flux, u, (a, b), &finish),
            Form::Lines(lattice) => lattice.convection_diffusion(part, flux, u, (a, b), &finish),
        });
    }

    /// Σ_j w_ij (u_j − u_i) of one row; `u` is valid.
    pub fn diffusion_row(&self, u: &[[f64; 4]], i: usize) -> [f64; 4] {
        let range = self.geometry.row(i);
        let mut sum = [0.0; 4];
        let faces = &self.geometry.faces[range.clone()];
        for (&j, s) in self.geometry.columns[range].iter().zip(faces) {
            (0..4).for_each(|c| sum[c] += s[3] * (u[j as usize][c] - u[i][c]));
        }
        sum
    }

    /// V G u of one row, \[d\]\[c\] = V ∂_d u_c \[m³/s\]; `u` is valid.
    pub fn velocity_gradient_row(&self, u: &[[f64; 4]], i: usize) -> [[f64; 4]; 3] {
        pairs::velocity_gradient_row(&self.geometry, u, i)
    }

    /// out_i = `finish`(x_i, Σ_j w_ij (x_j − x_i), values of the two `given` fields at i, old out_i) of a scalar.
    pub fn laplacian(
        &self,
        x: &mut [f64],
        given: [&[f64]; 2],
        out: &mut [f64],
        finish: impl Fn(f64, f64, [f64; 2], f64) -> f64 + Sync,
    ) {
        self.sweep(x, |x, part| match &self.form {
            Form::Rows(pairs) => pairs.laplacian(part, x, given, out, &finish),
            Form::Lines(lattice) => lattice.laplacian(part, x, given, out, &finish),
        });
    }

    /// What lumping the mass leaves out, Σ_j m_ij (x_i − x_j) \[field·m³\], handed with x_i to `finish(i, x_i, ·, a_i)`.
    /// Only pairs of the Galerkin form have masses.
    pub fn lumping_error<A: Send>(
        &self,
        x: &mut [[f64; 4]],
        out: &mut [A],
        finish: impl Fn(usize, [f64; 4], [f64; 4], &mut A) + Sync,
    ) {
        self.sweep(x, |x, part| match &self.form {
            Form::Rows(pairs) => pairs.lumping_error(part, x, out, &finish),
            // Lines are two-point.
            Form::Lines(_) => {}
        });
    }

    /// One row of [`Operators::lumping_error`]: V (u − ũ) with ũ = V⁻¹ M u; `x` is valid.
    pub fn lumping_row(&self, x: &[[f64; 4]], i: usize) -> [f64; 4] {
        match &self.form {
            Form::Rows(pairs) => pairs.lumping_row(x, i),
            Form::Lines(_) => [0.0; 4],
        }
    }

    /// Σ_j F*_ij of the interpolated fluxes ½(u_i + u_j)·S_ij \[m³/s\], handed to `finish(i, ·, a_i, b_i)`. Returns
    /// Σ_i (Σ_j |F*_ij|)² over the owned rows: what round-off is measured against.
    pub fn divergence<A: Send, B: Send>(
        &self,
        u: &mut [[f64; 4]],
        (a, b): (&mut [A], &mut [B]),
        finish: impl Fn(usize, f64, &mut A, &mut B) + Sync,
    ) -> f64 {
        let mut size = 0.0;
        self.sweep(u, |u, part| {
            size += match &self.form {
                Form::Rows(pairs) => pairs.divergence(part, u, (a, b), &finish),
                Form::Lines(lattice) => lattice.divergence(part, u, (a, b), &finish),
            };
        });
        size
    }

    /// Writes the fluxes F_ij = [½(u_i + u_j) − c]·S_ij − w_ij (ψ_j − ψ_i), c the velocity of the `frame`, and hands u_i, ψ_i and V G ψ to
    /// `finish(i, u_i, ψ_i, ·, a_i, b_i)`; `u` and `psi` are valid. Returns max ½ Σ_j |F_ij|/V_i over the owned rows \[1/s\].
    pub fn correct<A: Send, B: Send>(
        &self,
        (u, frame): (&[[f64; 4]], [f64; 3]),
        psi: &[f64],
        flux: &mut [f64],
        out: (&mut [A], &mut [B]),
        finish: impl Fn(usize, [f64; 4], f64, [f64; 4], &mut A, &mut B) + Sync,
    ) -> f64 {
        let inverse = &self.inverse_volumes;
        match &self.form {
            Form::Rows(pairs) => pairs.correct((u, frame, psi), flux, inverse, out, &finish),
            Form::Lines(lattice) => lattice.correct((u, frame, psi), flux, inverse, out, &finish),
        }
    }

    /// Length of what [`Operators::integrate`] needs to work with.
    pub fn shares(&self) -> usize {
        self.elements
            .as_ref()
            .map_or(0, |elements| elements.shares())
    }

    /// On meshes of the Galerkin form, the fluxes of u − ∇ψ integrated over the elements, with the sums of those of
    /// [`Operators::correct`]; max ½ Σ_j |F_ij|/V_i over the owned rows \[1/s\]. `at` gives (u, ψ) of owned and halo nodes.
    pub fn integrate(
        &self,
        mesh: &LocalMesh,
        at: impl Fn(usize) -> [f64; 4] + Sync,
        shares: &mut [f64],
        flux: &mut [f64],
    ) -> Option<f64> {
        let elements = self.elements.as_ref()?;
        let inverse = &self.inverse_volumes;
        Some(elements.fluxes(mesh, &self.geometry, at, shares, flux, inverse))
    }

    /// F −= c_ij w_ij (p_j − p_i) with c_ij = `coefficient`(i, j, (S, w)) symmetric; p is valid. Returns
    /// max ½ Σ_j |F_ij|/V_i over the owned rows \[1/s\].
    pub fn subtract_pair_gradient(
        &self,
        p: &[f64],
        coefficient: impl Fn(usize, usize, &[f64; 4]) -> f64 + Sync,
        flux: &mut [f64],
    ) -> f64 {
        let inverse = &self.inverse_volumes;
        match &self.form {
            Form::Rows(pairs) => pairs.subtract_pair_gradient(p, &coefficient, flux, inverse),
            Form::Lines(lattice) => lattice.subtract_pair_gradient(p, &coefficient, flux, inverse),
        }
    }

    /// Σ_j F_ij of one row.
    pub fn flux_sum(&self, flux: &[f64], i: usize) -> f64 {
        match &self.form {
            Form::Rows(_) => flux[self.geometry.row(i)].iter().sum(),
            Form::Lines(lattice) => lattice.flux_sum(flux, i),
        }
    }

    /// Σ_j `value`(w_ij) of every owned row.
    pub fn weight_sums(&self, value: impl Fn(f64) -> f64) -> Vec<f64> {
        let row = |i| self.geometry.faces[self.geometry.row(i)].iter();
        let sum = |i| row(i).map(|s| value(s[3])).sum();
        (0..self.halo.owned()).map(sum).collect()
    }
}
