//! All linked fibres in flat arrays, and their step.

use super::fibre::{Joint, LinkedFibre};
use super::friction;
use super::grips::{self, Grip};
use super::groups::Groups;
use super::joints::{Strain, Workspace, hold, push};
use super::mobility::Mobility;
use super::pins;
use super::settings::{LinkedScheme, LinkedSettings};
use super::step::{Counts, Scratch};
use super::touch::{Neighbours, Touch};
use super::walls::Walls;
use crate::contact::ContactError;
use crate::{FibreError, FibreSystem, FlowFormula, Quaternion, Reaction, Vector3};
use fibreflow_parallel::Communicator;
use nalgebra::Quaternion as Parameters;

/// Constants of one fibre.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub id: u64,
    pub radius: f64,
    pub half_length: f64,
    pub mobility: Mobility,
    /// Velocity by force in a flow that does not give way \[m/(N·s)\].
    pub own: [f64; 2],
    pub bending: [f64; 2],
    pub twisting: f64,
    pub joint: Joint,
    pub weight: Vector3,
    /// Mean of the centres \[m\].
    pub centre: Vector3,
    /// Its velocity in the step before \[m/s\].
    pub rate: Vector3,
}

/// One segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    pub chain: u32,
    /// Index among all segments.
    pub index: u32,
    /// First of its fibre.
    pub first: bool,
    pub centre: Vector3,
    pub frame: Quaternion,
    /// Frame without load by that of the segment before.
    pub equilibrium: Quaternion,
    pub axis: Vector3,
    /// Centre and axis at which the flow was felt in the last step.
    pub felt: [Vector3; 2],
    pub velocity: Vector3,
    pub spin: Vector3,
    /// Force in the joint before it, on the segment before; zero for the first \[N\].
    pub joint_force: Vector3,
    /// Torque of the pin before it, on the segment before \[N·m\].
    pub pin_torque: Vector3,
    /// Derivative of the frame's Euler parameters in the step before \[1/s\].
    pub rate: Parameters<f64>,
}

/// Segments below which a loop over fibres is not divided between threads.
const GRAIN: usize = 512;
/// A pin must lie in its plane to this at the start.
const IN_PLANE: f64 = 1e-6;

/// All linked fibres, in the order of their ids; on one rank.
pub struct LinkedSystem {
    pub(super) settings: LinkedSettings,
    pub(super) chains: Vec<Chain>,
    /// First segment of each fibre and, last, their number. Nodes of fibre f start at that plus f.
    pub(super) offsets: Vec<usize>,
    pub(super) segments: Vec<Segment>,
    pub(super) neighbours: Neighbours,
    /// Contacts at the present positions, without friction.
    pub(super) touches: Vec<Touch>,
    /// Contacts of the last step with the forces that they had.
    pub(super) solved: Vec<Touch>,
    pub(super) walls: Walls,
    /// Points that the grips hold, in the order of the segments.
    pub(super) grips: Vec<Grip>,
    groups: Groups,
    /// Simulated time \[s\].
    pub(super) time: f64,
    /// Length of the step before \[s\]; zero before the first.
    pub(super) last_step: f64,
    /// Longest sub-step that the implicit scheme tries next \[s\].
    pub(super) trial: f64,
    pub(super) counts: Counts,
    pub(super) implicit: Scratch,
    /// What the fluid took in the last step in a sampled flow, by segment.
    pub(super) reaction: Reaction,
}

