//! The state of fibres as records of 64-bit words that any rank can read: for checkpoints and changes of owner.

use crate::contact::FrictionRecord;
use crate::observe::Account;
use crate::shape::{Kinematics, Material, SEGMENT_BITS};
use crate::system::Load;
use crate::touching::Touching;
use crate::{FibreError, FibreSystem, Quaternion, Vector3};

/// One fibre: constants, loads, motion, and the friction springs of its segments against segments of higher id and
/// walls.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FibreRecord {
    /// Global id.
    pub id: u64,
    /// Contents; floating-point numbers by their bits.
    pub words: Vec<u64>,
}

/// The fibres of a rank.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FibreState {
    /// One for each fibre, in the order of the ids. They may be spread over other ranks, and other numbers of ranks,
    /// before they are restored.
    pub records: Vec<FibreRecord>,
    /// Numbers of the whole system, the same on every rank.
    pub scalars: Vec<(String, f64)>,
}

const CONTACT_STEP: &str = "fibre.contact_step";
const CONTACT_TIME: &str = "fibre.contact_time";
const CONTACT_LOSS: &str = "fibre.contact_loss";
const WALL_WORK: &str = "fibre.wall_work";
const CROSSINGS: &str = "fibre.crossings";

impl FibreSystem {
    /// All that decides how the fibres of this rank move on, given the settings: a restored system continues bitwise.
    /// Collective.
    pub fn state(&self) -> FibreState {
        let mut springs = self.contacts().map_or(Vec::new(), |c| c.records());
        springs.sort_unstable_by_key(|spring| (spring.a, spring.b));
        let touching = self.touching.as_ref();
        let step = touching.and_then(|t| t.critical_step);
        let time = touching.map(|t| t.contacts.time());
        let settled = touching.map(|t| t.contacts.settled());
        let [loss, work, crossings] = [0, 1, 2].map(|k| settled.map(|sums| sums[k]));
        let scalars = [
            (CONTACT_STEP, step),
            (CONTACT_TIME, time),
            (CONTACT_LOSS, loss),
            (WALL_WORK, work),
            (CROSSINGS, crossings),
        ];
        FibreState {
            records: (0..self.fibres())
                .map(|f| self.record(f, &springs))
                .collect(),
            scalars: scalars
                .into_iter()
                .filter_map(|(name, value)| value.map(|v| (name.into(), v)))
                .collect(),
        }
    }

    /// Replaces the fibres of this rank by those of the records.
    ///
    /// # Errors
    /// [`FibreError::Record`], [`FibreError::DuplicateId`]; the system then holds no fibres.
    pub fn restore(&mut self, state: FibreState) -> Result<(), FibreError> {
        let scalar = |wanted: &str| {
            let found = state.scalars.iter().find(|(name, _)| name == wanted);
            found.map(|(_, value)| *value)
        };
        if let Some(settings) = &self.settings.contacts {
            let touching = Touching::new(settings.clone(), &self.communicator)?;
            let touching = self.touching.insert(touching);
            touching.critical_step = scalar(CONTACT_STEP);
            touching
                .contacts
                .set_time(scalar(CONTACT_TIME).unwrap_or(0.0));
            let settled = [CONTACT_LOSS, WALL_WORK, CROSSINGS];
            touching
                .contacts
                .set_settled(settled.map(|name| scalar(name).unwrap_or(0.0)));
        }
        self.rebuild(state.records)
    }

    /// Replaces the fibres of this rank, and hands friction springs in the records to the contacts.
    pub(crate) fn rebuild(&mut self, mut records: Vec<FibreRecord>) -> Result<(), FibreError> {
        records.sort_by_key(|record| record.id);
        self.clear();
        let mut springs = Vec::new();
        for (k, record) in records.iter().enumerate() {
            let twice = k > 0 && records[k - 1].id == record.id;
            let result = if twice {
                Err(FibreError::DuplicateId { fibre: record.id })
            } else {
                self.read(record, &mut springs)
            };
            if let Err(error) = result {
                self.clear();
                self.resize_scratch();
                return Err(error);
            }
        }
        self.resize_scratch();
        if let Some(touching) = &mut self.touching
            && !springs.is_empty()
        {
            touching.contacts.restore_records(springs);
        }
        Ok(())
    }

