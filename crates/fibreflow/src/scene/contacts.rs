//! The contacts of a case: laws, and the walls that hold its fibres.

use super::mesh::SceneMesh;
use super::periodic_box;
use crate::case::{self, AmbientFlow, Boundary, Case, Contact, ContactWall, Domain};
use fibreflow_fibre::contact::{
    ContactSettings, Lubrication, LubricationModel, NormalDamping, Repulsion, SurfaceMotion,
    VanDerWaals, Wall,
};
use fibreflow_mesh::Periods;
use nalgebra::Vector3;

/// The settings of a case with `[contact]`. Collective.
pub fn settings(
    case: &Case,
    mesh: Option<&SceneMesh>,
    periods: &Periods,
) -> Option<ContactSettings> {
    let contact = case.contact.as_ref()?;
    let stiffness = contact.stiffness?;
    let thickest = case.fibres.iter().map(|g| g.diameter).fold(0.0, f64::max);
    Some(ContactSettings {
        damping: NormalDamping::Ratio(contact.damping),
        friction: contact.friction,
        tangential_ratio: contact.tangential_ratio,
        repulsion: contact.repulsion.as_ref().map(repulsion),
        van_der_waals: contact.van_der_waals.as_ref().map(van_der_waals),
        lubrication: lubrication(contact, case),
        walls: walls(contact, case, mesh),
        shear_rate: shear_rate(case),
        count_crossings: contact.count_crossings,
        periodic: periodic_box(case, periods),
        skin_grows: contact.skin.is_none(),
        ..ContactSettings::new(stiffness, contact.skin.unwrap_or(thickest))
    })
}

/// Those that the case gives, else the faces of the box that are not periodic: of every axis the lower one first.
pub(super) fn walls(contact: &Contact, case: &Case, mesh: Option<&SceneMesh>) -> Vec<Wall> {
    match &contact.walls {
        Some(walls) => {
            let given = walls.iter();
            given
                .flat_map(|wall| given_walls(wall, case, mesh))
                .collect()
        }
        None => (case.domain()).map_or_else(Vec::new, |d| faces(&d, case)),
    }
}

pub(super) fn repulsion(given: &case::Repulsion) -> Repulsion {
    Repulsion {
        strength: given.strength,
        decay: given.decay,
        attraction: given.attraction,
        attraction_width: given.attraction_width.unwrap_or(given.decay),
        range: given.range,
        contact_gap: given.contact_gap,
    }
}

fn van_der_waals(given: &case::VanDerWaals) -> VanDerWaals {
    VanDerWaals {
        hamaker: given.hamaker,
        closest: given.closest,
        range: given.range,
    }
}

fn lubrication(contact: &Contact, case: &Case) -> Option<Lubrication> {
    let given = contact.lubrication.as_ref()?;
    let fluid = case.fluid.as_ref().map(|fluid| fluid.viscosity);
    let around = fluid.or(case.ambient.as_ref().map(|ambient| ambient.viscosity));
    Some(Lubrication {
        viscosity: given.viscosity.or(around)?,
        roughness: given.roughness,
        range: given.range,
        model: match given.model {
            case::LubricationModel::Cylinders => LubricationModel::Cylinders,
            case::LubricationModel::Spheres => LubricationModel::Spheres,
        },
    })
}

/// In a prescribed shear flow a box that repeats along y is sheared with the flow.
pub(super) fn shear_rate(case: &Case) -> f64 {
    match &case.ambient {
        Some(ambient) => match (&ambient.flow, &ambient.domain) {
            (AmbientFlow::Shear { rate }, Some(domain)) if domain.periodic[1] => *rate,
            _ => 0.0,
        },
        None => 0.0,
    }
}

fn given_walls(wall: &ContactWall, case: &Case, mesh: Option<&SceneMesh>) -> Vec<Wall> {
    match wall {
        ContactWall::Plane {
            point,
            normal,
            velocity,
        } => vec![Wall {
            velocity: (*velocity).into(),
            ..Wall::plane((*point).into(), (*normal).into())
        }],
        ContactWall::Pipe {
            point,
            axis,
            radius,
        } => vec![Wall::pipe((*point).into(), (*axis).into(), *radius)],
        ContactWall::Patches { names } => {
            let Some(mesh) = mesh else {
                return Vec::new();
            };
            // One surface for all that moves alike, so that it has no rim in between.
            let mut alike: Vec<(SurfaceMotion, Vec<usize>)> = Vec::new();
            for (index, patch) in mesh.local.patches.iter().enumerate() {
                if !names.contains(patch) {
                    continue;
                }
                let motion = motion(case, patch);
                match alike.iter_mut().find(|(other, _)| *other == motion) {
                    Some((_, patches)) => patches.push(index),
                    None => alike.push((motion, vec![index])),
                }
            }
            let corner = |x: [f64; 3]| Vector3::from(x);
            let wall = |(motion, patches): (SurfaceMotion, Vec<usize>)| {
                let triangles = fibreflow_mesh::facets(&mesh.local, &patches).into_iter();
                Wall {
                    motion,
                    ..Wall::facets(triangles.map(|t| t.map(corner)).collect())
                }
            };
            alike.into_iter().map(wall).collect()
        }
    }
}

/// How the fluid's boundary moves in itself; at rest where that depends on time.
fn motion(case: &Case, patch: &str) -> SurfaceMotion {
    let boundaries = case.fluid.as_ref().map(|fluid| &fluid.boundaries);
    match boundaries.and_then(|boundaries| boundaries.get(patch)) {
        Some(Boundary::MovingWall {
            velocity,
            factor: None,
        }) => SurfaceMotion::Sliding((*velocity).into()),
        Some(Boundary::RotatingWall {
            point,
            axis,
            rate,
            factor: None,
        }) => SurfaceMotion::Turning {
            point: (*point).into(),
            spin: Vector3::from(*axis).normalize() * *rate,
        },
        _ => SurfaceMotion::Rest,
    }
}

/// The faces of the directions that are not periodic.
fn faces(domain: &Domain, case: &Case) -> Vec<Wall> {
    let mut walls = Vec::new();
    for c in (0..3).filter(|&c| !domain.periodic[c]) {
        let axis = ["x", "y", "z"][c];
        for (end, side, sign) in [("min", 0.0, 1.0), ("max", domain.size[c], -1.0)] {
            let mut point = Vector3::from(domain.origin);
            point[c] += side;
            walls.push(Wall {
                motion: motion(case, &format!("{axis}_{end}")),
                ..Wall::plane(point, Vector3::ith(c, sign))
            });
        }
    }
    walls
}
