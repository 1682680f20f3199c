//! A step in which the forces of the fibres are solved for together with the flow.
//!
//! Without convection the fluid answers a force at once: F → flow → fibres → F' is a map whose slope is the resistance of
//! the fibres by that of the fluid, about μ_rel − 1, and forces of the step before would grow by it in every step. The
//! fixed point F' = F is found by Anderson acceleration, each round one Stokes solve that starts from the last answer
//! and one step of the fibres from the same state.

use super::exchange::Exchange;
use crate::error::ProgramError;
use crate::figures::{Timings, timed};
use fibreflow_coupling::{Anderson, SpreadReport};
use fibreflow_fibre::{Ambient, FibreSystem, Points, Reaction, Saved};
use fibreflow_fluid::{Fluid, Inertia, StepReport};
use nalgebra::Vector3;

/// Rounds before a step is given up.
const MOST: usize = 60;
/// Rounds that the acceleration remembers.
const DEPTH: usize = 20;
/// Part of the change that a round has to take away; after two rounds in a row that do not, the acceleration starts anew: a
/// contact that came or went between two rounds has told it what is not so.
const PROGRESS: f64 = 0.7;
/// Between fibres that touch, forces jump as contacts come and go a sub-step earlier or later, and need not have a fixed
/// point closer than this. After as many new starts as [`STARTS`] it is enough: the fluid gets what the fibres took anyway.
const LOOSE: f64 = 1e-2;
const STARTS: usize = 3;

/// How forces and flow were found.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rounds {
    /// Solves of the flow with other forces.
    pub rounds: usize,
    /// Change of the forces in the last round, relative.
    pub left: f64,
    /// The tolerance was not reached, as contacts came and went between rounds.
    pub loose: bool,
    /// By how much the first round changed forces more than it was given: what lagged forces would grow by in a step.
    pub gain: f64,
}

/// What a step brought.
pub struct Together {
    /// Of the forces that the fibres took.
    pub spread: SpreadReport,
    /// Of the fluid, over all rounds.
    pub fluid: StepReport,
    /// How it was found.
    pub rounds: Rounds,
}

