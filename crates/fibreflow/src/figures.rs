//! Numbers of a step, and their sums over a run.

use crate::scene::{Rounds, Scene, Together};
use fibreflow_coupling::SpreadReport;
use fibreflow_fibre::Ambient;
use fibreflow_fluid::{DiffusionChoice, Fluid, PhaseReport, StepReport};
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
    /// Sub-steps of linked fibres in which limits of friction were taken as they were.
    pub unsettled: usize,
    /// Relative defect of force and torque in spreading.
    pub momentum_defect: f64,
    /// Hydrodynamic points outside the domain, held at its boundary.
    pub outside: usize,
    /// How forces and flow were found together; None in the staggered scheme.
    pub rounds: Option<Rounds>,
    /// What the order parameter did.
    pub phase: PhaseReport,
}

/// Wall time of the stages of the loop on this rank \[s\].
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Timings {
    /// Velocity and gradient at the fibres.
    pub sample: f64,
    /// What the fibres do to the flow themselves.
    pub disturbance: f64,
    /// Motion of the fibres.
    pub fibres: f64,
    /// Forces on the fluid.
    pub spread: f64,
    /// The order parameter of two fluids.
    pub phase: f64,
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
    /// Iterations of all steps of the order parameter.
    pub phase_iterations: usize,
    /// Largest divergence of any step \[1/s\].
    pub divergence_max: f64,
    /// Largest defect of any step.
    pub momentum_defect: f64,
    /// Sub-steps, largest of any fibre in each step.
    pub substeps: usize,
    /// Sum over all steps and segments of the sub-steps.
    pub segment_substeps: usize,
    /// Sub-steps of linked fibres in which limits of friction were taken as they were.
    pub unsettled: usize,
    /// Rounds of all steps in which forces and flow were found together, and the most of any.
    pub rounds: [usize; 2],
    /// Steps whose forces were found loosely.
    pub loose: u64,
    /// Largest change in a last round, relative.
    pub left: f64,
    /// Largest gain that lagged forces would have had.
    pub gain: f64,
    /// Longest step for explicit drag in the last step \[s\] (K 3.72), and the largest Δt β Σ w²/(ρV) in it.
    pub coupling: [f64; 2],
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
        if let Some(linked) = &scene.linked {
            self.substeps = linked.sub_steps();
            self.segment_substeps = self.substeps * linked.segments();
            self.unsettled = linked.unsettled();
        }
    }

    /// Takes over what the fluid reports, if there is one.
    pub fn fluid(&mut self, report: Option<StepReport>, convects: bool) {
        if let Some(report) = report {
            self.diffusion = convects.then_some(report.diffusion);
            self.poisson_iterations = report.poisson_iterations;
            self.momentum_iterations = report.momentum_iterations.iter().sum();
        }
    }

    /// Takes over what the order parameter reports, if there is one.
    pub fn phase(&mut self, report: Option<PhaseReport>) {
        self.phase = report.unwrap_or_default();
    }

    /// Takes over what the coupling reports, if it acts on the fluid.
    pub fn spread(&mut self, report: Option<SpreadReport>) {
        if let Some(report) = report {
            self.momentum_defect = report.defect_relative;
            self.outside = report.outside;
        }
    }

    /// Takes over a step of fluid and fibres together.
    pub fn together(&mut self, step: Option<Together>) {
        if let Some(step) = step {
            self.spread(Some(step.spread));
            self.fluid(Some(step.fluid), false);
            self.rounds = Some(step.rounds);
        }
    }
}

impl Totals {
    /// Adds a step.
    pub fn add(&mut self, figures: &Figures) {
        self.steps += 1;
        self.poisson_iterations += figures.poisson_iterations;
        self.phase_iterations += figures.phase.iterations;
        self.divergence_max = self.divergence_max.max(figures.divergence);
        self.momentum_defect = self.momentum_defect.max(figures.momentum_defect);
        self.substeps += figures.substeps;
        self.segment_substeps += figures.segment_substeps;
        self.unsettled += figures.unsettled;
        if let Some(rounds) = figures.rounds {
            self.rounds = [
                self.rounds[0] + rounds.rounds,
                self.rounds[1].max(rounds.rounds),
            ];
            self.gain = self.gain.max(rounds.gain);
            self.loose += u64::from(rounds.loose);
            self.left = self.left.max(rounds.left);
        }
    }

    /// Numbers of the last step alone. Collective.
    pub fn close(&mut self, scene: &Scene, ambient: &Ambient) {
        if let Some(fibres) = &scene.fibres {
            let [time, loading] = fibres.coupling_numbers(ambient);
            let communicator = &scene.communicator;
            self.coupling = [communicator.min(time), communicator.max(loading)];
        }
    }
}
