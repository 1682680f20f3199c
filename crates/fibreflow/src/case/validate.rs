//! Rules that no schema can say: which keys go together, what must fit into what.

use super::{
    Average, Case, CaseError, Clamp, ContactWall, Correction, CouplingMode, Document, DragLaw,
    Exact, Forcing, Initial, KernelKind, Kinematics, Line, MeshSource, Observables, Placement,
    Quantity, Region, SamplePoints, Schedule, Scheme, SlenderBody, Spheroid, TorqueLaw, schema,
};

pub(super) type Checked = Result<(), Box<CaseError>>;

/// Rules that need the case alone.
pub(super) fn validate(case: &Case, document: &Document) -> Checked {
    check_time(case, document)?;
    check_parts(case, document)?;
    check_fluid(case, document)?;
    check_laws(case, document)?;
    for (k, _) in case.fibres.iter().enumerate() {
        check_group(case, k, document)?;
    }
    for (name, schedule) in [
        ("vtk", &case.output.vtk),
        ("series", &case.output.series),
        ("checkpoint", &case.output.checkpoint),
    ] {
        check_schedule(name, schedule, document)?;
    }
    check_turbulence(case, document)?;
    check_loads(case, document)?;
    check_statistics(case, document)?;
    check_samples(case, document)?;
    check_observables(case, document)?;
    check_contact(case, document)?;
    super::linked::check(case, document)?;
    check_coupling(case, document)?;
    check_exact(case, document)
}

fn check_laws(case: &Case, document: &Document) -> Checked {
    let laws = &case.hydrodynamics;
    let spheroid = laws.drag == DragLaw::ProlateSpheroid;
    let slender = matches!(laws.drag, DragLaw::Auto | DragLaw::SlenderBody);
    let (key, need) = if laws.torque == TorqueLaw::ProlateSpheroid && !spheroid {
        ("torque", "`drag = \"prolate-spheroid\"`")
    } else if laws.spheroid != Spheroid::default() && !spheroid {
        ("spheroid", "`drag = \"prolate-spheroid\"`")
    } else if laws.slender_body != SlenderBody::default() && !slender {
        ("slender_body", "`drag` of \"auto\" or \"slender-body\"")
    } else {
        return Ok(());
    };
    let path = format!("hydrodynamics.{key}");
    let message = format!("`{path}` needs {need}");
    Err(document.value_error(&path, message))
}

fn check_coupling(case: &Case, document: &Document) -> Checked {
    let coupling = &case.coupling;
    let gaussian = coupling.kernel == KernelKind::Gaussian;
    let two_way = coupling.mode == CouplingMode::TwoWay && case.fluid.is_some();
    let refuse = |key: &str, problem: &str, help: &str| {
        let path = format!("coupling.{key}");
        let error = document.error(&path, format!("`{path}` {problem}"));
        Err(error.with_help(help.to_owned()))
    };
    match coupling.width {
        None if gaussian => {
            let help = "σ [m], two spacings of the mesh or more";
            return refuse("width", "is missing: a Gaussian kernel needs it", help);
        }
        Some(_) if !gaussian => {
            let help = "set `coupling.kernel = \"gaussian\"`, or remove the width";
            return refuse("width", "has no meaning with this kernel", help);
        }
        _ => {}
    }
    if gaussian && case.fluid.is_none() {
        let help = "a prescribed flow is taken at the points themselves";
        return refuse("kernel", "needs a fluid on a mesh", help);
    }
    if coupling.correction == Correction::Undisturbed && !(gaussian && two_way) {
        let help = "what a fibre does to the flow is known for `kernel = \"gaussian\"` in two-way coupling";
        return refuse("correction", "does not go with this coupling", help);
    }
    if !(coupling.tolerance > 0.0 && coupling.tolerance < 1.0) {
        let help = "a number above 0 and below 1";
        return refuse("tolerance", "is not the part of a force", help);
    }
    if coupling.scheme == Scheme::Iterated && !two_way {
        let help = "forces are solved together with the flow in two-way coupling only";
        return refuse("scheme", "does not go with this coupling", help);
    }
    Ok(())
}

