//! Random fibres that do not overlap.

mod centre_line;
mod occupied;

pub use centre_line::CentreLine;

use crate::{PeriodicBox, Vector3};
use occupied::Occupied;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{PI, TAU};

/// What to place, and where.
#[derive(Clone, Debug)]
pub struct PlacementSettings {
    /// How many fibres.
    pub amount: Amount,
    /// Length of a fibre along its axis \[m\].
    pub length: f64,
    /// Radius \[m\].
    pub radius: f64,
    /// Form of the axis.
    pub centre_line: CentreLine,
    /// Segments a fibre is made of.
    pub segments: usize,
    /// The box to fill.
    pub domain: PlacementDomain,
    /// Least distance of a fibre's surface from the faces that do not repeat \[m\].
    pub wall_clearance: f64,
    /// Least distance between the surfaces of two fibres \[m\].
    pub gap: f64,
    /// Directions of the fibres.
    pub orientation: Orientation,
    /// Seed of the random numbers: the same seed gives the same fibres.
    pub seed: u64,
    /// Random places tried for one fibre before giving up.
    pub max_attempts: usize,
}

/// How much is placed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amount {
    /// This many fibres.
    Count(usize),
    /// The number of fibres whose cylinders πr²L come nearest to this fraction of the box.
    VolumeFraction(f64),
}

/// The box that is filled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacementDomain {
    /// Lowest corner \[m\].
    pub origin: Vector3,
    /// Edges \[m\].
    pub size: Vector3,
    /// Axes along which the box repeats; the faces of the others are walls.
    pub periodic: [bool; 3],
}

/// Distribution of the fibres' directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Orientation {
    /// All directions alike.
    Isotropic,
    /// All fibres along one direction, turned at random about it.
    Aligned(Vector3),
    /// Directions at random in the plane with this normal; curved fibres lie in the plane.
    InPlane(Vector3),
}

/// Where one fibre is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedFibre {
    /// Mean of the nodes, inside the box \[m\].
    pub centre: Vector3,
    /// Unit tangent in the middle of the fibre.
    pub direction: Vector3,
    /// Unit normal of the plane in which a curved fibre lies.
    pub normal: Vector3,
}

impl PlacedFibre {
    /// Nodes in space of a centre line given in the fibre's own frame (see [`CentreLine::nodes`]), not wrapped.
    pub fn nodes(&self, centre_line: &[Vector3]) -> Vec<Vector3> {
        let side = self.normal.cross(&self.direction);
        let point =
            |x: &Vector3| self.centre + self.direction * x.x + side * x.y + self.normal * x.z;
        centre_line.iter().map(point).collect()
    }
}

/// Why fibres could not be placed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlacementError {
    /// A setting is out of range.
    #[error("placement: {name} is {value}, but must be {valid}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What would be valid.
        valid: &'static str,
    },
    /// A direction or a plane normal of no length.
    #[error("placement: the {0} has no direction")]
    Direction(&'static str),
    /// A fibre would meet its own image whatever its direction.
    #[error(
        "placement: the periodic box is {length} m long along {axis}, but a fibre of radius {radius} m with its gap needs at least {least} m"
    )]
    BoxTooSmall {
        /// x, y or z.
        axis: char,
        /// Length of the box \[m\].
        length: f64,
        /// Radius of the fibres \[m\].
        radius: f64,
        /// What would do \[m\].
        least: f64,
    },
    /// No free place was found.
    #[error(
        "placed {placed} of {wanted} fibres (volume fraction {volume_fraction:.4}) and found no room for another in {attempts} attempts; ask for fewer or shorter fibres, or align them"
    )]
    NoRoom {
        /// Fibres placed.
        placed: usize,
        /// Fibres asked for.
        wanted: usize,
        /// Volume fraction reached.
        volume_fraction: f64,
        /// Attempts for the fibre that failed.
        attempts: usize,
    },
}

