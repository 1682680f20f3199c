//! Forces, torques and flow on the patches of the boundary.

use crate::boundary::Through;
use crate::settings::{cross, dot, length};
use crate::{BoundaryCondition, Fluid};
use fibreflow_mesh::BoundaryNode;

/// What the fluid does to a patch, mean over the last step.
///
/// Pressure and viscous part add up to what the discrete momentum equation gives to the patch, so that the balance of
/// momentum closes to round-off. The viscous part is what is left of that beside the pressure: shear stress on walls,
/// momentum that is carried in on inlets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PatchLoad {
    /// Σ p A \[N\].
    pub pressure: [f64; 3],
    /// The rest of the force \[N\].
    pub viscous: [f64; 3],
    /// Σ (x − x₀) × p A \[N·m\].
    pub pressure_torque: [f64; 3],
    /// Torque of the rest \[N·m\].
    pub viscous_torque: [f64; 3],
    /// Flow out of the domain \[m³/s\].
    pub flux: f64,
}

impl PatchLoad {
    const LENGTH: usize = 13;

    /// Force \[N\].
    pub fn force(&self) -> [f64; 3] {
        [0, 1, 2].map(|c| self.pressure[c] + self.viscous[c])
    }

    /// Torque \[N·m\].
    pub fn torque(&self) -> [f64; 3] {
        [0, 1, 2].map(|c| self.pressure_torque[c] + self.viscous_torque[c])
    }

    /// Both together: the load on a group of patches.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        let add = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|c| a[c] + b[c]);
        Self {
            pressure: add(self.pressure, other.pressure),
            viscous: add(self.viscous, other.viscous),
            pressure_torque: add(self.pressure_torque, other.pressure_torque),
            viscous_torque: add(self.viscous_torque, other.viscous_torque),
            flux: self.flux + other.flux,
        }
    }

    fn from_numbers(n: &[f64], density: f64) -> Self {
        let vector = |k: usize| [n[k], n[k + 1], n[k + 2]].map(|v| density * v);
        Self {
            pressure: vector(0),
            viscous: vector(3),
            pressure_torque: vector(6),
            viscous_torque: vector(9),
            flux: n[12],
        }
    }
}

impl Fluid {
    /// Forces of the fluid on every patch, in the order of the mesh, with torques about the point x₀ = `about` \[m\].
    /// Forces are zero before the first step and on outlets. Collective.
    ///
    /// On nodes of several patches a slip plane takes what acts along its normal, and patches of given velocity share the
    /// rest by area. The Laplacian of the momentum equation carries μ ∂u/∂n; rotating walls feel μ (∇u)ᵀn = μ n × ω too,
    /// which has no resultant on a body of revolution but a torque.
    pub fn patch_loads(&self, about: [f64; 3]) -> Vec<PatchLoad> {
        let mut numbers = vec![0.0; PatchLoad::LENGTH * self.mesh.patches.len()];
        if self.last_dt > 0.0 && self.steps > 0 {
            for (constraint, reaction) in self.boundary.constraints.iter().zip(&self.reaction) {
                let [x, y, z, mean] = reaction.map(|r| r / self.last_dt);
                let node = constraint.node;
                let pressure = match self.creeping {
                    Some(_) => self.pressure[node as usize],
                    None => mean,
                };
                self.add_forces((node, pressure), [x, y, z], about, &mut numbers);
            }
        }
        for &(i, through) in &self.boundary.through {
            let flux = match through {
                Through::Given(flux) => flux.end,
                Through::Open => -self.operators.flux_sum(&self.flux, i as usize),
            };
            let all: f64 = self.shares(i).map(|s| length(s.area)).sum();
            for share in self.shares(i) {
                let at = PatchLoad::LENGTH * share.patch as usize + 12;
                numbers[at] += flux * length(share.area) / all;
            }
        }
        self.mesh.halo.communicator().sum_slice(&mut numbers);
        let density = self.settings.density;
        let loads = numbers.chunks_exact(PatchLoad::LENGTH);
        loads.map(|n| PatchLoad::from_numbers(n, density)).collect()
    }

    /// Kinematic forces at a constrained node: its pressure, and the reaction divided among its patches.
    fn add_forces(
        &self,
        (node, pressure): (u32, f64),
        reaction: [f64; 3],
        about: [f64; 3],
        numbers: &mut [f64],
    ) {
        let x = self.mesh.nodes[node as usize];
        let arm = [0, 1, 2].map(|c| x[c] - about[c]);
        let mut add = |patch: u16, slot: usize, force: [f64; 3]| {
            let at = PatchLoad::LENGTH * patch as usize + slot;
            let torque = cross(arm, force);
            for c in 0..3 {
                numbers[at + c] += force[c];
                numbers[at + 6 + c] += torque[c];
            }
        };
        let condition = |s: &&BoundaryNode| &self.settings.boundary[s.patch as usize];
        let outlet = |s: &&BoundaryNode| matches!(condition(s), BoundaryCondition::Outlet { .. });
        let slip = |s: &&BoundaryNode| matches!(condition(s), BoundaryCondition::Slip);
        let mut rest = reaction;
        for share in self.shares(node).filter(|s| !outlet(s)) {
            add(share.patch, 0, share.area.map(|a| a * pressure));
            let size = length(share.area);
            if slip(&share) && size > 0.0 {
                let normal = share.area.map(|a| a / size);
                let along = dot(normal, rest);
                let taken = normal.map(|n| along * n);
                (0..3).for_each(|c| rest[c] -= taken[c]);
                add(share.patch, 3, taken);
            }
        }
        let fixed = self.boundary.velocity_fixed[node as usize];
        let takes = |s: &&BoundaryNode| {
            if fixed {
                condition(s).gives_velocity()
            } else {
                slip(s)
            }
        };
        let all: f64 = self
            .shares(node)
            .filter(takes)
            .map(|s| length(s.area))
            .sum();
        for share in self.shares(node).filter(takes) {
            let part = length(share.area) / all;
            add(share.patch, 3, rest.map(|r| part * r));
        }
        let middle = self.time - 0.5 * self.last_dt;
        for share in self.shares(node) {
            if let Some(omega) = condition(&share).spin(middle) {
                let nu = self.settings.kinematic_viscosity();
                add(share.patch, 3, cross(omega, share.area).map(|f| nu * f));
            }
        }
    }

    /// Flow out of the domain through a patch \[m³/s\]. Collective.
    pub fn patch_flux(&self, patch: usize) -> f64 {
        self.patch_loads([0.0; 3])[patch].flux
    }

    /// Force of the fluid on a patch \[N\], see [`Fluid::patch_loads`]. Collective.
    pub fn wall_force(&self, patch: usize) -> [f64; 3] {
        self.patch_loads([0.0; 3])[patch].force()
    }

    /// Boundary shares of an owned node.
    fn shares(&self, node: u32) -> impl Iterator<Item = &BoundaryNode> + Clone {
        let all = &self.operators.geometry.boundary;
        let first = all.partition_point(|s| s.node < node);
        all[first..].iter().take_while(move |s| s.node == node)
    }
}
