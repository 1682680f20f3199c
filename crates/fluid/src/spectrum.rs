//! Energy spectrum of a periodic box.

use crate::{Fluid, FluidError};
use fibreflow_solve::Waves;
use std::f64::consts::TAU;

/// E(k) by shells of wave numbers: ½⟨|u − ū|²⟩ = Σ E Δk over all of them.
pub struct EnergySpectrum {
    waves: Waves,
    /// 2π/L of every direction \[1/m\].
    factors: [f64; 3],
    /// Δk \[1/m\].
    width: f64,
    energies: Vec<f64>,
}

impl EnergySpectrum {
    /// None where the mesh of the fluid is not a box of uniform spacings that is periodic in all directions. Shells are as
    /// wide as the longest wave. Collective.
    ///
    /// # Errors
    /// What the transform reports.
    pub fn new(fluid: &Fluid) -> Result<Option<Self>, FluidError> {
        let geometry = fluid.geometry();
        let Some(tensor) = &geometry.tensor else {
            return Ok(None);
        };
        let [Some(a), Some(b), Some(c)] = tensor.grid.periods else {
            return Ok(None);
        };
        let waves = Waves::new(&fluid.mesh().halo, &tensor.grid, &tensor.lines);
        let waves = waves.map_err(|source| FluidError::Solve {
            equation: "spectrum",
            source,
        })?;
        let factors = [a, b, c].map(|length| TAU / length);
        let width = factors.into_iter().fold(f64::INFINITY, f64::min);
        let counts = tensor.grid.counts();
        let largest = (0..3).map(|c| (factors[c] * (counts[c] / 2) as f64).powi(2));
        let shells = (largest.sum::<f64>().sqrt() / width).round() as usize;
        Ok(waves.map(|waves| Self {
            waves,
            factors,
            width,
            energies: vec![0.0; shells],
        }))
    }

    /// Wave numbers k = Δk, 2Δk, … in the middle of the shells \[1/m\].
    pub fn wave_numbers(&self) -> impl Iterator<Item = f64> {
        (1..=self.energies.len()).map(|n| n as f64 * self.width)
    }

    /// E of every shell \[m³/s²\], the same on all ranks. Collective.
    pub fn of(&mut self, fluid: &Fluid) -> &[f64] {
        self.energies.fill(0.0);
        let Self {
            waves,
            factors,
            width,
            energies,
        } = self;
        waves.energies(fluid.velocity(), |counts, energy| {
            let square = (0..3).map(|c| (factors[c] * f64::from(counts[c])).powi(2));
            let shell = (square.sum::<f64>().sqrt() / *width).round() as usize;
            // The mean flow is in shell zero.
            if let Some(sum) = shell.checked_sub(1).and_then(|n| energies.get_mut(n)) {
                *sum += energy / *width;
            }
        });
        fluid.mesh().halo.communicator().sum_slice(energies);
        &self.energies
    }
}
