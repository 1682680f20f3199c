//! Numbers that hydrodynamic points carry for others, through steps, changes of owner and restarts.

use crate::{FibreSystem, Reaction};

/// The same count for every point, flat.
#[derive(Clone, Debug, Default)]
pub(crate) struct Carried {
    pub width: usize,
    pub values: Vec<f64>,
}

impl FibreSystem {
    /// Lets every point carry `width` numbers, zeros at first; those that are carried stay when there are as many already.
    pub fn carry(&mut self, width: usize) {
        if self.carried.width != width {
            self.carried.width = width;
            self.carried.values = vec![0.0; width * self.point_count()];
        }
    }

    /// What the points carry, in their order.
    pub fn carried(&self) -> &[f64] {
        &self.carried.values
    }

    /// What the points carry, and what they did to the flow in the last step.
    pub fn carried_mut(&mut self) -> (&mut [f64], &Reaction) {
        (&mut self.carried.values, &self.reaction)
    }
}
