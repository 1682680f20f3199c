//! State of linked fibres for checkpoints.

use super::fibre::{Joint, LinkedFibre};
use super::grips::Grip;
use super::system::LinkedSystem;
use super::touch::Touch;
use super::walls::Press;
use crate::state::{Reader, Words};
use crate::{FibreError, FibreRecord, FibreState, Vector3};
use nalgebra::Quaternion as Parameters;

const TIME: &str = "linked.time";
const STEP: &str = "linked.step";
const TRIAL: &str = "linked.trial";
const TRAVELLED: &str = "linked.piston.travelled";
const SPEED: &str = "linked.piston.speed";
/// Marks the second id of a force as that of a wall or grip, not a segment.
const OTHER: u64 = 1 << 63;
/// Of a grip, with [`OTHER`].
const GRIP: u64 = 1 << 62;

/// A force of the last step: what it is between, its size and the rest of it.
type Force = ([u64; 2], f64, Vector3);

impl LinkedSystem {
    /// All that decides how the fibres move on, given the settings: a restored system goes on bit by bit.
    pub fn state(&self) -> FibreState {
        let mut scalars = vec![
            (TIME.into(), self.time),
            (STEP.into(), self.last_step),
            (TRIAL.into(), self.trial),
        ];
        if self.settings.piston.is_some() {
            scalars.push((TRAVELLED.into(), self.walls.travelled));
            scalars.push((SPEED.into(), self.walls.speed));
        }
        FibreState {
            records: (0..self.fibres()).map(|f| self.record(f)).collect(),
            scalars,
        }
    }

    fn record(&self, fibre: usize) -> FibreRecord {
        let chain = &self.chains[fibre];
        let segments = &self.segments[self.offsets[fibre]..self.offsets[fibre + 1]];
        let mut words = Words(vec![segments.len() as u64]);
        words.0.push(match chain.joint {
            Joint::Ball => 0,
            Joint::Pin => 1,
        });
        words.numbers(&[chain.radius, chain.half_length, chain.twisting]);
        words.numbers(&chain.bending);
        for v in [&chain.weight, &chain.centre, &chain.rate] {
            words.numbers(v.as_slice());
        }
        for s in segments {
            words.numbers(s.frame.coords.as_slice());
            words.numbers(s.equilibrium.coords.as_slice());
            words.numbers(s.rate.coords.as_slice());
            for v in [&s.joint_force, &s.pin_torque, &s.velocity, &s.spin] {
                words.numbers(v.as_slice());
            }
        }
        // Forces of the last step are where the next one starts to look.
        let own = self.offsets[fibre] as u32..self.offsets[fibre + 1] as u32;
        for touch in self.solved.iter().filter(|t| own.contains(&t.segments[0])) {
            let [a, b] = touch.segments.map(|s| self.neighbours.id(s as usize));
            words.0.extend([a, b]);
            words.numbers(&[touch.repulsion]);
            words.numbers(touch.friction.as_slice());
        }
        for press in (self.walls.solved.iter()).filter(|p| own.contains(&p.segment)) {
            let wall = 2 * u64::from(press.wall) + u64::from(press.end > 0);
            let id = self.neighbours.id(press.segment as usize);
            words.0.extend([id, OTHER | wall]);
            words.numbers(&[press.push, 0.0, 0.0, 0.0]);
        }
        for grip in self.grips.iter().filter(|g| own.contains(&g.segment)) {
            let id = self.neighbours.id(grip.segment as usize);
            words.0.extend([id, OTHER | GRIP | u64::from(grip.plane)]);
            words.numbers(&[grip.force, grip.along, 0.0, 0.0]);
        }
        let (id, words) = (chain.id, words.0);
        FibreRecord { id, words }
    }

