//! How a segment answers a force and a torque: the mobility of a prolate spheroid (S 2.3–2.5).

use crate::hydrodynamics::{Section, SpheroidRatio};
use crate::{Matrix3, Vector3};
use std::f64::consts::PI;

/// Velocity by force and spin by torque of one segment in creeping flow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mobility {
    /// Velocity by force along and across the axis, 1/6πμℓX^A and 1/6πμℓY^A \[m/(N·s)\].
    pub force: [f64; 2],
    /// Spin by torque about and across the axis, 1/8πμℓ³X^C and 1/8πμℓ³Y^C \[1/(N·m·s)\].
    pub torque: [f64; 2],
    /// Y^H/Y^C.
    pub strain: f64,
    /// 6πμℓ \[N·s/m\].
    pub stokes: f64,
}

impl Mobility {
    /// Of a segment of half-length ℓ \[m\] and a radius \[m\], in a fluid of a viscosity \[Pa·s\].
    pub fn new(half_length: f64, radius: f64, viscosity: f64, ratio: SpheroidRatio) -> Self {
        let functions = ratio.functions(&Section::middle(2.0 * radius, 2.0 * half_length));
        let stokes = 6.0 * PI * viscosity * half_length;
        let turning = 8.0 * PI * viscosity * half_length.powi(3);
        Self {
            force: functions.force.map(|x| 1.0 / (stokes * x)),
            torque: functions.spin.map(|x| 1.0 / (turning * x)),
            strain: functions.strain / functions.spin[1],
            stokes,
        }
    }

    /// Velocity by a force on a segment along `axis`.
    #[inline(always)]
    pub fn velocity(&self, axis: &Vector3, force: &Vector3) -> Vector3 {
        split(self.force, axis, force)
    }

    /// Spin by a torque.
    #[inline(always)]
    pub fn spin(&self, axis: &Vector3, torque: &Vector3) -> Vector3 {
        split(self.torque, axis, torque)
    }

    /// Force of the flow on a segment that slips with this velocity, and torque for slip of spin.
    pub fn drag(&self, axis: &Vector3, slip: &Vector3, slip_of_spin: &Vector3) -> [Vector3; 2] {
        [
            split(self.force.map(f64::recip), axis, slip),
            split(self.torque.map(f64::recip), axis, slip_of_spin),
        ]
    }

    /// Spin of a free segment in a flow: ½∇×u + (Y^H/Y^C) p × E·p.
    #[inline(always)]
    pub fn turned(&self, axis: &Vector3, gradient: &Matrix3) -> Vector3 {
        let strain = 0.5 * (gradient * axis + gradient.tr_mul(axis));
        vorticity(gradient) + axis.cross(&strain) * self.strain
    }
}

/// Half the curl.
#[inline(always)]
fn vorticity(g: &Matrix3) -> Vector3 {
    0.5 * Vector3::new(
        g[(2, 1)] - g[(1, 2)],
        g[(0, 2)] - g[(2, 0)],
        g[(1, 0)] - g[(0, 1)],
    )
}

#[inline(always)]
fn split([along, across]: [f64; 2], axis: &Vector3, x: &Vector3) -> Vector3 {
    x * across + axis * ((along - across) * axis.dot(x))
}