fn check_contact(case: &Case, document: &Document) -> Checked {
    let Some(contact) = &case.contact else {
        return Ok(());
    };
    if contact.stiffness.is_none() && !case.linked() {
        let message = "`contact` lacks `stiffness`: how hard segments press each other apart [N/m]";
        return Err(document.error("contact", message));
    }
    let ordered = [
        contact
            .repulsion
            .as_ref()
            .map(|r| ("repulsion.contact_gap", r.contact_gap, r.range)),
        contact
            .van_der_waals
            .as_ref()
            .map(|v| ("van_der_waals.closest", v.closest, v.range)),
        contact
            .lubrication
            .as_ref()
            .map(|l| ("lubrication.roughness", l.roughness, l.range)),
    ];
    for (key, inner, range) in ordered.into_iter().flatten() {
        if inner >= range {
            let path = format!("contact.{key}");
            let message = format!("`{path} = {inner}` is not below the range, {range}");
            return Err(document.value_error(&path, message));
        }
    }
    let patches = |wall: &ContactWall| matches!(wall, ContactWall::Patches { .. });
    let walls = contact.walls.as_deref().unwrap_or_default();
    match walls.iter().position(patches) {
        Some(k) if case.mesh.is_none() => {
            let path = format!("contact.walls[{k}].names");
            let error = document.error(&path, "patches as walls need a mesh");
            Err(error.with_help("kind = \"plane\" or kind = \"pipe\" without one"))
        }
        _ => Ok(()),
    }
}

fn check_observables(case: &Case, document: &Document) -> Checked {
    let Some(observables) = &case.output.observables else {
        return Ok(());
    };
    if case.fibres.is_empty() {
        let message = "`output.observables` needs fibres";
        return Err(document.error("output.observables", message));
    }
    let schedule = observables.schedule(&Schedule::default());
    check_schedule("observables", &schedule, document)?;
    check_margin(case, observables, document)?;
    let [f, g] = [observables.flow, observables.gradient];
    let square = |a: [f64; 3], b: [f64; 3]| (0..3).map(|c| a[c] * b[c]).sum::<f64>();
    // Squared sine of the angle that they enclose.
    if square(f, f) * square(g, g) - square(f, g).powi(2) <= 1e-12 * square(f, f) * square(g, g) {
        let path = "output.observables.gradient";
        let error = document.error(path, "`flow` and `gradient` span no plane of shear");
        return Err(
            error.with_help("two directions that are not parallel, as in [1, 0, 0] and [0, 1, 0]")
        );
    }
    Ok(())
}

/// What walls and volumes an observable needs.
fn check_margin(case: &Case, observables: &Observables, document: &Document) -> Checked {
    let domain = case.domain();
    if observables.stress && domain.is_none() && case.mesh.is_none() {
        let path = "output.observables.stress";
        let error = document.error(path, "stress needs the volume of the suspension");
        return Err(error.with_help("`ambient.domain`, or a mesh"));
    }
    if observables.wall_margin == 0.0 {
        return Ok(());
    }
    let path = "output.observables.wall_margin";
    let Some(domain) = domain else {
        let error = document.value_error(path, format!("`{path}` needs a box"));
        return Err(error.with_help("a mesh of kind \"box\", or `ambient.domain`"));
    };
    let narrow =
        |&c: &usize| !domain.periodic[c] && domain.size[c] <= 2.0 * observables.wall_margin;
    match (0..3).find(narrow) {
        None => Ok(()),
        Some(c) => {
            let (margin, size) = (observables.wall_margin, domain.size[c]);
            let message = format!("`{path} = {margin}` leaves nothing of a box {size} m wide");
            Err(document.value_error(path, message))
        }
    }
}

