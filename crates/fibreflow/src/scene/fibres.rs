//! The fibres of a case, placed.

use crate::case::{
    self, Case, Clamp, Domain, DragLaw, FibreGroup, IntegratorKind, Kinematics, Mechanics,
    Placement, Shape, TorqueLaw,
};
use crate::error::ProgramError;
use fibreflow_coupling::FibreLoad;
use fibreflow_fibre::contact::ContactSettings;
use fibreflow_fibre::hydrodynamics::{
    BUCKLING_FLEXIBILITY, DragModel, FluidProperties, Section, SlenderConstants, TorqueModel,
    flexibility,
};
use fibreflow_fibre::placement::{
    Amount, CentreLine, Orientation, PlacementDomain, PlacementSettings, place_random,
};
use fibreflow_fibre::{
    Equilibrium, Fibre, FibreSettings, FibreSystem, Hydrodynamics, ImplicitSettings, Integrator,
    Material, Points, Support,
};
use fibreflow_parallel::Communicator;
use nalgebra::Vector3;

/// Random places tried for one fibre before giving up.
const ATTEMPTS: usize = 100_000;

/// The fibres of a case and their number on all ranks; None for a case without fibres.
///
/// `spacing` is the mesh size \[m\]: longer parts of a segment get hydrodynamic points of their own. Ids count from 0
/// through the groups of the case. Every rank draws all places and keeps its share.
///
/// # Errors
/// Fibres that do not fit or have impossible constants.
pub fn place(
    case: &Case,
    spacing: f64,
    contacts: Option<ContactSettings>,
    communicator: &Communicator,
) -> Result<Option<(FibreSystem, usize)>, ProgramError> {
    if case.fibres.is_empty() {
        return Ok(None);
    }
    let mut places = Vec::new();
    for (index, group) in case.fibres.iter().enumerate() {
        let found = centre_lines(group, case.domain().as_ref())
            .map_err(|e| ProgramError::input(format!("fibres[{index}].placement: {e}")))?;
        places.extend(found.into_iter().map(|nodes| (group, nodes)));
    }
    let count = places.len();
    let (rank, ranks) = (communicator.rank(), communicator.size());
    let share = count * rank / ranks..count * (rank + 1) / ranks;
    let kept = places.drain(share.clone()).zip(share);
    let mine: Vec<(Fibre, &FibreGroup)> = kept
        .map(|((group, nodes), id)| (fibre(id as u64, group, nodes, case), group))
        .collect();
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
    Ok(Some((system, count)))
}

/// Nodes of all fibres of a group.
fn centre_lines(
    group: &FibreGroup,
    domain: Option<&Domain>,
) -> Result<Vec<Vec<Vector3<f64>>>, String> {
    let segments = group.segments.unwrap_or(1);
    match &group.placement {
        Placement::Line { start, end } => {
            let (a, b) = (Vector3::from(*start), Vector3::from(*end));
            let node = |k: usize| a + (b - a) * (k as f64 / segments as f64);
            Ok(vec![(0..=segments).map(node).collect()])
        }
        Placement::Nodes { positions } => {
            Ok(vec![positions.iter().map(|x| Vector3::from(*x)).collect()])
        }
        Placement::Random {
            count,
            volume_fraction,
            seed,
            orientation,
        } => {
            let (Some(length), Some(domain)) = (group.length, domain) else {
                return Err("a length and a box are needed".to_owned());
            };
            let centre_line = centre_line(group);
            let settings = PlacementSettings {
                amount: match (count, volume_fraction) {
                    (Some(count), _) => Amount::Count(*count),
                    (None, fraction) => Amount::VolumeFraction(fraction.unwrap_or(0.0)),
                },
                length,
                radius: 0.5 * group.diameter,
                centre_line: centre_line.clone(),
                segments,
                domain: PlacementDomain {
                    origin: domain.origin.into(),
                    size: domain.size.into(),
                    periodic: domain.periodic,
                },
                wall_clearance: 0.0,
                gap: 0.0,
                orientation: direction(orientation),
                seed: *seed,
                max_attempts: ATTEMPTS,
            };
            let placed = place_random(&settings).map_err(|e| e.to_string())?;
            let line = centre_line.nodes(length, segments);
            Ok(placed.iter().map(|p| p.nodes(&line)).collect())
        }
    }
}

fn centre_line(group: &FibreGroup) -> CentreLine {
    match group.shape {
        Shape::U { opening_angle } => CentreLine::U { opening_angle },
        Shape::Straight | Shape::AsPlaced => CentreLine::Straight,
    }
}

fn direction(orientation: &case::Orientation) -> Orientation {
    match orientation {
        case::Orientation::Isotropic => Orientation::Isotropic,
        case::Orientation::Aligned { direction } => Orientation::Aligned((*direction).into()),
        case::Orientation::InPlane { normal } => Orientation::InPlane((*normal).into()),
    }
}

