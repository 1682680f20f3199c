//! Second half of a step: solenoidal fluxes by one compact Poisson equation for the pressure increment.
//!
//! F* = ½(u_i* + u_j*)·S_ij,  Σ_j w_ij (ψ_j − ψ_i) = Σ_j F*_ij + F_b,  ψ = Δt (p^(n+½) − p^(n−½)),
//! F = F* − w (ψ_j − ψ_i),  u = u* − P G ψ.
//!
//! On meshes of the Galerkin form F is integrated over the elements instead, with the same sums (`operators/elements.rs`).
//!
//! The projection is approximate: D u keeps (L − DG)ψ. Left alone, that residue runs as slow waves between the velocity
//! and short-wave pressure (frequency √g a step and damping g/2, for the eigenvalue g of L⁻¹DG). So
//! `cleaning_cycles` short-wave inverses M⁻¹ of the rest r of the nodal divergence follow, u −= P G M⁻¹ r and
//! p += M⁻¹ r/Δt: two of them halve the loss of inviscid energy and lift its order in Δt on tetrahedra from 1.9 to 2.2
//! (16³, Courant numbers 0.5 to 0.125). M⁻¹ is a polynomial, not the preconditioner: what goes into the solution
//! must not depend on the number of ranks.

use crate::boundary::{Boundary, GivenFlux, Through};
use crate::fluid::START_CYCLES;
use crate::operators::Operators;
use crate::poisson::{Pressure, Projection};
use crate::predict::SubStep;
use crate::rows::{self, nothing};
use crate::{Fluid, FluidError};
use fibreflow_solve::CgSettings;

impl Fluid {
    /// Second half of a step: fluxes of the predicted velocity made solenoidal, velocity and pressure corrected.
    /// Collective. With `dt` zero the velocity is projected and no time passes.
    ///
    /// # Errors
    /// A pressure solve that fails.
    pub fn project(&mut self, dt: f64) -> Result<Projection, FluidError> {
        let report = self.make_solenoidal(dt, dt)?;
        if dt > 0.0 {
            self.finish_step(dt, dt);
        } else {
            self.impose_boundary();
            self.mesh.halo.update(&mut self.velocity);
        }
        Ok(report)
    }

    /// Fluxes of the predicted velocity made solenoidal, velocity and pressure corrected; the velocity is valid on owned
    /// nodes. The pressure acts over `span` \[s\] of a step of `dt`.
    pub(crate) fn make_solenoidal(&mut self, span: f64, dt: f64) -> Result<Projection, FluidError> {
        self.find_mismatch(dt);
        let settings = self.predicted_divergence();
        let pulses = self.boundary.pulses && span > 0.0;
        if pulses {
            self.lift_outlets(span);
            self.zero_outlets();
        }
        self.poisson.guess();
        let solve = self.poisson.solve(&settings);
        let report = solve.map_err(|source| self.solve_failed("pressure", source))?;
        if span > 0.0 && report.iterations > 0 {
            self.poisson.remember();
        }
        if pulses {
            self.put_outlets(span);
        }
        self.correct(span);
        Ok(report)
    }

    /// Cleans the velocity of a step of `dt` \[s\] whose last pressure acted over `span`, and lets time pass.
    pub(crate) fn finish_step(&mut self, dt: f64, span: f64) {
        (0..self.settings.cleaning_cycles).for_each(|_| self.clean(span));
        self.book_pressure(span);
        self.time += dt;
        self.last_dt = dt;
        self.steps += 1;
        self.impose_boundary();
        self.mesh.halo.update(&mut self.velocity);
    }

    /// Books that the pressure at constrained nodes has acted for `span` \[s\].
    pub(crate) fn book_pressure(&mut self, span: f64) {
        for (constraint, reaction) in self.boundary.constraints.iter().zip(&mut self.reaction) {
            reaction[3] += span * self.pressure[constraint.node as usize];
        }
    }

    /// −(Σ F* + F_b) into the right-hand side; the tolerance that goes with it.
    fn predicted_divergence(&mut self) -> CgSettings {
        let rhs = &mut self.poisson.rhs;
        let mut none = nothing(rhs.len());
        let size = self.operators.divergence(
            &mut self.velocity,
            (&mut rhs[..], &mut none),
            |_, sum, rhs, ()| *rhs = -sum,
        );
        self.mismatch.subtract_sums(rhs);
        close(&self.boundary, rhs, |flux| flux.end);
        self.pressure_tolerance(size)
    }