fn check_turbulence(case: &Case, document: &Document) -> Checked {
    let wanted = [
        ("turbulence", &case.output.turbulence),
        ("spectrum", &case.output.spectrum),
    ];
    for (name, schedule) in wanted {
        let Some(schedule) = schedule else { continue };
        check_schedule(name, schedule, document)?;
        if case.fluid.is_none() {
            let path = format!("output.{name}");
            let message = format!("`{path}` needs a fluid on a mesh");
            return Err(document.error(&path, message));
        }
    }
    let Some(MeshSource::Box { periodic, .. }) = &case.mesh else {
        return Ok(());
    };
    let fluid = case.fluid.as_ref();
    let linear = fluid.is_some_and(|f| matches!(f.forcing, Forcing::Linear { .. }));
    let isotropic = fluid.is_some_and(|f| matches!(f.initial, Initial::Isotropic { .. }));
    let needs = [
        ("fluid.forcing.kind", linear),
        ("fluid.initial.kind", isotropic),
        ("output.spectrum", case.output.spectrum.is_some()),
    ];
    match needs.into_iter().find(|(_, needs)| *needs) {
        Some((path, _)) if *periodic != [true; 3] => {
            let message = format!("`{path}`: this needs a box that is periodic in all directions");
            Err(document
                .error(path, message)
                .with_help("set `mesh.periodic = [true, true, true]`"))
        }
        _ => Ok(()),
    }
}

fn check_loads(case: &Case, document: &Document) -> Checked {
    let Some(loads) = &case.output.loads else {
        return Ok(());
    };
    if case.fluid.is_none() {
        let message = "`output.loads` needs a fluid on a mesh";
        return Err(document.error("output.loads", message));
    }
    check_schedule("loads", &loads.schedule(&Schedule::default()), document)?;
    let Some(coefficients) = &loads.coefficients else {
        return Ok(());
    };
    let lift = coefficients.lift.map(|lift| ("lift", lift));
    for (name, direction) in [("drag", coefficients.drag)].into_iter().chain(lift) {
        if direction == [0.0; 3] {
            let path = format!("output.loads.coefficients.{name}");
            let error = document.value_error(&path, format!("`{path}` is zero"));
            return Err(error.with_help("a direction, as in [1, 0, 0]"));
        }
    }
    Ok(())
}

fn check_statistics(case: &Case, document: &Document) -> Checked {
    let Some(statistics) = &case.output.statistics else {
        return Ok(());
    };
    if case.fluid.is_none() {
        let message = "`output.statistics` needs a fluid on a mesh";
        return Err(document.error("output.statistics", message));
    }
    let own = Schedule {
        every: statistics.every,
        interval: statistics.interval,
    };
    check_schedule("statistics", &own, document)?;
    let (path, from, end) = ("output.statistics.from", statistics.from, case.time.end);
    if from >= end {
        let message = format!("`{path} = {from}` is not before `time.end = {end}`");
        return Err(document.value_error(path, message));
    }
    let average = statistics.average;
    if let Average::Planes { normal, flow, .. } = average
        && normal == flow
    {
        let path = "output.statistics.average.flow";
        let message = format!("`{path}` is the direction across the planes");
        let help = "two different directions: `flow` along the planes, `normal` across them";
        return Err(document.value_error(path, message).with_help(help));
    }
    let wrong = |&along: &Line| match average {
        Average::Planes { normal, .. } => {
            along == Line::Around || along as usize == normal as usize
        }
        Average::Rings { axis, .. } => along != Line::Around && along as usize != axis as usize,
    };
    if let Some(k) = statistics.spectra.iter().position(wrong) {
        let path = format!("output.statistics.spectra[{k}]");
        let message = format!("`{path}` goes across the planes or rings");
        let help = "directions in planes, or that of the axis of rings and `around`";
        return Err(document.value_error(&path, message).with_help(help));
    }
    Ok(())
}

