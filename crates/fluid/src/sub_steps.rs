//! A step that projects after every sub-step.
//!
//! u^k = P [u^(k−1) + Δt (γ_k H(u^(k−1), F^(k−1)) + ζ_k H(u^(k−2), F^(k−2)) + α_k (f/ρ + g − G p))], with the projected
//! flux F of the sub-step before as the convecting one. Nothing is extrapolated in time: without boundaries that change
//! the velocity is of third order (the pressure drops out of a projected Runge–Kutta scheme), and a step costs three
//! pressure solves.

use crate::predict::{PASSED, SUB_STEPS};
use crate::{Fluid, FluidError, StepReport};

impl Fluid {
    /// One step with three projections. Collective.
    pub(crate) fn advance_projecting(&mut self, dt: f64) -> Result<StepReport, FluidError> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(FluidError::TimeStep(dt));
        }
        let diffusion = self.choose_diffusion(dt);
        self.prepare_diffusion(&diffusion)?;
        self.drive(self.time + 0.5 * dt);
        self.correcting = diffusion.corrected_mass;
        if self.steps == 0 {
            self.boundary.begin_step(0.0);
            self.start_pressure(dt)?;
        }
        self.reaction.fill([0.0; 4]);
        let settings = self.viscous_tolerance(&diffusion);
        let mut report = StepReport {
            diffusion,
            ..StepReport::default()
        };
        let (mut start, mut span) = (0.0, 0.0);
        for k in 0..SUB_STEPS.len() {
            span = SUB_STEPS[k].alpha * dt;
            std::mem::swap(&mut self.flux, &mut self.flux_other);
            self.boundary.begin_step(0.0);
            self.drive(self.time + start + 0.5 * span);
            self.gather_sources();
            report.momentum_iterations[k] = self.sub_step(k, dt, &diffusion, &settings)?;
            if k + 1 == SUB_STEPS.len() {
                self.hold_bulk_velocity(dt);
            }
            self.end_boundary(self.time + start + 0.5 * span)?;
            start = PASSED[k] * dt;
            let solve = self.make_solenoidal(span, dt)?;
            report.poisson_iterations += solve.iterations;
            report.poisson_residual = solve.residual;
            if k + 1 < SUB_STEPS.len() {
                self.book_pressure(span);
                self.impose_boundary();
            }
        }
        self.finish_step(dt, span);
        self.check_finite()?;
        Ok(report)
    }
}
