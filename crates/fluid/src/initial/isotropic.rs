//! Isotropic turbulence to start from.

use crate::settings::{cross, length};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// Random solenoidal field of a periodic box with the spectrum E ∝ k⁴ exp(−2(k/k₀)²) (Passot & Pouquet 1987), phases and
/// directions at random (Rogallo 1981): the energy of every wave is that of the spectrum.
#[derive(Clone, Debug, PartialEq)]
pub struct Isotropic {
    /// Corner of the box with the smallest coordinates \[m\].
    pub origin: [f64; 3],
    /// Edge lengths of the box, its periods \[m\].
    pub size: [f64; 3],
    /// u', root mean square of a component \[m/s\].
    pub intensity: f64,
    /// 2π/k₀, where the spectrum is largest \[m\]; waves down to a third of it take part.
    pub wavelength: f64,
    /// Seed of phases and directions.
    pub seed: u64,
}

/// Waves beyond so many k₀ have less than 1e-5 of the energy and are left out.
const LARGEST: f64 = 3.0;

/// Re[a exp(ik·x)], k = 2π counts/size.
struct Wave {
    counts: [i32; 3],
    real: [f64; 3],
    imaginary: [f64; 3],
}

impl Isotropic {
    /// The velocity field.
    pub fn field(&self) -> impl Fn([f64; 3]) -> [f64; 3] + use<> {
        let waves = self.waves();
        let largest = [0, 1, 2].map(|c| waves.iter().map(|w| w.counts[c].abs()).max().unwrap_or(0));
        let (origin, size) = (self.origin, self.size);
        move |x| {
            // exp(2πi n x/L) for n = 0 … largest, direction by direction.
            let factors: [Vec<[f64; 2]>; 3] = std::array::from_fn(|c| {
                let (sin, cos) = (TAU * (x[c] - origin[c]) / size[c]).sin_cos();
                let powers =
                    std::iter::successors(Some([1.0, 0.0]), |&p| Some(times(p, [cos, sin])));
                powers.take(largest[c] as usize + 1).collect()
            });
            let factor = |c: usize, n: i32| {
                let [re, im] = factors[c][n.unsigned_abs() as usize];
                [re, if n < 0 { -im } else { im }]
            };
            let mut u = [0.0; 3];
            for wave in &waves {
                let [l, m, n] = wave.counts;
                let [re, im] = times(times(factor(0, l), factor(1, m)), factor(2, n));
                for c in 0..3 {
                    u[c] += re * wave.real[c] - im * wave.imaginary[c];
                }
            }
            u
        }
    }

    /// One for every wave vector of a half space.
    fn waves(&self) -> Vec<Wave> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let peak = TAU / self.wavelength;
        let range = |c: usize| {
            let most = (LARGEST * self.size[c] / self.wavelength).floor() as i32;
            -most..=most
        };
        let mut waves = Vec::new();
        let mut square = 0.0;
        let counts = range(0).flat_map(|l| range(1).map(move |m| (l, m)));
        for counts in counts.flat_map(|(l, m)| range(2).map(move |n| [l, m, n])) {
            let vector: [f64; 3] =
                std::array::from_fn(|c| TAU * f64::from(counts[c]) / self.size[c]);
            let k = length(vector);
            if counts <= [0; 3] || k > LARGEST * peak {
                continue;
            }
            let density = (k / peak).powi(2) * (-2.0 * (k / peak).powi(2)).exp();
            let [first, second, share] = [(); 3].map(|()| TAU * random.random::<f64>());
            let [e, f] = across(vector.map(|v| v / k));
            let of = |phase: [f64; 2]| -> [f64; 3] {
                std::array::from_fn(|c| {
                    density.sqrt() * (phase[0] * share.cos() * e[c] + phase[1] * share.sin() * f[c])
                })
            };
            square += 0.5 * density;
            waves.push(Wave {
                counts,
                real: of([first.cos(), second.cos()]),
                imaginary: of([first.sin(), second.sin()]),
            });
        }
        let scale = 3.0_f64.sqrt() * self.intensity / square.sqrt();
        for wave in &mut waves {
            wave.real = wave.real.map(|a| scale * a);
            wave.imaginary = wave.imaginary.map(|a| scale * a);
        }
        waves
    }
}

fn times(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

/// Two unit vectors normal to a unit vector and to each other.
fn across(n: [f64; 3]) -> [[f64; 3]; 2] {
    let other = if n[0].abs() < 0.9 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let e = cross(n, other);
    let size = length(e);
    let e = e.map(|v| v / size);
    [e, cross(n, e)]
}
