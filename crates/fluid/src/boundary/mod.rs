//! Boundary conditions, compiled from patches to nodes.

mod condition;
mod constraint;
mod outflow;
mod profile;
mod signal;

pub use condition::BoundaryCondition;
pub(crate) use constraint::Constraint;
pub use profile::VelocityProfile;
pub use signal::{Signal, TimeTable};

use crate::FluidError;
use crate::settings::{dot, length};
use constraint::slip_projector;
use fibreflow_mesh::{BoundaryNode, DualGeometry, LocalMesh};
use fibreflow_parallel::Communicator;
use outflow::{OutflowNode, OutflowPatch};
use std::ops::Range;

/// Flux through the boundary of a node's volume.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Through {
    /// Given by the boundary velocity.
    Given(GivenFlux),
    /// Whatever closes continuity.
    Open,
}

/// A given flux through the boundary \[m³/s\], outward.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct GivenFlux {
    /// At the end of the step.
    pub end: f64,
    /// One step earlier.
    pub previous: f64,
    /// Extrapolated to the middle of the step, like the fluxes between nodes.
    pub convecting: f64,
    /// Mean rate of change over the first step \[m³/s²\].
    pub rate: f64,
}

/// A node whose given velocity changes in time.
#[derive(Clone, Debug)]
struct Moving {
    /// Where in [`Boundary::given`].
    given: usize,
    /// Where in [`Boundary::through`], unless nothing goes through.
    through: Option<usize>,
    position: [f64; 3],
    /// Where in [`Boundary::sources`]; the first decides.
    sources: Range<usize>,
}

/// A patch's claim on a moving node.
#[derive(Clone, Copy, Debug)]
struct Source {
    patch: u16,
    area: [f64; 3],
    shape: [f64; 3],
}

/// Boundary conditions by node of this rank, ascending.
#[derive(Clone, Debug)]
pub(crate) struct Boundary {
    /// Owned nodes whose velocity is fixed or confined to a plane or line.
    pub constraints: Vec<Constraint>,
    /// Velocity of fixed owned nodes \[m/s\].
    pub given: Vec<(u32, [f64; 3])>,
    /// How much the velocity of each of them changed in the last update \[m/s\].
    pub shift: Vec<[f64; 4]>,
    /// Owned nodes with flow through the boundary.
    pub through: Vec<(u32, Through)>,
    /// Owned outlet nodes and their pressure in the middle of the step \[Pa\].
    pub outlets: Vec<(u32, f64)>,
    /// Total length: nodes of given velocity.
    pub velocity_fixed: Vec<bool>,
    /// Total length: nodes of given pressure.
    pub pressure_fixed: Vec<bool>,
    /// No constraint on any rank.
    pub unconstrained: bool,
    /// A given velocity changes in time, on some rank.
    pub moves: bool,
    /// An outlet pressure changes in time.
    pub pulses: bool,
    /// There is an outlet, on some rank, that takes what the given fluxes leave.
    open: bool,
    conditions: Vec<BoundaryCondition>,
    /// Patch of every outlet node.
    outlet_patches: Vec<u16>,
    moving: Vec<Moving>,
    sources: Vec<Source>,
    /// Nodes and patches of convective outlets.
    outflow: Vec<OutflowNode>,
    outflow_patches: Vec<OutflowPatch>,
    /// Flow and area of each of them, while their speeds are found.
    outflow_sums: Vec<f64>,
    /// Σ |area| of every given node \[m²\].
    spans: Vec<f64>,
    communicator: Communicator,
}

