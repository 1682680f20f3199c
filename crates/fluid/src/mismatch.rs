//! What keeps chequerboards of the pressure bounded where given velocities are not zero.
//!
//! Given velocities may have a part of D u that no nodal velocity can balance, which would add the same chequerboard to
//! the pressure in every step. What can be told from the boundary alone is taken out (see [`Isolated`]). Against the rest
//! a little of the mismatch between the two gradients of the old pressure is left in the fluxes (after Rhie & Chow 1983):
//! F* gets
//!
//! m_ij = τ [½(Gp_i + Gp_j)·S_ij − w_ij (p_j − p_i)],  τ = ε Δt,
//!
//! of the old pressure p, with ε at most 0.015 and of first order in Δt. At given nodes Gp is told by the neighbours, which makes
//! Σ_j m_ij zero for a linear pressure on every mesh (G is not exact at walls of simplices, and a heavy fluid at rest was
//! set in growing motion). Between orthogonal hexahedra and walls at rest nothing feeds a chequerboard, D u_boundary = 0, and
//! nothing of this is done: it would double the loss of inviscid energy. On other meshes it also damps the slow waves that
//! keep a flow from its steady state.

use crate::Fluid;
use crate::boundary::Boundary;
use crate::isolated::Isolated;
use crate::operators::Operators;
use crate::rows::{self, nothing};
use crate::settings::length;
use fibreflow_mesh::{DualGeometry, LocalMesh};

/// Largest ε.
const SHARE: f64 = 0.015;

/// The part of the fluxes; empty where nothing is given that needs it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mismatch {
    /// m_ij \[m³/s\].
    flux: Vec<f64>,
    /// Owned: its sum over j \[m³/s\].
    sums: Vec<f64>,
    /// Total: τ p, then less what isolated nodes hand on \[m²/s\].
    q: Vec<f64>,
    isolated: Isolated,
}

impl Mismatch {
    /// With room for the fluxes where they are needed. Collective.
    pub fn new(mesh: &LocalMesh, operators: &Operators, boundary: &Boundary) -> Self {
        let at_rest = boundary.given.iter().all(|(_, u)| *u == [0.0; 3]);
        let feeds = boundary.moves || !at_rest || !two_point(&operators.geometry);
        let own = feeds && !boundary.given.is_empty();
        if !mesh.halo.communicator().any(own) {
            return Self::default();
        }
        Self {
            flux: vec![0.0; operators.flux_length()],
            sums: vec![0.0; mesh.owned()],
            q: vec![0.0; mesh.total()],
            isolated: Isolated::new(mesh, operators, &boundary.prescribed(mesh)),
        }
    }

    /// Adds it to minus the divergence.
    pub fn subtract_sums(&self, rhs: &mut [f64]) {
        if !self.sums.is_empty() {
            rows::each(rhs, |i, rhs| *rhs -= self.sums[i]);
        }
    }

    /// q of the velocity ½(Gp_i + Gp_j) − ∇p times τ; None where nothing is done.
    pub fn potential(&self) -> Option<&[f64]> {
        (!self.flux.is_empty()).then_some(&self.q[..])
    }

    /// Adds it to fluxes.
    pub fn add_to(&self, flux: &mut [f64]) {
        if !self.flux.is_empty() {
            rows::each(flux, |e, flux| *flux += self.flux[e]);
        }
    }
}

/// True where every pair is a face between orthogonal hexahedra: w = |S|/|d|.
fn two_point(geometry: &DualGeometry) -> bool {
    let pairs = geometry.faces.iter().zip(&geometry.displacements);
    let mut wrong = pairs.map(|([x, y, z, w], d)| {
        let face = length([*x, *y, *z]);
        (w * length([d[0], d[1], d[2]]) - face).abs() > 1e-9 * face
    });
    !wrong.any(|wrong| wrong)
}

impl Fluid {
    /// From the pressure as it is, for a step of `dt` \[s\], and the same in its sub-steps: a steady flow is steady in
    /// each of them. Collective.
    pub(crate) fn find_mismatch(&mut self, dt: f64) {
        if self.mismatch.flux.is_empty() {
            return;
        }
        // Given velocities that do not move are put in with the initial velocity.
        if dt == 0.0 || self.boundary.moves {
            self.mesh.halo.update(&mut self.velocity);
            let boundary = &self.boundary;
            self.mismatch
                .isolated
                .update(&self.mesh, &self.operators, &self.velocity, |node| {
                    boundary.given_flux(node)
                });
        }
        let Mismatch {
            flux,
            sums,
            q,
            isolated,
        } = &mut self.mismatch;
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
        isolated.smooth(&self.mesh, &self.operators, bias);
        isolated.subtract_from(q);
        let (still, out) = ([0.0; 3], (&mut sums[..], &mut none[..]));
        self.operators
            .correct((bias, still), q, flux, out, |_, _, _, _, _, ()| ());
        let (operators, flux) = (&self.operators, &*flux);
        rows::each(sums, |i, sum| *sum = operators.flux_sum(flux, i));
    }
}