fn check_samples(case: &Case, document: &Document) -> Checked {
    for (k, samples) in case.output.samples.iter().enumerate() {
        let path = format!("output.samples[{k}]");
        if case.fluid.is_none() {
            let message = "`output.samples` needs a fluid on a mesh";
            return Err(document.error(&path, message));
        }
        let own = samples.schedule(&Schedule::default());
        check_schedule(&format!("samples[{k}]"), &own, document)?;
        let earlier = &case.output.samples[..k];
        let series = [
            "fluid",
            "fibres",
            "loads",
            "friction",
            "orientation",
            "shape",
        ];
        let name = samples.name.as_str();
        if earlier.iter().any(|s| s.name == name) || series.contains(&name) {
            let path = format!("{path}.name");
            let message = format!("`{path} = \"{name}\"` is the name of other files");
            return Err(document.value_error(&path, message));
        }
        let thin = match &samples.at {
            SamplePoints::Plane { low, high, .. } => (0..2).any(|c| high[c] <= low[c]),
            SamplePoints::Box { low, high, .. } => (0..3).any(|c| high[c] <= low[c]),
            SamplePoints::Points { .. } | SamplePoints::Line { .. } => false,
        };
        if thin {
            let path = format!("{path}.at.high");
            let message = format!("`{path}` is not above `low`");
            return Err(document.value_error(&path, message));
        }
    }
    Ok(())
}

fn check_time(case: &Case, document: &Document) -> Checked {
    let time = &case.time;
    match (time.step, time.cfl) {
        (Some(_), Some(_)) => {
            return Err(document
                .error("time.cfl", "`time` has both `step` and `cfl`")
                .with_help(
                    "give one of them: a constant `step` [s], or the Courant number `cfl`",
                ));
        }
        (None, None) => {
            return Err(document.error("time", "`time` lacks the step").with_help(
                "give a constant `step` [s], or the Courant number `cfl` with `max_step` [s]",
            ));
        }
        (Some(step), None) if step > time.end => {
            return Err(document.value_error(
                "time.step",
                format!(
                    "`time.step = {step}` is longer than `time.end = {}`",
                    time.end
                ),
            ));
        }
        _ => {}
    }
    if time.step.is_some() && time.max_step.is_some() {
        return Err(document
            .error(
                "time.max_step",
                "`time.max_step` has no meaning with a constant `step`",
            )
            .with_help("remove it, or give `cfl` in place of `step`"));
    }
    if time.cfl.is_some() && case.fluid.is_none() {
        return Err(document
            .error("time.cfl", "`time.cfl` needs a fluid on a mesh")
            .with_help("give a constant `time.step` [s] with a prescribed flow"));
    }
    Ok(())
}

fn check_parts(case: &Case, document: &Document) -> Checked {
    match (&case.mesh, &case.fluid, &case.ambient) {
        (Some(_), Some(_), None) | (None, None, Some(_)) => {}
        (_, Some(_), Some(_)) | (Some(_), None, Some(_)) => {
            return Err(document
                .error(
                    "ambient",
                    "`[ambient]` prescribes the flow, so there is no `[mesh]` and no `[fluid]`",
                )
                .with_help("remove `[ambient]`, or remove `[mesh]` and `[fluid]`"));
        }
        (Some(_), None, None) => {
            return Err(document.error("mesh", "`[mesh]` is given without `[fluid]`"));
        }
        (None, Some(_), None) => {
            return Err(document
                .error("fluid", "`[fluid]` is given without `[mesh]`")
                .with_help(
                    "`[mesh]` with kind = \"box\", \"pipe\", \"gmsh\", \"vtk\" or \"openfoam\"",
                ));
        }
        (None, None, None) => {
            return Err(document
                .error("", "the case has neither a fluid nor a prescribed flow")
                .with_help("give `[mesh]` and `[fluid]`, or `[ambient]`"));
        }
    }
    if case.ambient.is_some() && case.fibres.is_empty() {
        return Err(document.error(
            "ambient",
            "a prescribed flow without `[[fibres]]` has nothing to compute",
        ));
    }
    if case.phase.is_some() && case.fluid.is_none() {
        return Err(document.error("phase", "`[phase]` is given without `[fluid]`"));
    }
    if case.beads.is_some() && case.fluid.is_none() {
        return Err(document.error("beads", "`[beads]` is given without `[fluid]`"));
    }
    if case.beads.is_some() && !case.fibres.is_empty() {
        let message = "`[beads]` and `[[fibres]]` do not go together yet";
        return Err(document.error("beads", message));
    }
    if case.beads.is_some() && case.phase.as_ref().is_some_and(|p| p.solid.is_some()) {
        let message = "the solid of `[phase]` is that of the beads where there are any";
        return Err(document.error("phase.solid", message));
    }
    if case.phase.as_ref().is_some_and(|p| p.decay.is_some()) && case.time.cfl.is_none() {
        return Err(document
            .error(
                "phase.decay",
                "`phase.decay` limits steps that may change, and `time.step` is constant",
            )
            .with_help("give `time.cfl` in place of `time.step`, or remove the key"));
    }
    Ok(())
}

