//! What is added to the rate of change of a sub-step where a flow has it: linear forcing, stress of unresolved motion.

use crate::rows::{self, nothing, sum};
use crate::{Fluid, Forcing};
use fibreflow_parallel::block_sums;

impl Fluid {
    /// Adds to `momentum.rate` and, times Δt γ, to `momentum.next`, a velocity or an impulse. The velocity is valid.
    pub(super) fn add_rates(&mut self, gamma: f64, velocity: bool) {
        if let Forcing::Linear { rate, energy } = self.settings.forcing {
            self.add_linear_forcing((rate, energy), gamma, velocity);
        }
        self.add_eddy_stress(gamma, velocity);
    }

    /// V ∇·(2ν_t S), explicit whatever diffusion is.
    fn add_eddy_stress(&mut self, gamma: f64, is_velocity: bool) {
        let Some(eddy) = &mut self.eddy else {
            return;
        };
        let (operators, momentum) = (&self.operators, &mut self.momentum);
        let inverse = operators.inverse_volumes();
        let out = (&mut momentum.rate[..], &mut momentum.next[..inverse.len()]);
        eddy.apply(operators, &self.velocity, out, |i, force, rate, next| {
            let scale = gamma * if is_velocity { inverse[i] } else { 1.0 };
            for c in 0..3 {
                rate[c] += force[c];
                next[c] += scale * force[c];
            }
        });
    }

    /// The bound of the spectrum at the start, by which the first step is chosen. Collective.
    pub(crate) fn find_eddy_rate(&mut self) {
        let Some(eddy) = &mut self.eddy else {
            return;
        };
        let rows = self.operators.volumes().len();
        let (mut a, mut b) = (nothing(rows), nothing(rows));
        let out = (&mut a[..], &mut b[..]);
        eddy.apply(&self.operators, &self.velocity, out, |_, _, (), ()| {});
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