    /// One fibre with those of the `springs` (in ascending order) that its segments come first in.
    pub(crate) fn record(&self, fibre: usize, springs: &[FrictionRecord]) -> FibreRecord {
        let constants = &self.model.fibres[fibre];
        let nodes = self.model.node_range(fibre);
        let account = self.accounts.fibres[fibre];
        let mut record = self.part(fibre, nodes, constants.id, account);
        let mut words = Words(std::mem::take(&mut record.words));
        let below = |id: u64| springs.partition_point(|s| s.a >> SEGMENT_BITS < id);
        for spring in &springs[below(constants.id)..below(constants.id + 1)] {
            words.0.extend([spring.a, spring.b]);
            words.numbers(&spring.spring);
        }
        record.words = words.0;
        record
    }

    /// A fibre in two parts, broken at `node` of it; the second one has the `id`.
    pub(crate) fn parts(&self, fibre: usize, node: usize, id: u64) -> [FibreRecord; 2] {
        let nodes = self.model.node_range(fibre);
        let (first, last) = (nodes.start, nodes.end);
        let account = self.accounts.fibres[fibre];
        [
            self.part(fibre, first..first + node + 1, self.id(fibre), account),
            self.part(fibre, first + node..last, id, account.of_part()),
        ]
    }

    /// Some consecutive nodes of a fibre as a fibre with this id, without friction springs.
    fn part(
        &self,
        fibre: usize,
        nodes: std::ops::Range<usize>,
        id: u64,
        account: Account,
    ) -> FibreRecord {
        let model = &self.model;
        let constants = &model.fibres[fibre];
        let skipped = nodes.start - model.offsets[fibre];
        let segments = model.segment_range(fibre).start + skipped;
        let segments = segments..segments + nodes.len() - 1;
        let points = model.points[segments.start]..model.points[segments.end];
        let width = self.carried.width;
        let mut words = Words(Vec::new());
        words.0.push(nodes.len() as u64);
        words.0.push(constants.stem + skipped as u64);
        words.0.push(match (&constants.body, constants.twist_free) {
            (None, false) => 0,
            (Some(_), _) => 1,
            (None, true) => 2,
        });
        words.0.extend(account.to_words());
        let m = &constants.material;
        words.numbers(&[
            m.radius,
            m.youngs_modulus,
            m.shear_modulus,
            m.density,
            m.retardation,
            f64::from(m.shear),
            m.bending_ratio,
            m.strength,
        ]);
        for i in nodes.clone() {
            let node = &model.nodes[i];
            words
                .0
                .push(u64::from(node.holds_translation) | u64::from(node.holds_rotation) << 1);
            let motion = &self.motion;
            // The part before has the load of the node that it shares.
            let load = if skipped > 0 && i == nodes.start {
                &Load::ZERO
            } else {
                &model.loads[i]
            };
            for v in [
                &load.force,
                &load.torque,
                &motion.position[i],
                &motion.velocity[i],
                &motion.angular_velocity[i],
            ] {
                words.numbers(v.as_slice());
            }
            words.numbers(motion.orientation[i].coords.as_slice());
        }
        for segment in &model.segments[segments] {
            words.numbers(&[segment.rest_length, segment.radius]);
            words.numbers(segment.start_frame.coords.as_slice());
            words.numbers(segment.end_frame.coords.as_slice());
        }
        words.0.push((points.len() * width) as u64);
        words.numbers(&self.carried.values[points.start * width..points.end * width]);
        FibreRecord { id, words: words.0 }
    }

