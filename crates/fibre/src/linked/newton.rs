//! Forces of contacts with given limits of friction, by Newton's method.
//!
//! They are the minimum of ½ f·Gf + w·f + Σ (h f₀ + λ f₀ (ln(f₀/F) − 1))/Δt over |f_t| ≤ limit: smooth and strictly convex, on a convex
//! set. Its matrix is G + diag(λ/Δt f₀), and along a limit the slip by that; corrections are found by conjugate gradients, preconditioned by each contact's
//! own block, and taken as far as the function falls. A sweep over the contacts, in which it always falls, brings small forces to size
//! that a linear step would make negative, and finds what is at its limit.

use super::cone::{Contact, Coupling, LEAST, Law, TOLERANCE, sweep};
use crate::{Matrix3, Vector3};
use nalgebra::Vector2;

/// Gain of a correction, relative, from which nothing moves otherwise.
const STILL: f64 = 1e-12;
/// Corrections before the forces are taken as they are.
const MOST: usize = 30;
/// Products with the matrix in a correction.
const LONGEST: usize = 500;
/// Corrections that are left out, after which there are no more.
const FAILED: usize = 8;
/// Residual of a correction, relative.
const INEXACT: f64 = 0.1;
/// Repulsions below this part of the strength count as this much: what opens widely has none.
const FAINT: f64 = 1e-12;
/// A correction leaves at least this part of a repulsion.
const KEPT: f64 = 0.1;
/// Repulsions below this part of all forces can be cut off in a correction.
const MATTERS: f64 = 1e-6;
/// Times that a correction is halved before it is left out.
const HALVED: i32 = 8;

/// Forces of the contacts; returns the number of sweeps, products with the matrix among them.
pub(super) fn minimise(contacts: &mut [Contact], coupling: &Coupling, law: &Law) -> usize {
    let (mut passes, mut failed) = (0, 0);
    for _ in 0..MOST {
        passes += 1;
        if sweep(contacts, coupling, law, false) <= TOLERANCE {
            break;
        }
        // Sweeps go on alone where corrections do not help.
        if failed < FAILED {
            let (more, gain) = correct(contacts, coupling, law);
            passes += more;
            failed += usize::from(gain.is_none());
            if gain.is_some_and(|gain| gain <= STILL) {
                break;
            }
        }
    }
    passes
}

/// What a contact adds to the matrix, which of its forces can change, and the inverse of its own block in these.
struct Block {
    /// Along d₀.
    normal: f64,
    /// Whether friction can change in any direction; else it can along its limit, the direction of `along`, if any.
    sticks: bool,
    along: Vector3,
    /// Along the limit, which bends away from it.
    bend: f64,
    inverse: Matrix3,
}

impl Block {
    /// Of a contact with the answer `own` to itself; across d₀ the gradient is its velocity.
    fn new(contact: &Contact, gradient: &Vector3, own: &Matrix3, law: &Law) -> Self {
        let normal = match contact.grips() {
            true => LEAST * own.trace(),
            false => law.decay / (law.step * faint(contact.force.x, law)),
        };
        let mut block = Self {
            normal,
            sticks: contact.limit > 0.0 && !contact.at_limit(),
            along: Vector3::zeros(),
            bend: 0.0,
            inverse: Matrix3::zeros(),
        };
        if contact.limit > 0.0 && !block.sticks {
            let friction = Vector3::new(0.0, contact.force.y, contact.force.z);
            block.along = Vector3::x().cross(&friction).normalize();
            block.bend = gradient.y.hypot(gradient.z) / contact.limit;
        }
        let free = Matrix3::from_columns(
            &[Vector3::x(), Vector3::y(), Vector3::z()].map(|e| block.free(e)),
        );
        let mut whole = free * own * free + Matrix3::identity() - free;
        whole[(0, 0)] += normal;
        whole += block.along * block.along.transpose() * block.bend;
        if let Some(inverse) = whole.try_inverse() {
            block.inverse = free * inverse * free;
        }
        block
    }

    /// What of a vector belongs to forces that can change.
    #[inline(always)]
    fn free(&self, v: Vector3) -> Vector3 {
        match self.sticks {
            true => v,
            false => Vector3::new(v.x, 0.0, 0.0) + self.along * self.along.dot(&v),
        }
    }

    /// The contact's own part of a product with the matrix.
    #[inline(always)]
    fn product(&self, v: &Vector3) -> Vector3 {
        Vector3::new(self.normal * v.x, 0.0, 0.0) + self.along * (self.bend * self.along.dot(v))
    }

    /// Whether friction moves along its limit.
    fn at_limit(&self) -> bool {
        self.along != Vector3::zeros()
    }
}

fn faint(normal: f64, law: &Law) -> f64 {
    normal.max(FAINT * law.strength)
}

