//! Creeping flow: the Stokes equations solved as one linear system, steady or in time, without convection.
//!
//! ```text
//! P [V s (u − u°) − ν V L u + V G p] = P V f/ρ          s = 0 (steady) or 1/(γΔt)
//! Σ_j F_ij + F_b = 0,   F_ij = ½(u_i + u_j)·S_ij + ½(T_i g_i + T_j g_j)·S_ij − τ_ij w_ij (p_j − p_i),   g = G p
//! ```
//!
//! (NUMERICS section 1). The divergence of pair fluxes is minus the transpose of V G, and with T_i = c h²/ν
//! the last two terms of F are symmetric and positive for any pressure, zero for a linear one: a stabilised saddle-point
//! problem (after Rhie & Chow 1983; Hughes, Franca & Balestra 1986) in which no chequerboard survives.
//! Steps shorter than h²/ν limit T to 2/s, which a steady state feels in fourth order of h. On orthogonal hexahedra T is a diagonal tensor, c h_c²/ν along axis c; elsewhere a number.
//!
//! Where a uniform flow meets no resistance (periodic boxes) the net force is balanced by a uniform pressure gradient and
//! the mean velocity is held.

mod bodies;
mod krylov;
mod modes;
mod precondition;
mod step;
mod system;

pub use bodies::{BodyLink, BodyMotion, BodyPart, BodyState};
pub use step::CreepingStep;

use crate::boundary::Boundary;
use crate::operators::Operators;
use crate::{Fluid, FluidError, Inertia, PressurePreconditioner, rows};
use fibreflow_mesh::LocalMesh;
use fibreflow_parallel::block_sums;
use fibreflow_solve::SolveError;
use krylov::{Krylov, Target, weighted_norm};
use precondition::BlockPreconditioner;
use system::{Data, System};

/// Attempts to bring both residuals below their targets; the second already starts near them.
const ATTEMPTS: usize = 4;

/// Directions kept by the Krylov method, and with bodies in the flow: they are strong and local, and with fewer it stalls.
const KEPT: usize = 24;
const KEPT_WITH_BODIES: usize = 96;

/// What creeping flow needs besides the fluid.
pub(crate) struct Creeping {
    system: System,
    preconditioner: BlockPreconditioner,
    krylov: Krylov,
    /// Components of a uniform flow that nothing resists.
    free: [bool; 3],
    /// Right-hand side of momentum without boundaries, V (f/ρ + s u°) \[m⁴/s²\], owned.
    source: Vec<[f64; 4]>,
    /// (u, p) of the running solve and its residual; total and owned.
    unknown: Vec<[f64; 4]>,
    residual: Vec<[f64; 4]>,
    /// (u, p) at rest, total, and square roots of the weights of the residual norm, owned.
    rest: Vec<[f64; 4]>,
    weights: Vec<[f64; 4]>,
    /// Flow per unit of driving force along the controlled direction, with the rate it belongs to.
    response: Option<(f64, Vec<[f64; 4]>)>,
    /// Velocity that a stage starts from, and that of the start of the step; owned.
    start: Vec<[f64; 4]>,
    origin: Vec<[f64; 4]>,
    /// (u, p) of the stages at the last solve of the step, total, if there was one.
    answers: [Vec<[f64; 4]>; 2],
    answered: bool,
}

/// How one linear solve went.
#[derive(Clone, Copy, Debug, Default)]
struct Solved {
    iterations: usize,
    divergence: [f64; 2],
}

impl Creeping {
    pub fn new(
        mesh: &LocalMesh,
        operators: &Operators,
        boundary: &Boundary,
        viscosity: f64,
        preconditioner: PressurePreconditioner,
    ) -> Result<Self, FluidError> {
        use PressurePreconditioner::{Auto, Direct};
        let directly = matches!(preconditioner, Auto | Direct);
        let system = System::new(mesh, operators, viscosity)?;
        let owned = vec![[0.0; 4]; mesh.owned()];
        Ok(Self {
            preconditioner: BlockPreconditioner::new(mesh, boundary, directly),
            krylov: Krylov::default(),
            free: free_directions(mesh, boundary),
            source: owned.clone(),
            unknown: vec![[0.0; 4]; mesh.total()],
            residual: owned.clone(),
            rest: vec![[0.0; 4]; mesh.total()],
            weights: owned.clone(),
            response: None,
            start: owned.clone(),
            origin: owned,
            answers: std::array::from_fn(|_| vec![[0.0; 4]; mesh.total()]),
            answered: false,
            system,
        })
    }
}

/// Components c for which every constraint admits the uniform flow e_c.
fn free_directions(mesh: &LocalMesh, boundary: &Boundary) -> [bool; 3] {
    let mut held = [0.0; 3];
    for constraint in &boundary.constraints {
        for (c, held) in held.iter_mut().enumerate() {
            let mut unit = [0.0; 4];
            unit[c] = 1.0;
            *held += (1.0 - constraint.admit(unit)[c]).abs();
        }
    }
    mesh.halo.communicator().sum_slice(&mut held);
    held.map(|h| h < 1e-12)
}

