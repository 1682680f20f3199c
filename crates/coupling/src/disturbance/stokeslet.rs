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
use std::sync::LazyLock;

/// α, β, α'/ρ and β'/ρ at a distance ρ.
#[derive(Clone, Copy, Debug)]
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

/// Squares of distances beyond which a Gaussian is a point and a degenerate quadrupole to round-off.
const OUTSIDE: usize = 64;
/// Pieces of the table by unit of ρ², and coefficients of each.
const PIECES: usize = 2;
const COEFFICIENTS: usize = 8;

/// α and β as polynomials of −1 ≤ t ≤ 1 on pieces of ρ², from the lowest power: 16 kB.
type Table = [[[f64; 2]; COEFFICIENTS]; PIECES * OUTSIDE];

/// Within 1e-12 of the closed forms.
static TABLE: LazyLock<Box<Table>> = LazyLock::new(|| {
    let middle = |piece: usize| (piece as f64 + 0.5) / PIECES as f64;
    let mut table = Box::new([[[0.0; 2]; COEFFICIENTS]; PIECES * OUTSIDE]);
    for (piece, coefficients) in table.iter_mut().enumerate() {
        let at = |t: f64| {
            let profile = Profile::exact(middle(piece) + 0.5 * t / PIECES as f64);
            [profile.alpha, profile.beta]
        };
        *coefficients = interpolated(at);
    }
    table
});

/// The polynomial through values at Chebyshev's points.
fn interpolated(at: impl Fn(f64) -> [f64; 2]) -> [[f64; 2]; COEFFICIENTS] {
    const N: usize = COEFFICIENTS;
    let angle = |k: usize| PI * (k as f64 + 0.5) / N as f64;
    let values: [[f64; 2]; N] = std::array::from_fn(|k| at(angle(k).cos()));
    let mut coefficients = [[0.0; 2]; N];
    // T_j as powers of t, by T_(j+1) = 2 t T_j − T_(j−1).
    let (mut before, mut power) = ([0.0; N], [0.0; N]);
    power[0] = 1.0;
    for j in 0..N {
        let share = if j == 0 { 1.0 } else { 2.0 } / N as f64;
        for c in 0..2 {
            let weighted = |k: usize| values[k][c] * (j as f64 * angle(k)).cos();
            let amount = share * (0..N).map(weighted).sum::<f64>();
            for (coefficient, p) in coefficients.iter_mut().zip(power) {
                coefficient[c] += amount * p;
            }
        }
        let mut next = before.map(|b| -b);
        for k in 1..N {
            next[k] += if j == 0 { 1.0 } else { 2.0 } * power[k - 1];
        }
        (before, power) = (power, next);
    }
    coefficients
}

impl Profile {
    fn at(square: f64, table: &Table) -> Self {
        let place = square * PIECES as f64;
        let Some(coefficients) = table.get(place as usize) else {
            return Self::outside(square);
        };
        let t = 2.0 * (place - place.floor()) - 1.0;
        let (mut value, mut slope) = ([0.0; 2], [0.0; 2]);
        for coefficient in coefficients.iter().rev() {
            for c in 0..2 {
                slope[c] = slope[c] * t + value[c];
                value[c] = value[c] * t + coefficient[c];
            }
        }
        // d/dρ by ρ is twice that by ρ².
        let by_square = 4.0 * PIECES as f64;
        Self {
            alpha: value[0],
            beta: value[1],
            alpha_slope: by_square * slope[0],
            beta_slope: by_square * slope[1],
        }
    }

    /// Where E = 1 and e = 0.
    fn outside(square: f64) -> Self {
        let i2 = 1.0 / square;
        let i = i2.sqrt();
        let i3 = i * i2;
        Self {
            alpha: i + i3,
            beta: i3 * (1.0 - 3.0 * i2),
            alpha_slope: -i3 * (1.0 + 3.0 * i2),
            beta_slope: i3 * i2 * (15.0 * i2 - 3.0),
        }
    }

    fn exact(square: f64) -> Self {
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

/// Flows of Gaussians, from a table.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stokeslets(&'static Table);

impl Stokeslets {
    pub fn new() -> Self {
        Self(&TABLE)
    }

    /// Adds the velocity at `r` from a force at the origin and its gradient, gradient\[i\]\[k\] = ∂u_i/∂x_k, by unit
    /// viscosity; `s` is the width.
    pub fn add(
        self,
        (u, gradient): (&mut Vector3<f64>, &mut Matrix3<f64>),
        r: &Vector3<f64>,
        force: &Vector3<f64>,
        s: f64,
    ) {
        let by_width = 1.0 / s;
        let x = r * by_width;
        let p = Profile::at(x.norm_squared(), self.0);
        let along = x.dot(force);
        let scale = by_width / (8.0 * PI);
        *u += force * (scale * p.alpha) + x * (scale * p.beta * along);
        let scale = scale * by_width;
        let across = force * (scale * p.alpha_slope) + x * (scale * p.beta_slope * along);
        let beta = scale * p.beta;
        for k in 0..3 {
            for i in 0..3 {
                gradient[(i, k)] += across[i] * x[k] + beta * x[i] * force[k];
            }
            gradient[(k, k)] += beta * along;
        }
    }
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

    fn flow(r: &Vector3<f64>, force: &Vector3<f64>, s: f64) -> (Vector3<f64>, Matrix3<f64>) {
        let (mut u, mut gradient) = (Vector3::zeros(), Matrix3::zeros());
        Stokeslets::new().add((&mut u, &mut gradient), r, force, s);
        (u, gradient)
    }

    fn velocity(r: &Vector3<f64>, force: &Vector3<f64>, s: f64) -> Vector3<f64> {
        flow(r, force, s).0
    }

    #[test]
    fn the_table_holds_the_closed_forms() {
        for k in 0..4000 {
            let square = 0.02 * f64::from(k) + 1e-3;
            let (found, wanted) = (Profile::at(square, &TABLE), Profile::exact(square));
            let size = 1.0 / (1.0 + square).sqrt();
            let pairs = [
                (found.alpha, wanted.alpha, size),
                (found.beta, wanted.beta, size.powi(3)),
                (found.alpha_slope, wanted.alpha_slope, size.powi(3)),
                (found.beta_slope, wanted.beta_slope, size.powi(5)),
            ];
            for (j, (a, b, size)) in pairs.into_iter().enumerate() {
                assert!((a - b).abs() < 1e-9 * size, "ρ² = {square}, {j}: {a} {b}");
            }
        }
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