/// The function, and f·(its matrix)·f; `each` receives its gradient by each contact, and the contact's own block.
fn function(
    contacts: &[Contact],
    coupling: &Coupling,
    law: &Law,
    mut each: impl FnMut(Vector3, Matrix3),
) -> [f64; 2] {
    let (mut sum, mut size) = (0.0, 0.0);
    for (c, contact) in contacts.iter().enumerate() {
        let (moved, own) = coupling.row(c, |other| contacts[other].force);
        let answer = moved + own * contact.force;
        let mut gradient = contact.free + answer;
        let own_work = contact.force.dot(&answer);
        sum += contact.force.dot(&contact.free) + 0.5 * own_work;
        size += own_work;
        // Grips are as soft as a sweep has them; their gap does not count.
        if contact.grips() {
            let strain = LEAST * own.trace() * contact.force.x;
            sum += 0.5 * strain * contact.force.x;
            gradient.x += strain;
        } else {
            let gap = contact.gap + law.decay * (faint(contact.force.x, law) / law.strength).ln();
            sum += contact.force.x * (gap - law.decay) / law.step;
            gradient.x += gap / law.step;
            size += contact.force.x * law.decay / law.step;
        }
        each(gradient, own);
    }
    [sum, size]
}

/// One correction; how many passes it took, and what it gains by the size of the function: the square of the error relative to the forces, each
/// seen by what it moves. Forces that move nothing, of contacts in one place, do not count. None if the forces are left as they are.
fn correct(contacts: &mut [Contact], coupling: &Coupling, law: &Law) -> (usize, Option<f64>) {
    let n = contacts.len();
    let (mut residual, mut blocks) = (Vec::with_capacity(n), Vec::with_capacity(n));
    let [start, size] = function(contacts, coupling, law, |gradient, own| {
        let block = Block::new(&contacts[blocks.len()], &gradient, &own, law);
        residual.push(-block.free(gradient));
        blocks.push(block);
    });
    let each = |f: &dyn Fn(usize) -> Vector3| -> Vec<Vector3> { (0..n).map(f).collect() };
    let dot =
        |a: &[Vector3], b: &[Vector3]| -> f64 { a.iter().zip(b).map(|(a, b)| a.dot(b)).sum() };
    let mut step = vec![Vector3::zeros(); n];
    let mut z = each(&|c| blocks[c].inverse * residual[c]);
    let mut direction = z.clone();
    let mut rho = dot(&residual, &z);
    let enough = INEXACT * INEXACT * rho;
    let (mut passes, mut gain) = (1, 0.0);
    while passes < (4 * n + 8).min(LONGEST) && rho > enough {
        passes += 1;
        let answer = each(&|c| {
            let moved = coupling.product(c, |other| direction[other]);
            blocks[c].free(moved + blocks[c].product(&direction[c]))
        });
        let curvature = dot(&direction, &answer);
        if curvature.is_nan() || curvature <= 0.0 {
            break;
        }
        let length = rho / curvature;
        gain += length * rho / size;
        for c in 0..n {
            step[c] += direction[c] * length;
            residual[c] -= answer[c] * length;
        }
        z = each(&|c| blocks[c].inverse * residual[c]);
        let next = dot(&residual, &z);
        for c in 0..n {
            direction[c] = z[c] + direction[c] * (next / rho);
        }
        rho = next;
    }
    let before: Vec<Vector3> = contacts.iter().map(|c| c.force).collect();
    // Farther than that a repulsion that matters would turn into a pull; those that do not are cut off.
    let matters = MATTERS * dot(&before, &before).sqrt();
    let falls = |c: usize| match !contacts[c].grips() && before[c].x > matters {
        true => (1.0 - KEPT) * before[c].x / (-step[c].x).max(f64::MIN_POSITIVE),
        false => f64::INFINITY,
    };
    // And farther than that friction that sticks would exceed its limit.
    let slips = |c: usize| {
        let limit = contacts[c].limit;
        if !blocks[c].sticks || limit == f64::INFINITY || limit < matters {
            return f64::INFINITY;
        }
        let [f, s] = [&before[c], &step[c]].map(|v| Vector2::new(v.y, v.z));
        let (a, b) = (s.norm_squared(), f.dot(&s));
        let c = limit * limit - f.norm_squared();
        c / (b + (b * b + a * c).sqrt()).max(f64::MIN_POSITIVE)
    };
    let within = (0..n).map(|c| falls(c).min(slips(c))).fold(1.0, f64::min);
    // First all of it, cut off; that is no way down in any case. Then straight ahead.
    let parts = std::iter::once(1.0).chain((0..HALVED).map(|k| within * 0.5_f64.powi(k)));
    for part in parts {
        for (c, contact) in contacts.iter_mut().enumerate() {
            contact.force = before[c] + step[c] * part;
            if !contact.grips() {
                contact.force.x = contact.force.x.max(KEPT * faint(before[c].x, law));
            }
            let tangential = contact.tangential();
            if tangential > contact.limit || blocks[c].at_limit() {
                let back = contact.limit / tangential;
                contact.force.y *= back;
                contact.force.z *= back;
            }
        }
        passes += 1;
        if function(contacts, coupling, law, |_, _| {})[0] < start {
            return (passes, Some(gain));
        }
    }
    for (contact, force) in contacts.iter_mut().zip(before) {
        contact.force = force;
    }
    (passes, None)
}
