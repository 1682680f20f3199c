//! The flow around the fibres: solved for on a mesh, or prescribed.

use super::beads::beads;
use super::boundary::Boundaries;
use super::exchange::Exchange;
use super::forces::body_force;
use super::inertia::{InertiaChoice, bounds};
use super::initial::velocity_field;
use super::mesh::SceneMesh;
use super::phase::Phase;
use super::pipe::Pipe;
use super::settings::settings;
use super::together::Together;
use crate::case::{self, Case, Document};
use crate::error::{ProgramError, agree};
use crate::figures::Timings;
use fibreflow_coupling::{Beads, SpreadReport};
use fibreflow_fibre::hydrodynamics::AmbientFlow;
use fibreflow_fibre::{Ambient, FibreSystem, Points};
use fibreflow_fluid::{BoundaryCondition, Fluid, FluidError, Inertia, PhaseReport, StepReport};
use nalgebra::Vector3;
use std::path::Path;

/// The flow around the fibres.
pub enum Flow {
    /// A fluid on a mesh.
    Solved(Box<Solved>),
    /// A formula.
    Prescribed(AmbientFlow),
}

/// A fluid and what couples fibres to it.
pub struct Solved {
    /// The solver.
    pub fluid: Fluid,
    /// What passes between it and the fibres.
    pub exchange: Exchange,
    /// The second fluid, if there is one.
    pub phase: Option<Phase>,
    /// Beads, if there are any.
    pub beads: Option<Beads>,
    /// Which inertia it has, and why.
    pub inertia: InertiaChoice,
}

impl Flow {
    /// The flow of a case at its start. Collective.
    ///
    /// # Errors
    /// Boundaries, forcing or initial field that do not fit.
    pub fn new(
        case: &Case,
        document: &Document,
        mesh: Option<SceneMesh>,
        folder: &Path,
    ) -> Result<Self, ProgramError> {
        match (&case.fluid, mesh, &case.ambient) {
            (Some(fluid), Some(mesh), _) => {
                let solved = solved(case, document, fluid, &mesh, folder)?;
                Ok(Self::Solved(Box::new(solved)))
            }
            (_, _, Some(ambient)) => Ok(Self::Prescribed(prescribed(&ambient.flow))),
            _ => Err(ProgramError::input(
                "the case has neither a fluid nor a prescribed flow",
            )),
        }
    }

    /// The fluid, if it is solved for.
    pub fn fluid(&self) -> Option<&Fluid> {
        match self {
            Self::Solved(solved) => Some(&solved.fluid),
            Self::Prescribed(_) => None,
        }
    }

    /// A fluid is solved for, with convection.
    pub fn convects(&self) -> bool {
        self.inertia().is_some_and(|i| i.inertia == Inertia::Full)
    }

    /// Which inertia the fluid has, if one is solved for.
    pub fn inertia(&self) -> Option<&InertiaChoice> {
        match self {
            Self::Solved(solved) => Some(&solved.inertia),
            Self::Prescribed(_) => None,
        }
    }

    /// What passes between the fluid, if one is solved for, and the fibres.
    pub fn exchange(&self) -> Option<&Exchange> {
        match self {
            Self::Solved(solved) => Some(&solved.exchange),
            Self::Prescribed(_) => None,
        }
    }

    /// Forces are solved for together with the flow.
    pub fn iterates(&self) -> bool {
        self.exchange().is_some_and(|e| e.scheme.iterated)
    }

    /// Wall time on this rank for the flow that fibres make themselves \[s\].
    pub fn correcting(&self) -> f64 {
        self.exchange().map_or(0.0, |e| e.correcting)
    }

    /// u and ∇u at every hydrodynamic point in a step of `dt` \[s\]: the adjoint of [`Flow::spread`]. Collective.
    ///
    /// # Errors
    /// Points at positions that are not finite.
    pub fn sample(
        &mut self,
        fibres: &mut FibreSystem,
        points: &mut Points,
        ambient: &mut Ambient,
        dt: f64,
    ) -> Result<(), ProgramError> {
        match self {
            Self::Solved(solved) => {
                let fluid = &solved.fluid;
                solved.exchange.sample(fluid, fibres, points, ambient, dt)?;
            }
            Self::Prescribed(flow) => {
                fibres.points(points);
                ambient.velocity.clear();
                ambient.gradient.clear();
                for x in &points.position {
                    let (u, gradient) = flow.at(x);
                    ambient.velocity.push(u);
                    ambient.gradient.push(gradient);
                }
            }
        }
        Ok(())
    }

