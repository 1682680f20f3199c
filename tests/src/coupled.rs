//! A small two-way coupled flow for the conservation tests: random fibres in a random flow.

use fibreflow_coupling::{Coupling, FibreLoad, Kernel, SpreadReport};
use fibreflow_fibre::hydrodynamics::{DragModel, FluidProperties, TorqueModel};
use fibreflow_fibre::{
    Ambient, Fibre, FibreSettings, FibreSystem, Hydrodynamics, Material, Points,
};
use fibreflow_fluid::{BoundaryCondition, Fluid, FluidSettings};
use fibreflow_mesh::{BoxMesh, distribute, geometry};
use fibreflow_parallel::Communicator;
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use std::error::Error;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Edge of the box \[m\].
pub const BOX: f64 = 2e-3;
/// A kernel that is 1.2 elements wide on five of them.
pub const GAUSSIAN: Kernel = Kernel::Gaussian { width: 0.24 * BOX };
/// Scale of the initial velocity \[m/s\].
pub const SPEED: f64 = 0.05;
const DENSITY: f64 = 1000.0;
const VISCOSITY: f64 = 1e-3;
const FIBRES: u64 = 10;
const SEGMENTS: usize = 6;
const LENGTH: f64 = 8e-4;

/// Fluid and fibres, advanced in the staggered scheme.
pub struct Coupled {
    /// The fluid of this rank.
    pub fluid: Fluid,
    /// The fibres of this rank.
    pub fibres: FibreSystem,
    /// What joins them.
    pub coupling: Coupling,
    points: Points,
    ambient: Ambient,
    /// Σ |F| Δt over all points and steps so far \[N·s\], over all ranks.
    pub impulses: f64,
}

impl Coupled {
    /// On a unit box mesh scaled to [`BOX`]; walls at rest on all its patches. Collective.
    ///
    /// # Errors
    /// What the parts report.
    pub fn new(
        communicator: &Communicator,
        unit: &BoxMesh,
        kernel: Kernel,
    ) -> Result<Self, Box<dyn Error>> {
        let scaled = BoxMesh {
            size: unit.size.map(|s| s * BOX),
            ..unit.clone()
        };
        let mesh = communicator.is_root().then(|| scaled.build()).transpose()?;
        let mesh = Arc::new(distribute(communicator, mesh)?);
        let geometry = Arc::new(geometry::dual(&mesh)?);
        let mut settings = FluidSettings::new(DENSITY, VISCOSITY);
        settings.boundary = vec![BoundaryCondition::WALL; mesh.patches.len()];
        settings.pressure.relative_tolerance = 1e-12;
        settings.momentum.relative_tolerance = 1e-12;
        let mut fluid = Fluid::new(mesh.clone(), geometry.clone(), settings)?;
        fluid.set_velocity(initial)?;
        let mut no_slip = vec![false; mesh.owned()];
        for share in &geometry.boundary {
            no_slip[share.node as usize] = true;
        }
        let mine = |id: &u64| *id as usize % communicator.size() == communicator.rank();
        let settings = FibreSettings {
            hydrodynamics: Some(Hydrodynamics {
                fluid: FluidProperties {
                    density: DENSITY,
                    viscosity: VISCOSITY,
                },
                drag: DragModel::default(),
                torque: TorqueModel::default(),
                point_spacing: f64::INFINITY,
            }),
            ..FibreSettings::default()
        };
        let own = (0..FIBRES).filter(mine).map(fibre).collect();
        Ok(Self {
            fluid,
            fibres: FibreSystem::new(communicator.clone(), settings, own)?,
            coupling: Coupling::with_kernel(mesh, geometry, no_slip, kernel)?,
            points: Points::default(),
            ambient: Ambient::default(),
            impulses: 0.0,
        })
    }

    /// One staggered step: sample, fibres, spread, fluid. Collective.
    ///
    /// # Errors
    /// What the parts report.
    pub fn step(&mut self, dt: f64) -> Result<SpreadReport, Box<dyn Error>> {
        self.fibres.points(&mut self.points);
        let velocity = self.fluid.velocity();
        self.coupling
            .sample(velocity, &self.points.position, &mut self.ambient)?;
        let reaction = self.fibres.advance(&self.ambient, dt)?;
        let body_force = self.fluid.body_force_mut();
        body_force.fill([0.0; 4]);
        let report = self.coupling.spread(reaction, body_force)?;
        let impulse: f64 = reaction.force.iter().map(|f| f.norm() * dt).sum();
        self.impulses += self.fibres.communicator().sum(impulse);
        self.fluid.advance(dt)?;
        Ok(report)
    }

    /// Gives each fibre to the rank that holds the fluid around its middle. Collective.
    ///
    /// # Errors
    /// What the parts report.
    pub fn settle(&mut self) -> Result<(), Box<dyn Error>> {
        self.fibres.points(&mut self.points);
        let velocity = self.fluid.velocity();
        self.coupling
            .sample(velocity, &self.points.position, &mut self.ambient)?;
        let points = self.points.position.len() / self.fibres.fibres().max(1);
        let load = |f: usize| FibreLoad {
            id: self.fibres.id(f),
            load: SEGMENTS as f64,
            middle_point: f * points + points / 2,
        };
        let loads: Vec<FibreLoad> = (0..self.fibres.fibres()).map(load).collect();
        let owners = self.coupling.points_owner(&loads);
        self.fibres.migrate(&owners)?;
        self.coupling.forget();
        Ok(())
    }

    /// Momentum of the fibres of all ranks \[kg·m/s\]. Collective.
    pub fn fibre_momentum(&self) -> Vector3<f64> {
        let mut sum: [f64; 3] = self.fibres.momentum().into();
        self.fibres.communicator().sum_slice(&mut sum);
        sum.into()
    }

    /// Momentum of fluid and fibres \[kg·m/s\]. Collective.
    pub fn momentum(&self) -> Vector3<f64> {
        Vector3::from(self.fluid.momentum()) + self.fibre_momentum()
    }
}

/// A few periodic modes; the fluid projects them.
fn initial(x: [f64; 3]) -> [f64; 3] {
    let phase = |c: usize| TAU * x[c] / BOX;
    let (a, b, c) = (phase(0), phase(1), phase(2));
    [
        SPEED * (b.sin() + (c + 0.4).cos() + 0.5),
        SPEED * ((c + 1.0).sin() + (a + 2.0).cos()),
        SPEED * ((a - 0.7).sin() + (b + a).cos() - 0.3),
    ]
}

/// Fibre `id`, the same on any rank: anywhere and in any direction, most of them across the boundary of the box.
fn fibre(id: u64) -> Fibre {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(id);
    let mut random = || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
    let middle = Vector3::repeat(0.5 * BOX) + 0.25 * BOX * random();
    let half = 0.5 * LENGTH * random().normalize();
    let material = Material::new(2e-5, 2e6, 0.3, 1300.0);
    Fibre::straight(id, material, middle - half, middle + half, SEGMENTS)
}
