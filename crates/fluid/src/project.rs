//! Second half of a step: solenoidal fluxes by one compact Poisson equation for the pressure increment.
//!
//! F* = ½(u_i* + u_j*)·S_ij − w_ij (q_j − q_i),  Σ_j w_ij (ψ_j − ψ_i) = Σ_j F*_ij + F_b,  ψ = Δt (p^(n+½) − p^(n−½)),
//! F = F* − w (ψ_j − ψ_i),  u = u* − P G ψ.
//!
//! The projection is approximate: D u keeps (L − DG)ψ. Left alone, that residue runs as slow waves between the velocity
//! and short-wave pressure (frequency √g a step and damping g/2, for the eigenvalue g of L⁻¹DG). So
//! `cleaning_cycles` short-wave inverses M⁻¹ of the rest r of the nodal divergence follow, u −= P G M⁻¹ r and
//! p += M⁻¹ r/Δt: two of them halve the loss of inviscid energy and lift its order in Δt on tetrahedra from 1.9 to 2.2
//! (16³, Courant numbers 0.5 to 0.125, ε = 0). M⁻¹ is a polynomial, not the preconditioner: what goes into the solution
//! must not depend on the number of ranks.
//!
//! Boundary velocities may have a part of D u that no nodal velocity can balance (the corners of a driven cavity), which
//! would add the same chequerboard to the pressure in every step. A little of the mismatch between the two gradients of
//! the old pressure is therefore left in the fluxes (after Rhie & Chow 1983): F* gets τ [½(Gp_i + Gp_j)·S_ij −
//! w_ij (p_j − p_i)], zero for linear pressure on every mesh, with τ = ε Δt and ε at most 0.015 and of first order in Δt.
//! A cavity then comes to a steady state with bounded pressure, which it does not at ε = 0.

use crate::boundary::{Boundary, GivenFlux, Through};
use crate::fluid::START_CYCLES;
use crate::polynomial::Polynomial;
use crate::predict::SubStep;
use crate::{Fluid, FluidError, PressurePreconditioner, rows};
use fibreflow_mesh::{DualGeometry, LocalMesh};
use fibreflow_parallel::block_sums;
use fibreflow_solve::{
    Amg, AmgSettings, CgSettings, ConjugateGradients, Jacobi, NullSpace, PairMatrix,
    Preconditioner, SolveError, SolveReport,
};

/// Largest ε.
const MISMATCH_SHARE: f64 = 0.015;

/// What the pressure equation needs besides the flow.
pub(crate) struct Pressure {
    matrix: PairMatrix,
    preconditioner: Box<dyn Preconditioner<f64> + Send + Sync>,
    krylov: ConjugateGradients<f64>,
    polynomial: Polynomial,
    null_space: NullSpace,
    /// Total: ψ \[m²/s\].
    psi: Vec<f64>,
    /// Owned: minus the divergence of F* \[m³/s\].
    rhs: Vec<f64>,
    /// Owned: (Σ F*, Σ |F*|), then V G ψ in the second half.
    sums: Vec<[f64; 2]>,
    gradient: Vec<[f64; 4]>,
    /// Total: τ p, and owned: τ G p \[m²/s, m/s\].
    q: Vec<f64>,
    bias: Vec<[f64; 4]>,
    /// Owned: ψ/Δt² of the last step and of the one before, for the initial guess.
    pub(crate) rates: [Vec<f64>; 2],
}

impl Pressure {
    pub fn new(
        mesh: &LocalMesh,
        geometry: &DualGeometry,
        boundary: &Boundary,
        preconditioner: PressurePreconditioner,
    ) -> Result<Self, FluidError> {
        let failed = |source| FluidError::Solve {
            equation: "pressure",
            source,
        };
        let matrix =
            PairMatrix::new(mesh, geometry, &boundary.pressure_fixed, None).map_err(failed)?;
        let null_space = if matrix.is_singular() {
            NullSpace::Constant
        } else {
            NullSpace::None
        };
        let owned = vec![0.0; mesh.owned()];
        Ok(Self {
            preconditioner: match preconditioner {
                PressurePreconditioner::Amg => {
                    Box::new(Amg::new(&matrix, AmgSettings::default()).map_err(failed)?)
                }
                PressurePreconditioner::Jacobi => Box::new(Jacobi::new(&matrix)),
            },
            polynomial: Polynomial::new(&matrix, geometry),
            matrix,
            krylov: ConjugateGradients::new(),
            null_space,
            psi: vec![0.0; mesh.total()],
            rhs: owned.clone(),
            sums: vec![[0.0; 2]; mesh.owned()],
            gradient: vec![[0.0; 4]; mesh.owned()],
            q: vec![0.0; mesh.total()],
            bias: vec![[0.0; 4]; mesh.owned()],
            rates: [owned.clone(), owned],
        })
    }

