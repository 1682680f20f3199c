//! Rules for linked fibres.

use super::validate::Checked;
use super::{
    Case, Clamp, ContactWall, Correction, Document, DragLaw, FibreGroup, IntegratorKind, Joints,
    Kinematics, Placement, TorqueLaw,
};

/// What linked fibres need, and what they do not know.
pub(super) fn check(case: &Case, document: &Document) -> Checked {
    let linked = |group: &FibreGroup| group.kinematics == Kinematics::Linked;
    if !case.fibres.iter().any(linked) {
        return only_linked(case, document);
    }
    if let Some(k) = case.fibres.iter().position(|group| !linked(group)) {
        let path = format!("fibres[{k}].kinematics");
        let error = document.error(&path, "linked fibres and beams do not mix");
        return Err(error.with_help("`kinematics = \"linked\"` in every group, or in none"));
    }
    if case.fluid.is_some() {
        check_coupling(case, document)?;
    }
    let laws = &case.hydrodynamics;
    for (key, fits) in [
        ("drag", laws.drag == DragLaw::ProlateSpheroid),
        ("torque", laws.torque == TorqueLaw::ProlateSpheroid),
    ] {
        if !fits {
            let path = format!("hydrodynamics.{key}");
            let message = format!("`{path}`: the segments of linked fibres are spheroids");
            let error = document.error(&path, message);
            return Err(error.with_help(format!("`{path} = \"prolate-spheroid\"`")));
        }
    }
    for (k, group) in case.fibres.iter().enumerate() {
        check_group(group, k, document)?;
    }
    check_contacts(case, document)?;
    check_piston(case, document)?;
    if let Some(grips) = &case.grips
        && grips.planes[0] >= grips.planes[1]
    {
        let error = document.value_error("grips.planes", "`grips.planes` are not in order");
        return Err(error.with_help("the lower one first"));
    }
    let observables = case.output.observables.as_ref();
    let refused = [
        ("hydrodynamics.fluid_inertia", laws.fluid_inertia),
        ("exact", case.exact.is_some()),
        (
            "output.observables.energy",
            observables.is_some_and(|o| o.energy),
        ),
        (
            "output.observables.wall_margin",
            observables.is_some_and(|o| o.wall_margin != 0.0),
        ),
    ];
    refuse(&refused, document)?;
    let Some(distance) = observables.and_then(|o| o.pair_distance) else {
        return Ok(());
    };
    let path = "output.observables.pair_distance";
    let domain = case.domain().filter(|d| d.periodic == [true; 3]);
    let least = domain.map_or(0.0, |d| d.size.into_iter().fold(f64::INFINITY, f64::min));
    if distance > 0.5 * least {
        let message = format!("`{path} = {distance}` is more than half of a periodic box");
        let help = "at most half the shortest edge of `ambient.domain`";
        return Err(document.value_error(path, message).with_help(help));
    }
    Ok(())
}

/// In a flow that is solved for.
fn check_coupling(case: &Case, document: &Document) -> Checked {
    if case.mechanics.integrator == IntegratorKind::Explicit {
        let path = "mechanics.integrator";
        let message =
            format!("`{path}`: linked fibres move implicitly in a flow that is solved for");
        return Err(document
            .value_error(path, message)
            .with_help("\"implicit\""));
    }
    let observables = case.output.observables.as_ref();
    refuse(
        &[
            (
                "coupling.correction",
                case.coupling.correction == Correction::Undisturbed,
            ),
            (
                "output.observables.stress",
                observables.is_some_and(|o| o.stress),
            ),
            (
                "output.observables.pair_distance",
                observables.is_some_and(|o| o.pair_distance.is_some()),
            ),
            ("piston", case.piston.is_some()),
            ("grips", case.grips.is_some()),
        ],
        document,
    )
}

