//! A step of creeping flow, solved as often as its forces change.

use super::{Creeping, Data, Solved};
use crate::{Fluid, FluidError, Inertia, StepReport, rows};

/// Share of the second stage of the two-stage, stiffly accurate Runge–Kutta scheme (Alexander 1977): second order, L-stable.
const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

/// A step without convection that is begun and not yet finished.
///
/// For forces that depend on the velocity at the end of the step, as those of fibres without inertia do: put them into
/// [`CreepingStep::body_force_mut`], [`CreepingStep::solve`], read [`CreepingStep::velocity`], and again until both agree.
/// Every solve starts from the answer of the one before, time does not pass between them, and the last one is the step.
///
/// The velocity u(f) is affine in the body force, u(f) = u(0) + R f, and R is symmetric and positive:
/// Σ V f₁·R f₂ = Σ V f₂·R f₁, to the tolerance of the pressure solve. A step that is dropped before
/// [`CreepingStep::finish`] leaves the fluid in its midst: restore a state then.
#[must_use = "the step is over with `finish`"]
pub struct CreepingStep<'a> {
    fluid: &'a mut Fluid,
    dt: f64,
    solved: Solved,
}

impl Fluid {
    /// One step without convection. Collective.
    pub(crate) fn creep(&mut self, dt: f64) -> Result<StepReport, FluidError> {
        let mut step = self.begin_step(dt)?;
        step.solve()?;
        step.finish()
    }

    /// Begins a step of `dt` \[s\] without convection, to be solved with one body force after another. Collective.
    ///
    /// # Errors
    /// A flow with convection, whose answer to a force is not linear; a step that is not positive and finite.
    pub fn begin_step(&mut self, dt: f64) -> Result<CreepingStep<'_>, FluidError> {
        let Some(creeping) = &mut self.creeping else {
            return Err(FluidError::Convection);
        };
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(FluidError::TimeStep(dt));
        }
        let owned = self.mesh.owned();
        creeping.origin.copy_from_slice(&self.velocity[..owned]);
        creeping.answered = false;
        let steady = self.settings.inertia == Inertia::Steady;
        self.drive(self.time + if steady { dt } else { 0.5 * dt });
        self.boundary.begin_step(0.0);
        Ok(CreepingStep {
            fluid: self,
            dt,
            solved: Solved::default(),
        })
    }
}

impl CreepingStep<'_> {
    /// Body force \[N/m³\] of the next solve, see [`Fluid::body_force_mut`].
    pub fn body_force_mut(&mut self) -> &mut [[f64; 4]] {
        &mut self.fluid.body_force
    }

    /// Velocity \[m/s\] at the end of the step with the body force solved for last; before, that of the start.
    pub fn velocity(&self) -> &[[f64; 4]] {
        &self.fluid.velocity
    }

    /// Solves for velocity and pressure at the end of the step with the present body force, and returns the iterations
    /// that it took. Collective.
    ///
    /// # Errors
    /// A solve that does not converge, boundary velocities that do not balance.
    pub fn solve(&mut self) -> Result<usize, FluidError> {
        // Taken out while the fluid is read, put back whatever happens.
        let Some(mut creeping) = self.fluid.creeping.take() else {
            return Err(FluidError::Convection);
        };
        let outcome = self.fluid.stages(&mut creeping, self.dt);
        creeping.answered = outcome.is_ok();
        self.fluid.creeping = Some(creeping);
        let solved = outcome?;
        self.solved = Solved {
            iterations: self.solved.iterations + solved.iterations,
            ..solved
        };
        Ok(solved.iterations)
    }

    /// Lets time pass: what was solved for last is the state of the fluid. Solves first where nothing was. Collective.
    ///
    /// # Errors
    /// A solve that does not converge; a value that is not finite, with its field, node and position.
    pub fn finish(mut self) -> Result<StepReport, FluidError> {
        if !self.fluid.creeping.as_ref().is_some_and(|c| c.answered) {
            self.solve()?;
        }
        let Self { fluid, dt, solved } = self;
        if let Some(creeping) = &mut fluid.creeping {
            std::mem::swap(&mut fluid.flux, &mut fluid.flux_other);
            let (system, unknown) = (&mut creeping.system, &mut creeping.unknown);
            let rate = system.fluxes(&fluid.operators, unknown, &mut fluid.flux);
            fluid.flux_rate = fluid.mesh.halo.communicator().max(rate);
        }
        fluid.time += dt;
        fluid.last_dt = dt;
        fluid.steps += 1;
        fluid.check_finite()?;
        Ok(StepReport {
            diffusion: fluid.choose_diffusion(dt),
            momentum_iterations: [0; 3],
            poisson_iterations: solved.iterations,
            poisson_residual: Some(solved.divergence),
        })
    }
}

