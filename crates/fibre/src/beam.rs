//! The beam element between two nodes, derived from an energy of total strains.
//!
//! A node carries a position and a frame. Rigidly attached to each node frame are, for the segment on its either side,
//! an *end frame* that coincides with the segment's own frame in the stress-free shape; natural curvature and twist
//! are held in these constant offsets and nowhere else. With a1, b1 the tangents (x axes) of the two end frames, t the
//! unit chord, l its length and
//!
//! - θ_a = ∠(a1, t), θ_b = ∠(b1, t), δ = ∠(a1, b1),
//! - τ the twist that is left when a1 is brought onto b1 by the smallest rotation,
//!
//! the energy is
//!
//! ```text
//! U = ½ (EA/l₀)(l − l₀)² + (EI/l₀)[3 θ_a² + 3 θ_b² − δ²] + ½ (GJ/l₀) τ²
//! ```
//!
//! In a plane, with signed angles, the bracket is 2(α² + αβ + β²): the cubic Hermite beam of Euler and Bernoulli. It
//! needs no element frame because the section is round, so forces are closed expressions of vectors (the form of
//! Kuzkin & Asonov 2012, Phys. Rev. E 86, 051301, with angles in place of cosines). Total strains do not drift, unlike
//! the rates of Kunhappan 2018, eqs. 3.11–3.17. Nothing changes under rigid motion, so linear and angular momentum
//! are kept.
//!
//! A beam that gives way to shear (Timoshenko) has, with Φ = 12EI/(κGA l₀²), 3/(1 + Φ) for 3 and (2 − Φ)/(2(1 + Φ)) for
//! the factor 1 of δ². A section that bends more easily one way, EI₂ in the plane of the first two axes of the end
//! frames and EI₃ in that of the first and third, adds with u = a₂·t, w = a₃·t of either end and
//! r = (EI₂ − EI₃)/(EI₂ + EI₃), EI being the mean of the two,
//!
//! ```text
//! U' = r (EI/l₀)[3 u_a² + 3 u_b² − (u_a − u_b)² − 3 w_a² − 3 w_b² + (w_a − w_b)²]
//! ```

use crate::{Quaternion, Vector3};

mod flat;
mod hinge;
mod tangent;

use flat::Slopes;
pub(crate) use hinge::{Hinge, HingeStiffness};
pub use tangent::SegmentStiffness;

/// Constants of one segment: stiffness over rest length and the stress-free end frames.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// Stress-free chord length l₀ \[m\].
    pub rest_length: f64,
    /// EA/l₀ \[N/m\].
    pub axial: f64,
    /// Radius of the section; of the round one of the same area if it is not round \[m\].
    pub radius: f64,
    /// EI/l₀, over 1 + Φ with shear \[N·m\].
    pub bending: f64,
    /// EI/l₀ times (2 − Φ)/(2(1 + Φ)): the same without shear \[N·m\].
    pub mutual: f64,
    /// r, between −1 and 1; 0 for a section that bends alike in all directions.
    pub flatness: f64,
    /// GJ/l₀ \[N·m\].
    pub torsion: f64,
    /// Kelvin–Voigt retardation time \[s\]: damping matrix = this × stiffness matrix.
    pub retardation: f64,
    /// Rotation from the frame of the first node to its end frame.
    pub start_frame: Quaternion,
    /// Rotation from the frame of the second node to its end frame.
    pub end_frame: Quaternion,
}

/// Position and frame of a segment's end node.
#[derive(Clone, Copy, Debug)]
pub struct Pose<'a> {
    /// Node position \[m\].
    pub position: &'a Vector3,
    /// Node frame.
    pub orientation: &'a Quaternion,
}

/// Velocity and angular velocity (space axes) of a segment's end node.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    /// \[m/s\]
    pub velocity: &'a Vector3,
    /// \[rad/s\]
    pub angular_velocity: &'a Vector3,
}

