//! Fibres that may touch: all fibres of all ranks advance in the same sub-steps, with contact forces in each.

use crate::contact::{ContactSettings, ContactSystem, Segments};
use crate::implicit::{ImplicitSettings, Integrator, Joint, Parties};
use crate::integrate::{Batch, Flow, Given, sub_steps};
use crate::system::{Model, Motion};
use crate::{FibreError, FibreSystem, Material};
use fibreflow_parallel::Communicator;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Contacts and the segments as they see them.
pub(crate) struct Touching {
    pub contacts: ContactSystem,
    /// Critical step of the contacts at the end of the last step \[s\], the same on every rank; none before the first.
    /// Part of the state, since it decides the next number of sub-steps.
    pub critical_step: Option<f64>,
    /// Length of the last sub-step \[s\].
    pub last_step: Option<f64>,
    joint: Joint,
    axes: Axes,
}

/// Constants of the segments of this rank.
#[derive(Default)]
pub(crate) struct Axes {
    /// First node of each segment.
    node: Vec<u32>,
    ids: Vec<u64>,
    stems: Vec<u64>,
    radius: Vec<f64>,
    mass: Vec<f64>,
}

impl Axes {
    fn new(model: &Model) -> Self {
        let mut new = Self::default();
        for (f, fibre) in model.fibres.iter().enumerate() {
            for (i, s) in model.segment_range(f).enumerate() {
                let segment = &model.segments[s];
                let section = Material {
                    radius: segment.radius,
                    ..fibre.material
                };
                new.node.push((model.offsets[f] + i) as u32);
                new.ids.push(FibreSystem::segment_id(fibre.id, i));
                new.stems.push(fibre.stem + i as u64);
                new.radius.push(segment.radius);
                new.mass
                    .push(section.density * section.area() * segment.rest_length);
            }
        }
        new
    }

    pub fn moving<'a>(&'a self, motion: &'a Motion) -> Segments<'a> {
        Segments {
            ids: &self.ids,
            stems: &self.stems,
            node: &self.node,
            radius: &self.radius,
            mass: &self.mass,
            position: &motion.position,
            velocity: &motion.velocity,
            angular_velocity: &motion.angular_velocity,
        }
    }
}

impl Touching {
    pub fn new(settings: ContactSettings, communicator: &Communicator) -> Result<Self, FibreError> {
        Ok(Self {
            contacts: ContactSystem::new(settings, communicator)?,
            critical_step: None,
            last_step: None,
            joint: Joint::default(),
            axes: Axes::default(),
        })
    }

    /// Takes over the segments of the model.
    pub fn rebuild(&mut self, model: &Model) {
        self.axes = Axes::new(model);
        self.forget();
    }

    /// Starts the next joint step without what the last one has left.
    pub fn forget(&mut self) {
        self.joint = Joint::default();
    }

    /// Contact loads at the given motion, in the middle of a sub-step; friction moves on by `step`.
    fn press(&mut self, motion: &Motion, step: f64) -> Result<(), FibreError> {
        let segments = self.axes.moving(motion);
        let start = self.contacts.time();
        self.contacts.set_time(start + 0.5 * step);
        self.contacts.update(&segments)?;
        self.contacts.forces(&segments, step);
        if self.contacts.counts_crossings() {
            // Since the middle of the last sub-step, ends have drifted with the velocities they have now.
            let last = self.last_step.unwrap_or(step);
            self.contacts
                .count_crossings(&segments, 0.5 * (last + step));
        }
        self.last_step = Some(step);
        self.contacts.set_time(start + step);
        Ok(())
    }
}

impl Batch<'_> {
    /// Adds the contact loads of one fibre's segments; the torque goes to both ends alike, as the spin of a segment is
    /// the mean of theirs.
    pub(crate) fn add_contacts(&mut self, model: &Model, contacts: &ContactSystem) {
        for (i, segment) in model.segment_range(self.fibres.start).enumerate() {
            if let Some(load) = contacts.load(segment) {
                self.load[i].force += load.start_force;
                self.load[i + 1].force += load.end_force;
                self.load[i].torque += load.torque * 0.5;
                self.load[i + 1].torque += load.torque * 0.5;
            }
        }
    }
}

impl Batch<'_> {
    /// Changes the velocities of one fibre by the contact loads of its segments over `step`.
    fn kick_by_contacts(&mut self, model: &Model, contacts: &ContactSystem, step: f64) {
        let nodes = &model.nodes[model.node_range(self.fibres.start)];
        for (i, segment) in model.segment_range(self.fibres.start).enumerate() {
            if let Some(load) = contacts.load(segment) {
                for (end, force) in [(i, &load.start_force), (i + 1, &load.end_force)] {
                    self.kick_node(end, &nodes[end], force, &(load.torque * 0.5), step);
                }
            }
        }
    }
}

