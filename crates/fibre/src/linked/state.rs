//! State of linked fibres for checkpoints.

use super::fibre::{Joint, LinkedFibre};
use super::system::LinkedSystem;
use crate::state::{Reader, Words};
use crate::{FibreError, FibreRecord, FibreState, Vector3};
use nalgebra::Quaternion as Parameters;

const TIME: &str = "linked.time";
const STEP: &str = "linked.step";
const TRIAL: &str = "linked.trial";

impl LinkedSystem {
    /// All that decides how the fibres move on, given the settings: a restored system goes on bit by bit.
    pub fn state(&self) -> FibreState {
        FibreState {
            records: (0..self.fibres()).map(|f| self.record(f)).collect(),
            scalars: vec![
                (TIME.into(), self.time),
                (STEP.into(), self.last_step),
                (TRIAL.into(), self.trial),
            ],
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

    fn read(
        &mut self,
        record: &FibreRecord,
        forces: &mut Vec<([u64; 2], f64, Vector3)>,
    ) -> Result<(), FibreError> {
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
}