/// Random sequential placement: fibres are put at random places and directions, and kept where they touch no other
/// fibre, no image of themselves and no wall.
///
/// The work grows linearly with the number of fibres. Every rank that calls it gets the same answer.
///
/// # Errors
/// [`PlacementError`] when a setting is unusable or there is no room.
pub fn place_random(settings: &PlacementSettings) -> Result<Vec<PlacedFibre>, PlacementError> {
    let wanted = checked_count(settings)?;
    let line = settings
        .centre_line
        .nodes(settings.length, settings.segments);
    let mut occupied = Occupied::new(settings, wanted)?;
    let mut random = ChaCha8Rng::seed_from_u64(settings.seed);
    let mut placed = Vec::with_capacity(wanted);
    while placed.len() < wanted {
        let fits = |fibre: &PlacedFibre| occupied.try_insert(&fibre.nodes(&line));
        let fibre = (0..settings.max_attempts)
            .map(|_| candidate(settings, &mut random))
            .find(fits);
        let Some(fibre) = fibre else {
            return Err(PlacementError::NoRoom {
                placed: placed.len(),
                wanted,
                volume_fraction: placed.len() as f64 * fibre_fraction(settings),
                attempts: settings.max_attempts,
            });
        };
        placed.push(fibre);
    }
    Ok(placed)
}

/// Fraction of the box that one fibre fills.
fn fibre_fraction(settings: &PlacementSettings) -> f64 {
    let volume = settings.domain.size.product();
    PI * settings.radius * settings.radius * settings.length / volume
}

fn checked_count(settings: &PlacementSettings) -> Result<usize, PlacementError> {
    let positive = |name, value: f64| check(value > 0.0, name, value, "a positive length in m");
    let distance = |name, value: f64| check(value >= 0.0, name, value, "zero or a length in m");
    positive("length", settings.length)?;
    positive("radius", settings.radius)?;
    distance("wall_clearance", settings.wall_clearance)?;
    distance("gap", settings.gap)?;
    for axis in 0..3 {
        positive("domain size", settings.domain.size[axis])?;
    }
    let segments = settings.segments as f64;
    check(segments >= 1.0, "segments", segments, "at least 1")?;
    let attempts = settings.max_attempts as f64;
    check(attempts >= 1.0, "max_attempts", attempts, "at least 1")?;
    if let CentreLine::U { opening_angle } = settings.centre_line {
        let valid = (0.0..=PI).contains(&opening_angle);
        check(valid, "opening angle", opening_angle, "between 0 and π")?;
    }
    let direction = |name, v: Vector3| {
        let usable = v.norm() > 0.0 && v.norm().is_finite();
        usable.then_some(()).ok_or(PlacementError::Direction(name))
    };
    match settings.orientation {
        Orientation::Isotropic => {}
        Orientation::Aligned(v) => direction("aligned orientation", v)?,
        Orientation::InPlane(v) => direction("normal of the plane of orientations", v)?,
    }
    match settings.amount {
        Amount::Count(count) => Ok(count),
        Amount::VolumeFraction(fraction) => {
            let valid = (0.0..1.0).contains(&fraction);
            check(valid, "volume fraction", fraction, "between 0 and 1")?;
            Ok((fraction / fibre_fraction(settings)).round() as usize)
        }
    }
}

fn check(
    good: bool,
    name: &'static str,
    value: f64,
    valid: &'static str,
) -> Result<(), PlacementError> {
    if good && value.is_finite() {
        Ok(())
    } else {
        Err(PlacementError::Setting { name, value, valid })
    }
}

/// A random place and direction.
fn candidate(settings: &PlacementSettings, random: &mut ChaCha8Rng) -> PlacedFibre {
    let domain = &settings.domain;
    let mut unit = || random.random::<f64>();
    let centre = Vector3::from_fn(|axis, _| domain.origin[axis] + domain.size[axis] * unit());
    let (direction, normal) = match settings.orientation {
        Orientation::Isotropic => {
            let (z, azimuth) = (2.0 * unit() - 1.0, TAU * unit());
            let sine = (1.0 - z * z).sqrt();
            let direction = Vector3::new(sine * azimuth.cos(), sine * azimuth.sin(), z);
            (direction, around(&direction, TAU * unit()))
        }
        Orientation::Aligned(direction) => {
            let direction = direction.normalize();
            (direction, around(&direction, TAU * unit()))
        }
        Orientation::InPlane(normal) => {
            let normal = normal.normalize();
            (around(&normal, TAU * unit()), normal)
        }
    };
    PlacedFibre {
        centre,
        direction,
        normal,
    }
}

/// The unit vector at `angle` in the plane across `axis`.
fn around(axis: &Vector3, angle: f64) -> Vector3 {
    let first = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
    first * angle.cos() + axis.cross(&first) * angle.sin()
}

impl PlacementDomain {
    fn periodic_box(&self) -> PeriodicBox {
        PeriodicBox {
            origin: self.origin,
            lengths: [0, 1, 2].map(|axis| self.periodic[axis].then_some(self.size[axis])),
        }
    }
}

#[cfg(test)]
mod tests;
