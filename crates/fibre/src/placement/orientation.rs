//! Distributions of directions, and directions drawn from them.

use super::PlacementError;
use super::error::check;
use crate::{Matrix3, Vector3};
use std::f64::consts::TAU;

/// Distribution of the fibres' directions p.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Orientation {
    /// All directions alike.
    Isotropic,
    /// All fibres along one direction, turned at random about it.
    Aligned(Vector3),
    /// Directions at random in the plane with this normal; curved fibres lie in the plane.
    InPlane(Vector3),
    /// On Jeffery's orbits in simple shear, with phases as time passes on them.
    Jeffery {
        /// Aspect ratio r of the spheroid that turns as a fibre does.
        aspect_ratio: f64,
        /// Direction of the flow.
        flow: Vector3,
        /// Direction of the velocity gradient.
        gradient: Vector3,
        /// Which orbits.
        orbits: Orbits,
    },
    /// Angular central Gaussian distribution (Tyler 1987) with this ⟨pp⟩: symmetric, trace one. Eigenvalues below
    /// 1e-4 are taken as 1e-4.
    Tensor(Matrix3),
}

/// Distribution of the orbit constant C = tan θ √(cos²φ + sin²φ/r²), θ from the vorticity, φ from the gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Orbits {
    /// Those of fibres that were isotropic when the shear began: their average over long times.
    FromIsotropic,
    /// The steady state of slender fibres under weak rotary diffusion, f(C) = 4C (4C² + 1)^−³ᐟ² (Leal & Hinch 1971).
    WeakDiffusion,
    /// One orbit.
    Constant(f64),
}

/// Smallest eigenvalue of ⟨pp⟩.
const FLATTEST: f64 = 1e-4;

/// Maps three numbers in \[0, 1) to a direction.
#[derive(Clone, Copy, Debug)]
pub(super) enum Sampler {
    Isotropic,
    Aligned(Vector3),
    InPlane(Vector3),
    Jeffery {
        aspect_ratio: f64,
        /// Columns: flow, gradient, vorticity.
        axes: Matrix3,
        orbits: Orbits,
    },
    /// B in p = Bx/|Bx|, x isotropic.
    Gaussian {
        spread: Matrix3,
        target: Matrix3,
    },
}

impl Sampler {
    pub fn new(orientation: &Orientation) -> Result<Self, PlacementError> {
        let unit = |name, v: &Vector3| {
            let length = v.norm();
            let usable = length > 0.0 && length.is_finite();
            usable
                .then(|| v / length)
                .ok_or(PlacementError::Direction(name))
        };
        Ok(match orientation {
            Orientation::Isotropic => Self::Isotropic,
            Orientation::Aligned(v) => Self::Aligned(unit("aligned orientation", v)?),
            Orientation::InPlane(v) => {
                Self::InPlane(unit("normal of the plane of orientations", v)?)
            }
            Orientation::Jeffery {
                aspect_ratio,
                flow,
                gradient,
                orbits,
            } => {
                let name = "aspect ratio of the orbits";
                check(*aspect_ratio > 0.0, name, *aspect_ratio, "positive")?;
                if let Orbits::Constant(c) = orbits {
                    check(*c >= 0.0, "orbit constant", *c, "zero or positive")?;
                }
                let flow = unit("flow of the orbits", flow)?;
                let across = gradient - flow * flow.dot(gradient);
                let gradient = unit("gradient of the orbits across the flow", &across)?;
                Self::Jeffery {
                    aspect_ratio: *aspect_ratio,
                    axes: Matrix3::from_columns(&[flow, gradient, flow.cross(&gradient)]),
                    orbits: *orbits,
                }
            }
            Orientation::Tensor(target) => gaussian(target)?,
        })
    }

    pub fn direction(&self, [u, v, w]: [f64; 3]) -> Vector3 {
        match self {
            Self::Isotropic => isotropic(u, v),
            Self::Aligned(direction) => *direction,
            Self::InPlane(normal) => around(normal, TAU * v),
            Self::Jeffery {
                aspect_ratio,
                axes,
                orbits,
            } => {
                let constant = match orbits {
                    Orbits::FromIsotropic => orbit_constant(&isotropic(u, v), *aspect_ratio),
                    Orbits::WeakDiffusion => 0.5 * ((1.0 - u).powi(-2) - 1.0).sqrt(),
                    Orbits::Constant(c) => *c,
                };
                axes * on_orbit(constant, *aspect_ratio, TAU * w)
            }
            Self::Gaussian { spread, .. } => (spread * isotropic(u, v)).normalize(),
        }
    }