fn check_fluid(case: &Case, document: &Document) -> Checked {
    let Some(fluid) = &case.fluid else {
        return Ok(());
    };
    if let Forcing::BulkVelocity { direction, .. } = fluid.forcing
        && direction == [0.0; 3]
    {
        return Err(document.value_error(
            "fluid.forcing.direction",
            "`fluid.forcing.direction` is zero",
        ));
    }
    if fluid.frame_velocity != [0.0; 3] && !(case.fibres.is_empty() && case.beads.is_none()) {
        let problem = "`fluid.frame_velocity` moves the mesh away from fibres and beads";
        let help = "remove it, or run the flow alone";
        let error = document.error("fluid.frame_velocity", problem);
        return Err(error.with_help(help));
    }
    if let Some(MeshSource::Box { periodic, .. }) = &case.mesh {
        let walls = periodic.iter().filter(|p| !**p).count();
        let needs_walls = matches!(
            fluid.initial,
            Initial::Poiseuille { .. } | Initial::PerturbedChannel { .. }
        );
        if needs_walls && walls != 1 {
            return Err(document
                .error("fluid.initial.kind", "this initial field needs a box with exactly one direction that is not periodic")
                .with_help("set `mesh.periodic`, as in [true, false, true]"));
        }
    }
    Ok(())
}

fn check_group(case: &Case, k: usize, document: &Document) -> Checked {
    let group = &case.fibres[k];
    let path = |key: &str| format!("fibres[{k}].{key}");
    let lacks = |key: &str, why: &str| {
        document.error(
            &format!("fibres[{k}]"),
            format!("`fibres[{k}]` lacks `{key}`: {why}"),
        )
    };
    if group.kinematics == Kinematics::Auto && case.shear_rate().is_none() {
        return Err(document
            .error(
                &path("kinematics"),
                format!(
                    "`{} = \"auto\"` needs a shear rate to judge by",
                    path("kinematics")
                ),
            )
            .with_help("give `mechanics.shear_rate`, or `flexible` or `rigid`"));
    }
    if group.kinematics == Kinematics::Rigid && group.clamp != Clamp::None {
        return Err(document
            .error(
                &path("clamp"),
                format!("`{}` holds a rigid fibre", path("clamp")),
            )
            .with_help("only flexible fibres can be held"));
    }
    let length = match &group.placement {
        Placement::Random {
            count,
            volume_fraction,
            region,
            ..
        } => {
            if count.is_some() == volume_fraction.is_some() {
                return Err(document
                    .error(
                        &path("placement"),
                        format!(
                            "`{}` needs either `count` or `volume_fraction`",
                            path("placement")
                        ),
                    )
                    .with_help("give exactly one of them"));
            }
            if region.is_none() && case.domain().is_none() {
                let message = "random placement needs to know where: the case has no box";
                return Err(document.error(&path("placement"), message).with_help(
                    "give `region = { kind = \"box\" … }` or `{ kind = \"pipe\" … }`, a box mesh, or `ambient.domain`",
                ));
            }
            let length = group.length.as_ref();
            length
                .ok_or_else(|| lacks("length", "random placement needs it [m]"))?
                .nominal()
        }
        Placement::Line { start, end } => Some(distance(start, end)),
        Placement::File { .. } => None,
        Placement::Frames { .. } => {
            let length = group.length.as_ref().and_then(Quantity::nominal);
            return match length {
                Some(_) => Ok(()),
                None => Err(lacks("length", "frames need the length of a fibre [m]")),
            };
        }
        Placement::Nodes { positions } => {
            Some(positions.windows(2).map(|p| distance(&p[0], &p[1])).sum())
        }
    };
    if length == Some(0.0) {
        return Err(document.error(
            &path("placement"),
            format!("`{}` has no length", path("placement")),
        ));
    }
    let nodes = match (&group.placement, group.segments) {
        // The file decides.
        (Placement::File { .. } | Placement::Frames { .. }, _) => return Ok(()),
        (Placement::Nodes { positions }, None) => positions.len(),
        (Placement::Nodes { positions }, Some(n)) if positions.len() == n + 1 => positions.len(),
        (Placement::Nodes { positions }, Some(n)) => {
            return Err(document.value_error(
                &path("segments"),
                format!(
                    "`{} = {n}` does not fit {} positions",
                    path("segments"),
                    positions.len()
                ),
            ));
        }
        (_, Some(n)) => n + 1,
        (_, None) => return Err(lacks("segments", "the number of beam segments of a fibre")),
    };
    let segment = length.map_or(f64::INFINITY, |length| length / (nodes - 1) as f64);
    if group.diameter > segment {
        return Err(document
            .value_error(
                &path("diameter"),
                format!("`{} = {}` is larger than a segment is long ({segment:.4e} m)", path("diameter"), group.diameter),
            )
            .with_help("use fewer segments or a smaller diameter: a beam segment is at least as long as it is thick"));
    }
    for (l, load) in group.point_loads.iter().enumerate() {
        let index = if load.node < 0 {
            load.node + nodes as i64
        } else {
            load.node
        };
        if !(0..nodes as i64).contains(&index) {
            let key = path(&format!("point_loads[{l}].node"));
            return Err(document
                .value_error(
                    &key,
                    format!(
                        "`{key} = {}` is no node of a fibre of {nodes} nodes",
                        load.node
                    ),
                )
                .with_help(format!(
                    "valid: 0 to {}, or -1 to -{nodes} from the end",
                    nodes - 1
                )));
        }
    }
    Ok(())
}

