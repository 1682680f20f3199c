//! What is on and what is off in a run, with the number that decided it.

use crate::case::{Case, CouplingMode};
use crate::output::log::Log;
use crate::scene::Scene;

/// A few lines for the log.
pub fn describe(scene: &Scene, case: &Case, log: &mut Log) {
    if let (Some(fluid), Some(solver)) = (&case.fluid, scene.flow.fluid()) {
        let mesh = solver.mesh();
        let form = match (fluid.order, solver.geometry().orthogonal) {
            (4, _) => "fourth-order",
            (_, true) => "two-point",
            (_, false) => "Galerkin",
        };
        log.line(&format!(
            "fluid: {} nodes, {} elements, {form} weights, ν = {:.4e} m²/s",
            mesh.total_nodes,
            mesh.total_elements,
            fluid.viscosity / fluid.density
        ));
        if let Some(inertia) = scene.flow.inertia() {
            log.line(&format!("  {inertia}"));
        }
        if scene.flow.convects() {
            log.line(&format!("  {}", solver.pressure_choice()));
        }
    }
    if case.ambient.is_some() {
        log.line("flow: prescribed, nothing is solved for");
    }
    if scene.fibre_count == 0 {
        log.line("fibres: none, no sampling");
        return;
    }
    let contact = match &case.contact {
        Some(c) if c.friction > 0.0 => "contacts with friction",
        Some(_) => "contacts without friction",
        None => "no contacts (no `[contact]`)",
    };
    let coupling = match (case.coupling.mode, case.ambient.is_some()) {
        (_, true) => "one-way (prescribed flow)",
        (CouplingMode::OneWay, _) => "one-way",
        (CouplingMode::TwoWay, _) => "two-way",
    };
    log.line(&format!(
        "fibres: {}, {contact}, coupling {coupling}",
        scene.fibre_count
    ));
    for (k, group) in case.fibres.iter().enumerate() {
        let area = std::f64::consts::PI * group.diameter * group.diameter / 4.0;
        let stiffness = group.youngs_modulus * area * group.diameter * group.diameter / 16.0;
        log.line(&format!(
            "  group {k}: EI = {stiffness:.3e} N·m², E = {:.3e} Pa",
            group.youngs_modulus
        ));
    }
}
