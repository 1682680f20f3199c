//! The fibres of a case, placed.

use super::population::{PlacementReport, Populate};
use crate::case::{
    Case, Clamp, DragLaw, FibreGroup, Form, IntegratorKind, Kinematics, Mechanics, Placement,
    Shape, SlenderBody, Spheroid, TorqueLaw,
};
use crate::error::ProgramError;
use fibreflow_coupling::FibreLoad;
use fibreflow_fibre::Kinematics as Motion;
use fibreflow_fibre::contact::ContactSettings;
use fibreflow_fibre::hydrodynamics::{
    BUCKLING_FLEXIBILITY, DragModel, FluidProperties, Section, SlenderConstants, SpheroidRatio,
    TorqueModel, flexibility,
};
use fibreflow_fibre::placement::CentreLine;
use fibreflow_fibre::{
    Equilibrium, Fibre, FibreSettings, FibreSystem, Hydrodynamics, ImplicitSettings, Integrator,
    Material, Support,
};
use fibreflow_parallel::Communicator;
use nalgebra::Vector3;

/// Fibres of this rank, and what is known of all.
pub struct PlacedFibres {
    /// The fibres of this rank.
    pub system: FibreSystem,
    /// Fibres on all ranks.
    pub count: usize,
    /// What came of the random groups.
    pub reports: Vec<PlacementReport>,
}

/// The fibres of a case; None for a case without fibres.
///
/// `spacing` is the mesh size \[m\]: longer parts of a segment get hydrodynamic points of their own. Ids count from 0
/// through the groups of the case. Every rank draws all places and keeps its share.
///
/// # Errors
/// Fibres that do not fit or have impossible constants.
pub fn place(
    populate: Populate<'_>,
    spacing: f64,
    contacts: Option<ContactSettings>,
    communicator: &Communicator,
) -> Result<Option<PlacedFibres>, ProgramError> {
    let case = populate.case;
    if case.fibres.is_empty() || case.linked() {
        return Ok(None);
    }
    let lines = populate.centre_lines()?;
    let (nodes, reports) = populate.place(&lines)?;
    let count = nodes.iter().map(Vec::len).sum();
    let (rank, ranks) = (communicator.rank(), communicator.size());
    let share = count * rank / ranks..count * (rank + 1) / ranks;
    let mut mine: Vec<(Fibre, &FibreGroup)> = Vec::with_capacity(share.len());
    let mut id = 0;
    for (k, (group, nodes)) in case.fibres.iter().zip(nodes).enumerate() {
        let moduli = populate.moduli(k, nodes.len())?;
        for (nodes, modulus) in nodes.into_iter().zip(moduli) {
            if share.contains(&id) {
                let fibre = fibre(id as u64, group, &lines[k], nodes, modulus, case);
                mine.push((fibre, group));
            }
            id += 1;
        }
    }
    let fibres = mine.iter().map(|(fibre, _)| fibre.clone()).collect();
    let settings = settings(case, spacing, contacts);
    let made = FibreSystem::new(communicator.clone(), settings, fibres);
    let mut system = made.map_err(ProgramError::input)?;
    for (fibre, group) in &mine {
        for load in &group.point_loads {
            let nodes = fibre.nodes.len() as i64;
            let node = if load.node < 0 {
                load.node + nodes
            } else {
                load.node
            };
            system
                .add_load(fibre.id, node as usize, load.force.into(), Vector3::zeros())
                .map_err(ProgramError::input)?;
        }
    }
    Ok(Some(PlacedFibres {
        system,
        count,
        reports,
    }))
}

