//! The implicit viscous operator on increments that keep to their constraints.

use crate::boundary::Constraint;
use fibreflow_parallel::Halo;
use fibreflow_solve::{Helmholtz, LinearOperator};

/// P (V + c A) for increments x = P x: P takes out the normal component on slip nodes.
pub(super) struct Confined<'a> {
    pub helmholtz: Helmholtz<'a>,
    pub constraints: &'a [Constraint],
}

impl LinearOperator<[f64; 4]> for Confined<'_> {
    fn halo(&self) -> &Halo {
        LinearOperator::<[f64; 4]>::halo(&self.helmholtz)
    }

    fn apply(&self, x: &mut [[f64; 4]], y: &mut [[f64; 4]]) {
        self.helmholtz.apply(x, y);
        for constraint in self.constraints {
            let y = &mut y[constraint.node as usize];
            *y = constraint.admit(*y);
        }
    }
}
