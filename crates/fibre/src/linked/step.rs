//! Scheme B: a step with bending, twist and repulsion implicit, joints and friction solved together.
//!
//! Torques of joints and gaps of contacts are those of the end of the step, by their slopes at its start (linearly implicit Euler;
//! the repulsion itself is not linearised). Flow, resistances and levers are those of the middle, foreseen by the motion of the
//! step before, so that what is not stiff moves with second order.

use super::cone::{self, Contact, Coupling, Found, Law, Source};
use super::grips::Grips;
use super::implicit::{Unknown, Work, assemble, solve};
use super::pins;
use super::system::{Chain, LinkedSystem, Segment, each};
use super::touch::Touch;
use super::walls::Press;
use crate::contact::Repulsion;
use crate::{FibreError, Matrix3, Quaternion, Vector3};
use rayon::prelude::*;

/// Joints that part by more than this many radii in a step ask for a shorter one.
const DRIFT: f64 = 0.05;
/// The shortest sub-step by the step.
const SHORTEST: f64 = 1.0 / 4096.0;
/// Part of the step above which friction that is not found asks for a shorter sub-step.
const SHORTER: f64 = 2e-3;
/// Gap by decay length from which deeper pairs are pushed apart in a step: fibres that overlap at the start come apart in several.
const DEEPEST: f64 = -12.0;
/// Part of what a gripped point has strayed from its plane that a step takes back.
const BACK: f64 = 0.1;
/// A pair is solved for if its gap can fall within range when it closes this much faster than it does without forces.
const FASTER: f64 = 2.0;

/// What a step took.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counts {
    pub steps: usize,
    pub sweeps: usize,
    /// Sub-steps in which limits of friction were taken as they were.
    pub unsettled: usize,
}

/// Work space of the implicit steps.
#[derive(Default)]
pub(super) struct Scratch {
    work: Vec<Work>,
}

/// u and ∇u around a segment, by its index, at a place.
pub(super) type Around<'a> = &'a (dyn Fn(usize, &Vector3) -> (Vector3, Matrix3) + Sync);

impl LinkedSystem {
    pub(super) fn advance_implicit(
        &mut self,
        flow: Around<'_>,
        step: f64,
    ) -> Result<(), FibreError> {
        let (start, mut done) = (self.time, 0.0);
        self.counts = Counts::default();
        // After one sub-step in which shortening did not help, it is not tried again in this step.
        let mut followed = false;
        while done < step {
            let left = step - done;
            // A sliver at the end is shared with the step before it.
            let part = match left / self.trial {
                n if n <= 1.0 => left,
                n if n < 2.0 => 0.5 * left,
                _ => self.trial,
            };
            let shorter = part > SHORTER * step && !followed;
            let (drift, found) = self.attempt(flow, part, shorter);
            followed |= found.followed;
            self.counts.steps += 1;
            self.counts.sweeps += found.sweeps;
            if part > SHORTEST * step && !within(drift, DRIFT) {
                // Joints part by the square of the step.
                let shorter = (0.8 * (DRIFT / drift).sqrt()).clamp(0.1, 0.8);
                self.trial = part * if drift.is_finite() { shorter } else { 0.1 };
                continue;
            }
            if !drift.is_finite() {
                return Err(FibreError::NoJointConvergence);
            }
            self.counts.unsettled += usize::from(found.unsettled);
            self.accept(part);
            self.react(flow, part);
            done = if part == left { step } else { done + part };
            self.time = start + done;
            self.last_step = part;
            if part < left || self.trial < step {
                self.trial = part * (DRIFT / drift.max(0.1 * DRIFT)).sqrt().clamp(0.5, 1.5);
            }
            self.check_finite()?;
            self.find_touches()?;
        }
        Ok(())
    }