/// What a segment exerts on its two nodes; the force on the first node is `-force`.
#[derive(Clone, Copy, Debug)]
pub struct SegmentForce {
    /// Force on the second node \[N\].
    pub force: Vector3,
    /// Torque on the first node \[N·m\].
    pub start_torque: Vector3,
    /// Torque on the second node \[N·m\].
    pub end_torque: Vector3,
}

impl std::ops::AddAssign for SegmentForce {
    fn add_assign(&mut self, other: Self) {
        self.force += other.force;
        self.start_torque += other.start_torque;
        self.end_torque += other.end_torque;
    }
}

/// Elastic energy of a segment by kind \[J\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ElasticEnergy {
    /// Axial strain.
    pub stretching: f64,
    /// Curvature.
    pub bending: f64,
    /// Torsion.
    pub torsion: f64,
}

impl ElasticEnergy {
    /// Sum of the three kinds \[J\].
    pub fn total(&self) -> f64 {
        self.stretching + self.bending + self.torsion
    }
}

/// End-frame tangents and relative rotation of a segment.
pub(crate) struct Strain {
    pub chord: Vector3,
    pub length: f64,
    pub inverse_length: f64,
    pub start_tangent: Vector3,
    pub end_tangent: Vector3,
    /// tan(τ/2)
    pub half_twist: f64,
}

impl Strain {
    #[inline(always)]
    pub fn new(segment: &Segment, start: Pose, end: Pose) -> Self {
        let a = start.orientation * segment.start_frame;
        let b = end.orientation * segment.end_frame;
        let span = end.position - start.position;
        let length = span.norm();
        let inverse_length = 1.0 / length;
        // The twist part of a⁻¹b about the tangent (swing–twist decomposition); the ratio ignores the double cover.
        let w = a.w * b.w + a.i * b.i + a.j * b.j + a.k * b.k;
        let x = a.w * b.i - a.i * b.w - a.j * b.k + a.k * b.j;
        Self {
            // Divided, so that what lies along an axis does so to the last bit.
            chord: span / length,
            length,
            inverse_length,
            start_tangent: tangent(&a),
            end_tangent: tangent(&b),
            half_twist: x / w,
        }
    }

    /// Elastic force and torques, given the twist τ.
    #[inline(always)]
    pub fn force(&self, segment: &Segment, twist: f64) -> SegmentForce {
        let (a, b, t) = (&self.start_tangent, &self.end_tangent, &self.chord);
        let slope_a = 3.0 * segment.bending * squared_angle_slope(a, t);
        let slope_b = 3.0 * segment.bending * squared_angle_slope(b, t);
        let mutual = a.cross(b) * (segment.mutual * squared_angle_slope(a, b));
        // ∂τ/∂(rotation of b) = (a + b)/(1 + a·b)
        let torsion = (a + b) * (segment.torsion * twist / (1.0 + a.dot(b)));
        let pull = a * slope_a + b * slope_b;
        let transverse = pull - t * pull.dot(t);
        let tension = segment.axial * (self.length - segment.rest_length);
        SegmentForce {
            force: transverse * self.inverse_length - t * tension,
            start_torque: a.cross(t) * slope_a - mutual + torsion,
            end_torque: b.cross(t) * slope_b + mutual - torsion,
        }
    }
}

/// The x axis of a frame.
#[inline(always)]
pub fn tangent(q: &Quaternion) -> Vector3 {
    Vector3::new(
        1.0 - 2.0 * (q.j * q.j + q.k * q.k),
        2.0 * (q.i * q.j + q.w * q.k),
        2.0 * (q.i * q.k - q.w * q.j),
    )
}

// θ² = Σ C_n sⁿ with s = 1 − cos θ, C_n = 2ⁿ⁺¹/(n² binom(2n, n)), cut after n = 6: 1e-4 off at θ = 1, smooth everywhere.
const SQUARED_ANGLE: [f64; 6] = [
    2.0,
    1.0 / 3.0,
    4.0 / 45.0,
    1.0 / 35.0,
    16.0 / 1575.0,
    8.0 / 2079.0,
];

