//! What keeps chequerboards of the pressure bounded where velocities are given.
//!
//! Given velocities may have a part of D u that no nodal velocity can balance (the corners of a driven cavity), which
//! would add the same chequerboard to the pressure in every step. A little of the mismatch between the two gradients of
//! the old pressure is therefore left in the fluxes (after Rhie & Chow 1983): F* gets
//!
//! m_ij = τ [½(Gp_i + Gp_j)·S_ij − w_ij (p_j − p_i)],  τ = ε Δt,
//!
//! of the old pressure p, with ε at most 0.015 and of first order in Δt. It is zero for a linear pressure on every mesh.

use crate::Fluid;
use crate::rows::{self, nothing};

/// Largest ε.
const SHARE: f64 = 0.015;

/// The part of the fluxes; empty where no velocity is given on any rank.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mismatch {
    /// m_ij \[m³/s\].
    flux: Vec<f64>,
    /// Owned: its sum over j \[m³/s\].
    sums: Vec<f64>,
    /// Total: τ p \[m²/s\].
    q: Vec<f64>,
}

impl Mismatch {
    /// With room for the fluxes where there are given velocities.
    pub fn new(wanted: bool, flux_length: usize, owned: usize, total: usize) -> Self {
        if !wanted {
            return Self::default();
        }
        Self {
            flux: vec![0.0; flux_length],
            sums: vec![0.0; owned],
            q: vec![0.0; total],
        }
    }

    /// Adds it to minus the divergence.
    pub fn subtract_sums(&self, rhs: &mut [f64]) {
        if !self.sums.is_empty() {
            rows::each(rhs, |i, rhs| *rhs -= self.sums[i]);
        }
    }

    /// Adds it to fluxes.
    pub fn add_to(&self, flux: &mut [f64]) {
        if !self.flux.is_empty() {
            rows::each(flux, |e, flux| *flux += self.flux[e]);
        }
    }
}

impl Fluid {
    /// From the pressure as it is, for a step of `dt` \[s\], and the same in its sub-steps: a steady flow is steady in
    /// each of them. Collective.
    pub(crate) fn find_mismatch(&mut self, dt: f64) {
        let Mismatch { flux, sums, q } = &mut self.mismatch;
        if flux.is_empty() {
            return;
        }
        let transport = dt * (self.flux_rate + 0.5 * self.viscous_rate);
        let tau = dt * SHARE * transport.min(1.0);
        let (pressure, inverse) = (&self.pressure, self.operators.inverse_volumes());
        rows::each(q, |i, q| *q = tau * pressure[i]);
        let (owned, bias) = (inverse.len(), &mut self.momentum.increment);
        let mut none = nothing(owned);
        self.operators.gradient(
            q,
            (&mut bias[..owned], &mut none),
            |i, _, gradient, bias, ()| *bias = gradient.map(|g| g * inverse[i]),
        );
        self.mesh.halo.update(bias);
        self.operators
            .correct(bias, q, flux, (sums, &mut none), |_, _, _, _, _, ()| ());
        let (operators, flux) = (&self.operators, &*flux);
        rows::each(sums, |i, sum| *sum = operators.flux_sum(flux, i));
    }
}
