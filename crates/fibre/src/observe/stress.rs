//! What the fibres add to the stress of the suspension.

use crate::linear_slip::for_arms;
use crate::{FibreSystem, Matrix3, Vector3};
use fibreflow_parallel::block_sums;

impl FibreSystem {
    /// Particle stress of the fibres of this rank times the volume they are in \[N·m\]: the sum of their stresslets
    /// (Batchelor 1970, J. Fluid Mech. 41:545),
    ///
    /// ```text
    /// S = −Σ ½ (r f + f r) less a third of its trace,   r from the middle of the fibre's points,
    /// ```
    ///
    /// f the mean force in the last step on the fluid at a point, as of the reaction. Positive along what is stretched:
    /// a fibre along the stretching axis of a flow has S > 0 there. Of the torque by length, which acts over the
    /// thickness, only the antisymmetric part is known; contacts are not in it.
    pub fn particle_stress(&self) -> Matrix3 {
        let sums = block_sums(self.fibres(), |range| {
            let mut sum = Matrix3::zeros();
            for fibre in range {
                sum += self.stresslet(fibre);
            }
            std::array::from_fn::<f64, 9, _>(|k| sum[k])
        });
        Matrix3::from_column_slice(&sums)
    }

    /// Stresslet of a local fibre \[N·m\].
    fn stresslet(&self, fibre: usize) -> Matrix3 {
        let first = self.model.points[self.model.segment_range(fibre).start];
        let node = self.model.offsets[fibre];
        let (mut moment, mut middle, mut total) =
            (Matrix3::zeros(), Vector3::zeros(), Vector3::zeros());
        let mut length = 0.0;
        let origin = self.motion.position[node];
        for_arms(&self.model, fibre, |i, p, xi, weight, _| {
            let [a, b] = [0, 1].map(|end| self.motion.position[node + i + end] - origin);
            let (r, f) = (a + (b - a) * xi, self.reaction.force[first + p]);
            moment -= r * f.transpose();
            total += f;
            middle += r * weight;
            length += weight;
        });
        moment += middle / length * total.transpose();
        let symmetric = (moment + moment.transpose()) * 0.5;
        symmetric - Matrix3::from_diagonal_element(symmetric.trace() / 3.0)
    }
}