impl FibreSystem {
    /// Contacts of a fibre with others at the end of the last step.
    pub fn contacts_of(&self, fibre: usize) -> f64 {
        self.accounts.fibres[fibre].contacts
    }

    /// Notes the contacts of every fibre.
    fn count_contacts(&mut self, contacts: &ContactSystem) {
        for (f, account) in self.accounts.fibres.iter_mut().enumerate() {
            let segments = self.model.segment_range(f);
            account.contacts = segments.map(|s| contacts.contacts_of(s) as f64).sum();
        }
    }

    /// One implicit step of all fibres together. Collective.
    fn run_jointly(
        &mut self,
        touching: &mut Touching,
        given: Option<Given>,
        dt: f64,
        settings: &ImplicitSettings,
    ) -> Result<(), FibreError> {
        let only = self.model.fibres.iter().any(|f| f.only_implicit());
        if self.communicator.any(only) {
            return Err(FibreError::RigidContact);
        }
        if touching.joint.is_empty() {
            touching.joint.resize(&self.model);
        }
        let flow = Flow::new(given, &self.settings, dt)?;
        let mut parties = Parties {
            model: &self.model,
            motion: &mut self.motion,
            scratch: &mut self.scratch,
            reaction: &mut self.reaction,
            contacts: &mut touching.contacts,
            communicator: &self.communicator,
            flow,
        };
        let joint = &mut touching.joint;
        let done = joint.advance(&mut parties, &touching.axes, dt, settings)?;
        let segments = touching.axes.moving(&self.motion);
        touching.contacts.finish(&segments);
        self.count_contacts(&touching.contacts);
        self.work = (done.sub_steps, done.sub_steps * self.segments());
        if done.converged {
            Ok(())
        } else {
            Err(FibreError::NoJointConvergence)
        }
    }

    /// One step of all fibres together. Collective.
    pub(crate) fn run_together(
        &mut self,
        touching: &mut Touching,
        given: Option<Given>,
        dt: f64,
    ) -> Result<(), FibreError> {
        if let Integrator::Implicit(settings) = self.settings.integrator {
            return self.run_jointly(touching, given, dt, &settings);
        }
        let contact_step = touching.critical_step.unwrap_or_else(|| {
            let segments = touching.axes.moving(&self.motion);
            touching.contacts.critical_step(&segments)
        });
        let beam_step = self.communicator.min(self.critical_step());
        // Frequencies of beams and contacts add in squares.
        let critical = (beam_step.powi(-2) + contact_step.powi(-2)).powf(-0.5);
        let (n, step) = sub_steps(dt, self.settings.step_safety * critical);
        self.work = (n, n * self.segments());
        let flow = Flow::new(given, &self.settings, dt)?;
        let model = &self.model;
        let (motion, scratch, reaction) = (&mut self.motion, &mut self.scratch, &mut self.reaction);
        let given_up = AtomicUsize::new(usize::MAX);
        let only = |fibre: &Batch| model.fibres[fibre.fibres.start].only_implicit();
        Batch::all(model, motion, scratch, reaction).for_each(model, &|fibre| {
            if !only(fibre) {
                fibre.begin(model, flow, step);
            }
        });
        for k in 0..n {
            touching.press(motion, step)?;
            let contacts = &touching.contacts;
            Batch::all(model, motion, scratch, reaction).for_each(model, &|fibre| {
                if fibre.leaps(model, flow.is_some()) {
                    fibre.kick_by_contacts(model, contacts, step);
                    fibre.leap(model, k..k + 1, n, step);
                    return;
                }
                fibre.add_contacts(model, contacts);
                if !only(fibre) {
                    fibre.sub_step(model, flow.is_some(), k, n, step);
                } else if !fibre.sub_step_implicit(model, flow, step, (k, n)) {
                    given_up.fetch_min(fibre.fibres.start, Ordering::Relaxed);
                }
            });
        }
        Batch::all(model, motion, scratch, reaction).for_each(model, &|fibre| {
            if !only(fibre) {
                fibre.end(model, flow);
            }
        });
        let segments = touching.axes.moving(motion);
        touching.contacts.finish(&segments);
        touching.critical_step = Some(touching.contacts.critical_step(&segments));
        self.count_contacts(&touching.contacts);
        self.given_up(given_up.into_inner())
    }
}