impl Fluid {
    /// Velocity and pressure at the end of the step, from the velocity at its start.
    fn stages(&mut self, creeping: &mut Creeping, dt: f64) -> Result<Solved, FluidError> {
        self.reaction.fill([0.0; 4]);
        creeping.start.copy_from_slice(&creeping.origin);
        if self.settings.inertia == Inertia::Steady {
            return self.stage(creeping, 0, 0.0, [dt, dt]);
        }
        let rate = 1.0 / (GAMMA * dt);
        let first = self.stage(creeping, 0, rate, [GAMMA * dt, (1.0 - GAMMA) * dt])?;
        let ahead = (1.0 - GAMMA) / GAMMA;
        let velocity = &self.velocity;
        rows::each(&mut creeping.start, |i, u| {
            (0..3).for_each(|c| u[c] += ahead * (velocity[i][c] - u[c]));
        });
        let second = self.stage(creeping, 1, rate, [dt, GAMMA * dt])?;
        Ok(Solved {
            iterations: first.iterations + second.iterations,
            ..second
        })
    }

    /// Solves for velocity and pressure with ∂u/∂t = `rate` (u − `creeping.start`); boundaries are as after
    /// `passed` seconds, and their nodes take the forces on them for `weight` seconds.
    fn stage(
        &mut self,
        creeping: &mut Creeping,
        index: usize,
        rate: f64,
        [passed, weight]: [f64; 2],
    ) -> Result<Solved, FluidError> {
        let held = self.held(creeping);
        let volumes = self.operators.volumes();
        let per_mass = 1.0 / self.settings.density;
        let [x, y, z] = self.driving;
        let (driving, force) = ([x, y, z, 0.0], &self.body_force);
        let start = &creeping.start;
        rows::each(&mut creeping.source, |i, source| {
            for c in 0..3 {
                let f = per_mass * (force[i][c] + driving[c]);
                source[c] = volumes[i] * (f + rate * start[i][c]);
            }
        });
        if let Some(bodies) = &creeping.system.bodies {
            bodies.push(&mut creeping.source);
        }
        self.boundary.move_to(self.time + passed);
        self.boundary.pulse_to(self.time + passed);
        self.boundary.balance()?;
        if creeping.answered {
            self.take(&creeping.answers[index]);
        }
        for &(i, pressure) in &self.boundary.outlets {
            self.pressure[i as usize] = pressure * per_mass;
        }
        self.impose_boundary();
        let (velocity, pressure) = (&self.velocity, &self.pressure);
        rows::each(&mut creeping.unknown, |i, x| {
            let [u, v, w, _] = velocity[i];
            *x = [u, v, w, pressure[i]];
        });
        let solved = self.solve_stokes(creeping, rate, held, true)?;
        let controlled = self.control_bulk_velocity(creeping, rate, held)?;
        creeping.answers[index].copy_from_slice(&creeping.unknown);
        self.take(&creeping.unknown);
        let Creeping {
            system,
            unknown,
            residual,
            source,
            ..
        } = creeping;
        let data = Data {
            rate,
            source,
            given: true,
        };
        system.whole_residual(&self.operators, &self.boundary, data, unknown, residual);
        for (constraint, reaction) in self.boundary.constraints.iter().zip(&mut self.reaction) {
            let left = creeping.residual[constraint.node as usize];
            let admitted = constraint.admit(left);
            (0..3).for_each(|c| reaction[c] += weight * (left[c] - admitted[c]));
        }
        Ok(Solved {
            iterations: solved.iterations + controlled,
            ..solved
        })
    }

    /// Velocity and pressure from (u, p).
    fn take(&mut self, answer: &[[f64; 4]]) {
        rows::each(&mut self.velocity, |i, u| {
            let [x, y, z, _] = answer[i];
            *u = [x, y, z, 0.0];
        });
        rows::each(&mut self.pressure, |i, p| *p = answer[i][3]);
    }
}