/// Keys that have a meaning for linked fibres alone.
fn only_linked(case: &Case, document: &Document) -> Checked {
    let wrong = |path: String| {
        let message = format!("`{path}` is for linked fibres");
        Err(document
            .error(&path, message)
            .with_help("`kinematics = \"linked\"`"))
    };
    for (k, group) in case.fibres.iter().enumerate() {
        if group.joints != Joints::Ball {
            return wrong(format!("fibres[{k}].joints"));
        }
        if matches!(group.placement, Placement::Frames { .. }) {
            return wrong(format!("fibres[{k}].placement.kind"));
        }
    }
    let observables = case.output.observables.as_ref();
    if observables.is_some_and(|o| o.pair_distance.is_some()) {
        return wrong("output.observables.pair_distance".to_owned());
    }
    for (key, given) in [
        ("piston", case.piston.is_some()),
        ("grips", case.grips.is_some()),
    ] {
        if given {
            return wrong(key.to_owned());
        }
    }
    let contact = case.contact.as_ref();
    if contact.is_some_and(|c| c.sliding_friction.is_some()) {
        return wrong("contact.sliding_friction".to_owned());
    }
    Ok(())
}

fn check_group(group: &FibreGroup, k: usize, document: &Document) -> Checked {
    let keys = [
        ("clamp", group.clamp != Clamp::None),
        ("point_loads", !group.point_loads.is_empty()),
        ("taper", group.taper != 1.0),
        ("shear", group.shear),
        ("retardation", group.retardation != 0.0),
        ("strength", group.strength.is_some()),
    ];
    let named = keys.map(|(key, given)| (format!("fibres[{k}].{key}"), given));
    let keys: Vec<(&str, bool)> = named
        .iter()
        .map(|(key, given)| (key.as_str(), *given))
        .collect();
    refuse(&keys, document)
}

fn check_contacts(case: &Case, document: &Document) -> Checked {
    let Some(contact) = &case.contact else {
        return Ok(());
    };
    if contact.repulsion.is_none() {
        let error = document.error(
            "contact",
            "`contact` lacks `repulsion`, by which linked fibres keep apart",
        );
        return Err(error
            .with_help("`repulsion = { strength = …, decay = …, range = …, contact_gap = … }`"));
    }
    refuse(
        &[
            ("contact.stiffness", contact.stiffness.is_some()),
            ("contact.van_der_waals", contact.van_der_waals.is_some()),
            ("contact.lubrication", contact.lubrication.is_some()),
            ("contact.count_crossings", contact.count_crossings),
        ],
        document,
    )?;
    let walls = contact.walls.as_deref().unwrap_or_default();
    let plane = |wall: &ContactWall| matches!(wall, ContactWall::Plane { .. });
    match walls.iter().position(|wall| !plane(wall)) {
        Some(k) => {
            let path = format!("contact.walls[{k}].kind");
            let message = format!("`{path}`: linked fibres know plane walls alone");
            let error = document.value_error(&path, message);
            Err(error.with_help("kind = \"plane\""))
        }
        None => Ok(()),
    }
}

/// A piston is a face of the box that is a wall.
fn check_piston(case: &Case, document: &Document) -> Checked {
    let Some(piston) = &case.piston else {
        return Ok(());
    };
    let contact = case.contact.as_ref();
    let walls = contact.is_some_and(|c| c.walls.is_none());
    let axis = piston.face.axis();
    let free = case.domain().is_some_and(|d| !d.periodic[axis]);
    if walls && free {
        return Ok(());
    }
    let message = "`piston.face` is no wall that fibres touch";
    Err(document
        .value_error("piston.face", message)
        .with_help("`[contact]` without `walls`, and `ambient.domain` that is not periodic there"))
}

fn refuse(keys: &[(&str, bool)], document: &Document) -> Checked {
    match keys.iter().find(|(_, given)| *given) {
        None => Ok(()),
        Some((path, _)) => {
            let message = format!("`{path}` does not go with linked fibres");
            Err(document.error(path, message).with_help("remove it"))
        }
    }
}
