//! What a run will need, for `fibreflow check`: wall units, step, time, memory.

use crate::case::{Boundary, Case, Forcing};
use crate::error::{ProgramError, agree};
use crate::scene::Scene;
use fibreflow_fluid::Fluid;
use fibreflow_mesh::QualityReport;
use std::time::Instant;

/// Steps that are timed, after one that is not.
const TRIAL: u32 = 2;
/// Reynolds number of the hydraulic diameter below which a flow is taken as laminar.
const LAMINAR: f64 = 2300.0;

/// Heights of first cells, and after some trial steps what the run will cost. The flow is no longer at its start. Collective.
///
/// # Errors
/// A trial step that fails.
pub fn forecast(
    scene: &mut Scene,
    case: &Case,
    report: &QualityReport,
) -> Result<Vec<String>, ProgramError> {
    let mut lines = Vec::new();
    let Some(fluid) = scene.flow.fluid() else {
        return Ok(lines);
    };
    lines.extend(wall_units(fluid, case, report));
    let dt = scene.flow.suggest_step(&case.time).min(case.time.end);
    let courant = fluid.courant_number(dt);
    let nodes = fluid.mesh().total_nodes as f64;
    let communicator = scene.communicator.clone();
    let mut start = Instant::now();
    for step in 0..=TRIAL {
        if step == 1 {
            start = Instant::now();
        }
        let advanced = scene.flow.advance(dt, false);
        agree(&communicator, advanced)?;
    }
    let seconds = communicator.max(start.elapsed().as_secs_f64()) / f64::from(TRIAL);
    let steps = (case.time.end / dt).ceil();
    lines.push(format!(
        "step: Δt = {dt:.3e} s, Courant number {courant:.2} at the start; {steps:.0} steps to {} s",
        case.time.end
    ));
    let fibres = if scene.fibres.is_some() {
        "fibres and output"
    } else {
        "output"
    };
    lines.push(format!(
        "time: {:.3} s a step, {:.3} µs per node·step (mean of {TRIAL} trial steps); {} in all without {fibres}",
        seconds,
        1e6 * seconds / nodes,
        duration(seconds * steps)
    ));
    let ranks = communicator.size();
    if let Some(bytes) = peak_memory() {
        let mut sum = [bytes];
        communicator.sum_slice(&mut sum);
        lines.push(format!(
            "memory: {:.0} MB in use at most so far, {:.2} kB a node, on {ranks} rank{}",
            sum[0] / 1e6,
            sum[0] / 1e3 / nodes,
            if ranks == 1 { "" } else { "s" }
        ));
    }
    Ok(lines)
}

/// Friction velocity by what drives the flow, and first cells in its units.
fn wall_units(fluid: &Fluid, case: &Case, report: &QualityReport) -> Vec<String> {
    let Some(about) = &case.fluid else {
        return Vec::new();
    };
    let is_wall = |name: &str| {
        matches!(
            about.boundaries.get(name),
            Some(Boundary::Wall {} | Boundary::MovingWall { .. } | Boundary::RotatingWall { .. })
        )
    };
    let walls: Vec<_> = (report.patches.iter())
        .filter(|patch| is_wall(&patch.name))
        .collect();
    let area: f64 = walls.iter().map(|patch| patch.area).sum();
    let length = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
    let bulk = length(fluid.bulk_velocity());
    let (stress, reason) = match about.forcing {
        Forcing::PressureGradient { value, .. } => (
            length(value) * report.volume / area,
            "the pressure gradient",
        ),
        Forcing::BulkVelocity { value, .. } => friction(
            value.abs(),
            about.density,
            about.viscosity,
            report.volume,
            area,
        ),
        Forcing::None | Forcing::Linear { .. } => {
            friction(bulk, about.density, about.viscosity, report.volume, area)
        }
    };
    if walls.is_empty() || !stress.is_finite() || stress <= 0.0 {
        return Vec::new();
    }
    let velocity = (stress / about.density).sqrt();
    let unit = about.viscosity / about.density / velocity;
    let first = |height: f64| format!("{:.3}", height / unit);
    let heights = walls
        .iter()
        .map(|p| format!("`{}` {}", p.name, first(p.first_cell)));
    vec![format!(
        "wall units by {reason}: u_τ = {velocity:.3e} m/s, ν/u_τ = {unit:.3e} m; first cell y⁺ = {}",
        heights.collect::<Vec<_>>().join(", ")
    )]
}

/// Wall stress of a mean velocity over the hydraulic diameter 4V/A \[Pa\]: 8μU/D in laminar flow, else Blasius (1913).
fn friction(
    speed: f64,
    density: f64,
    viscosity: f64,
    volume: f64,
    area: f64,
) -> (f64, &'static str) {
    let diameter = 4.0 * volume / area;
    let reynolds = density * speed * diameter / viscosity;
    if reynolds < LAMINAR {
        (
            8.0 * viscosity * speed / diameter,
            "the mean velocity (laminar)",
        )
    } else {
        let factor = 0.3164 * reynolds.powf(-0.25);
        (
            factor / 8.0 * density * speed * speed,
            "the mean velocity (Blasius)",
        )
    }
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{s:.1} s"),
        s if s < 7200.0 => format!("{:.1} minutes", s / 60.0),
        s => format!("{:.1} hours", s / 3600.0),
    }
}

/// Largest resident memory of this process \[bytes\], where the system says it.
fn peak_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kilobytes: f64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some(1024.0 * kilobytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_is_that_of_pipes() {
        // Radius 1, length 1: V/A = ½, D = 2.
        let (volume, area) = (std::f64::consts::PI, std::f64::consts::TAU);
        let (laminar, _) = friction(1.0, 1.0, 0.01, volume, area);
        assert!((laminar - 0.04).abs() < 1e-12, "4μU/R");
        let (turbulent, _) = friction(1.0, 1.0, 2.0 / 5300.0, volume, area);
        let velocity = turbulent.sqrt();
        // El Khoury et al. (2013): 0.0683.
        assert!((velocity / 0.0683 - 1.0).abs() < 0.02, "{velocity}");
    }

    #[test]
    fn durations_are_readable() {
        assert_eq!(duration(3.21), "3.2 s");
        assert_eq!(duration(600.0), "10.0 minutes");
        assert_eq!(duration(36000.0), "10.0 hours");
    }
}