    /// ⟨pp⟩ of the distribution.
    pub fn target(&self) -> Matrix3 {
        match self {
            Self::Isotropic => Matrix3::from_diagonal_element(1.0 / 3.0),
            Self::Aligned(p) => p * p.transpose(),
            Self::InPlane(n) => 0.5 * (Matrix3::identity() - n * n.transpose()),
            Self::Gaussian { target, .. } => *target,
            Self::Jeffery { .. } => {
                let samples = 1 << 14;
                let one = |k: usize| {
                    let p = self.direction(sequence(k, [0.5; 3]));
                    p * p.transpose()
                };
                (0..samples).map(one).sum::<Matrix3>() / f64::from(samples as u32)
            }
        }
    }
}

fn isotropic(u: f64, v: f64) -> Vector3 {
    let (z, azimuth) = (1.0 - 2.0 * u, TAU * v);
    let sine = (1.0 - z * z).max(0.0).sqrt();
    Vector3::new(sine * azimuth.cos(), sine * azimuth.sin(), z)
}

/// The unit vector at `angle` in the plane across `axis`.
pub(super) fn around(axis: &Vector3, angle: f64) -> Vector3 {
    let first = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
    first * angle.cos() + axis.cross(&first) * angle.sin()
}

/// C of a direction with components along flow, gradient and vorticity; infinite in the plane of shear.
pub fn orbit_constant(p: &Vector3, aspect_ratio: f64) -> f64 {
    // tan θ cos φ = p_y/p_z, tan θ sin φ = p_x/p_z
    (p.y * p.y + (p.x / aspect_ratio).powi(2)).sqrt() / p.z.abs()
}

/// Jeffery 1922: tan φ = r tan τ, tan θ = C r/√(r² cos²φ + sin²φ), with τ growing evenly in time.
fn on_orbit(constant: f64, aspect_ratio: f64, phase: f64) -> Vector3 {
    let (sine, cosine) = phase.sin_cos();
    // p_x : p_y : p_z = C r sin τ : C cos τ : 1
    if constant.is_infinite() {
        return Vector3::new(aspect_ratio * sine, cosine, 0.0).normalize();
    }
    Vector3::new(constant * aspect_ratio * sine, constant * cosine, 1.0).normalize()
}

/// Point k of an additive sequence that fills the unit cube evenly (powers of the root of g⁴ = g + 1), shifted.
pub(super) fn sequence(k: usize, shift: [f64; 3]) -> [f64; 3] {
    const STEPS: [f64; 3] = [
        0.819_172_513_396_164_4,
        0.671_043_606_703_789_2,
        0.549_700_477_901_970_3,
    ];
    [0, 1, 2].map(|d| (shift[d] + STEPS[d] * k as f64).fract())
}

fn gaussian(target: &Matrix3) -> Result<Sampler, PlacementError> {
    let refused = |reason| PlacementError::Tensor { reason };
    if (target - target.transpose()).amax() > 1e-9 || !target.amax().is_finite() {
        return Err(refused("it is not symmetric"));
    }
    if (target.trace() - 1.0).abs() > 1e-6 {
        return Err(refused("its trace is not 1"));
    }
    let system = target.symmetric_eigen();
    if system.eigenvalues.min() < -1e-9 {
        return Err(refused("it has a negative eigenvalue"));
    }
    let wanted = system.eigenvalues.map(|a| a.max(FLATTEST));
    let wanted = wanted / wanted.sum();
    let mut variances = wanted;
    // The maximum-likelihood iteration of Tyler 1987 with exact moments; it converges from anywhere.
    for _ in 0..10_000 {
        let moments = moments(&variances);
        let next = variances.component_mul(&wanted.component_div(&moments));
        let next = next / next.sum();
        let settled = (next - variances).component_div(&variances).amax() < 1e-10;
        variances = next;
        if settled {
            break;
        }
    }
    let spread = system.eigenvectors * Matrix3::from_diagonal(&variances.map(f64::sqrt));
    Ok(Sampler::Gaussian {
        spread,
        target: *target,
    })
}

/// ⟨p_i²⟩ of the angular central Gaussian distribution with these variances:
/// ⅓ R_D(1/b_j, 1/b_k, 1/b_i)/√(b₁b₂b₃).
fn moments(b: &Vector3) -> Vector3 {
    let inverse = b.map(f64::recip);
    let scale = 1.0 / (3.0 * b.product().sqrt());
    Vector3::from_fn(|i, _| scale * carlson(inverse[(i + 1) % 3], inverse[(i + 2) % 3], inverse[i]))
}

