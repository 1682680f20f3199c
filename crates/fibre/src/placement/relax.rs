//! Overlaps are removed by moving and turning rigid fibres.
//!
//! Every overlap δ of two shells, or of a node with a wall, stores ½δ²; the sum is minimised by damped inertial motion
//! that is stopped whenever it runs uphill (FIRE; Bitzek et al. 2006, Phys. Rev. Lett. 97, 170201). Shells are a little
//! thicker meanwhile, so that zero overlap is reached in a finite number of steps.

use super::crowd::{Body, Crowd, Turns};
use crate::contact::closest_points;
use crate::{Quaternion, Vector3};
use rayon::prelude::*;

/// By how much the shells are thicker than they have to be in the end.
const MARGIN: f64 = 0.02;
/// Steps after which progress is judged.
const PATIENCE: usize = 50;
/// Fraction of the overlap energy that has to vanish in that many steps.
const PROGRESS: f64 = 0.2;
/// Steps until it counts as stalled, whatever the progress.
const LIMIT: usize = 4000;
/// Fraction of the fibres that is put elsewhere, or given up, at a time.
const SHARE: f64 = 0.01;
/// How often fibres are put elsewhere without halving the overlap energy.
const ROUNDS: usize = 10;
/// Largest move in a step, in shells.
const STRIDE: f64 = 0.2;
/// Time steps with masses and stiffnesses of one.
const FIRST_STEP: f64 = 0.05;
const LARGEST_STEP: f64 = 0.25;

/// Pieces that one thread handles at least.
const GRAIN: usize = 256;

/// A generalised move: translation, and rotation times the radius of gyration.
type Move = [Vector3; 2];

/// One overlap, pushing fibre a by −push and fibre b by +push.
struct Push {
    bodies: [u32; 2],
    push: Vector3,
    arms: [Vector3; 2],
}

/// Moves fibres until none overlap. When that stalls, those that overlap most are put elsewhere by `replant`; when that
/// does not help, they are given up. Returns the steps taken.
pub(super) fn relax(crowd: &mut Crowd, mut replant: impl FnMut(&mut Crowd, usize)) -> usize {
    let mut relaxation = Relaxation::new(crowd);
    let (mut steps, mut lowest, mut hope) = (0, f64::INFINITY, ROUNDS);
    loop {
        let (taken, energy) = relaxation.descend(crowd);
        steps += taken;
        if energy == 0.0 {
            return steps;
        }
        let worst = relaxation.worst(crowd);
        if energy < 0.5 * lowest {
            (lowest, hope) = (energy, ROUNDS);
        }
        if hope > 0 {
            hope -= 1;
            worst.iter().for_each(|&i| replant(crowd, i));
        } else {
            worst.iter().for_each(|&i| crowd.bodies[i].gone = true);
        }
        relaxation.listed.clear();
    }
}

struct Relaxation {
    gyration: Vec<f64>,
    force: Vec<Move>,
    velocity: Vec<Move>,
    /// Sum of the overlaps of every fibre.
    pressed: Vec<f64>,
    pairs: Vec<[u32; 2]>,
    /// Piece ends when the pairs were found; empty before.
    listed: Vec<[Vector3; 2]>,
}

/// State of a step.
#[derive(Clone, Copy, Default)]
struct Overlap {
    energy: f64,
    /// Largest overlap of the shells without margin \[m\].
    worst: f64,
}

impl Relaxation {
    fn new(crowd: &Crowd) -> Self {
        let bodies = crowd.bodies.len();
        Self {
            gyration: crowd.bodies.iter().map(Body::gyration).collect(),
            force: vec![[Vector3::zeros(); 2]; bodies],
            velocity: vec![[Vector3::zeros(); 2]; bodies],
            pressed: vec![0.0; bodies],
            pairs: Vec::new(),
            listed: Vec::new(),
        }
    }

