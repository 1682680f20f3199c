//! Friction of a group of contacts: no sliding in the planes of contact, up to Coulomb's limit (S 2.82–2.88).

use super::groups::Groups;
use super::mobility::Mobility;
use super::system::{Chain, Segment};
use super::touch::{Touch, across};
use crate::Vector3;
use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

/// Residual of the sliding velocities by what they are without friction.
const TOLERANCE: f64 = 1e-13;

/// Static and kinetic coefficient.
pub(super) type Coefficients = [f64; 2];

/// Solves for the friction of all contacts that rub, given the velocities of the segments without it.
pub(super) fn solve(
    touches: &mut [Touch],
    groups: &Groups,
    chains: &[Chain],
    segments: &[Segment],
    coefficients: Coefficients,
) {
    let count = groups.count();
    let answers: Vec<Vec<(Vector3, bool)>> = (0..count)
        .into_par_iter()
        .with_min_len(16)
        .map(|g| Group::new(g, touches, groups, chains, segments).solve(coefficients))
        .collect();
    for (g, answer) in answers.into_iter().enumerate() {
        let contacts = groups.starts[g] as usize..groups.starts[g + 1] as usize;
        for (&k, (friction, slides)) in groups.contacts[contacts].iter().zip(answer) {
            let touch = &mut touches[k as usize];
            (touch.friction, touch.slides) = (friction, slides);
        }
    }
}

/// A contact within its group.
struct Contact {
    /// Places of the two bodies in the group.
    bodies: [usize; 2],
    arms: [Vector3; 2],
    /// The plane of contact.
    plane: [Vector3; 2],
    /// Velocity at which the surfaces slide without friction \[m/s\].
    sliding: Vector3,
    push: f64,
    /// Inverse of the contact's own block of the matrix.
    inverse: Matrix2<f64>,
}

/// A segment within its group.
struct Body {
    mobility: Mobility,
    axis: Vector3,
}

/// A group of contacts: R_F of S 2.83 as an operator on the components of friction in the planes of contact. In these it is
/// symmetric, and F·n = 0 needs no equation.
pub(super) struct Group {
    contacts: Vec<Contact>,
    bodies: Vec<Body>,
}

impl Group {
    pub fn new(
        g: usize,
        touches: &[Touch],
        groups: &Groups,
        chains: &[Chain],
        segments: &[Segment],
    ) -> Self {
        let members = groups.member_starts[g] as usize..groups.member_starts[g + 1] as usize;
        let body = |&s: &u32| {
            let segment = &segments[s as usize];
            Body {
                mobility: chains[segment.chain as usize].mobility,
                axis: segment.axis,
            }
        };
        let bodies: Vec<Body> = groups.members[members].iter().map(body).collect();
        let contacts = groups.starts[g] as usize..groups.starts[g + 1] as usize;
        let contact = |&k: &u32| {
            let t = &touches[k as usize];
            let velocity = |k: usize| {
                let s = &segments[t.segments[k] as usize];
                s.velocity + s.spin.cross(&t.arms[k])
            };
            let first = across(&t.normal);
            let mut contact = Contact {
                bodies: t.segments.map(|s| groups.place[s as usize] as usize),
                arms: t.arms,
                plane: [first, t.normal.cross(&first)],
                sliding: velocity(0) - velocity(1) + t.image_velocity,
                push: t.push,
                inverse: Matrix2::zeros(),
            };
            let own = Matrix2::from_columns(&[Vector2::x(), Vector2::y()].map(|unit| {
                let force = contact.force(&unit);
                let answer = |k: usize| bodies[contact.bodies[k]].answer(&contact.arms[k], &force);
                contact.components(&(answer(0) + answer(1)))
            }));
            contact.inverse = own.try_inverse().unwrap_or_else(Matrix2::zeros);
            contact
        };
        let contacts = groups.contacts[contacts].iter().map(contact).collect();
        Self { contacts, bodies }
    }