impl Exchange {
    /// One step of fluid and fibres. Collective.
    ///
    /// # Errors
    /// Forces that are not found, or what a part reports.
    pub fn advance_together(
        &mut self,
        fluid: &mut Fluid,
        fibres: &mut FibreSystem,
        points: &mut Points,
        ambient: &mut Ambient,
        dt: f64,
        times: &mut Timings,
    ) -> Result<Together, ProgramError> {
        let communicator = fibres.communicator().clone();
        let steady = fluid.settings().inertia == Inertia::Steady;
        fibres.points_after(0.5 * dt, points);
        let scale = self.coupling.spacing();
        let [guess, memory] = self.columns(fibres.carried());
        let mut saved = Saved::default();
        fibres.save(&mut saved);
        let mut start = Ambient::default();
        timed(&mut times.sample, || {
            self.coupling
                .sample(fluid.velocity(), &points.position, &mut start)
        })?;
        self.correct(fibres, points, &memory, &mut start);
        let mut step = fluid.begin_step(dt)?;
        let (mut x, mut solver) = (guess, Anderson::new(DEPTH));
        let mut rounds = Rounds::default();
        let (mut first, mut moved) = (Vec::new(), 0.0);
        let touching = fibres.contacts().is_some();
        let (mut before, mut idle, mut starts) = (f64::INFINITY, 0, 0);
        let norm = |v: &[f64]| communicator.sum(v.iter().map(|v| v * v).sum()).sqrt();
        let apart = |a: &[f64], b: &[f64]| {
            let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
            communicator.sum(squares.sum()).sqrt()
        };
        loop {
            let given = unpacked(&x, scale);
            timed(&mut times.spread, || {
                self.spread_into(step.body_force_mut(), &given)
            })?;
            timed(&mut times.fluid, || step.solve())?;
            timed(&mut times.sample, || {
                self.coupling
                    .sample(step.velocity(), &points.position, ambient)
            })?;
            let remembered = self.remembered(&memory, points, ambient, &given, dt);
            self.correct(fibres, points, &remembered, ambient);
            in_motion(points, ambient, (!steady).then_some(&start), dt);
            let taken = timed(&mut times.fibres, || {
                if rounds.rounds > 0 {
                    fibres.go_back(&saved);
                }
                fibres.advance(ambient, dt)
            })?;
            let g = packed(taken, scale);
            rounds.rounds += 1;
            let (size, change) = (norm(&g), apart(&g, &x));
            rounds.left = if size > 0.0 { change / size } else { 0.0 };
            match rounds.rounds {
                1 => {
                    first.clone_from(&g);
                    moved = change;
                }
                2 if moved > 0.0 => rounds.gain = apart(&g, &first) / moved,
                _ => {}
            }
            let last = rounds.rounds == MOST;
            let found = rounds.left <= self.scheme.tolerance;
            let enough = touching && (starts == STARTS || last) && rounds.left <= LOOSE;
            if found || enough {
                rounds.loose = !found;
                x = g;
                break;
            }
            if last {
                return Err(ProgramError::failed(format!(
                    "forces between fluid and fibres were not found in {MOST} rounds (they change by {:.1e} in the last)",
                    rounds.left
                )));
            }
            idle = if rounds.left > PROGRESS * before {
                idle + 1
            } else {
                0
            };
            before = rounds.left;
            if idle == 2 {
                solver = Anderson::new(DEPTH);
                (idle, starts) = (0, STARTS.min(starts + 1));
            }
            solver.advance(&mut x, &g, &communicator);
        }
        // The fluid receives what the fibres took.
        let taken = unpacked(&x, scale);
        let spread = timed(&mut times.spread, || {
            self.spread_into(step.body_force_mut(), &taken)
        })?;
        let report = timed(&mut times.fluid, || {
            step.solve()?;
            step.finish()
        })?;
        let remembered = self.remembered(&memory, points, ambient, &taken, dt);
        self.put(fibres.carried_mut().0, &[x, remembered]);
        Ok(Together {
            spread,
            fluid: report,
            rounds,
        })
    }

    fn remembered(
        &self,
        memory: &[f64],
        points: &Points,
        ambient: &Ambient,
        reaction: &Reaction,
        dt: f64,
    ) -> Vec<f64> {
        let mut memory = memory.to_vec();
        if let Some(undisturbed) = &self.undisturbed {
            undisturbed.remember(&mut memory, points, ambient, reaction, dt);
        }
        memory
    }
}

/// From the flow at the points in the middle of their way to the one they meet: it changes as they move, and, where it has
/// inertia, from what it was at the `start` of the step.
fn in_motion(points: &Points, ambient: &mut Ambient, start: Option<&Ambient>, dt: f64) {
    ambient.change.clear();
    ambient.travel.clear();
    for p in 0..points.position.len() {
        let travel = dt * (ambient.gradient_at(p) * points.velocity[p]);
        let growth = start.map_or(Vector3::zeros(), |s| ambient.velocity[p] - s.velocity[p]);
        ambient.velocity[p] += 0.5 * travel;
        ambient.change.push(travel + growth);
        ambient.travel.push(travel);
    }
}

/// Forces and torques as one list of forces.
fn packed(reaction: &Reaction, scale: f64) -> Vec<f64> {
    let points = reaction.force.iter().zip(&reaction.torque);
    let flat = points.flat_map(|(f, t)| [f.x, f.y, f.z, t.x / scale, t.y / scale, t.z / scale]);
    flat.collect()
}

fn unpacked(x: &[f64], scale: f64) -> Reaction {
    let points = x.chunks_exact(6);
    Reaction {
        force: points
            .clone()
            .map(|p| Vector3::new(p[0], p[1], p[2]))
            .collect(),
        torque: points
            .map(|p| scale * Vector3::new(p[3], p[4], p[5]))
            .collect(),
    }
}
