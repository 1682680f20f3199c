//! What passes between fibres and a fluid in a step.

use super::mesh::SceneMesh;
use crate::case::{self, Boundary, Case, Correction, CouplingMode, KernelKind, MeshSource, Scheme};
use crate::error::ProgramError;
use crate::figures::timed;
use fibreflow_coupling::{Coupling, Kernel, PlaneWall, SpreadReport, Undisturbed, Wake};
use fibreflow_fibre::linked::LinkedSystem;
use fibreflow_fibre::{Ambient, FibreSystem, Points, Reaction};
use fibreflow_fluid::{Fluid, Inertia};
use nalgebra::Vector3;
use std::fmt;

/// Steps between estimates of how the flow gives way; points move less than an element in each.
const ESTIMATE: u64 = 8;

/// How a step of fluid and fibres is taken together, and why.
#[derive(Clone, Debug)]
pub struct SchemeChoice {
    /// Forces are solved for with the flow.
    pub iterated: bool,
    /// Change of the forces in a round, relative, at which they are found.
    pub tolerance: f64,
    reason: &'static str,
}

impl fmt::Display for SchemeChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            tolerance, reason, ..
        } = self;
        if self.iterated {
            write!(
                f,
                "scheme iterated (forces solved with the flow, to {tolerance:.0e}): {reason}"
            )
        } else {
            write!(
                f,
                "scheme staggered (fibres in the flow extrapolated from the last two steps, then the fluid): {reason}"
            )
        }
    }
}

impl SchemeChoice {
    fn new(case: &case::Coupling, inertia: Inertia) -> Result<Self, ProgramError> {
        let convects = inertia == Inertia::Full;
        let (iterated, reason) = match (case.scheme, case.mode) {
            (Scheme::Iterated, _) if convects => {
                return Err(ProgramError::input(
                    "`coupling.scheme = \"iterated\"`: the fluid has convection, and its answer to forces is not linear then; `fluid.inertia = \"linear\"` or `\"steady\"`, or another scheme",
                ));
            }
            (Scheme::Iterated, _) => (true, "as set"),
            (Scheme::Staggered, _) => (false, "as set"),
            (Scheme::Auto, CouplingMode::OneWay) => (false, "the fluid does not feel the fibres"),
            (Scheme::Auto, _) if convects => (false, "the fluid has inertia to hold its velocity"),
            (Scheme::Auto, _) => (true, "without convection the flow answers at once"),
        };
        Ok(Self {
            iterated,
            tolerance: case.tolerance,
            reason,
        })
    }
}

/// Sampling, spreading, and what is remembered from step to step.
pub struct Exchange {
    /// Sampling and spreading.
    pub coupling: Coupling,
    /// The fibres act back on the fluid.
    pub two_way: bool,
    /// How a step is taken.
    pub scheme: SchemeChoice,
    /// Which nodes points reach.
    pub kernel: Kernel,
    /// Takes the fibres' own flow away.
    pub undisturbed: Option<Undisturbed>,
    /// Walls whose images are taken away too.
    pub walls: usize,
    /// ∂u/∂t of the last step \[m/s²\] by node, with halo; empty before the first and where forces are iterated.
    pub slope: Vec<[f64; 4]>,
    /// Body force that the case gives \[N/m³\], by owned node; empty without.
    pub forces: Vec<[f64; 4]>,
    before: Vec<[f64; 4]>,
    /// Wall time of the disturbance so far \[s\]; in the staggered scheme a part of sampling.
    pub correcting: f64,
}

impl Exchange {
    /// `given` marks the owned nodes of given velocity. Collective.
    ///
    /// # Errors
    /// A kernel or a scheme that does not fit the case.
    pub fn new(
        case: &Case,
        fluid: &case::Fluid,
        inertia: Inertia,
        mesh: &SceneMesh,
        given: Vec<bool>,
        forces: Vec<[f64; 4]>,
    ) -> Result<Self, ProgramError> {
        let two_way = case.coupling.mode == CouplingMode::TwoWay;
        let kernel = match (case.coupling.kernel, case.coupling.width) {
            (KernelKind::Gaussian, Some(width)) => Kernel::Gaussian { width },
            (KernelKind::Middle, _) => Kernel::Middle,
            _ => Kernel::Element,
        };
        let (local, geometry) = (mesh.local.clone(), mesh.geometry.clone());
        let coupling = Coupling::with_kernel(local, geometry, given, kernel)
            .map_err(|e| ProgramError::input(format!("`coupling.width`: {e}")))?;
        let corrects = match case.coupling.correction {
            Correction::None => false,
            Correction::Undisturbed => true,
            // The points of linked fibres have no memory.
            Correction::Auto => two_way && kernel.width().is_some() && !case.linked(),
        };
        let wake = match inertia {
            Inertia::Steady => Wake::Steady,
            Inertia::Linear => Wake::Diffusing,
            Inertia::Full => Wake::Carried,
        };
        let walls = if corrects {
            walls(case, fluid)
        } else {
            Vec::new()
        };
        let count = walls.len();
        if kernel == Kernel::Middle && case.linked() {
            return Err(ProgramError::input(
                "`coupling.kernel = \"middle\"`: linked fibres have one point a segment, in its middle; `\"element\"`",
            ));
        }
        let scheme = SchemeChoice::new(&case.coupling, inertia)?;
        if scheme.iterated && case.linked() {
            return Err(ProgramError::input(
                "linked fibres need a fluid with convection to hold its velocity: `fluid.inertia = \"full\"`, `coupling.mode = \"one-way\"`, or `coupling.scheme = \"staggered\"` at small steps",
            ));
        }
        let undisturbed = corrects
            .then(|| Undisturbed::new(kernel, fluid.viscosity, fluid.density, wake, walls))
            .transpose()
            .map_err(ProgramError::input)?;
        Ok(Self {
            coupling,
            two_way,
            scheme,
            kernel,
            undisturbed,
            walls: count,
            slope: Vec::new(),
            forces,
            before: Vec::new(),
            correcting: 0.0,
        })
    }

