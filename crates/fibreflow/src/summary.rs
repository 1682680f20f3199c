//! `summary.json`: final figures, costs, errors against exact answers.

use crate::case::Case;
use crate::clock::Clock;
use crate::error::ProgramError;
use crate::figures::{Timings, Totals};
use crate::observe::{LoadSummary, Stop, loads};
use crate::output::replace_file;
use crate::scene::{Scene, errors};
use fibreflow_parallel::Communicator;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Final figures of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Title of the case.
    pub title: String,
    /// Why it ended: `end`, `signal` or `wall time`.
    pub stopped_by: &'static str,
    /// Steps from the start, over restarts.
    pub steps: u64,
    /// Simulated time \[s\].
    pub simulated_time: f64,
    /// Wall time of this run \[s\].
    pub wall_seconds: f64,
    /// Ranks.
    pub ranks: usize,
    /// Threads of each rank.
    pub threads: usize,
    /// The fluid.
    pub fluid: FluidSummary,
    /// The fibres.
    pub fibres: FibreSummary,
    /// The coupling.
    pub coupling: CouplingSummary,
    /// Wall time by stage \[s\], the slowest rank of each.
    pub timings: Timings,
    /// Relative errors against the exact answer, where the case has one.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub errors: BTreeMap<String, f64>,
}

/// Figures of the fluid; zeros and nulls without one.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FluidSummary {
    /// Nodes on all ranks.
    pub nodes: usize,
    /// Elements on all ranks.
    pub elements: usize,
    /// Wall time of the fluid by nodes and steps \[s\].
    pub seconds_per_node_step: Option<f64>,
    /// How the pressure equation was solved, and why.
    pub pressure_solver: Option<String>,
    /// Iterations of the pressure solve, mean over the steps; one where it is direct.
    pub poisson_iterations_mean: Option<f64>,
    /// Wall time of the order parameter by nodes and steps \[s\]; null without one.
    pub phase_seconds_per_node_step: Option<f64>,
    /// Iterations of its nonlinear system, two solves each, mean over the steps.
    pub phase_iterations_mean: Option<f64>,
    /// Largest divergence of any step \[1/s\].
    pub divergence_max: Option<f64>,
    /// At the end \[J\].
    pub kinetic_energy: Option<f64>,
    /// Volume mean at the end \[m/s\].
    pub bulk_velocity: Option<[f64; 3]>,
    /// Uniform driving force at the end \[N/m³\].
    pub driving_force: Option<[f64; 3]>,
    /// Forces on patches at the end, where the case asks for them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loads: Option<LoadSummary>,
}

/// Figures of the fibres; zeros and nulls without any.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FibreSummary {
    /// Fibres on all ranks.
    pub count: usize,
    /// Segments on all ranks.
    pub segments: usize,
    /// Wall time of the fibres by segments and steps of the fluid \[s\].
    pub seconds_per_segment_step: Option<f64>,
    /// Wall time of the fibres by segments and sub-steps \[s\].
    pub seconds_per_segment_substep: Option<f64>,
    /// Sub-steps in a step, mean over the steps of the largest of any fibre.
    pub substeps_mean: Option<f64>,
    /// Sub-steps in which limits of kinetic friction were taken as they were, before they agreed with the repulsions; null without linked fibres.
    pub unsettled_substeps: Option<usize>,
}

/// Figures of the coupling.
#[derive(Clone, Debug, Default, Serialize)]
pub struct CouplingSummary {
    /// Largest relative defect of force and torque of any step; null one-way.
    pub momentum_defect_relative: Option<f64>,
    /// Longest step that explicit drag would bear at the end \[s\], Kunhappan 3.72; drag is implicit and not bound by it.
    pub explicit_drag_step: Option<f64>,
    /// Largest Δt β Σ w²/(ρV) of the last step: resistance by the inertia of the nodes that share it; null where forces
    /// are solved with the flow.
    pub loading: Option<f64>,
    /// Wall time of sampling and spreading by segments and steps \[s\], without the disturbance.
    pub seconds_per_segment_step: Option<f64>,
    /// The same by that of the fluid.
    pub share_of_fluid: Option<f64>,
    /// Solves of the flow with other forces, mean over the steps; null in the staggered scheme.
    pub rounds_mean: Option<f64>,
    /// The most of any step.
    pub rounds_max: Option<usize>,
    /// Steps whose forces were found to a hundredth only, as contacts came and went between rounds.
    pub loose_steps: Option<u64>,
    /// Largest change of the forces in the last round of a step, relative.
    pub left_max: Option<f64>,
    /// Largest factor by which lagged forces would have grown in a step.
    pub gain_max: Option<f64>,
}

