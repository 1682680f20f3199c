//! One step of Cahn–Hilliard with advection.
//!
//! From ψ to ψ' over Δt, with the fluxes F of the flow (ψ at mid-step is carried), θ = ½ + ½ min(1, DΔt/ξ²):
//!
//! ```text
//! V (ψ' − ψ)/Δt + Σ_j ½(ψ_i + ψ_j)^(½) F_ij = D V L m,   m = g(ψ, ψ') − ξ² L (θψ' + (1 − θ)ψ)
//! ```
//!
//! g (ψ' − ψ) ≥ f(ψ') − f(ψ) for the bulk and the same of gradients, so F' − F ≤ −Δt (D/e) Σ w (μ_j − μ_i)² without flow: F
//! never rises, whatever the step. Of second order in Δt; steps longer than the relaxation ξ²/D become those of backward Euler, which
//! damps what they cannot resolve. The nonlinear system is solved by a fixed point with constant coefficients,
//!
//! [V/Δt − D V L (S − θξ² L)] δ = residual,   factored into   Dθξ² (a V − V L) V⁻¹ (b V − V L),   a + b = S/θξ², ab = 1/(Dθξ²Δt)
//!
//! with S large enough for real a and b: two solves of second order, direct or by multigrid, accelerated by past iterates.

use super::PhaseField;
use super::free_energy::difference;
use crate::boundary::Through;
use crate::inverse::Inverse;
use crate::{Fluid, FluidError, rows};
use fibreflow_parallel::block_sums;
use fibreflow_solve::{CgSettings, SolveError};

/// ∂²f/∂ψ² lies between −1 and about this.
const STEEPEST: f64 = 3.5;

/// Steps beyond this times ξ²/D may have several answers (16 is the limit of uniqueness in backward Euler).
const LONGEST: f64 = 8.0;

/// Growth of a step against the one before.
const GROWTH: f64 = 1.3;

/// Residual reduction of the inner solves by multigrid.
const INNER: CgSettings = CgSettings {
    relative_tolerance: 1e-2,
    absolute_tolerance: 0.0,
    max_iterations: 200,
};

/// What a step of the order parameter cost and did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PhaseReport {
    /// Iterations of the nonlinear system, two solves of second order each.
    pub iterations: usize,
    /// What diffusion took from the free energy by time \[W\].
    pub dissipation: f64,
}