    /// Clears the history of the initial guess.
    pub fn forget(&mut self) {
        self.rates.iter_mut().for_each(|rate| rate.fill(0.0));
    }

    /// ψ from the last two: Δt² (2 r^n − r^(n−1)), r = ψ/Δt².
    fn guess(&mut self, dt: f64) {
        let (square, [new, old]) = (dt * dt, &self.rates);
        rows::each(&mut self.psi[..new.len()], |i, psi| {
            *psi = square * (2.0 * new[i] - old[i]);
        });
    }

    fn remember(&mut self, dt: f64) {
        let [new, old] = &mut self.rates;
        std::mem::swap(new, old);
        let (inverse, psi) = (1.0 / (dt * dt), &self.psi);
        rows::each(new, |i, rate| *rate = inverse * psi[i]);
    }

    fn solve(&mut self, settings: &CgSettings) -> Result<SolveReport, SolveError> {
        self.krylov.solve(
            &self.matrix,
            &mut *self.preconditioner,
            &self.rhs,
            &mut self.psi,
            settings,
            self.null_space,
        )
    }
}

impl Fluid {
    /// Second half of a step: fluxes of the predicted velocity made solenoidal, velocity and pressure corrected.
    /// Collective. With `dt` zero the velocity is projected and no time passes.
    ///
    /// # Errors
    /// A pressure solve that fails.
    pub fn project(&mut self, dt: f64) -> Result<SolveReport, FluidError> {
        std::mem::swap(&mut self.flux, &mut self.flux_previous);
        self.add_mismatch(dt);
        let settings = self.predicted_divergence();
        self.poisson.guess(dt);
        let pulses = self.boundary.pulses && dt > 0.0;
        if pulses {
            self.lift_outlets(dt);
        }
        let solve = self.poisson.solve(&settings);
        let report = solve.map_err(|source| self.solve_failed("pressure", source))?;
        if pulses {
            self.put_outlets(dt);
        }
        self.correct();
        if dt > 0.0 {
            self.poisson.remember(dt);
            Self::raise(&self.poisson.psi, dt, &mut self.pressure);
            for _ in 0..self.settings.cleaning_cycles {
                self.clean();
                Self::raise(&self.poisson.psi, dt, &mut self.pressure);
            }
            self.time += dt;
            self.last_dt = dt;
            self.steps += 1;
        }
        self.remove_mismatch();
        self.mesh.halo.update(&mut self.velocity);
        Ok(report)
    }

    /// q = τ p and τ G p, τ = ε Δt, ε = ε₀ min(1, Δt max (½ Σ|F| + ν Σ w)/V); the latter is added to the velocity.
    fn add_mismatch(&mut self, dt: f64) {
        let tau = dt * MISMATCH_SHARE * self.transport_number(dt).min(1.0);
        let Pressure { q, bias, .. } = &mut self.poisson;
        let (pressure, volumes) = (&mut self.pressure, self.operators.volumes());
        rows::each(q, |i, q| *q = tau * pressure[i]);
        self.operators.gradient(pressure, bias);
        rows::each_pair(&mut self.velocity[..volumes.len()], bias, |i, u, bias| {
            let scale = tau / volumes[i];
            for c in 0..3 {
                bias[c] *= scale;
                u[c] += bias[c];
            }
        });
    }

    /// Takes τ G p out of the velocity again.
    fn remove_mismatch(&mut self) {
        let bias = &self.poisson.bias;
        rows::each(&mut self.velocity[..bias.len()], |i, u| {
            (0..3).for_each(|c| u[c] -= bias[i][c]);
        });
        self.impose_boundary();
    }

