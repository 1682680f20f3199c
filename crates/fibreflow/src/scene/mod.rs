//! What a case describes, ready to be advanced: flow, fibres, coupling.

mod beads;
mod boundary;
mod contacts;
mod csv;
mod exact;
mod exchange;
mod expression;
mod fibres;
mod flow;
mod forces;
mod framed;
mod inertia;
mod initial;
mod linked;
mod mesh;
mod phase;
mod pipe;
mod polyline;
mod population;
mod scatter;
mod settings;
mod together;

pub use exact::errors;
pub use exchange::Exchange;
pub use fibres::{kinematics, length as length_of};
pub use flow::{Flow, Solved};
pub use linked::settings as linked_settings;
pub use mesh::{SceneMesh, build as build_mesh};
pub use phase::Phase;
pub use population::PlacementReport;
pub use together::{Rounds, Together};

use crate::case::{Case, Document, validate_domain};
use crate::error::{ProgramError, agree};
use crate::figures::{Timings, timed};
use fibreflow_coupling::SpreadReport;
use fibreflow_fibre::linked::LinkedSystem;
use fibreflow_fibre::{Ambient, FibreSystem, PeriodicBox, Points, Vector3};
use fibreflow_mesh::Periods;
use fibreflow_parallel::Communicator;
use population::Populate;
use std::path::Path;

/// Flow and fibres of a case.
pub struct Scene {
    /// All ranks.
    pub communicator: Communicator,
    /// The fluid that is solved for, or the prescribed flow.
    pub flow: Flow,
    /// Fibres of this rank as beams; None in a case without them.
    pub fibres: Option<FibreSystem>,
    /// Fibres as chains of rigid segments, in a case that has them in place of beams.
    pub linked: Option<LinkedSystem>,
    /// Fibres on all ranks.
    pub fibre_count: usize,
    /// Some of them have a strength.
    breakable: bool,
    /// What came of random placement.
    pub placements: Vec<PlacementReport>,
    /// Periodic directions.
    pub periods: Periods,
    /// Checksum of the mesh.
    pub mesh_checksum: Option<u64>,
}

impl Scene {
    /// Sets a case up at its start. `folder` is that of the case file. Collective.
    ///
    /// # Errors
    /// Whatever is wrong with mesh, boundaries, initial field or fibres; every rank fails then.
    pub fn new(
        case: &Case,
        document: &Document,
        folder: &Path,
        communicator: &Communicator,
    ) -> Result<Self, ProgramError> {
        let mesh = build_mesh(case, document, folder, communicator)?;
        check_fibres(case, document, mesh.as_ref(), communicator)?;
        let mesh_checksum = mesh.as_ref().map(|m| m.checksum);
        let periods = periods(case, mesh.as_ref());
        let spacing = mesh.as_ref().map_or(f64::INFINITY, SceneMesh::spacing);
        let contacts = contacts::settings(case, mesh.as_ref(), &periods);
        let flow = agree(communicator, Flow::new(case, document, mesh, folder))?;
        let populate = Populate {
            case,
            document,
            folder,
            periodic: periodic_box(case, &periods),
        };
        let chained = agree(communicator, linked::place(&populate, communicator))?;
        let (linked, reports) = chained.map_or((None, None), |(l, r)| (Some(l), Some(r)));
        let placed = agree(
            communicator,
            fibres::place(populate, spacing, contacts, communicator),
        )?;
        let chains = linked.as_ref().map_or(0, LinkedSystem::fibres);
        let fibre_count = placed.as_ref().map_or(chains, |p| p.count);
        let (fibres, placements) =
            placed.map_or((None, Vec::new()), |p| (Some(p.system), p.reports));
        let placements = reports.unwrap_or(placements);
        let mut scene = Self {
            communicator: communicator.clone(),
            flow,
            fibres,
            linked,
            fibre_count,
            breakable: case.fibres.iter().any(|group| group.strength.is_some()),
            placements,
            periods,
            mesh_checksum,
        };
        if let (Some(fibres), Some(exchange)) = (&mut scene.fibres, scene.flow.exchange()) {
            fibres.carry(exchange.carried());
        }
        let settled = scene.settle();
        agree(communicator, settled)?;
        Ok(scene)
    }

    /// Global indices of the fluid nodes that this rank owns.
    pub fn owned_nodes(&self) -> Vec<u64> {
        let mesh = self.flow.fluid().map(|f| f.mesh());
        mesh.map_or_else(Vec::new, |m| m.global_nodes[..m.owned()].to_vec())
    }

