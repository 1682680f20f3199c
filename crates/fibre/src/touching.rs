//! Fibres that may touch: all fibres of all ranks advance in the same sub-steps, with contact forces in each.

use crate::contact::{ContactSettings, ContactSystem, SegmentLoad, Segments};
use crate::integrate::{Batch, Flow, Given, sub_steps};
use crate::system::{Model, Motion};
use crate::{FibreError, FibreSystem, Vector3};
use fibreflow_parallel::Communicator;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Contacts, the segments as they see them, and the loads they give.
pub(crate) struct Touching {
    pub contacts: ContactSystem,
    /// Critical step of the contacts at the end of the last step \[s\], the same on every rank; none before the first.
    /// Part of the state, since it decides the next number of sub-steps.
    pub critical_step: Option<f64>,
    /// Length of the last sub-step \[s\].
    last_step: Option<f64>,
    gathered: Gathered,
    load: Vec<SegmentLoad>,
}

/// End values of the segments of this rank.
#[derive(Default)]
struct Gathered {
    /// First node of each segment.
    node: Vec<usize>,
    ids: Vec<u64>,
    start: Vec<Vector3>,
    end: Vec<Vector3>,
    start_velocity: Vec<Vector3>,
    end_velocity: Vec<Vector3>,
    angular_velocity: Vec<Vector3>,
    radius: Vec<f64>,
    mass: Vec<f64>,
}

/// Segments that one thread gathers at least.
const GRAIN: usize = 1024;

impl Gathered {
    fn new(model: &Model) -> Self {
        let mut new = Self::default();
        for (f, fibre) in model.fibres.iter().enumerate() {
            let line_density = fibre.material.density * fibre.material.area();
            for (i, s) in model.segment_range(f).enumerate() {
                new.node.push(model.offsets[f] + i);
                new.ids.push(FibreSystem::segment_id(fibre.id, i));
                new.radius.push(fibre.material.radius);
                new.mass.push(line_density * model.segments[s].rest_length);
            }
        }
        for vectors in [
            &mut new.start,
            &mut new.end,
            &mut new.start_velocity,
            &mut new.end_velocity,
            &mut new.angular_velocity,
        ] {
            vectors.resize(new.node.len(), Vector3::zeros());
        }
        new
    }

    fn take(&mut self, motion: &Motion) {
        let node = &self.node;
        let fill = |out: &mut [Vector3], value: &(dyn Fn(usize) -> Vector3 + Sync)| {
            let chunks = out.par_iter_mut().with_min_len(GRAIN).zip(node);
            chunks.for_each(|(x, &i)| *x = value(i));
        };
        fill(&mut self.start, &|i| motion.position[i]);
        fill(&mut self.end, &|i| motion.position[i + 1]);
        fill(&mut self.start_velocity, &|i| motion.velocity[i]);
        fill(&mut self.end_velocity, &|i| motion.velocity[i + 1]);
        fill(&mut self.angular_velocity, &|i| {
            (motion.angular_velocity[i] + motion.angular_velocity[i + 1]) * 0.5
        });
    }

    fn view(&self) -> Segments<'_> {
        Segments {
            ids: &self.ids,
            start: &self.start,
            end: &self.end,
            start_velocity: &self.start_velocity,
            end_velocity: &self.end_velocity,
            angular_velocity: &self.angular_velocity,
            radius: &self.radius,
            mass: &self.mass,
        }
    }
}

impl Touching {
    pub fn new(settings: ContactSettings, communicator: &Communicator) -> Result<Self, FibreError> {
        Ok(Self {
            contacts: ContactSystem::new(settings, communicator)?,
            critical_step: None,
            last_step: None,
            gathered: Gathered::default(),
            load: Vec::new(),
        })
    }

    /// Takes over the segments of the model.
    pub fn rebuild(&mut self, model: &Model) {
        self.gathered = Gathered::new(model);
        self.load
            .resize(self.gathered.ids.len(), SegmentLoad::default());
    }

    /// Contact loads at the given motion, in the middle of a sub-step; friction moves on by `step`.
    fn press(&mut self, motion: &Motion, step: f64) -> Result<(), FibreError> {
        self.gathered.take(motion);
        let segments = self.gathered.view();
        let start = self.contacts.time();
        self.contacts.set_time(start + 0.5 * step);
        self.contacts.update(&segments)?;
        self.load.fill(SegmentLoad::default());
        self.contacts.forces(&segments, step, &mut self.load);
        if self.contacts.counts_crossings() {
            // Since the middle of the last sub-step, ends have drifted with the velocities they have now.
            let last = self.last_step.unwrap_or(step);
            self.contacts.count_crossings(0.5 * (last + step));
        }
        self.last_step = Some(step);
        self.contacts.set_time(start + step);
        Ok(())
    }
}

impl Batch<'_> {
    /// Adds the contact loads of one fibre's segments; the torque goes to both ends alike, as the spin of a segment is
    /// the mean of theirs.
    fn add_contacts(&mut self, model: &Model, loads: &[SegmentLoad]) {
        for (i, load) in loads[model.segment_range(self.fibres.start)]
            .iter()
            .enumerate()
        {
            self.load[i].force += load.start_force;
            self.load[i + 1].force += load.end_force;
            self.load[i].torque += load.torque * 0.5;
            self.load[i + 1].torque += load.torque * 0.5;
        }
    }
}

impl FibreSystem {
    /// One step of all fibres together. Collective.
    pub(crate) fn run_together(
        &mut self,
        touching: &mut Touching,
        given: Option<Given>,
        dt: f64,
    ) -> Result<(), FibreError> {
        let contact_step = touching
            .critical_step
            .unwrap_or_else(|| touching.contacts.critical_step(&touching.gathered.view()));
        let beam_step = self.communicator.min(self.critical_step());
        // Frequencies of beams and contacts add in squares.
        let critical = (beam_step.powi(-2) + contact_step.powi(-2)).powf(-0.5);
        let (n, step) = sub_steps(dt, self.settings.step_safety * critical);
        self.work = (n, n * self.segments());
        let flow = Flow::new(given, &self.settings)?;
        let model = &self.model;
        let (motion, scratch, reaction) = (&mut self.motion, &mut self.scratch, &mut self.reaction);
        let given_up = AtomicUsize::new(usize::MAX);
        let body = |fibre: &Batch| model.fibres[fibre.fibres.start].body.as_ref();
        Batch::all(model, motion, scratch, reaction).for_each(model, &|fibre| {
            if body(fibre).is_none() {
                fibre.begin(model, flow, step);
            }
        });
        for k in 0..n {
            touching.press(motion, step)?;
            let loads = &touching.load;
            Batch::all(model, motion, scratch, reaction).for_each(model, &|fibre| {
                fibre.add_contacts(model, loads);
                match body(fibre) {
                    None => fibre.sub_step(model, flow.is_some(), k, n, step),
                    Some(body) => {
                        if !fibre.sub_step_rigid(model, body, flow, step, (k, n)) {
                            given_up.fetch_min(fibre.fibres.start, Ordering::Relaxed);
                        }
                    }
                }
            });
        }
        Batch::all(model, motion, scratch, reaction).for_each(model, &|fibre| {
            if body(fibre).is_none() {
                fibre.end(model, flow);
            }
        });
        let segments = touching.gathered.view();
        touching.critical_step = Some(touching.contacts.critical_step(&segments));
        self.given_up(given_up.into_inner())
    }
}
