//! Binary fluid with an interface of finite width, beside a solid of given volume fraction (L 27–32; NUMERICS section 6).
//!
//! ```text
//! F = e ∫ f dV,   f = ¼(1 − ψ²)² + (3/2) φ² (ψ − ψ*)² + ½ ξ² |∇ψ|²        (L 27–30)
//! ∂ψ/∂t + ∇·(ψu) = M ∇²μ_ψ,   μ_ψ = δF/δψ,   μ_φ = δF/δφ,   D = e M        (L 32)
//! force on the flow = −ψ∇μ_ψ, force on the solid = ∫ μ_φ ∇φ dV             (L 33, with −φ∇μ_φ taken as a whole)
//! ```
//!
//! The surface tension between both fluids is σ = (√8/3) e ξ, their interface ψ = tanh(x/√2ξ). With the energy of gradients
//! ½ Σ w_ij (ψ_j − ψ_i)² over pairs, V μ_ψ = ∂F/∂ψ_i holds exactly; the force is minus the transpose of ψ-advection by the fluxes
//! ½(u_i + u_j)·S_ij, so that what the flow takes from F it gains as work, and nothing moves where μ_ψ is uniform: L's −φ∇μ_φ, which
//! differs by a gradient in total, would stir the fluid at the edge of a solid at rest. Boundaries are neutral and let nothing
//! diffuse through.

mod force;
mod free_energy;
mod mixing;
mod state;
mod step;

pub use free_energy::FreeEnergy;
pub use step::PhaseReport;

use crate::inverse::Inverse;
use crate::{Fluid, FluidError, PressurePreconditioner};
use fibreflow_parallel::block_sums;
use fibreflow_solve::{CgSettings, ConjugateGradients};
use mixing::Mixing;

/// What a binary fluid is made of. SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseSettings {
    /// Surface tension σ between both fluids \[N/m\].
    pub surface_tension: f64,
    /// Width ξ of the interface \[m\].
    pub interface_width: f64,
    /// D = e M \[m²/s\], of the order of what diffuses in the bulk (there it is 2D).
    pub diffusivity: f64,
    /// When the equation of a step counts as solved; relative to its terms.
    pub solver: CgSettings,
}

impl PhaseSettings {
    /// With a tolerance of 1e-9 and at most 200 iterations.
    pub fn new(surface_tension: f64, interface_width: f64, diffusivity: f64) -> Self {
        Self {
            surface_tension,
            interface_width,
            diffusivity,
            solver: CgSettings {
                relative_tolerance: 1e-9,
                absolute_tolerance: 0.0,
                max_iterations: 200,
            },
        }
    }

    /// e \[J/m³\], from σ = (√8/3) e ξ (L 44 and errata).
    pub fn energy_density(&self) -> f64 {
        3.0 * self.surface_tension / (8.0_f64.sqrt() * self.interface_width)
    }

    fn check(&self) -> Result<(), FluidError> {
        for (name, value) in [
            ("surface tension", self.surface_tension),
            ("interface width", self.interface_width),
            ("diffusivity", self.diffusivity),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(FluidError::Setting {
                    name,
                    value,
                    expected: "positive and finite",
                });
            }
        }
        Ok(())
    }
}

/// The order parameter on the nodes of a fluid.
pub struct PhaseField {
    settings: PhaseSettings,
    /// Direct solves are wanted where they are possible.
    directly: bool,
    /// ψ by node, total.
    psi: Vec<f64>,
    /// Change of ψ in the last step by its length \[1/s\], owned: the guess of the next.
    rate: Vec<f64>,
    /// φ and ψ*, total.
    solid: Vec<[f64; 2]>,
    /// ∫ψ dV \[m³\] as it must be.
    amount: f64,
    /// What diffusion took from F in the last step \[W\], and its length \[s\]; zero before the first.
    power: f64,
    last_dt: f64,
    /// The two factors of the fourth-order operator, and what they are for.
    factors: Vec<Inverse>,
    fitted: [f64; 2],
    /// Residual that round-off leaves, by D \[m^(3/2)/m²\].
    floor: f64,
    mixing: Mixing,
    krylov: ConjugateGradients<f64>,
    /// Total: ψ at the end of the step, what gradients are taken of, the update, (ψ, μ, ·, ·).
    trial: Vec<f64>,
    blend: Vec<f64>,
    update: Vec<f64>,
    packed: Vec<[f64; 4]>,
    /// Owned.
    laplacian: Vec<f64>,
    residual: Vec<f64>,
}

