//! First half of a step: the momentum equation with the old pressure gradient.
//!
//! u^k = u^(k−1) + Δt [γ_k H(u^(k−1)) + ζ_k H(u^(k−2)) + α_k (f/ρ + g − G p)] + ½ α_k Δt ν L (u^(k−1) + u^k), k = 1, 2, 3
//!
//! with V H(u) = −C(F)u. The convecting flux F is frozen at the middle of the step, extrapolated from the last two
//! projected fluxes: it is solenoidal, so the operator is skew-symmetric in every sub-step and the Runge–Kutta scheme
//! can only damp kinetic energy (for |λΔt| < √3). A steady state does not depend on Δt: the increments vanish together.

use crate::boundary::{Boundary, Through};
use crate::{Fluid, FluidError, rows};
use fibreflow_mesh::{DualGeometry, LocalMesh};
use fibreflow_parallel::block_sums;
use fibreflow_solve::{CgSettings, ConjugateGradients, Helmholtz, Jacobi, NullSpace, PairMatrix};

mod operator;
use operator::Confined;

/// Weights of the newest and of the older convective increment, and their sum (Spalart, Moser & Rogers 1991).
const SUB_STEPS: [SubStep; 3] = [
    SubStep::new(8.0 / 15.0, 0.0),
    SubStep::new(5.0 / 12.0, -17.0 / 60.0),
    SubStep::new(3.0 / 4.0, -5.0 / 12.0),
];

/// Time passed at the end of each sub-step, by Δt.
const PASSED: [f64; 3] = [8.0 / 15.0, 2.0 / 3.0, 1.0];

#[derive(Clone, Copy)]
pub(crate) struct SubStep {
    gamma: f64,
    zeta: f64,
    alpha: f64,
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
    /// F at the middle of the step, by pair entry \[m³/s\].
    convecting: Vec<f64>,
    /// Owned: V (f/ρ + g − G p) \[m⁴/s²\].
    pub(crate) source: Vec<[f64; 4]>,
    /// Owned: −C(F)u of the newest sub-step \[m⁴/s²\].
    convection: Vec<[f64; 4]>,
    /// Owned: explicit part of V (u^k − u^(k−1)) \[m⁴/s\].
    pub(crate) rhs: Vec<[f64; 4]>,
    /// Total: u^k − u^(k−1) \[m/s\].
    pub(crate) increment: Vec<[f64; 4]>,
}

impl Momentum {
    pub fn new(
        mesh: &LocalMesh,
        geometry: &DualGeometry,
        boundary: &Boundary,
    ) -> Result<Self, FluidError> {
        let matrix =
            PairMatrix::new(mesh, geometry, &boundary.velocity_fixed, None).map_err(|source| {
                FluidError::Solve {
                    equation: "momentum",
                    source,
                }
            })?;
        let owned = vec![[0.0; 4]; mesh.owned()];
        Ok(Self {
            jacobi: Jacobi::new(&matrix),
            matrix,
            krylov: ConjugateGradients::new(),
            convecting: vec![0.0; geometry.columns.len()],
            source: owned.clone(),
            convection: owned.clone(),
            rhs: owned,
            increment: vec![[0.0; 4]; mesh.total()],
        })
    }
}

