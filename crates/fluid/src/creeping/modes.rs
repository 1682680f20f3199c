//! Bodies in the velocity block of the preconditioner: their motions, strains and links by the Woodbury formula.
//!
//! With Φ the columns s_i p_m(x_i − x_k) of the modes p_m of every body, 1 and x (of each component of velocity), what bodies add to the
//! momentum equation is nearly Φ Q Φᵀ: of a body of its own κ times what is not rigid, of linked ones the links. Then
//!
//! ```text
//! (A + Φ Q Φᵀ)⁻¹ = A⁻¹ − A⁻¹ Φ (1 + Q M)⁻¹ Q Φᵀ A⁻¹,   M = Φᵀ A⁻¹ Φ
//! ```
//!
//! with A the viscous operator. M is dense and small; it changes little while the bodies move little, and is kept.

use super::bodies::{Bodies, BodyPart};
use crate::inverse::Inverse;
use fibreflow_parallel::Communicator;
use fibreflow_solve::{CgSettings, ConjugateGradients, SolveError};
use nalgebra::{DMatrix, DVector, Dyn, LU, SMatrix};
use std::sync::Arc;

/// Inner solves where they are iterative: M must be symmetric and belong to them.
pub(super) const ACCURATE: CgSettings = CgSettings {
    relative_tolerance: 1e-3,
    absolute_tolerance: 0.0,
    max_iterations: 200,
};

/// Eigenvalues of a Gram matrix below this part of the largest are those of modes that a body has too few nodes for.
const DEPENDENT: f64 = 1e-10;

/// What bodies do to the viscous solves.
#[derive(Default)]
pub(super) struct BodyModes {
    /// Directions in which bodies have an extent; components of the velocity that they touch.
    axes: Vec<usize>,
    /// Length that makes modes numbers \[m\].
    scale: f64,
    /// Bodies of the next solve.
    parts: Arc<Vec<BodyPart>>,
    /// Q; index (component, body, mode).
    resistance: DMatrix<f64>,
    /// ν M by kind of viscous solve; empty: to be made.
    mobility: Vec<DMatrix<f64>>,
    /// 1 + QM; none: to be made.
    factor: Option<LU<f64, Dyn, Dyn>>,
    /// Φᵀ z and what corrects it.
    moments: DVector<f64>,
}

impl BodyModes {
    /// Takes the bodies of the next solves.
    pub fn fit(&mut self, bodies: &Bodies, communicator: &Communicator) {
        (self.axes, self.scale) = bodies.extent();
        self.parts = bodies.shared_parts();
        self.resistance = bodies.resistance_of_modes(self, communicator);
        self.factor = None;
        self.mobility.clear();
    }

    /// Forgets M, of another viscous operator.
    pub fn forget(&mut self) {
        self.mobility.clear();
    }

    /// False without bodies.
    pub fn active(&self) -> bool {
        !self.parts.is_empty()
    }

    /// Components of velocity.
    pub fn axes(&self) -> &[usize] {
        &self.axes
    }

    /// Modes of a body and component.
    pub fn modes(&self) -> usize {
        1 + self.axes.len()
    }

    /// Of a component.
    fn unknowns(&self) -> usize {
        self.parts.len() * self.modes()
    }

    /// p_m at an arm.
    pub fn mode(&self, m: usize, arm: &[f64; 3]) -> f64 {
        if m == 0 {
            1.0
        } else {
            arm[self.axes[m - 1]] / self.scale
        }
    }