    /// Numbers that each hydrodynamic point carries: how the flow gives way there, or the last force and torque; then
    /// those of the disturbance.
    pub fn carried(&self) -> usize {
        self.own() + self.undisturbed.as_ref().map_or(0, Undisturbed::carried)
    }

    fn own(&self) -> usize {
        match (self.two_way, self.scheme.iterated) {
            (false, _) => 0,
            (true, false) => 1,
            (true, true) => 6,
        }
    }

    /// Columns of what the points carry: those of the scheme, those of the disturbance.
    pub(super) fn columns(&self, carried: &[f64]) -> [Vec<f64>; 2] {
        let (own, all) = (self.own(), self.carried());
        let column = |range: std::ops::Range<usize>| {
            let entries = carried.chunks_exact(all.max(1));
            entries
                .flat_map(|entry| &entry[range.clone()])
                .copied()
                .collect()
        };
        [column(0..own), column(own..all)]
    }

    /// The inverse of [`Exchange::columns`].
    pub(super) fn put(&self, carried: &mut [f64], columns: &[Vec<f64>; 2]) {
        let (own, all) = (self.own(), self.carried());
        for (p, entry) in carried.chunks_exact_mut(all.max(1)).enumerate() {
            entry[..own].copy_from_slice(&columns[0][p * own..(p + 1) * own]);
            let theirs = all - own;
            entry[own..].copy_from_slice(&columns[1][p * theirs..(p + 1) * theirs]);
        }
    }

    /// The flow that the fibres will move in, undisturbed by themselves, at the places where their points are in the
    /// middle of the step; its change as they meet it on their way. Of second order, from the last two velocities of the
    /// fluid. Collective.
    ///
    /// # Errors
    /// Points at positions that are not finite, or with too few nodes around.
    pub fn sample(
        &mut self,
        fluid: &Fluid,
        fibres: &mut FibreSystem,
        points: &mut Points,
        ambient: &mut Ambient,
        dt: f64,
    ) -> Result<(), ProgramError> {
        fibres.points_after(0.5 * dt, points);
        let velocity = fluid.velocity();
        let slope = Some(&self.slope[..]).filter(|slope| !slope.is_empty());
        if self.undisturbed.is_none() {
            let travels = fibres.settings().fluid_inertia;
            self.coupling
                .sample_met(velocity, slope, points, dt, travels, ambient)?;
        } else if let Some(slope) = slope {
            self.coupling
                .sample_changing(velocity, slope, &points.position, ambient)?;
        } else {
            self.coupling.sample(velocity, &points.position, ambient)?;
        }
        if self.two_way {
            self.estimate_response(fluid, fibres, points, ambient, dt)?;
        }
        if self.undisturbed.is_some() {
            let [_, memory] = self.columns(fibres.carried());
            self.correct(fibres, points, &memory, ambient);
            ambient.meet(&points.velocity, dt);
        }
        Ok(())
    }

    /// As [`Exchange::sample`] for linked fibres: the flow in the middle of the step, and how it gives way. Collective.
    ///
    /// # Errors
    /// Points at positions that are not finite, or with too few nodes around.
    pub fn sample_linked(
        &mut self,
        fluid: &Fluid,
        fibres: &LinkedSystem,
        points: &mut Points,
        ambient: &mut Ambient,
        dt: f64,
    ) -> Result<(), ProgramError> {
        fibres.points(dt, points);
        let (velocity, positions) = (fluid.velocity(), &points.position);
        if self.slope.is_empty() {
            self.coupling.sample(velocity, positions, ambient)?;
        } else {
            self.coupling
                .sample_changing(velocity, &self.slope, positions, ambient)?;
            let changes = ambient.velocity.iter_mut().zip(&ambient.change);
            changes.for_each(|(u, slope)| *u += 0.5 * dt * slope);
        }
        ambient.yielding.clear();
        if self.two_way {
            let response = self.coupling.response(positions)?;
            let per_force = dt / fluid.settings().density;
            ambient
                .yielding
                .extend(response.iter().map(|r| per_force * r));
        }
        Ok(())
    }