    /// Friction of each contact, and whether it slides. What exceeds the static limit slides with the kinetic force, against
    /// the direction in which it would have been held; the rest is solved for again, until no more is beyond the limit.
    fn solve(&self, [at_rest, sliding]: Coefficients) -> Vec<(Vector3, bool)> {
        let n = self.contacts.len();
        let mut slides = vec![false; n];
        let mut force = vec![Vector2::zeros(); n];
        if at_rest == 0.0 && sliding == 0.0 {
            return vec![(Vector3::zeros(), true); n];
        }
        loop {
            self.stick(&mut force, &slides);
            let mut more = false;
            for (k, contact) in self.contacts.iter().enumerate() {
                let (size, normal) = (force[k].norm(), contact.push.abs());
                if !slides[k] && size > at_rest * normal {
                    force[k] *= sliding * normal / size;
                    slides[k] = true;
                    more = true;
                }
            }
            if !more {
                break;
            }
        }
        let each = self.contacts.iter().zip(force).zip(slides);
        each.map(|((c, f), s)| (c.force(&f), s)).collect()
    }

    /// Friction of the contacts that do not slide so that their surfaces move together; the others keep theirs. Conjugate
    /// gradients, preconditioned by each contact's own block.
    fn stick(&self, force: &mut [Vector2<f64>], slides: &[bool]) {
        let n = force.len();
        let zero = Vector2::zeros();
        let mut answer = vec![zero; n];
        let free = |x: &mut [Vector2<f64>]| {
            x.iter_mut()
                .zip(slides)
                .filter(|(_, s)| **s)
                .for_each(|(x, _)| *x = zero);
        };
        self.apply(force, &mut answer);
        let mut residual: Vec<Vector2<f64>> = (self.contacts.iter().zip(&answer))
            .map(|(c, moved)| -c.components(&c.sliding) - moved)
            .collect();
        free(&mut residual);
        let scale: f64 = self.contacts.iter().map(|c| c.sliding.norm_squared()).sum();
        let precondition = |r: &[Vector2<f64>]| -> Vec<Vector2<f64>> {
            (self.contacts.iter().zip(r))
                .map(|(c, r)| c.inverse * r)
                .collect()
        };
        let dot = |a: &[Vector2<f64>], b: &[Vector2<f64>]| -> f64 {
            a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
        };
        let mut z = precondition(&residual);
        let mut direction = z.clone();
        let mut rho = dot(&residual, &z);
        // In exact arithmetic as many rounds as unknowns; as many again for round-off.
        for _ in 0..4 * n + 8 {
            if dot(&residual, &residual) <= TOLERANCE * TOLERANCE * scale || rho <= 0.0 {
                break;
            }
            self.apply(&direction, &mut answer);
            free(&mut answer);
            let curvature = dot(&direction, &answer);
            if curvature <= 0.0 {
                break;
            }
            let step = rho / curvature;
            for k in 0..n {
                force[k] += direction[k] * step;
                residual[k] -= answer[k] * step;
            }
            z = precondition(&residual);
            let next = dot(&residual, &z);
            let turn = next / rho;
            rho = next;
            for k in 0..n {
                direction[k] = z[k] + direction[k] * turn;
            }
        }
    }

    /// Sliding velocities that forces make, in the planes of contact.
    pub fn apply(&self, force: &[Vector2<f64>], answer: &mut [Vector2<f64>]) {
        let mut loads = vec![[Vector3::zeros(); 2]; self.bodies.len()];
        for (contact, f) in self.contacts.iter().zip(force) {
            let force = contact.force(f);
            for (k, sign) in [(0, 1.0), (1, -1.0)] {
                let [f, t] = &mut loads[contact.bodies[k]];
                *f += force * sign;
                *t += contact.arms[k].cross(&force) * sign;
            }
        }
        for (body, load) in self.bodies.iter().zip(&mut loads) {
            let [f, t] = *load;
            *load = [
                body.mobility.velocity(&body.axis, &f),
                body.mobility.spin(&body.axis, &t),
            ];
        }
        for (contact, answer) in self.contacts.iter().zip(answer) {
            let at = |k: usize| {
                let [v, w] = loads[contact.bodies[k]];
                v + w.cross(&contact.arms[k])
            };
            *answer = contact.components(&(at(0) - at(1)));
        }
    }
}

impl Contact {
    fn force(&self, f: &Vector2<f64>) -> Vector3 {
        self.plane[0] * f.x + self.plane[1] * f.y
    }

    fn components(&self, v: &Vector3) -> Vector2<f64> {
        Vector2::new(self.plane[0].dot(v), self.plane[1].dot(v))
    }
}

impl Body {
    /// Velocity at an arm by a force there.
    fn answer(&self, arm: &Vector3, force: &Vector3) -> Vector3 {
        let spin = self.mobility.spin(&self.axis, &arm.cross(force));
        self.mobility.velocity(&self.axis, force) + spin.cross(arm)
    }
}

#[cfg(test)]
mod tests;
