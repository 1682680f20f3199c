//! Second half of a step: solenoidal fluxes by one compact Poisson equation for the pressure increment.
//!
//! F* = ½(u_i* + u_j*)·S_ij,  Σ_j w_ij (ψ_j − ψ_i) = Σ_j F*_ij + F_b,  ψ = Δt (p^(n+½) − p^(n−½)),
//! F = F* − w (ψ_j − ψ_i),  u = u* − P G ψ.

use crate::boundary::{Boundary, Through};
use crate::predict::SubStep;
use crate::{Fluid, FluidError, PressurePreconditioner, rows};
use fibreflow_mesh::{DualGeometry, LocalMesh};
use fibreflow_parallel::block_sums;
use fibreflow_solve::{
    Amg, AmgSettings, CgSettings, ConjugateGradients, Jacobi, NullSpace, PairMatrix,
    Preconditioner, SolveError, SolveReport,
};

/// What the pressure equation needs besides the flow.
pub(crate) struct Pressure {
    matrix: PairMatrix,
    preconditioner: Box<dyn Preconditioner<f64> + Send + Sync>,
    krylov: ConjugateGradients<f64>,
    null_space: NullSpace,
    /// Total: ψ \[m²/s\].
    psi: Vec<f64>,
    /// Owned: minus the divergence of F* \[m³/s\].
    rhs: Vec<f64>,
    /// Owned: (Σ F*, Σ |F*|), then V G ψ in the second half.
    sums: Vec<[f64; 2]>,
    gradient: Vec<[f64; 4]>,
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
            matrix,
            krylov: ConjugateGradients::new(),
            null_space,
            psi: vec![0.0; mesh.total()],
            rhs: owned.clone(),
            sums: vec![[0.0; 2]; mesh.owned()],
            gradient: vec![[0.0; 4]; mesh.owned()],
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
        let settings = self.predicted_divergence();
        self.poisson.guess(dt);
        let solve = self.poisson.solve(&settings);
        let report = solve.map_err(|source| self.solve_failed("pressure", source))?;
        self.correct();
        if dt > 0.0 {
            self.poisson.remember(dt);
            let (inverse, psi) = (1.0 / dt, &self.poisson.psi);
            rows::each(&mut self.pressure, |i, p| *p += inverse * psi[i]);
            self.last_dt = dt;
            self.steps += 1;
        }
        self.mesh.halo.update(&mut self.velocity);
        Ok(report)
    }

    /// F* into `flux`, −(Σ F* + F_b) into the right-hand side; the tolerance that goes with it.
    fn predicted_divergence(&mut self) -> CgSettings {
        let Pressure { sums, .. } = &mut self.poisson;
        self.operators
            .interpolate_flux(&mut self.velocity, &mut self.flux, sums);
        self.right_hand_side(1.0)
    }

    /// `given` scales the boundary fluxes that are given: they do not change in time.
    fn right_hand_side(&mut self, given: f64) -> CgSettings {
        let Pressure { sums, rhs, .. } = &mut self.poisson;
        rows::each(rhs, |i, rhs| *rhs = -sums[i][0]);
        for &(i, through) in &self.boundary.through {
            match through {
                Through::Given(flux) => rhs[i as usize] -= given * flux,
                Through::Open => rhs[i as usize] = 0.0,
            }
        }
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

    /// F = F* − w (ψ_j − ψ_i), u = u* − P G ψ; the rest of G ψ acts on the boundary.
    fn correct(&mut self) {
        let Pressure { psi, gradient, .. } = &mut self.poisson;
        self.operators.correct(psi, &mut self.flux, gradient);
        self.subtract_gradient();
    }

    /// u −= P G ψ from V G ψ.
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

    /// The pressure that keeps the initial fluxes solenoidal; without it the first step would be of first order.
    /// Convecting flux as extrapolated for the step.
    pub(crate) fn start_pressure(&mut self) -> Result<(), FluidError> {
        self.pressure.fill(0.0);
        for &(i, pressure) in &self.boundary.outlets {
            self.pressure[i as usize] = pressure / self.settings.density;
        }
        self.acceleration();
        self.poisson.psi.fill(0.0);
        let settings = self.settings.pressure;
        let solve = self.poisson.solve(&settings);
        solve.map_err(|source| self.solve_failed("pressure", source))?;
        let psi = &self.poisson.psi;
        rows::each(&mut self.pressure, |i, p| *p += psi[i]);
        Ok(())
    }

    /// Minus the divergence of the acceleration into the right-hand side.
    fn acceleration(&mut self) {
        self.gather_sources();
        self.explicit(&SubStep::RATE, 1.0);
        let (rhs, volumes) = (&self.momentum.rhs, self.operators.volumes());
        let rate = &mut self.momentum.increment;
        rows::each(&mut rate[..rhs.len()], |i, rate| {
            *rate = rhs[i].map(|r| r / volumes[i]);
        });
        // `flux_previous` equals `flux` before the first step: it serves as scratch.
        let sums = &mut self.poisson.sums;
        self.operators
            .interpolate_flux(rate, &mut self.flux_previous, sums);
        self.flux_previous.copy_from_slice(&self.flux);
        self.right_hand_side(0.0);
    }
}