    /// As [`Exchange::spread`] for linked fibres. Collective.
    ///
    /// # Errors
    /// A reaction that does not fit the points sampled last.
    pub fn spread_linked(
        &mut self,
        fluid: &mut Fluid,
        reaction: &Reaction,
    ) -> Result<Option<SpreadReport>, ProgramError> {
        if !self.two_way {
            return Ok(None);
        }
        self.spread_into(fluid.body_force_mut(), reaction).map(Some)
    }

    /// Takes the own flow of the fibres away.
    pub(super) fn correct(
        &mut self,
        fibres: &FibreSystem,
        points: &Points,
        memory: &[f64],
        ambient: &mut Ambient,
    ) {
        if let Some(undisturbed) = &self.undisturbed {
            let offsets = fibres.point_offsets();
            timed(&mut self.correcting, || {
                undisturbed.correct(&offsets, points, memory, ambient);
            });
        }
    }

    /// How the flow gives way to the forces of a step: by the inertia of the nodes that they share.
    fn estimate_response(
        &mut self,
        fluid: &Fluid,
        fibres: &mut FibreSystem,
        points: &Points,
        ambient: &mut Ambient,
        dt: f64,
    ) -> Result<(), ProgramError> {
        let all = self.carried();
        if fluid.steps().is_multiple_of(ESTIMATE) {
            let mut response = self.coupling.response(&points.position)?;
            if let Some(undisturbed) = &self.undisturbed {
                // What a fibre does itself it does not feel.
                let own = undisturbed.own_response(&fibres.point_offsets(), points);
                let others = response.iter_mut().zip(own);
                others.for_each(|(response, own)| *response = (*response - own).max(0.0));
            }
            let entries = fibres.carried_mut().0.chunks_exact_mut(all);
            entries.zip(response).for_each(|(entry, r)| entry[0] = r);
        }
        let per_force = dt / fluid.settings().density;
        let entries = fibres.carried().chunks_exact(all);
        ambient.yielding.clear();
        ambient
            .yielding
            .extend(entries.map(|entry| per_force * entry[0]));
        Ok(())
    }

    /// The fibres' reaction as a body force of the next fluid step, momentum conserved; None one-way. Collective.
    ///
    /// # Errors
    /// A reaction that does not fit the points sampled last.
    pub fn spread(
        &mut self,
        fluid: &mut Fluid,
        fibres: &mut FibreSystem,
        points: &Points,
        ambient: &Ambient,
        dt: f64,
    ) -> Result<Option<SpreadReport>, ProgramError> {
        if !self.two_way {
            return Ok(None);
        }
        let (carried, reaction) = fibres.carried_mut();
        let report = self.spread_into(fluid.body_force_mut(), reaction)?;
        if let Some(undisturbed) = &self.undisturbed {
            let [own, mut memory] = self.columns(carried);
            undisturbed.remember(&mut memory, points, ambient, reaction, dt);
            self.put(carried, &[own, memory]);
        }
        Ok(Some(report))
    }

    /// Body force of the case and the fibres.
    pub(super) fn spread_into(
        &mut self,
        body_force: &mut [[f64; 4]],
        reaction: &Reaction,
    ) -> Result<SpreadReport, ProgramError> {
        body_force.fill([0.0; 4]);
        body_force[..self.forces.len()].copy_from_slice(&self.forces);
        Ok(self.coupling.spread(reaction, body_force)?)
    }

    /// To be called before the fluid moves on.
    pub fn before_step(&mut self, fluid: &Fluid) {
        self.before.clear();
        self.before.extend_from_slice(fluid.velocity());
    }

    /// Remembers how the fluid has changed in `dt` \[s\].
    pub fn after_step(&mut self, fluid: &Fluid, dt: f64) {
        self.slope.clear();
        let nodes = fluid.velocity().iter().zip(&self.before);
        let slope = nodes.map(|(u, old)| std::array::from_fn(|c| (u[c] - old[c]) / dt));
        self.slope.extend(slope);
    }
}

/// Sides of a box that hold the velocity of the fluid.
fn walls(case: &Case, fluid: &case::Fluid) -> Vec<PlaneWall> {
    let Some(MeshSource::Box {
        origin,
        size,
        periodic,
        ..
    }) = &case.mesh
    else {
        return Vec::new();
    };
    let mut walls = Vec::new();
    for c in (0..3).filter(|&c| !periodic[c]) {
        for (side, sign) in [("min", 1.0), ("max", -1.0)] {
            let name = format!("{}_{side}", ["x", "y", "z"][c]);
            let holds = matches!(
                fluid.boundaries.get(&name),
                Some(Boundary::Wall {} | Boundary::MovingWall { .. })
            );
            if holds {
                let place = if sign > 0.0 {
                    origin[c]
                } else {
                    origin[c] + size[c]
                };
                walls.push(PlaneWall {
                    normal: sign * Vector3::ith(c, 1.0),
                    offset: sign * place,
                });
            }
        }
    }
    walls
}
