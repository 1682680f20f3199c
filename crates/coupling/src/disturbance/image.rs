//! What a plane wall adds to the flow of a force that is spread and seen through Gaussians.
//!
//! Blake's (1971) images of a point force F at the height h, with R from the image to the place, Ψ = 1/R, S the Oseen tensor,
//! n the normal and t the force with its normal part turned round, by 8π and unit viscosity:
//!
//! ```text
//! B = −S F − 2h² ∇∂_t Ψ − 2h ∂_t S n
//! ```
//!
//! B is biharmonic in the place x and, by reciprocity, in that of the force y. So its mean over Gaussians of variance v around
//! both is exactly B + ½v ∇x²B + ½v ∇y²B + ¼v² ∇x²∇y²B, as long as they do not reach the wall, with
//!
//! ```text
//! ∇x²B = 2∇∂_F Ψ + 4h ∇∂_t∂_n Ψ
//! ∇y²B = 2∇∂_F Ψ − 4∇∂_t Ψ − 4h ∇∂_t∂_n Ψ − 4(2n ∂_t∂_n Ψ − ∇∂_t∂_n² R)
//! ∇x²∇y²B = 8 ∇∂_t∂_n² Ψ
//! ```

use nalgebra::Vector3;
use std::f64::consts::PI;

type V3 = Vector3<f64>;

/// Distance from the image, in widths of the whole Gaussian, below which it reaches the wall so far that images of points
/// mean nothing.
const NEAREST: f64 = 2.0;

/// Forces in one place by what multiplies them: 1, ½v and ¼v² of their variances v.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sum([V3; 3]);

impl Sum {
    /// Adds a force whose Gaussian and that at the place are `s` wide together, at the distance of the image. Where that is less than
    /// 2s, and for disturbances that have spread that far, it counts as what the image would be at 2s.
    pub fn add(&mut self, force: &V3, s: f64, distance: f64) {
        // B is homogeneous of degree −1 in all lengths.
        let seen = s.min(distance / NEAREST);
        let share = seen / s;
        let half = 0.25 * seen * seen;
        for (sum, weight) in self
            .0
            .iter_mut()
            .zip([share, share * half, share * half * half])
        {
            *sum += force * weight;
        }
    }

    /// Velocity by unit viscosity at `place` from the image; `normal` points into the fluid, `height` is that of the forces.
    pub fn velocity(&self, place: &V3, normal: &V3, height: f64) -> V3 {
        let (n, h) = (normal, height);
        let field = Derivatives::at(place);
        let turned = |f: &V3| f - 2.0 * f.dot(n) * n;
        let [force, linear, square] = &self.0;
        // ∇x²B + ∇y²B: the terms with the height cancel.
        let t = &turned(linear);
        let bent = 2.0 * n * field.second(t).dot(n) - field.fourth_of_distance(t, n);
        let by_variance = 4.0 * (field.second(linear) - field.second(t) - bent);
        let by_square = 8.0 * field.fourth(&turned(square), n);
        (blake(&field, force, n, h) + by_variance + by_square) / (8.0 * PI)
    }
}

/// B of points, by 8π.
fn blake(field: &Derivatives, force: &V3, n: &V3, h: f64) -> V3 {
    let place = &field.place;
    let t = &(force - 2.0 * force.dot(n) * n);
    let (up, toward) = (place.dot(n), place.dot(t));
    let [i1, i3, i5] = [field.inverse, field.inverse.powi(3), field.inverse.powi(5)];
    let oseen = force * i1 + place * (place.dot(force) * i3);
    let sheared = (t * up + place * t.dot(n) - n * toward) * i3 - place * (3.0 * up * toward * i5);
    -oseen - 2.0 * h * h * field.second(t) - 2.0 * h * sheared
}

/// Derivatives of 1/R and R along given directions, the last index left open.
struct Derivatives {
    place: V3,
    inverse: f64,
}

impl Derivatives {
    fn at(place: &V3) -> Self {
        Self {
            place: *place,
            inverse: 1.0 / place.norm(),
        }
    }

    /// ∇∂_a (1/R)
    fn second(&self, a: &V3) -> V3 {
        let x = &self.place;
        let i = self.inverse;
        3.0 * x.dot(a) * i.powi(5) * x - a * i.powi(3)
    }

    /// x x x x a b b, pairs of them with δ, and pairs of δ, each as a vector.
    fn quartic(&self, a: &V3, b: &V3) -> [V3; 3] {
        let x = &self.place;
        let (xa, xb) = (x.dot(a), x.dot(b));
        let (ab, bb) = (a.dot(b), b.dot(b));
        [
            x * (xa * xb * xb),
            a * (xb * xb) + b * (2.0 * xa * xb) + x * (2.0 * ab * xb + bb * xa),
            a * bb + b * (2.0 * ab),
        ]
    }