impl Boundary {
    /// At time zero. Collective.
    pub fn new(
        mesh: &LocalMesh,
        geometry: &DualGeometry,
        conditions: &[BoundaryCondition],
    ) -> Result<Self, FluidError> {
        if conditions.len() != mesh.patches.len() {
            return Err(FluidError::Patches {
                found: conditions.len(),
                expected: mesh.patches.len(),
            });
        }
        let communicator = mesh.halo.communicator();
        let pulses = |c: &BoundaryCondition| matches!(c, BoundaryCondition::Outlet { pressure } if !pressure.is_constant());
        let mut boundary = Self {
            constraints: Vec::new(),
            given: Vec::new(),
            shift: Vec::new(),
            through: Vec::new(),
            outlets: Vec::new(),
            velocity_fixed: vec![false; mesh.total()],
            pressure_fixed: vec![false; mesh.total()],
            unconstrained: true,
            moves: !conditions.iter().all(BoundaryCondition::is_steady),
            pulses: conditions.iter().any(pulses),
            open: false,
            conditions: conditions.to_vec(),
            outlet_patches: Vec::new(),
            moving: Vec::new(),
            sources: Vec::new(),
            outflow: Vec::new(),
            outflow_patches: Vec::new(),
            outflow_sums: Vec::new(),
            spans: Vec::new(),
            communicator: communicator.clone(),
        };
        boundary.list_outflow_patches();
        for shares in geometry.boundary.chunk_by(|a, b| a.node == b.node) {
            boundary.add_node(mesh, geometry, shares);
        }
        boundary.spread_marks(mesh);
        boundary.check_outlets(mesh, geometry)?;
        boundary.open = communicator.any(!boundary.outlets.is_empty());
        boundary.unconstrained = !communicator.any(!boundary.constraints.is_empty());
        boundary.shift = vec![[0.0; 4]; boundary.given.len()];
        boundary.correct_outflow();
        boundary.balance()?;
        boundary.settle();
        Ok(boundary)
    }

    fn add_node(&mut self, mesh: &LocalMesh, geometry: &DualGeometry, shares: &[BoundaryNode]) {
        let node = shares[0].node;
        let x = mesh.nodes[node as usize];
        let conditions = &self.conditions;
        let condition = |share: &BoundaryNode| &conditions[share.patch as usize];
        let Some(first) = shares.iter().min_by_key(|s| condition(s).rank()) else {
            return;
        };
        if matches!(condition(first), BoundaryCondition::ConvectiveOutlet { .. }) {
            self.add_outflow(geometry, first.patch, shares);
            return;
        }
        if condition(first).gives_velocity() {
            self.add_given(node, x, first.patch, shares);
            return;
        }
        if let Some(projector) =
            slip_projector(shares, |s| matches!(condition(s), BoundaryCondition::Slip))
        {
            self.constraints.push(Constraint { node, projector });
        }
        // An outlet beside a slip plane still lets flow out through its own share.
        let outlet = shares.iter().find_map(|s| match condition(s) {
            BoundaryCondition::Outlet { pressure } => Some((s.patch, pressure.at(0.0))),
            _ => None,
        });
        if let Some((patch, pressure)) = outlet {
            self.outlets.push((node, pressure));
            self.outlet_patches.push(patch);
            self.pressure_fixed[node as usize] = true;
            self.through.push((node, Through::Open));
        }
    }

    fn add_given(&mut self, node: u32, x: [f64; 3], first: u16, shares: &[BoundaryNode]) {
        self.velocity_fixed[node as usize] = true;
        self.constraints.push(Constraint {
            node,
            projector: [[0.0; 3]; 3],
        });
        self.spans.push(shares.iter().map(|s| length(s.area)).sum());
        let conditions = &self.conditions;
        let start = self.sources.len();
        let source = |s: &BoundaryNode| Source {
            patch: s.patch,
            area: s.area,
            shape: conditions[s.patch as usize].shape(x),
        };
        let others = shares.iter().filter(|s| s.patch != first);
        let ordered = shares.iter().filter(|s| s.patch == first).chain(others);
        self.sources.extend(ordered.map(source));
        let (velocity, flux) = self.claimed(start..self.sources.len(), x, 0.0);
        self.given.push((node, velocity));
        let deciding = &self.conditions[first as usize];
        let (steady, tight) = (deciding.is_steady(), deciding.is_tight());
        let through = !tight && (!steady || flux != 0.0);
        if through {
            let flux = GivenFlux {
                end: flux,
                ..GivenFlux::default()
            };
            self.through.push((node, Through::Given(flux)));
        }
        if steady {
            self.sources.truncate(start);
        } else {
            self.moving.push(Moving {
                given: self.given.len() - 1,
                through: through.then(|| self.through.len() - 1),
                position: x,
                sources: start..self.sources.len(),
            });
        }
    }

