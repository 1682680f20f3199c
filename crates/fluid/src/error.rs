//! What can go wrong in the fluid. Every rank sees the same error.

use crate::PressureReason;
use fibreflow_solve::SolveError;

/// An impossible set-up, a solve that failed, or a solution that blew up.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FluidError {
    /// A number out of range in the settings.
    #[error("{name} = {value} is not possible: {expected}")]
    Setting {
        /// Which setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What would be valid.
        expected: &'static str,
    },
    /// The list of boundary conditions does not fit the patches of the mesh.
    #[error("{found} boundary conditions were given for {expected} patches")]
    Patches {
        /// Conditions given.
        found: usize,
        /// Patches of the mesh.
        expected: usize,
    },
    /// A mesh that would move through the boundary.
    #[error(
        "the mesh cannot move with the frame: patch `{patch}` is not along its velocity, \
         ({:.6e}, {:.6e}, {:.6e}) m/s", frame[0], frame[1], frame[2]
    )]
    FrameThroughBoundary {
        /// Patch name.
        patch: String,
        /// Velocity of the frame \[m/s\].
        frame: [f64; 3],
    },
    /// Linear forcing where it has no meaning.
    #[error(
        "linear forcing needs a mesh that is periodic in all directions, and a flow with convection"
    )]
    NotPeriodic,
    /// An eddy viscosity in creeping flow.
    #[error("an eddy viscosity needs a flow with convection")]
    EddiesWithoutConvection,
    /// No node of an outlet carries its pressure: all of them belong to walls or inlets too.
    #[error("outlet `{patch}` has no node of its own: all of them lie on walls or inlets as well")]
    EmptyOutlet {
        /// Patch name.
        patch: String,
    },
    /// More flows in than out, and no outlet takes the difference.
    #[error(
        "the boundary velocities let {net:.3e} m³/s out of the domain in total (speed times area of these \
         boundaries: {total:.3e} m³/s) and no outlet balances it"
    )]
    UnbalancedFlux {
        /// Net outward flux \[m³/s\].
        net: f64,
        /// Σ |velocity| |area| over boundaries of given velocity \[m³/s\].
        total: f64,
    },
    /// A table in time that makes no sense.
    #[error("entry {} of the table in time {problem}", entry + 1)]
    Table {
        /// Which entry, from zero.
        entry: usize,
        /// What is wrong with it.
        problem: String,
    },
    /// A NaN or infinity.
    #[error(
        "{field} is not finite at node {node}, position ({:.6e}, {:.6e}, {:.6e}) m, step {step}",
        position[0], position[1], position[2]
    )]
    NotFinite {
        /// Which field.
        field: &'static str,
        /// Index of the node in the whole mesh.
        node: u64,
        /// Where it is \[m\].
        position: [f64; 3],
        /// Steps completed before.
        step: u64,
    },
    /// Direct solves of the pressure equation were asked for where they are not possible.
    #[error("the pressure equation cannot be solved directly: {0}")]
    NoDirect(PressureReason),
    /// A time step that is not positive and finite.
    #[error("time step {0} s is not positive and finite")]
    TimeStep(f64),
    /// A step that only a flow without convection can take.
    #[error(
        "only a flow without convection answers forces linearly (inertia \"linear\" or \"steady\")"
    )]
    Convection,
    /// A stored state that does not fit the mesh.
    #[error("stored state: `{name}` {problem}")]
    State {
        /// Field or number.
        name: String,
        /// What is wrong with it.
        problem: String,
    },
    /// Averages that the mesh does not allow.
    #[error("statistics: {problem}")]
    Statistics {
        /// What is in the way.
        problem: String,
    },
    /// A linear solve failed.
    #[error("{equation} equation: {source}")]
    Solve {
        /// "momentum" or "pressure".
        equation: &'static str,
        /// What the solver reports.
        source: SolveError,
    },
}
