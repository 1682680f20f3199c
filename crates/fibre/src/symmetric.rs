//! Symmetric 3×3 matrices in six numbers.

use crate::{Matrix3, Vector3};

/// A symmetric matrix.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Symmetric {
    /// xx, yy, zz.
    diagonal: [f64; 3],
    /// yz, zx, xy.
    off: [f64; 3],
}

impl Symmetric {
    /// `scale` times the unit matrix.
    pub fn unit(scale: f64) -> Self {
        Self {
            diagonal: [scale; 3],
            off: [0.0; 3],
        }
    }

    /// Adds `scale` times a matrix that is symmetric.
    #[inline(always)]
    pub fn add(&mut self, m: &Matrix3, scale: f64) {
        for (to, at) in self.diagonal.iter_mut().zip([(0, 0), (1, 1), (2, 2)]) {
            *to += m[at] * scale;
        }
        for (to, at) in self.off.iter_mut().zip([(1, 2), (2, 0), (0, 1)]) {
            *to += m[at] * scale;
        }
    }

    /// `scale` times this, plus `unit` times the unit matrix, plus `excess` t tᵀ.
    #[inline(always)]
    pub fn combined(&self, scale: f64, unit: f64, t: &Vector3, excess: f64) -> Self {
        let ([xx, yy, zz], [yz, zx, xy]) = (self.diagonal, self.off);
        Self {
            diagonal: [
                xx * scale + unit + t.x * t.x * excess,
                yy * scale + unit + t.y * t.y * excess,
                zz * scale + unit + t.z * t.z * excess,
            ],
            off: [
                yz * scale + t.y * t.z * excess,
                zx * scale + t.z * t.x * excess,
                xy * scale + t.x * t.y * excess,
            ],
        }
    }

    pub fn matrix(&self) -> Matrix3 {
        let ([xx, yy, zz], [yz, zx, xy]) = (self.diagonal, self.off);
        Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz)
    }

    /// Product with a vector.
    #[inline(always)]
    pub fn times(&self, v: &Vector3) -> Vector3 {
        let ([xx, yy, zz], [yz, zx, xy]) = (self.diagonal, self.off);
        Vector3::new(
            xx * v.x + xy * v.y + zx * v.z,
            xy * v.x + yy * v.y + yz * v.z,
            zx * v.x + yz * v.y + zz * v.z,
        )
    }

    /// Inverse by cofactors, for matrices that are well-conditioned.
    #[inline(always)]
    pub fn inverse(&self) -> Self {
        let ([xx, yy, zz], [yz, zx, xy]) = (self.diagonal, self.off);
        let cofactor_x = yy * zz - yz * yz;
        let (cofactor_xy, cofactor_zx) = (yz * zx - xy * zz, xy * yz - yy * zx);
        let scale = 1.0 / (xx * cofactor_x + xy * cofactor_xy + zx * cofactor_zx);
        Self {
            diagonal: [
                cofactor_x * scale,
                (xx * zz - zx * zx) * scale,
                (xx * yy - xy * xy) * scale,
            ],
            off: [
                (xy * zx - xx * yz) * scale,
                cofactor_zx * scale,
                cofactor_xy * scale,
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn does_what_full_matrices_do() {
        let a = Matrix3::new(4.0, 0.3, -0.7, 0.3, 5.0, 1.1, -0.7, 1.1, 3.0);
        let mut s = Symmetric::unit(2.0);
        s.add(&a, 0.5);
        let full = Matrix3::identity() * 2.0 + a * 0.5;
        let (v, t) = (Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.6, 0.0, 0.8));
        assert!((s.matrix() - full).norm() < 1e-15);
        assert!((s.times(&v) - full * v).norm() < 1e-15);
        assert!((s.inverse().matrix() * full - Matrix3::identity()).norm() < 1e-15);
        let sum = full * 3.0 + Matrix3::identity() * 7.0 + t * t.transpose() * 11.0;
        assert!((s.combined(3.0, 7.0, &t, 11.0).matrix() - sum).norm() < 1e-14);
    }
}