/// Whether a fibre of this length \[m\] keeps its shape, and ζ⊥γ̇L⁴/EI where that decides.
pub fn is_rigid(
    case: &Case,
    group: &FibreGroup,
    material: &Material,
    length: f64,
) -> (bool, Option<f64>) {
    let section = Section {
        diameter: group.diameter,
        fibre_length: length,
    };
    match (group.kinematics, case.shear_rate()) {
        (Kinematics::Flexible, _) | (Kinematics::Auto, None) => (false, None),
        (Kinematics::Rigid, _) => (true, None),
        (Kinematics::Auto, Some(rate)) => {
            let stiffness = material.bending_stiffness();
            let number = flexibility(&section, stiffness, viscosity(case), rate);
            (number < 0.1 * BUCKLING_FLEXIBILITY, Some(number))
        }
    }
}

fn viscosity(case: &Case) -> f64 {
    let fluid = case.fluid.as_ref().map(|fluid| fluid.viscosity);
    fluid
        .or(case.ambient.as_ref().map(|ambient| ambient.viscosity))
        .unwrap_or(0.0)
}

fn fibre(id: u64, group: &FibreGroup, nodes: Vec<Vector3<f64>>, case: &Case) -> Fibre {
    let (radius, modulus) = (0.5 * group.diameter, group.youngs_modulus);
    let mut material = Material::new(radius, modulus, group.poisson_ratio, group.density);
    material.retardation = group.retardation;
    let last = nodes.len() - 1;
    let placed_length = nodes.windows(2).map(|p| (p[1] - p[0]).norm()).sum();
    let (rigid, _) = is_rigid(case, group, &material, placed_length);
    let equilibrium = match (&group.shape, &group.placement) {
        _ if rigid => Equilibrium::Placed,
        (Shape::Straight, _) => Equilibrium::Straight,
        (Shape::AsPlaced, _) | (Shape::U { .. }, Placement::Random { .. }) => Equilibrium::Placed,
        (Shape::U { .. }, _) => Equilibrium::Shape(centre_line(group).nodes(placed_length, last)),
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
        rigid,
    }
}

fn settings(case: &Case, spacing: f64, contacts: Option<ContactSettings>) -> FibreSettings {
    let fluid = match (&case.fluid, &case.ambient) {
        (Some(fluid), _) => (fluid.density, fluid.viscosity),
        (None, Some(ambient)) => (ambient.density, ambient.viscosity),
        (None, None) => (0.0, 0.0),
    };
    let constants = SlenderConstants::Batchelor;
    FibreSettings {
        gravity: case.gravity.acceleration.into(),
        buoyant_density: fluid.0,
        hydrodynamics: Some(Hydrodynamics {
            fluid: FluidProperties {
                density: fluid.0,
                viscosity: fluid.1,
            },
            drag: match case.hydrodynamics.drag {
                DragLaw::Auto => DragModel::Auto,
                DragLaw::SlenderBody => DragModel::SlenderBody(constants),
                DragLaw::InfiniteCylinder => DragModel::InfiniteCylinder,
                DragLaw::None => DragModel::None,
            },
            torque: match case.hydrodynamics.torque {
                TorqueLaw::Jeffery => TorqueModel::Jeffery(constants),
                TorqueLaw::Kunhappan => TorqueModel::Kunhappan,
                TorqueLaw::None => TorqueModel::None,
            },
            point_spacing: spacing,
        }),
        contacts,
        integrator: integrator(&case.mechanics),
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
        Placement::Random { .. } => group.length,
        Placement::Line { start, end } => {
            Some((Vector3::from(*end) - Vector3::from(*start)).norm())
        }
        Placement::Nodes { positions } => {
            let step = |p: &[[f64; 3]]| (Vector3::from(p[1]) - Vector3::from(p[0])).norm();
            Some(positions.windows(2).map(step).sum())
        }
    }
}

/// What the balance over ranks needs to know of each fibre; `points` are those of the fibres now.
pub fn loads(fibres: &FibreSystem, points: &Points) -> Vec<FibreLoad> {
    let mut first = 0;
    let load = |fibre: usize| {
        let segments = fibres.offsets()[fibre + 1] - fibres.offsets()[fibre] - 1;
        let half = 0.5 * fibres.length(fibre);
        let (mut along, mut count, mut middle) = (0.0, 0, first);
        while along < 2.0 * half * (1.0 - 1e-9) {
            along += points.weight[first + count];
            if along <= half {
                middle = first + count;
            }
            count += 1;
        }
        first += count;
        FibreLoad {
            id: fibres.id(fibre),
            segments,
            middle_point: middle,
        }
    };
    (0..fibres.fibres()).map(load).collect()
}
