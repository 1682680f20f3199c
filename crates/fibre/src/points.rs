//! What passes between fibres and flow at the hydrodynamic points (Gauss points of the segments).

use nalgebra::{Matrix3, Vector3};

/// The flow at the hydrodynamic points, in the order of the points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ambient {
    /// Velocity u \[m/s\].
    pub velocity: Vec<Vector3<f64>>,
    /// gradient\[i\]\[j\] = ∂u_i/∂x_j \[1/s\].
    pub gradient: Vec<Matrix3<f64>>,
}

/// What the fibres do to the flow at the hydrodynamic points, mean over the step: minus what they took.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reaction {
    /// Force on the fluid \[N\].
    pub force: Vec<Vector3<f64>>,
    /// Torque on the fluid about the point \[N·m\].
    pub torque: Vec<Vector3<f64>>,
}
