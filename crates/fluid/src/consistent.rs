//! A start from which the time scheme does not have to recover.
//!
//! The projection is approximate: fluxes are corrected with the compact gradient, velocities with the conserving one,
//! so a nodal divergence of (L − DG)ψ stays and is taken up by later steps, the slower the shorter its wave. Started
//! from D u ≠ 0 or from the compact pressure, this transient hides second order in Δt (measured on distorted
//! hexahedra at fixed mesh: fitted order 0.3 without this module). So the initial velocity and pressure solve the wide
//! equation D P G q = D u, with D = −(V G)ᵀ, symmetric: conjugate gradients preconditioned by the compact operator.

use crate::boundary::{Boundary, Constraint};
use crate::operators::Operators;
use fibreflow_parallel::Halo;
use fibreflow_solve::{CgSettings, LinearOperator};
use std::cell::RefCell;

/// −D P G: gradient at the nodes, constraints applied, divergence of its interpolation. Rows of outlet nodes are the
/// identity.
pub(crate) struct Wide<'a> {
    operators: &'a Operators,
    constraints: &'a [Constraint],
    outlets: &'a [(u32, f64)],
    gradient: RefCell<Vec<[f64; 4]>>,
}

impl<'a> Wide<'a> {
    pub fn new(operators: &'a Operators, boundary: &'a Boundary) -> Self {
        let gradient = vec![[0.0; 4]; operators.halo().total()];
        Self {
            operators,
            constraints: &boundary.constraints,
            outlets: &boundary.outlets,
            gradient: RefCell::new(gradient),
        }
    }

    /// The spectrum reaches down to zero (chequerboards), so full convergence is neither possible nor needed: what
    /// is left belongs to waves that the gradient does not see.
    pub const SETTINGS: CgSettings = CgSettings {
        relative_tolerance: 1e-6,
        absolute_tolerance: 0.0,
        max_iterations: 100,
    };
}

impl LinearOperator<f64> for Wide<'_> {
    fn halo(&self) -> &Halo {
        self.operators.halo()
    }

    fn apply(&self, x: &mut [f64], y: &mut [f64]) {
        let gradient = &mut *self.gradient.borrow_mut();
        let volumes = self.operators.volumes();
        self.operators.gradient(x, &mut gradient[..volumes.len()]);
        for constraint in self.constraints {
            let gradient = &mut gradient[constraint.node as usize];
            *gradient = constraint.admit(*gradient);
        }
        for (gradient, volume) in gradient.iter_mut().zip(volumes) {
            gradient.iter_mut().for_each(|g| *g /= volume);
        }
        self.operators.divergence(gradient, y);
        y[..volumes.len()].iter_mut().for_each(|y| *y = -*y);
        for &(i, _) in self.outlets {
            y[i as usize] = x[i as usize];
        }
    }
}
