//! First half of a step: the momentum equation with the old pressure gradient.
//!
//! | diffusion | sub-step k = 1, 2, 3 |
//! |---|---|
//! | explicit | u^k = u^(k−1) + Δt [γ_k H(u^(k−1)) + ζ_k H(u^(k−2)) + α_k (f/ρ + g − G p)],  H(u) = −C(F)u/V + ν L u |
//! | implicit | the same with H(u) = −C(F)u/V, and + ½ α_k Δt ν L (u^(k−1) + u^k) |
//! | implicit along one axis | the same with L split: L along the axis in the last term, the rest of it in H |
//!
//! With one projection a step the convecting flux F is frozen at the middle of the step, extrapolated from the last two
//! projected fluxes; with three it is that of the sub-step before. It is solenoidal, so the operator is skew-symmetric in
//! every sub-step and the Runge–Kutta scheme can only damp kinetic energy below its stability limit. A steady state does not depend on Δt: the increments vanish together. Where mass is corrected,
//! [`mass`] says how the increment follows from the right-hand side.

use crate::boundary::{Boundary, Through};
use crate::diffusion::DiffusionChoice;
use crate::rows::{self, nothing};
use crate::{Fluid, FluidError};
use fibreflow_mesh::{DualGeometry, LocalMesh};
use fibreflow_parallel::block_sums;
use fibreflow_solve::{CgSettings, ConjugateGradients, Jacobi, PairMatrix};
use std::sync::Arc;

mod added;
mod direct;
mod implicit;
mod mass;
mod operator;
use direct::DirectDiffusion;

/// Weights of the newest and of the older rate of change, and their sum (Spalart, Moser & Rogers 1991).
pub(crate) const SUB_STEPS: [SubStep; 3] = [
    SubStep::new(8.0 / 15.0, 0.0),
    SubStep::new(5.0 / 12.0, -17.0 / 60.0),
    SubStep::new(3.0 / 4.0, -5.0 / 12.0),
];

/// Time passed at the end of each sub-step, by Δt.
pub(crate) const PASSED: [f64; 3] = [8.0 / 15.0, 2.0 / 3.0, 1.0];

#[derive(Clone, Copy)]
pub(crate) struct SubStep {
    gamma: f64,
    zeta: f64,
    pub alpha: f64,
}

impl SubStep {
    const fn new(gamma: f64, zeta: f64) -> Self {
        Self {
            gamma,
            zeta,
            alpha: gamma + zeta,
        }
    }

    /// The instantaneous rate of change.
    pub(crate) const RATE: Self = Self::new(1.0, 0.0);
}

/// What the momentum equation needs besides the flow.
pub(crate) struct Momentum {
    matrix: PairMatrix,
    jacobi: Jacobi,
    krylov: ConjugateGradients<[f64; 4]>,
    /// Direct solves of implicit diffusion, where they are possible.
    pub(crate) direct: Option<DirectDiffusion>,
    /// Owned: V (f/ρ + g − G p) \[m⁴/s²\].
    pub(crate) source: Vec<[f64; 4]>,
    /// Owned: V H(u) of the newest sub-step \[m⁴/s²\].
    rate: Vec<[f64; 4]>,
    /// Total: u of the sub-step to come \[m/s\]; where diffusion is implicit, owned: the explicit part of
    /// V (u^k − u^(k−1)) \[m⁴/s\].
    pub(crate) next: Vec<[f64; 4]>,
    /// Total: u^k − u^(k−1) where diffusion is implicit, or before its mass is corrected; in a projection what the old
    /// pressure adds to the convecting velocity \[m/s\].
    pub(crate) increment: Vec<[f64; 4]>,
    /// Total: by how much the implicit increment differs from the one before it, in the correction of its mass \[m/s\].
    change: Vec<[f64; 4]>,
}

impl Momentum {
    pub fn new(
        mesh: &LocalMesh,
        geometry: &Arc<DualGeometry>,
        boundary: &Boundary,
    ) -> Result<Self, FluidError> {
        let matrix =
            PairMatrix::new(mesh, geometry, &boundary.velocity_fixed, None).map_err(|source| {
                FluidError::Solve {
                    equation: "momentum",
                    source,
                }
            })?;
        let (owned, total) = (vec![[0.0; 4]; mesh.owned()], vec![[0.0; 4]; mesh.total()]);
        Ok(Self {
            jacobi: Jacobi::new(&matrix),
            matrix,
            krylov: ConjugateGradients::new(),
            direct: DirectDiffusion::new(mesh, geometry, boundary),
            source: owned.clone(),
            rate: owned,
            next: total.clone(),
            increment: total,
            change: Vec::new(),
        })
    }
}

