//! All contacts of a step together: repulsion at the gap to come, and the exact cone of Coulomb, by Gauss and Seidel over
//! contacts (nonsmooth contact dynamics, Jean 1999; S 2.72 with inequalities).
//!
//! Locally a contact has the directions d₀ = −n, d₁, d₂; with the force Σ f_k d_k on a and its opposite on b, the conjugate
//! velocities w_k = d_k·Δu are G f + w_free, and w₀ is the rate at which the gap opens. G couples the contacts of a fibre.

use super::touch::across;
use super::{limits, newton};
use crate::{Matrix3, Vector3};
use nalgebra::{Matrix2, Vector2};

/// Relative change of the forces in a sweep at which they are found; the next step starts from them.
pub(super) const TOLERANCE: f64 = 1e-4;
/// The same in the turns within a contact.
const LOCAL: f64 = 1e-9;
/// Least answer of a contact to its own repulsion, by the sum of its answers.
pub(super) const LEAST: f64 = 1e-9;
/// Turns of repulsion and friction in a contact that slides.
const TURNS: usize = 20;
/// Sweeps with exact cones after which the forces are taken as they are.
const MOST: usize = 200;
/// Where they still change by this much, limits follow the repulsions instead.
const LOST: f64 = 1e-2;
/// By how much less than its limit friction counts as all of it.
const BESIDE: f64 = 1e-9;

/// What a contact is, by its index among those of its kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// Two segments.
    Touch(usize),
    /// A segment and a wall.
    Press(usize),
    /// A segment and a grip: along d₀ the velocity is zero whatever force that takes, across it nothing is held.
    Grip(usize),
}

/// One contact.
#[derive(Clone, Debug)]
pub(super) struct Contact {
    /// What it is.
    pub source: Source,
    /// Segments; the second one is that of a touch alone.
    pub segments: [u32; 2],
    /// From the segments' centres to the contact \[m\].
    pub arms: [Vector3; 2],
    /// d₀, d₁, d₂.
    pub directions: Matrix3,
    /// Gap at the start of the step \[m\].
    pub gap: f64,
    /// Velocities without forces \[m/s\].
    pub free: Vector3,
    /// Forces \[N\].
    pub force: Vector3,
    /// Whether it rubs.
    pub rubs: bool,
    /// Exceeded the static limit.
    pub slides: bool,
    /// Most that its friction can be \[N\]; infinite where it sticks in any case.
    pub limit: f64,
}

impl Contact {
    /// How many segments it has.
    pub fn sides(&self) -> usize {
        match self.source {
            Source::Touch(_) => 2,
            Source::Press(_) | Source::Grip(_) => 1,
        }
    }

    /// Whether a grip holds.
    pub fn grips(&self) -> bool {
        matches!(self.source, Source::Grip(_))
    }

    /// Size of the friction \[N\].
    pub fn tangential(&self) -> f64 {
        self.force.y.hypot(self.force.z)
    }

    /// Coefficient that it has now.
    pub fn friction(&self, law: &Law) -> f64 {
        law.friction[usize::from(self.slides)]
    }

    /// Whether its friction is all that it can be.
    pub fn at_limit(&self) -> bool {
        self.tangential() >= self.limit * (1.0 - BESIDE)
    }

    /// The plane of contact.
    pub fn directions(normal: &Vector3) -> Matrix3 {
        let first = across(normal);
        Matrix3::from_columns(&[-normal, first, normal.cross(&first)])
    }
}

/// Repulsion F exp(−h/λ) and friction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Law {
    pub strength: f64,
    pub decay: f64,
    /// Static and kinetic coefficient.
    pub friction: [f64; 2],
    /// \[s\]
    pub step: f64,
}

/// A row of G: where its parts are.
pub(super) struct Coupling {
    /// First side of each fibre and, last, their number.
    pub starts: Vec<usize>,
    /// Contact of each side.
    pub contact: Vec<u32>,
    /// By contact and side: fibre and place among its sides; the second one of a contact with one side is the first again.
    pub place: Vec<[(u32, u32); 2]>,
    /// First block of each fibre; block (i, j) of a fibre with m sides is at i m + j.
    pub block_starts: Vec<usize>,
    pub blocks: Vec<Matrix3>,
}

impl Coupling {
    /// Sum over other contacts, and the contact's own block.
    pub fn row(&self, c: usize, force: impl Fn(usize) -> Vector3) -> (Vector3, Matrix3) {
        let (mut moved, mut own) = (Vector3::zeros(), Matrix3::zeros());
        let [first, second] = self.place[c];
        let sides = if first == second { 1 } else { 2 };
        for (fibre, place) in [first, second].into_iter().take(sides) {
            let sides = self.starts[fibre as usize]..self.starts[fibre as usize + 1];
            let first = self.block_starts[fibre as usize] + place as usize * sides.len();
            for (block, &other) in self.blocks[first..].iter().zip(&self.contact[sides]) {
                if other as usize == c {
                    own += block;
                } else {
                    moved += block * force(other as usize);
                }
            }
        }
        (moved, own)
    }

