//! Implicit diffusion: the solve of a sub-step, and what it gives to the boundary.

use super::operator::Confined;
use super::{Momentum, SubStep};
use crate::diffusion::DiffusionChoice;
use crate::rows;
use crate::{Fluid, FluidError};
use fibreflow_parallel::block_sums;
use fibreflow_solve::{CgSettings, Helmholtz, NullSpace};

impl Fluid {
    /// Sets up the direct solves of a step, the first time. Collective.
    pub(crate) fn prepare_diffusion(
        &mut self,
        diffusion: &DiffusionChoice,
    ) -> Result<(), FluidError> {
        match &mut self.momentum.direct {
            Some(direct) if diffusion.direct => {
                direct.prepare(diffusion.along, &self.boundary.velocity_fixed)
            }
            _ => Ok(()),
        }
    }

    /// Solves (V − ½ α Δt ν V L) δ = rhs, L along lines or the whole, twice more with lumping errors where mass is corrected
    /// ([`super::mass`]), and adds δ to the velocity (owned entries).
    pub(super) fn implicit_part(
        &mut self,
        step: &SubStep,
        dt: f64,
        diffusion: &DiffusionChoice,
        settings: &CgSettings,
    ) -> Result<usize, FluidError> {
        let coefficient = 0.5 * step.alpha * dt * self.settings.kinematic_viscosity();
        self.lift_shift(coefficient, diffusion);
        let mut iterations = self.viscous_solve(coefficient, diffusion, settings)?;
        if self.correcting {
            let Momentum {
                increment, change, ..
            } = &mut self.momentum;
            change.clone_from(increment);
            iterations += self.solve_again(coefficient, diffusion, settings)?;
            let increment = &self.momentum.increment;
            rows::each(&mut self.momentum.change, |i, change| {
                *change = std::array::from_fn(|c| increment[i][c] - change[c]);
            });
            iterations += self.solve_again(coefficient, diffusion, settings)?;
        }
        self.close_balance(coefficient, diffusion);
        self.book_shift();
        let increment = &self.momentum.increment;
        let owned = self.mesh.owned();
        rows::each(&mut self.velocity[..owned], |i, u| {
            (0..3).for_each(|c| u[c] += increment[i][c]);
        });
        Ok(iterations)
    }

    /// The next of the increments with corrected mass.
    fn solve_again(
        &mut self,
        coefficient: f64,
        diffusion: &DiffusionChoice,
        settings: &CgSettings,
    ) -> Result<usize, FluidError> {
        self.correct_right_side();
        // Zero at given nodes, as what is solved for.
        self.boundary.put_zero(&mut self.momentum.increment);
        self.viscous_solve(coefficient, diffusion, settings)
    }

    /// Changes of given velocities into the right-hand side; the increment becomes zero.
    fn lift_shift(&mut self, coefficient: f64, diffusion: &DiffusionChoice) {
        let Momentum {
            matrix,
            direct,
            next,
            increment,
            ..
        } = &mut self.momentum;
        increment.fill([0.0; 4]);
        if self.boundary.moves {
            let mass = self.operators.volumes();
            let helmholtz = Helmholtz {
                matrix,
                mass,
                coefficient,
            };
            self.boundary.put_shift(increment);
            self.mesh.halo.update(increment);
            match direct {
                Some(direct) if diffusion.along.is_some() => {
                    direct.lift(increment, mass, coefficient, next);
                }
                _ => helmholtz.lift(increment, next),
            }
            self.boundary.put_zero(next);
            increment.fill([0.0; 4]);
        }
    }

    /// Increment from the right-hand side, given values put in; starts from the increment, zero at given nodes.
    fn viscous_solve(
        &mut self,
        coefficient: f64,
        diffusion: &DiffusionChoice,
        settings: &CgSettings,
    ) -> Result<usize, FluidError> {
        let volumes = self.operators.volumes();
        let Momentum {
            matrix,
            jacobi,
            krylov,
            direct,
            next,
            increment,
            ..
        } = &mut self.momentum;
        let rhs = &next[..volumes.len()];
        let iterations = match direct {
            Some(direct) if diffusion.direct => {
                let lines = diffusion.along.is_some();
                let solved = direct.solve(lines, coefficient, rhs, increment);
                solved.map_err(|source| self.solve_failed("momentum", source))?;
                1
            }
            _ => {
                let helmholtz = Helmholtz {
                    matrix,
                    mass: volumes,
                    coefficient,
                };
                jacobi.update(helmholtz.diagonal());
                let operator = Confined {
                    helmholtz,
                    constraints: &self.boundary.constraints,
                };
                let none = NullSpace::None;
                let solve = krylov.solve(&operator, jacobi, rhs, increment, settings, none);
                let solve = solve.map_err(|source| self.solve_failed("momentum", source))?;
                solve.iterations
            }
        };
        if self.boundary.moves {
            let increment = &mut self.momentum.increment;
            self.boundary.put_shift(increment);
            self.mesh.halo.update(increment);
        }
        Ok(iterations)
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

    /// Momentum that the implicit part of diffusion gave to constrained nodes; without any, the mean of the increment
    /// is set to what was put in, so that momentum does not depend on the tolerance of the solve.
    fn close_balance(&mut self, coefficient: f64, diffusion: &DiffusionChoice) {
        let Momentum {
            next,
            increment,
            direct,
            ..
        } = &mut self.momentum;
        let lines = direct.as_ref().filter(|_| diffusion.along.is_some());
        for (constraint, reaction) in self.boundary.constraints.iter().zip(&mut self.reaction) {
            let i = constraint.node as usize;
            let diffused = match lines {
                Some(lines) => lines.row(increment, i),
                None => self.operators.diffusion_row(increment, i),
            };
            let admitted = constraint.admit(diffused);
            (0..3).for_each(|c| reaction[c] += coefficient * (diffused[c] - admitted[c]));
        }
        if !self.boundary.unconstrained {
            return;
        }
        let (rhs, volumes) = (&*next, self.operators.volumes());
        let mut missing = block_sums::<3>(volumes.len(), |range| {
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
}
