//! What holds on a patch.

use super::{Signal, VelocityProfile};

/// What holds on a patch. On nodes of several patches the order is
/// resting wall > moving wall > inlet > convective outlet > slip > outlet.
#[derive(Clone, Debug)]
pub enum BoundaryCondition {
    /// No slip on a wall of constant velocity \[m/s\].
    Wall {
        /// Velocity of the wall; zero for a wall at rest.
        velocity: [f64; 3],
    },
    /// No slip on a wall that rotates, or whose velocity changes in time or from place to place.
    MovingWall {
        /// Velocity of the wall.
        profile: VelocityProfile,
    },
    /// No flow through, no shear stress: a symmetry plane.
    Slip,
    /// Given velocity.
    Inlet {
        /// Velocity over the patch.
        profile: VelocityProfile,
    },
    /// Given pressure, no viscous stress; what flows back in brings no kinetic energy.
    Outlet {
        /// Pressure \[Pa\].
        pressure: Signal,
    },
    /// Flow that is carried out as it comes, ∂u/∂t + U_c ∂u/∂n = 0; none comes back.
    ConvectiveOutlet {
        /// U_c \[m/s\]; the mean speed through the patch when not given.
        speed: Option<f64>,
    },
}

impl BoundaryCondition {
    /// Wall at rest.
    pub const WALL: Self = Self::Wall { velocity: [0.0; 3] };

    /// True when the velocity of the fluid is given here.
    pub fn gives_velocity(&self) -> bool {
        !matches!(self, Self::Slip | Self::Outlet { .. })
    }

    /// The part of the given velocity that does not change in time, see [`VelocityProfile::shape`].
    pub(super) fn shape(&self, x: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Wall { velocity } => *velocity,
            Self::MovingWall { profile } | Self::Inlet { profile } => profile.shape(x),
            Self::Slip | Self::Outlet { .. } | Self::ConvectiveOutlet { .. } => [0.0; 3],
        }
    }

    /// Given velocity at a time, if there is one, from its shape.
    pub(super) fn velocity(&self, base: [f64; 3], x: [f64; 3], time: f64) -> Option<[f64; 3]> {
        match self {
            Self::Wall { velocity } => Some(*velocity),
            Self::MovingWall { profile } | Self::Inlet { profile } => {
                Some(profile.moved(base, x, time))
            }
            Self::Slip | Self::Outlet { .. } | Self::ConvectiveOutlet { .. } => None,
        }
    }

    /// True when the given velocity never changes.
    pub(super) fn is_steady(&self) -> bool {
        match self {
            Self::MovingWall { profile } | Self::Inlet { profile } => profile.is_steady(),
            Self::ConvectiveOutlet { .. } => false,
            _ => true,
        }
    }

    /// True when nothing goes through, whatever the velocity says on faces that are not quite those of the wall.
    pub(super) fn is_tight(&self) -> bool {
        matches!(self, Self::MovingWall { profile } if profile.is_rotation())
    }

    /// ω \[rad/s\] of a rotating wall at a time \[s\].
    pub(crate) fn spin(&self, time: f64) -> Option<[f64; 3]> {
        match self {
            Self::MovingWall { profile } => profile.spin(time),
            _ => None,
        }
    }

    /// Which condition decides on a node of several patches: the smallest.
    pub(super) fn rank(&self) -> usize {
        match self {
            Self::Wall { velocity } if *velocity == [0.0; 3] => 0,
            Self::MovingWall { profile } if profile.is_rest() => 0,
            Self::Wall { .. } | Self::MovingWall { .. } => 1,
            Self::Inlet { .. } => 2,
            Self::ConvectiveOutlet { .. } => 3,
            Self::Slip => 4,
            Self::Outlet { .. } => 5,
        }
    }
}