impl Fluid {
    /// Components whose mean velocity is kept: free ones in steady flow.
    fn held(&self, creeping: &Creeping) -> [bool; 3] {
        let steady = self.settings.inertia == Inertia::Steady || self.settings.hold_mean_velocity;
        creeping.free.map(|free| free && steady)
    }

    /// Brings the momentum and the divergence residual below the tolerance, from the guess in `creeping.unknown`.
    /// `given` is false for a response: boundary velocities and outlet pressures are zero then.
    fn solve_stokes(
        &self,
        creeping: &mut Creeping,
        rate: f64,
        held: [bool; 3],
        given: bool,
    ) -> Result<Solved, FluidError> {
        let failed = |source| self.solve_failed("Stokes", source);
        let communicator = self.mesh.halo.communicator();
        let (operators, boundary) = (&self.operators, &self.boundary);
        let Creeping {
            system,
            preconditioner,
            krylov,
            source,
            unknown,
            residual,
            rest,
            weights,
            ..
        } = creeping;
        // Rounded, so that neither the answer nor the set-up depends on the steps before, nor changes with each.
        let near = if rate > 0.0 {
            rate.log2().round().exp2()
        } else {
            0.0
        };
        let scales = (near, system.viscosity);
        system
            .prepare(&self.mesh, operators, near)
            .map_err(failed)?;
        preconditioner
            .prepare(&self.mesh, operators, boundary, scales)
            .map_err(failed)?;
        system.weigh(operators, rate, weights);
        let mean = self.mean(unknown);
        let data = Data {
            rate,
            source,
            given,
        };
        let sizes = |system: &System, x: &[[f64; 4]], residual: &[[f64; 4]]| {
            let mut sums = system.sizes(data, x, residual);
            communicator.sum_slice(&mut sums);
            sums.map(f64::sqrt)
        };
        // What the data ask for: the residual of a flow at rest but for its boundaries.
        self.put_rest(rest, given);
        self.level(rest, held, mean);
        system.residual(operators, boundary, data, rest, residual);
        self.balance(residual, held);
        let [asked, asked_flux, _, terms] = sizes(system, rest, residual);
        if asked <= 1e-14 * terms && asked_flux == 0.0 {
            unknown.copy_from_slice(rest);
        }
        let scale = weighted_norm(residual, weights, communicator);
        let tolerance = self.settings.pressure.relative_tolerance;
        let (mut solved, mut goal) = (Solved::default(), tolerance);
        for attempt in 0..ATTEMPTS {
            system.residual(operators, boundary, data, unknown, residual);
            self.balance(residual, held);
            let [momentum, divergence, flow, terms] = sizes(system, unknown, residual);
            if attempt == 0 {
                solved.divergence[0] = divergence;
            }
            solved.divergence[1] = divergence;
            if !(momentum + divergence + terms).is_finite() {
                let iteration = solved.iterations;
                return Err(failed(SolveError::NotFinite { iteration }));
            }
            let targets = [
                (tolerance * asked).max(1e-15 * terms),
                (tolerance * flow.max(asked_flux)).max(1e-15 * flow),
            ];
            if momentum <= targets[0] && divergence <= targets[1] {
                break;
            }
            if attempt + 1 == ATTEMPTS {
                return Err(failed(SolveError::NotConverged {
                    iterations: solved.iterations,
                    residual: momentum,
                    target: targets[0],
                    initial_residual: asked,
                }));
            }
            if attempt > 0 {
                let over = (momentum / targets[0]).max(divergence / targets[1].max(1e-300));
                goal *= (0.5 / over).clamp(1e-3, 0.5);
            }
            let target = Target {
                residual: goal * scale,
                max_iterations: self.settings.pressure.max_iterations,
                kept: if system.bodies.is_some() {
                    KEPT_WITH_BODIES
                } else {
                    KEPT
                },
            };
            let operator = |z: &mut [[f64; 4]], q: &mut [[f64; 4]]| {
                system.apply(operators, boundary, rate, z, q);
                if system.bodies.is_some() {
                    // Bodies of given motion resist a uniform flow.
                    self.balance(q, held);
                }
            };
            let precondition = |r: &[[f64; 4]], z: &mut [[f64; 4]]| {
                preconditioner.apply(operators, boundary, scales, r, z)?;
                self.level(z, held, [0.0; 3]);
                Ok(())
            };
            solved.iterations += krylov
                .solve(
                    operator,
                    precondition,
                    weights,
                    (unknown, residual),
                    target,
                    communicator,
                )
                .map_err(failed)?;
        }
        self.level(unknown, held, mean);
        if !communicator.any(!self.boundary.outlets.is_empty()) {
            self.remove_mean_pressure(unknown);
        }
        self.mesh.halo.update(unknown);
        Ok(solved)
    }