impl Fluid {
    /// First half of a step: velocity from momentum with the pressure of the last step; not solenoidal. Collective.
    ///
    /// # Errors
    /// A step size that is not positive and finite, or a viscous solve that fails.
    pub fn predict(&mut self, dt: f64) -> Result<Prediction, FluidError> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(FluidError::TimeStep(dt));
        }
        let diffusion = self.choose_diffusion(dt);
        self.prepare_diffusion(&diffusion)?;
        self.drive(self.time + 0.5 * dt);
        self.correcting = diffusion.corrected_mass;
        self.extrapolate_flux(dt);
        if self.steps == 0 {
            self.start_pressure(dt)?;
        }
        self.gather_sources();
        self.reaction.fill([0.0; 4]);
        let settings = self.viscous_tolerance(&diffusion);
        let mut iterations = [0; 3];
        for (k, iterations) in iterations.iter_mut().enumerate() {
            *iterations = self.sub_step(k, dt, &diffusion, &settings)?;
        }
        self.hold_bulk_velocity(dt);
        self.end_boundary(self.time + 0.5 * dt)?;
        Ok(Prediction {
            diffusion,
            iterations,
        })
    }

    /// F(t + ½Δt) = F + ½ (Δt/Δt') (F − F'), in the place of F'.
    pub(crate) fn extrapolate_flux(&mut self, dt: f64) {
        let ahead = if self.last_dt > 0.0 {
            0.5 * dt / self.last_dt
        } else {
            0.0
        };
        let new = &self.flux;
        rows::each(&mut self.flux_other, |e, flux| {
            *flux = new[e] + ahead * (new[e] - *flux);
        });
        self.boundary.begin_step(ahead);
    }

    /// V (f/ρ + g − G p).
    pub(crate) fn gather_sources(&mut self) {
        let volumes = self.operators.volumes();
        let per_mass = 1.0 / self.settings.density;
        let [x, y, z] = self.driving;
        let (driving, body_force) = ([x, y, z, 0.0], &self.body_force);
        let source = &mut self.momentum.source;
        let mut none = nothing(source.len());
        self.operators.gradient(
            &mut self.pressure,
            (source, &mut none),
            |i, _, gradient, source, ()| {
                let mass = per_mass * volumes[i];
                for c in 0..3 {
                    source[c] = mass * (body_force[i][c] + driving[c]) - gradient[c];
                }
            },
        );
    }

    /// Velocity at the end of sub-step `k`; iterations of the viscous solve.
    pub(crate) fn sub_step(
        &mut self,
        k: usize,
        dt: f64,
        diffusion: &DiffusionChoice,
        settings: &CgSettings,
    ) -> Result<usize, FluidError> {
        let (step, passed) = (&SUB_STEPS[k], PASSED[k] * dt);
        if diffusion.implicit {
            if diffusion.along.is_some() {
                self.explicit_part_of_lines(step, dt);
            } else {
                self.explicit_part(step, dt);
            }
            self.move_boundary(passed, step, dt);
            self.implicit_part(step, dt, diffusion, settings)
        } else {
            self.explicit_sub_step(step, dt, passed);
            Ok(0)
        }
    }

    /// Given velocities `passed` \[s\] after the start of the step; implicit diffusion sees them in the sub-step.
    fn move_boundary(&mut self, passed: f64, step: &SubStep, dt: f64) {
        if self.boundary.moves {
            self.boundary.move_to(self.time + passed);
            let weights = [step.gamma, step.zeta];
            self.boundary.convect_outflow(&self.velocity, dt, weights);
        }
    }

    /// Given fluxes at the end of what was predicted; outlet pressures in its `middle` \[s\].
    pub(crate) fn end_boundary(&mut self, middle: f64) -> Result<(), FluidError> {
        if self.boundary.moves {
            self.boundary.balance()?;
        }
        if self.boundary.pulses {
            self.boundary.pulse_to(middle);
        }
        Ok(())
    }

    /// A sub-step with explicit diffusion, in one pass.
    pub(crate) fn explicit_sub_step(&mut self, step: &SubStep, dt: f64, passed: f64) {
        let nu = self.settings.kinematic_viscosity();
        let (gamma, zeta, alpha) = (dt * step.gamma, dt * step.zeta, dt * step.alpha);
        let Momentum {
            source, rate, next, ..
        } = &mut self.momentum;
        let (source, inverse) = (&*source, self.operators.inverse_volumes());
        let correcting = self.correcting;
        // A factor, not a branch: the kernel stays in vectors.
        let kept = if correcting { 0.0 } else { 1.0 };
        self.operators.convection_diffusion(
            &self.flux_other,
            &mut self.velocity,
            (&mut rate[..], &mut next[..inverse.len()]),
            |i, own, convected, diffused, rate, next| {
                let (source, inverse) = (source[i], inverse[i]);
                for c in 0..4 {
                    let new = convected[c] + nu * diffused[c];
                    let impulse = gamma * new + zeta * rate[c] + alpha * source[c];
                    next[c] = kept * own[c] + inverse * impulse;
                    rate[c] = new;
                }
            },
        );
        self.flow_through(gamma, true);
        self.add_rates(gamma, true);
        self.move_boundary(passed, step, dt);
        if correcting {
            self.correct_step();
        }
        self.confine_sub_step();
        std::mem::swap(&mut self.velocity, &mut self.momentum.next);
    }

    /// Puts into the velocity of the next sub-step what constraints leave of its increment, or what boundaries give.
    fn confine_sub_step(&mut self) {
        let (velocity, next) = (&self.velocity, &mut self.momentum.next);
        // Given nodes are among the constrained ones, in the same order.
        let mut shifts = self.boundary.shift.iter();
        for (constraint, reaction) in self.boundary.constraints.iter().zip(&mut self.reaction) {
            let i = constraint.node as usize;
            let volume = self.operators.volumes()[i];
            let (own, next) = (velocity[i], &mut next[i]);
            let step: [f64; 4] = std::array::from_fn(|c| next[c] - own[c]);
            let mut admitted = constraint.admit(step);
            if self.boundary.velocity_fixed[i] && self.boundary.moves {
                admitted = shifts.next().copied().unwrap_or_default();
            }
            for c in 0..3 {
                reaction[c] += volume * (step[c] - admitted[c]);
                next[c] = own[c] + admitted[c];
            }
        }
    }

    /// Momentum that the flow carries through boundaries, added to `rate` and, times Δt γ, to `next`, a velocity or
    /// an impulse.
    fn flow_through(&mut self, gamma: f64, velocity: bool) {
        let Momentum { rate, next, .. } = &mut self.momentum;
        for &(i, through) in &self.boundary.through {
            let i = i as usize;
            let inverse = self.operators.inverse_volumes()[i];
            let scale = if velocity { inverse } else { 1.0 };
            let flux = match through {
                Through::Given(flux) => flux.convecting,
                Through::Open => -self.operators.flux_sum(&self.flux_other, i),
            };
            // Backflow through an outlet would bring in ½ u² F_b: that much is taken away.
            let flux = flux - 0.5 * flux.min(0.0);
            for c in 0..3 {
                let convected = -self.velocity[i][c] * flux;
                rate[i][c] += convected;
                next[i][c] += scale * gamma * convected;
            }
        }
    }

    /// Explicit part of the increment where diffusion is implicit, into `momentum.next`; what constraints take out goes
    /// to `reaction`.
    pub(crate) fn explicit_part(&mut self, step: &SubStep, dt: f64) {
        let diffusive = step.alpha * dt * self.settings.kinematic_viscosity();
        let (gamma, zeta, alpha) = (dt * step.gamma, dt * step.zeta, dt * step.alpha);
        let Momentum {
            source, rate, next, ..
        } = &mut self.momentum;
        let source = &*source;
        self.operators.convection_diffusion(
            &self.flux_other,
            &mut self.velocity,
            (&mut rate[..], &mut next[..source.len()]),
            |i, _, convected, diffused, rate, rhs| {
                for c in 0..4 {
                    rhs[c] = gamma * convected[c]
                        + zeta * rate[c]
                        + alpha * source[i][c]
                        + diffusive * diffused[c];
                }
                *rate = convected;
            },
        );
        self.flow_through(gamma, false);
        self.add_rates(gamma, false);
        self.confine_explicit_part();
    }

    /// As [`Fluid::explicit_part`] where diffusion is implicit along lines: across them it goes with convection.
    fn explicit_part_of_lines(&mut self, step: &SubStep, dt: f64) {
        let nu = self.settings.kinematic_viscosity();
        let (gamma, zeta, alpha) = (dt * step.gamma, dt * step.zeta, dt * step.alpha);
        let Momentum {
            direct,
            source,
            rate,
            next,
            increment,
            ..
        } = &mut self.momentum;
        let source = &*source;
        // −V L u along the lines, in a place that is free until the solve.
        if let Some(direct) = direct {
            direct.multiply(&mut self.velocity, &mut increment[..source.len()]);
        }
        let along = &increment[..source.len()];
        self.operators.convection_diffusion(
            &self.flux_other,
            &mut self.velocity,
            (&mut rate[..], &mut next[..source.len()]),
            |i, _, convected, diffused, rate, rhs| {
                for c in 0..4 {
                    let new = convected[c] + nu * (diffused[c] + along[i][c]);
                    let implicit = source[i][c] - nu * along[i][c];
                    rhs[c] = gamma * new + zeta * rate[c] + alpha * implicit;
                    rate[c] = new;
                }
            },
        );
        self.flow_through(gamma, false);
        self.add_rates(gamma, false);
        self.confine_explicit_part();
    }

    fn confine_explicit_part(&mut self) {
        let rhs = &mut self.momentum.next;
        for (constraint, reaction) in self.boundary.constraints.iter().zip(&mut self.reaction) {
            let rhs = &mut rhs[constraint.node as usize];
            let admitted = constraint.admit(*rhs);
            (0..4).for_each(|c| reaction[c] += rhs[c] - admitted[c]);
            *rhs = admitted;
        }
    }

    /// Adds the uniform velocity that brings the mean to its target, and learns the driving force from it.
    pub(crate) fn hold_bulk_velocity(&mut self, dt: f64) {
        let Some((direction, target)) = self.settings.forcing.controlled() else {
            return;
        };
        let [x, y, z] = direction;
        let direction = [x, y, z, 0.0];
        let volumes = self.operators.volumes();
        let (velocity, constraints) = (&mut self.velocity, &self.boundary.constraints);
        let along = |v: [f64; 4]| (0..3).map(|c| v[c] * direction[c]).sum::<f64>();
        let [sum] = block_sums(volumes.len(), |range| {
            [range.map(|i| volumes[i] * along(velocity[i])).sum()]
        });
        let given = |s: f64, c: &crate::boundary::Constraint| {
            s + volumes[c.node as usize] * (1.0 - along(c.admit(direction)))
        };
        let mut sums = [sum, constraints.iter().fold(0.0, given)];
        self.mesh.halo.communicator().sum_slice(&mut sums);
        let total = self.operators.geometry.total_volume;
        let shift = (target * total - sums[0]) / (total - sums[1]);
        let step = direction.map(|d| d * shift);
        rows::each(&mut velocity[..volumes.len()], |_, u| {
            (0..3).for_each(|c| u[c] += step[c]);
        });
        for (constraint, reaction) in constraints.iter().zip(&mut self.reaction) {
            let i = constraint.node as usize;
            let admitted = constraint.admit(step);
            for c in 0..3 {
                velocity[i][c] -= step[c] - admitted[c];
                reaction[c] += volumes[i] * (step[c] - admitted[c]);
            }
        }
        for c in 0..3 {
            self.driving[c] += self.settings.density * step[c] / dt;
        }
    }

    /// Relative tolerance as set; absolute where the increment is round-off of the velocity itself.
    pub(crate) fn viscous_tolerance(&self, diffusion: &DiffusionChoice) -> CgSettings {
        if !diffusion.implicit || diffusion.direct {
            return self.settings.momentum;
        }
        let (velocity, volumes) = (&self.velocity, self.operators.volumes());
        let [sum] = block_sums(volumes.len(), |range| {
            let square = |i: usize| {
                let [x, y, z, _] = velocity[i];
                volumes[i] * volumes[i] * (x * x + y * y + z * z)
            };
            [range.map(square).sum()]
        });
        let scale = self.mesh.halo.communicator().sum(sum).sqrt();
        let settings = self.settings.momentum;
        CgSettings {
            absolute_tolerance: settings.absolute_tolerance.max(1e-16 * scale),
            ..settings
        }
    }
}

/// What the first half of a step did.
#[derive(Clone, Copy, Debug)]
pub struct Prediction {
    /// How diffusion was advanced.
    pub diffusion: DiffusionChoice,
    /// Conjugate-gradient iterations of the viscous solves, one where they are direct.
    pub iterations: [usize; 3],
}