    /// Makes what is missing. Collective.
    pub fn prepare(
        &mut self,
        viscous: &mut [Inverse],
        (solver, viscosity): ([usize; 3], f64),
        krylov: &mut ConjugateGradients<f64>,
        (rhs, answer): (&mut [f64], &mut [f64]),
        communicator: &Communicator,
    ) -> Result<(), SolveError> {
        if !self.active() {
            return Ok(());
        }
        let unknowns = self.unknowns();
        if self.mobility.is_empty() {
            self.factor = None;
            let mut mobility = Vec::with_capacity(viscous.len());
            for (kind, inverse) in viscous.iter_mut().enumerate() {
                let used = self.axes.iter().any(|&axis| solver[axis] == kind);
                let unknowns = if used { unknowns } else { 0 };
                let mut columns = DMatrix::zeros(unknowns, unknowns);
                for (k, part) in self.parts.iter().enumerate().filter(|_| used) {
                    for m in 0..self.modes() {
                        rhs.fill(0.0);
                        for ((&i, share), arm) in part.entries() {
                            rhs[i as usize] += share * self.mode(m, arm);
                        }
                        inverse.solve(krylov, rhs, answer, &ACCURATE)?;
                        let mut column = columns.column_mut(k * self.modes() + m);
                        for (l, part) in self.parts.iter().enumerate() {
                            for n in 0..self.modes() {
                                let entries = part.entries();
                                let terms = entries.map(|((&i, share), arm)| {
                                    share * self.mode(n, arm) * answer[i as usize]
                                });
                                column[l * self.modes() + n] = terms.sum();
                            }
                        }
                    }
                }
                communicator.sum_slice(columns.as_mut_slice());
                mobility.push(0.5 * (&columns + columns.transpose()));
            }
            self.mobility = mobility;
        }
        if self.factor.is_none() {
            let mut matrix = DMatrix::identity(self.resistance.nrows(), self.resistance.ncols());
            for (c, &axis) in self.axes.iter().enumerate() {
                let mobility = &self.mobility[solver[axis]];
                let columns = self.resistance.columns(c * unknowns, unknowns);
                let product = columns * mobility / viscosity;
                let mut block = matrix.columns_mut(c * unknowns, unknowns);
                block += product;
            }
            self.factor = Some(matrix.lu());
        }
        Ok(())
    }

    /// Φᵀ z → (1 + QM)⁻¹ Q Φᵀ z, kept for [`BodyModes::subtract`]. Collective.
    pub fn weigh(&mut self, z: &[[f64; 4]], communicator: &Communicator) {
        let (unknowns, modes) = (self.unknowns(), self.modes());
        let mut moments = DVector::zeros(self.axes.len() * unknowns);
        for (k, part) in self.parts.iter().enumerate() {
            for ((&i, share), arm) in part.entries() {
                for m in 0..modes {
                    let weight = share * self.mode(m, arm);
                    for (c, &axis) in self.axes.iter().enumerate() {
                        moments[c * unknowns + k * modes + m] += weight * z[i as usize][axis];
                    }
                }
            }
        }
        communicator.sum_slice(moments.as_mut_slice());
        let loads = &self.resistance * moments;
        // A singular matrix corrects nothing.
        let solved = self.factor.as_ref().and_then(|f| f.solve(&loads));
        self.moments = solved.unwrap_or_else(|| DVector::zeros(loads.len()));
    }

    /// Minus Φ times that, of the c-th of [`BodyModes::axes`], into `rhs`, by ν.
    pub fn subtract(&self, c: usize, viscosity: f64, rhs: &mut [f64]) {
        let (unknowns, modes) = (self.unknowns(), self.modes());
        rhs.fill(0.0);
        for (k, part) in self.parts.iter().enumerate() {
            let loads = &self.moments.as_slice()[c * unknowns + k * modes..][..modes];
            for ((&i, share), arm) in part.entries() {
                let load = loads.iter().enumerate();
                let load: f64 = load.map(|(m, load)| load * self.mode(m, arm)).sum();
                rhs[i as usize] -= share * load / viscosity;
            }
        }
    }
}

/// Inverse of a Gram matrix on what it spans.
pub(super) fn inverse(gram: DMatrix<f64>) -> DMatrix<f64> {
    let eigen = gram.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let inverse = eigen.eigenvalues.map(|e| {
        if e > DEPENDENT * largest {
            1.0 / e
        } else {
            0.0
        }
    });
    &eigen.eigenvectors * DMatrix::from_diagonal(&inverse) * eigen.eigenvectors.transpose()
}

/// A 6 × 6 block of a link.
pub(super) fn block(matrix: &SMatrix<f64, 12, 12>, row: usize, column: usize) -> DMatrix<f64> {
    let view = matrix.fixed_view::<6, 6>(6 * row, 6 * column);
    DMatrix::from_iterator(6, 6, view.iter().copied())
}