/// Elliptic integral R_D(x, y, z) = 3/2 ∫₀^∞ dt/(√((t + x)(t + y)) (t + z)^³ᐟ²), by duplication (Carlson 1979).
fn carlson(mut x: f64, mut y: f64, mut z: f64) -> f64 {
    let (mut sum, mut power) = (0.0, 1.0);
    loop {
        let mean = (x + y + 3.0 * z) / 5.0;
        let (dx, dy, dz) = ((mean - x) / mean, (mean - y) / mean, (mean - z) / mean);
        if dx.abs().max(dy.abs()).max(dz.abs()) < 1e-3 {
            let (ea, eb) = (dx * dy, dz * dz);
            let (ec, ed, ee) = (ea - eb, ea - 6.0 * eb, 3.0 * ea - 8.0 * eb);
            let series = 1.0 - ed * (3.0 / 14.0) + ed * ed * (9.0 / 88.0) + dz * ee / 6.0
                - dz * ed * ee * (9.0 / 52.0)
                + dz * dz * (-ec * (9.0 / 22.0) + dz * ea * (3.0 / 26.0));
            return 3.0 * sum + power * series / (mean * mean.sqrt());
        }
        let (rx, ry, rz) = (x.sqrt(), y.sqrt(), z.sqrt());
        let lambda = rx * (ry + rz) + ry * rz;
        sum += power / (rz * (z + lambda));
        power *= 0.25;
        (x, y, z) = (
            0.25 * (x + lambda),
            0.25 * (y + lambda),
            0.25 * (z + lambda),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampled(sampler: &Sampler, count: usize) -> Matrix3 {
        let one = |k: usize| {
            let p = sampler.direction(sequence(k, [0.3, 0.1, 0.7]));
            assert!((p.norm() - 1.0).abs() < 1e-12);
            p * p.transpose()
        };
        (0..count).map(one).sum::<Matrix3>() / count as f64
    }

    #[test]
    fn every_distribution_has_the_moments_it_states() {
        let turn = nalgebra::Rotation3::new(Vector3::new(0.3, -0.8, 0.5));
        let tensor = |a: [f64; 3]| {
            let a = Matrix3::from_diagonal(&Vector3::from(a));
            Orientation::Tensor(turn.matrix() * a * turn.matrix().transpose())
        };
        let jeffery = |orbits| Orientation::Jeffery {
            aspect_ratio: 12.0,
            flow: Vector3::x() * 2.0,
            gradient: Vector3::new(0.4, 0.0, 1.0),
            orbits,
        };
        for orientation in [
            Orientation::Isotropic,
            Orientation::Aligned(Vector3::new(3.0, 0.0, 4.0)),
            Orientation::InPlane(Vector3::new(0.0, 1.0, 2.0)),
            tensor([0.6, 0.3, 0.1]),
            tensor([0.5, 0.4999, 0.0001]),
            tensor([0.9, 0.08, 0.02]),
            jeffery(Orbits::FromIsotropic),
            jeffery(Orbits::WeakDiffusion),
            jeffery(Orbits::Constant(0.7)),
        ] {
            let sampler = Sampler::new(&orientation).expect("usable");
            let error = (sampled(&sampler, 4000) - sampler.target()).amax();
            assert!(error < 4e-3, "{orientation:?}: {error}");
        }
    }

    /// Between flips a fibre of r = 12 points along the flow: time averages in the plane of shear are those of
    /// tan φ = r tan τ, ⟨p_x²⟩ = r/(r + 1).
    #[test]
    fn a_tumbling_fibre_has_jefferys_average() {
        let orientation = Orientation::Jeffery {
            aspect_ratio: 12.0,
            flow: Vector3::x(),
            gradient: Vector3::y(),
            orbits: Orbits::Constant(1e12),
        };
        let a = Sampler::new(&orientation).expect("usable").target();
        assert!((a[(0, 0)] - 12.0 / 13.0).abs() < 1e-3, "{a}");
        assert!(a[(0, 1)].abs() < 1e-3 && a[(2, 2)] < 1e-12);
    }

    #[test]
    fn orbit_constants_are_those_asked_for() {
        for constant in [0.0, 0.2, 3.0] {
            for k in 0..50 {
                let p = on_orbit(constant, 12.0, 0.17 * f64::from(k));
                assert!((orbit_constant(&p, 12.0) - constant).abs() < 1e-12);
            }
        }
    }

    /// R_D against the elementary cases R_D(z, z, z) = z^−³ᐟ² and R_D(0, 2, 1) (Carlson & Notis 1981).
    #[test]
    fn carlsons_integral_is_right() {
        assert!((carlson(4.0, 4.0, 4.0) - 0.125).abs() < 1e-14);
        assert!((carlson(0.0, 2.0, 1.0) - 1.797_210_352_103_388_3).abs() < 1e-12);
    }

    #[test]
    fn impossible_tensors_are_refused() {
        let refused = |a: Matrix3| {
            let error = Sampler::new(&Orientation::Tensor(a)).expect_err("refused");
            error.to_string()
        };
        assert!(refused(Matrix3::identity()).contains("trace"));
        let mut a = Matrix3::from_diagonal_element(1.0 / 3.0);
        a[(0, 1)] = 0.1;
        assert!(refused(a).contains("symmetric"));
        let a = Matrix3::from_diagonal(&Vector3::new(1.2, 0.0, -0.2));
        assert!(refused(a).contains("negative"));
    }
}