    /// Solves for the motion in a step, without moving; by how many radii joints part in it. That is infinite where friction is not
    /// found and a shorter step may help (`shorter`). And what finding the forces took.
    fn attempt(&mut self, flow: Around<'_>, step: f64, shorter: bool) -> (f64, Found) {
        let mut work = std::mem::take(&mut self.implicit.work);
        self.foresee(flow, step, &mut work);
        let mut contacts = self.contacts(&work, step);
        let mut took = Found::default();
        if !contacts.is_empty() {
            let coupling = couple(&self.chains, &self.offsets, &work, &contacts);
            // Without repulsion there are grips alone, which do not ask for it.
            let [strength, decay] =
                (self.settings.repulsion).map_or([1.0; 2], |r| [r.strength, r.decay]);
            let law = Law {
                strength,
                decay,
                friction: self.settings.friction,
                step,
            };
            let Some(found) = cone::solve(&mut contacts, &coupling, &law, shorter) else {
                self.implicit.work = work;
                return (f64::INFINITY, took);
            };
            took = found;
            for c in &contacts {
                let force = c.directions * c.force;
                let sides = &c.segments[..c.sides()];
                add(&self.chains, &mut work, sides, &c.arms, &force);
                match c.source {
                    Source::Touch(k) => {
                        let touch = &mut self.touches[k];
                        touch.repulsion = c.force.x;
                        touch.push += c.force.x;
                        touch.friction = force + touch.normal * c.force.x;
                        touch.slides = c.slides;
                    }
                    Source::Press(k) => self.walls.presses[k].push = c.force.x,
                    Source::Grip(k) => self.grips[k].force = c.force.x,
                }
            }
            move_with_joints(&mut self.chains, &mut work);
        }
        let parted = work.windows(2).map(|pair| {
            let chain = &self.chains[pair[0].segment.chain as usize];
            let side = |w: &Work, sign: f64| {
                let s = &self.segments[w.segment.index as usize];
                let axis = Quaternion::new(w.moves[1] * step) * s.axis;
                s.centre + w.moves[0] * step + axis * (sign * chain.half_length)
            };
            match pair[1].segment.first {
                true => 0.0,
                false => (side(&pair[0], 1.0) - side(&pair[1], -1.0)).norm() / chain.radius,
            }
        });
        // What is not a number stays.
        let larger = |a: f64, b: f64| if b <= a || a.is_nan() { a } else { b };
        let drift = parted.fold(0.0, larger);
        self.implicit.work = work;
        (drift, took)
    }

    /// Segments in the middle of the step, by the motion of the one before; loads without contacts; the motion by these.
    fn foresee(&mut self, flow: Around<'_>, step: f64, work: &mut Vec<Work>) {
        let half = if self.last_step > 0.0 {
            0.5 * step
        } else {
            0.0
        };
        work.clear();
        work.extend(self.segments.iter().copied().map(Work::new));
        each(&mut self.chains, work, &|chain, work| {
            let (mut node, mut middle) = (Vector3::zeros(), Vector3::zeros());
            for w in work.iter_mut() {
                let s = &mut w.segment;
                s.axis = Quaternion::new(s.spin * half) * s.axis;
                s.centre = node + s.axis * chain.half_length;
                middle += s.centre;
                node = s.centre + s.axis * chain.half_length;
            }
            let shift = chain.centre + chain.rate * half - middle / work.len() as f64;
            for w in work.iter_mut() {
                let s = &mut w.segment;
                s.centre += shift;
                s.felt = [s.centre, s.axis];
                let (velocity, gradient) = flow(s.index as usize, &s.centre);
                let turning = chain.mobility.turned(&s.axis, &gradient);
                let [_, torque] = chain.mobility.drag(&s.axis, &Vector3::zeros(), &turning);
                let falling = chain.mobility.velocity(&s.axis, &chain.weight);
                w.load = [velocity + falling, torque];
            }
            assemble(chain, work, step);
        });
        // Attraction is weak and has no stiff slope.
        if let Some(law) = self.settings.repulsion {
            for touch in &mut self.touches {
                touch.push = pull(&law, touch);
                (touch.repulsion, touch.friction, touch.slides) = (0.0, Vector3::zeros(), false);
                if touch.push != 0.0 {
                    let force = touch.normal * -touch.push;
                    let arms = arms(touch, &self.segments, work, half);
                    add(&self.chains, work, &touch.segments, &arms, &force);
                }
            }
        }
        self.walls.presses.iter_mut().for_each(|p| p.push = 0.0);
        move_with_joints(&mut self.chains, work);
    }