    /// Replaces the fibres by those of a state.
    ///
    /// # Errors
    /// Records that cannot be read.
    pub fn restore(&mut self, mut state: FibreState) -> Result<(), FibreError> {
        let scalar = |wanted: &str| {
            let found = state.scalars.iter().find(|(name, _)| name == wanted);
            found.map_or(0.0, |(_, value)| *value)
        };
        (self.time, self.last_step) = (scalar(TIME), scalar(STEP));
        self.trial = scalar(TRIAL);
        (self.walls.travelled, self.walls.speed) = (scalar(TRAVELLED), scalar(SPEED));
        state.records.sort_by_key(|record| record.id);
        self.chains.clear();
        self.segments.clear();
        self.neighbours.clear();
        self.offsets.truncate(1);
        let mut forces = Vec::new();
        for record in &state.records {
            self.read(record, &mut forces)?;
        }
        self.regrow();
        self.find_touches()?;
        self.remember(&forces);
        Ok(())
    }

    fn read(&mut self, record: &FibreRecord, forces: &mut Vec<Force>) -> Result<(), FibreError> {
        let mut reader = Reader {
            fibre: record.id,
            words: &record.words,
        };
        let count = reader.word()? as usize;
        // A segment has more words than one.
        if count == 0 || count > record.words.len() {
            return Err(reader.error("it has an impossible number of segments"));
        }
        let joint = match reader.word()? {
            0 => Joint::Ball,
            1 => Joint::Pin,
            _ => return Err(reader.error("it has an unknown kind of joint")),
        };
        let [radius, half_length, twisting] = reader.numbers()?;
        let bending = reader.numbers()?;
        let (weight, centre, rate) = (reader.vector()?, reader.vector()?, reader.vector()?);
        let mut fibre = LinkedFibre {
            id: record.id,
            radius,
            half_length,
            centre,
            frames: Vec::with_capacity(count),
            equilibrium: Vec::with_capacity(count),
            bending,
            twisting,
            joint,
            weight,
        };
        let mut rest = Vec::with_capacity(count);
        for _ in 0..count {
            fibre.frames.push(reader.quaternion()?);
            fibre.equilibrium.push(reader.quaternion()?);
            let [i, j, k, w] = reader.numbers()?;
            let vectors = [
                reader.vector()?,
                reader.vector()?,
                reader.vector()?,
                reader.vector()?,
            ];
            rest.push((Parameters::new(w, i, j, k), vectors));
        }
        while !reader.words.is_empty() {
            let pair = [reader.word()?, reader.word()?];
            let [repulsion] = reader.numbers()?;
            forces.push((pair, repulsion, reader.vector()?));
        }
        let first = self.segments.len();
        self.push(&fibre)?;
        for (s, (rate, [force, torque, velocity, spin])) in
            self.segments[first..].iter_mut().zip(rest)
        {
            (s.rate, s.joint_force, s.pin_torque) = (rate, force, torque);
            (s.velocity, s.spin) = (velocity, spin);
        }
        if let Some(chain) = self.chains.last_mut() {
            chain.rate = rate;
        }
        Ok(())
    }

    /// Takes over the forces of a checkpoint.
    fn remember(&mut self, forces: &[Force]) {
        self.solved.clear();
        self.walls.solved.clear();
        self.grips.clear();
        for &([a, b], size, rest) in forces {
            let Some(segment) = self.neighbours.find(a) else {
                continue;
            };
            if b & OTHER == 0 {
                let pair = self.neighbours.find(b).map(|b| [segment, b]);
                let at = pair.map(|pair| self.touches.binary_search_by_key(&pair, |t| t.segments));
                if let Some(Ok(at)) = at {
                    self.solved.push(Touch {
                        repulsion: size,
                        friction: rest,
                        ..self.touches[at]
                    });
                }
            } else if b & GRIP == 0 {
                let end = if b & 1 == 0 { -1 } else { 1 };
                let key = (segment, end, ((b & !OTHER) / 2) as u32);
                let presses = &self.walls.presses;
                if let Ok(at) = presses.binary_search_by_key(&key, Press::key) {
                    let press = Press {
                        push: size,
                        ..presses[at]
                    };
                    self.walls.solved.push(press);
                }
            } else if self.settings.grips.is_some() {
                self.grips.push(Grip {
                    segment,
                    plane: (b & 1) as u8,
                    along: rest.x,
                    force: size,
                });
            }
        }
        self.solved.sort_by_key(|t| t.segments);
        self.walls.solved.sort_by_key(Press::key);
        self.grips.sort_by_key(|g| (g.segment, g.plane));
    }
}