impl PhaseField {
    /// ψ = 1 everywhere, no solid. Collective.
    ///
    /// # Errors
    /// Settings out of range.
    pub fn new(fluid: &Fluid, settings: PhaseSettings) -> Result<Self, FluidError> {
        settings.check()?;
        use PressurePreconditioner::{Auto, Direct};
        let (owned, total) = (fluid.mesh.owned(), fluid.mesh.total());
        let rates = fluid.operators.weight_sums(f64::abs);
        let width = settings.interface_width.powi(2);
        let volumes = fluid.operators.volumes();
        let square = |i: usize| {
            let rate = 2.0 * rates[i] / volumes[i];
            volumes[i] * (rate * (1.0 + width * rate)).powi(2)
        };
        let [sum] = block_sums(owned, |range| [range.map(square).sum()]);
        let floor = 4.0 * f64::EPSILON * fluid.mesh.halo.communicator().sum(sum).sqrt();
        let mut field = Self {
            directly: matches!(fluid.settings.preconditioner, Auto | Direct),
            psi: vec![1.0; total],
            rate: vec![0.0; owned],
            solid: vec![[0.0; 2]; total],
            amount: 0.0,
            power: 0.0,
            last_dt: 0.0,
            factors: Vec::new(),
            fitted: [f64::NAN; 2],
            floor,
            mixing: Mixing::default(),
            krylov: ConjugateGradients::new(),
            trial: vec![0.0; total],
            blend: vec![0.0; total],
            update: vec![0.0; total],
            packed: vec![[0.0; 4]; total],
            laplacian: vec![0.0; owned],
            residual: vec![0.0; owned],
            settings,
        };
        field.amount = field.integral(fluid);
        Ok(field)
    }

    /// Sets ψ as a function of position \[m\]; history starts anew. Collective.
    ///
    /// # Errors
    /// A value that is not finite.
    pub fn set(&mut self, fluid: &Fluid, psi: impl Fn([f64; 3]) -> f64) -> Result<(), FluidError> {
        let values: Vec<f64> = fluid.mesh.nodes.iter().map(|&x| psi(x)).collect();
        self.set_values(fluid, &values)
    }

    /// Sets ψ by owned node, or more; history starts anew. Collective.
    ///
    /// # Errors
    /// A value that is not finite.
    pub fn set_values(&mut self, fluid: &Fluid, psi: &[f64]) -> Result<(), FluidError> {
        let owned = fluid.mesh.owned();
        self.psi[..owned].copy_from_slice(&psi[..owned]);
        fluid.mesh.halo.update(&mut self.psi);
        self.rate.fill(0.0);
        (self.power, self.last_dt) = (0.0, 0.0);
        self.amount = self.integral(fluid);
        self.check_finite(fluid)
    }

    /// What it was made with.
    pub fn settings(&self) -> &PhaseSettings {
        &self.settings
    }

    /// ψ at owned and halo nodes.
    pub fn order_parameter(&self) -> &[f64] {
        &self.psi
    }

    /// Volume fraction φ of the solid and the value ψ* that it asks for (L 30, 31), by node, total length.
    pub fn solid(&self) -> &[[f64; 2]] {
        &self.solid
    }

    /// See [`PhaseField::solid`]; halo entries must be set as well.
    pub fn solid_mut(&mut self) -> &mut [[f64; 2]] {
        &mut self.solid
    }

    /// ∫ψ dV over the domain \[m³\]. Collective.
    pub fn integral(&self, fluid: &Fluid) -> f64 {
        self.sum(fluid, |psi| psi)
    }

    fn sum(&self, fluid: &Fluid, of: impl Fn(f64) -> f64 + Sync) -> f64 {
        let (volumes, psi) = (fluid.operators.volumes(), &self.psi);
        let [sum] = block_sums(volumes.len(), |range| {
            [range.map(|i| volumes[i] * of(psi[i])).sum()]
        });
        fluid.mesh.halo.communicator().sum(sum)
    }

    /// ∫ψ dV where ψ > ½ \[m³\]: what is in drops of fluid A (L 45: πR² times the depth in two dimensions). Collective.
    pub fn in_drops(&self, fluid: &Fluid) -> f64 {
        self.sum(fluid, |psi| if psi > 0.5 { psi } else { 0.0 })
    }

    /// How the factors of the step are solved, where that is done directly; known after the first step.
    pub fn directions(&self) -> Option<String> {
        self.factors.first().and_then(Inverse::directions)
    }

    fn check_finite(&self, fluid: &Fluid) -> Result<(), FluidError> {
        let owned = fluid.mesh.owned();
        let bad = self.psi[..owned].iter().position(|psi| !psi.is_finite());
        let record = bad.map(|i| {
            let [x, y, z] = fluid.mesh.nodes[i];
            [fluid.mesh.global_nodes[i] as f64, x, y, z]
        });
        let communicator = fluid.mesh.halo.communicator();
        let records = communicator.all_gather(record.as_slice());
        match records.iter().flatten().next() {
            None => Ok(()),
            Some(&[node, x, y, z]) => Err(FluidError::NotFinite {
                field: "order parameter",
                node: node as u64,
                position: [x, y, z],
                step: fluid.steps,
            }),
        }
    }
}

/// ψ* of a solid that ψ = ψ_0 prefers inside (L 31).
pub fn affinity(psi_0: f64) -> f64 {
    (2.0 * psi_0 + psi_0.powi(3)) / 3.0
}