    /// Pairs that can come within range in the step, with the forces of the last step to start from; then walls and grips.
    fn contacts(&self, work: &[Work], step: f64) -> Vec<Contact> {
        let mut contacts = Vec::new();
        if let Some(law) = &self.settings.repulsion {
            contacts = self.pairs(law, work, step);
            contacts.extend(self.at_walls(law, work, step));
        }
        contacts.extend(self.at_grips(work, step));
        contacts
    }

    fn at_walls<'a>(
        &'a self,
        law: &'a Repulsion,
        work: &'a [Work],
        step: f64,
    ) -> impl Iterator<Item = Contact> + 'a {
        let walls = &self.walls;
        let piston = walls.next_speed(&walls.solved, step);
        let contact = move |(k, press): (usize, &Press)| {
            let w = &work[press.segment as usize];
            let chain = &self.chains[w.segment.chain as usize];
            let arm = w.segment.axis * (chain.half_length * f64::from(press.end));
            let speed = walls.speed_of(press.wall, piston);
            let directions = Contact::directions(&-press.normal);
            let free =
                directions.tr_mul(&(w.moves[0] + w.moves[1].cross(&arm) - press.normal * speed));
            let coming = step * (FASTER * free.x).min(free.x).min(0.0);
            if press.gap + coming >= law.range {
                return None;
            }
            let before = walls.solved.binary_search_by_key(&press.key(), Press::key);
            let push = before.map_or(0.0, |at| walls.solved[at].push);
            Some(Contact {
                source: Source::Press(k),
                segments: [press.segment; 2],
                arms: [arm; 2],
                directions,
                gap: press.gap.max(DEEPEST * law.decay),
                free,
                force: Vector3::x() * push,
                rubs: false,
                slides: false,
                limit: 0.0,
            })
        };
        walls.presses.iter().enumerate().filter_map(contact)
    }

    fn at_grips<'a>(&'a self, work: &'a [Work], step: f64) -> impl Iterator<Item = Contact> + 'a {
        let contact = move |about: &'a Grips| {
            let directions = Contact::directions(&-about.axis);
            self.grips.iter().enumerate().map(move |(k, grip)| {
                let (w, s) = (&work[grip.segment as usize], grip.segment as usize);
                let s = &self.segments[s];
                let (arm, now) = (w.segment.axis * grip.along, s.centre + s.axis * grip.along);
                let plane = usize::from(grip.plane);
                let strayed = about.place(plane, self.time) - about.axis.dot(&now);
                let speed = about.speed_of(plane) + BACK * strayed / step;
                let velocity = w.moves[0] + w.moves[1].cross(&arm) - about.axis * speed;
                Contact {
                    source: Source::Grip(k),
                    segments: [grip.segment; 2],
                    arms: [arm; 2],
                    directions,
                    gap: 0.0,
                    free: directions.tr_mul(&velocity),
                    force: Vector3::x() * grip.force,
                    rubs: false,
                    slides: false,
                    limit: 0.0,
                }
            })
        };
        self.settings.grips.iter().flat_map(contact)
    }

    fn pairs(&self, law: &Repulsion, work: &[Work], step: f64) -> Vec<Contact> {
        let half = if self.last_step > 0.0 {
            0.5 * step
        } else {
            0.0
        };
        let contact = |(k, touch): (usize, &Touch)| {
            let [a, b] = touch.segments.map(|s| s as usize);
            let arms = arms(touch, &self.segments, work, half);
            let at = |s: usize, arm: &Vector3| {
                let [v, w] = work[s].moves;
                v + w.cross(arm)
            };
            let free = at(a, &arms[0]) - at(b, &arms[1]) + touch.image_velocity;
            let directions = Contact::directions(&touch.normal);
            let free = directions.tr_mul(&free);
            let coming = step * (FASTER * free.x).min(free.x).min(0.0);
            if touch.gap + coming >= law.range {
                return None;
            }
            let before = self
                .solved
                .binary_search_by_key(&touch.segments, |t| t.segments);
            let force = before.map_or(Vector3::zeros(), |at| {
                let before = &self.solved[at];
                let mut force = directions.tr_mul(&before.friction);
                force.x = before.repulsion;
                force
            });
            Some(Contact {
                source: Source::Touch(k),
                segments: touch.segments,
                arms,
                directions,
                gap: touch.gap.max(DEEPEST * law.decay),
                free,
                force,
                rubs: touch.gap + step * free.x.min(0.0) < law.contact_gap,
                slides: false,
                limit: 0.0,
            })
        };
        let touches = self.touches.par_iter().enumerate().with_min_len(128);
        touches.filter_map(contact).collect()
    }

    /// Moves everything by the motion found last.
    fn accept(&mut self, step: f64) {
        let work = std::mem::take(&mut self.implicit.work);
        each(&mut self.chains, &mut self.segments, &|chain, segments| {
            let mut rate = Vector3::zeros();
            for s in segments.iter_mut() {
                let w = &work[s.index as usize];
                [s.velocity, s.spin] = w.moves;
                s.joint_force = w.joint_force;
                s.felt = w.segment.felt;
                rate += s.velocity;
                let moved = Quaternion::new(s.spin * step) * s.frame;
                s.frame = Quaternion::new_normalize(moved.into_inner());
            }
            chain.rate = rate / segments.len() as f64;
            chain.centre += chain.rate * step;
            pins::fit(chain, segments);
        });
        self.implicit.work = work;
        self.regrow();
        std::mem::swap(&mut self.touches, &mut self.solved);
        let speed = self.walls.next_speed(&self.walls.solved, step);
        self.walls.advance(speed, step);
    }
}

