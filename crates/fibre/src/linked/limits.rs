//! Friction by limits that follow the repulsions, where sweeps with exact cones do not find it.

use super::cone::{Contact, Coupling, Law};
use super::newton;
use crate::Vector3;

/// Changes of the limits of friction after which they are taken as they are.
const ROUNDS: usize = 40;
/// Sweeps after which limits are taken as they are.
const MANY: usize = 20_000;
/// By how much of all forces friction that slides may miss its limit.
const NEAR: f64 = 2e-3;
/// Least part of a change of a limit that is followed.
const SLOWEST: f64 = 0.02;

/// Limits μ f₀ that follow the repulsions: with given limits the problem is convex (Tresca), and its forces are bounded whatever the limits
/// are, so that some limits agree with them. A limit is followed by as much as its own contact answers, and by less where it
/// goes to and fro. How many sweeps, and whether friction came to agree with its limits.
pub(super) fn follow(contacts: &mut [Contact], coupling: &Coupling, law: &Law) -> (usize, bool) {
    let mut pace = vec![1.0_f64; contacts.len()];
    let mut before = vec![0.0_f64; contacts.len()];
    for c in contacts.iter_mut().filter(|c| c.rubs) {
        c.limit = c.friction(law) * c.force.x;
    }
    let (mut sweeps, mut settled) = (0, false);
    for _ in 0..ROUNDS {
        sweeps += newton::minimise(contacts, coupling, law);
        let (mut missed, mut size) = (0.0, 0.0);
        for c in contacts.iter() {
            let (tangential, wanted) = (c.tangential(), c.friction(law) * c.force.x);
            size += c.force.norm_squared();
            if c.rubs && (c.at_limit() || tangential > wanted) {
                missed += (wanted - tangential).powi(2);
            }
        }
        settled = missed <= NEAR * NEAR * size;
        if settled || sweeps > MANY {
            break;
        }
        for k in 0..contacts.len() {
            let c = &contacts[k];
            if !c.rubs {
                continue;
            }
            let change = c.friction(law) * c.force.x - c.limit;
            pace[k] = match change * before[k] < 0.0 {
                true => (0.5 * pace[k]).max(SLOWEST),
                false => (1.1 * pace[k]).min(1.0),
            };
            before[k] = change;
            // Friction that presses the contact open answers against the change.
            let (_, own) = coupling.row(k, |_| Vector3::zeros());
            let tangential = c.tangential().max(f64::MIN_POSITIVE);
            let mixed = (own[(0, 1)] * c.force.y + own[(0, 2)] * c.force.z) / tangential;
            let softness = law.decay / (law.step * c.force.x.max(f64::MIN_POSITIVE));
            let answer = c.friction(law) * mixed / (own[(0, 0)] + softness);
            contacts[k].limit += pace[k] * change / (1.0 + answer.max(0.0));
        }
    }
    // What the limits still miss is slip, not friction.
    for c in contacts.iter_mut().filter(|c| c.rubs) {
        let (tangential, most) = (c.tangential(), c.friction(law) * c.force.x);
        if tangential > most || (tangential > 0.0 && c.at_limit()) {
            c.force.y *= most / tangential;
            c.force.z *= most / tangential;
        }
    }
    (sweeps, settled)
}
