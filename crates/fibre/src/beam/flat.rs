//! The part of the energy by which a section bends more easily one way than the other.

use super::{Pose, Segment, SegmentForce, SegmentStiffness, Strain};
use crate::{Matrix3, Vector3};

/// Slopes of the chord against the two axes across each end frame: (u_a, u_b) and (w_a, w_b).
pub(super) struct Slopes {
    /// The second and third axis of the start and of the end frame.
    axes: [[Vector3; 2]; 2],
    chord: Vector3,
    slopes: [[f64; 2]; 2],
}

impl Slopes {
    pub fn new(segment: &Segment, start: Pose, end: Pose, strain: &Strain) -> Self {
        let frames = [
            start.orientation * segment.start_frame,
            end.orientation * segment.end_frame,
        ];
        let axes = [Vector3::y(), Vector3::z()].map(|axis| frames.map(|frame| frame * axis));
        Self {
            axes,
            chord: strain.chord,
            slopes: axes.map(|ends| ends.map(|axis| axis.dot(&strain.chord))),
        }
    }

    pub fn energy(&self, segment: &Segment) -> f64 {
        let [softer, stiffer] = self.slopes.map(|[a, b]| {
            3.0 * segment.bending * (a * a + b * b) - segment.mutual * (a - b).powi(2)
        });
        segment.flatness * (softer - stiffer)
    }

    /// ∂U'/∂ of each slope.
    fn gradient(&self, segment: &Segment) -> [[f64; 2]; 2] {
        let (own, other) = segment.end_stiffness();
        let sign = [segment.flatness, -segment.flatness];
        [0, 1].map(|k| {
            let [a, b] = self.slopes[k];
            [own * a + other * b, other * a + own * b].map(|c| c * sign[k])
        })
    }

    pub fn force(&self, segment: &Segment, strain: &Strain) -> SegmentForce {
        let gradient = self.gradient(segment);
        let pull = |end: usize| {
            self.axes[0][end] * gradient[0][end] + self.axes[1][end] * gradient[1][end]
        };
        let (a, b, t) = (pull(0), pull(1), &self.chord);
        let both = a + b;
        SegmentForce {
            force: (both - t * both.dot(t)) * -strain.inverse_length,
            start_torque: t.cross(&a),
            end_torque: t.cross(&b),
        }
    }

    /// Adds the second derivatives. With s = e·t of an axis e: ∂s/∂d = Pe/l, ∂s/∂θ = e × t, P = I − tt.
    pub fn add_stiffness(&self, segment: &Segment, strain: &Strain, to: &mut SegmentStiffness) {
        let gradient = self.gradient(segment);
        let (own, other) = segment.end_stiffness();
        let t = &self.chord;
        let inverse = strain.inverse_length;
        let across = Matrix3::identity() - t * t.transpose();
        for (k, sign) in [segment.flatness, -segment.flatness]
            .into_iter()
            .enumerate()
        {
            let by_span = [0, 1].map(|end| across * self.axes[k][end] * inverse);
            let by_turn = [0, 1].map(|end| self.axes[k][end].cross(t));
            let (own, other) = (sign * own, sign * other);
            let [pa, pb] = &by_span;
            let [na, nb] = &by_turn;
            to.dd += (pa * pa.transpose() + pb * pb.transpose()) * own
                + (pa * pb.transpose() + pb * pa.transpose()) * other;
            to.da += (pa * na.transpose()) * own + (pb * na.transpose()) * other;
            to.db += (pb * nb.transpose()) * own + (pa * nb.transpose()) * other;
            to.aa += na * na.transpose() * own;
            to.bb += nb * nb.transpose() * own;
            to.ab += na * nb.transpose() * other;
            for end in 0..2 {
                let (e, p, c) = (&self.axes[k][end], &by_span[end], gradient[k][end]);
                let s = self.slopes[k][end];
                let mixed = p * t.transpose();
                to.dd -= (mixed + mixed.transpose() + across * (s * inverse)) * (c * inverse);
                let turned = across * e.cross_matrix() * (c * inverse);
                let own = (e * t.transpose() - Matrix3::identity() * s) * c;
                match end {
                    0 => {
                        to.da -= turned;
                        to.aa += own;
                    }
                    _ => {
                        to.db -= turned;
                        to.bb += own;
                    }
                }
            }
        }
    }
}