/// The summary, the same on every rank. Collective.
pub fn of(
    scene: &Scene,
    case: &Case,
    clock: &Clock,
    totals: &Totals,
    stop: Stop,
    folder: &Path,
    wall_seconds: f64,
) -> Summary {
    let communicator = &scene.communicator;
    let slowest = |seconds: f64| communicator.max(seconds);
    let t = &totals.timings;
    let correcting = scene.flow.correcting();
    let inside = if scene.flow.iterates() {
        0.0
    } else {
        correcting
    };
    let timings = Timings {
        sample: slowest(t.sample - inside),
        disturbance: slowest(correcting),
        fibres: slowest(t.fibres),
        spread: slowest(t.spread),
        phase: slowest(t.phase),
        fluid: slowest(t.fluid),
        output: slowest(t.output),
    };
    let steps = totals.steps as f64;
    let each = |seconds: f64, things: usize, times: f64| {
        (things > 0 && times > 0.0).then(|| seconds / (things as f64 * times))
    };
    let mean = |sum: usize| (steps > 0.0).then(|| sum as f64 / steps);
    let fluid = scene.flow.fluid().map(|fluid| FluidSummary {
        nodes: fluid.mesh().total_nodes,
        elements: fluid.mesh().total_elements,
        seconds_per_node_step: each(timings.fluid, fluid.mesh().total_nodes, steps),
        pressure_solver: Some(fluid.pressure_choice().to_string()),
        poisson_iterations_mean: mean(totals.poisson_iterations),
        phase_seconds_per_node_step: each(timings.phase, fluid.mesh().total_nodes, steps)
            .filter(|_| scene.flow.phase().is_some()),
        phase_iterations_mean: mean(totals.phase_iterations)
            .filter(|_| scene.flow.phase().is_some()),
        divergence_max: (steps > 0.0).then_some(totals.divergence_max),
        kinetic_energy: Some(fluid.kinetic_energy()),
        bulk_velocity: Some(fluid.bulk_velocity()),
        driving_force: Some(fluid.driving_force()),
        // Forces belong to a step.
        loads: (steps > 0.0).then(|| loads(scene, case)).flatten(),
    });
    let fibres = scene.fibres.as_ref().map(|fibres| {
        let segments = communicator.sum_count(fibres.segments());
        FibreSummary {
            count: communicator.sum_count(fibres.fibres()),
            segments,
            seconds_per_segment_step: each(timings.fibres, segments, steps),
            seconds_per_segment_substep: each(timings.fibres, totals.segment_substeps, 1.0),
            substeps_mean: mean(totals.substeps),
            unsettled_substeps: None,
        }
    });
    let linked = scene.linked.as_ref().map(|linked| FibreSummary {
        count: linked.fibres(),
        segments: linked.segments(),
        seconds_per_segment_step: each(timings.fibres, linked.segments(), steps),
        seconds_per_segment_substep: each(timings.fibres, totals.segment_substeps, 1.0),
        substeps_mean: mean(totals.substeps),
        unsettled_substeps: Some(totals.unsettled),
    });
    let fibres = fibres.or(linked);
    let transfer = timings.sample + timings.spread;
    let segments = fibres.as_ref().map_or(0, |fibres| fibres.segments);
    let spread = steps > 0.0 && scene.two_way();
    let iterated = spread && scene.flow.iterates();
    Summary {
        title: case.about.title.clone(),
        stopped_by: match stop {
            Stop::GoOn => "end",
            Stop::Signal => "signal",
            Stop::WallTime => "wall time",
        },
        steps: clock.step,
        simulated_time: clock.time,
        wall_seconds,
        ranks: communicator.size(),
        threads: rayon::current_num_threads(),
        fluid: fluid.unwrap_or_default(),
        fibres: fibres.unwrap_or_default(),
        coupling: CouplingSummary {
            momentum_defect_relative: spread.then_some(totals.momentum_defect),
            explicit_drag_step: Some(totals.coupling[0])
                .filter(|step| *step > 0.0 && step.is_finite()),
            loading: (spread && !iterated).then_some(totals.coupling[1]),
            seconds_per_segment_step: each(transfer, segments, steps)
                .filter(|_| scene.flow.fluid().is_some()),
            share_of_fluid: (timings.fluid > 0.0).then(|| transfer / timings.fluid),
            rounds_mean: mean(totals.rounds[0]).filter(|_| iterated),
            rounds_max: iterated.then_some(totals.rounds[1]),
            loose_steps: iterated.then_some(totals.loose),
            left_max: iterated.then_some(totals.left),
            gain_max: iterated.then_some(totals.gain),
        },
        timings,
        errors: errors(scene, case, clock, folder),
    }
}

