//! What is seen of linked fibres.

use super::grips::Grip;
use super::joints::Strain;
use super::system::LinkedSystem;
use super::touch::Touch;
use crate::{Matrix3, Quaternion, Vector3};

/// Figures of all linked fibres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkedStatistics {
    /// Contacts that rub.
    pub contacts: usize,
    /// Contacts that slid in the last step.
    pub sliding: usize,
    /// Pairs that overlap.
    pub overlaps: usize,
    /// Largest overlap \[m\].
    pub max_overlap: f64,
    /// Energy of the joints \[J\] (S 2.34).
    pub elastic_energy: f64,
    /// Largest distance of pins from their planes, as the sine of an angle.
    pub pin_drift: f64,
    /// Searches for neighbours since the start.
    pub searches: usize,
    /// Sub-steps of the last step.
    pub steps: usize,
    /// Sweeps over the contacts in the last step.
    pub sweeps: usize,
    /// Sub-steps of the last step in which limits of friction were taken as they were, before they agreed with the repulsions.
    pub unsettled: usize,
}

impl LinkedSystem {
    /// Number of fibres.
    pub fn fibres(&self) -> usize {
        self.chains.len()
    }

    /// First segment of each fibre and, last, their number.
    pub fn offsets(&self) -> &[usize] {
        &self.offsets
    }

    /// Number of segments.
    pub fn segments(&self) -> usize {
        self.segments.len()
    }

    /// Global id of a fibre.
    pub fn id(&self, fibre: usize) -> u64 {
        self.chains[fibre].id
    }

    /// Radius of a fibre \[m\].
    pub fn radius(&self, fibre: usize) -> f64 {
        self.chains[fibre].radius
    }

    /// Length of a fibre \[m\], without its caps.
    pub fn length(&self, fibre: usize) -> f64 {
        let count = self.offsets[fibre + 1] - self.offsets[fibre];
        2.0 * self.chains[fibre].half_length * count as f64
    }

    /// Mean of the segments' centres of a fibre \[m\], unwrapped.
    pub fn centre(&self, fibre: usize) -> Vector3 {
        self.chains[fibre].centre
    }

    /// Joints and ends \[m\]: those of fibre f start at its first segment plus f.
    pub fn nodes(&self) -> &[Vector3] {
        &self.neighbours.position
    }

    /// Frame of a segment.
    pub fn frame(&self, segment: usize) -> Quaternion {
        self.segments[segment].frame
    }

    /// Velocity of the centre \[m/s\] and spin \[1/s\] of a segment in the last step.
    pub fn motion(&self, segment: usize) -> [Vector3; 2] {
        let s = &self.segments[segment];
        [s.velocity, s.spin]
    }

    /// Force in the joint before a segment in the last step \[N\]: on the segment before; the segment feels the opposite.
    pub fn joint_force(&self, segment: usize) -> Vector3 {
        self.segments[segment].joint_force
    }

    /// Contacts and what else is in range now; friction is that of the step to come, so zero.
    pub fn touches(&self) -> &[Touch] {
        &self.touches
    }

    /// Contacts of the last step with their forces.
    pub fn solved_touches(&self) -> &[Touch] {
        &self.solved
    }

    /// Sub-steps of the last step.
    pub fn sub_steps(&self) -> usize {
        self.counts.steps
    }

    /// Sub-steps of the last step in which limits of friction were taken as they were.
    pub fn unsettled(&self) -> usize {
        self.counts.unsettled
    }

    /// Simulated time \[s\].
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Centre and axis of a segment at which it felt the flow in the last step: at its start, or in the middle of an implicit one.
    pub fn felt(&self, segment: usize) -> [Vector3; 2] {
        self.segments[segment].felt
    }

    /// Force and torque of the flow on a segment in the last step, given the flow at [`LinkedSystem::felt`] \[N, N·m\].
    pub fn drag(&self, segment: usize, flow: &(Vector3, Matrix3)) -> [Vector3; 2] {
        let s = &self.segments[segment];
        let axis = &s.felt[1];
        let mobility = &self.chains[s.chain as usize].mobility;
        let (velocity, gradient) = flow;
        let slip = velocity - s.velocity;
        mobility.drag(axis, &slip, &(mobility.turned(axis, gradient) - s.spin))
    }

    /// What the piston has travelled \[m\], and its speed \[m/s\].
    pub fn piston(&self) -> [f64; 2] {
        [self.walls.travelled, self.walls.speed]
    }

    /// Force of the fibres on each wall in the last step, against its normal \[N\].
    pub fn wall_loads(&self) -> Vec<f64> {
        self.walls.loads(&self.walls.solved)
    }

    /// Force of the fibres on the piston in the last step \[N\].
    pub fn piston_load(&self) -> f64 {
        let piston = self.settings.piston.as_ref();
        piston.map_or(0.0, |p| self.wall_loads()[p.wall])
    }

    /// What the grips hold, with the forces of the last step.
    pub fn grips(&self) -> &[Grip] {
        &self.grips
    }

    /// Half the force with which the planes of the grips pull the fibres apart in the last step, T of S 2.115 \[N\].
    pub fn tension(&self) -> f64 {
        let pull = |g: &Grip| if g.plane == 0 { -g.force } else { g.force };
        0.5 * self.grips.iter().map(pull).sum::<f64>()
    }

    /// Figures of the present state.
    pub fn statistics(&self) -> LinkedStatistics {
        let mut figures = LinkedStatistics {
            searches: self.neighbours.searches,
            steps: self.counts.steps,
            sweeps: self.counts.sweeps,
            unsettled: self.counts.unsettled,
            sliding: self.solved.iter().filter(|t| t.slides).count(),
            ..LinkedStatistics::default()
        };
        for touch in &self.touches {
            figures.contacts += usize::from(touch.rubs);
            figures.overlaps += usize::from(touch.gap < 0.0);
            figures.max_overlap = figures.max_overlap.max(-touch.gap);
        }
        for pair in self.segments.windows(2).filter(|pair| !pair[1].first) {
            let chain = &self.chains[pair[1].chain as usize];
            figures.elastic_energy += Strain::of(&pair[0], &pair[1]).energy(chain, &pair[1]);
            if chain.joint == super::Joint::Pin {
                let off = (pair[0].frame * Vector3::z()).dot(&pair[1].axis).abs();
                figures.pin_drift = figures.pin_drift.max(off);
            }
        }
        figures
    }
}