    /// F* into `flux`, −(Σ F* + F_b) into the right-hand side; the tolerance that goes with it.
    fn predicted_divergence(&mut self) -> CgSettings {
        let Pressure { sums, q, .. } = &mut self.poisson;
        self.operators
            .interpolate_flux(&mut self.velocity, q, &mut self.flux, sums);
        self.right_hand_side(|flux| flux.end)
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
        self.poisson.guess(dt);
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

    /// Minus the divergence into the right-hand side; `given` picks the fluxes that boundaries prescribe.
    fn right_hand_side(&mut self, given: impl Fn(&GivenFlux) -> f64) -> CgSettings {
        let Pressure { sums, rhs, .. } = &mut self.poisson;
        rows::each(rhs, |i, rhs| *rhs = -sums[i][0]);
        self.close(given);
        let sums = &self.poisson.sums;
        let [square] = block_sums(sums.len(), |range| {
            [sums[range].iter().map(|s| s[1] * s[1]).sum()]
        });
        let scale = self.mesh.halo.communicator().sum(square).sqrt();
        let settings = self.settings.pressure;
        CgSettings {
            absolute_tolerance: settings.absolute_tolerance.max(1e-16 * scale),
            ..settings
        }
    }

    /// Velocity by one short-wave inverse of what is left of the nodal divergence; ψ is what it took.
    pub(crate) fn clean(&mut self) {
        let Pressure { rhs, q, .. } = &mut self.poisson;
        self.operators.divergence(&mut self.velocity, q, rhs);
        rows::each(rhs, |_, rhs| *rhs = -*rhs);
        self.close(|flux| flux.end);
        let Pressure {
            matrix,
            polynomial,
            rhs,
            psi,
            gradient,
            ..
        } = &mut self.poisson;
        polynomial.apply(matrix, rhs, psi);
        self.operators.gradient(psi, gradient);
        self.subtract_gradient();
    }

    /// `field` += ψ/Δt, for pressures of total length; ψ is valid.
    fn raise(psi: &[f64], dt: f64, field: &mut [f64]) {
        let inverse = 1.0 / dt;
        rows::each(field, |i, p| *p += inverse * psi[i]);
    }

    /// Boundary fluxes into the right-hand side; outlets close themselves.
    fn close(&mut self, given: impl Fn(&GivenFlux) -> f64) {
        for (i, through) in &self.boundary.through {
            let rhs = &mut self.poisson.rhs[*i as usize];
            match through {
                Through::Given(flux) => *rhs -= given(flux),
                Through::Open => *rhs = 0.0,
            }
        }
    }

    /// F = F* − w (ψ_j − ψ_i), u = u* − P G ψ.
    fn correct(&mut self) {
        let Pressure { psi, gradient, .. } = &mut self.poisson;
        self.operators.correct(psi, &mut self.flux, gradient);
        self.subtract_gradient();
    }

    /// u −= P G ψ from V G ψ; the rest of it acts on the boundary.
    fn subtract_gradient(&mut self) {
        let volumes = self.operators.volumes();
        let gradient = &mut self.poisson.gradient;
        for (constraint, reaction) in self.boundary.constraints.iter().zip(&mut self.reaction) {
            let gradient = &mut gradient[constraint.node as usize];
            let admitted = constraint.admit(*gradient);
            (0..3).for_each(|c| reaction[c] -= gradient[c] - admitted[c]);
            *gradient = admitted;
        }
        let gradient = &*gradient;
        rows::each(&mut self.velocity[..volumes.len()], |i, u| {
            let inverse = 1.0 / volumes[i];
            (0..3).for_each(|c| u[c] -= inverse * gradient[i][c]);
        });
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
        Self::raise(&self.poisson.psi, 1.0, &mut self.pressure);
        for _ in 0..START_CYCLES {
            self.acceleration();
            let Pressure {
                matrix,
                polynomial,
                rhs,
                psi,
                ..
            } = &mut self.poisson;
            polynomial.apply(matrix, rhs, psi);
            self.mesh.halo.update(psi);
            Self::raise(&self.poisson.psi, 1.0, &mut self.pressure);
        }
        Ok(())
    }

    /// Minus the divergence of the acceleration into the right-hand side.
    fn acceleration(&mut self) -> CgSettings {
        self.gather_sources();
        self.explicit(&SubStep::RATE, 1.0);
        let (rhs, volumes) = (&self.momentum.rhs, self.operators.volumes());
        let rate = &mut self.momentum.increment;
        rows::each(&mut rate[..rhs.len()], |i, rate| {
            *rate = rhs[i].map(|r| r / volumes[i]);
        });
        // The force on nodes of the boundary is balanced by pressure too.
        for constraint in &self.boundary.constraints {
            let i = constraint.node as usize;
            let source = self.momentum.source[i];
            let admitted = constraint.admit(source);
            (0..3).for_each(|c| rate[i][c] += (source[c] - admitted[c]) / volumes[i]);
        }
        // `flux_previous` equals `flux` before the first step: it serves as scratch.
        // No mismatch in the rate.
        let Pressure { sums, psi, .. } = &mut self.poisson;
        psi.fill(0.0);
        self.operators
            .interpolate_flux(rate, psi, &mut self.flux_previous, sums);
        self.flux_previous.copy_from_slice(&self.flux);
        self.right_hand_side(|flux| flux.rate)
    }
}
