//! The incompressible solver: one step is `predict`, then `project`.

use crate::boundary::Boundary;
use crate::creeping::Creeping;
use crate::eddy::{Eddy, walls};
use crate::mismatch::Mismatch;
use crate::operators::Operators;
use crate::poisson::Pressure;
use crate::predict::Momentum;
use crate::settings::length;
use crate::{DiffusionChoice, FluidError, FluidSettings, Forcing, Inertia, PressureChoice};
use fibreflow_mesh::{BoundaryNode, DualGeometry, LocalMesh};
use std::sync::Arc;

/// Incompressible flow of constant density and viscosity on the nodes of a mesh.
///
/// ∂u/∂t + ∇·(u u) = −∇p/ρ + ν∇²u + f/ρ, ∇·u = 0 (NUMERICS section 1; K 3.3), second order in space and time:
///
/// 1. `predict`: three sub-steps of low-storage Runge–Kutta for convection and, where it is stable, diffusion, else with
///    Crank–Nicolson for diffusion; with the pressure gradient of the last step, and a convecting flux extrapolated from
///    the last two projected ones;
/// 2. `project`: pair fluxes interpolated from the prediction, one compact Poisson equation for the pressure
///    increment, fluxes and velocity corrected.
pub struct Fluid {
    pub(crate) mesh: Arc<LocalMesh>,
    pub(crate) settings: FluidSettings,
    pub(crate) operators: Operators,
    pub(crate) boundary: Boundary,
    pub(crate) momentum: Momentum,
    pub(crate) poisson: Pressure,
    /// The present step corrects lumped mass, see [`crate::Mass`].
    pub(crate) correcting: bool,
    pub(crate) mismatch: Mismatch,
    /// What a flow without inertia needs; none in a flow with it.
    pub(crate) creeping: Option<Creeping>,
    /// What a turbulence model needs.
    pub(crate) eddy: Option<Box<Eddy>>,
    /// u \[m/s\], point values at nodes (x, y, z, 0); valid between steps.
    pub(crate) velocity: Vec<[f64; 4]>,
    /// p/ρ \[m²/s²\]; valid between steps.
    pub(crate) pressure: Vec<f64>,
    /// F_ij \[m³/s\] of every pair, in the layout of the operators: solenoidal, F_ij = −F_ji.
    pub(crate) flux: Vec<f64>,
    /// F of the step before; within a step F at its middle, then F of the step.
    pub(crate) flux_other: Vec<f64>,
    /// Fluxes by element, where these are integrated.
    pub(crate) shares: Vec<f64>,
    /// max ½ Σ_j |F_ij|/V_i over all nodes \[1/s\]: the Courant number of a step of 1 s.
    pub(crate) flux_rate: f64,
    /// Spectral bound of ν L \[1/s\], see [`DiffusionChoice`].
    pub(crate) viscous_rate: f64,
    /// f \[N/m³\].
    pub(crate) body_force: Vec<[f64; 4]>,
    /// Uniform driving force −∇P \[Pa/m\] (x, y, z).
    pub(crate) driving: [f64; 3],
    /// What constrained nodes gave to the boundary in the last step, ρ⁻¹ × impulse \[m⁴/s\], by constraint; in the
    /// fourth place the pressure there, times Δt \[m²/s\].
    pub(crate) reaction: Vec<[f64; 4]>,
    /// Time \[s\], for what changes in time on the boundary.
    pub(crate) time: f64,
    /// Size of the last step \[s\]; zero before the first.
    pub(crate) last_dt: f64,
    /// Steps completed.
    pub(crate) steps: u64,
}

/// Cleaning cycles of the initial velocity and pressure. Without, time steps have to do it: a part of the inviscid
/// energy loss that does not depend on Δt.
pub(crate) const START_CYCLES: usize = 30;

/// What a step cost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepReport {
    /// How diffusion was advanced, and why.
    pub diffusion: DiffusionChoice,
    /// Conjugate-gradient iterations of the three viscous solves, zero where diffusion was explicit.
    pub momentum_iterations: [usize; 3],
    /// Conjugate-gradient iterations of the pressure solve; one where it is direct.
    pub poisson_iterations: usize,
    /// Norm of the predicted divergence before and after the solve \[m³/s\]; None after a direct solve, see
    /// [`crate::Projection::residual`].
    pub poisson_residual: Option<[f64; 2]>,
}