    /// Sum over all contacts.
    #[inline(always)]
    pub fn product(&self, c: usize, force: impl Fn(usize) -> Vector3) -> Vector3 {
        let [first, second] = self.place[c];
        let sides = if first == second { 1 } else { 2 };
        let mut moved = Vector3::zeros();
        for (fibre, place) in [first, second].into_iter().take(sides) {
            let sides = self.starts[fibre as usize]..self.starts[fibre as usize + 1];
            let first = self.block_starts[fibre as usize] + place as usize * sides.len();
            for (block, &other) in self.blocks[first..].iter().zip(&self.contact[sides]) {
                moved += block * force(other as usize);
            }
        }
        moved
    }
}

/// What finding the forces took: sweeps over the contacts, whether limits had to follow the repulsions, and whether they were taken as they were
/// before they agreed with them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Found {
    pub sweeps: usize,
    pub followed: bool,
    pub unsettled: bool,
}

/// Finds the forces. None if sweeps with exact cones do not find them and a shorter step may help (`shorter`).
///
/// First as if whatever rubs sticks: that is a smooth convex problem. What then exceeds the static limit slides; without kinetic
/// friction the rest is solved for again until nothing more exceeds it, as in scheme A. With it, limits that follow the repulsions go on from
/// there.
pub(super) fn solve(
    contacts: &mut [Contact],
    coupling: &Coupling,
    law: &Law,
    shorter: bool,
) -> Option<Found> {
    let [at_rest, sliding] = law.friction;
    for c in contacts.iter_mut() {
        c.limit = match c.rubs && at_rest > 0.0 {
            true => f64::INFINITY,
            false => 0.0,
        };
    }
    let mut found = Found::default();
    loop {
        found.sweeps += newton::minimise(contacts, coupling, law);
        let mut more = false;
        for c in contacts.iter_mut().filter(|c| c.rubs && !c.slides) {
            c.slides = c.tangential() > at_rest * c.force.x;
            more |= c.slides;
            if c.slides {
                c.limit = 0.0;
            }
        }
        if !more {
            return Some(found);
        }
        if sliding > 0.0 {
            let more = in_cones(contacts, coupling, law, shorter)?;
            found.sweeps += more.sweeps;
            found.followed = more.followed;
            found.unsettled = more.unsettled;
            return Some(found);
        }
    }
}

/// Coulomb's cones: first the static one for all; then what has reached its limit slides with the kinetic coefficient, until no more
/// does.
fn in_cones(
    contacts: &mut [Contact],
    coupling: &Coupling,
    law: &Law,
    shorter: bool,
) -> Option<Found> {
    let [at_rest, sliding] = law.friction;
    contacts.iter_mut().for_each(|c| c.slides = false);
    let mut found = Found::default();
    loop {
        let before: Vec<Vector3> = contacts.iter().map(|c| c.force).collect();
        let (sweeps, converged) = sweep_cones(contacts, coupling, law);
        found.sweeps += sweeps;
        if !converged && shorter {
            return None;
        }
        found.unsettled = false;
        if !converged {
            found.followed = true;
            for (c, force) in contacts.iter_mut().zip(before) {
                c.force = force;
            }
            let (sweeps, settled) = limits::follow(contacts, coupling, law);
            found.sweeps += sweeps;
            found.unsettled = !settled;
        }
        let mut more = false;
        for c in contacts.iter_mut().filter(|c| c.rubs && !c.slides) {
            c.slides = c.tangential() >= at_rest * c.force.x * (1.0 - BESIDE);
            more |= c.slides;
        }
        if !more || at_rest == sliding {
            return Some(found);
        }
    }
}

/// Sweeps with the exact cones until the forces no longer change; how many, and whether they came near that. Wide cones of contacts that
/// depend on each other can drive each other without end.
fn sweep_cones(contacts: &mut [Contact], coupling: &Coupling, law: &Law) -> (usize, bool) {
    let mut change = f64::INFINITY;
    for sweeps in 1..=MOST {
        change = sweep(contacts, coupling, law, true);
        if change <= TOLERANCE || !change.is_finite() {
            return (sweeps, change.is_finite());
        }
    }
    (MOST, change <= LOST)
}