    /// No flow but for boundary values and no pressure but at outlets.
    fn put_rest(&self, rest: &mut [[f64; 4]], given: bool) {
        rest.fill([0.0; 4]);
        if given {
            for &(i, [x, y, z]) in &self.boundary.given {
                rest[i as usize] = [x, y, z, 0.0];
            }
            for &(i, pressure) in &self.boundary.outlets {
                rest[i as usize][3] = pressure / self.settings.density;
            }
        }
    }

    /// Takes the uniform force from the momentum residual that a pressure gradient balances.
    fn balance(&self, residual: &mut [[f64; 4]], held: [bool; 3]) {
        if held == [false; 3] {
            return;
        }
        let volumes = self.operators.volumes();
        let mut sums = block_sums::<3>(residual.len(), |range| {
            range.fold([0.0; 3], |s, i| {
                std::array::from_fn(|c| s[c] + residual[i][c])
            })
        });
        self.mesh.halo.communicator().sum_slice(&mut sums);
        let total = self.operators.geometry.total_volume;
        rows::each(residual, |i, r| {
            for c in (0..3).filter(|&c| held[c]) {
                r[c] -= volumes[i] * (sums[c] / total);
            }
        });
    }

    /// Mean velocity over the domain of a field of total length.
    fn mean(&self, field: &[[f64; 4]]) -> [f64; 3] {
        let volumes = self.operators.volumes();
        let mut sums = block_sums::<3>(volumes.len(), |range| {
            range.fold([0.0; 3], |s, i| {
                std::array::from_fn(|c| s[c] + volumes[i] * field[i][c])
            })
        });
        self.mesh.halo.communicator().sum_slice(&mut sums);
        sums.map(|s| s / self.operators.geometry.total_volume)
    }

    /// Sets the mean velocity of the held components.
    fn level(&self, field: &mut [[f64; 4]], held: [bool; 3], wanted: [f64; 3]) {
        if held == [false; 3] {
            return;
        }
        let mean = self.mean(field);
        rows::each(field, |_, u| {
            for c in (0..3).filter(|&c| held[c]) {
                u[c] += wanted[c] - mean[c];
            }
        });
    }

    /// Mean over the nodes to zero.
    fn remove_mean_pressure(&self, field: &mut [[f64; 4]]) {
        let owned = self.mesh.owned();
        let [sum] = block_sums(owned, |range| [range.map(|i| field[i][3]).sum()]);
        let mut sums = [sum, owned as f64];
        self.mesh.halo.communicator().sum_slice(&mut sums);
        let mean = sums[0] / sums[1];
        rows::each(field, |_, x| x[3] -= mean);
    }

    /// Adds the multiple of the response to a uniform force that brings the mean velocity to its target; the driving
    /// force learns it.
    fn control_bulk_velocity(
        &mut self,
        creeping: &mut Creeping,
        rate: f64,
        held: [bool; 3],
    ) -> Result<usize, FluidError> {
        let Some((direction, target)) = self.settings.forcing.controlled() else {
            return Ok(0);
        };
        let along = |mean: [f64; 3]| (0..3).map(|c| mean[c] * direction[c]).sum::<f64>();
        let missing = target - along(self.mean(&creeping.unknown));
        if (0..3).all(|c| held[c] || direction[c] == 0.0) {
            rows::each(&mut creeping.unknown, |_, u| {
                (0..3).for_each(|c| u[c] += missing * direction[c]);
            });
            return Ok(0);
        }
        let mut iterations = 0;
        if creeping.response.as_ref().is_none_or(|r| r.0 != rate) {
            let flow = vec![[0.0; 4]; self.mesh.total()];
            let unknown = std::mem::replace(&mut creeping.unknown, flow);
            let volumes = self.operators.volumes();
            let [x, y, z] = direction;
            let source = volumes.iter().map(|v| [v * x, v * y, v * z, 0.0]);
            let source = std::mem::replace(&mut creeping.source, source.collect());
            let solve = self.solve_stokes(creeping, rate, held, false);
            creeping.source = source;
            let flow = std::mem::replace(&mut creeping.unknown, unknown);
            iterations = solve?.iterations;
            creeping.response = Some((rate, flow));
        }
        let Some((_, response)) = &creeping.response else {
            return Ok(iterations);
        };
        let force = missing / along(self.mean(response));
        rows::each(&mut creeping.unknown, |i, x| {
            (0..4).for_each(|c| x[c] += force * response[i][c]);
        });
        let volumes = self.operators.volumes();
        rows::each(&mut creeping.source, |i, s| {
            (0..3).for_each(|c| s[c] += volumes[i] * force * direction[c]);
        });
        for c in 0..3 {
            self.driving[c] += self.settings.density * force * direction[c];
        }
        Ok(iterations)
    }
}