/// False for what is not a number.
fn within(x: f64, limit: f64) -> bool {
    x <= limit
}

/// What attraction alone does at the gap of a pair: minus the pull \[N\].
fn pull(law: &Repulsion, touch: &Touch) -> f64 {
    if law.attraction == 0.0 || touch.gap >= law.range {
        return 0.0;
    }
    -law.attraction * (-(touch.gap.max(0.0) / law.attraction_width).powi(2)).exp()
}

/// Levers in the middle of the step, after `half` \[s\]: both forces act in one place, though the surfaces have slid past each other.
fn arms(touch: &Touch, segments: &[Segment], work: &[Work], half: f64) -> [Vector3; 2] {
    let moved = |k: usize| {
        let s = touch.segments[k] as usize;
        let (now, then) = (&work[s].segment, &segments[s]);
        let arm = touch.arms[k] + (now.axis - then.axis) * touch.along[k];
        (arm, now.centre - then.centre + arm - touch.arms[k])
    };
    let [(a, moved_a), (b, moved_b)] = [moved(0), moved(1)];
    let apart = (moved_a - moved_b + touch.image_velocity * half) * 0.5;
    [a - apart, b + apart]
}

/// Adds a force on a and its opposite on b to the loads.
fn add(
    chains: &[Chain],
    work: &mut [Work],
    segments: &[u32],
    arms: &[Vector3; 2],
    force: &Vector3,
) {
    for (k, (&segment, sign)) in segments.iter().zip([1.0, -1.0]).enumerate() {
        let w = &mut work[segment as usize];
        let s: &Segment = &w.segment;
        let mobility = &chains[s.chain as usize].mobility;
        w.load[0] += mobility.velocity(&s.axis, &(force * sign));
        w.load[1] += arms[k].cross(force) * sign;
    }
}

