//! Flow of a force that is spread as a Gaussian, in creeping flow without boundaries.
//!
//! With the unit force F, standard deviation s, ρ = r/s, E = erf(ρ/√2), e = √(2/π) exp(−½ρ²), and unit viscosity
//!
//! ```text
//! u = [α F + β ρ (ρ·F)]/(8π s),   α = E/ρ + E/ρ³ − e/ρ²,   β = E/ρ³ − 3E/ρ⁵ + 3e/ρ⁴
//! ```
//!
//! (from u = (δ∇² − ∇∇)H F, ∇⁴H = −g; H is the mean distance to a point of the Gaussian by 8π). Beyond the Gaussian α = 1/ρ
//! and β = 1/ρ³, the Oseen tensor; at r = 0 u = F/(6π a), a = √(π/2) s.

use nalgebra::{Matrix3, Vector3};
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// α, β, α'/ρ and β'/ρ at a distance ρ.
struct Profile {
    alpha: f64,
    beta: f64,
    alpha_slope: f64,
    beta_slope: f64,
}

/// √(2/π)
const PEAK: f64 = 0.797_884_560_802_865_4;
/// Below this distance the closed forms cancel and series are summed.
const NEAR: f64 = 1.5;
const TERMS: usize = 18;

impl Profile {
    fn at(square: f64) -> Self {
        if square < NEAR * NEAR {
            Self::near(square)
        } else {
            Self::far(square.sqrt())
        }
    }

    fn far(rho: f64) -> Self {
        let (i, i2) = (1.0 / rho, 1.0 / (rho * rho));
        let big = erf(rho * FRAC_1_SQRT_2) * i;
        let e = PEAK * (-0.5 * rho * rho).exp();
        Self {
            alpha: big + (big - e) * i2,
            beta: i2 * (big + 3.0 * i2 * (e - big)),
            alpha_slope: i2 * (2.0 * e - big + 3.0 * i2 * (e - big)),
            beta_slope: i2 * i2 * (-2.0 * e - 3.0 * big + 15.0 * i2 * (big - e)),
        }
    }

    /// From e = √(2/π) Σ c_n ρ^(2n), E/ρ = √(2/π) Σ c_n ρ^(2n)/(2n + 1), c_n = (−½)ⁿ/n!.
    fn near(square: f64) -> Self {
        let mut c = [0.0; TERMS + 3];
        c[0] = PEAK;
        for n in 1..c.len() {
            c[n] = -0.5 * c[n - 1] / n as f64;
        }
        let over = |n: usize| c[n] / (2 * n + 1) as f64;
        let mut sum = [0.0; 4];
        for n in (0..TERMS).rev() {
            let alpha = |n: usize| over(n) + over(n + 1) - c[n + 1];
            let beta = |n: usize| over(n + 1) + 3.0 * (c[n + 2] - over(n + 2));
            let double = 2.0 * (n + 1) as f64;
            let terms = [
                alpha(n),
                beta(n),
                double * alpha(n + 1),
                double * beta(n + 1),
            ];
            for (sum, term) in sum.iter_mut().zip(terms) {
                *sum = *sum * square + term;
            }
        }
        let [alpha, beta, alpha_slope, beta_slope] = sum;
        Self {
            alpha,
            beta,
            alpha_slope,
            beta_slope,
        }
    }
}

/// Velocity at `r` from a force at the origin and its gradient, gradient\[i\]\[k\] = ∂u_i/∂x_k, by unit viscosity.
pub(super) fn flow(r: &Vector3<f64>, force: &Vector3<f64>, s: f64) -> (Vector3<f64>, Matrix3<f64>) {
    let x = r / s;
    let p = Profile::at(x.norm_squared());
    let along = x.dot(force);
    let u = (p.alpha * force + p.beta * along * x) / (8.0 * PI * s);
    let gradient = p.alpha_slope * force * x.transpose()
        + p.beta_slope * along * x * x.transpose()
        + p.beta * (Matrix3::from_diagonal_element(along) + x * force.transpose());
    (u, gradient / (8.0 * PI * s * s))
}

/// Error function to round-off for positive arguments.
fn erf(x: f64) -> f64 {
    if x > 6.0 {
        return 1.0;
    }
    if x < 2.0 {
        // 2/√π exp(−x²) Σ 2ⁿ x^(2n+1)/(2n+1)!!
        let (mut term, mut sum, mut n) = (x, x, 1.0);
        while term > 1e-17 * sum {
            term *= 2.0 * x * x / (2.0 * n + 1.0);
            sum += term;
            n += 1.0;
        }
        return 2.0 / PI.sqrt() * (-x * x).exp() * sum;
    }
    // Continued fraction of erfc, from its tail.
    let tail = (1..=60).rev().fold(x, |t, k| x + 0.5 * f64::from(k) / t);
    1.0 - (-x * x).exp() / (PI.sqrt() * tail)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn velocity(r: &Vector3<f64>, force: &Vector3<f64>, s: f64) -> Vector3<f64> {
        flow(r, force, s).0
    }

    #[test]
    fn the_error_function_has_its_tabulated_values() {
        for (x, value) in [
            (0.5, 0.520_499_877_813_046_5),
            (1.0, 0.842_700_792_949_714_9),
            (2.0, 0.995_322_265_018_952_7),
            (3.0, 0.999_977_909_503_001_4),
        ] {
            assert!((erf(x) - value).abs() < 1e-14, "{x}: {}", erf(x));
        }
        let step = erf(2.0) - erf(2.0 - 1e-9);
        assert!(step.abs() < 1e-10, "the two forms meet: {step}");
    }

    /// Far away the Oseen tensor, in the middle the mobility of a sphere of radius √(π/2) s.
    #[test]
    fn the_stokeslet_has_its_limits() {
        let force = Vector3::new(1.0, -2.0, 0.5);
        let middle = velocity(&Vector3::zeros(), &force, 0.3);
        let radius = 0.3 * (PI / 2.0).sqrt();
        assert!((middle - force / (6.0 * PI * radius)).norm() < 1e-14);
        let r = Vector3::new(2.0, 1.0, -3.0);
        let oseen = (force + r * r.dot(&force) / r.norm_squared()) / (8.0 * PI * r.norm());
        // What is left is the degenerate quadrupole, (s/r)².
        assert!((velocity(&r, &force, 0.3) - oseen).norm() < 1e-2 * oseen.norm());
        assert!((velocity(&r, &force, 0.003) - oseen).norm() < 1e-6 * oseen.norm());
        for s in [0.3, 2.0] {
            let (_, gradient) = flow(&r, &force, s);
            assert!(gradient.trace().abs() < 1e-13, "free of divergence");
            for k in 0..3 {
                let h = 1e-5 * Vector3::ith(k, 1.0);
                let slope = (velocity(&(r + h), &force, s) - velocity(&(r - h), &force, s)) / 2e-5;
                assert!((gradient.column(k) - slope).norm() < 1e-8, "{k}");
            }
        }
    }

    #[test]
    fn series_and_closed_forms_meet() {
        let (a, b) = (Profile::near(2.25), Profile::far(1.5));
        let pairs = [
            (a.alpha, b.alpha),
            (a.beta, b.beta),
            (a.alpha_slope, b.alpha_slope),
            (a.beta_slope, b.beta_slope),
        ];
        for (k, (x, y)) in pairs.into_iter().enumerate() {
            assert!((x - y).abs() < 1e-11, "{k}: {x} {y}");
        }
    }
}
