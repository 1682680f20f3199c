//! What is on and what is off in a run, with the number that decided it.

use crate::case::{Case, CouplingMode, FibreGroup, IntegratorKind, Quantity};
use crate::scene::{Exchange, PlacementReport, Scene, kinematics as motion, length_of};
use fibreflow_coupling::Kernel;
use fibreflow_fibre::hydrodynamics::BUCKLING_FLEXIBILITY;
use fibreflow_fibre::{FibreSettings, Integrator, Kinematics, Material};

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
        if let Some(eddies) = &solver.settings().turbulence {
            lines.push(format!(
                "  eddy viscosity: {:?}, C = {}, explicit",
                eddies.model, eddies.constant
            ));
        }
        if scene.flow.convects() {
            lines.push(format!("  {}", solver.pressure_choice()));
        }
    }
    if let Some(phase) = scene.flow.phase() {
        let settings = phase.field.settings();
        lines.push(format!(
            "two fluids: σ = {:.4e} N/m, ξ = {:.4e} m, energy density {:.4e} J/m³, D = {:.4e} m²/s, an interface relaxes in {:.4e} s",
            settings.surface_tension,
            settings.interface_width,
            settings.energy_density(),
            settings.diffusivity,
            settings.interface_width.powi(2) / settings.diffusivity
        ));
    }
    if let Some(beads) = scene.flow.beads() {
        let settings = beads.settings();
        lines.push(format!(
            "beads: {} in {} rows, r_b = {:.4e} m, ξ = {:.4e} m, rigid over ℓ = {:.4e} m, beams implicit",
            beads.beads().len(),
            beads.offsets().len() - 1,
            settings.profile.radius,
            settings.profile.width,
            beads.screening()
        ));
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
    if let Some(exchange) = scene.flow.exchange() {
        lines.extend(coupled(exchange, scene));
    }
    if let Some(fibres) = &scene.fibres {
        let critical = fibres.communicator().min(fibres.critical_step());
        let way = match case.mechanics.integrator {
            IntegratorKind::Implicit if case.contact.is_some() => {
                "implicit, contacts in the same equations".to_owned()
            }
            IntegratorKind::Implicit => "implicit".to_owned(),
            _ if case.contact.is_some() => "explicit, as fibres may touch".to_owned(),
            IntegratorKind::Explicit => "explicit".to_owned(),
            IntegratorKind::Auto => format!(
                "auto: implicit where a step is longer than {:.3e} s",
                critical * FibreSettings::default().step_safety * Integrator::WORTH as f64
            ),
        };
        lines.push(format!(
            "  integrator {way}; critical explicit step {critical:.3e} s"
        ));
    }
    if let Some(linked) = &scene.linked {
        lines.push(format!(
            "  linked: {} rigid segments, {}",
            linked.segments(),
            match case.mechanics.integrator {
                IntegratorKind::Explicit =>
                    "explicit, friction by groups of contacts (Switzer 2002, 2.9.2)",
                IntegratorKind::Auto | IntegratorKind::Implicit =>
                    "implicit, joints and friction solved together",
            }
        ));
        if let Some(grips) = &case.grips {
            lines.push(format!(
                "  grips: {} points of fibres, planes apart by {:.3e} m/s",
                linked.grips().len(),
                2.0 * grips.speed
            ));
        }
        if let Some(piston) = &case.piston {
            lines.push(format!(
                "  piston: {:.3e} kg, {:.3e} N, stops at a volume fraction of {}",
                piston.mass, piston.weight, piston.volume_fraction
            ));
        }
    }
    for (k, group) in case.fibres.iter().enumerate() {
        let area = std::f64::consts::PI * group.diameter * group.diameter / 4.0;
        let moment = area * group.diameter * group.diameter / 16.0;
        let Some(modulus) = group.youngs_modulus.nominal() else {
            lines.push(format!("  group {k}: E from a file"));
            continue;
        };
        let drawn = match &group.youngs_modulus {
            Quantity::Constant(_) => "",
            Quantity::Drawn(_) => " in the mean",
        };
        lines.push(format!(
            "  group {k}: EI = {:.3e} N·m², E = {modulus:.3e} Pa{drawn}, {}",
            modulus * moment,
            kinematics(case, group, modulus)
        ));
    }
    lines.extend(scene.placements.iter().map(placement));
    lines
}

fn kinematics(case: &Case, group: &FibreGroup, modulus: f64) -> String {
    let material = Material::new(
        0.5 * group.diameter,
        modulus,
        group.poisson_ratio,
        group.density,
    );
    let length = length_of(group).unwrap_or(0.0);
    if case.linked() {
        return linked(case, &material, length);
    }
    let (kinematics, number) = motion(case, group, &material, length);
    let name = match kinematics {
        Kinematics::Full => "flexible",
        Kinematics::TwistFree => "flexible without twist",
        Kinematics::Rigid => "rigid",
    };
    match number {
        None => name.to_owned(),
        Some(number) => {
            format!("{name} as ζ⊥γ̇L⁴/EI = {number:.3} and {BUCKLING_FLEXIBILITY} buckles it")
        }
    }
}

/// S^eff = EI/(μγ̇L⁴), stiffness by the torque of the flow.
fn linked(case: &Case, material: &Material, length: f64) -> String {
    let fluid = case.fluid.as_ref().map(|f| f.viscosity);
    let ambient = case.ambient.as_ref().map(|a| a.viscosity);
    let viscosity = fluid.or(ambient).unwrap_or(0.0);
    match case.shear_rate().filter(|_| length > 0.0) {
        Some(rate) => {
            let number = material.bending_stiffness() / (viscosity * rate * length.powi(4));
            format!("linked, S^eff = EI/μγ̇L⁴ = {number:.4}")
        }
        None => "linked".to_owned(),
    }
}

/// How the coupling is done.
fn coupled(exchange: &Exchange, scene: &Scene) -> Vec<String> {
    let mut lines = vec![format!("  {}", exchange.scheme)];
    let kernel = match exchange.kernel {
        Kernel::Element => "  kernel: the element around a point".to_owned(),
        Kernel::Middle => "  kernel: the element around the middle of a segment".to_owned(),
        Kernel::Gaussian { width } => {
            let spacing = scene.flow.fluid().map_or(f64::NAN, |fluid| {
                let nodes = fluid.mesh().total_nodes as f64;
                (fluid.geometry().total_volume / nodes).cbrt()
            });
            let ratio = width / spacing;
            let warning = if ratio < 2.0 {
                "; warning: below 2 the mesh shows"
            } else {
                ""
            };
            format!("  kernel: Gaussian of σ = {width:.3e} m, {ratio:.2} mean spacings{warning}")
        }
    };
    lines.push(kernel);
    lines.push(match (&exchange.undisturbed, exchange.walls) {
        (None, _) => "  fibres feel the flow that they make themselves".to_owned(),
        (Some(_), 0) => "  fibres feel the flow without what they make themselves".to_owned(),
        (Some(_), walls) => format!(
            "  fibres feel the flow without what they make themselves, images of {walls} plane walls included"
        ),
    });
    lines
}

fn placement(report: &PlacementReport) -> String {
    let (k, [placed, wanted]) = (report.group, report.fibres);
    let warning = if placed < wanted {
        format!(
            "; warning: there was no room for {} of {wanted}",
            wanted - placed
        )
    } else {
        String::new()
    };
    format!(
        "  group {k}: {placed} placed at random, volume fraction {:.4}, ⟨pp⟩ within {:.3} of its target{warning}",
        report.volume_fraction, report.orientation_error
    )
}
