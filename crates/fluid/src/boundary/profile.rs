//! Velocity over a patch: shapes, rotation, change in time.

use super::Signal;
use crate::settings::length;
use std::fmt;
use std::sync::Arc;

/// Velocity over an inlet or a wall.
#[derive(Clone)]
pub enum VelocityProfile {
    /// The same everywhere \[m/s\].
    Uniform([f64; 3]),
    /// As a function of position \[m\], in m/s.
    Function(Arc<dyn Fn([f64; 3]) -> [f64; 3] + Send + Sync>),
    /// As a function of position \[m\] and time \[s\], in m/s.
    Unsteady(Arc<dyn Fn([f64; 3], f64) -> [f64; 3] + Send + Sync>),
    /// Rigid rotation ω × (x − x₀): nothing goes through, whatever the faces of the mesh say.
    Rotation {
        /// x₀ \[m\], a point of the axis.
        point: [f64; 3],
        /// ω \[rad/s\].
        angular_velocity: [f64; 3],
    },
    /// A profile times a number that changes in time.
    Scaled {
        /// What is scaled.
        shape: Box<VelocityProfile>,
        /// By what.
        factor: Signal,
    },
}

impl VelocityProfile {
    /// Plane Poiseuille profile 6 ū s(1 − s), s = (x_axis − low)/(high − low), of mean velocity ū \[m/s\].
    pub fn parabolic(mean: [f64; 3], axis: usize, low: f64, high: f64) -> Self {
        Self::Function(Arc::new(move |x| {
            let s = (x[axis] - low) / (high - low);
            mean.map(|m| 6.0 * m * s * (1.0 - s))
        }))
    }

    /// This profile times a number that changes in time.
    #[must_use]
    pub fn scaled(self, factor: Signal) -> Self {
        Self::Scaled {
            shape: Box::new(self),
            factor,
        }
    }

    /// Velocity at a point \[m\] and time \[s\].
    pub fn velocity(&self, x: [f64; 3], time: f64) -> [f64; 3] {
        self.moved(self.shape(x), x, time)
    }

    /// The part that does not change in time, to be found once for each node.
    pub(super) fn shape(&self, x: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Uniform(velocity) => *velocity,
            Self::Function(function) => function(x),
            Self::Unsteady(_) => [0.0; 3],
            Self::Rotation {
                point,
                angular_velocity: [p, q, r],
            } => {
                let [x, y, z] = [0, 1, 2].map(|c| x[c] - point[c]);
                [q * z - r * y, r * x - p * z, p * y - q * x]
            }
            Self::Scaled { shape, .. } => shape.shape(x),
        }
    }

    /// Velocity at a time, from [`VelocityProfile::shape`].
    pub(super) fn moved(&self, base: [f64; 3], x: [f64; 3], time: f64) -> [f64; 3] {
        match self {
            Self::Unsteady(function) => function(x, time),
            Self::Scaled { shape, factor } => {
                let factor = factor.at(time);
                shape.moved(base, x, time).map(|u| factor * u)
            }
            _ => base,
        }
    }

    /// True when it never changes.
    pub fn is_steady(&self) -> bool {
        match self {
            Self::Unsteady(_) => false,
            Self::Scaled { shape, factor } => shape.is_steady() && factor.is_constant(),
            _ => true,
        }
    }

    /// True for a body of revolution that turns about its axis.
    pub(super) fn is_rotation(&self) -> bool {
        match self {
            Self::Rotation { .. } => true,
            Self::Scaled { shape, .. } => shape.is_rotation(),
            _ => false,
        }
    }

    /// ω \[rad/s\] of a rotation at a time \[s\].
    pub(super) fn spin(&self, time: f64) -> Option<[f64; 3]> {
        match self {
            Self::Rotation {
                angular_velocity, ..
            } => Some(*angular_velocity),
            Self::Scaled { shape, factor } => {
                let factor = factor.at(time);
                shape.spin(time).map(|omega| omega.map(|w| factor * w))
            }
            _ => None,
        }
    }

    /// True when it is zero at any time.
    pub(super) fn is_rest(&self) -> bool {
        match self {
            Self::Uniform(velocity) => length(*velocity) == 0.0,
            Self::Scaled { shape, .. } => shape.is_rest(),
            _ => false,
        }
    }
}

impl fmt::Debug for VelocityProfile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Uniform(velocity) => write!(f, "Uniform({velocity:?})"),
            Self::Function(_) => f.write_str("Function"),
            Self::Unsteady(_) => f.write_str("Unsteady"),
            Self::Rotation {
                point,
                angular_velocity,
            } => write!(f, "Rotation({angular_velocity:?} about {point:?})"),
            Self::Scaled { shape, factor } => write!(f, "{shape:?} × {factor:?}"),
        }
    }
}
