//! Initial velocity fields as functions of position, the same on any mesh and any number of ranks.
//!
//! [`crate::Fluid::set_velocity`] takes any of them and projects it.

mod isotropic;
pub use isotropic::Isotropic;

use crate::settings::cross;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{PI, TAU};

/// The same velocity everywhere.
pub fn uniform(velocity: [f64; 3]) -> impl Fn([f64; 3]) -> [f64; 3] {
    move |_| velocity
}

/// Plane Poiseuille flow 6 ū s(1 − s), s = (x_axis − low)/(high − low), of mean velocity ū \[m/s\].
pub fn poiseuille(
    mean: [f64; 3],
    axis: usize,
    low: f64,
    high: f64,
) -> impl Fn([f64; 3]) -> [f64; 3] {
    move |x| {
        let s = (x[axis] - low) / (high - low);
        mean.map(|m| 6.0 * m * s * (1.0 - s))
    }
}

/// Exact two-dimensional Taylor–Green vortices of wave number k, carried by a drift (U, V):
/// u = U + A sin(kξ) cos(kη) e, v = V − A cos(kξ) sin(kη) e, with ξ = x − Ut, η = y − Vt, e = exp(−2νk²t).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaylorGreen {
    /// A \[m/s\].
    pub amplitude: f64,
    /// k \[1/m\].
    pub wave_number: f64,
    /// (U, V) \[m/s\].
    pub drift: [f64; 2],
    /// ν \[m²/s\].
    pub kinematic_viscosity: f64,
}

impl TaylorGreen {
    /// Velocity \[m/s\] at a time \[s\] and point \[m\].
    pub fn velocity(&self, time: f64, x: [f64; 3]) -> [f64; 3] {
        let a = self.amplitude * self.decay(time);
        let [xi, eta] = self.phase(time, x);
        [
            self.drift[0] + a * xi.sin() * eta.cos(),
            self.drift[1] - a * xi.cos() * eta.sin(),
            0.0,
        ]
    }

    /// Kinematic pressure p/ρ \[m²/s²\]: ¼ A² e² (cos 2kξ + cos 2kη).
    pub fn pressure(&self, time: f64, x: [f64; 3]) -> f64 {
        let a = self.amplitude * self.decay(time);
        let [xi, eta] = self.phase(time, x);
        0.25 * a * a * ((2.0 * xi).cos() + (2.0 * eta).cos())
    }

    fn decay(&self, time: f64) -> f64 {
        (-2.0 * self.kinematic_viscosity * self.wave_number.powi(2) * time).exp()
    }

    fn phase(&self, time: f64, x: [f64; 3]) -> [f64; 2] {
        std::array::from_fn(|c| self.wave_number * (x[c] - self.drift[c] * time))
    }
}

/// Mean profile of a channel start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeanProfile {
    /// Parabola 3/2 ū (1 − η²).
    Laminar,
    /// Seventh-root law 8/7 ū (1 − |η|)^(1/7).
    Turbulent,
}

/// A channel between two planes, its mean flow disturbed by random solenoidal eddies that vanish at the walls.
#[derive(Clone, Debug, PartialEq)]
pub struct PerturbedChannel {
    /// Corner of the box with the smallest coordinates \[m\].
    pub origin: [f64; 3],
    /// Edge lengths of the box \[m\]; the disturbance has them as periods.
    pub size: [f64; 3],
    /// Direction of the flow, 0 to 2.
    pub stream: usize,
    /// Direction across the channel, 0 to 2.
    pub across: usize,
    /// ū \[m/s\].
    pub mean: f64,
    /// Shape of the mean flow.
    pub profile: MeanProfile,
    /// Root mean square of the disturbance in the middle of the channel, relative to ū.
    pub intensity: f64,
    /// Seed of the disturbance.
    pub seed: u64,
}

impl PerturbedChannel {
    /// The velocity field: mean along `stream` plus ∇ × ((1 − η²)² Ψ), Ψ a random sum of waves.
    pub fn field(&self) -> impl Fn([f64; 3]) -> [f64; 3] + use<> {
        let channel = self.clone();
        let potential = Waves::random(self.size, 3, self.seed);
        // Waves of unit mean square each; the curl of one multiplies it by |k|.
        let scale = self.intensity * self.mean / potential.curl_intensity();
        move |x| {
            let half = 0.5 * channel.size[channel.across];
            let middle = channel.origin[channel.across] + half;
            let eta = ((x[channel.across] - middle) / half).clamp(-1.0, 1.0);
            let relative = std::array::from_fn(|c| x[c] - channel.origin[c]);
            let mut slope = [0.0; 3];
            slope[channel.across] = -4.0 * eta * (1.0 - eta * eta) / half;
            let mut u = potential.inside(relative, (1.0 - eta * eta).powi(2), slope);
            u = u.map(|u| scale * u);
            u[channel.stream] += channel.mean
                * match channel.profile {
                    MeanProfile::Laminar => 1.5 * (1.0 - eta * eta),
                    MeanProfile::Turbulent => 8.0 / 7.0 * (1.0 - eta.abs()).powf(1.0 / 7.0),
                };
            u
        }
    }
}