fn check_schedule(name: &str, schedule: &Schedule, document: &Document) -> Checked {
    if schedule.every.is_some() && schedule.interval.is_some() {
        let path = format!("output.{name}");
        return Err(document
            .error(&path, format!("`{path}` has both `every` and `interval`"))
            .with_help("give `every` (steps) or `interval` [s]"));
    }
    Ok(())
}

fn check_exact(case: &Case, document: &Document) -> Checked {
    let Some(exact) = case.exact else {
        return Ok(());
    };
    let fluid = case.fluid.as_ref();
    let fits = match exact {
        Exact::TaylorGreen => {
            fluid.is_some_and(|f| matches!(f.initial, Initial::TaylorGreen { .. }))
        }
        Exact::Poiseuille => {
            fluid.is_some_and(|f| {
                matches!(f.forcing, Forcing::PressureGradient { factor: None, .. })
            }) && matches!(&case.mesh, Some(MeshSource::Box { periodic, .. }) if periodic.iter().filter(|p| !**p).count() == 1)
        }
        Exact::Cantilever => case
            .fibres
            .first()
            .is_some_and(|g| !g.point_loads.is_empty()),
        Exact::Jeffery => {
            !case.fibres.is_empty()
                && case
                    .ambient
                    .as_ref()
                    .is_some_and(|a| matches!(a.flow, super::AmbientFlow::Shear { .. }))
        }
    };
    if fits {
        return Ok(());
    }
    let needs = match exact {
        Exact::TaylorGreen => "`fluid.initial` of kind \"taylor-green\"",
        Exact::Poiseuille => {
            "a box with one direction that is not periodic and `fluid.forcing` of kind \"pressure-gradient\" without `factor`"
        }
        Exact::Cantilever => "a first fibre with a point load",
        Exact::Jeffery => "a fibre in `ambient.flow` of kind \"shear\"",
    };
    Err(document
        .error("exact.kind", "this exact answer does not fit the case")
        .with_help(format!("it needs {needs}")))
}

