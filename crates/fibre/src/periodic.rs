//! Periodic boxes: images and wrapping.

use crate::Vector3;

/// A box that repeats along some axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeriodicBox {
    /// Lowest corner \[m\].
    pub origin: Vector3,
    /// Period along x, y, z \[m\]; `None` where the domain does not repeat.
    pub lengths: [Option<f64>; 3],
}

impl PeriodicBox {
    /// No axis repeats.
    pub fn unbounded() -> Self {
        Self {
            origin: Vector3::zeros(),
            lengths: [None; 3],
        }
    }

    /// The whole number of periods nearest to `difference`, as a vector \[m\].
    pub fn nearest_period(&self, difference: &Vector3) -> Vector3 {
        let nearest = |x: f64, length: f64| {
            // Most differences are short, and a division is long.
            if x.abs() < 0.5 * length {
                0.0
            } else {
                length * (x / length).round()
            }
        };
        Vector3::from_fn(|axis, _| {
            self.lengths[axis].map_or(0.0, |length| nearest(difference[axis], length))
        })
    }

    /// The shortest of all images of `difference`.
    pub fn minimum_image(&self, difference: &Vector3) -> Vector3 {
        difference - self.nearest_period(difference)
    }

    /// The image of `point` inside the box.
    pub fn wrap(&self, point: &Vector3) -> Vector3 {
        Vector3::from_fn(|axis, _| {
            let x = point[axis];
            self.lengths[axis].map_or(x, |length| {
                x - length * ((x - self.origin[axis]) / length).floor()
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_the_shortest_and_inside() {
        let periodic = PeriodicBox {
            origin: Vector3::new(-1.0, 5.0, 0.0),
            lengths: [Some(2.0), None, Some(0.5)],
        };
        let image = periodic.minimum_image(&Vector3::new(1.5, 9.0, -0.4));
        assert!((image - Vector3::new(-0.5, 9.0, 0.1)).norm() < 1e-15);
        let wrapped = periodic.wrap(&Vector3::new(-3.5, -7.0, 1.7));
        assert!((wrapped - Vector3::new(0.5, -7.0, 0.2)).norm() < 1e-15);
    }
}