    /// ∇∂_a∂_b² (1/R)
    fn fourth(&self, a: &V3, b: &V3) -> V3 {
        let [x4, x2, x0] = self.quartic(a, b);
        let i = self.inverse;
        105.0 * i.powi(9) * x4 - 15.0 * i.powi(7) * x2 + 3.0 * i.powi(5) * x0
    }

    /// ∇∂_a∂_b² R
    fn fourth_of_distance(&self, a: &V3, b: &V3) -> V3 {
        let [x4, x2, x0] = self.quartic(a, b);
        let i = self.inverse;
        -15.0 * i.powi(7) * x4 + 3.0 * i.powi(5) * x2 - i.powi(3) * x0
    }
}

#[cfg(test)]
mod tests {
    use super::super::stokeslet;
    use super::*;

    impl Derivatives {
        /// ∇∂_a∂_b (1/R)
        fn third(&self, a: &V3, b: &V3) -> V3 {
            let x = &self.place;
            let (xa, xb, i) = (x.dot(a), x.dot(b), self.inverse);
            3.0 * i.powi(5) * (a * xb + b * xa + x * a.dot(b)) - 15.0 * xa * xb * i.powi(7) * x
        }
    }

    /// With different variances around the place and around the force.
    fn mean(place: &V3, force: &V3, [at_place, at_force]: [f64; 2], n: &V3, h: f64) -> V3 {
        let field = Derivatives::at(place);
        let t = &(force - 2.0 * force.dot(n) * n);
        let (of_turned, of_force) = (field.second(t), field.second(force));
        let third = field.third(t, n);
        let bent = 2.0 * n * of_turned.dot(n) - field.fourth_of_distance(t, n);
        let by_place = 2.0 * of_force + 4.0 * h * third;
        let by_force = 2.0 * of_force - 4.0 * of_turned - 4.0 * h * third - 4.0 * bent;
        let by_both = 8.0 * field.fourth(t, n);
        let sum = blake(&field, force, n, h)
            + 0.5 * at_place * by_place
            + 0.5 * at_force * by_force
            + 0.25 * at_place * at_force * by_both;
        sum / (8.0 * PI)
    }

    fn velocity(r: &V3, force: &V3, s: f64, normal: &V3, height: f64) -> V3 {
        let place = r + 2.0 * height * normal;
        let mut sum = Sum::default();
        sum.add(force, s, place.norm());
        sum.velocity(&place, normal, height)
    }

    #[test]
    fn forces_of_several_widths_are_summed_and_near_ones_kept_away() {
        let (normal, force) = (Vector3::z(), Vector3::new(0.4, -0.2, 0.8));
        let (r, height) = (Vector3::new(0.3, -0.1, 0.2), 0.5);
        let place: V3 = r + 2.0 * height * normal;
        let distance = place.norm();
        let mut sum = Sum::default();
        let mut wanted = V3::zeros();
        for (s, share) in [(0.2, 1.0), (0.5, -0.7), (1.5, 0.4)] {
            sum.add(&(force * share), s, distance);
            let scale = (2.0 * s / distance).max(1.0);
            let variances = [0.5 * s * s; 2];
            let (place, height) = (place * scale, height * scale);
            wanted += share * mean(&place, &force, variances, &normal, height);
        }
        let found = sum.velocity(&place, &normal, height);
        assert!((found - wanted).norm() < 1e-14, "{found} {wanted}");
    }

    /// A Gaussian force and its image leave the wall at rest.
    #[test]
    fn the_image_holds_the_wall() {
        let (normal, height) = (Vector3::y(), 1.0);
        for force in [Vector3::new(1.0, 0.0, 0.0), Vector3::new(0.3, 1.0, -0.5)] {
            for (x, z) in [(0.0, 0.0), (0.4, -0.7), (3.0, 1.0)] {
                let r = Vector3::new(x, -height, z);
                let s = 0.15;
                let (mut alone, mut gradient) = (V3::zeros(), nalgebra::Matrix3::zeros());
                let into = (&mut alone, &mut gradient);
                stokeslet::Stokeslets::new().add(into, &r, &force, s);
                let place = r + 2.0 * height * normal;
                let both = alone + mean(&place, &force, [0.0, s * s], &normal, height);
                assert!(both.norm() < 1e-9 * alone.norm(), "{x} {z}: {both}");
            }
        }
    }

    /// Force at one place, velocity at the other, and the other way round.
    #[test]
    fn the_image_is_reciprocal() {
        let normal = Vector3::z();
        let (a, b) = (Vector3::new(0.1, 0.2, 0.9), Vector3::new(-0.4, 0.5, 1.3));
        let (f, g) = (Vector3::new(1.0, -0.3, 0.6), Vector3::new(0.2, 0.7, -1.1));
        let answer =
            |at: &V3, from: &V3, force: &V3| velocity(&(at - from), force, 0.3, &normal, from.z);
        let (one, other) = (answer(&b, &a, &f).dot(&g), answer(&a, &b, &g).dot(&f));
        assert!(
            (one - other).abs() < 1e-13 * one.abs().max(1.0),
            "{one} {other}"
        );
    }
}