    /// The fibres' reaction as a body force of the next fluid step, momentum conserved. Collective.
    ///
    /// # Errors
    /// A reaction that does not fit the points sampled last.
    pub fn spread(
        &mut self,
        fibres: &mut FibreSystem,
        points: &Points,
        ambient: &Ambient,
        dt: f64,
    ) -> Result<Option<SpreadReport>, ProgramError> {
        match self {
            Self::Solved(solved) => {
                let fluid = &mut solved.fluid;
                solved.exchange.spread(fluid, fibres, points, ambient, dt)
            }
            Self::Prescribed(_) => Ok(None),
        }
    }

    /// The second fluid, if there is one.
    pub fn phase(&self) -> Option<&Phase> {
        match self {
            Self::Solved(solved) => solved.phase.as_ref(),
            Self::Prescribed(_) => None,
        }
    }

    /// Beads, if there are any.
    pub fn beads(&self) -> Option<&Beads> {
        match self {
            Self::Solved(solved) => solved.beads.as_ref(),
            Self::Prescribed(_) => None,
        }
    }

    /// One step of the order parameter, whose force then acts on the flow. Collective.
    ///
    /// # Errors
    /// A step that is not solved.
    pub fn advance_phase(&mut self, dt: f64) -> Result<Option<PhaseReport>, ProgramError> {
        let Self::Solved(solved) = self else {
            return Ok(None);
        };
        let Solved {
            fluid,
            exchange,
            phase: Some(phase),
            ..
        } = &mut **solved
        else {
            return Ok(None);
        };
        let report = phase.advance(fluid, dt, &mut exchange.forces)?;
        fluid.body_force_mut().copy_from_slice(&exchange.forces);
        Ok(Some(report))
    }

    /// One fluid step: convect, diffuse, project; `follow` remembers the change for fibres. Collective.
    ///
    /// # Errors
    /// A solve that does not converge, or a value that is not finite.
    pub fn advance(&mut self, dt: f64, follow: bool) -> Result<Option<StepReport>, ProgramError> {
        let Self::Solved(solved) = self else {
            return Ok(None);
        };
        if solved.beads.is_some() {
            return solved.advance_beads(dt).map(Some);
        }
        let Solved {
            fluid, exchange, ..
        } = &mut **solved;
        if !follow {
            return Ok(Some(fluid.advance(dt)?));
        }
        exchange.before_step(fluid);
        let report = fluid.advance(dt)?;
        exchange.after_step(fluid, dt);
        Ok(Some(report))
    }

    /// One step of fluid and fibres with forces that fit both, where [`Flow::iterates`]. Collective.
    ///
    /// # Errors
    /// Forces that are not found, or what a part reports.
    pub fn advance_together(
        &mut self,
        fibres: &mut FibreSystem,
        points: &mut Points,
        ambient: &mut Ambient,
        dt: f64,
        times: &mut Timings,
    ) -> Result<Option<Together>, ProgramError> {
        let Self::Solved(solved) = self else {
            return Ok(None);
        };
        let Solved {
            fluid, exchange, ..
        } = &mut **solved;
        exchange
            .advance_together(fluid, fibres, points, ambient, dt, times)
            .map(Some)
    }

    /// Longest step that the case allows now \[s\]. Collective.
    pub fn suggest_step(&self, time: &case::Time) -> f64 {
        let longest = time.max_step.unwrap_or(time.end);
        match (self, time.step, time.cfl) {
            (_, Some(step), _) => step,
            (Self::Solved(solved), None, Some(cfl)) => {
                let longest = solved.fluid.suggest_dt(cfl, longest);
                let phase = solved.phase.as_ref();
                phase.map_or(longest, |phase| phase.suggest_dt(&solved.fluid, longest))
            }
            _ => longest,
        }
    }

    /// Gives every fibre to the rank that holds the fluid around its middle. Collective.
    ///
    /// # Errors
    /// Points at positions that are not finite.
    pub fn settle(&mut self, fibres: &mut FibreSystem) -> Result<(), ProgramError> {
        let Self::Solved(solved) = self else {
            return Ok(());
        };
        let mut points = Points::default();
        fibres.points(&mut points);
        let mut ambient = Ambient::default();
        let velocity = solved.fluid.velocity();
        let coupling = &mut solved.exchange.coupling;
        coupling.sample(velocity, &points.position, &mut ambient)?;
        let loads = super::fibres::loads(fibres);
        let destination = coupling.points_owner(&loads);
        fibres.migrate(&destination)?;
        Ok(())
    }
}

impl Solved {
    /// One step of the flow with the beads in it, which then move. Collective.
    fn advance_beads(&mut self, dt: f64) -> Result<StepReport, ProgramError> {
        let fluid = &mut self.fluid;
        if let Some(beads) = &mut self.beads {
            let field = self.phase.as_ref().map(|phase| &phase.field);
            beads.hold(fluid, field, dt)?;
        }
        let report = fluid.advance(dt)?;
        if let Some(beads) = &mut self.beads {
            beads.follow(fluid, dt);
        }
        self.place_beads();
        Ok(report)
    }