impl LinkedSystem {
    /// A system of the given fibres.
    ///
    /// # Errors
    /// Fibres or settings that cannot be used, two fibres with one id, more than one rank.
    pub fn new(
        communicator: &Communicator,
        mut settings: LinkedSettings,
        mut fibres: Vec<LinkedFibre>,
    ) -> Result<Self, FibreError> {
        if communicator.size() > 1 {
            return Err(FibreError::LinkedRanks);
        }
        settings.check()?;
        settings.grips = settings.grips.map(|g| g.check()).transpose()?;
        let walls = Walls::new(&settings.walls, settings.piston)?;
        fibres.sort_by_key(|f| f.id);
        let mut system = Self {
            settings,
            chains: Vec::new(),
            offsets: vec![0],
            segments: Vec::new(),
            neighbours: Neighbours::new(communicator.clone()),
            touches: Vec::new(),
            solved: Vec::new(),
            walls,
            grips: Vec::new(),
            groups: Groups::default(),
            time: 0.0,
            last_step: 0.0,
            trial: f64::INFINITY,
            counts: Counts::default(),
            implicit: Scratch::default(),
            reaction: Reaction::default(),
        };
        for fibre in &fibres {
            system.push(fibre)?;
            let off = |w: &[Quaternion]| (w[0] * Vector3::z()).dot(&(w[1] * Vector3::x())).abs();
            if fibre.joint == Joint::Pin && fibre.frames.windows(2).any(|w| off(w) > IN_PLANE) {
                return Err(FibreError::Linked {
                    fibre: fibre.id,
                    reason: "has pins, but is placed out of the plane in which these turn",
                });
            }
        }
        each(&mut system.chains, &mut system.segments, &|chain, s| {
            pins::fit(chain, s);
        });
        system.regrow();
        system.find_touches()?;
        if let Some(grips) = &system.settings.grips {
            system.grips = grips.find(&system.chains, &system.segments);
        }
        Ok(system)
    }

    /// Appends a fibre at rest.
    pub(super) fn push(&mut self, fibre: &LinkedFibre) -> Result<(), FibreError> {
        fibre.check()?;
        if self.chains.last().is_some_and(|last| last.id == fibre.id) {
            return Err(FibreError::DuplicateId { fibre: fibre.id });
        }
        let chain = self.chains.len();
        for (k, (&frame, &equilibrium)) in fibre.frames.iter().zip(&fibre.equilibrium).enumerate() {
            let node = (self.segments.len() + chain) as u32;
            let id = FibreSystem::segment_id(fibre.id, k);
            self.neighbours.push(id, node, fibre.radius);
            self.segments.push(Segment {
                chain: chain as u32,
                index: self.segments.len() as u32,
                first: k == 0,
                centre: Vector3::zeros(),
                frame,
                equilibrium,
                axis: frame * Vector3::x(),
                felt: [Vector3::zeros(); 2],
                velocity: Vector3::zeros(),
                spin: Vector3::zeros(),
                joint_force: Vector3::zeros(),
                pin_torque: Vector3::zeros(),
                rate: Parameters::new(0.0, 0.0, 0.0, 0.0),
            });
        }
        let s = &self.settings;
        let mobility = Mobility::new(fibre.half_length, fibre.radius, s.viscosity, s.spheroid);
        self.chains.push(Chain {
            id: fibre.id,
            radius: fibre.radius,
            half_length: fibre.half_length,
            own: mobility.force,
            mobility,
            bending: fibre.bending,
            twisting: fibre.twisting,
            joint: fibre.joint,
            weight: fibre.weight,
            centre: fibre.centre,
            rate: Vector3::zeros(),
        });
        self.offsets.push(self.segments.len());
        Ok(())
    }

    /// One step in a flow. Scheme A (S 2.10.2): explicit Euler the first time, Adams–Bashforth of second order after. Scheme B: as many
    /// sub-steps as the drift of the joints asks for.
    ///
    /// # Errors
    /// A periodic box that is too short for the segments, fibres at positions that are not finite.
    pub fn advance(&mut self, flow: FlowFormula<'_>, step: f64) -> Result<(), FibreError> {
        if self.settings.scheme == LinkedScheme::Implicit {
            return self.advance_implicit(&|_, x| flow(x, 0.0), step);
        }
        self.counts = Counts {
            steps: 1,
            ..Counts::default()
        };
        self.move_freely(flow);
        self.solve();
        self.integrate(step);
        let speed = self.walls.next_speed(&self.walls.presses, step);
        self.walls.advance(speed, step);
        self.time += step;
        self.last_step = step;
        self.check_finite()?;
        std::mem::swap(&mut self.touches, &mut self.solved);
        self.find_touches()?;
        Ok(())
    }

