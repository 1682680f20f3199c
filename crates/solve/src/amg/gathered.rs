//! A level with few unknowns a rank, held whole by every rank: messages would cost more than the work.

use super::hierarchy::Node;
use crate::gather::Gathering;
use crate::{PairMatrix, SolveError};

/// The level and what follows, the same on every rank.
#[derive(Clone, Debug)]
pub(super) struct Gathered {
    /// Takes the right-hand side of the owned rows.
    pub(super) gathering: Gathering<f32>,
    /// D^½ of owned rows.
    pub(super) roots: Vec<f64>,
    pub(super) x: Vec<f32>,
    whole: Box<Node>,
}

impl Gathered {
    /// `build` makes the hierarchy of the whole matrix. Collective.
    pub(super) fn new(
        matrix: &PairMatrix,
        build: impl FnOnce(PairMatrix) -> Result<Node, SolveError>,
    ) -> Result<Self, SolveError> {
        let (gathering, whole) = Gathering::new(matrix)?;
        let whole = build(whole)?;
        Ok(Self {
            roots: whole.roots()[gathering.part()].to_vec(),
            x: vec![0.0; matrix.owned()],
            gathering,
            whole: Box::new(whole),
        })
    }

    /// `x` from the right-hand side. Collective.
    pub(super) fn solve(&mut self) {
        let ordered = self.gathering.collect();
        self.whole.solve(|i| ordered[i]);
        self.x
            .copy_from_slice(&self.whole.answer()[self.gathering.part()]);
    }
}