/// Square of the angle between two unit vectors.
#[inline(always)]
fn squared_angle(a: &Vector3, b: &Vector3) -> f64 {
    let s = 0.5 * (a - b).norm_squared();
    let c = &SQUARED_ANGLE;
    s * (c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5])))))
}

/// Derivative of [`squared_angle`] by s = 1 − a·b.
#[inline(always)]
fn squared_angle_slope(a: &Vector3, b: &Vector3) -> f64 {
    let s = 0.5 * (a - b).norm_squared();
    let c = &SQUARED_ANGLE;
    c[0] + s
        * (2.0 * c[1] + s * (3.0 * c[2] + s * (4.0 * c[3] + s * (5.0 * c[4] + s * (6.0 * c[5])))))
}

/// First and second derivative of [`squared_angle`] by s = 1 − a·b.
#[inline(always)]
fn squared_angle_slopes(a: &Vector3, b: &Vector3) -> (f64, f64) {
    let s = 0.5 * (a - b).norm_squared();
    let c = &SQUARED_ANGLE;
    let curvature =
        2.0 * c[1] + s * (6.0 * c[2] + s * (12.0 * c[3] + s * (20.0 * c[4] + s * (30.0 * c[5]))));
    (squared_angle_slope(a, b), curvature)
}

/// Squares below which [`small_arc_tangent`] is exact to round-off.
pub(crate) const SMALL_TWIST: f64 = 4e-4;

/// Arc tangent, by its series for the small angles of a fine chain.
#[inline(always)]
pub(crate) fn arc_tangent(y: f64) -> f64 {
    if y * y < SMALL_TWIST {
        small_arc_tangent(y)
    } else {
        y.atan()
    }
}

#[inline(always)]
pub(crate) fn small_arc_tangent(y: f64) -> f64 {
    let z = y * y;
    y * (1.0 - z * (1.0 / 3.0 - z * (0.2 - z * (1.0 / 7.0 - z * (1.0 / 9.0 - z / 11.0)))))
}

impl Segment {
    /// Elastic energy at the given poses.
    pub fn energy(&self, start: Pose, end: Pose) -> ElasticEnergy {
        let e = Strain::new(self, start, end);
        let (a, b, t) = (&e.start_tangent, &e.end_tangent, &e.chord);
        let twist = 2.0 * arc_tangent(e.half_twist);
        let round = 3.0 * self.bending * (squared_angle(a, t) + squared_angle(b, t))
            - self.mutual * squared_angle(a, b);
        let flat = match self.flatness {
            0.0 => 0.0,
            _ => Slopes::new(self, start, end, &e).energy(self),
        };
        ElasticEnergy {
            stretching: 0.5 * self.axial * (e.length - self.rest_length).powi(2),
            bending: round + flat,
            torsion: 0.5 * self.torsion * twist * twist,
        }
    }

    /// Elastic force and torques: the exact negative gradient of [`Segment::energy`].
    #[inline(always)]
    pub fn elastic_force(&self, start: Pose, end: Pose) -> SegmentForce {
        let e = Strain::new(self, start, end);
        let mut force = e.force(self, 2.0 * arc_tangent(e.half_twist));
        if self.flatness != 0.0 {
            force += Slopes::new(self, start, end, &e).force(self, &e);
        }
        force
    }

