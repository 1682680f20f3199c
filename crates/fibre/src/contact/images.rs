//! Periodic images of segments, in a box at rest or in one that is sheared (Lees & Edwards 1972).

use crate::{PeriodicBox, Vector3};

/// The images at an instant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Images {
    periodic: PeriodicBox,
    /// Shear rate ∂u_x/∂y \[1/s\]; 0 in a box at rest.
    rate: f64,
    /// How far the box above is ahead along x, less whole periods \[m\].
    ahead: f64,
}

/// One of the images of a body: what to subtract from its position and velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Image {
    pub shift: Vector3,
    pub velocity: Vector3,
}

impl Images {
    /// After the box has been sheared by `strain`.
    pub fn new(periodic: &PeriodicBox, rate: f64, strain: f64) -> Self {
        let ahead = strain * periodic.lengths[1].unwrap_or(0.0);
        let whole = periodic.lengths[0].map_or(0.0, |l| l * (ahead / l).round());
        Self {
            periodic: *periodic,
            rate,
            ahead: ahead - whole,
        }
    }

    pub fn periodic(&self) -> &PeriodicBox {
        &self.periodic
    }

    /// What brings the point at `difference` next to the origin.
    pub fn nearest(&self, difference: &Vector3) -> Image {
        let (Some(height), true) = (self.periodic.lengths[1], self.rate != 0.0) else {
            return Image {
                shift: self.periodic.nearest_period(difference),
                velocity: Vector3::zeros(),
            };
        };
        let layers = (difference.y / height).round();
        let above = Vector3::new(layers * self.ahead, layers * height, 0.0);
        Image {
            shift: above + self.periodic.nearest_period(&(difference - above)),
            velocity: Vector3::new(layers * height * self.rate, 0.0, 0.0),
        }
    }

    /// The image of b whose middle is next to a's middle.
    pub fn beside(&self, a: &[Vector3; 2], b: &[Vector3; 2]) -> Image {
        self.nearest(&(0.5 * ((b[0] - a[0]) + (b[1] - a[1]))))
    }

    /// Coordinates in which the images lie on a rectangular lattice.
    pub fn upright(&self, x: &Vector3) -> Vector3 {
        let y = x.y - self.periodic.origin.y;
        Vector3::new(x.x - self.slant() * y, x.y, x.z)
    }

    /// How much farther apart upright coordinates can be than positions.
    pub fn stretch(&self) -> f64 {
        self.slant().hypot(1.0)
    }

    fn slant(&self) -> f64 {
        self.periodic.lengths[1].map_or(0.0, |height| self.ahead / height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_of_a_sheared_box() {
        let periodic = PeriodicBox {
            origin: Vector3::new(1.0, -1.0, 0.0),
            lengths: [Some(4.0), Some(2.0), None],
        };
        // The box above is 2 × 2.8 = 5.6 ahead, that is 1.6.
        let images = Images::new(&periodic, 3.0, 2.8);
        let image = images.nearest(&Vector3::new(1.7, 2.1, 9.0));
        assert!((image.shift - Vector3::new(1.6, 2.0, 0.0)).norm() < 1e-14);
        assert!((image.velocity - Vector3::new(6.0, 0.0, 0.0)).norm() < 1e-14);
        let image = images.nearest(&Vector3::new(-5.8, -1.9, 0.0));
        assert!((image.shift - Vector3::new(-5.6, -2.0, 0.0)).norm() < 1e-14);
        let inside = images.nearest(&Vector3::new(1.9, 0.9, 0.0));
        assert_eq!(inside.shift, Vector3::zeros());
        assert_eq!(inside.velocity, Vector3::zeros());
        // Upright, an image is a whole number of periods away.
        let x = Vector3::new(0.3, 0.4, 0.5);
        let moved = images.upright(&(x + Vector3::new(1.6, 2.0, 0.0))) - images.upright(&x);
        assert!((moved - Vector3::new(0.0, 2.0, 0.0)).norm() < 1e-14);
    }
}
