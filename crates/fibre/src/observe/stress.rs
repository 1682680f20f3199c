//! What the fibres add to the stress of the suspension.

use super::Inside;
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
    /// thickness, only the antisymmetric part is known; contacts are not in it. Only fibres whose centre is `inside` count.
    pub fn particle_stress(&self, inside: &Inside) -> Matrix3 {
        self.stress(inside, |fibre| self.hydrodynamic_moment(fibre))
    }

    /// Stress of the contacts of the fibres of this rank times the volume they are in \[N·m\], at the end of the last step:
    /// S = Σ ½ (r f + f r) less a third of its trace over the contact forces f on the ends of segments, r from the middle
    /// of the fibre. As f = −f' in a pair, that is −Σ (r of one centre from the other) f over the pairs (Batchelor 1977,
    /// J. Fluid Mech. 83:97); forces of walls are in it. What a contact does over the thickness of a fibre, of order d/L
    /// of it, is not. Only fibres whose centre is `inside` count.
    pub fn contact_stress(&self, inside: &Inside) -> Matrix3 {
        match &self.touching {
            Some(_) => self.stress(inside, |fibre| self.contact_moment(fibre)),
            None => Matrix3::zeros(),
        }
    }

    /// Symmetric part without trace of what every fibre adds.
    fn stress(&self, inside: &Inside, moment: impl Fn(usize) -> Matrix3 + Sync + Send) -> Matrix3 {
        let sums = block_sums(self.fibres(), |range| {
            let counted = range.filter(|&fibre| inside.holds(&self.centre(fibre)));
            let sum: Matrix3 = counted.map(&moment).sum();
            std::array::from_fn::<f64, 9, _>(|k| sum[k])
        });
        let sum = Matrix3::from_column_slice(&sums);
        let symmetric = (sum + sum.transpose()) * 0.5;
        symmetric - Matrix3::from_diagonal_element(symmetric.trace() / 3.0)
    }

    /// −Σ r f of a local fibre \[N·m\], f on the fluid.
    fn hydrodynamic_moment(&self, fibre: usize) -> Matrix3 {
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
        moment + middle / length * total.transpose()
    }

    /// Σ r f of a local fibre \[N·m\], f of contacts on its segments.
    fn contact_moment(&self, fibre: usize) -> Matrix3 {
        let Some(contacts) = self.contacts() else {
            return Matrix3::zeros();
        };
        let (node, centre) = (self.model.offsets[fibre], self.centre(fibre));
        let mut moment = Matrix3::zeros();
        for (i, segment) in self.model.segment_range(fibre).enumerate() {
            if let Some(load) = contacts.load(segment) {
                for (end, force) in [(i, &load.start_force), (i + 1, &load.end_force)] {
                    let arm = self.motion.position[node + end] - centre;
                    moment += arm * force.transpose();
                }
            }
        }
        moment
    }
}