    /// Kelvin–Voigt force: retardation time × stiffness of the round section × strain rates. Dissipative, and zero in a
    /// rigid motion.
    pub fn viscous_force(
        &self,
        start: Pose,
        end: Pose,
        start_motion: Motion,
        end_motion: Motion,
    ) -> SegmentForce {
        let span = end.position - start.position;
        let length = span.norm();
        let t = span / length;
        let relative = end_motion.velocity - start_motion.velocity;
        let spin = t.cross(&relative) / length;
        let across = |w: Vector3| w - t * w.dot(&t);
        let a = across(start_motion.angular_velocity - spin);
        let b = across(end_motion.angular_velocity - spin);
        let twist = (end_motion.angular_velocity - start_motion.angular_velocity).dot(&t);
        let (own, other) = self.end_stiffness();
        let start_bend = (a * own + b * other) * -self.retardation;
        let end_bend = (a * other + b * own) * -self.retardation;
        let torsion = t * (self.retardation * self.torsion * twist);
        SegmentForce {
            force: t.cross(&(start_bend + end_bend)) / length
                - t * (self.retardation * self.axial * relative.dot(&t)),
            start_torque: start_bend + torsion,
            end_torque: end_bend - torsion,
        }
    }

    /// Torque by the angle of the same end and by that of the other one, for small angles: 4EI/l₀ and 2EI/l₀ without
    /// shear \[N·m\].
    fn end_stiffness(&self) -> (f64, f64) {
        (6.0 * self.bending - 2.0 * self.mutual, 2.0 * self.mutual)
    }

    /// EA ε at this length \[N\].
    pub(crate) fn tension(&self, length: f64) -> f64 {
        self.axial * (length - self.rest_length)
    }

    /// Largest tensile stress under a bending moment \[N·m\] and a tension \[N\]: M/W + N/A of a round section \[Pa\].
    pub(crate) fn tensile_stress(&self, moment: f64, tension: f64) -> f64 {
        let area = std::f64::consts::PI * self.radius * self.radius;
        4.0 * moment / (area * self.radius) + tension / area
    }

    /// [`Segment::tensile_stress`] at the two ends.
    pub(crate) fn end_stresses(&self, start: Pose, end: Pose) -> [f64; 2] {
        let span = end.position - start.position;
        let length = span.norm();
        let t = span / length;
        let f = self.elastic_force(start, end);
        [f.start_torque, f.end_torque].map(|torque| {
            let moment = (torque - t * torque.dot(&t)).norm();
            self.tensile_stress(moment, self.tension(length))
        })
    }

    /// Bound of the squared angular frequency \[1/s²\] of this segment with the masses \[kg\] it gives its two nodes and
    /// the squared radii of gyration \[m²\] across and along the tangent. The largest over all segments bounds the
    /// chain's.
    ///
    /// Stretching k(1/m_a + 1/m_b), torsion alike; bending is stiffest when both ends turn alike against the chord.
    pub fn frequency_bound(&self, masses: [f64; 2], transverse: f64, axial: f64) -> f64 {
        let mobility = 1.0 / masses[0] + 1.0 / masses[1];
        let lightest = masses[0].min(masses[1]);
        let chord = mobility / (self.rest_length * self.rest_length);
        let stiffest = 1.0 + self.flatness.abs();
        let shear = 12.0 * stiffest * self.bending * (0.5 / (lightest * transverse) + chord);
        let bow = stiffest * (6.0 * self.bending - 4.0 * self.mutual) / (lightest * transverse);
        (self.axial * mobility)
            .max(self.torsion * mobility / axial)
            .max(shear)
            .max(bow)
    }
}

/// Shares of a segment's mass that its two nodes carry: halves, but 5/12 at a fibre's end and 7/12 at the node next to
/// it (Gregory's end correction of the trapezoidal rule), so that the moment of inertia of the fibre and the kinetic
/// energy of its modes are right to third order.
pub(crate) fn mass_shares(segment: usize, segments: usize) -> [f64; 2] {
    let (first, last) = (segment == 0, segment + 1 == segments);
    match (first, last) {
        (true, false) => [5.0 / 12.0, 7.0 / 12.0],
        (false, true) => [7.0 / 12.0, 5.0 / 12.0],
        _ => [0.5, 0.5],
    }
}
