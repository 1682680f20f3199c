//! Ambient flows given by formulae: a fibre in one of them needs no mesh.

use nalgebra::{Matrix3, Vector3};

/// A steady, divergence-free flow. Directions as in the sources: flow x, gradient y, vorticity z.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum AmbientFlow {
    /// At rest.
    #[default]
    Quiescent,
    /// The same velocity everywhere \[m/s\].
    Uniform(Vector3<f64>),
    /// Simple shear u = (γ̇ y, 0, 0).
    Shear {
        /// γ̇ \[1/s\].
        rate: f64,
    },
    /// Uniaxial extension u = ε̇ (x, −y/2, −z/2).
    Extension {
        /// ε̇ \[1/s\].
        rate: f64,
    },
    /// Planar extension u = ε̇ (x, −y, 0).
    PlanarExtension {
        /// ε̇ \[1/s\].
        rate: f64,
    },
    /// Counter-rotating cells u = U (sin kx cos ky, −cos kx sin ky, 0), k = 2π/wavelength.
    Vortex {
        /// Largest velocity U \[m/s\].
        velocity: f64,
        /// Wavelength of the cells \[m\].
        wavelength: f64,
    },
}

impl AmbientFlow {
    /// Velocity \[m/s\] and its gradient, gradient\[i\]\[j\] = ∂u_i/∂x_j \[1/s\], at a position \[m\].
    pub fn at(&self, position: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        let linear = |gradient: Matrix3<f64>| (gradient * position, gradient);
        match *self {
            Self::Quiescent => (Vector3::zeros(), Matrix3::zeros()),
            Self::Uniform(velocity) => (velocity, Matrix3::zeros()),
            Self::Shear { rate } => {
                linear(Matrix3::new(0.0, rate, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
            }
            Self::Extension { rate } => linear(Matrix3::from_diagonal(&Vector3::new(
                rate,
                -0.5 * rate,
                -0.5 * rate,
            ))),
            Self::PlanarExtension { rate } => {
                linear(Matrix3::from_diagonal(&Vector3::new(rate, -rate, 0.0)))
            }
            Self::Vortex {
                velocity,
                wavelength,
            } => {
                let k = 2.0 * std::f64::consts::PI / wavelength;
                let ((sx, cx), (sy, cy)) = ((k * position.x).sin_cos(), (k * position.y).sin_cos());
                let a = k * velocity;
                (
                    velocity * Vector3::new(sx * cy, -cx * sy, 0.0),
                    a * Matrix3::new(
                        cx * cy,
                        -sx * sy,
                        0.0,
                        sx * sy,
                        -cx * cy,
                        0.0,
                        0.0,
                        0.0,
                        0.0,
                    ),
                )
            }
        }
    }

    /// Mean over space of the velocity gradient \[1/s\]; zero for vortices, whose cells cancel.
    pub fn mean_gradient(&self) -> Matrix3<f64> {
        match self {
            Self::Vortex { .. } => Matrix3::zeros(),
            _ => self.at(&Vector3::zeros()).1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_match_finite_differences_and_are_divergence_free() {
        let flows = [
            AmbientFlow::Quiescent,
            AmbientFlow::Uniform(Vector3::new(1.0, 2.0, -3.0)),
            AmbientFlow::Shear { rate: 2.0 },
            AmbientFlow::Extension { rate: -1.5 },
            AmbientFlow::PlanarExtension { rate: 0.7 },
            AmbientFlow::Vortex {
                velocity: 1.3,
                wavelength: 2.2,
            },
        ];
        let x = Vector3::new(0.31, -0.72, 0.45);
        let h = 1e-5;
        for flow in flows {
            let (_, gradient) = flow.at(&x);
            assert!(gradient.trace().abs() < 1e-13, "{flow:?}");
            for j in 0..3 {
                let step = h * Vector3::ith(j, 1.0);
                let difference = (flow.at(&(x + step)).0 - flow.at(&(x - step)).0) / (2.0 * h);
                assert!(
                    (difference - gradient.column(j)).norm() < 1e-8,
                    "{flow:?} along {j}"
                );
            }
        }
    }

    #[test]
    fn shear_flows_along_x_and_grows_along_y() {
        let (u, _) = AmbientFlow::Shear { rate: 3.0 }.at(&Vector3::new(5.0, 2.0, 7.0));
        assert_eq!(u, Vector3::new(6.0, 0.0, 0.0));
    }
}
