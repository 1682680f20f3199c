//! Steps that are taken again from the same state, for fibres that are solved together with the flow.

use crate::contact::FrictionRecord;
use crate::hydrodynamics::Section;
use crate::observe::Account;
use crate::system::Motion;
use crate::{Ambient, FibreSystem, Points};

/// All that a step changes.
#[derive(Clone, Debug, Default)]
pub struct Saved {
    motion: Motion,
    accounts: Vec<Account>,
    contacts: Option<SavedContacts>,
}

#[derive(Clone, Debug)]
struct SavedContacts {
    springs: Vec<FrictionRecord>,
    critical_step: Option<f64>,
    last_step: Option<f64>,
    time: f64,
    settled: [f64; 3],
}

impl FibreSystem {
    /// Remembers the state at the start of a step.
    pub fn save(&self, saved: &mut Saved) {
        saved.motion.clone_from(&self.motion);
        saved.accounts.clone_from(&self.accounts.fibres);
        saved.contacts = self.touching.as_ref().map(|touching| SavedContacts {
            springs: touching.contacts.records(),
            critical_step: touching.critical_step,
            last_step: touching.last_step,
            time: touching.contacts.time(),
            settled: touching.contacts.settled(),
        });
    }

    /// Goes back to a state of these same fibres. Pairs stay listed; they are searched for anew where there are friction springs.
    pub fn go_back(&mut self, saved: &Saved) {
        self.motion.clone_from(&saved.motion);
        self.accounts.fibres.clone_from(&saved.accounts);
        if let (Some(touching), Some(state)) = (&mut self.touching, &saved.contacts) {
            touching.forget();
            touching.critical_step = state.critical_step;
            touching.last_step = state.last_step;
            touching.contacts.set_time(state.time);
            touching.contacts.set_settled(state.settled);
            touching.contacts.replace_springs(&state.springs);
        }
    }

    /// Of the points of this rank in a flow: the longest step that explicit drag would bear \[s\], K 3.72, twice mass by
    /// resistance, infinite without points (drag is implicit here, and not bound by it); and the largest product of
    /// resistance and what the flow gives way, Δt β Σ w²/(ρV).
    pub fn coupling_numbers(&self, ambient: &Ambient) -> [f64; 2] {
        let (mut least, mut largest) = (f64::INFINITY, 0.0_f64);
        let Some(law) = &self.settings.hydrodynamics else {
            return [least, largest];
        };
        let mut points = Points::default();
        self.points(&mut points);
        if ambient.velocity.len() != points.position.len() {
            return [least, largest];
        }
        let mut lengths = self.point_lengths();
        for (f, fibre) in self.model.fibres.iter().enumerate() {
            let section = Section::middle(2.0 * fibre.material.radius, fibre.length);
            let line_density = fibre.material.density * fibre.material.area();
            for (i, s) in self.model.segment_range(f).enumerate() {
                let node = self.model.offsets[f] + i;
                let span = self.motion.position[node + 1] - self.motion.position[node];
                let tangent = span.normalize();
                let own = self.model.points[s]..self.model.points[s + 1];
                for (p, length) in own.zip(&mut lengths) {
                    let slip = ambient.velocity[p] - points.velocity[p];
                    let drag = law.drag.resistance(&tangent, &slip, &section, &law.fluid);
                    least = least.min(2.0 * line_density / drag.normal);
                    let yielding = ambient.yielding.get(p).copied().unwrap_or(0.0);
                    largest = largest.max(drag.normal * length * yielding);
                }
            }
        }
        [least, largest]
    }
}