    fn read(
        &mut self,
        record: &FibreRecord,
        springs: &mut Vec<FrictionRecord>,
    ) -> Result<(), FibreError> {
        let mut reader = Reader {
            fibre: record.id,
            words: &record.words,
        };
        let nodes = reader.word()? as usize;
        // A node has more words than one, so a count above their number is nonsense, however large.
        if nodes < 2 || nodes > record.words.len() {
            return Err(reader.error("it has an impossible number of nodes"));
        }
        let stem = reader.word()?;
        let kinematics = match reader.word()? {
            0 => Kinematics::Full,
            1 => Kinematics::Rigid,
            2 => Kinematics::TwistFree,
            _ => return Err(reader.error("it has an unknown kind of motion")),
        };
        let account = Account::from_words(reader.word()?, reader.numbers()?);
        let [radius, youngs_modulus, shear_modulus, density, retardation] = reader.numbers()?;
        let [shear, bending_ratio, strength] = reader.numbers()?;
        let material = Material {
            radius,
            youngs_modulus,
            shear_modulus,
            density,
            retardation,
            shear: shear != 0.0,
            bending_ratio,
            strength,
        };
        material.check(record.id)?;
        let mut held = Vec::with_capacity(nodes);
        let mut loads = Vec::with_capacity(nodes);
        for _ in 0..nodes {
            let flags = reader.word()?;
            held.push((flags & 1 != 0, flags & 2 != 0));
            loads.push(Load {
                force: reader.vector()?,
                torque: reader.vector()?,
            });
            self.motion.position.push(reader.vector()?);
            self.motion.velocity.push(reader.vector()?);
            self.motion.angular_velocity.push(reader.vector()?);
            self.motion.orientation.push(reader.quaternion()?);
        }
        let segments = (1..nodes)
            .map(|_| {
                let [rest_length, radius] = reader.numbers()?;
                let (start, end) = (reader.quaternion()?, reader.quaternion()?);
                Ok(material.segment(rest_length, radius, start, end))
            })
            .collect::<Result<_, FibreError>>()?;
        let carried = reader.word()? as usize;
        if carried > reader.words.len() {
            return Err(reader.error("its points carry an impossible count of numbers"));
        }
        let carried: Vec<f64> = (0..carried)
            .map(|_| reader.numbers().map(|[x]| x))
            .collect::<Result<_, _>>()?;
        while !reader.words.is_empty() {
            springs.push(FrictionRecord {
                a: reader.word()?,
                b: reader.word()?,
                spring: reader.numbers()?,
            });
        }
        self.push_constants((record.id, stem), material, kinematics, segments, &held);
        let first = self.model.loads.len() - nodes;
        self.model.loads[first..].copy_from_slice(&loads);
        // What was carried under other settings starts anew.
        let (first, room) = (
            self.carried.values.len(),
            self.point_count() * self.carried.width,
        );
        if carried.len() == room - first {
            self.carried.values.extend(carried);
        } else {
            self.carried.values.resize(room, 0.0);
        }
        if let Some(last) = self.accounts.fibres.last_mut() {
            *last = account;
        }
        Ok(())
    }
}

pub(crate) struct Words(pub Vec<u64>);

impl Words {
    pub fn numbers(&mut self, values: &[f64]) {
        self.0.extend(values.iter().map(|v| v.to_bits()));
    }
}

pub(crate) struct Reader<'a> {
    pub fibre: u64,
    pub words: &'a [u64],
}

impl Reader<'_> {
    pub fn error(&self, reason: &'static str) -> FibreError {
        FibreError::Record {
            fibre: self.fibre,
            reason,
        }
    }

    pub fn word(&mut self) -> Result<u64, FibreError> {
        let (&first, rest) = self
            .words
            .split_first()
            .ok_or_else(|| self.error("it is too short"))?;
        self.words = rest;
        Ok(first)
    }

    pub fn numbers<const N: usize>(&mut self) -> Result<[f64; N], FibreError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = f64::from_bits(self.word()?);
        }
        Ok(values)
    }

    pub fn vector(&mut self) -> Result<Vector3, FibreError> {
        Ok(Vector3::from(self.numbers::<3>()?))
    }

    pub fn quaternion(&mut self) -> Result<Quaternion, FibreError> {
        let [i, j, k, w] = self.numbers()?;
        // Not normalised again: the bits matter.
        Ok(Quaternion::new_unchecked(nalgebra::Quaternion::new(
            w, i, j, k,
        )))
    }
}
