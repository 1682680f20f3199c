//! Forms of a fibre's axis.

use super::PlacementError;
use super::error::check;
use crate::{Quaternion, Vector3};
use std::f64::consts::{PI, TAU};

/// Form of a fibre's axis, in the fibre's own frame: x along the tangent in the middle, curved forms in the x–y plane,
/// the mean of the nodes in the origin.
#[derive(Clone, Debug, PartialEq)]
pub enum CentreLine {
    /// A straight line.
    Straight,
    /// An arc that turns by the same angle at every inner node.
    U {
        /// Angle between the two end tangents, seen from the middle: π is straight, 0 a half circle \[rad\].
        opening_angle: f64,
    },
    /// A right-handed helix about x.
    Helix {
        /// Radius of the axis \[m\].
        radius: f64,
        /// Advance along x in a turn \[m\].
        pitch: f64,
    },
    /// Straight segments that bend at every inner node by one angle, and turn about themselves by another between bends
    /// (S 2.6.1).
    Chain {
        /// Angle between neighbouring segments \[rad\].
        bend: f64,
        /// Angle between the planes of neighbouring bends \[rad\].
        turn: f64,
    },
    /// Any nodes, scaled to the length; the number of segments is theirs.
    Nodes(Vec<Vector3>),
}

impl CentreLine {
    /// # Errors
    /// [`PlacementError`] for a shape that no fibre can have.
    pub fn check(&self) -> Result<(), PlacementError> {
        match self {
            Self::Straight => Ok(()),
            Self::Chain { bend, turn } => {
                let valid = (0.0..PI).contains(bend);
                check(valid, "bend of the chain", *bend, "between 0 and π")?;
                check(
                    turn.is_finite(),
                    "turn of the chain",
                    *turn,
                    "a number of rad",
                )
            }
            Self::Helix { radius, pitch } => {
                let positive = "a positive length in m";
                check(*radius > 0.0, "radius of the helix", *radius, positive)?;
                check(
                    *pitch >= 0.0,
                    "pitch of the helix",
                    *pitch,
                    "zero or a length in m",
                )
            }
            Self::Nodes(nodes) => {
                let spans = nodes.windows(2).all(|n| (n[1] - n[0]).norm() > 0.0);
                let reason = "a shape needs two nodes, and no node twice in a row";
                let good = nodes.len() > 1 && spans;
                good.then_some(()).ok_or(PlacementError::Shape { reason })
            }
            Self::U { opening_angle } => {
                let valid = (0.0..=PI).contains(opening_angle);
                check(valid, "opening angle", *opening_angle, "between 0 and π")
            }
        }
    }

    /// The nodes of `segments` segments of equal length \[m\].
    pub fn nodes(&self, length: f64, segments: usize) -> Vec<Vector3> {
        let nodes = match self {
            Self::Straight => chain(length, segments, 0.0),
            Self::U { opening_angle } => chain(length, segments, PI - opening_angle),
            Self::Helix { radius, pitch } => helix(*radius, *pitch, length, segments),
            Self::Chain { bend, turn } => bends(length, segments, *bend, *turn),
            Self::Nodes(nodes) => {
                let own: f64 = nodes.windows(2).map(|n| (n[1] - n[0]).norm()).sum();
                nodes.iter().map(|x| x * (length / own)).collect()
            }
        };
        let mean = nodes.iter().sum::<Vector3>() / nodes.len() as f64;
        nodes.iter().map(|x| x - mean).collect()
    }
}

/// Equal segments whose directions turn by `turn` from one end tangent of the arc to the other.
fn chain(length: f64, segments: usize, turn: f64) -> Vec<Vector3> {
    let step = length / segments as f64;
    let mut nodes = vec![Vector3::zeros()];
    for k in 0..segments {
        let angle = turn * ((k as f64 + 0.5) / segments as f64 - 0.5);
        let along = Vector3::new(angle.cos(), angle.sin(), 0.0);
        nodes.push(nodes[k] + along * step);
    }
    nodes
}

