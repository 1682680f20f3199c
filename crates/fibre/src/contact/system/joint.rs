//! Contacts in the equations of the implicit integrator. All collective.

use super::ContactSystem;
use crate::Vector3;
use crate::contact::Segments;
use crate::contact::linear::Sway;
use crate::contact::pairs::Bodies;
use rayon::prelude::*;

/// Segments that one thread takes at least.
const GRAIN: usize = 2048;

impl ContactSystem {
    /// Contact loads at the end of a step of length `dt` in which the nodes have moved by `shift` \[m\] and their frames
    /// turned by `turn`, with the friction springs of its start; `segments` are those of the last
    /// [`ContactSystem::update`].
    pub(crate) fn linearise(
        &mut self,
        segments: &Segments<'_>,
        shift: &[Vector3],
        turn: &[Vector3],
        dt: f64,
    ) {
        self.share(segments);
        self.spread(segments, shift, turn);
        let images = self.images();
        let bodies = Bodies {
            segments,
            ghosts: &self.ghosts,
        };
        self.loads.clear();
        let (law, loads, sway) = (&self.law, &self.loads, &self.sway);
        self.pairs.linearise(bodies, law, &images, sway, dt, loads);
        let pairs = &self.pairs;
        self.loads
            .gather(|segment| pairs.linear_load(segment, None));
        self.walls
            .linearise(segments, law, sway, self.time, dt, &mut self.loads);
    }

    /// How the loads of [`ContactSystem::linearise`] change when the nodes move by `shift` and turn by `turn`.
    pub(crate) fn change(&mut self, segments: &Segments<'_>, shift: &[Vector3], turn: &[Vector3]) {
        self.spread(segments, shift, turn);
        let (pairs, sway) = (&self.pairs, &self.sway);
        self.loads
            .gather(|segment| pairs.linear_load(segment, Some(sway)));
        self.walls.add_change(sway, &mut self.loads);
    }

    /// Largest part of its displacement in which the centre line of each owned segment reaches no other, if all keep to
    /// theirs; `segments` are where they were in the last [`ContactSystem::linearise`].
    pub(crate) fn strides(
        &mut self,
        segments: &Segments<'_>,
        shift: &[Vector3],
        turn: &[Vector3],
        out: &mut Vec<f64>,
    ) {
        self.spread(segments, shift, turn);
        let bodies = Bodies {
            segments,
            ghosts: &self.ghosts,
        };
        let (images, pairs, sway) = (self.images(), &self.pairs, &self.sway);
        let room = self.unseen(segments);
        out.resize(segments.count(), 1.0);
        let all = out.par_iter_mut().with_min_len(GRAIN).enumerate();
        all.for_each(|(segment, part)| {
            let ends = sway[segment].ends.map(|x| Vector3::from(x).norm());
            let unseen = room / ends[0].max(ends[1]).max(room);
            *part = pairs.own_stride(segment, bodies, &images, sway).min(unseen);
        });
    }

    /// How far a segment may move without reaching one that is not listed with it: those are at least half a skin and two
    /// radii apart \[m\].
    fn unseen(&self, segments: &Segments<'_>) -> f64 {
        let radii = segments.radius.iter().copied();
        0.25 * self.settings.skin + 0.8 * radii.fold(f64::INFINITY, f64::min)
    }

    /// Largest part of a displacement in which no centre line reaches another, over all ranks; `segments` are where they
    /// were in the last [`ContactSystem::linearise`] or [`ContactSystem::settle`].
    pub(crate) fn stride(
        &mut self,
        segments: &Segments<'_>,
        shift: &[Vector3],
        turn: &[Vector3],
    ) -> f64 {
        self.spread(segments, shift, turn);
        let bodies = Bodies {
            segments,
            ghosts: &self.ghosts,
        };
        let seen = self.pairs.stride(bodies, &self.images(), &self.sway);
        let farthest = shift.par_iter().with_min_len(GRAIN).map(|x| x.norm());
        let farthest = farthest.reduce(|| 0.0, f64::max);
        let room = self.unseen(segments);
        let unseen = room / farthest.max(room);
        self.communicator.min(seen.min(unseen))
    }

    /// Tells other ranks where the segments are.
    pub(crate) fn settle(&mut self, segments: &Segments<'_>) {
        self.share(segments);
    }

    /// Takes the contacts of the last [`ContactSystem::linearise`] for those of a finished step of length `dt`.
    pub(crate) fn commit(&mut self, dt: f64) {
        // Nothing is left to book for the explicit integrator.
        self.load_step = 0.0;
        let lost = self.pairs.commit(self.halo.owned());
        self.walls.commit(&self.law, dt, &mut self.totals.walls);
        self.totals.dissipated += self.totals.walls.dissipated + lost;
    }

    fn spread(&mut self, segments: &Segments<'_>, shift: &[Vector3], turn: &[Vector3]) {
        self.sway.resize(self.halo.total(), Sway::default());
        let owned = &mut self.sway[..segments.count()];
        let filled = owned.par_iter_mut().with_min_len(GRAIN).zip(segments.node);
        filled.for_each(|(sway, &node)| {
            let node = node as usize;
            *sway = Sway {
                ends: [shift[node].into(), shift[node + 1].into()],
                turn: ((turn[node] + turn[node + 1]) * 0.5).into(),
            };
        });
        self.halo.update(&mut self.sway);
    }
}
