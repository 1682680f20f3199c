//! Fibres that break where bending and tension together reach the strength of the material.
//!
//! At an inner node the largest tensile stress is σ = M/W + N/A, with the moments and the tension of the two segments that meet
//! there, W = πr³/4. A fibre breaks at the worst of its nodes, once a step: the first part keeps the id, the second gets
//! a new one above all others. Both keep position, velocity and frame at the break; what the lumped masses lose or gain of
//! momentum there is given back. Ends that were one fibre overlap by construction, so the segments beside a break never
//! touch each other.

use crate::implicit::for_hinges;
use crate::observe::Account;
use crate::{FibreError, FibreSystem, Vector3};

/// A fibre of this rank that breaks.
struct Break {
    fibre: usize,
    /// Counted from the fibre's first node.
    node: usize,
    /// Momentum before \[kg·m/s\].
    momentum: Vector3,
}

impl FibreSystem {
    /// Breaks every fibre whose stress has reached its strength; the number of breaks on all ranks. Points and local indices of
    /// fibres are others then. Collective.
    ///
    /// # Errors
    /// [`FibreError::IdTooLarge`] when there are no ids left; [`FibreError::NonFinite`].
    pub fn break_up(&mut self) -> Result<usize, FibreError> {
        self.check_finite()?;
        let breaks: Vec<Break> = (0..self.fibres()).filter_map(|f| self.weakest(f)).collect();
        let counts = self.communicator.all_gather(&[breaks.len() as u64]);
        let counts: Vec<u64> = counts.into_iter().flatten().collect();
        let total: u64 = counts.iter().sum();
        if total == 0 {
            return Ok(0);
        }
        let last = self.model.fibres.last().map_or(-1.0, |f| f.id as f64);
        let first = self.communicator.max(last) as u64 + 1;
        if first + total > Self::ID_LIMIT {
            return Err(FibreError::IdTooLarge {
                fibre: first + total,
                limit: Self::ID_LIMIT,
            });
        }
        let first = first + counts[..self.communicator.rank()].iter().sum::<u64>();
        let mut broken = breaks.iter().zip(first..).peekable();
        let mut records = Vec::with_capacity(self.fibres() + breaks.len());
        let mut pieces = Vec::with_capacity(breaks.len());
        for f in 0..self.fibres() {
            match broken.next_if(|(b, _)| b.fibre == f) {
                None => records.push(self.record(f, &[])),
                Some((b, id)) => {
                    records.extend(self.parts(f, b.node, id));
                    pieces.push(([self.id(f), id], b.momentum));
                }
            }
        }
        self.rebuild(records)?;
        for (ids, momentum) in pieces {
            self.give_back(ids, &momentum);
        }
        Ok(total as usize)
    }

    /// Where a fibre breaks now, if it does.
    fn weakest(&self, fibre: usize) -> Option<Break> {
        let constants = &self.model.fibres[fibre];
        let strength = constants.material.strength;
        if strength == f64::INFINITY || constants.body.is_some() {
            return None;
        }
        let mut stress = vec![0.0_f64; self.model.node_range(fibre).len()];
        let segments = &self.model.segments[self.model.segment_range(fibre)];
        if constants.twist_free {
            let nodes = self.model.node_range(fibre);
            let position = &self.motion.position[nodes.clone()];
            let orientation = &self.motion.orientation[nodes];
            let tension = |s: usize| {
                let length = (position[s + 1] - position[s]).norm();
                segments[s].tension(length)
            };
            for_hinges(&self.model, fibre, position, orientation, |at, hinge| {
                if let Some(node) = at.joint() {
                    for s in [node - 1, node] {
                        let both = segments[s].tensile_stress(hinge.moment(), tension(s));
                        stress[node] = stress[node].max(both);
                    }
                }
            });
        } else {
            for (s, segment) in segments.iter().enumerate() {
                let (start, end) = self.segment_poses(fibre, s);
                for (node, value) in [s, s + 1].into_iter().zip(segment.end_stresses(start, end)) {
                    stress[node] = stress[node].max(value);
                }
            }
        }
        let inner = 1..stress.len() - 1;
        let node = inner.max_by(|&a, &b| stress[a].total_cmp(&stress[b]))?;
        (stress[node] >= strength).then(|| Break {
            fibre,
            node,
            momentum: self.fibre_momentum(fibre),
        })
    }

    fn fibre_momentum(&self, fibre: usize) -> Vector3 {
        let nodes = self.model.node_range(fibre);
        nodes
            .map(|i| self.motion.velocity[i] * self.model.nodes[i].mass)
            .sum()
    }

    /// Moves two parts together so that they have this momentum.
    fn give_back(&mut self, ids: [u64; 2], momentum: &Vector3) {
        let parts = ids.map(|id| self.find(id));
        let parts = parts.into_iter().flatten();
        let (mut mass, mut now, mut free) = (0.0, Vector3::zeros(), true);
        for f in parts.clone() {
            now += self.fibre_momentum(f);
            let nodes = &self.model.nodes[self.model.node_range(f)];
            mass += nodes.iter().map(|node| node.mass).sum::<f64>();
            free &= !nodes.iter().any(|node| node.holds_translation);
        }
        if free {
            for f in parts {
                for i in self.model.node_range(f) {
                    self.motion.velocity[i] += (momentum - now) / mass;
                }
            }
        }
    }
}

impl Account {
    /// Of the part of a fibre that gets a new id: its energy was booked by the first part.
    pub fn of_part(&self) -> Self {
        Self::opened_at(self.is_open().then_some([0.0; 2]))
    }
}