    /// Profiles of the beads where they are. Collective.
    pub fn place_beads(&mut self) {
        if let Some(beads) = &mut self.beads {
            let field = self.phase.as_mut().map(|phase| &mut phase.field);
            beads.place(&self.fluid, field);
        }
    }
}

fn prescribed(flow: &case::AmbientFlow) -> AmbientFlow {
    match *flow {
        case::AmbientFlow::Quiescent => AmbientFlow::Quiescent,
        case::AmbientFlow::Uniform { velocity } => AmbientFlow::Uniform(Vector3::from(velocity)),
        case::AmbientFlow::Shear { rate } => AmbientFlow::Shear { rate },
        case::AmbientFlow::Extension { rate } => AmbientFlow::Extension { rate },
        case::AmbientFlow::PlanarExtension { rate } => AmbientFlow::PlanarExtension { rate },
        case::AmbientFlow::Vortex {
            velocity,
            wavelength,
        } => AmbientFlow::Vortex {
            velocity,
            wavelength,
        },
    }
}

fn solved(
    case: &Case,
    document: &Document,
    fluid: &case::Fluid,
    mesh: &SceneMesh,
    folder: &Path,
) -> Result<Solved, ProgramError> {
    let domain = case.domain();
    let communicator = mesh.local.halo.communicator();
    let inertia = InertiaChoice::new(case, fluid, bounds(&mesh.local));
    let boundaries = Boundaries {
        fluid,
        document,
        folder,
        domain: domain.as_ref(),
    };
    let pipe = Pipe::new(&mesh.local);
    let read = || {
        inertia.check(fluid, document)?;
        let settings = settings(&boundaries, &mesh.local.patches, inertia.inertia)?;
        Ok((
            settings,
            velocity_field(&fluid.initial, domain.as_ref(), &pipe, folder)?,
        ))
    };
    let (settings, initial) = agree(communicator, read())?;
    let as_input = |e| match e {
        FluidError::NoDirect(_) => {
            ProgramError::input(format!("`fluid.poisson.preconditioner = \"direct\"`: {e}"))
        }
        _ => ProgramError::input(format!("[fluid]: {e}")),
    };
    let mut solver =
        Fluid::new(mesh.local.clone(), mesh.geometry.clone(), settings).map_err(as_input)?;
    solver.set_velocity(initial).map_err(as_input)?;
    check_step(case, document, &solver)?;
    let forces = body_force(&fluid.forces, document, mesh)?;
    solver.body_force_mut()[..forces.len()].copy_from_slice(&forces);
    let phase = (case.phase.as_ref())
        .map(|phase| Phase::new(phase, &solver, &forces))
        .transpose()?;
    let given = given_velocity(mesh, &solver.settings().boundary);
    let exchange = Exchange::new(case, fluid, inertia.inertia, mesh, given, forces)?;
    let beads = (case.beads.as_ref())
        .map(|given| beads(given, case.phase.as_ref(), &solver))
        .transpose()?;
    let mut solved = Solved {
        exchange,
        phase,
        beads,
        fluid: solver,
        inertia,
    };
    solved.place_beads();
    if let (Some(beads), Some(phase)) = (&solved.beads, &mut solved.phase) {
        beads.wet(&solved.fluid, &mut phase.field)?;
    }
    Ok(solved)
}

/// A constant step that explicit diffusion cannot bear blows up at once.
fn check_step(case: &Case, document: &Document, fluid: &Fluid) -> Result<(), ProgramError> {
    let Some(step) = case.time.step else {
        return Ok(());
    };
    let stable = fluid.suggest_dt(f64::INFINITY, step);
    if stable >= step * (1.0 - 1e-9) {
        return Ok(());
    }
    let eddies = fluid.settings().turbulence.is_some();
    let (what, help) = if eddies {
        (
            "the eddy viscosity",
            "a smaller step, or `time.cfl` in its place",
        )
    } else {
        (
            "`fluid.diffusion = \"explicit\"`",
            "a smaller step, `time.cfl` in its place, or diffusion \"auto\" or \"implicit\"",
        )
    };
    let error = document.value_error(
        "time.step",
        format!("`time.step = {step}` is beyond the limit of {what}: {stable:.4e} s at the start"),
    );
    Err(error.with_help(help).into())
}

/// Owned nodes whose velocity is given.
fn given_velocity(mesh: &SceneMesh, conditions: &[BoundaryCondition]) -> Vec<bool> {
    let mut given = vec![false; mesh.local.owned()];
    for share in &mesh.geometry.boundary {
        given[share.node as usize] |= conditions[share.patch as usize].gives_velocity();
    }
    given
}
