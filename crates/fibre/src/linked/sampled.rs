//! Linked fibres in a flow that is sampled at their segments, and what they do to it.

use super::settings::LinkedScheme;
use super::step::Around;
use super::system::LinkedSystem;
use crate::{Ambient, FibreError, Points, Reaction, Vector3};

impl LinkedSystem {
    /// Where the flow has to be known for a step of `step` \[s\]: the middles of the segments half-way, at their present velocities.
    pub fn points(&self, step: f64, points: &mut Points) {
        points.position.clear();
        points.velocity.clear();
        for s in &self.segments {
            points.position.push(s.centre + s.velocity * (0.5 * step));
            points.velocity.push(s.velocity);
        }
    }

    /// A step by the implicit scheme in the flow sampled at [`LinkedSystem::points`]: u + ∇u (x − x_point) around a segment. Where
    /// the flow gives way to forces ([`Ambient::yielding`]) the segments of a fibre move with it, by the mean over the fibre. Returns the
    /// mean force and torque on the fluid at every point: that of the drag, so that it is opposite to all other forces.
    ///
    /// # Errors
    /// As [`LinkedSystem::advance`]; the explicit scheme.
    pub fn advance_sampled(
        &mut self,
        points: &Points,
        ambient: &Ambient,
        step: f64,
    ) -> Result<&Reaction, FibreError> {
        if self.settings.scheme == LinkedScheme::Explicit {
            return Err(FibreError::LinkedSampled);
        }
        self.give_way(&ambient.yielding);
        for sums in [&mut self.reaction.force, &mut self.reaction.torque] {
            sums.clear();
            sums.resize(self.segments.len(), Vector3::zeros());
        }
        let flow = |s: usize, x: &Vector3| {
            let gradient = *ambient.gradient_at(s);
            (
                ambient.velocity[s] + gradient * (x - points.position[s]),
                gradient,
            )
        };
        self.advance_implicit(&flow, step)?;
        let Reaction { force, torque } = &mut self.reaction;
        (force.iter_mut().chain(torque)).for_each(|impulse| *impulse /= step);
        Ok(&self.reaction)
    }

    /// The reaction of the last step in a sampled flow.
    pub fn reaction(&self) -> &Reaction {
        &self.reaction
    }

    /// Segments answer forces by their own mobility and that of the flow.
    fn give_way(&mut self, yielding: &[f64]) {
        for (f, chain) in self.chains.iter_mut().enumerate() {
            let range = self.offsets[f]..self.offsets[f + 1];
            let mean = yielding
                .get(range.clone())
                .map_or(0.0, |y| y.iter().sum::<f64>() / range.len() as f64);
            chain.mobility.force = chain.own.map(|m| m + mean);
        }
    }

    /// Adds what the drag of a sub-step, with the motion found in it, does to the fluid.
    pub(super) fn react(&mut self, flow: Around<'_>, step: f64) {
        let reactions = self
            .reaction
            .force
            .iter_mut()
            .zip(&mut self.reaction.torque);
        for (s, (force, torque)) in self.segments.iter().zip(reactions) {
            let mobility = &self.chains[s.chain as usize].mobility;
            let [place, axis] = &s.felt;
            let (velocity, gradient) = flow(s.index as usize, place);
            let turning = mobility.turned(axis, &gradient) - s.spin;
            let [drag, twist] = mobility.drag(axis, &(velocity - s.velocity), &turning);
            *force -= drag * step;
            *torque -= twist * step;
        }
    }
}