/// One sweep over the contacts, in their cones or with the limits that they have; the relative change of the forces.
pub(super) fn sweep(
    contacts: &mut [Contact],
    coupling: &Coupling,
    law: &Law,
    in_cone: bool,
) -> f64 {
    let (mut change, mut size) = (0.0, 0.0);
    for c in 0..contacts.len() {
        let (moved, own) = coupling.row(c, |other| contacts[other].force);
        let contact = &contacts[c];
        let free = contact.free + moved;
        let force = if contact.grips() {
            Vector3::new(-free.x / (own[(0, 0)] + LEAST * own.trace()), 0.0, 0.0)
        } else {
            local(contact, &free, &own, law, in_cone)
        };
        change += (force - contact.force).norm_squared();
        size += force.norm_squared();
        contacts[c].force = force;
    }
    (change / size.max(f64::MIN_POSITIVE)).sqrt()
}

/// Force of one contact whose velocities are `others` + `own` f. Where it sticks, repulsion and friction are found together;
/// where it slides, in turns. Friction is limited by the cone or by the contact's own limit.
fn local(contact: &Contact, others: &Vector3, own: &Matrix3, law: &Law, in_cone: bool) -> Vector3 {
    // Two places of one fibre can be all but rigid to each other.
    let least = LEAST * own.trace();
    let at_rest = |open: f64, own: f64| {
        repulsion(
            contact.gap + law.step * open,
            law.step * own.max(least),
            law,
        )
    };
    let friction = if contact.rubs {
        contact.friction(law)
    } else {
        0.0
    };
    let limit = |normal: f64| match in_cone {
        true => friction * normal,
        false => contact.limit,
    };
    if limit(1.0) == 0.0 {
        return Vector3::new(at_rest(others.x, own[(0, 0)]), 0.0, 0.0);
    }
    let plane = own.fixed_view::<2, 2>(1, 1).into_owned();
    let mixed = Vector2::new(own[(0, 1)], own[(0, 2)]);
    let slip = Vector2::new(others.y, others.z);
    if let Some(inverse) = plane.try_inverse() {
        // Friction that holds: f_t = −G_tt⁻¹(w_t + G_t0 f_0).
        let (free, answer) = (inverse * slip, inverse * mixed);
        let open = others.x - mixed.dot(&free);
        let normal = at_rest(open, own[(0, 0)] - mixed.dot(&answer));
        let held = -free - answer * normal;
        if held.norm() <= limit(normal) {
            return Vector3::new(normal, held.x, held.y);
        }
    }
    let mut force = contact.force;
    for _ in 0..TURNS {
        let open = others.x + mixed.x * force.y + mixed.y * force.z;
        let normal = at_rest(open, own[(0, 0)]);
        let slip = slip + mixed * normal;
        let held = sliding(&slip, &plane, limit(normal), least);
        let next = Vector3::new(normal, held.x, held.y);
        let change = (next - force).norm_squared();
        force = next;
        if change <= LOCAL * LOCAL * force.norm_squared() {
            break;
        }
    }
    force
}

/// The force of at most `limit` against a velocity `slip` + G f: the point of the disc that the velocity is opposed to.
fn sliding(slip: &Vector2<f64>, plane: &Matrix2<f64>, limit: f64, least: f64) -> Vector2<f64> {
    // What opens widely has no repulsion left.
    if limit.partial_cmp(&f64::MIN_POSITIVE) != Some(std::cmp::Ordering::Greater) {
        return Vector2::zeros();
    }
    let eigen = plane.symmetric_eigen();
    let slip = eigen.eigenvectors.tr_mul(slip);
    // Σ (slip_k/(g_k + s))² = limit² has one root s ≥ 0 where sticking takes more; |velocity| = s · limit.
    let answers = eigen.eigenvalues.map(|g| g.max(least));
    let at = |s: f64| Vector2::from_fn(|k, _| -slip[k] / (answers[k] + s));
    let mut held = at(0.0);
    let sticks = held.norm() <= limit;
    if !sticks {
        let largest = answers.amax();
        // From the left of the root, where 1/|f| is concave: Newton rises towards it without passing.
        let mut s = (slip.norm() / limit - largest).max(0.0);
        for _ in 0..30 {
            held = at(s);
            let size = held.norm();
            let slope: f64 = (0..2).map(|k| held[k] * held[k] / (answers[k] + s)).sum();
            let more = (size / limit - 1.0) * size * size / slope;
            s += more;
            if more.abs() <= 1e-13 * (s + largest) {
                break;
            }
        }
        held = at(s);
        held *= limit / held.norm();
    }
    eigen.eigenvectors * held
}