    /// Velocity at a node, by the first of its sources, and flux through all that prescribe the same.
    fn claimed(&self, sources: Range<usize>, x: [f64; 3], time: f64) -> ([f64; 3], f64) {
        let sources = &self.sources[sources];
        let velocity = |s: &Source| self.conditions[s.patch as usize].velocity(s.shape, x, time);
        let first = velocity(&sources[0]).unwrap_or_default();
        let agrees = |s: &&Source| velocity(s) == Some(first);
        let fluxes = sources.iter().filter(agrees).map(|s| dot(first, s.area));
        (first, fluxes.sum())
    }

    /// Marks of halo nodes from their owners.
    fn spread_marks(&mut self, mesh: &LocalMesh) {
        let pairs = self.velocity_fixed.iter().zip(&self.pressure_fixed);
        let mut marks: Vec<u8> = pairs
            .map(|(&v, &p)| u8::from(v) | u8::from(p) << 1)
            .collect();
        mesh.halo.update(&mut marks);
        for (i, mark) in marks.into_iter().enumerate() {
            self.velocity_fixed[i] = mark & 1 != 0;
            self.pressure_fixed[i] = mark & 2 != 0;
        }
    }

    fn check_outlets(&self, mesh: &LocalMesh, geometry: &DualGeometry) -> Result<(), FluidError> {
        for (patch, condition) in self.conditions.iter().enumerate() {
            let own = match condition {
                BoundaryCondition::Outlet { .. } => {
                    let mut shares = geometry.boundary.iter();
                    shares
                        .any(|s| s.patch as usize == patch && self.pressure_fixed[s.node as usize])
                }
                BoundaryCondition::ConvectiveOutlet { .. } => self.has_outflow(patch),
                _ => continue,
            };
            if !mesh.halo.communicator().any(own) {
                return Err(FluidError::EmptyOutlet {
                    patch: mesh.patches[patch].clone(),
                });
            }
        }
        Ok(())
    }

    /// Given velocities and their fluxes at a time \[s\]; `shift` is what changed.
    pub fn move_to(&mut self, time: f64) {
        for k in 0..self.moving.len() {
            let Moving {
                given,
                through,
                position,
                sources,
            } = self.moving[k].clone();
            let (velocity, flux) = self.claimed(sources, position, time);
            let old = std::mem::replace(&mut self.given[given].1, velocity);
            (0..3).for_each(|c| self.shift[given][c] = velocity[c] - old[c]);
            if let Some(Through::Given(through)) = through.map(|t| &mut self.through[t].1) {
                through.end = flux;
            }
        }
    }

    /// The last change of the given velocities into a field of increments.
    pub fn put_shift(&self, increment: &mut [[f64; 4]]) {
        for ((i, _), shift) in self.given.iter().zip(&self.shift) {
            increment[*i as usize] = *shift;
        }
    }

    /// Zero at given nodes.
    pub fn put_zero(&self, field: &mut [[f64; 4]]) {
        for (i, _) in &self.given {
            field[*i as usize] = [0.0; 4];
        }
    }

    /// Outlet pressures at a time \[s\].
    pub fn pulse_to(&mut self, time: f64) {
        for ((_, pressure), &patch) in self.outlets.iter_mut().zip(&self.outlet_patches) {
            if let BoundaryCondition::Outlet { pressure: signal } = &self.conditions[patch as usize]
            {
                *pressure = signal.at(time);
            }
        }
    }

    /// Given flux through the boundary of a node at the end of the step \[m³/s\]; zero where none is given.
    pub fn given_flux(&self, node: u32) -> f64 {
        let found = self.through.binary_search_by_key(&node, |t| t.0);
        match found.map(|k| &self.through[k].1) {
            Ok(Through::Given(flux)) => flux.end,
            _ => 0.0,
        }
    }