/// What a fibre of this length \[m\] can do, and ζ⊥γ̇L⁴/EI where that decides whether it is rigid.
pub fn kinematics(
    case: &Case,
    group: &FibreGroup,
    material: &Material,
    length: f64,
) -> (Motion, Option<f64>) {
    let bends = if may_lack_twist(case, group) {
        Motion::TwistFree
    } else {
        Motion::Full
    };
    let section = Section::middle(group.diameter, length);
    match (group.kinematics, case.shear_rate()) {
        (Kinematics::Flexible | Kinematics::Linked, _) => (Motion::Full, None),
        (Kinematics::TwistFree, _) => (Motion::TwistFree, None),
        (Kinematics::Rigid, _) => (Motion::Rigid, None),
        (Kinematics::Auto, None) => (bends, None),
        (Kinematics::Auto, Some(rate)) => {
            let stiffness = material.bending_stiffness();
            let number = flexibility(&section, stiffness, viscosity(case), rate);
            let stiff = number < 0.1 * BUCKLING_FLEXIBILITY;
            (if stiff { Motion::Rigid } else { bends }, Some(number))
        }
    }
}

/// Whether nothing twists the fibres of a group, and the integrator can do without.
fn may_lack_twist(case: &Case, group: &FibreGroup) -> bool {
    let integrator = match case.mechanics.integrator {
        IntegratorKind::Auto => true,
        IntegratorKind::Implicit => case.contact.is_none(),
        IntegratorKind::Explicit => false,
    };
    let round = group.bending_ratio == 1.0 && !group.shear && group.twist == 0.0;
    integrator && round && matches!(group.shape, Shape::Straight)
}

fn viscosity(case: &Case) -> f64 {
    let fluid = case.fluid.as_ref().map(|fluid| fluid.viscosity);
    fluid
        .or(case.ambient.as_ref().map(|ambient| ambient.viscosity))
        .unwrap_or(0.0)
}

/// One fibre of a group through nodes.
pub(super) fn fibre(
    id: u64,
    group: &FibreGroup,
    line: &CentreLine,
    nodes: Vec<Vector3<f64>>,
    modulus: f64,
    case: &Case,
) -> Fibre {
    let radius = 0.5 * group.diameter;
    let mut material = Material::new(radius, modulus, group.poisson_ratio, group.density);
    material.retardation = group.retardation;
    material.shear = group.shear;
    material.strength = group.strength.unwrap_or(f64::INFINITY);
    material.bending_ratio = group.bending_ratio;
    let last = nodes.len() - 1;
    let placed_length = nodes.windows(2).map(|p| (p[1] - p[0]).norm()).sum();
    let (kinematics, _) = kinematics(case, group, &material, placed_length);
    let equilibrium = match (&group.shape, &group.placement) {
        _ if kinematics == Motion::Rigid => Equilibrium::Placed,
        (Shape::Straight, _) => Equilibrium::Straight,
        (Shape::AsPlaced, _) => Equilibrium::Placed,
        (_, Placement::Random { form, .. }) if *form == Form::Relaxed => Equilibrium::Placed,
        (Shape::U { .. } | Shape::Helix { .. } | Shape::Chain { .. } | Shape::File { .. }, _) => {
            Equilibrium::Shape(line.nodes(placed_length, last))
        }
    };
    let clamped: &[usize] = match group.clamp {
        Clamp::None => &[],
        Clamp::First => &[0],
        Clamp::Last => &[last],
        Clamp::Both => &[0, last],
    };
    Fibre {
        id,
        material,
        nodes,
        equilibrium,
        supports: clamped.iter().map(|&n| Support::clamp(n)).collect(),
        twist: group.twist,
        taper: group.taper,
        section_axis: group.section_axis.into(),
        kinematics,
    }
}