/// Each segment's frame is that of the one before, turned about its axis and then bent.
fn bends(length: f64, segments: usize, bend: f64, turn: f64) -> Vec<Vector3> {
    let joint = Quaternion::from_axis_angle(&Vector3::x_axis(), turn)
        * Quaternion::from_axis_angle(&Vector3::z_axis(), bend);
    // The segment in the middle lies along x.
    let mut frame = Quaternion::identity();
    (0..segments / 2).for_each(|_| frame *= joint.inverse());
    let mut nodes = vec![Vector3::zeros()];
    for k in 0..segments {
        nodes.push(nodes[k] + frame * Vector3::x() * (length / segments as f64));
        frame *= joint;
    }
    nodes
}

/// Nodes at equal steps on a helix whose chords are `length` together, or a full turn a segment where that is too long.
fn helix(radius: f64, pitch: f64, length: f64, segments: usize) -> Vec<Vector3> {
    let step = length / segments as f64;
    let chord = |turn: f64| (pitch * turn / TAU).hypot(2.0 * radius * (0.5 * turn).sin());
    let (mut low, mut high) = (0.0, PI);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if chord(middle) < step {
            low = middle;
        } else {
            high = middle;
        }
    }
    let node = |k: usize| {
        let angle = low * (k as f64 - 0.5 * segments as f64);
        let (sine, cosine) = angle.sin_cos();
        Vector3::new(pitch * angle / TAU, radius * cosine, radius * sine)
    };
    (0..=segments).map(node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_u_has_equal_segments_equal_turns_and_the_opening_asked_for() {
        let line = CentreLine::U {
            opening_angle: 0.4 * PI,
        };
        let nodes = line.nodes(3.0, 30);
        assert_eq!(nodes.len(), 31);
        let spans: Vec<Vector3> = nodes.windows(2).map(|n| n[1] - n[0]).collect();
        assert!(spans.iter().all(|s| (s.norm() - 0.1).abs() < 1e-14));
        let turns: Vec<f64> = spans.windows(2).map(|s| s[0].angle(&s[1])).collect();
        assert!(turns.iter().all(|t| (t - 0.6 * PI / 30.0).abs() < 1e-7));
        // The end tangents lie half a turn beyond the end segments.
        let whole = spans[0].angle(&spans[29]) + turns[0];
        assert!((PI - whole - 0.4 * PI).abs() < 1e-7);
        assert!(nodes.iter().sum::<Vector3>().norm() < 1e-13);
        assert!((spans[14] + spans[15]).normalize().x > 1.0 - 1e-14);
    }

    /// Curvature R/(R² + (p/2π)²) and torsion (p/2π)/(R² + (p/2π)²).
    #[test]
    fn a_helix_has_its_length_radius_and_rise() {
        let (radius, pitch) = (0.5, 1.2);
        let nodes = CentreLine::Helix { radius, pitch }.nodes(6.0, 60);
        let spans: Vec<Vector3> = nodes.windows(2).map(|n| n[1] - n[0]).collect();
        assert!(spans.iter().all(|s| (s.norm() - 0.1).abs() < 1e-12));
        let rise = pitch / TAU;
        let square = radius * radius + rise * rise;
        let tangent = rise / square.sqrt();
        assert!(spans.iter().all(|s| (s.x / 0.1 - tangent).abs() < 2e-3));
        let turns = spans.windows(2).map(|s| s[0].angle(&s[1]) / 0.1);
        assert!(
            turns
                .into_iter()
                .all(|k| (k - radius / square).abs() < 5e-3)
        );
        // Right-handed: the tangent turns from y to z as it goes along x.
        assert!(spans[30].cross(&spans[31]).x > 0.0);
    }

    #[test]
    fn given_nodes_are_scaled() {
        let given = vec![Vector3::zeros(), Vector3::x(), Vector3::new(1.0, 2.0, 0.0)];
        let nodes = CentreLine::Nodes(given).nodes(6.0, 2);
        assert!((nodes[2] - nodes[1] - Vector3::y() * 4.0).norm() < 1e-14);
        assert!(nodes.iter().sum::<Vector3>().norm() < 1e-14);
    }

    #[test]
    fn a_straight_line_is_centred() {
        let nodes = CentreLine::Straight.nodes(2.0, 2);
        assert_eq!(nodes, vec![-Vector3::x(), Vector3::zeros(), Vector3::x()]);
    }
}
