//! The part of a fibre's matrix that ties all its nodes: A − b W with three columns b (the shares b_i of the nodes, times
//! the identity) and three rows W, solved with the factors of A by Sherman, Morrison and Woodbury's formula.

use super::Workspace;
use super::blocks::{factor, solve};
use crate::{Matrix3, Vector3};
use nalgebra::Vector6;

/// b, W and what the solution needs of them.
#[derive(Default)]
pub(super) struct LowRank {
    pub active: bool,
    /// b_i.
    pub share: Vec<f64>,
    /// W_i.
    pub response: Vec<Matrix3>,
    /// A⁻¹ b.
    columns: [Vec<Vector6<f64>>; 3],
    /// (I − W A⁻¹ b)⁻¹
    answer: Matrix3,
}

impl LowRank {
    pub fn resize(&mut self, nodes: usize) {
        self.share.resize(nodes, 0.0);
        self.response.resize(nodes, Matrix3::zeros());
    }

    pub fn clear(&mut self) {
        self.active = false;
        self.share.fill(0.0);
        self.response.fill(Matrix3::zeros());
    }

    /// W x.
    fn respond(response: &[Matrix3], x: &[Vector6<f64>], paired: bool) -> Vector3 {
        let each = response.iter().enumerate();
        each.map(|(i, w)| {
            let (row, first) = place(i, paired);
            w * x[row].fixed_rows::<3>(first)
        })
        .sum()
    }
}

/// Row of a node's position and its first unknown there: two nodes share a row where there are no rotations.
pub(super) fn place(node: usize, paired: bool) -> (usize, usize) {
    if paired {
        (node / 2, 3 * (node % 2))
    } else {
        (node, 0)
    }
}

impl Workspace {
    /// Factors the matrix in place.
    pub(super) fn factor(&mut self) {
        factor(&mut self.rows);
        let low = &mut self.low_rank;
        if !low.active {
            return;
        }
        let mut tied = Matrix3::identity();
        for (c, column) in low.columns.iter_mut().enumerate() {
            column.resize(self.rows.len(), Vector6::zeros());
            column.fill(Vector6::zeros());
            for (i, share) in low.share.iter().enumerate() {
                let (row, first) = place(i, self.paired);
                column[row][first + c] = *share;
            }
            solve(&self.rows, column);
            let moved = LowRank::respond(&low.response, column, self.paired);
            let left = tied.column(c) - moved;
            tied.set_column(c, &left);
        }
        low.answer = crate::blocktri::inverse(&tied);
    }

    /// Replaces the right-hand side by the answer.
    pub(super) fn solve(&mut self) {
        solve(&self.rows, &mut self.rhs);
        let low = &self.low_rank;
        if !low.active {
            return;
        }
        let pull = low.answer * LowRank::respond(&low.response, &self.rhs, self.paired);
        for (i, x) in self.rhs.iter_mut().enumerate() {
            for (c, column) in low.columns.iter().enumerate() {
                *x += column[i] * pull[c];
            }
        }
    }
}