/// Velocities, spins and joint forces by the loads.
fn move_with_joints(chains: &mut [Chain], work: &mut [Work]) {
    each(chains, work, &|chain, work| {
        let mut motion: Vec<[Vector3; 2]> = work.iter().map(|w| w.load).collect();
        let mut unknowns = vec![Unknown::zeros(); work.len()];
        solve(chain, work, &mut motion, &mut unknowns);
        for ((w, moves), x) in work.iter_mut().zip(motion).zip(unknowns) {
            w.moves = moves;
            w.joint_force = x.fixed_rows::<3>(3) * chain.mobility.stokes;
        }
    });
}

/// How contacts answer each other's forces through the fibres.
fn couple(chains: &[Chain], offsets: &[usize], work: &[Work], contacts: &[Contact]) -> Coupling {
    let fibre = |c: &Contact, k: usize| work[c.segments[k] as usize].segment.chain as usize;
    let mut starts = vec![0; chains.len() + 1];
    for c in contacts {
        (0..c.sides()).for_each(|k| starts[fibre(c, k) + 1] += 1);
    }
    for f in 0..chains.len() {
        starts[f + 1] += starts[f];
    }
    let mut next = starts.clone();
    let mut sides = vec![(0, 0); starts[chains.len()]];
    let mut place = Vec::with_capacity(contacts.len());
    for (at, c) in contacts.iter().enumerate() {
        let mut side = |k: usize| {
            let f = fibre(c, k);
            sides[next[f]] = (at as u32, k);
            next[f] += 1;
            (f as u32, (next[f] - 1 - starts[f]) as u32)
        };
        let first = side(0);
        let second = if c.sides() == 2 { side(1) } else { first };
        place.push([first, second]);
    }
    let mut block_starts = vec![0; chains.len() + 1];
    for f in 0..chains.len() {
        let own = starts[f + 1] - starts[f];
        block_starts[f + 1] = block_starts[f] + own * own;
    }
    let blocks = (0..chains.len()).into_par_iter().with_min_len(32).map(|f| {
        let own = &sides[starts[f]..starts[f + 1]];
        let work = &work[offsets[f]..offsets[f + 1]];
        blocks(&chains[f], offsets[f], work, contacts, own)
    });
    let blocks: Vec<Vec<Matrix3>> = blocks.collect();
    Coupling {
        starts,
        contact: sides.iter().map(|(c, _)| *c).collect(),
        place,
        block_starts,
        blocks: blocks.concat(),
    }
}

/// Velocities at every side of a fibre by unit forces at every other one.
fn blocks(
    chain: &Chain,
    first: usize,
    work: &[Work],
    contacts: &[Contact],
    sides: &[(u32, usize)],
) -> Vec<Matrix3> {
    let n = sides.len();
    let mut found = vec![Matrix3::zeros(); n * n];
    let mut motion = vec![[Vector3::zeros(); 2]; work.len()];
    let mut unknowns = vec![Unknown::zeros(); work.len()];
    let sign = |side: usize| if side == 0 { 1.0 } else { -1.0 };
    for (j, &(contact, side)) in sides.iter().enumerate() {
        let c = &contacts[contact as usize];
        let at = c.segments[side] as usize - first;
        for column in 0..3 {
            let force = c.directions.column(column) * sign(side);
            motion.fill([Vector3::zeros(); 2]);
            motion[at] = [
                chain.mobility.velocity(&work[at].segment.axis, &force),
                c.arms[side].cross(&force),
            ];
            solve(chain, work, &mut motion, &mut unknowns);
            for (i, &(contact, side)) in sides.iter().enumerate() {
                let c = &contacts[contact as usize];
                let [v, w] = motion[c.segments[side] as usize - first];
                let velocity = (v + w.cross(&c.arms[side])) * sign(side);
                let seen = c.directions.tr_mul(&velocity);
                found[i * n + j].set_column(column, &seen);
            }
        }
    }
    found
}