fn settings(case: &Case, spacing: f64, contacts: Option<ContactSettings>) -> FibreSettings {
    let fluid = match (&case.fluid, &case.ambient) {
        (Some(fluid), _) => (fluid.density, fluid.viscosity),
        (None, Some(ambient)) => (ambient.density, ambient.viscosity),
        (None, None) => (0.0, 0.0),
    };
    let constants = match case.hydrodynamics.slender_body {
        SlenderBody::Batchelor => SlenderConstants::Batchelor,
        SlenderBody::Kunhappan => SlenderConstants::Kunhappan,
        SlenderBody::Split => SlenderConstants::Split,
        SlenderBody::Ends => SlenderConstants::Ends,
    };
    let spheroid = match case.hydrodynamics.spheroid {
        Spheroid::Cox => SpheroidRatio::Cox,
        Spheroid::Bretherton => SpheroidRatio::Bretherton,
    };
    FibreSettings {
        gravity: case.gravity.acceleration.into(),
        buoyant_density: fluid.0,
        hydrodynamics: Some(Hydrodynamics {
            fluid: FluidProperties {
                density: fluid.0,
                viscosity: fluid.1,
            },
            drag: match case.hydrodynamics.drag {
                DragLaw::Auto => DragModel::Auto(constants),
                DragLaw::SlenderBody => DragModel::SlenderBody(constants),
                DragLaw::InfiniteCylinder => DragModel::InfiniteCylinder,
                DragLaw::ProlateSpheroid => DragModel::ProlateSpheroid(spheroid),
                DragLaw::None => DragModel::None,
            },
            torque: match case.hydrodynamics.torque {
                TorqueLaw::Jeffery => TorqueModel::Jeffery(constants),
                TorqueLaw::Kunhappan => TorqueModel::Kunhappan,
                TorqueLaw::ProlateSpheroid => TorqueModel::ProlateSpheroid(spheroid),
                TorqueLaw::None => TorqueModel::None,
            },
            point_spacing: spacing,
        }),
        fluid_inertia: case.hydrodynamics.fluid_inertia,
        contacts,
        integrator: integrator(&case.mechanics),
        budget: (case.output.observables.as_ref()).is_some_and(|o| o.energy),
        ..FibreSettings::default()
    }
}

fn integrator(mechanics: &Mechanics) -> Integrator {
    let settings = ImplicitSettings {
        linear: mechanics.linear,
        tolerance: match mechanics.tolerance {
            0.0 => f64::INFINITY,
            tolerance => tolerance,
        },
    };
    match mechanics.integrator {
        IntegratorKind::Auto => Integrator::Auto(settings),
        IntegratorKind::Explicit => Integrator::Explicit,
        IntegratorKind::Implicit => Integrator::Implicit(settings),
    }
}

/// Length of the fibres of a group \[m\].
pub fn length(group: &FibreGroup) -> Option<f64> {
    match &group.placement {
        Placement::Random { .. } | Placement::Frames { .. } => group.length.as_ref()?.nominal(),
        Placement::File { .. } => None,
        Placement::Line { start, end } => {
            Some((Vector3::from(*end) - Vector3::from(*start)).norm())
        }
        Placement::Nodes { positions } => {
            let step = |p: &[[f64; 3]]| (Vector3::from(p[1]) - Vector3::from(p[0])).norm();
            Some(positions.windows(2).map(step).sum())
        }
    }
}

/// Time that a contact takes with the pairs near it, by that of a segment: 12 % of a profile for 129 contacts, 48 % for 3120 rigid segments.
const CONTACT: f64 = 6.0;

/// What the balance over ranks needs to know of each fibre.
pub fn loads(fibres: &FibreSystem) -> Vec<FibreLoad> {
    let lengths: Vec<f64> = fibres.point_lengths().collect();
    let mut first = 0;
    let load = |fibre: usize| {
        let segments = fibres.offsets()[fibre + 1] - fibres.offsets()[fibre] - 1;
        let half = 0.5 * fibres.length(fibre);
        let (mut along, mut count, mut middle) = (0.0, 0, first);
        while along < 2.0 * half * (1.0 - 1e-9) {
            along += lengths[first + count];
            if along <= half {
                middle = first + count;
            }
            count += 1;
        }
        first += count;
        FibreLoad {
            id: fibres.id(fibre),
            load: segments as f64 + CONTACT * fibres.contacts_of(fibre),
            middle_point: middle,
        }
    };
    (0..fibres.fibres()).map(load).collect()
}
