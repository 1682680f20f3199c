//! Periodic images of points: multiples of the mesh's lattice vectors.

use fibreflow_mesh::Periods;
use nalgebra::{Matrix3, Vector3};

/// Whole multiples of the three lattice vectors.
pub(crate) type Shift = [i32; 3];

/// The lattice and the cell in which the mesh lies.
#[derive(Clone, Debug)]
pub(crate) struct Lattice {
    vectors: [Vector3<f64>; 3],
    /// fraction_k = dual_k · x; zero rows for directions that are not periodic.
    dual: Matrix3<f64>,
    /// Smallest fraction of any mesh vertex.
    lowest: Vector3<f64>,
    periodic: [bool; 3],
}

impl Lattice {
    pub fn new(periods: &Periods) -> Self {
        let vectors = periods.vectors.map(Vector3::from);
        let periodic = std::array::from_fn(|k| periods.is_periodic(k));
        let columns = Matrix3::from_columns(&vectors);
        // (AᵀA)⁻¹Aᵀ with a one on the diagonal for each unused direction.
        let unused =
            Matrix3::from_diagonal(&Vector3::from_fn(|k, _| f64::from(u8::from(!periodic[k]))));
        let gram = columns.transpose() * columns + unused;
        let dual = gram
            .try_inverse()
            .map_or_else(Matrix3::zeros, |g| g * columns.transpose());
        Self {
            vectors,
            dual,
            lowest: Vector3::zeros(),
            periodic,
        }
    }

    /// Fractions of the lattice vectors.
    pub fn fractions(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.dual * point
    }

    /// Sets the lower corner of the cell.
    pub fn start_at(&mut self, lowest: Vector3<f64>) {
        self.lowest = lowest;
    }

    /// Largest radius of a ball around a point of the cell that reaches no further than the cells next to it.
    pub fn reach(&self) -> f64 {
        let steepest = self.dual.row_iter().map(|row| row.norm());
        1.0 / steepest.fold(0.0, f64::max)
    }

    /// The point moved by whole lattice vectors.
    #[inline]
    pub fn image(&self, point: &Vector3<f64>, shift: Shift) -> Vector3<f64> {
        point + self.away(shift)
    }

    /// So many lattice vectors.
    #[inline]
    pub fn away(&self, shift: Shift) -> Vector3<f64> {
        if shift == [0; 3] {
            return Vector3::zeros();
        }
        (0..3).map(|k| f64::from(shift[k]) * self.vectors[k]).sum()
    }

    /// The shift that brings a point into the cell of the mesh.
    pub fn wrap(&self, point: &Vector3<f64>) -> Shift {
        let fractions = self.fractions(point) - self.lowest;
        std::array::from_fn(|k| {
            if self.periodic[k] {
                -(fractions[k].floor() as i32)
            } else {
                0
            }
        })
    }

    /// Shifts of the images in and next to the cell of the mesh, the wrapped one first.
    pub fn images(&self, point: &Vector3<f64>) -> impl Iterator<Item = Shift> + use<> {
        let wrapped = self.wrap(point);
        let periodic = self.periodic;
        // Codes in base 3 with digits 0, 1, −1.
        (0..27).filter_map(move |code| {
            let digits: [i32; 3] =
                [code % 3, code / 3 % 3, code / 9].map(|d| [0, 1, -1][d as usize]);
            (0..3)
                .all(|k| digits[k] == 0 || periodic[k])
                .then(|| std::array::from_fn(|k| wrapped[k] + digits[k]))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_points_come_back_into_a_skewed_cell() {
        let periods = Periods {
            vectors: [[2.0, 0.0, 0.0], [0.0; 3], [0.5, 0.0, 1.0]],
        };
        let mut lattice = Lattice::new(&periods);
        lattice.start_at(Vector3::new(-0.25, 0.0, 0.0));
        let inside = Vector3::new(0.3, 5.0, 0.6);
        for shift in [[0, 0, 0], [7, 0, -3], [-20, 0, 11]] {
            let far = lattice.image(&inside, shift);
            let back = lattice.wrap(&far);
            assert_eq!(back, shift.map(|s| -s));
            assert!((lattice.image(&far, back) - inside).norm() < 1e-13);
        }
        assert_eq!(lattice.images(&inside).count(), 9);
        assert_eq!(lattice.images(&inside).next(), Some([0; 3]));
    }
}