impl PhaseField {
    /// ψ after `dt` \[s\] in the present flow. Collective.
    ///
    /// # Errors
    /// A step that is not positive and finite or whose equation is not solved.
    pub fn advance(&mut self, fluid: &Fluid, dt: f64) -> Result<PhaseReport, FluidError> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(FluidError::TimeStep(dt));
        }
        let failed = |source| FluidError::Solve {
            equation: "order parameter",
            source,
        };
        self.prepare(fluid, dt).map_err(failed)?;
        let owned = fluid.mesh.owned();
        let communicator = fluid.mesh.halo.communicator();
        let volumes = fluid.operators.volumes();
        let (psi, rate) = (&self.psi, &self.rate);
        rows::each(&mut self.trial[..owned], |i, trial| {
            *trial = psi[i] + dt * rate[i];
        });
        let settings = self.settings.solver;
        let scale = self.settings.diffusivity * self.share(dt)[0] * self.square_width();
        self.mixing.restart();
        let mut report = PhaseReport::default();
        loop {
            let [left, terms, dissipated] = self.find_residual(fluid, dt);
            let floor = self.floor * self.settings.diffusivity;
            let target = (settings.relative_tolerance * terms).max(floor);
            report.dissipation = dissipated;
            if !left.is_finite() {
                let iteration = report.iterations;
                return Err(failed(SolveError::NotFinite { iteration }));
            }
            if left <= target {
                break;
            }
            if report.iterations == settings.max_iterations {
                return Err(failed(SolveError::NotConverged {
                    iterations: report.iterations,
                    residual: left,
                    target,
                    initial_residual: terms,
                }));
            }
            let inverse = 1.0 / scale;
            rows::each(&mut self.residual, |_, r| *r *= inverse);
            let [first, second] = &mut self.factors[..] else {
                unreachable!("`prepare` makes two factors")
            };
            let solved = first.solve(&mut self.krylov, &self.residual, &mut self.update, &INNER);
            solved.map_err(failed)?;
            let update = &self.update;
            rows::each(&mut self.residual, |i, r| *r = volumes[i] * update[i]);
            let solved = second.solve(&mut self.krylov, &self.residual, &mut self.update, &INNER);
            solved.map_err(failed)?;
            let (trial, update) = (&mut self.trial[..owned], &self.update[..owned]);
            self.mixing.step(trial, update, volumes, communicator);
            report.iterations += 1;
        }
        self.take(fluid, dt);
        (self.power, self.last_dt) = (report.dissipation, dt);
        self.check_finite(fluid)?;
        Ok(report)
    }

    /// Largest step in which diffusion takes about the part `decay` of the free energy, at most `longest` and 1.3 times the one
    /// before \[s\]. Collective.
    pub fn suggest_dt(&self, fluid: &Fluid, decay: f64, longest: f64) -> f64 {
        let relaxation = self.square_width() / self.settings.diffusivity;
        let longest = longest.min(LONGEST * relaxation);
        if self.last_dt == 0.0 {
            return longest.min(decay * relaxation);
        }
        let by_energy = decay * self.energy(fluid).total() / self.power;
        let by_growth = GROWTH * self.last_dt;
        // Nothing is lost at rest: 0/0.
        [by_energy, by_growth].iter().fold(
            longest,
            |dt, &other| {
                if other.is_nan() { dt } else { dt.min(other) }
            },
        )
    }

    pub(super) fn square_width(&self) -> f64 {
        self.settings.interface_width.powi(2)
    }

    /// θ, and the share 2θ − 1 of backward Euler.
    fn share(&self, dt: f64) -> [f64; 2] {
        let share = (self.settings.diffusivity * dt / self.square_width()).min(1.0);
        [0.5 + 0.5 * share, share]
    }

    /// Makes the two factors for about this step. Collective.
    fn prepare(&mut self, fluid: &Fluid, dt: f64) -> Result<(), SolveError> {
        // Rounded, so that steps that change a little keep them.
        let dt = (0.5 * (2.0 * dt.log2()).round()).exp2();
        let [theta, _] = self.share(dt);
        let bent = theta * self.square_width();
        let product = 1.0 / (self.settings.diffusivity * bent * dt);
        let middle = 0.5 * (theta * STEEPEST - 1.0);
        let sum = (middle / bent).max(2.0 * product.sqrt());
        let root = (sum * sum - 4.0 * product).max(0.0).sqrt();
        let large = 0.5 * (sum + root);
        let masses = [large, product / large];
        if masses == self.fitted {
            return Ok(());
        }
        let set = |(factor, mass): (&mut Inverse, f64)| factor.set(mass);
        let reused = self.factors.len() == 2 && self.factors.iter_mut().zip(masses).all(set);
        if !reused {
            self.factors.clear();
            let free = vec![false; fluid.mesh.total()];
            for mass in masses {
                let directly = self.directly;
                let factor = Inverse::new(&fluid.mesh, &fluid.operators, &free, mass, directly)?;
                self.factors.push(factor);
            }
        }
        self.fitted = masses;
        Ok(())
    }

    /// Residual of the trial; its norm, that of the terms that change ψ, and what diffusion takes from F by time \[W\]. Collective.
    fn find_residual(&mut self, fluid: &Fluid, dt: f64) -> [f64; 3] {
        let ([theta, share], owned) = (self.share(dt), fluid.mesh.owned());
        let (width, diffusivity) = (self.square_width(), self.settings.diffusivity);
        let operators = &fluid.operators;
        let (volumes, inverse) = (operators.volumes(), operators.inverse_volumes());
        let (psi, solid) = (&self.psi, &self.solid);
        let trial = &self.trial;
        rows::each(&mut self.blend[..owned], |i, blend| {
            *blend = psi[i] + theta * (trial[i] - psi[i]);
        });
        let finish = |_: f64, sum: f64, _: [f64; 2], _: f64| sum;
        let none = [volumes, volumes];
        operators.laplacian(&mut self.blend, none, &mut self.laplacian, finish);
        let laplacian = &self.laplacian;
        rows::each(&mut self.packed[..owned], |i, packed| {
            let potential =
                difference(psi[i], trial[i], solid[i], share) - width * inverse[i] * laplacian[i];
            *packed = [0.5 * (psi[i] + trial[i]), potential, 0.0, 0.0];
        });
        let out = (&mut self.residual[..], &mut self.laplacian[..]);
        operators.convection_diffusion(
            &fluid.flux,
            &mut self.packed,
            out,
            |_, _, convection, diffusion, change, diffused| {
                *change = convection[0] + diffusivity * diffusion[1];
                *diffused = diffusion[1];
            },
        );
        for &(i, through) in &fluid.boundary.through {
            let flux = through_boundary(fluid, i as usize, through);
            self.residual[i as usize] -= self.packed[i as usize][0] * flux;
        }
        let (packed, diffused, change) = (&self.packed, &self.laplacian, &self.residual);
        let left = |i: usize| change[i] - volumes[i] * (trial[i] - psi[i]) / dt;
        let mut sums = block_sums(owned, |range| {
            range.fold([0.0; 3], |s, i| {
                [
                    s[0] + inverse[i] * left(i).powi(2),
                    s[1] + inverse[i] * change[i] * change[i],
                    s[2] - packed[i][1] * diffused[i],
                ]
            })
        });
        rows::each(&mut self.residual, |i, r| {
            *r -= volumes[i] * (trial[i] - psi[i]) / dt;
        });
        fluid.mesh.halo.communicator().sum_slice(&mut sums);
        let dissipated = self.settings.energy_density() * diffusivity * sums[2];
        [sums[0].sqrt(), sums[1].sqrt(), dissipated]
    }

    /// The trial becomes ψ, its integral exact.
    fn take(&mut self, fluid: &Fluid, dt: f64) {
        let owned = fluid.mesh.owned();
        let out = |&(i, through): &(u32, Through)| {
            self.packed[i as usize][0] * through_boundary(fluid, i as usize, through)
        };
        let communicator = fluid.mesh.halo.communicator();
        let lost: f64 = fluid.boundary.through.iter().map(out).sum();
        self.amount -= dt * communicator.sum(lost);
        let (volumes, psi) = (fluid.operators.volumes(), &mut self.psi);
        let old = psi[..owned].to_vec();
        psi[..owned].copy_from_slice(&self.trial[..owned]);
        let [found] = block_sums(owned, |range| [range.map(|i| volumes[i] * psi[i]).sum()]);
        let shift = (self.amount - communicator.sum(found)) / fluid.operators.geometry.total_volume;
        rows::each(&mut psi[..owned], |_, psi| *psi += shift);
        rows::each(&mut self.rate, |i, rate| *rate = (psi[i] - old[i]) / dt);
        fluid.mesh.halo.update(psi);
    }
}

/// Outward flux at a node \[m³/s\].
fn through_boundary(fluid: &Fluid, i: usize, through: Through) -> f64 {
    match through {
        Through::Given(flux) => flux.end,
        Through::Open => -fluid.operators.flux_sum(&fluid.flux, i),
    }
}