/// A circular pipe along an axis, its mean flow disturbed by random solenoidal eddies that vanish at the wall.
#[derive(Clone, Debug, PartialEq)]
pub struct PerturbedPipe {
    /// Centre of the section with the smallest coordinate along the axis \[m\].
    pub origin: [f64; 3],
    /// Direction of the axis, 0 to 2.
    pub stream: usize,
    /// R \[m\].
    pub radius: f64,
    /// Length \[m\]; the disturbance has it as period.
    pub length: f64,
    /// Mean velocity ū \[m/s\].
    pub mean: f64,
    /// Shape of the mean flow: 2 ū (1 − s²) or 60/49 ū (1 − s)^(1/7), s = r/R.
    pub profile: MeanProfile,
    /// Root mean square of the disturbance on the axis, relative to ū.
    pub intensity: f64,
    /// Seed of the disturbance.
    pub seed: u64,
}

impl PerturbedPipe {
    /// The velocity field: mean along `stream` plus ∇ × ((1 − s²)² Ψ), Ψ a random sum of waves.
    pub fn field(&self) -> impl Fn([f64; 3]) -> [f64; 3] + use<> {
        let pipe = self.clone();
        let mut size = [2.0 * pipe.radius; 3];
        size[pipe.stream] = pipe.length;
        let potential = Waves::random(size, 3, self.seed);
        let scale = self.intensity * self.mean / potential.curl_intensity();
        move |x| {
            let relative: [f64; 3] = std::array::from_fn(|c| x[c] - pipe.origin[c]);
            let mut across = relative.map(|r| r / pipe.radius);
            across[pipe.stream] = 0.0;
            let square = across.iter().map(|s| s * s).sum::<f64>().min(1.0);
            let slope = across.map(|s| -4.0 * s * (1.0 - square) / pipe.radius);
            let mut u = potential.inside(relative, (1.0 - square).powi(2), slope);
            u = u.map(|u| scale * u);
            u[pipe.stream] += pipe.mean
                * match pipe.profile {
                    MeanProfile::Laminar => 2.0 * (1.0 - square),
                    MeanProfile::Turbulent => 60.0 / 49.0 * (1.0 - square.sqrt()).powf(1.0 / 7.0),
                };
            u
        }
    }
}

/// Random solenoidal field of a periodic box: curl of a random sum of waves with wave vectors up to `waves` periods
/// in each direction, scaled to a root mean square velocity of `intensity` \[m/s\].
pub fn random_solenoidal(
    size: [f64; 3],
    waves: i32,
    intensity: f64,
    seed: u64,
) -> impl Fn([f64; 3]) -> [f64; 3] {
    let potential = Waves::random(size, waves, seed);
    let scale = intensity / potential.curl_intensity();
    move |x| potential.value_and_curl(x).1.map(|u| scale * u)
}

/// Ψ = Σ a cos(k·x + θ).
struct Waves {
    waves: Vec<Wave>,
}

struct Wave {
    amplitude: [f64; 3],
    vector: [f64; 3],
    phase: f64,
}

impl Waves {
    /// One wave for every wave vector of the upper half space with components up to `largest` periods; amplitudes are
    /// random, and the curls of all waves are of similar size.
    fn random(size: [f64; 3], largest: i32, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut waves = Vec::new();
        let range = || -largest..=largest;
        for (l, m, n) in
            range().flat_map(|l| range().flat_map(move |m| range().map(move |n| (l, m, n))))
        {
            if (l, m, n) <= (0, 0, 0) || l * l + m * m + n * n > largest * largest {
                continue;
            }
            let counts = [l, m, n];
            let vector: [f64; 3] = std::array::from_fn(|c| TAU * f64::from(counts[c]) / size[c]);
            let size = magnitude(vector);
            let amplitude = std::array::from_fn(|_| (2.0 * random.random::<f64>() - 1.0) / size);
            waves.push(Wave {
                amplitude,
                vector,
                phase: 2.0 * PI * random.random::<f64>(),
            });
        }
        Self { waves }
    }

    /// Root mean square of ∇ × Ψ.
    fn curl_intensity(&self) -> f64 {
        let square = |w: &Wave| 0.5 * magnitude(cross(w.vector, w.amplitude)).powi(2);
        self.waves.iter().map(square).sum::<f64>().sqrt()
    }

