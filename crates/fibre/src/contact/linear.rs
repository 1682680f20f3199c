//! Contacts for the implicit integrator: force at the end of a step and its derivative by displacements.

use crate::contact::SegmentLoad;
use crate::contact::far::{Facing, Push};
use crate::contact::law::{Law, Touch, turned};
use crate::{Matrix3, Vector3};
use bytemuck::{Pod, Zeroable};

/// Displacements of the two ends of a segment and its rotation, as they travel between ranks.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Sway {
    /// \[m\]
    pub ends: [[f64; 3]; 2],
    /// \[rad\]
    pub turn: [f64; 3],
}

impl Sway {
    /// Displacement at the lever `arm` from the axis point `s` \[m\].
    pub fn at(&self, s: f64, arm: &Vector3) -> Vector3 {
        let [first, second] = self.ends.map(Vector3::from);
        first + (second - first) * s + Vector3::from(self.turn).cross(arm)
    }
}

/// One contact in one iteration.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Linear {
    /// Places on the two axes.
    pub at: [f64; 2],
    /// Levers from the axes to the contact point \[m\].
    pub arms: [Vector3; 2],
    /// Force on a \[N\]; b feels the opposite.
    pub force: Vector3,
    /// Torque on a besides \[N·m\].
    pub couple: Vector3,
    /// Minus the derivative of the force by the displacement of a against b \[N/m\], symmetric and not negative.
    pub stiffness: Matrix3,
    /// Friction spring after the step \[m\].
    pub spring: Vector3,
    /// Energy in springs and of forces at a distance \[J\].
    pub stored: f64,
    /// Energy lost in the step \[J\].
    pub dissipated: f64,
    pub overlap: f64,
}

impl Linear {
    /// Adds the load on side 0 or 1 of a force that acts on a.
    pub fn load(&self, side: usize, force: &Vector3, load: &mut SegmentLoad) {
        let sign = if side == 0 { 1.0 } else { -1.0 };
        load.add(&(force * sign), self.at[side], &self.arms[side]);
    }
}

/// A step that ends now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passed {
    /// Displacement of a against b at the contact point since its start \[m\].
    pub slip: Vector3,
    /// Its length \[s\].
    pub time: f64,
}

impl Law {
    /// The contact at the end of a step, with the friction `spring` of its start.
    ///
    /// The laws are those of [`Law::respond`], with all velocities and displacements those of the end of the step. The
    /// derivative leaves out how the normal turns and how the Coulomb limit follows the normal force.
    pub fn linearise(&self, touch: &Touch, passed: &Passed, spring: &Vector3) -> Linear {
        let normal = &touch.normal;
        let along = normal * normal.transpose();
        let across = Matrix3::identity() - along;
        let approach = touch.velocity.dot(normal);
        let slip = touch.velocity - normal * approach;
        let mut linear = Linear {
            overlap: touch.overlap,
            ..Linear::default()
        };
        let mut pressed = 0.0;
        if touch.overlap > 0.0 {
            let stiffness = touch.share * self.stiffness;
            let damping = 2.0 * self.damping_ratio * (stiffness * touch.mass).sqrt();
            let elastic = stiffness * touch.overlap;
            // Of a pair that was apart at the start only the way since the touch counts: no jump of the force at it.
            let approach = approach.min(touch.overlap / passed.time);
            let total = elastic + damping * approach;
            if total > 0.0 {
                pressed = total;
                linear.stiffness += along * (stiffness + damping / passed.time);
            }
            linear.force -= normal * pressed;
            linear.stored += 0.5 * elastic * touch.overlap;
            linear.dissipated += (pressed - elastic) * approach * passed.time;
        }
        if let Some(facing) = &touch.facing {
            pressed += self.push(touch, facing, &mut linear);
            if let Some(film) = &self.far.lubrication {
                let resistance = film.resistance(-touch.overlap, facing);
                let (n, t) = (
                    touch.share * resistance.normal,
                    touch.share * resistance.tangential,
                );
                linear.force -= normal * (n * approach) + slip * t;
                linear.stiffness += (along * n + across * t) / passed.time;
                let power = n * approach * approach + t * slip.norm_squared();
                linear.dissipated += power * passed.time;
            }
        }
        if -touch.overlap <= self.far.contact_gap() && self.friction > 0.0 {
            let stiffness = touch.rub_share * self.tangential_stiffness;
            let before = 0.5 * stiffness * spring.norm_squared();
            let moved = across * passed.slip;
            let trial = turned(spring, normal, 0.0) + moved;
            let (size, limit) = (stiffness * trial.norm(), self.friction * pressed);
            let force = if size > limit {
                // The secant, not the derivative: along the slip that is zero, and the iteration would overshoot.
                linear.stiffness += across * (limit * stiffness / size);
                trial * (-limit / trial.norm())
            } else {
                linear.stiffness += across * stiffness;
                trial * -stiffness
            };
            linear.spring = force / -stiffness;
            let after = 0.5 * stiffness * linear.spring.norm_squared();
            linear.force += force;
            linear.stored += after;
            linear.dissipated += before - after - force.dot(&moved);
        }
        linear
    }

    /// Adds repulsion and attraction; answers with the repulsion.
    fn push(&self, touch: &Touch, facing: &Facing, linear: &mut Linear) -> f64 {
        let (normal, gap) = (&touch.normal, -touch.overlap);
        let along = normal * normal.transpose();
        let mut repelled = 0.0;
        let mut add = |push: Push| {
            linear.force -= normal * (touch.share * push.force);
            linear.stored += touch.share * push.energy;
            // Attraction softens: its derivative is left out where it would make the matrix negative.
            if push.force > 0.0 {
                linear.stiffness += along * (touch.share * push.stiffness);
            }
        };
        if let Some(repulsion) = &self.far.repulsion {
            let push = repulsion.push(gap);
            repelled = touch.share * push.force.max(0.0);
            add(push);
        }
        if let Some(adhesion) = &self.far.adhesion {
            let (push, couple) = adhesion.push(gap, facing);
            add(push);
            linear.couple += couple * touch.share;
        }
        repelled
    }
}