    /// Breaks fibres that have reached their strength. Collective.
    ///
    /// # Errors
    /// Fibres at positions that are not finite; no ids left.
    pub fn break_up(&mut self) -> Result<(), ProgramError> {
        if let Some(fibres) = self.fibres.as_mut().filter(|_| self.breakable) {
            let breaks = fibres.break_up()?;
            self.fibre_count += breaks;
            if breaks > 0
                && let Flow::Solved(solved) = &mut self.flow
            {
                solved.exchange.coupling.forget();
            }
        }
        Ok(())
    }

    /// A step of the linked fibres, and what they do to a fluid that is solved for as its body force. Collective.
    ///
    /// # Errors
    /// What they report; points at positions that are not finite.
    pub fn advance_linked(
        &mut self,
        points: &mut Points,
        ambient: &mut Ambient,
        dt: f64,
        times: &mut Timings,
    ) -> Result<Option<SpreadReport>, ProgramError> {
        let Some(linked) = &mut self.linked else {
            return Ok(None);
        };
        match &mut self.flow {
            Flow::Prescribed(flow) => {
                timed(&mut times.fibres, || linked.advance(&|x, _| flow.at(x), dt))?;
                Ok(None)
            }
            Flow::Solved(solved) => {
                let Solved {
                    fluid, exchange, ..
                } = &mut **solved;
                timed(&mut times.sample, || {
                    exchange.sample_linked(fluid, linked, points, ambient, dt)
                })?;
                timed(&mut times.fibres, || {
                    linked.advance_sampled(points, ambient, dt).map(|_| ())
                })?;
                timed(&mut times.spread, || {
                    exchange.spread_linked(fluid, linked.reaction())
                })
            }
        }
    }

    /// The fibres act back on the fluid.
    pub fn two_way(&self) -> bool {
        (self.fibres.is_some() || self.linked.is_some())
            && self.flow.exchange().is_some_and(|e| e.two_way)
    }

    /// Gives every fibre to the rank that holds the fluid around its middle. Collective.
    ///
    /// # Errors
    /// Fibres at positions that are not finite.
    pub fn settle(&mut self) -> Result<(), ProgramError> {
        match &mut self.fibres {
            Some(fibres) if self.communicator.size() > 1 => self.flow.settle(fibres),
            _ => Ok(()),
        }
    }
}

/// Periods of the mesh, or of the box of a prescribed flow.
fn periods(case: &Case, mesh: Option<&SceneMesh>) -> Periods {
    let mut periods = Periods::default();
    match (mesh, case.domain()) {
        (Some(mesh), _) => periods = mesh.local.periods,
        (None, Some(domain)) => {
            for c in (0..3).filter(|&c| domain.periodic[c]) {
                periods.vectors[c][c] = domain.size[c];
            }
        }
        (None, None) => {}
    }
    periods
}

/// The periodic box of a case without a mesh.
pub fn prescribed_box(case: &Case) -> PeriodicBox {
    periodic_box(case, &periods(case, None))
}

/// Along axes only: a sheared lattice has no box.
fn periodic_box(case: &Case, periods: &Periods) -> PeriodicBox {
    let length = |c: usize| Some(periods.vectors[c][c]).filter(|l| *l > 0.0);
    PeriodicBox {
        origin: (case.domain()).map_or_else(Vector3::zeros, |d| d.origin.into()),
        lengths: [length(0), length(1), length(2)],
    }
}

/// Explicitly placed fibres must lie in the domain: the box of the case, or the bounds of its mesh.
fn check_fibres(
    case: &Case,
    document: &Document,
    mesh: Option<&SceneMesh>,
    communicator: &Communicator,
) -> Result<(), ProgramError> {
    let checked = if let Some(domain) = case.domain() {
        let high = [0, 1, 2].map(|c| domain.origin[c] + domain.size[c]);
        validate_domain(case, document, domain.origin, high, domain.periodic)
    } else if let Some(mesh) = mesh {
        let periods = &mesh.local.periods;
        let periodic = [0, 1, 2].map(|c| (0..3).any(|k| periods.vectors[k][c] != 0.0));
        let owned = &mesh.local.nodes;
        let low = [0, 1, 2].map(|c| {
            let least = owned.iter().map(|x| x[c]).fold(f64::INFINITY, f64::min);
            communicator.min(least)
        });
        let high = [0, 1, 2].map(|c| {
            let most = owned.iter().map(|x| x[c]).fold(f64::NEG_INFINITY, f64::max);
            communicator.max(most)
        });
        validate_domain(case, document, low, high, periodic)
    } else {
        Ok(())
    };
    agree(communicator, checked.map_err(ProgramError::from))
}