    /// What outlets give to ψ at their neighbours into the right-hand side; at outlets it is put in after the solve,
    /// so that their unit does not enter the norm.
    fn lift_outlets(&mut self, dt: f64) {
        self.poisson.psi.fill(0.0);
        self.put_outlets(dt);
        let Pressure {
            matrix, psi, rhs, ..
        } = &mut self.poisson;
        matrix.lift(psi, rhs);
    }

    fn zero_outlets(&mut self) {
        let Pressure { psi, rhs, .. } = &mut self.poisson;
        for &(i, _) in &self.boundary.outlets {
            (psi[i as usize], rhs[i as usize]) = (0.0, 0.0);
        }
    }

    /// ψ = Δt (p^(n+½) − p^(n−½)) at outlets.
    fn put_outlets(&mut self, dt: f64) {
        let psi = &mut self.poisson.psi;
        for &(i, pressure) in &self.boundary.outlets {
            let i = i as usize;
            psi[i] = dt * (pressure / self.settings.density - self.pressure[i]);
        }
        self.mesh.halo.update(psi);
    }

    /// Relative tolerance as set; absolute where the divergence is round-off of the fluxes, `size` = Σ_i (Σ_j |F_ij|)².
    fn pressure_tolerance(&self, size: f64) -> CgSettings {
        let scale = self.mesh.halo.communicator().sum(size).sqrt();
        let settings = self.settings.pressure;
        CgSettings {
            absolute_tolerance: settings.absolute_tolerance.max(1e-16 * scale),
            ..settings
        }
    }

    /// F = F* − w (ψ_j − ψ_i), u = u* − P G ψ, p += ψ/Δt (not where Δt is zero).
    pub(crate) fn correct(&mut self, dt: f64) {
        let psi = &self.poisson.psi;
        let inverse = self.operators.inverse_volumes();
        let owned = inverse.len();
        let raise = if dt > 0.0 { dt.recip() } else { 0.0 };
        let next = &mut self.momentum.next;
        let frame = self.settings.frame;
        let rate = self.operators.correct(
            (&self.velocity, frame),
            psi,
            &mut self.flux_other,
            (&mut next[..owned], &mut self.pressure[..owned]),
            |i, own, psi, gradient, next, pressure| {
                (0..4).for_each(|c| next[c] = own[c] - inverse[i] * gradient[c]);
                *pressure += raise * psi;
            },
        );
        let (mesh, flux) = (&self.mesh, &mut self.flux_other);
        let (velocity, bias) = (&self.velocity, &self.momentum.increment);
        let q = self.mismatch.potential();
        let at = |i: usize| {
            let ([x, y, z, _], psi) = (velocity[i], psi[i]);
            let [x, y, z] = [x - frame[0], y - frame[1], z - frame[2]];
            q.map_or([x, y, z, psi], |q| {
                let [bx, by, bz, _] = bias[i];
                [x + bx, y + by, z + bz, psi + q[i]]
            })
        };
        let integrated = self.operators.integrate(mesh, at, &mut self.shares, flux);
        if integrated.is_none() {
            self.mismatch.add_to(flux);
        }
        let rate = integrated.unwrap_or(rate);
        std::mem::swap(&mut self.flux, &mut self.flux_other);
        std::mem::swap(&mut self.velocity, &mut self.momentum.next);
        self.flux_rate = self.mesh.halo.communicator().max(rate);
        let psi = &self.poisson.psi;
        confine(
            &self.operators,
            &self.boundary,
            psi,
            &mut self.velocity,
            &mut self.reaction,
        );
    }

    /// Velocity by one short-wave inverse of what is left of the nodal divergence, pressure by what it took.
    pub(crate) fn clean(&mut self, dt: f64) {
        let polynomial = &mut self.poisson.polynomial;
        let mut none = nothing(polynomial.rhs.len());
        self.operators.divergence(
            &mut self.velocity,
            (&mut polynomial.rhs[..], &mut none),
            |_, sum, rhs, ()| *rhs = -sum,
        );
        self.mismatch.subtract_sums(&mut polynomial.rhs);
        close(&self.boundary, &mut polynomial.rhs, |flux| flux.end);
        polynomial.apply(&self.operators);
        let inverse = self.operators.inverse_volumes();
        let owned = inverse.len();
        let raise = if dt > 0.0 { dt.recip() } else { 0.0 };
        let x = &mut polynomial.x;
        self.operators.gradient(
            x,
            (&mut self.velocity[..owned], &mut self.pressure[..owned]),
            |i, own, gradient, velocity, pressure| {
                (0..3).for_each(|c| velocity[c] -= inverse[i] * gradient[c]);
                *pressure += raise * own;
            },
        );
        confine(
            &self.operators,
            &self.boundary,
            x,
            &mut self.velocity,
            &mut self.reaction,
        );
    }