/// Every patch of the mesh needs a condition, and every condition a patch.
///
/// # Errors
/// [`CaseError`] naming the patch.
pub fn validate_patches(case: &Case, document: &Document, patches: &[String]) -> Checked {
    let Some(fluid) = &case.fluid else {
        return Ok(());
    };
    let known: Vec<&str> = patches.iter().map(String::as_str).collect();
    let all = if known.is_empty() {
        "the mesh has no patches: every direction is periodic".to_owned()
    } else {
        format!("patches of the mesh: `{}`", known.join("`, `"))
    };
    let unknown = |name: &&String| !known.contains(&name.as_str());
    if let Some(name) = fluid.boundaries.keys().find(unknown) {
        let path = format!("fluid.boundaries.{name}");
        let error = document.error(&path, format!("`{path}`: the mesh has no patch `{name}`"));
        return Err(error.with_help(match schema::nearest(name, &known) {
            Some(near) => format!("did you mean `{near}`? {all}"),
            None => all,
        }));
    }
    let loads = case.output.loads.iter().flat_map(|l| &l.patches);
    if let Some((k, name)) = loads.enumerate().find(|(_, name)| unknown(name)) {
        let path = format!("output.loads.patches[{k}]");
        let error =
            document.value_error(&path, format!("`{path}`: the mesh has no patch `{name}`"));
        return Err(error.with_help(match schema::nearest(name, &known) {
            Some(near) => format!("did you mean `{near}`? {all}"),
            None => all,
        }));
    }
    let walls = case.contact.iter().filter_map(|c| c.walls.as_ref());
    for (k, wall) in walls.flatten().enumerate() {
        let ContactWall::Patches { names } = wall else {
            continue;
        };
        if let Some(name) = names.iter().find(unknown) {
            let path = format!("contact.walls[{k}].names");
            let message = format!("`{path}`: the mesh has no patch `{name}`");
            return Err(document.value_error(&path, message).with_help(all));
        }
    }
    match known.iter().find(|p| !fluid.boundaries.contains_key(**p)) {
        None => Ok(()),
        Some(patch) => Err(document
            .error("fluid.boundaries", format!("`fluid.boundaries` lacks the patch `{patch}`"))
            .with_help(format!(
                "add `boundaries.{patch} = {{ kind = \"wall\" }}` under `[fluid]` (kinds: wall, moving-wall, rotating-wall, slip, inlet, outlet, convective-outlet); {all}"
            ))),
    }
}

/// Explicitly placed fibres must lie in the box `low`…`high`, but for periodic directions.
///
/// # Errors
/// [`CaseError`] naming fibre, node and position.
pub fn validate_domain(
    case: &Case,
    document: &Document,
    low: [f64; 3],
    high: [f64; 3],
    periodic: [bool; 3],
) -> Checked {
    for (k, group) in case.fibres.iter().enumerate() {
        let points: Vec<(String, [f64; 3])> = match &group.placement {
            Placement::Random { region, .. } => {
                let corners = region.iter().flat_map(Region::corners);
                corners.map(|x| ("region".to_owned(), x)).collect()
            }
            Placement::File { .. } | Placement::Frames { .. } => continue,
            Placement::Line { start, end } => vec![("start".into(), *start), ("end".into(), *end)],
            Placement::Nodes { positions } => {
                let named = positions.iter().enumerate();
                named
                    .map(|(n, x)| (format!("positions[{n}]"), *x))
                    .collect()
            }
        };
        for (name, x) in points {
            // A region may be given by other numbers than the box it fills.
            let slack = |c: usize| 1e-9 * (high[c] - low[c]);
            let beyond = |c: usize| low[c] - x[c] > slack(c) || x[c] - high[c] > slack(c);
            let out = (0..3).find(|&c| !periodic[c] && beyond(c));
            if let Some(c) = out {
                let path = format!("fibres[{k}].placement.{name}");
                let axis = ["x", "y", "z"][c];
                return Err(document
                    .value_error(
                        &path,
                        format!(
                            "`{path} = {x:?}` lies outside the domain: {axis} = {}",
                            x[c]
                        ),
                    )
                    .with_help(format!("{axis} from {} to {} m is inside", low[c], high[c])));
            }
        }
    }
    Ok(())
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>().sqrt()
}