    /// Velocities with flow, weight, repulsion and the torques of joints, without friction and joint forces: a and b of S 2.43,
    /// 2.44.
    fn move_freely(&mut self, flow: FlowFormula<'_>) {
        each(&mut self.chains, &mut self.segments, &|chain, segments| {
            let count = segments.len();
            let mut before = Vector3::zeros();
            for i in 0..count {
                // Torque of the joint behind on this segment, and of that ahead.
                let ahead = match segments.get(i + 1) {
                    Some(next) => Strain::of(&segments[i], next).torque(chain, next),
                    None => Vector3::zeros(),
                };
                let s = &mut segments[i];
                s.felt = [s.centre, s.axis];
                let (velocity, gradient) = flow(&s.centre, 0.0);
                s.velocity = velocity + chain.mobility.velocity(&s.axis, &chain.weight);
                s.spin = chain.mobility.turned(&s.axis, &gradient)
                    + chain.mobility.spin(&s.axis, &(before - ahead));
                before = ahead;
            }
        });
        for touch in &self.touches {
            load(
                &self.chains,
                &mut self.segments,
                touch,
                &(touch.normal * -touch.push),
            );
        }
        for press in &self.walls.presses {
            let s = &mut self.segments[press.segment as usize];
            let chain = &self.chains[s.chain as usize];
            let force = press.normal * press.push;
            let lever = s.axis * (chain.half_length * f64::from(press.end));
            s.velocity += chain.mobility.velocity(&s.axis, &force);
            s.spin += chain.mobility.spin(&s.axis, &lever.cross(&force));
        }
    }

    /// Friction with the forces of joints and grips of the step before, then these with that friction (S 2.9.2).
    fn solve(&mut self) {
        if self.last_step == 0.0 {
            // There is no step before: joint forces without friction.
            let mut trial = self.segments.clone();
            each(&mut self.chains, &mut trial, &|chain, segments| {
                hold(chain, segments, &mut Workspace::default());
            });
            for (s, t) in self.segments.iter_mut().zip(&trial) {
                (s.joint_force, s.pin_torque) = (t.joint_force, t.pin_torque);
            }
        }
        if self.settings.friction != [0.0; 2] && self.touches.iter().any(|t| t.rubs) {
            self.groups.sort(&self.touches, self.segments.len());
            let mut held = self.segments.clone();
            if let Some(about) = &self.settings.grips {
                grips::load(&about.axis, &self.grips, &self.chains, &mut held);
            }
            each(&mut self.chains, &mut held, &|chain, segments| {
                push(chain, segments)
            });
            friction::solve(
                &mut self.touches,
                &self.groups,
                &self.chains,
                &held,
                self.settings.friction,
            );
            for touch in &self.touches {
                load(&self.chains, &mut self.segments, touch, &touch.friction);
            }
        }
        if let Some(about) = &self.settings.grips {
            let (chains, segments) = (&self.chains, &self.segments);
            grips::solve(&mut self.grips, about, chains, segments, &self.offsets);
            grips::load(&about.axis, &self.grips, chains, &mut self.segments);
        }
        each(&mut self.chains, &mut self.segments, &|chain, segments| {
            hold(chain, segments, &mut Workspace::default());
        });
    }

    /// S 2.96–2.98; with steps of unequal length the weights of the two rates follow.
    fn integrate(&mut self, step: f64) {
        let ratio = match self.last_step {
            0.0 => 0.0,
            last => 0.5 * step / last,
        };
        each(&mut self.chains, &mut self.segments, &|chain, segments| {
            let sum: Vector3 = segments.iter().map(|s| s.velocity).sum();
            let rate = sum / segments.len() as f64;
            chain.centre += (rate * (1.0 + ratio) - chain.rate * ratio) * step;
            chain.rate = rate;
            for s in segments.iter_mut() {
                let q = s.frame.into_inner();
                let rate = Parameters::from_imag(s.spin) * q * 0.5;
                let moved = q + (rate * (1.0 + ratio) - s.rate * ratio) * step;
                s.frame = Quaternion::new_normalize(moved);
                s.rate = rate;
            }
            pins::fit(chain, segments);
        });
        self.regrow();
    }

