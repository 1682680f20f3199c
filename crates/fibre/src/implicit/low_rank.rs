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
        for column in &mut self.columns {
            column.resize(nodes, Vector6::zeros());
        }
    }

    pub fn clear(&mut self) {
        self.active = false;
        self.share.fill(0.0);
        self.response.fill(Matrix3::zeros());
    }

    /// W x.
    fn respond(response: &[Matrix3], x: &[Vector6<f64>]) -> Vector3 {
        let pairs = response.iter().zip(x);
        pairs.map(|(w, x)| w * x.fixed_rows::<3>(0)).sum()
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
            for (x, share) in column.iter_mut().zip(&low.share) {
                *x = Vector6::zeros();
                x[c] = *share;
            }
            solve(&self.rows, column);
            let moved = LowRank::respond(&low.response, column);
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
        let pull = low.answer * LowRank::respond(&low.response, &self.rhs);
        for (i, x) in self.rhs.iter_mut().enumerate() {
            for (c, column) in low.columns.iter().enumerate() {
                *x += column[i] * pull[c];
            }
        }
    }
}
