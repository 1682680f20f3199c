//! Contacts between fibre segments, and between segments and walls.
//!
//! A segment is a spherocylinder: an axis between two end nodes and a radius. [`ContactSystem`] finds the pairs that
//! can touch with a distributed cell list ([`ContactSystem::update`]) and adds their forces
//! ([`ContactSystem::forces`]). Every pair is computed in the order a < b of the global segment ids by each rank that
//! owns one of the two, from identical numbers, so that both apply exactly opposite forces and the result does not
//! depend on the number of ranks.

pub(crate) mod broad;
mod closest;
mod crossing;
mod facets;
mod far;
mod grid;
pub(crate) mod images;
mod law;
mod linear;
mod loads;
mod pairs;
mod springs;
mod system;
pub(crate) mod travel;
mod wall;

pub use closest::{ClosestPoints, closest_points, contact_points};
pub use crossing::crossings;
pub(crate) use far::Far;
pub use far::{Lubrication, LubricationModel, Repulsion, VanDerWaals};
pub use springs::FrictionRecord;
pub use system::{ContactStatistics, ContactSystem};
pub use wall::{Surface, SurfaceMotion, Wall};

use crate::{PeriodicBox, Vector3};

/// What contacts are made of; [`ContactSettings::new`] fills in defaults.
#[derive(Clone, Debug)]
pub struct ContactSettings {
    /// k_n of two touching segments \[N/m\].
    pub normal_stiffness: f64,
    /// Loss in the normal direction.
    pub damping: NormalDamping,
    /// Coulomb coefficient μ; 0 switches friction off.
    pub friction: f64,
    /// k_t / k_n (α of K 3.30b).
    pub tangential_ratio: f64,
    /// Pairs nearer than this beyond touching are kept until ends have moved apart by so much \[m\].
    pub skin: f64,
    /// Whether the skin may grow, up to the longest segment, while few pairs are kept.
    pub skin_grows: bool,
    /// Repulsion at a distance.
    pub repulsion: Option<Repulsion>,
    /// Attraction at a distance.
    pub van_der_waals: Option<VanDerWaals>,
    /// Resistance of a thin film of fluid.
    pub lubrication: Option<Lubrication>,
    /// Surfaces that hold the fibres.
    pub walls: Vec<Wall>,
    /// Directions in which the domain repeats.
    pub periodic: PeriodicBox,
    /// Rate at which the periodic box is sheared \[1/s\]: the box above, along y, moves along x with this times the
    /// period (Lees & Edwards 1972). 0 for a box at rest.
    pub shear_rate: f64,
    /// Counts the crossings of centre lines in every step (see [`crossings`]); costs about as much as the contacts.
    pub count_crossings: bool,
}

impl ContactSettings {
    /// Frictionless contacts with a damping ratio of 0.1 in unbounded space, without forces at a distance.
    pub fn new(normal_stiffness: f64, skin: f64) -> Self {
        Self {
            normal_stiffness,
            damping: NormalDamping::Ratio(0.1),
            friction: 0.0,
            tangential_ratio: 2.0 / 7.0,
            skin,
            skin_grows: false,
            repulsion: None,
            van_der_waals: None,
            lubrication: None,
            walls: Vec::new(),
            periodic: PeriodicBox::unbounded(),
            shear_rate: 0.0,
            count_crossings: false,
        }
    }
}

/// How a contact loses energy in the normal direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NormalDamping {
    /// Coefficient of restitution e of a head-on collision, 0.05 to 1.
    Restitution(f64),
    /// Damping ratio ζ of the contact oscillator, 0 to 5.
    Ratio(f64),
}

/// The segments a rank owns, in ascending order of their ids, and the nodes that they join.
#[derive(Clone, Copy, Debug)]
pub struct Segments<'a> {
    /// Global ids: fibre << 20 | index in the fibre; one entry a segment, as `node`, `radius` and `mass`.
    pub ids: &'a [u64],
    /// Ids in the fibres that they have broken from, by which neighbours are known; otherwise as `ids`.
    pub stems: &'a [u64],
    /// First end of the axis, an index into the nodes; the second end is the next node.
    pub node: &'a [u32],
    /// Radius \[m\].
    pub radius: &'a [f64],
    /// Mass \[kg\].
    pub mass: &'a [f64],
    /// Positions of the nodes, not wrapped into a periodic box \[m\].
    pub position: &'a [Vector3],
    /// Velocities of the nodes \[m/s\].
    pub velocity: &'a [Vector3],
    /// Angular velocities of the nodes' frames \[rad/s\].
    pub angular_velocity: &'a [Vector3],
}

impl Segments<'_> {
    /// Number of segments.
    pub fn count(&self) -> usize {
        self.ids.len()
    }

    /// Both ends of the axis \[m\].
    #[inline]
    pub fn ends(&self, segment: usize) -> [Vector3; 2] {
        let node = self.node[segment] as usize;
        [self.position[node], self.position[node + 1]]
    }

    /// Velocities of both ends \[m/s\].
    #[inline]
    pub fn end_velocities(&self, segment: usize) -> [Vector3; 2] {
        let node = self.node[segment] as usize;
        [self.velocity[node], self.velocity[node + 1]]
    }

    /// Angular velocity of the surface about the axis, the mean of the ends' \[rad/s\].
    #[inline]
    pub fn spin(&self, segment: usize) -> Vector3 {
        let node = self.node[segment] as usize;
        (self.angular_velocity[node] + self.angular_velocity[node + 1]) * 0.5
    }
}

/// Contact load on a segment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SegmentLoad {
    /// Force on the first end \[N\].
    pub start_force: Vector3,
    /// Force on the second end \[N\].
    pub end_force: Vector3,
    /// Torque about the axis point that is nearest to the contact \[N·m\].
    pub torque: Vector3,
}

impl SegmentLoad {
    /// Power on a segment that moves with the given velocities of its ends and surface \[W\].
    fn power(&self, start: &Vector3, end: &Vector3, spin: &Vector3) -> f64 {
        self.start_force.dot(start) + self.end_force.dot(end) + self.torque.dot(spin)
    }

    /// Adds a force that acts at the lever `arm` from the axis point `s` (0 at the first end, 1 at the second).
    fn add(&mut self, force: &Vector3, s: f64, arm: &Vector3) {
        self.start_force += force * (1.0 - s);
        self.end_force += force * s;
        self.torque += arm.cross(force);
    }
}

/// Why contacts cannot be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ContactError {
    /// A constant is out of range.
    #[error("contact {name} is {value}, but must be {valid}")]
    Setting {
        /// Name of the constant.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What would be valid.
        valid: &'static str,
    },
    /// A wall without a usable normal.
    #[error("wall {index}: {reason}")]
    Wall {
        /// Position in the list of walls.
        index: usize,
        /// What is wrong.
        reason: &'static str,
    },
    /// A segment could touch two images of another one.
    #[error(
        "the periodic box is {length} m long along {axis}; contacts of segments that reach {reach} m need at least twice that (use shorter segments or a longer box)"
    )]
    PeriodicTooShort {
        /// x, y or z.
        axis: char,
        /// Length of the box \[m\].
        length: f64,
        /// Longest segment with its two caps and the skin \[m\].
        reach: f64,
    },
    /// A segment has an end or a radius that is not finite.
    #[error("a segment's position or radius is not finite")]
    NonFinite,
}
