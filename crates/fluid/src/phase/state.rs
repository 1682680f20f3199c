//! What a checkpoint holds of the order parameter.

use super::PhaseField;
use crate::{Fluid, FluidError, FluidState};

const PSI: &str = "phase.order_parameter";
const RATE: &str = "phase.rate";
const AMOUNT: &str = "phase.amount";
const POWER: &str = "phase.power";
const LAST_DT: &str = "phase.last_dt";

impl PhaseField {
    /// The state of the owned nodes. The solid is the caller's.
    pub fn state(&self) -> FluidState {
        let owned = self.rate.len();
        FluidState {
            node: vec![
                (PSI.to_owned(), 1, self.psi[..owned].to_vec()),
                (RATE.to_owned(), 1, self.rate.clone()),
            ],
            pair: Vec::new(),
            scalars: vec![
                (AMOUNT.to_owned(), self.amount),
                (POWER.to_owned(), self.power),
                (LAST_DT.to_owned(), self.last_dt),
            ],
        }
    }

    /// Goes on from a stored state: bitwise on the same ranks. Entries of others are ignored. Collective.
    ///
    /// # Errors
    /// [`FluidError::State`] when something is missing or of the wrong length, nothing is changed then; values that are not finite.
    pub fn restore(&mut self, fluid: &Fluid, state: &FluidState) -> Result<(), FluidError> {
        let owned = self.rate.len();
        let psi = state.node(PSI, 1, owned)?;
        let rate = state.node(RATE, 1, owned)?;
        let (amount, power) = (state.scalar(AMOUNT)?, state.scalar(POWER)?);
        let last_dt = state.scalar(LAST_DT)?;
        self.psi[..owned].copy_from_slice(psi);
        self.rate.copy_from_slice(rate);
        (self.amount, self.power, self.last_dt) = (amount, power, last_dt);
        fluid.mesh.halo.update(&mut self.psi);
        self.check_finite(fluid)
    }
}