/// Writes it on rank 0.
///
/// # Errors
/// A file that cannot be written.
pub fn write(
    summary: &Summary,
    folder: &Path,
    communicator: &Communicator,
) -> Result<(), ProgramError> {
    if !communicator.is_root() {
        return Ok(());
    }
    let path = folder.join("summary.json");
    let text = serde_json::to_string_pretty(summary)
        .map_err(|e| ProgramError::failed(format!("the summary cannot be written: {e}")))?;
    replace_file(&path, (text + "\n").as_bytes()).map_err(|e| ProgramError::output(&path, &e))
}

/// The last lines of a run.
pub fn closing(summary: &Summary, stop: Stop) -> String {
    let (steps, time, wall) = (summary.steps, summary.simulated_time, summary.wall_seconds);
    let mut lines = vec![match stop {
        Stop::GoOn => format!("done: step {steps}, time {time:.6e} s, wall time {wall:.1} s"),
        Stop::Signal => format!("stopped by a signal at step {steps}; `--resume` goes on"),
        Stop::WallTime => {
            format!("stopped at the wall-time limit, step {steps}; `--resume` goes on")
        }
    }];
    let t = &summary.timings;
    lines.push(format!(
        "wall time by stage [s]: fluid {:.2}, fibres {:.2}, sample {:.2}, disturbance {:.2}, spread {:.2}, output {:.2}",
        t.fluid, t.fibres, t.sample, t.disturbance, t.spread, t.output
    ));
    if let Some(cost) = summary.fluid.seconds_per_node_step {
        let iterations = summary.fluid.poisson_iterations_mean.unwrap_or(0.0);
        lines.push(format!(
            "fluid: {:.1} ns a node and step, {iterations:.1} Poisson iterations a step",
            cost * 1e9
        ));
    }
    if let (Some(cost), Some(iterations)) = (
        summary.fluid.phase_seconds_per_node_step,
        summary.fluid.phase_iterations_mean,
    ) {
        lines.push(format!(
            "order parameter: {:.1} ns a node and step, {iterations:.1} iterations a step",
            cost * 1e9
        ));
    }
    if let Some(cost) = summary.fibres.seconds_per_segment_substep {
        let substeps = summary.fibres.substeps_mean.unwrap_or(0.0);
        lines.push(format!(
            "fibres: {:.1} ns a segment and sub-step, {substeps:.1} sub-steps a step",
            cost * 1e9
        ));
    }
    if let Some(count @ 1..) = summary.fibres.unsettled_substeps {
        lines.push(format!(
            "fibres: in {count} sub-steps the limits of friction were taken as they were, before they agreed with the repulsions"
        ));
    }
    let coupling = &summary.coupling;
    if let (Some(cost), Some(share)) = (coupling.seconds_per_segment_step, coupling.share_of_fluid)
    {
        lines.push(format!(
            "coupling: {:.1} ns a segment and step to sample and spread, {:.0} % of the fluid",
            cost * 1e9,
            share * 100.0
        ));
    }
    if let (Some(mean), Some(most), Some(gain)) =
        (coupling.rounds_mean, coupling.rounds_max, coupling.gain_max)
    {
        lines.push(format!(
            "coupling: {mean:.1} rounds a step, {most} at most; lagged forces would grow by {gain:.2} in a step"
        ));
        if let (Some(steps @ 1..), Some(left)) = (coupling.loose_steps, coupling.left_max) {
            lines.push(format!(
                "coupling: in {steps} steps contacts that came and went left forces changing by up to {left:.1e} in the last round"
            ));
        }
    }
    if let Some(loading) = coupling.loading {
        lines.push(format!(
            "coupling: Δt β/(ρV) up to {loading:.2e} in the last step"
        ));
    }
    if let Some(step) = coupling.explicit_drag_step {
        lines.push(format!(
            "coupling: explicit drag would need steps below {step:.2e} s (K 3.72)"
        ));
    }
    for (name, value) in &summary.errors {
        lines.push(format!(
            "error against the exact answer: {name} = {value:.3e}"
        ));
    }
    lines.join("\n")
}
