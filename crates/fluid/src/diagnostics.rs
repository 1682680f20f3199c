//! What is asked of a flow: energy, momentum, divergence, wall forces, time step.

use crate::boundary::Through;
use crate::{Diffusion, Fluid};
use fibreflow_parallel::{block_max, block_sums};

impl Fluid {
    /// ½ ρ Σ V |u|² over the domain \[J\]. Collective.
    pub fn kinetic_energy(&self) -> f64 {
        let [sum] = self.sum(|u| [u[0] * u[0] + u[1] * u[1] + u[2] * u[2]]);
        0.5 * self.settings.density * sum
    }

    /// ρ Σ V u over the domain \[kg·m/s\]. Collective.
    pub fn momentum(&self) -> [f64; 3] {
        self.sum(|u| [u[0], u[1], u[2]])
            .map(|s| self.settings.density * s)
    }

    /// Mean velocity over the domain \[m/s\]. Collective.
    pub fn bulk_velocity(&self) -> [f64; 3] {
        let total = self.operators.geometry.total_volume;
        self.sum(|u| [u[0], u[1], u[2]]).map(|s| s / total)
    }

    /// Volume of the domain \[m³\].
    pub fn volume(&self) -> f64 {
        self.operators.geometry.total_volume
    }

    /// Mean of ∂u_i/∂x_j over the domain \[1/s\] as gradient\[i\]\[j\]: ∮ u n dA by its volume, exact for the shape functions of
    /// the elements. Collective.
    pub fn mean_gradient(&self) -> [[f64; 3]; 3] {
        let mut sums = [0.0; 9];
        for share in &self.operators.geometry.boundary {
            let u = self.velocity[share.node as usize];
            for i in 0..3 {
                for j in 0..3 {
                    sums[3 * i + j] += u[i] * share.area[j];
                }
            }
        }
        self.mesh.halo.communicator().sum_slice(&mut sums);
        [0, 1, 2].map(|i| [0, 1, 2].map(|j| sums[3 * i + j] / self.volume()))
    }

    /// Σ V f(u) over the owned nodes of all ranks.
    fn sum<const N: usize>(&self, value: impl Fn([f64; 4]) -> [f64; N] + Sync + Send) -> [f64; N] {
        let volumes = self.operators.volumes();
        let mut sums = block_sums(volumes.len(), |range| {
            range.fold([0.0; N], |mut sums, i| {
                let values = value(self.velocity[i]);
                sums.iter_mut()
                    .zip(values)
                    .for_each(|(s, v)| *s += volumes[i] * v);
                sums
            })
        });
        self.mesh.halo.communicator().sum_slice(&mut sums);
        sums
    }

    /// Largest |Σ_j F_ij + F_b|/V over the nodes \[1/s\]: what the pressure solve left. Collective.
    pub fn divergence_max(&self) -> f64 {
        let volumes = self.operators.volumes();
        let through = &self.boundary.through;
        let divergence = |i: usize| {
            let sum = self.operators.flux_sum(&self.flux, i);
            let boundary = through.binary_search_by_key(&(i as u32), |t| t.0);
            let rest = match boundary.map(|k| through[k].1) {
                Err(_) => sum,
                Ok(Through::Given(flux)) => sum + flux.end,
                Ok(Through::Open) => 0.0,
            };
            rest.abs() / volumes[i]
        };
        self.largest(divergence).max(0.0)
    }

    /// Courant number of a step: Δt max ½ Σ_j |F_ij|/V_i, which is Δt Σ_c |u_c|/h_c on a uniform grid.
    pub fn courant_number(&self, dt: f64) -> f64 {
        dt * self.flux_rate
    }

    /// Largest step of Courant number `cfl`, see [`Fluid::courant_number`], and not above `longest` \[s\]. The scheme is
    /// stable up to √3, mass is corrected up to 1.23. Where the settings ask for explicit diffusion, its stability limits the step too,
    /// and so does that of an eddy viscosity.
    pub fn suggest_dt(&self, cfl: f64, longest: f64) -> f64 {
        let by_flow = cfl / self.flux_rate;
        let dt = if by_flow.is_nan() {
            longest
        } else {
            longest.min(by_flow)
        };
        match self.settings.diffusion {
            Diffusion::Explicit => dt.min(self.longest_explicit_step(self.viscous_rate)),
            Diffusion::Auto | Diffusion::Implicit if self.eddy.is_some() => {
                dt.min(self.longest_explicit_step(0.0))
            }
            Diffusion::Auto | Diffusion::Implicit => dt,
        }
    }

    fn largest(&self, value: impl Fn(usize) -> f64 + Sync + Send) -> f64 {
        let owned = self.mesh.owned();
        let local = block_max(owned, |mut range| {
            range
                .try_fold(f64::NEG_INFINITY, |m, i| {
                    let v = value(i);
                    if v.is_nan() { Err(v) } else { Ok(m.max(v)) }
                })
                .unwrap_or_else(|nan| nan)
        });
        self.mesh.halo.communicator().max(local)
    }
}
