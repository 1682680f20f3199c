//! Energy budget and scales of a turbulent flow.

use crate::{Fluid, Forcing};
use fibreflow_parallel::block_sums;

/// Means over the domain, by mass.
///
/// dK/dt = power − dissipation − eddy_dissipation in a periodic box, but for what the time scheme takes: the dissipation is the work of the
/// scheme's own viscous operator.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TurbulenceBudget {
    /// K = ½⟨|u − ū|²⟩ \[m²/s²\].
    pub kinetic_energy: f64,
    /// ε = −ν⟨u·L u⟩ \[m²/s³\].
    pub dissipation: f64,
    /// Work of the eddy viscosity, −⟨u·∇·(2ν_t S)⟩ \[m²/s³\].
    pub eddy_dissipation: f64,
    /// ⟨ν_t⟩ \[m²/s\].
    pub eddy_viscosity: f64,
    /// Power of linear forcing, of driving and of body forces \[m²/s³\].
    pub power: f64,
    /// ½⟨|∇ × u|²⟩ with the gradient at nodes \[1/s²\].
    pub enstrophy: f64,
    /// Mean of ⟨(∂u/∂x)³⟩/⟨(∂u/∂x)²⟩^(3/2) over the three directions; zero in a flow without gradients.
    pub skewness: f64,
    /// ν \[m²/s\].
    pub kinematic_viscosity: f64,
}

impl TurbulenceBudget {
    /// u' = √(2K/3) \[m/s\] (K 5.5).
    pub fn fluctuation(&self) -> f64 {
        (2.0 / 3.0 * self.kinetic_energy).sqrt()
    }

    /// Kolmogorov's length η = (ν³/ε)^¼ \[m\] (K 5.4).
    pub fn kolmogorov_length(&self) -> f64 {
        (self.kinematic_viscosity.powi(3) / self.dissipation).powf(0.25)
    }

    /// Taylor's length λ = √(15ν/ε) u' \[m\]: K 5.6 with K^(3/2)/ε for its length, which is how K's table 5.3 has it.
    pub fn taylor_length(&self) -> f64 {
        (15.0 * self.kinematic_viscosity / self.dissipation).sqrt() * self.fluctuation()
    }

    /// Re_λ = u'λ/ν (K 5.7).
    pub fn taylor_reynolds(&self) -> f64 {
        self.fluctuation() * self.taylor_length() / self.kinematic_viscosity
    }

    /// Length of the large eddies u'³/ε \[m\] (K 5.8).
    pub fn large_eddy_length(&self) -> f64 {
        self.fluctuation().powi(3) / self.dissipation
    }

    /// Turnover time K/ε \[s\] (K 5.9).
    pub fn turnover_time(&self) -> f64 {
        self.kinetic_energy / self.dissipation
    }
}

impl Fluid {
    /// Vorticity \[1/s\] and, last, Q = −½ ∂uᵢ/∂xⱼ ∂uⱼ/∂xᵢ \[1/s²\] (Hunt, Wray & Moin 1988) at the owned nodes, by the
    /// conserving gradient of a velocity of owned and halo nodes.
    pub fn vortices_of(&self, velocity: &[[f64; 4]]) -> Vec<[f64; 4]> {
        let inverse = self.operators.inverse_volumes();
        let mut values = vec![[0.0; 4]; inverse.len()];
        self.operators
            .velocity_gradient(velocity, &mut values, |i, g, value| {
                let g = g.map(|row| row.map(|v| inverse[i] * v));
                let [x, y, z] = curl(&g);
                let product = |d: usize| (0..3).map(|c| g[d][c] * g[c][d]).sum::<f64>();
                *value = [x, y, z, -0.5 * (0..3).map(product).sum::<f64>()];
            });
        values
    }

    /// Energy budget of the moment. Collective.
    pub fn turbulence(&self) -> TurbulenceBudget {
        let (mean, kinetic_energy) = self.fluctuation();
        let (operators, u) = (&self.operators, &self.velocity);
        let (volumes, inverse) = (operators.volumes(), operators.inverse_volumes());
        let forces = &self.body_force;
        let mut sums = block_sums::<9>(volumes.len(), |range| {
            range.fold([0.0; 9], |mut sums, i| {
                let g = operators.velocity_gradient_row(u, i);
                let g = g.map(|row| row.map(|v| inverse[i] * v));
                let curl = curl(&g);
                let diffused = operators.diffusion_row(u, i);
                for c in 0..3 {
                    sums[0] -= u[i][c] * diffused[c];
                    sums[1] += volumes[i] * u[i][c] * forces[i][c];
                    sums[2] += 0.5 * volumes[i] * curl[c] * curl[c];
                    sums[3 + c] += volumes[i] * g[c][c].powi(2);
                    sums[6 + c] += volumes[i] * g[c][c].powi(3);
                }
                sums
            })
        });
        self.mesh.halo.communicator().sum_slice(&mut sums);
        let [viscous, pushed, enstrophy, squares_and_cubes @ ..] =
            sums.map(|s| s / operators.geometry.total_volume);
        let (squares, cubes) = squares_and_cubes.split_at(3);
        let skewness = squares.iter().zip(cubes).map(|(&square, cube)| {
            if square > 0.0 {
                cube / square.powf(1.5)
            } else {
                0.0
            }
        });
        let density = self.settings.density;
        let driven: f64 = (0..3).map(|c| mean[c] * self.driving[c]).sum();
        let linear = match self.settings.forcing {
            Forcing::Linear { rate, energy } => 2.0 * rate * energy.unwrap_or(kinetic_energy),
            Forcing::PressureGradient(_) | Forcing::BulkVelocity { .. } => 0.0,
        };
        let kinematic_viscosity = self.settings.kinematic_viscosity();
        let [eddy_dissipation, eddy_viscosity] = self.eddy_dissipation();
        TurbulenceBudget {
            kinetic_energy,
            dissipation: kinematic_viscosity * viscous,
            eddy_dissipation,
            eddy_viscosity,
            power: linear + (driven + pushed) / density,
            enstrophy,
            skewness: skewness.sum::<f64>() / 3.0,
            kinematic_viscosity,
        }
    }
}

/// ∇ × u of ∂_d u_c at \[d\]\[c\].
fn curl(g: &[[f64; 4]; 3]) -> [f64; 3] {
    [g[1][2] - g[2][1], g[2][0] - g[0][2], g[0][1] - g[1][0]]
}
