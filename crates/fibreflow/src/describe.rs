//! What is on and what is off in a run, with the number that decided it.

use crate::case::{Case, CouplingMode};
use crate::scene::Scene;

/// A few lines, for a check and for the log of a run.
pub fn describe(scene: &Scene, case: &Case) -> Vec<String> {
    let mut lines = Vec::new();
    if let (Some(fluid), Some(solver)) = (&case.fluid, scene.flow.fluid()) {
        let mesh = solver.mesh();
        let form = match (fluid.order, solver.geometry().orthogonal) {
            (4, _) => "fourth-order",
            (_, true) => "two-point",
            (_, false) => "Galerkin",
        };
        lines.push(format!(
            "fluid: {} nodes, {} elements, {form} weights, ν = {:.4e} m²/s",
            mesh.total_nodes,
            mesh.total_elements,
            fluid.viscosity / fluid.density
        ));
        if let Some(inertia) = scene.flow.inertia() {
            lines.push(format!("  {inertia}"));
        }
        if scene.flow.convects() {
            lines.push(format!("  {}", solver.pressure_choice()));
        }
    }
    if case.ambient.is_some() {
        lines.push("flow: prescribed, nothing is solved for".to_owned());
    }
    if scene.fibre_count == 0 {
        lines.push("fibres: none, no sampling".to_owned());
        return lines;
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
    lines.push(format!(
        "fibres: {}, {contact}, coupling {coupling}",
        scene.fibre_count
    ));
    for (k, group) in case.fibres.iter().enumerate() {
        let area = std::f64::consts::PI * group.diameter * group.diameter / 4.0;
        let stiffness = group.youngs_modulus * area * group.diameter * group.diameter / 16.0;
        lines.push(format!(
            "  group {k}: EI = {stiffness:.3e} N·m², E = {:.3e} Pa",
            group.youngs_modulus
        ));
    }
    lines
}