/// y = F exp(−(h + c y)/λ): with z = c y/λ, z + ln z = ln(cF/λ) − h/λ.
fn repulsion(gap: f64, opening: f64, law: &Law) -> f64 {
    let a = (opening * law.strength / law.decay).ln() - gap / law.decay;
    // Above and below one of the two terms leads; Newton on ln z, whose derivative is 1 + z.
    let mut log = if a < 1.0 { a } else { a.ln() };
    for _ in 0..20 {
        let z = log.exp();
        let more = (a - log - z) / (1.0 + z);
        log += more;
        if more.abs() < 1e-14 * (1.0 + log.abs()) {
            break;
        }
    }
    log.exp() * law.decay / opening
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law() -> Law {
        Law {
            strength: 150.0,
            decay: 0.05,
            friction: [0.7; 2],
            step: 1e-2,
        }
    }

    fn contact(gap: f64) -> Contact {
        Contact {
            source: Source::Touch(0),
            segments: [0, 1],
            arms: [Vector3::zeros(); 2],
            directions: Matrix3::identity(),
            gap,
            free: Vector3::zeros(),
            force: Vector3::zeros(),
            rubs: true,
            slides: false,
            limit: 0.0,
        }
    }

    #[test]
    fn repulsion_is_that_of_the_gap_to_come() {
        for gap in [-1.0, -0.1, 0.0, 0.3, 0.6_f64] {
            for opening in [1e-8, 1e-3, 1.0] {
                let y = repulsion(gap, opening, &law());
                let expected = 150.0 * (-(gap + opening * y) / 0.05).exp();
                assert!(
                    (y / expected - 1.0).abs() < 1e-11,
                    "{gap} {opening}: {y} {expected}"
                );
            }
        }
    }

    /// Slides against the velocity that is left, at the limit; or sticks below it.
    #[test]
    fn friction_lies_in_the_cone() {
        let own = Matrix3::new(2.0, 0.3, -0.2, 0.3, 1.5, 0.4, -0.2, 0.4, 0.6);
        for (speed, friction, sticks) in [(0.2, 2.0, true), (8.0, 0.7, false), (300.0, 0.7, false)]
        {
            let others = Vector3::new(-6.0, 0.6 * speed, -0.8 * speed);
            let mut c = contact(0.05);
            let law = Law {
                friction: [friction; 2],
                ..law()
            };
            for _ in 0..300 {
                c.force = local(&c, &others, &own, &law, true);
            }
            let w = others + own * c.force;
            let normal = 150.0 * (-(0.05 + 1e-2 * w.x) / 0.05).exp();
            assert!((c.force.x / normal - 1.0).abs() < 1e-9);
            let (slip, held) = (Vector2::new(w.y, w.z), Vector2::new(c.force.y, c.force.z));
            let limit = friction * c.force.x;
            if sticks {
                assert!(slip.norm() < 1e-9 && held.norm() < limit);
            } else {
                assert!((held.norm() / limit - 1.0).abs() < 1e-12);
                assert!(
                    (held / limit + slip / slip.norm()).norm() < 1e-7,
                    "{slip} {held}"
                );
            }
        }
    }

    /// Two contacts that slide, each pressed by the other's friction: repulsions 1/(1 − g) with g = μ × the coupling. Where g is near one, sweeps
    /// and limits come down from the forces that stick too slowly, and it says so.
    #[test]
    fn limits_that_are_taken_as_they_are_count() {
        let across = 0.9;
        let other = Matrix3::new(0.0, across, 0.0, across, 0.0, 0.0, 0.0, 0.0, 0.0);
        let one = Matrix3::identity();
        let coupling = Coupling {
            starts: vec![0, 2],
            contact: vec![0, 1],
            place: vec![[(0, 0); 2], [(0, 1); 2]],
            block_starts: vec![0],
            blocks: vec![one, other, other, one],
        };
        let found = |gain: f64, shorter: bool| {
            let law = Law {
                strength: 1.0,
                decay: 1e-6,
                friction: [gain / across; 2],
                step: 1.0,
            };
            let mut contacts = vec![contact(0.0); 2];
            for c in &mut contacts {
                c.free = Vector3::new(-1.0, 1e6, 0.0);
            }
            let found = solve(&mut contacts, &coupling, &law, shorter);
            for c in &contacts {
                assert!(c.tangential() <= c.friction(&law) * c.force.x * (1.0 + 1e-9));
            }
            (found, contacts[0].force.x * (1.0 - gain))
        };
        let (settled, force) = found(0.5, false);
        assert!(!settled.expect("forces").unsettled && (force - 1.0).abs() < 1e-2);
        let (unsettled, force) = found(0.99, false);
        println!("{unsettled:?}, {force:.1} times the force");
        let unsettled = unsettled.expect("forces");
        assert!(unsettled.followed && unsettled.unsettled && force > 2.0);
        assert!(found(0.99, true).0.is_none());
    }
}
