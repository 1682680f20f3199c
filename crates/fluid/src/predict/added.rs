//! What is added to the rate of change of a sub-step where a flow has it: linear forcing.

use crate::rows::{self, sum};
use crate::{Fluid, Forcing};
use fibreflow_parallel::block_sums;

impl Fluid {
    /// Adds to `momentum.rate` and, times Δt γ, to `momentum.next`, a velocity or an impulse. The velocity is valid.
    pub(super) fn add_rates(&mut self, gamma: f64, velocity: bool) {
        if let Forcing::Linear { rate, energy } = self.settings.forcing {
            self.add_linear_forcing((rate, energy), gamma, velocity);
        }
    }

    /// V A (u − ū), see [`Forcing::Linear`]: no net force.
    fn add_linear_forcing(
        &mut self,
        (rate, energy): (f64, Option<f64>),
        gamma: f64,
        is_velocity: bool,
    ) {
        let (mean, kinetic) = self.fluctuation();
        let factor = match energy {
            Some(held) if kinetic > 0.0 => rate * held / kinetic,
            _ => rate,
        };
        let (volumes, inverse) = (self.operators.volumes(), self.operators.inverse_volumes());
        let (velocity, momentum) = (&self.velocity, &mut self.momentum);
        let next = &mut momentum.next[..inverse.len()];
        rows::each_pair(&mut momentum.rate, next, sum, |i, rate, next| {
            let scale = gamma * if is_velocity { inverse[i] } else { 1.0 };
            for c in 0..3 {
                let push = factor * volumes[i] * (velocity[i][c] - mean[c]);
                rate[c] += push;
                next[c] += scale * push;
            }
            0.0
        });
    }

    /// Mean velocity ū \[m/s\] and ½⟨|u − ū|²⟩ \[m²/s²\]. Collective.
    pub(crate) fn fluctuation(&self) -> ([f64; 3], f64) {
        let (volumes, velocity) = (self.operators.volumes(), &self.velocity);
        let communicator = self.mesh.halo.communicator();
        let total = self.operators.geometry.total_volume;
        let mut mean = block_sums::<3>(volumes.len(), |range| {
            range.fold([0.0; 3], |s, i| {
                std::array::from_fn(|c| s[c] + volumes[i] * velocity[i][c])
            })
        });
        communicator.sum_slice(&mut mean);
        let mean = mean.map(|m| m / total);
        let [square] = block_sums::<1>(volumes.len(), |range| {
            let square = |i: usize| {
                let part = |c: usize| (velocity[i][c] - mean[c]).powi(2);
                volumes[i] * (part(0) + part(1) + part(2))
            };
            [range.map(square).sum()]
        });
        (mean, 0.5 * communicator.sum(square) / total)
    }
}
