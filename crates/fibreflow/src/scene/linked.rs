//! The linked fibres of a case, placed.

use super::contacts::{repulsion, shear_rate, walls};
use super::fibres::fibre;
use super::population::{PlacementReport, Populate};
use crate::case::{
    self, Case, Document, Domain, Form, IntegratorKind, Joints, Placement, Spheroid,
};
use crate::error::ProgramError;
use fibreflow_fibre::hydrodynamics::SpheroidRatio;
use fibreflow_fibre::linked::{
    Grips, Joint, LinkedFibre, LinkedScheme, LinkedSettings, LinkedSystem, Piston,
};
use fibreflow_fibre::{Equilibrium, PeriodicBox};
use fibreflow_parallel::Communicator;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// The fibres of a case with linked ones, and what came of the random groups; None for one without.
///
/// # Errors
/// Fibres that do not fit or have impossible constants; more than one rank.
pub fn place(
    populate: &Populate<'_>,
    communicator: &Communicator,
) -> Result<Option<(LinkedSystem, Vec<PlacementReport>)>, ProgramError> {
    let case = populate.case;
    let Some(mut settings) = settings(case, populate.periodic) else {
        return Ok(None);
    };
    let around = surroundings(case);
    let lines = populate.centre_lines()?;
    let (nodes, reports) = populate.place(&lines)?;
    let mut fibres = Vec::new();
    for (k, (group, nodes)) in case.fibres.iter().zip(nodes).enumerate() {
        let moduli = populate.moduli(k, nodes.len())?;
        let framed = match &group.placement {
            Placement::Frames { file } => Some(populate.frames(k, file)?),
            _ => None,
        };
        let joint = match group.joints {
            Joints::Ball => Joint::Ball,
            Joints::Pin => Joint::Pin,
        };
        for (j, (nodes, modulus)) in nodes.into_iter().zip(moduli).enumerate() {
            let beam = fibre(fibres.len() as u64, group, &lines[k], nodes, modulus, case);
            let mut linked = LinkedFibre::new(&beam, joint).map_err(ProgramError::input)?;
            // Joints are numbered by the shape without load, as frames in files are.
            if matches!(
                group.placement,
                Placement::Random {
                    form: Form::Relaxed,
                    ..
                }
            ) {
                let segments = linked.frames.len();
                let mut shape = beam.clone();
                shape.nodes = lines[k].nodes(2.0 * linked.half_length * segments as f64, segments);
                shape.equilibrium = Equilibrium::Placed;
                linked = linked
                    .with_axes_of(&LinkedFibre::new(&shape, joint).map_err(ProgramError::input)?);
            }
            if let Some(framed) = &framed {
                linked.centre = framed[j].centre;
                linked.frames.clone_from(&framed[j].frames);
            }
            let volume = 2.0 * linked.half_length * PI * linked.radius * linked.radius;
            let gravity = Vector3::from(case.gravity.acceleration);
            linked.weight = gravity * ((group.density - around[0]) * volume);
            fibres.push(linked);
        }
    }
    if let (Some(given), Some(domain)) = (&case.piston, case.domain()) {
        let volume =
            |f: &LinkedFibre| 2.0 * f.half_length * f.frames.len() as f64 * PI * f.radius.powi(2);
        let volume = fibres.iter().map(volume).sum();
        settings.piston = Some(piston(given, &domain, volume, populate.document)?);
    }
    let system = LinkedSystem::new(communicator, settings, fibres).map_err(ProgramError::input)?;
    Ok(Some((system, reports)))
}

/// Density and viscosity of the fluid.
fn surroundings(case: &Case) -> [f64; 2] {
    let fluid = case.fluid.as_ref().map(|f| [f.density, f.viscosity]);
    let ambient = case.ambient.as_ref().map(|a| [a.density, a.viscosity]);
    fluid.or(ambient).unwrap_or_default()
}

/// Settings of a case with linked fibres; None for other cases.
pub fn settings(case: &Case, periodic: PeriodicBox) -> Option<LinkedSettings> {
    if !case.linked() {
        return None;
    }
    let thickest = case.fibres.iter().map(|g| g.diameter).fold(0.0, f64::max);
    let contact = case.contact.as_ref();
    let friction = contact.map_or(0.0, |c| c.friction);
    Some(LinkedSettings {
        scheme: match case.mechanics.integrator {
            IntegratorKind::Explicit => LinkedScheme::Explicit,
            IntegratorKind::Auto | IntegratorKind::Implicit => LinkedScheme::Implicit,
        },
        viscosity: surroundings(case)[1],
        spheroid: match case.hydrodynamics.spheroid {
            Spheroid::Cox => SpheroidRatio::Cox,
            Spheroid::Bretherton => SpheroidRatio::Bretherton,
        },
        repulsion: contact.and_then(|c| c.repulsion.as_ref()).map(repulsion),
        friction: [
            friction,
            contact.and_then(|c| c.sliding_friction).unwrap_or(friction),
        ],
        skin: contact.and_then(|c| c.skin).unwrap_or(thickest),
        periodic,
        shear_rate: shear_rate(case),
        walls: contact.map_or_else(Vec::new, |c| walls(c, case, None)),
        piston: None,
        grips: case.grips.as_ref().map(|grips| Grips {
            axis: Vector3::ith(grips.axis as usize, 1.0),
            planes: grips.planes,
            speed: grips.speed,
        }),
    })
}

/// The piston of a case, for fibres of this volume \[m³\].
fn piston(
    given: &case::Piston,
    domain: &Domain,
    volume: f64,
    document: &Document,
) -> Result<Piston, ProgramError> {
    let axis = given.face.axis();
    let area = domain.size.iter().product::<f64>() / domain.size[axis];
    let travel = domain.size[axis] - volume / (given.volume_fraction * area);
    if travel < 0.0 {
        let path = "piston.volume_fraction";
        let message = format!("`{path}` is that of a larger box than the one at the start");
        let least = volume / domain.size.iter().product::<f64>();
        let error = document.value_error(path, message);
        return Err(error.with_help(format!("above {least:.3e}")).into());
    }
    // Walls are the faces that are not periodic, in order.
    let before = (0..axis).filter(|&c| !domain.periodic[c]).count();
    Ok(Piston {
        wall: 2 * before + given.face as usize % 2,
        mass: given.mass,
        weight: given.weight,
        travel,
    })
}
