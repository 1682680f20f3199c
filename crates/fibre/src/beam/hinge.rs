//! Bending of a chain without twist: a hinge at every node, between the two chords that meet there.
//!
//! ```text
//! U = ½ b θ²(t₁, t₂),   1/b = ½ l₁/EI₁ + ½ l₂/EI₂
//! ```
//!
//! with t₁, t₂ the directions of the chords: positions alone, for a fibre that is straight and round without load, where no
//! torque twists it. At a held frame t₁ is the frame's tangent and half a segment bends, 1/b = ½ l₂/EI₂.

use super::{Segment, squared_angle, squared_angle_slopes};
use crate::{Matrix3, Vector3};

/// A hinge between a chord d₁, or a fixed direction, and a chord d₂.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hinge {
    /// b \[N·m\].
    stiffness: f64,
    /// Chords, their lengths and directions.
    lengths: [f64; 2],
    directions: [Vector3; 2],
}

/// Gradient and second derivatives of the energy by the two chords.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HingeStiffness {
    /// ∂U/∂d₁, ∂U/∂d₂ \[N\].
    pub gradient: [Vector3; 2],
    /// ∂²U/∂d₁², ∂²U/∂d₁∂d₂, ∂²U/∂d₂² \[N/m\].
    pub second: [Matrix3; 3],
}

impl Hinge {
    /// Between two segments.
    pub fn between(segments: [&Segment; 2], chords: [Vector3; 2]) -> Self {
        let [a, b] = segments.map(|s| 0.5 / s.bending);
        Self::new(1.0 / (a + b), chords)
    }

    /// Between a fixed direction and a segment.
    pub fn clamp(segment: &Segment, direction: Vector3, chord: Vector3) -> Self {
        Self::new(2.0 * segment.bending, [direction, chord])
    }

    fn new(stiffness: f64, chords: [Vector3; 2]) -> Self {
        let lengths = chords.map(|d| d.norm());
        Self {
            stiffness,
            lengths,
            directions: [chords[0] / lengths[0], chords[1] / lengths[1]],
        }
    }

    /// U \[J\].
    pub fn energy(&self) -> f64 {
        let [a, b] = &self.directions;
        0.5 * self.stiffness * squared_angle(a, b)
    }

    /// b θ \[N·m\].
    pub fn moment(&self) -> f64 {
        (2.0 * self.stiffness * self.energy()).sqrt()
    }

    pub fn stiffness(&self) -> HingeStiffness {
        let [a, b] = &self.directions;
        let (slope, curve) = squared_angle_slopes(a, b);
        // By c = a·b: ∂/∂c = −∂/∂s.
        let (first, second) = (-0.5 * self.stiffness * slope, 0.5 * self.stiffness * curve);
        let cosine = a.dot(b);
        let across = [a, b].map(|t| Matrix3::identity() - t * t.transpose());
        let inverse = self.lengths.map(|l| 1.0 / l);
        // ∂c/∂d₁, ∂c/∂d₂
        let by = [(b - a * cosine) * inverse[0], (a - b * cosine) * inverse[1]];
        let own = |k: usize| {
            let mixed = self.directions[k] * by[k].transpose();
            let bent = (mixed + mixed.transpose()) * inverse[k]
                + across[k] * (cosine * inverse[k] * inverse[k]);
            by[k] * by[k].transpose() * second - bent * first
        };
        let mutual = by[0] * by[1].transpose() * second
            + across[0] * across[1] * (first * inverse[0] * inverse[1]);
        HingeStiffness {
            gradient: by.map(|p| p * first),
            second: [own(0), mutual, own(1)],
        }
    }

    /// Retardation × stiffness × rate of bending: forces on the chords by their rates, as a gradient, and its derivative by them.
    /// `rates` are those of the chords \[m/s\]; a fixed direction that turns has the rate ω × t.
    pub fn damping(&self, retardation: f64, rates: [Vector3; 2]) -> HingeStiffness {
        let levers = [0, 1].map(|k| self.directions[k].cross_matrix() / self.lengths[k]);
        let relative = levers[1] * rates[1] - levers[0] * rates[0];
        let strength = retardation * self.stiffness;
        let torque = relative * strength;
        let [first, second] = levers;
        HingeStiffness {
            gradient: [-(first.transpose() * torque), second.transpose() * torque],
            second: [
                first.transpose() * first * strength,
                first.transpose() * second * -strength,
                second.transpose() * second * strength,
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    #[test]
    fn stiffness_is_the_derivative_of_the_energy() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        for _ in 0..50 {
            let mut vector = || Vector3::from_fn(|_, _| rng.random_range(-0.6..0.6));
            let chords = [Vector3::x() + vector(), Vector3::x() * 0.7 + vector()];
            let hinge = |chords: [Vector3; 2]| Hinge::new(1.7, chords);
            let k = hinge(chords).stiffness();
            let h = 1e-5;
            for (part, axis) in (0..2).flat_map(|p| (0..3).map(move |a| (p, a))) {
                let moved = |s: f64| {
                    let mut chords = chords;
                    chords[part][axis] += s;
                    hinge(chords)
                };
                let slope = (moved(h).energy() - moved(-h).energy()) / (2.0 * h);
                let size = 1.0 + k.gradient[part].norm();
                assert!((slope - k.gradient[part][axis]).abs() < 1e-8 * size);
                let (up, down) = (moved(h).stiffness(), moved(-h).stiffness());
                for other in 0..2 {
                    let change = (up.gradient[other] - down.gradient[other]) / (2.0 * h);
                    let column: Vector3 = match (other, part) {
                        (0, 0) => k.second[0].column(axis).into(),
                        (1, 1) => k.second[2].column(axis).into(),
                        (0, _) => k.second[1].column(axis).into(),
                        _ => k.second[1].transpose().column(axis).into(),
                    };
                    let size = 1.0 + column.norm();
                    assert!((change - column).norm() < 1e-7 * size, "{change} {column}");
                }
            }
        }
    }

    #[test]
    fn damping_loses_energy_and_ignores_rigid_rotation() {
        let chords = [Vector3::new(1.0, 0.2, 0.1), Vector3::new(0.8, -0.3, 0.2)];
        let hinge = Hinge::new(2.0, chords);
        let spin = Vector3::new(0.3, -1.0, 0.7);
        // Spin about the chords is none of the hinge's.
        let rates = chords.map(|d| spin.cross(&d));
        let normal = chords[0].cross(&chords[1]).normalize();
        let still = hinge.damping(0.5, chords.map(|d| normal.cross(&d)));
        assert!(still.gradient.iter().all(|g| g.norm() < 1e-15));
        let moving = hinge.damping(0.5, rates);
        let power: f64 = moving
            .gradient
            .iter()
            .zip(&rates)
            .map(|(g, r)| g.dot(r))
            .sum();
        assert!(power >= 0.0);
    }
}
