//! Numbers of a step, and their sums over a run.

use crate::scene::Scene;
use fibreflow_coupling::SpreadReport;
use fibreflow_fluid::{DiffusionChoice, Fluid, StepReport};
use serde::Serialize;
use std::time::Instant;

/// Numbers of one step, the same on every rank.
#[derive(Clone, Copy, Debug, Default)]
pub struct Figures {
    /// A fluid is solved for.
    pub has_fluid: bool,
    /// Courant number of the step.
    pub cfl: f64,
    /// Largest divergence \[1/s\].
    pub divergence: f64,
    /// How diffusion was advanced; None without convection, where all is implicit.
    pub diffusion: Option<DiffusionChoice>,
    /// Iterations of the pressure solve.
    pub poisson_iterations: usize,
    /// Iterations of the viscous solves.
    pub momentum_iterations: usize,
    /// Fibres on all ranks.
    pub fibres: usize,
    /// Sub-steps, largest of any fibre.
    pub substeps: usize,
    /// Sum over all segments of their sub-steps.
    pub segment_substeps: usize,
    /// Relative defect of force and torque in spreading.
    pub momentum_defect: f64,
    /// Hydrodynamic points outside the domain, held at its boundary.
    pub outside: usize,
}

/// Wall time of the stages of the loop on this rank \[s\].
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Timings {
    /// Velocity and gradient at the fibres.
    pub sample: f64,
    /// Motion of the fibres.
    pub fibres: f64,
    /// Forces on the fluid.
    pub spread: f64,
    /// The fluid.
    pub fluid: f64,
    /// Observers.
    pub output: f64,
}

/// Result of a stage and its wall time, added to `total` \[s\].
pub fn timed<T>(total: &mut f64, stage: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = stage();
    *total += start.elapsed().as_secs_f64();
    result
}

/// Sums and extremes over the steps of a run.
#[derive(Clone, Copy, Debug, Default)]
pub struct Totals {
    /// Steps of this run, without those before a resume.
    pub steps: u64,
    /// Iterations of all pressure solves.
    pub poisson_iterations: usize,
    /// Largest divergence of any step \[1/s\].
    pub divergence_max: f64,
    /// Largest defect of any step.
    pub momentum_defect: f64,
    /// Sub-steps, largest of any fibre in each step.
    pub substeps: usize,
    /// Sum over all steps and segments of the sub-steps.
    pub segment_substeps: usize,
    /// Wall time by stage.
    pub timings: Timings,
}

impl Figures {
    /// Before a step of length `dt` \[s\]. Collective.
    pub fn before(scene: &Scene, dt: f64) -> Self {
        let fluid = scene.flow.fluid();
        Self {
            has_fluid: fluid.is_some(),
            cfl: fluid.map_or(0.0, |f| f.courant_number(dt)),
            fibres: scene.fibre_count,
            ..Self::default()
        }
    }

    /// After a step. Collective.
    pub fn after(&mut self, scene: &Scene) {
        self.divergence = scene.flow.fluid().map_or(0.0, Fluid::divergence_max);
        if let Some(fibres) = &scene.fibres {
            let communicator = &scene.communicator;
            self.substeps = communicator.max(fibres.substeps() as f64) as usize;
            self.segment_substeps = communicator.sum_count(fibres.segment_substeps());
        }
    }

    /// Takes over what the fluid reports.
    pub fn fluid(&mut self, report: &StepReport, convects: bool) {
        self.diffusion = convects.then_some(report.diffusion);
        self.poisson_iterations = report.poisson_iterations;
        self.momentum_iterations = report.momentum_iterations.iter().sum();
    }

    /// Takes over what the coupling reports.
    pub fn spread(&mut self, report: &SpreadReport) {
        self.momentum_defect = report.defect_relative;
        self.outside = report.outside;
    }
}

impl Totals {
    /// Adds a step.
    pub fn add(&mut self, figures: &Figures) {
        self.steps += 1;
        self.poisson_iterations += figures.poisson_iterations;
        self.divergence_max = self.divergence_max.max(figures.divergence);
        self.momentum_defect = self.momentum_defect.max(figures.momentum_defect);
        self.substeps += figures.substeps;
        self.segment_substeps += figures.segment_substeps;
    }
}
