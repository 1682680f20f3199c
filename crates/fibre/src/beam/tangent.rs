//! Second derivatives of a segment's energy: the tangent of the implicit integrator.

use super::{Pose, Segment, SegmentForce, Slopes, Strain, arc_tangent, squared_angle_slopes};
use crate::{Matrix3, Vector3};

/// Derivatives of the energy gradient (g_d, g_a, g_b) by the span d = x_b − x_a and by rotations θ_a, θ_b of the two
/// node frames about space axes, each applied last (q ← exp(θ) q).
///
/// Mixed blocks are each other's transposes; a diagonal block of one frame has a skew part, half the cross matrix of the
/// gradient, because rotations do not commute. It sums to zero over the segments at a node in equilibrium.
#[derive(Clone, Copy, Debug)]
pub struct SegmentStiffness {
    /// ∂g_d/∂d \[N/m\], symmetric.
    pub dd: Matrix3,
    /// ∂g_d/∂θ_a \[N\]; its transpose is ∂g_a/∂d.
    pub da: Matrix3,
    /// ∂g_d/∂θ_b \[N\]; its transpose is ∂g_b/∂d.
    pub db: Matrix3,
    /// ∂g_a/∂θ_a \[N·m\].
    pub aa: Matrix3,
    /// ∂g_a/∂θ_b \[N·m\]; its transpose is ∂g_b/∂θ_a.
    pub ab: Matrix3,
    /// ∂g_b/∂θ_b \[N·m\].
    pub bb: Matrix3,
}

/// [v×]
fn cross(v: &Vector3) -> Matrix3 {
    v.cross_matrix()
}

fn dyad(a: &Vector3, b: &Vector3) -> Matrix3 {
    a * b.transpose()
}

impl Segment {
    /// Elastic force and torques with their exact tangent.
    pub fn elastic_stiffness(&self, start: Pose, end: Pose) -> (SegmentForce, SegmentStiffness) {
        let e = Strain::new(self, start, end);
        let (a, b, t) = (&e.start_tangent, &e.end_tangent, &e.chord);
        let identity = Matrix3::identity();
        let inverse = 1.0 / e.length;
        // The energy in terms of cosines: ∂/∂cos = −∂/∂s with s = 1 − cos.
        let part = |weight: f64, u: &Vector3, v: &Vector3| {
            let (first, second) = squared_angle_slopes(u, v);
            (-weight * first, weight * second)
        };
        let (slope_a, curve_a) = part(3.0 * self.bending, a, t);
        let (slope_b, curve_b) = part(3.0 * self.bending, b, t);
        let (slope_ab, curve_ab) = part(-self.mutual, a, b);
        let (cos_a, cos_b, cos_ab) = (a.dot(t), b.dot(t), a.dot(b));
        let (at, bt, ab) = (a.cross(t), b.cross(t), a.cross(b));
        let across = identity - dyad(t, t);
        let (pa, pb) = (a - t * cos_a, b - t * cos_b);

        let tension = self.axial * (e.length - self.rest_length);
        let pull = pa * slope_a + pb * slope_b;
        let along = slope_a * cos_a + slope_b * cos_b;
        let mixed = dyad(&pull, t);
        let dd = dyad(t, t) * self.axial + across * ((tension - along * inverse) * inverse)
            - (mixed + mixed.transpose()) * (inverse * inverse)
            + (dyad(&pa, &pa) * curve_a + dyad(&pb, &pb) * curve_b) * (inverse * inverse);
        let by_frame = |u: &Vector3, pu: &Vector3, ut: &Vector3, slope: f64, curve: f64| {
            (dyad(pu, ut) * curve - across * cross(u) * slope) * inverse
        };
        let da = by_frame(a, &pa, &at, slope_a, curve_a);
        let db = by_frame(b, &pb, &bt, slope_b, curve_b);

        let twist = 2.0 * arc_tangent(e.half_twist);
        let scale = 1.0 / (1.0 + cos_ab);
        let m = (a + b) * scale;
        let moment = self.torsion * twist;
        let stiff = dyad(&m, &m) * self.torsion;
        let turn_a = (cross(a) + dyad(&m, &ab)) * (moment * scale);
        let turn_b = (cross(b) - dyad(&m, &ab)) * (moment * scale);
        let curved = dyad(&ab, &ab) * curve_ab;
        let aa = (dyad(a, t) - identity * cos_a) * slope_a
            + dyad(&at, &at) * curve_a
            + (dyad(a, b) - identity * cos_ab) * slope_ab
            + curved
            + stiff
            + turn_a;
        let bb = (dyad(b, t) - identity * cos_b) * slope_b
            + dyad(&bt, &bt) * curve_b
            + (dyad(b, a) - identity * cos_ab) * slope_ab
            + curved
            + stiff
            - turn_b;
        let mutual = (identity * cos_ab - dyad(b, a)) * slope_ab - curved - stiff + turn_b;
        let mut force = SegmentForce {
            force: -pull * inverse - t * tension,
            start_torque: -at * slope_a - ab * slope_ab + m * moment,
            end_torque: -bt * slope_b + ab * slope_ab - m * moment,
        };
        let mut stiffness = SegmentStiffness {
            dd,
            da,
            db,
            aa,
            ab: mutual,
            bb,
        };
        if self.flatness != 0.0 {
            let slopes = Slopes::new(self, start, end, &e);
            force += slopes.force(self, &e);
            slopes.add_stiffness(self, &e, &mut stiffness);
        }
        (force, stiffness)
    }

    /// The negative part of ∂g_d/∂d \[N/m\]: what a compressed segment lacks of stiffness across its chord.
    pub(crate) fn compression(&self, start: Pose, end: Pose) -> Matrix3 {
        let span = end.position - start.position;
        let length = span.norm();
        let tension = self.axial * (length - self.rest_length);
        let across = Matrix3::identity() - dyad(&span, &span) / (length * length);
        across * (tension.min(0.0) / length)
    }

    /// Kelvin–Voigt damping matrix in the blocks of [`SegmentStiffness`]: minus the derivative of
    /// [`Segment::viscous_force`] by the velocities, symmetric and positive semi-definite.
    pub fn damping(&self, start: Pose, end: Pose) -> SegmentStiffness {
        let span = end.position - start.position;
        let length = span.norm();
        let t = span / length;
        let along = dyad(&t, &t);
        let across = Matrix3::identity() - along;
        let (own, other) = self.end_stiffness();
        let [own, other] = [own, other].map(|bend| self.retardation * bend);
        let both = own + other;
        let twist = along * (self.retardation * self.torsion);
        let shear = cross(&t) * (both / length);
        SegmentStiffness {
            dd: along * (self.retardation * self.axial) + across * (2.0 * both / (length * length)),
            da: shear,
            db: shear,
            aa: across * own + twist,
            ab: across * other - twist,
            bb: across * own + twist,
        }
    }
}