impl Fluid {
    /// First half of a step: velocity from momentum with the pressure of the last step; not solenoidal. Returns the
    /// iterations of the three viscous solves. Collective.
    ///
    /// # Errors
    /// A step size that is not positive and finite, or a viscous solve that fails.
    pub fn predict(&mut self, dt: f64) -> Result<[usize; 3], FluidError> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(FluidError::TimeStep(dt));
        }
        self.extrapolate_flux(dt);
        if self.steps == 0 {
            self.start_pressure(dt)?;
        }
        self.gather_sources();
        self.reaction.fill([0.0; 4]);
        let settings = self.viscous_tolerance();
        let mut iterations = [0; 3];
        for (k, (sub_step, iterations)) in SUB_STEPS.iter().zip(&mut iterations).enumerate() {
            self.explicit(sub_step, dt);
            self.move_boundary(PASSED[k] * dt);
            *iterations = self.implicit(sub_step, dt, &settings)?;
        }
        self.hold_bulk_velocity(dt);
        self.end_boundary(dt)?;
        Ok(iterations)
    }

    /// F(t + ½Δt) = F + ½ (Δt/Δt') (F − F').
    fn extrapolate_flux(&mut self, dt: f64) {
        let ahead = if self.last_dt > 0.0 {
            0.5 * dt / self.last_dt
        } else {
            0.0
        };
        let (new, old) = (&self.flux, &self.flux_previous);
        rows::each(&mut self.momentum.convecting, |e, flux| {
            *flux = new[e] + ahead * (new[e] - old[e]);
        });
        self.boundary.begin_step(ahead);
    }

    /// V (f/ρ + g − G p).
    pub(crate) fn gather_sources(&mut self) {
        let volumes = self.operators.volumes();
        let source = &mut self.momentum.source;
        self.operators.gradient(&mut self.pressure, source);
        let per_mass = 1.0 / self.settings.density;
        let [x, y, z] = self.driving;
        let (driving, body_force) = ([x, y, z, 0.0], &self.body_force);
        rows::each(source, |i, source| {
            for c in 0..3 {
                let force = per_mass * (body_force[i][c] + driving[c]);
                source[c] = volumes[i] * force - source[c];
            }
        });
    }

    /// Explicit part of the increment into `momentum.rhs`; what constraints take out goes to `reaction`.
    pub(crate) fn explicit(&mut self, step: &SubStep, dt: f64) {
        let Momentum {
            convecting,
            source,
            convection,
            rhs,
            ..
        } = &mut self.momentum;
        let diffusive = step.alpha * dt * self.settings.kinematic_viscosity();
        let (gamma, zeta, alpha) = (dt * step.gamma, dt * step.zeta, dt * step.alpha);
        let through = &self.boundary.through;
        let velocity = &mut self.velocity;
        self.operators.convection_diffusion(
            convecting,
            velocity,
            (convection, rhs),
            |i, convected, diffused, convection, rhs| {
                for c in 0..4 {
                    rhs[c] = gamma * convected[c]
                        + zeta * convection[c]
                        + alpha * source[i][c]
                        + diffusive * diffused[c];
                }
                *convection = convected;
            },
        );
        for &(i, through) in through {
            let i = i as usize;
            let flux = match through {
                Through::Given(flux) => flux.convecting,
                Through::Open => -self.operators.flux_sum(convecting, i),
            };
            // Backflow through an outlet would bring in ½ u² F_b: that much is taken away.
            let flux = flux - 0.5 * flux.min(0.0);
            for c in 0..3 {
                let convected = -velocity[i][c] * flux;
                convection[i][c] += convected;
                rhs[i][c] += gamma * convected;
            }
        }
        for (constraint, reaction) in self.boundary.constraints.iter().zip(&mut self.reaction) {
            let rhs = &mut rhs[constraint.node as usize];
            let admitted = constraint.admit(*rhs);
            (0..4).for_each(|c| reaction[c] += rhs[c] - admitted[c]);
            *rhs = admitted;
        }
    }

    /// Solves (V − ½ α Δt ν V L) δ = rhs and adds δ to the velocity (owned entries).
    fn implicit(
        &mut self,
        step: &SubStep,
        dt: f64,
        settings: &CgSettings,
    ) -> Result<usize, FluidError> {
        let coefficient = 0.5 * step.alpha * dt * self.settings.kinematic_viscosity();
        let volumes = self.operators.volumes();
        let Momentum {
            matrix,
            jacobi,
            krylov,
            rhs,
            increment,
            ..
        } = &mut self.momentum;
        let mut iterations = 0;
        let moves = self.boundary.moves;
        if coefficient > 0.0 {
            let helmholtz = Helmholtz {
                matrix,
                mass: volumes,
                coefficient,
            };
            if moves {
                increment.fill([0.0; 4]);
                self.boundary.put_shift(increment);
                self.mesh.halo.update(increment);
                helmholtz.lift(increment, rhs);
                self.boundary.put_zero(rhs);
            }
            jacobi.update(helmholtz.diagonal());
            let operator = Confined {
                helmholtz,
                constraints: &self.boundary.constraints,
            };
            increment.fill([0.0; 4]);
            let solve = krylov.solve(&operator, jacobi, rhs, increment, settings, NullSpace::None);
            iterations = solve
                .map_err(|source| self.solve_failed("momentum", source))?
                .iterations;
            if moves {
                let increment = &mut self.momentum.increment;
                self.boundary.put_shift(increment);
                self.mesh.halo.update(increment);
            }
            self.close_balance(coefficient);
        } else {
            rows::each(&mut increment[..rhs.len()], |i, increment| {
                *increment = rhs[i].map(|r| r / volumes[i]);
            });
            self.boundary.put_shift(increment);
        }
        self.book_shift();
        let increment = &self.momentum.increment;
        let owned = self.mesh.owned();
        rows::each(&mut self.velocity[..owned], |i, u| {
            (0..3).for_each(|c| u[c] += increment[i][c]);
        });
        Ok(iterations)
    }

    /// Given velocities `passed` \[s\] after the start of the step; implicit diffusion sees them in the sub-step.
    fn move_boundary(&mut self, passed: f64) {
        if self.boundary.moves {
            self.boundary.move_to(self.time + passed);
        }
    }

    /// Momentum that boundaries gave to nodes whose velocity they changed.
    fn book_shift(&mut self) {
        if !self.boundary.moves {
            return;
        }
        let volumes = self.operators.volumes();
        for (constraint, reaction) in self.boundary.constraints.iter().zip(&mut self.reaction) {
            let i = constraint.node as usize;
            let increment = self.momentum.increment[i];
            let admitted = constraint.admit(increment);
            (0..3).for_each(|c| reaction[c] -= volumes[i] * (increment[c] - admitted[c]));
        }
    }

    /// Given fluxes at the end of the step, outlet pressures in its middle.
    fn end_boundary(&mut self, dt: f64) -> Result<(), FluidError> {
        if self.boundary.moves {
            self.boundary.balance()?;
        }
        if self.boundary.pulses {
            self.boundary.pulse_to(self.time + 0.5 * dt);
        }
        Ok(())
    }

    /// Momentum that the implicit part of diffusion gave to constrained nodes; without any, the mean of the increment
    /// is set to what was put in, so that momentum does not depend on the tolerance of the solve.
    fn close_balance(&mut self, coefficient: f64) {
        let increment = &mut self.momentum.increment;
        for (constraint, reaction) in self.boundary.constraints.iter().zip(&mut self.reaction) {
            let i = constraint.node as usize;
            let diffused = self.operators.diffusion_row(increment, i);
            let admitted = constraint.admit(diffused);
            (0..3).for_each(|c| reaction[c] += coefficient * (diffused[c] - admitted[c]));
        }
        if !self.boundary.unconstrained {
            return;
        }
        let (rhs, volumes) = (&self.momentum.rhs, self.operators.volumes());
        let mut missing = block_sums::<3>(rhs.len(), |range| {
            range.fold([0.0; 3], |s, i| {
                std::array::from_fn(|c| s[c] + (rhs[i][c] - volumes[i] * increment[i][c]))
            })
        });
        self.mesh.halo.communicator().sum_slice(&mut missing);
        let shift = missing.map(|m| m / self.operators.geometry.total_volume);
        rows::each(increment, |_, increment| {
            (0..3).for_each(|c| increment[c] += shift[c]);
        });
    }

    /// Adds the uniform velocity that brings the mean to its target, and learns the driving force from it.
    fn hold_bulk_velocity(&mut self, dt: f64) {
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
    fn viscous_tolerance(&self) -> CgSettings {
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