    /// ∇ × (eΨ) with an envelope e of the given value and gradient there.
    fn inside(&self, x: [f64; 3], envelope: f64, slope: [f64; 3]) -> [f64; 3] {
        let (psi, curl) = self.value_and_curl(x);
        let turned = cross(slope, psi);
        std::array::from_fn(|c| envelope * curl[c] + turned[c])
    }

    fn value_and_curl(&self, x: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        let (mut value, mut curl) = ([0.0; 3], [0.0; 3]);
        for wave in &self.waves {
            let k = wave.vector;
            let (sin, cos) = (k[0] * x[0] + k[1] * x[1] + k[2] * x[2] + wave.phase).sin_cos();
            let turned = cross(k, wave.amplitude);
            for c in 0..3 {
                value[c] += cos * wave.amplitude[c];
                curl[c] -= sin * turned[c];
            }
        }
        (value, curl)
    }
}

fn magnitude(v: [f64; 3]) -> f64 {
    crate::settings::length(v)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn divergence(u: &impl Fn([f64; 3]) -> [f64; 3], x: [f64; 3]) -> f64 {
        let h = 1e-5;
        (0..3)
            .map(|c| {
                let (mut low, mut high) = (x, x);
                low[c] -= h;
                high[c] += h;
                (u(high)[c] - u(low)[c]) / (2.0 * h)
            })
            .sum()
    }

    #[test]
    fn random_fields_are_solenoidal_and_of_the_wanted_size() {
        let u = random_solenoidal([2.0, 1.0, 1.5], 3, 0.7, 5);
        let n = 12;
        let mut square = 0.0;
        for i in 0..n {
            for j in 0..n {
                for k in 0..n {
                    let x = [i as f64 * 2.0, j as f64, k as f64 * 1.5].map(|x| x / n as f64);
                    assert!(divergence(&u, x).abs() < 1e-7);
                    square += u(x).iter().map(|v| v * v).sum::<f64>();
                }
            }
        }
        assert!(((square / f64::from(n).powi(3)).sqrt() - 0.7).abs() < 1e-12);
    }

    #[test]
    fn channel_disturbance_is_solenoidal_and_keeps_the_walls() {
        for profile in [MeanProfile::Laminar, MeanProfile::Turbulent] {
            let channel = PerturbedChannel {
                origin: [0.0, -1.0, 0.0],
                size: [4.0, 2.0, 2.0],
                stream: 0,
                across: 1,
                mean: 1.0,
                profile,
                intensity: 0.2,
                seed: 1,
            };
            let u = channel.field();
            for y in [-1.0, 1.0] {
                assert!(u([0.3, y, 0.7]).iter().all(|v| v.abs() < 1e-12));
            }
            assert!(divergence(&u, [0.4, 0.3, 0.9]).abs() < 1e-7);
            let other = PerturbedChannel { seed: 2, ..channel };
            assert_ne!(u([0.4, 0.3, 0.9]), other.field()([0.4, 0.3, 0.9]));
        }
    }

    #[test]
    fn pipe_disturbance_is_solenoidal_and_keeps_the_wall_and_the_flow_rate() {
        for (profile, stream) in [(MeanProfile::Laminar, 0), (MeanProfile::Turbulent, 2)] {
            let pipe = PerturbedPipe {
                origin: [0.5, -1.0, 2.0],
                stream,
                radius: 0.7,
                length: 3.0,
                mean: 1.2,
                profile,
                intensity: 0.2,
                seed: 1,
            };
            let u = pipe.field();
            let at = |along: f64, r: f64, angle: f64| {
                let mut x = pipe.origin;
                x[stream] += along;
                x[(stream + 1) % 3] += r * angle.cos();
                x[(stream + 2) % 3] += r * angle.sin();
                x
            };
            for k in 0..8 {
                let wall = u(at(0.4, 0.7, f64::from(k)));
                // The seventh root of round-off is a hundredth.
                assert!(wall.iter().all(|v| v.abs() < 0.03), "{wall:?}");
                let x = at(0.4, 0.1 + 0.05 * f64::from(k), f64::from(k));
                assert!(divergence(&u, x).abs() < 1e-7);
                let mut next = x;
                next[stream] += 3.0;
                assert!((0..3).all(|c| (u(next)[c] - u(x)[c]).abs() < 1e-12));
            }
            let calm = PerturbedPipe {
                intensity: 0.0,
                ..pipe.clone()
            };
            let (calm, n) = (calm.field(), 4000);
            let ring = |k: i32| {
                let s = (f64::from(k) + 0.5) / f64::from(n);
                calm(at(0.0, 0.7 * s, 0.0))[stream] * 2.0 * s / f64::from(n)
            };
            let mean: f64 = (0..n).map(ring).sum();
            assert!((mean / 1.2 - 1.0).abs() < 1e-4, "{mean}");
        }
    }
}