    /// The pressure that keeps the initial velocity and fluxes solenoidal; without it the first step would be of first
    /// order. Convecting flux as extrapolated for the step; boundaries change as they do in the step of size `dt`.
    pub(crate) fn start_pressure(&mut self, dt: f64) -> Result<(), FluidError> {
        if self.boundary.moves {
            self.boundary.find_rates(self.time, dt)?;
        }
        self.pressure.fill(0.0);
        for &(i, pressure) in &self.boundary.outlets {
            self.pressure[i as usize] = pressure / self.settings.density;
        }
        let settings = self.acceleration();
        self.poisson.psi.fill(0.0);
        let solve = self.poisson.solve(&settings);
        solve.map_err(|source| self.solve_failed("pressure", source))?;
        let psi = &self.poisson.psi;
        rows::each(&mut self.pressure, |i, p| *p += psi[i]);
        for _ in 0..START_CYCLES {
            self.acceleration();
            let Pressure {
                polynomial, rhs, ..
            } = &mut self.poisson;
            polynomial.rhs.copy_from_slice(rhs);
            polynomial.apply(&self.operators);
            let x = &polynomial.x;
            let owned = rhs.len();
            rows::each(&mut self.pressure[..owned], |i, p| *p += x[i]);
        }
        Ok(())
    }

    /// Minus the divergence of the acceleration into the right-hand side.
    fn acceleration(&mut self) -> CgSettings {
        self.gather_sources();
        self.explicit_part(&SubStep::RATE, 1.0);
        let (rhs, inverse) = (&self.momentum.next, self.operators.inverse_volumes());
        let rate = &mut self.momentum.increment;
        rows::each(&mut rate[..inverse.len()], |i, rate| {
            *rate = rhs[i].map(|r| r * inverse[i]);
        });
        if self.correcting {
            self.correct_rate();
        }
        let (rate, inverse) = (
            &mut self.momentum.increment,
            self.operators.inverse_volumes(),
        );
        // The force on nodes of the boundary is balanced by pressure too.
        for constraint in &self.boundary.constraints {
            let i = constraint.node as usize;
            let source = self.momentum.source[i];
            let admitted = constraint.admit(source);
            (0..3).for_each(|c| rate[i][c] += (source[c] - admitted[c]) * inverse[i]);
        }
        let sums = &mut self.poisson.rhs;
        let mut none = nothing(sums.len());
        let size =
            self.operators
                .divergence(rate, (&mut sums[..], &mut none), |_, sum, rhs, ()| {
                    *rhs = -sum
                });
        close(&self.boundary, sums, |flux| flux.rate);
        self.pressure_tolerance(size)
    }
}

/// Boundary fluxes into sums −Σ F, `given` of those that boundaries prescribe; outlets close themselves.
fn close(boundary: &Boundary, sums: &mut [f64], given: impl Fn(&GivenFlux) -> f64) {
    for (i, through) in &boundary.through {
        let sum = &mut sums[*i as usize];
        match through {
            Through::Given(flux) => *sum -= given(flux),
            Through::Open => *sum = 0.0,
        }
    }
}

/// Gives back to the velocity of constrained nodes what −G x must not change, and books it as given to the boundary.
fn confine(
    operators: &Operators,
    boundary: &Boundary,
    x: &[f64],
    velocity: &mut [[f64; 4]],
    reaction: &mut [[f64; 4]],
) {
    for (constraint, reaction) in boundary.constraints.iter().zip(reaction) {
        let i = constraint.node as usize;
        let gradient = operators.gradient_row(x, i);
        let admitted = constraint.admit(gradient);
        for c in 0..3 {
            let refused = gradient[c] - admitted[c];
            reaction[c] -= refused;
            velocity[i][c] += operators.inverse_volumes()[i] * refused;
        }
    }
}