    /// Given fluxes \[m³/s\] at the end of the last step and one step earlier, by owned node.
    pub fn fluxes(&self, owned: usize) -> Vec<f64> {
        let mut fluxes = vec![0.0; 2 * owned];
        for (i, through) in &self.through {
            if let Through::Given(flux) = through {
                let at = 2 * *i as usize;
                (fluxes[at], fluxes[at + 1]) = (flux.end, flux.previous);
            }
        }
        fluxes
    }

    /// Goes on from velocities and [`Boundary::fluxes`] of a stored state.
    pub fn restore(&mut self, velocity: &[[f64; 4]], fluxes: &[f64]) {
        for moving in &self.moving {
            let (node, given) = &mut self.given[moving.given];
            let [x, y, z, _] = velocity[*node as usize];
            *given = [x, y, z];
        }
        self.restore_outflow(velocity);
        for (i, through) in &mut self.through {
            if let Through::Given(flux) = through {
                let at = 2 * *i as usize;
                (flux.end, flux.previous) = (fluxes[at], fluxes[at + 1]);
            }
        }
    }

    /// Given fluxes for the step that begins: half a step ahead by `ahead` = ½Δt/Δt' times the last change. Collective.
    pub fn begin_step(&mut self, ahead: f64) {
        self.find_speeds();
        for (_, through) in &mut self.through {
            if let Through::Given(flux) = through {
                flux.convecting = flux.end + ahead * (flux.end - flux.previous);
                flux.previous = flux.end;
            }
        }
    }

    /// Rates of change of the given fluxes over a first step of `dt` from `time` \[s\]. Collective.
    pub fn find_rates(&mut self, time: f64, dt: f64) -> Result<(), FluidError> {
        let given = self.given.clone();
        self.move_to(time + dt);
        self.correct_outflow();
        self.balance()?;
        for (_, through) in &mut self.through {
            if let Through::Given(flux) = through {
                flux.rate = (flux.end - flux.previous) / dt;
                flux.end = flux.previous;
            }
        }
        self.given = given;
        Ok(())
    }

    /// As at time zero, before the first step, with a velocity to start outlets from. Collective.
    pub fn restart(&mut self, velocity: &[[f64; 4]]) -> Result<(), FluidError> {
        self.move_to(0.0);
        self.pulse_to(0.0);
        self.start_outflow(velocity);
        self.balance()?;
        self.settle();
        Ok(())
    }

    /// History as before the first step.
    fn settle(&mut self) {
        for (_, through) in &mut self.through {
            if let Through::Given(flux) = through {
                flux.previous = flux.end;
                flux.convecting = flux.end;
            }
        }
    }

    /// Without an outlet the given fluxes must sum to zero, or the pressure equation has no answer: quadrature error
    /// is taken from all of them in proportion; more than that is refused. Collective.
    pub fn balance(&mut self) -> Result<(), FluidError> {
        if self.open {
            return Ok(());
        }
        let nodes = self.given.iter().zip(&self.spans);
        let reach: f64 = nodes.map(|((_, u), span)| length(*u) * span).sum();
        // Twice: the second pass takes out the round-off of the first.
        for _ in 0..2 {
            let mut sums = [0.0, 0.0, reach];
            for (_, through) in &self.through {
                if let Through::Given(flux) = through {
                    sums[0] += flux.end;
                    sums[1] += flux.end.abs();
                }
            }
            self.communicator.sum_slice(&mut sums);
            let [net, total, reach] = sums;
            if net.abs() > 0.02 * reach {
                return Err(FluidError::UnbalancedFlux { net, total: reach });
            }
            if total == 0.0 {
                return Ok(());
            }
            for (_, through) in &mut self.through {
                if let Through::Given(flux) = through {
                    flux.end -= net * (flux.end.abs() / total);
                }
            }
        }
        Ok(())
    }
}