    /// Centres and nodes from the middles of the fibres and the frames (S 2.99, 2.100).
    pub(super) fn regrow(&mut self) {
        each(&mut self.chains, &mut self.segments, &|chain, segments| {
            let mut node = Vector3::zeros();
            let mut middle = Vector3::zeros();
            for s in segments.iter_mut() {
                s.axis = s.frame * Vector3::x();
                let half = s.axis * chain.half_length;
                s.centre = node + half;
                middle += s.centre;
                node = s.centre + half;
            }
            let shift = chain.centre - middle / segments.len() as f64;
            segments.iter_mut().for_each(|s| s.centre += shift);
        });
        let position = &mut self.neighbours.position;
        position.clear();
        for (f, chain) in self.chains.iter().enumerate() {
            let segments = &self.segments[self.offsets[f]..self.offsets[f + 1]];
            position.push(segments[0].centre - segments[0].axis * chain.half_length);
            let last = segments
                .iter()
                .map(|s| s.centre + s.axis * chain.half_length);
            position.extend(last);
        }
    }

    /// Contacts at the present positions.
    pub(super) fn find_touches(&mut self) -> Result<(), ContactError> {
        let strain = self.settings.shear_rate * self.time;
        // Within a long step pairs can come near from farther away.
        let more = match self.settings.scheme {
            LinkedScheme::Explicit => 0.0,
            LinkedScheme::Implicit => 0.5 * self.settings.skin,
        };
        let Self {
            neighbours,
            segments,
            settings,
            touches,
            walls,
            chains,
            time,
            ..
        } = self;
        let law = settings.repulsion.as_ref();
        walls.find(chains, segments, law, *time, more);
        neighbours.touches(segments, settings, strain, more, touches)
    }

    pub(super) fn check_finite(&self) -> Result<(), FibreError> {
        let sum = |s: &Segment| s.centre.sum() + s.frame.coords.sum();
        match self.segments.iter().position(|s| !sum(s).is_finite()) {
            None => Ok(()),
            Some(s) => {
                let fibre = self.segments[s].chain as usize;
                Err(FibreError::NonFinite {
                    fibre: self.chains[fibre].id,
                    node: s - self.offsets[fibre],
                    field: "position or frame",
                    position: self.segments[s].centre,
                })
            }
        }
    }
}

/// Adds what a force on the first segment of a contact, and its opposite on the second, do to their motion.
#[inline(always)]
fn load(chains: &[Chain], segments: &mut [Segment], touch: &Touch, force: &Vector3) {
    for (k, sign) in [(0, 1.0), (1, -1.0)] {
        let s = &mut segments[touch.segments[k] as usize];
        let mobility = &chains[s.chain as usize].mobility;
        s.velocity += mobility.velocity(&s.axis, &(force * sign));
        s.spin += mobility.spin(&s.axis, &(touch.arms[k].cross(force) * sign));
    }
}

/// What belongs to a segment of a fibre.
pub(super) trait Of {
    /// Index of the fibre.
    fn chain(&self) -> u32;
}

impl Of for Segment {
    fn chain(&self) -> u32 {
        self.chain
    }
}

/// Runs `work` on every fibre with what belongs to its segments, in parallel.
pub(super) fn each<T: Of + Send>(
    chains: &mut [Chain],
    segments: &mut [T],
    work: &(impl Fn(&mut Chain, &mut [T]) + Sync),
) {
    if segments.len() <= GRAIN || chains.len() == 1 {
        let mut rest = segments;
        for chain in chains {
            let first = rest.first().map_or(0, Of::chain);
            let count = rest.iter().position(|s| s.chain() != first);
            let (own, others) = rest.split_at_mut(count.unwrap_or(rest.len()));
            work(chain, own);
            rest = others;
        }
        return;
    }
    let (left, right) = chains.split_at_mut(chains.len() / 2);
    let first = segments[0].chain() as usize + left.len();
    let at = segments.partition_point(|s| (s.chain() as usize) < first);
    let (low, high) = segments.split_at_mut(at);
    rayon::join(|| each(left, low, work), || each(right, high, work));
}