    /// Steps taken, and the energy at which it stalls; zero when no overlap is left.
    fn descend(&mut self, crowd: &mut Crowd) -> (usize, f64) {
        self.velocity.fill([Vector3::zeros(); 2]);
        let (mut dt, mut mixing, mut downhill) = (FIRST_STEP, 0.1, 0);
        let mut before = f64::INFINITY;
        for step in 0..LIMIT {
            let overlap = self.press(crowd);
            if overlap.worst <= 0.0 {
                return (step, 0.0);
            }
            if step.is_multiple_of(PATIENCE) {
                if step > 0 && overlap.energy > (1.0 - PROGRESS) * before {
                    return (step, overlap.energy);
                }
                before = overlap.energy;
            }
            let power = dot(&self.velocity, &self.force);
            if power > 0.0 {
                let ratio = dot(&self.velocity, &self.velocity) / dot(&self.force, &self.force);
                for (v, f) in self.velocity.iter_mut().zip(&self.force) {
                    for k in 0..2 {
                        v[k] = v[k] * (1.0 - mixing) + f[k] * (mixing * ratio.sqrt());
                    }
                }
                downhill += 1;
                if downhill > 5 {
                    dt = (1.1 * dt).min(LARGEST_STEP);
                    mixing *= 0.99;
                }
            } else {
                self.velocity.fill([Vector3::zeros(); 2]);
                (dt, mixing, downhill) = (0.5 * dt, 0.1, 0);
                dt = dt.max(0.1 * FIRST_STEP);
            }
            self.advance(crowd, dt);
        }
        (LIMIT, before)
    }

    /// Forces at the present places.
    fn press(&mut self, crowd: &mut Crowd) -> Overlap {
        self.find_pairs(crowd);
        self.force.fill([Vector3::zeros(); 2]);
        self.pressed.fill(0.0);
        let shared: &Crowd = crowd;
        let blocks: Vec<(Vec<Push>, Overlap)> = self
            .pairs
            .par_chunks(GRAIN)
            .map(|pairs| {
                let mut overlap = Overlap::default();
                let pushes = pairs.iter().filter_map(|&pair| {
                    let push = push(shared, pair, &mut overlap)?;
                    Some(push)
                });
                (pushes.collect(), overlap)
            })
            .collect();
        let mut total = Overlap::default();
        for (pushes, overlap) in &blocks {
            total.energy += overlap.energy;
            total.worst = total.worst.max(overlap.worst);
            for push in pushes {
                for (side, sign) in [(0, -1.0), (1, 1.0)] {
                    let body = push.bodies[side] as usize;
                    let force = push.push * sign;
                    self.force[body][0] += force;
                    self.force[body][1] += push.arms[side].cross(&force);
                    self.pressed[body] += force.norm();
                }
            }
        }
        for (i, body) in crowd.bodies.iter().enumerate().filter(|(_, b)| !b.gone) {
            let (force, torque, pressed) = wall_push(body, &mut total);
            self.pressed[i] += pressed;
            let [f, t] = self.force[i];
            self.force[i] = constrained(body, f + force, (t + torque) / self.gyration[i]);
        }
        total
    }

    fn advance(&mut self, crowd: &mut Crowd, dt: f64) {
        let moves = crowd.bodies.par_iter_mut().zip(&mut self.velocity);
        let given = self.force.par_iter().zip(&self.gyration);
        moves
            .with_min_len(GRAIN)
            .zip(given)
            .for_each(|((body, v), (f, gyration))| {
                for k in 0..2 {
                    v[k] += f[k] * dt;
                    let (size, limit) = (v[k].norm() * dt, STRIDE * body.shell);
                    if size > limit {
                        v[k] *= limit / size;
                    }
                }
                body.centre += v[0] * dt;
                let turn = Quaternion::from_scaled_axis(v[1] * (dt / gyration));
                body.rotation = turn * body.rotation;
            });
        let (bodies, local, owner) = (&crowd.bodies, &crowd.local, &crowd.owner);
        let pieces = crowd.ends.par_iter_mut().with_min_len(GRAIN);
        pieces
            .zip(local.par_iter().zip(owner))
            .for_each(|(ends, (local, &owner))| {
                *ends = local.map(|x| bodies[owner as usize].at(&x));
            });
    }