/// Part of a boundary's area that may face along the velocity of the frame.
const FACING: f64 = 1e-9;

/// The mesh must slide along its boundary. Collective.
fn check_frame(
    mesh: &LocalMesh,
    geometry: &DualGeometry,
    frame: [f64; 3],
) -> Result<(), FluidError> {
    let crosses = |share: &&BoundaryNode| {
        let through = (0..3).map(|c| share.area[c] * frame[c]).sum::<f64>();
        through.abs() > FACING * length(share.area) * length(frame)
    };
    let patches = geometry.boundary.iter().filter(crosses).map(|s| s.patch);
    let first = patches.fold(f64::INFINITY, |first, patch| first.min(f64::from(patch)));
    let first = mesh.halo.communicator().min(first);
    if first == f64::INFINITY {
        return Ok(());
    }
    Err(FluidError::FrameThroughBoundary {
        patch: mesh.patches[first as usize].clone(),
        frame,
    })
}

impl Fluid {
    /// Fluid at rest (but for boundaries), on the mesh and dual geometry of this rank. Collective.
    ///
    /// # Errors
    /// Settings out of range, conditions that do not fit the patches or do not balance.
    pub fn new(
        mesh: Arc<LocalMesh>,
        geometry: Arc<DualGeometry>,
        settings: FluidSettings,
    ) -> Result<Self, FluidError> {
        settings.check()?;
        check_frame(&mesh, &geometry, settings.frame)?;
        let boundary = Boundary::new(&mesh, &geometry, &settings.boundary)?;
        let operators = Operators::new(&mesh, &geometry, settings.kernels);
        let (total, entries) = (mesh.total(), operators.flux_length());
        let mut fluid = Self {
            correcting: false,
            creeping: match settings.inertia {
                Inertia::Full => None,
                Inertia::Steady | Inertia::Linear => Some(Creeping::new(
                    &mesh,
                    &operators,
                    &boundary,
                    settings.kinematic_viscosity(),
                    settings.preconditioner,
                )?),
            },
            momentum: Momentum::new(&mesh, &geometry, &boundary)?,
            poisson: Pressure::new(&mesh, &geometry, &operators, &boundary, &settings)?,
            mismatch: Mismatch::new(&mesh, &operators, &boundary),
            eddy: settings.turbulence.map(|model| {
                let walls = walls(&geometry, &settings);
                Box::new(Eddy::new(model, &mesh, walls))
            }),
            velocity: vec![[0.0; 4]; total],
            pressure: vec![0.0; total],
            flux: vec![0.0; entries],
            flux_other: vec![0.0; entries],
            shares: vec![0.0; operators.shares()],
            flux_rate: 0.0,
            viscous_rate: 0.0,
            body_force: vec![[0.0; 4]; total],
            driving: [0.0; 3],
            reaction: vec![[0.0; 4]; boundary.constraints.len()],
            time: 0.0,
            last_dt: 0.0,
            steps: 0,
            mesh,
            settings,
            operators,
            boundary,
        };
        fluid.viscous_rate = fluid.find_viscous_rate();
        fluid.set_velocity(|_| [0.0; 3])?;
        Ok(fluid)
    }

    /// Sets the velocity \[m/s\] as a function of position \[m\], puts boundary values in and projects; pressure and
    /// time start anew. Collective.
    ///
    /// # Errors
    /// When the projection fails, or the function gives a value that is not finite.
    pub fn set_velocity(
        &mut self,
        velocity: impl Fn([f64; 3]) -> [f64; 3],
    ) -> Result<(), FluidError> {
        for (u, &x) in self.velocity.iter_mut().zip(&self.mesh.nodes) {
            let [x, y, z] = velocity(x);
            *u = [x, y, z, 0.0];
        }
        self.restart_history()?;
        self.impose_boundary();
        self.check_finite()?;
        self.project(0.0)?;
        (0..START_CYCLES).for_each(|_| self.clean(0.0));
        self.project(0.0)?;
        self.flux_other.copy_from_slice(&self.flux);
        self.find_eddy_rate();
        self.check_finite()
    }

