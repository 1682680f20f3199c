//! Hydrodynamic points, the Gauss points of the segments, and what passes between fibres and flow there.

use crate::hydrodynamics::{DragResponse, Resistance};
use crate::{Matrix3, Vector3};
use wide::f64x4;

/// The flow at the hydrodynamic points, in the order of the points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ambient {
    /// Velocity u at the end of the step \[m/s\].
    pub velocity: Vec<Vector3>,
    /// gradient\[i\]\[j\] = ∂u_i/∂x_j \[1/s\], by point or by pair of points: see [`Ambient::gradient_at`].
    pub gradient: Vec<Matrix3>,
    /// Points 2k and 2k + 1 share a gradient.
    pub paired: bool,
    /// Change of the velocity in the step, uniform in time \[m/s\]; empty where it is held.
    pub change: Vec<Vector3>,
    /// The part of `change` that comes from the way of the point through the flow, Δt v·∇u \[m/s\]; empty where `change` is
    /// that at a fixed place, and may be where the fluid's inertia is not in the laws.
    pub travel: Vec<Vector3>,
    /// How far the velocity gives way in the step to a force on the fluid at the point \[m/(s·N)\]; empty where the flow is
    /// what it is. Laws of resistance z then act as z/(1 + z·yielding).
    pub yielding: Vec<f64>,
}

impl Ambient {
    /// Velocity at a point after the fraction `moment` of the step.
    #[inline(always)]
    pub fn velocity_at(&self, point: usize, moment: f64) -> Vector3 {
        let last = self.velocity[point];
        let change = self.change.get(point);
        change.map_or(last, |change| last + change * (moment - 1.0))
    }

    /// Velocity gradient around a point \[1/s\].
    #[inline(always)]
    pub fn gradient_at(&self, point: usize) -> &Matrix3 {
        &self.gradient[point >> usize::from(self.paired)]
    }

    /// From the flow at the place of a point in the middle of a step of `dt` \[s\], of second order: `velocity` and the
    /// columns ∂u/∂x_j of `gradient` as they are at its start, `slope` = ∂u/∂t. The velocity at the end of the step, its
    /// change as a point of `speed` meets it, and the part of that that comes from its way. A fourth component is carried
    /// along for the sake of vector registers.
    #[inline(always)]
    pub fn met(
        velocity: f64x4,
        gradient: [f64x4; 3],
        slope: f64x4,
        speed: &Vector3,
        dt: f64,
    ) -> [f64x4; 3] {
        let [x, y, z] = gradient;
        let travel = dt * (x * speed.x + y * speed.y + z * speed.z);
        let growth = dt * slope;
        let change = growth + travel;
        let end = velocity + 0.5 * (growth + change);
        [end, change, travel]
    }

    /// From the flow at the places of points in the middle of a step of `dt` \[s\], with ∂u/∂t \[m/s²\] as `change` where
    /// that is not empty, to what points with a gradient each, of these `speeds` \[m/s\] meet: see [`Ambient::met`].
    pub fn meet(&mut self, speeds: &[Vector3], dt: f64) {
        self.change.resize(speeds.len(), Vector3::zeros());
        self.travel.resize(speeds.len(), Vector3::zeros());
        let flow = self.velocity.iter_mut().zip(&self.gradient);
        let changes = self.change.iter_mut().zip(&mut self.travel);
        let four = |v: &Vector3| f64x4::from([v.x, v.y, v.z, 0.0]);
        let three = |v: f64x4| Vector3::from_row_slice(&v.to_array()[..3]);
        for (((u, gradient), (change, travel)), speed) in flow.zip(changes).zip(speeds) {
            let columns = [0, 1, 2].map(|c| four(&gradient.column(c).into()));
            let met = Self::met(four(u), columns, four(change), speed, dt);
            [*u, *change, *travel] = met.map(three);
        }
    }

    /// `drag` per length, less what the flow gives way to it over `length` of fibre; and the factor that is left across.
    pub(crate) fn yielded(&self, point: usize, drag: Resistance, length: f64) -> (Resistance, f64) {
        let Some(yielding) = self.yielding.get(point) else {
            return (drag, 1.0);
        };
        let left = |z: f64| 1.0 / (1.0 + z * length * yielding);
        let (normal, axial) = (left(drag.normal), left(drag.axial));
        let yielded = Resistance {
            normal: normal * drag.normal,
            axial: axial * drag.axial,
        };
        (yielded, normal)
    }

    /// The same for drag with derivatives at a `slip`: z/(1 + zc) changes by 1/(1 + zc)² of the change of z.
    pub(crate) fn yielded_response(
        &self,
        point: usize,
        drag: DragResponse,
        length: f64,
        tangent: &Vector3,
        slip: &Vector3,
    ) -> (DragResponse, f64) {
        if self.yielding.is_empty() {
            return (drag, 1.0);
        }
        let law = drag.resistance;
        let (resistance, left) = self.yielded(point, law, length);
        let squares = Resistance {
            normal: left * left,
            axial: (resistance.axial / law.axial.max(f64::MIN_POSITIVE)).powi(2),
        }
        .tensor(tangent);
        let by_slip = squares * (drag.by_slip - law.tensor(tangent));
        let by_tangent = squares * (drag.by_tangent - law.turning(tangent, slip));
        let yielded = DragResponse {
            resistance,
            by_slip: resistance.tensor(tangent) + by_slip,
            by_tangent: resistance.turning(tangent, slip) + by_tangent,
        };
        (yielded, left)
    }
}

/// A flow given by a formula: velocity \[m/s\] and gradient \[1/s\] at a place \[m\], unwrapped, and a fraction of the step.
pub type FlowFormula<'a> = &'a (dyn Fn(&Vector3, f64) -> (Vector3, Matrix3) + Sync);

/// What the fibres do to the flow at the hydrodynamic points, mean over the step: minus what they took.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reaction {
    /// Force on the fluid \[N\].
    pub force: Vec<Vector3>,
    /// Torque on the fluid about the point \[N·m\].
    pub torque: Vec<Vector3>,
}

/// The hydrodynamic points of a rank: those of the first segment along the fibre, then of the next, and so on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Position \[m\], unwrapped.
    pub position: Vec<Vector3>,
    /// Velocity of the fibre there \[m/s\].
    pub velocity: Vec<Vector3>,
}

/// Points of a segment: two Gauss points in each of `points / 2` equal parts, so that drag and its moment are
/// integrated exactly for a slip that is linear along the part.
#[inline(always)]
pub(crate) fn abscissa(point: usize, points: usize) -> f64 {
    // (1 − 1/√3)/2
    const FIRST: f64 = 0.211_324_865_405_187_1;
    let parts = points / 2;
    let within = if point.is_multiple_of(2) {
        FIRST
    } else {
        1.0 - FIRST
    };
    ((point / 2) as f64 + within) / parts as f64
}

/// Number of points of a segment of this length when its parts may be `spacing` long.
pub(crate) fn point_count(length: f64, spacing: f64) -> usize {
    2 * (length / spacing).ceil().max(1.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_integrate_cubics_exactly() {
        for parts in [1, 2, 5] {
            let n = 2 * parts;
            let integral =
                |power: i32| (0..n).map(|p| abscissa(p, n).powi(power)).sum::<f64>() / n as f64;
            for power in 0..4 {
                let exact = 1.0 / f64::from(power + 1);
                assert!((integral(power) - exact).abs() < 1e-15);
            }
        }
        assert_eq!(point_count(1.0, f64::INFINITY), 2);
        assert_eq!(point_count(1.0, 0.4), 6);
    }
}
