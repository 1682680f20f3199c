//! Forms of a fibre's axis.

use super::PlacementError;
use super::error::check;
use crate::Vector3;
use std::f64::consts::PI;

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
    /// Any nodes; length and number of segments are theirs.
    Nodes(Vec<Vector3>),
}

impl CentreLine {
    pub(super) fn check(&self) -> Result<(), PlacementError> {
        match self {
            Self::Straight | Self::Nodes(_) => Ok(()),
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
            Self::Nodes(nodes) => nodes.clone(),
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

    #[test]
    fn a_straight_line_is_centred() {
        let nodes = CentreLine::Straight.nodes(2.0, 2);
        assert_eq!(nodes, vec![-Vector3::x(), Vector3::zeros(), Vector3::x()]);
    }
}