    /// Takes out what constraints forbid and puts the given velocities in.
    pub(crate) fn impose_boundary(&mut self) {
        for constraint in &self.boundary.constraints {
            let u = &mut self.velocity[constraint.node as usize];
            *u = constraint.admit(*u);
        }
        for &(i, [x, y, z]) in &self.boundary.given {
            self.velocity[i as usize] = [x, y, z, 0.0];
        }
    }

    /// Pressure and history as before the first step.
    fn restart_history(&mut self) -> Result<(), FluidError> {
        self.time = 0.0;
        self.drive(0.0);
        self.boundary.restart(&self.velocity)?;
        self.last_dt = 0.0;
        self.steps = 0;
        self.pressure.fill(0.0);
        self.reaction.fill([0.0; 4]);
        self.poisson.forget();
        Ok(())
    }

    /// The given driving force at a time \[s\]; that of a bulk velocity is found in the step.
    pub(crate) fn drive(&mut self, time: f64) {
        if let Forcing::PressureGradient(gradient) = self.settings.forcing {
            let factor = self.settings.forcing_factor.at(time);
            self.driving = gradient.map(|g| factor * g);
        }
    }

    /// One step of size `dt` \[s\]: predict, project; without convection one Stokes problem. Collective.
    ///
    /// # Errors
    /// A solve that does not converge; a value that is not finite, with its field, node and position.
    pub fn advance(&mut self, dt: f64) -> Result<StepReport, FluidError> {
        if self.creeping.is_some() {
            return self.creep(dt);
        }
        if self.poisson.choice.solves > 1 {
            return self.advance_projecting(dt);
        }
        let prediction = self.predict(dt)?;
        let solve = self.project(dt)?;
        self.check_finite()?;
        Ok(StepReport {
            diffusion: prediction.diffusion,
            momentum_iterations: prediction.iterations,
            poisson_iterations: solve.iterations,
            poisson_residual: solve.residual,
        })
    }

    /// Mesh of this rank.
    pub fn mesh(&self) -> &Arc<LocalMesh> {
        &self.mesh
    }

    /// Dual geometry of this rank.
    pub fn geometry(&self) -> &Arc<DualGeometry> {
        &self.operators.geometry
    }

    /// What the fluid was made with.
    pub fn settings(&self) -> &FluidSettings {
        &self.settings
    }

    /// How the pressure equation is solved, and why.
    pub fn pressure_choice(&self) -> &PressureChoice {
        &self.poisson.choice
    }

    /// Velocity \[m/s\] at owned and halo nodes, (x, y, z, 0).
    pub fn velocity(&self) -> &[[f64; 4]] {
        &self.velocity
    }

    /// Kinematic pressure p/ρ \[m²/s²\] by node, of the last step at owned nodes only; times [`FluidSettings::density`] it is in Pa.
    /// It belongs to the middle of the last step. Without outlets its mean over the nodes is zero.
    pub fn pressure(&self) -> &[f64] {
        &self.pressure
    }

    /// [`Fluid::pressure`] at owned and halo nodes. Collective.
    pub fn pressure_everywhere(&self) -> Vec<f64> {
        let mut pressure = self.pressure.clone();
        self.mesh.halo.update(&mut pressure);
        pressure
    }

    /// Flux F_ij \[m³/s\] of every pair entry of [`DualGeometry`].
    pub fn flux(&self) -> Vec<f64> {
        self.operators.to_entries(&self.flux)
    }

    /// True where kernels run along lines of a tensor-product mesh instead of over rows of pairs.
    pub fn runs_on_lines(&self) -> bool {
        self.operators.on_lines()
    }

    /// Body force \[N/m³\] by node; the owned part acts in the next steps until it is changed.
    pub fn body_force(&self) -> &[[f64; 4]] {
        &self.body_force
    }

    /// See [`Fluid::body_force`]; total length, so that a caller can spread into halo entries and accumulate.
    pub fn body_force_mut(&mut self) -> &mut [[f64; 4]] {
        &mut self.body_force
    }

    /// Uniform driving force −∇P \[Pa/m\] of the last step: given, or found by the bulk-velocity controller.
    pub fn driving_force(&self) -> [f64; 3] {
        self.driving
    }

    /// Time since the velocity was set \[s\], over restarts.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Steps completed since the velocity was set, over restarts.
    pub fn steps(&self) -> u64 {
        self.steps
    }
}
