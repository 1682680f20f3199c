//! Contacts that stick, by Newton's method.
//!
//! Where nothing slides the forces are the minimum of ½ f·Gf + w·f + Σ (h f₀ + λ f₀ (ln(f₀/F) − 1))/Δt: smooth and strictly convex.
//! Its matrix is G + diag(λ/Δt f₀); corrections are found by conjugate gradients, preconditioned by each contact's own block, and a
//! sweep over the contacts brings small forces to size that a linear step would make negative.

use super::cone::{Contact, Coupling, LEAST, Law, TOLERANCE, sweep};
use crate::{Matrix3, Vector3};

/// Corrections before the forces are taken as they are.
const MOST: usize = 30;
/// Residual of a correction, relative.
const INEXACT: f64 = 0.1;
/// Repulsions below this part of the strength count as this much: what opens widely has none.
const FAINT: f64 = 1e-12;
/// A correction leaves at least this part of a repulsion.
const KEPT: f64 = 0.1;

/// Forces as if all that rubs and does not slide sticks, and what slides has no friction; returns the number of sweeps, products
/// with the matrix among them.
pub(super) fn stick(contacts: &mut [Contact], coupling: &Coupling, law: &Law) -> usize {
    let sticks = |c: &Contact| c.rubs && !c.slides && law.friction[0] > 0.0;
    let friction = |c: &Contact| if sticks(c) { f64::MAX } else { 0.0 };
    let mut passes = 0;
    for _ in 0..MOST {
        passes += 1;
        if sweep(contacts, coupling, law, friction) <= TOLERANCE {
            break;
        }
        passes += correct(contacts, coupling, law, sticks);
    }
    passes
}

/// One correction.
fn correct(
    contacts: &mut [Contact],
    coupling: &Coupling,
    law: &Law,
    sticks: impl Fn(&Contact) -> bool,
) -> usize {
    let n = contacts.len();
    let held: Vec<bool> = contacts.iter().map(&sticks).collect();
    let kept = |c: usize, v: Vector3| {
        if held[c] {
            v
        } else {
            Vector3::new(v.x, 0.0, 0.0)
        }
    };
    let mut residual = Vec::with_capacity(n);
    let mut slope = Vec::with_capacity(n);
    let mut inverse = Vec::with_capacity(n);
    for (c, contact) in contacts.iter().enumerate() {
        let (moved, own) = coupling.row(c, |other| contacts[other].force);
        let velocity = contact.free + moved + own * contact.force;
        // Grips are as soft as a sweep has them; their gap does not count.
        let (gap, softness) = if contact.grips() {
            let softness = LEAST * own.trace();
            (softness * contact.force.x * law.step, softness)
        } else {
            let normal = contact.force.x.max(FAINT * law.strength);
            let gap = contact.gap + law.decay * (normal / law.strength).ln();
            (gap, law.decay / (law.step * normal))
        };
        residual.push(kept(c, -velocity - Vector3::x() * (gap / law.step)));
        slope.push(softness);
        let mut block = own;
        block[(0, 0)] += slope[c];
        let whole = if held[c] { block.try_inverse() } else { None };
        inverse.push(whole.unwrap_or_else(|| {
            Matrix3::from_diagonal(&Vector3::new(1.0 / block[(0, 0)], 0.0, 0.0))
        }));
    }
    let dot =
        |a: &[Vector3], b: &[Vector3]| -> f64 { a.iter().zip(b).map(|(a, b)| a.dot(b)).sum() };
    let precondition =
        |r: &[Vector3]| -> Vec<Vector3> { (0..n).map(|c| kept(c, inverse[c] * r[c])).collect() };
    let mut step = vec![Vector3::zeros(); n];
    let mut z = precondition(&residual);
    let mut direction = z.clone();
    let mut rho = dot(&residual, &z);
    let enough = INEXACT * INEXACT * rho;
    let mut passes = 1;
    while passes < 4 * n + 8 && rho > enough {
        passes += 1;
        let answer: Vec<Vector3> = (0..n)
            .map(|c| {
                let (moved, own) = coupling.row(c, |other| direction[other]);
                let mut y = moved + own * direction[c];
                y.x += slope[c] * direction[c].x;
                kept(c, y)
            })
            .collect();
        let curvature = dot(&direction, &answer);
        if curvature.is_nan() || curvature <= 0.0 {
            break;
        }
        let length = rho / curvature;
        for c in 0..n {
            step[c] += direction[c] * length;
            residual[c] -= answer[c] * length;
        }
        z = precondition(&residual);
        let next = dot(&residual, &z);
        for c in 0..n {
            direction[c] = z[c] + direction[c] * (next / rho);
        }
        rho = next;
    }
    for (contact, step) in contacts.iter_mut().zip(step) {
        let least = KEPT * contact.force.x.max(FAINT * law.strength);
        contact.force += step;
        if !contact.grips() {
            contact.force.x = contact.force.x.max(least);
        }
    }
    passes
}