    /// Searches for pairs when an end has moved by half of the skin.
    fn find_pairs(&mut self, crowd: &mut Crowd) {
        let limit = 0.5 * (1.0 - 2.0 * MARGIN) * crowd.skin;
        let stayed = |(now, before): (&[Vector3; 2], &[Vector3; 2])| {
            (0..2).all(|k| (now[k] - before[k]).norm_squared() <= limit * limit)
        };
        if self.listed.len() == crowd.ends.len()
            && crowd.ends.par_iter().zip(&self.listed).all(stayed)
        {
            return;
        }
        self.listed.clone_from(&crowd.ends);
        self.pairs = crowd.pairs();
    }

    /// The fibres that are pressed most, a fixed share of all.
    fn worst(&self, crowd: &Crowd) -> Vec<usize> {
        let pressed = |&i: &usize| self.pressed[i] > 0.0 && crowd.bodies[i].turns != Turns::Held;
        let mut worst: Vec<usize> = (0..crowd.bodies.len()).filter(pressed).collect();
        worst.sort_by(|&i, &j| self.pressed[j].total_cmp(&self.pressed[i]).then(i.cmp(&j)));
        let left = crowd.bodies.iter().filter(|b| !b.gone).count();
        worst.truncate((SHARE * left as f64).ceil() as usize);
        worst
    }
}

fn push(crowd: &Crowd, pair: [u32; 2], overlap: &mut Overlap) -> Option<Push> {
    let [a, b] = pair.map(|p| p as usize);
    let bodies = [crowd.owner[a], crowd.owner[b]];
    let [first, second] = bodies.map(|i| &crowd.bodies[i as usize]);
    let shift = crowd.shift(a, b);
    let other = crowd.ends[b].map(|x| x - shift);
    let points = closest_points(&crowd.ends[a], &other);
    let apart = first.shell + second.shell;
    let depth = apart * (1.0 + MARGIN) - points.distance;
    if depth <= 0.0 {
        return None;
    }
    overlap.energy += 0.5 * depth * depth;
    overlap.worst = overlap.worst.max(apart - points.distance);
    let away = if points.distance > 1e-9 * apart {
        points.separation / points.distance
    } else {
        let across = (crowd.ends[a][1] - crowd.ends[a][0]).cross(&(other[1] - other[0]));
        across.try_normalize(0.0).unwrap_or_else(Vector3::x)
    };
    let at = |ends: &[Vector3; 2], s: f64| ends[0] + (ends[1] - ends[0]) * s;
    Some(Push {
        bodies,
        push: away * depth,
        arms: [
            at(&crowd.ends[a], points.s) - first.centre,
            at(&crowd.ends[b], points.t) - second.centre,
        ],
    })
}

/// Force and torque of the walls on a fibre, and how hard they press it, also where opposite walls cancel; many nodes
/// push no harder than the two ends.
fn wall_push(body: &Body, overlap: &mut Overlap) -> (Vector3, Vector3, f64) {
    let (mut force, mut torque, mut pressed) = (Vector3::zeros(), Vector3::zeros(), 0.0);
    let Some(walls) = body.walls else {
        return (force, torque, pressed);
    };
    let weight = 2.0 / body.nodes.len() as f64;
    for x in &body.nodes {
        let arm = body.rotation * x;
        let place = body.centre + arm;
        let excess = walls.excess(&place, body.clearance + MARGIN * body.shell);
        if excess == Vector3::zeros() {
            continue;
        }
        let beyond = walls.excess(&place, body.clearance).norm();
        overlap.worst = overlap.worst.max(beyond);
        overlap.energy += 0.5 * weight * excess.norm_squared();
        pressed += excess.norm() * weight;
        force += excess * weight;
        torque += arm.cross(&excess) * weight;
    }
    (force, torque, pressed)
}

/// What is left of force and scaled torque of a fibre that may not move in all ways.
fn constrained(body: &Body, force: Vector3, torque: Vector3) -> Move {
    match body.turns {
        Turns::Free => [force, torque],
        Turns::About(axis) => [force, axis * axis.dot(&torque)],
        Turns::Never => [force, Vector3::zeros()],
        Turns::Held => [Vector3::zeros(); 2],
    }
}

fn dot(a: &[Move], b: &[Move]) -> f64 {
    let pairs = a.iter().zip(b);
    pairs.map(|(a, b)| a[0].dot(&b[0]) + a[1].dot(&b[1])).sum()
}
