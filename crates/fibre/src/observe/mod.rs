//! Quantities of the whole system and of single fibres. Sums over this rank; the caller adds ranks.

mod budget;
mod inside;
mod statistics;
mod stress;

pub use budget::Budget;
pub(crate) use budget::{Account, Accounts};
pub use inside::Inside;
pub use statistics::{FOURTH, Histogram, OrientationMoments, Shear};

use crate::beam::{ElasticEnergy, tangent};
use crate::implicit::for_hinges;
use crate::{FibreSystem, Vector3};
use fibreflow_parallel::{block_sum, block_sums};

fn sum(length: usize, value: impl Fn(usize) -> f64 + Sync + Send) -> f64 {
    block_sum(length, |range| range.map(&value).sum())
}

fn sum_vectors(length: usize, value: impl Fn(usize) -> Vector3 + Sync + Send) -> Vector3 {
    Vector3::from(block_sums(length, |range| {
        range.map(&value).sum::<Vector3>().into()
    }))
}

/// Mechanical energy of the fibres of this rank \[J\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energy {
    /// Translation and rotation.
    pub kinetic: f64,
    /// Strain energy by kind.
    pub elastic: ElasticEnergy,
    /// Potential of weight (less buoyancy) and point forces, zero at the origin; point torques have none.
    pub potential: f64,
}

impl Energy {
    /// Kinetic, elastic and potential energy \[J\].
    pub fn total(&self) -> f64 {
        self.kinetic + self.elastic.total() + self.potential
    }
}

impl FibreSystem {
    /// Energies of the fibres of this rank.
    pub fn energy(&self) -> Energy {
        let m = &self.motion;
        let kinetic = |i: usize| {
            let node = &self.model.nodes[i];
            let w = &m.angular_velocity[i];
            let axial = w.dot(&tangent(&m.orientation[i])).powi(2);
            0.5 * (node.mass * m.velocity[i].norm_squared()
                + node.transverse_inertia * (w.norm_squared() - axial)
                + node.axial_inertia * axial)
        };
        let nodes = self.model.nodes.len();
        let mut elastic = ElasticEnergy::default();
        for f in 0..self.fibres() {
            let e = self.elastic_energy(f);
            elastic.stretching += e.stretching;
            elastic.bending += e.bending;
            elastic.torsion += e.torsion;
        }
        Energy {
            kinetic: sum(nodes, kinetic),
            elastic,
            potential: sum(nodes, |i| -self.given_force(i).dot(&m.position[i])),
        }
    }

    /// Elastic energy of a local fibre.
    pub(crate) fn elastic_energy(&self, fibre: usize) -> ElasticEnergy {
        let mut sum = ElasticEnergy::default();
        let constants = &self.model.fibres[fibre];
        if constants.body.is_some() {
            return sum;
        }
        let segments = &self.model.segments[self.model.segment_range(fibre)];
        if constants.twist_free {
            let nodes = self.model.node_range(fibre);
            let position = &self.motion.position[nodes.clone()];
            for (segment, x) in segments.iter().zip(position.windows(2)) {
                let stretch = (x[1] - x[0]).norm() - segment.rest_length;
                sum.stretching += 0.5 * segment.axial * stretch * stretch;
            }
            let orientation = &self.motion.orientation[nodes];
            for_hinges(&self.model, fibre, position, orientation, |_, hinge| {
                sum.bending += hinge.energy();
            });
            return sum;
        }
        for (s, segment) in segments.iter().enumerate() {
            let (start, end) = self.segment_poses(fibre, s);
            let e = segment.energy(start, end);
            sum.stretching += e.stretching;
            sum.bending += e.bending;
            sum.torsion += e.torsion;
        }
        sum
    }

    /// Mass of the fibres of this rank \[kg\].
    pub fn mass(&self) -> f64 {
        sum(self.model.nodes.len(), |i| self.model.nodes[i].mass)
    }

    /// Linear momentum \[kg·m/s\].
    pub fn momentum(&self) -> Vector3 {
        sum_vectors(self.model.nodes.len(), |i| {
            self.motion.velocity[i] * self.model.nodes[i].mass
        })
    }

    /// Angular momentum about the origin, with the nodes' own \[kg·m²/s\].
    pub fn angular_momentum(&self) -> Vector3 {
        let m = &self.motion;
        sum_vectors(self.model.nodes.len(), |i| {
            let node = &self.model.nodes[i];
            let w = &m.angular_velocity[i];
            let t = tangent(&m.orientation[i]);
            let own = w * node.transverse_inertia
                + t * ((node.axial_inertia - node.transverse_inertia) * w.dot(&t));
            m.position[i].cross(&m.velocity[i]) * node.mass + own
        })
    }

    /// Sum of weight (less buoyancy) and point forces \[N\].
    pub fn applied_force(&self) -> Vector3 {
        sum_vectors(self.model.nodes.len(), |i| self.given_force(i))
    }

    fn given_force(&self, node: usize) -> Vector3 {
        self.model.loads[node].force + self.model.nodes[node].weight
    }

    /// Vector from the first to the last node of a local fibre \[m\].
    pub fn end_to_end(&self, fibre: usize) -> Vector3 {
        let range = self.model.node_range(fibre);
        self.motion.position[range.end - 1] - self.motion.position[range.start]
    }

    /// Centre of mass of a local fibre \[m\].
    pub fn centre(&self, fibre: usize) -> Vector3 {
        let mut moment = Vector3::zeros();
        let mut mass = 0.0;
        for i in self.model.node_range(fibre) {
            moment += self.motion.position[i] * self.model.nodes[i].mass;
            mass += self.model.nodes[i].mass;
        }
        moment / mass
    }

    /// Curvature vectors κb \[1/m\] at the inner nodes of a local fibre, the angle between the adjacent chords over the
    /// mean of their lengths; `out` is cleared.
    pub fn curvature(&self, fibre: usize, out: &mut Vec<Vector3>) {
        let nodes = &self.motion.position[self.model.node_range(fibre)];
        out.clear();
        out.extend(nodes.windows(3).map(|w| {
            let (a, b) = (w[1] - w[0], w[2] - w[1]);
            let (la, lb) = (a.norm(), b.norm());
            let binormal = a.cross(&b);
            let sine = binormal.norm();
            let angle = sine.atan2(a.dot(&b));
            let direction = if sine > 0.0 {
                binormal / sine
            } else {
                binormal
            };
            direction * (2.0 * angle / (la + lb))
        }));
    }
}
