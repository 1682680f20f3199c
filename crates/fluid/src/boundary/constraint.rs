//! What a node's velocity may not do.

use crate::settings::{dot, length};
use fibreflow_mesh::BoundaryNode;

/// A node whose velocity is not free: increments are multiplied by `projector`, zero where the velocity is given.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Constraint {
    pub node: u32,
    pub projector: [[f64; 3]; 3],
}

impl Constraint {
    /// P v.
    pub fn admit(&self, v: [f64; 4]) -> [f64; 4] {
        let row = |r: [f64; 3]| r[0] * v[0] + r[1] * v[1] + r[2] * v[2];
        [
            row(self.projector[0]),
            row(self.projector[1]),
            row(self.projector[2]),
            0.0,
        ]
    }
}

/// I − Σ n nᵀ over the distinct normals of a node's slip patches; None without any.
///
/// Normals within 20° of the plane spanned so far count as the same surface, curved.
pub(super) fn slip_projector(
    shares: &[BoundaryNode],
    is_slip: impl Fn(&BoundaryNode) -> bool,
) -> Option<[[f64; 3]; 3]> {
    const SAME_SURFACE: f64 = 0.34;
    let mut projector = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut normals = 0;
    for share in shares.iter().filter(|s| is_slip(s)) {
        let size = length(share.area);
        if size == 0.0 {
            continue;
        }
        let normal = share.area.map(|a| a / size);
        let rest = projector.map(|row| dot(row, normal));
        let left = length(rest);
        if left < SAME_SURFACE {
            continue;
        }
        let direction = rest.map(|r| r / left);
        for (row, a) in projector.iter_mut().zip(direction) {
            row.iter_mut().zip(direction).for_each(|(p, b)| *p -= a * b);
        }
        normals += 1;
    }
    (normals > 0).then_some(projector)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share(area: [f64; 3]) -> BoundaryNode {
        BoundaryNode {
            node: 0,
            patch: 0,
            area,
        }
    }

    #[test]
    fn slip_corner_leaves_the_edge_direction() {
        let shares = [share([0.0, -2.0, 0.0]), share([0.0, 0.0, 3.0])];
        let projector = slip_projector(&shares, |_| true).expect("two normals");
        let constraint = Constraint { node: 0, projector };
        assert_eq!(constraint.admit([1.0, 2.0, 3.0, 0.0]), [1.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn nearly_parallel_shares_are_one_surface() {
        let shares = [share([0.0, -2.0, 0.0]), share([0.2, -2.0, 0.0])];
        let projector = slip_projector(&shares, |_| true).expect("one normal");
        let constraint = Constraint { node: 0, projector };
        assert_eq!(constraint.admit([1.0, 2.0, 3.0, 0.0]), [1.0, 0.0, 3.0, 0.0]);
    }

    #[test]
    fn without_slip_patches_nothing_is_projected() {
        assert!(slip_projector(&[share([1.0, 0.0, 0.0])], |_| false).is_none());
    }
}
