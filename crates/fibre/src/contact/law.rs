//! Force of one contact: linear spring, viscous damping, Coulomb friction, forces at a distance.

use crate::Vector3;
use crate::contact::far::{Facing, Far, Push};
use crate::contact::{ContactError, ContactSettings, NormalDamping};
use nalgebra::Rotation3;

/// The constants of the contact law.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Law {
    /// k_n \[N/m\].
    pub stiffness: f64,
    /// k_t \[N/m\].
    pub tangential_stiffness: f64,
    /// ζ of the normal oscillator.
    pub damping_ratio: f64,
    /// Coulomb coefficient μ.
    pub friction: f64,
    /// Forces at a distance.
    pub far: Far,
}

/// One contact, seen from a.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touch {
    /// Unit vector from a to b.
    pub normal: Vector3,
    /// δ \[m\]; −δ is the gap.
    pub overlap: f64,
    /// Velocity of a relative to b at the contact point \[m/s\].
    pub velocity: Vector3,
    /// Mean angular velocity of the two bodies \[rad/s\].
    pub spin: Vector3,
    /// Effective mass of the pair at the contact point \[kg\].
    pub mass: f64,
    /// Share of the normal stiffness and of the forces at a distance that this contact carries.
    pub share: f64,
    /// Share of the tangential stiffness.
    pub rub_share: f64,
    /// How the surfaces face each other, where there are forces at a distance.
    pub facing: Option<Facing>,
}

/// What a contact does in one step.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Response {
    /// Force on a \[N\]; b feels the opposite.
    pub force: Vector3,
    /// Torque on a besides that of the force \[N·m\]; b feels the opposite.
    pub couple: Vector3,
    /// Energy in the normal and the tangential spring and of the forces at a distance \[J\].
    pub stored: f64,
    /// Energy that the friction spring lost in this step \[J\].
    pub dissipated: f64,
    /// Part of the force whose work on the relative motion is lost \[N\].
    pub drag: Vector3,
    /// Bound of the stiffness of the forces at a distance \[N/m\].
    pub far_stiffness: f64,
}

/// Lubrication is implicit in the velocity of one pair; the factor leaves room for several on one segment.
const PAIRS_AT_ONCE: f64 = 4.0;

impl Law {
    /// Checks the settings and derives the constants.
    pub fn new(settings: &ContactSettings) -> Result<Self, ContactError> {
        let check = |good: bool, name: &'static str, value: f64, valid: &'static str| {
            let error = ContactError::Setting { name, value, valid };
            if good { Ok(()) } else { Err(error) }
        };
        let ContactSettings {
            normal_stiffness: stiffness,
            friction,
            tangential_ratio: ratio,
            skin,
            ..
        } = *settings;
        let finite = |x: f64| x.is_finite();
        check(
            finite(stiffness) && stiffness > 0.0,
            "normal_stiffness",
            stiffness,
            "a positive number of N/m",
        )?;
        check(
            finite(friction) && friction >= 0.0,
            "friction",
            friction,
            "zero or a positive number",
        )?;
        check(
            finite(ratio) && ratio > 0.0,
            "tangential_ratio",
            ratio,
            "a positive number, usually 2/7 to 1",
        )?;
        check(
            finite(skin) && skin > 0.0,
            "skin",
            skin,
            "a positive length in m",
        )?;
        let damping_ratio = match settings.damping {
            NormalDamping::Restitution(e) => {
                check(
                    (0.05..=1.0).contains(&e),
                    "restitution",
                    e,
                    "between 0.05 and 1",
                )?;
                ratio_for_restitution(e)
            }
            NormalDamping::Ratio(zeta) => {
                check(
                    (0.0..=5.0).contains(&zeta),
                    "damping ratio",
                    zeta,
                    "between 0 and 5",
                )?;
                zeta
            }
        };
        Ok(Self {
            stiffness,
            tangential_stiffness: ratio * stiffness,
            damping_ratio,
            friction,
            far: Far::new(
                settings.repulsion,
                settings.van_der_waals,
                settings.lubrication,
            )?,
        })
    }

    /// Force of a contact and the friction spring after a step `dt`.
    ///
    /// Normal: F_n = max(0, k_n δ + c v·n) (K 3.28 with c = 2ζ√(k_n m)) and the forces at a distance. Tangential (Cundall &
    /// Strack 1979): the spring turns with the contact, grows by v_t dt (K 3.31) and is cut to |F_t| ≤ μ F_n, where
    /// F_n holds the repulsion but no attraction.
    pub fn respond(&self, touch: &Touch, spring: &mut Vector3, dt: f64) -> Response {
        let normal = &touch.normal;
        let approach = touch.velocity.dot(normal);
        let mut response = Response::default();
        // What does work that is lost.
        let mut drag = Vector3::zeros();
        let mut pressed = 0.0;
        if touch.overlap > 0.0 {
            let stiffness = touch.share * self.stiffness;
            let damping = 2.0 * self.damping_ratio * (stiffness * touch.mass).sqrt();
            let elastic = stiffness * touch.overlap;
            pressed = (elastic + damping * approach).max(0.0);
            drag = (elastic - pressed) * normal;
            response.force = -pressed * normal;
            response.stored = 0.5 * elastic * touch.overlap;
        }
        if let Some(facing) = &touch.facing {
            pressed += self.reach_out(touch, facing, &mut response);
            let film = self.shear(touch, facing, approach, dt);
            drag += film;
            response.force += film;
        }
        if -touch.overlap > self.far.contact_gap() {
            *spring = Vector3::zeros();
        } else if self.friction > 0.0 {
            let slip = touch.velocity - approach * normal;
            let friction = self.rub(touch, &slip, pressed, spring, dt, &mut response);
            drag += friction;
            response.force += friction;
        }
        response.drag = drag;
        response
    }

    /// Friction on a under the normal force `pressed`; books what its spring gives and takes.
    fn rub(
        &self,
        touch: &Touch,
        slip: &Vector3,
        pressed: f64,
        spring: &mut Vector3,
        dt: f64,
        response: &mut Response,
    ) -> Vector3 {
        let stiffness = touch.rub_share * self.tangential_stiffness;
        let damping = 2.0 * self.damping_ratio * (stiffness * touch.mass).sqrt();
        let before = 0.5 * stiffness * spring.norm_squared();
        *spring = turned(spring, &touch.normal, touch.spin.dot(&touch.normal) * dt) + slip * dt;
        let mut force = -stiffness * *spring - damping * slip;
        let limit = self.friction * pressed;
        let size = force.norm();
        if size > limit {
            force *= limit / size;
            // Nothing is left in the spring when the surfaces part.
            *spring = -force / stiffness;
        }
        let after = 0.5 * stiffness * spring.norm_squared();
        response.stored += after;
        response.dissipated += before - after;
        force
    }

    /// Adds repulsion and attraction; answers with the repulsion, to which friction is proportional.
    fn reach_out(&self, touch: &Touch, facing: &Facing, response: &mut Response) -> f64 {
        let (normal, gap) = (&touch.normal, -touch.overlap);
        let mut add = |push: Push| {
            response.force -= touch.share * push.force * normal;
            response.stored += touch.share * push.energy;
            response.far_stiffness += touch.share * push.stiffness;
        };
        let mut repelled = 0.0;
        if let Some(repulsion) = &self.far.repulsion {
            let push = repulsion.push(gap);
            repelled = touch.share * push.force.max(0.0);
            add(push);
        }
        if let Some(adhesion) = &self.far.adhesion {
            let (push, couple) = adhesion.push(gap, facing);
            add(push);
            response.couple += touch.share * couple;
        }
        repelled
    }

    /// Lubrication force on a.
    fn shear(&self, touch: &Touch, facing: &Facing, approach: f64, dt: f64) -> Vector3 {
        let Some(film) = &self.far.lubrication else {
            return Vector3::zeros();
        };
        let resistance = film.resistance(-touch.overlap, facing);
        let implicit = |c: f64| touch.share * c / (1.0 + PAIRS_AT_ONCE * c * dt / touch.mass);
        let along = approach * touch.normal;
        -(along * implicit(resistance.normal)
            + (touch.velocity - along) * implicit(resistance.tangential))
    }
}

/// The spring in the current tangent plane: its length is kept, and it turns with the bodies about the normal.
pub(super) fn turned(spring: &Vector3, normal: &Vector3, angle: f64) -> Vector3 {
    let flat = spring - normal * normal.dot(spring);
    let (length, size) = (spring.norm(), flat.norm());
    if size <= 1e-12 * length || length == 0.0 {
        return Vector3::zeros();
    }
    Rotation3::new(normal * angle) * (flat * (length / size))
}

/// Restitution of a linear spring and dashpot that part when their force vanishes (Schwager & Pöschel 2007):
/// e = exp(−2ζ arccos(ζ)/√(1 − ζ²)).
fn restitution(zeta: f64) -> f64 {
    let angle_over_sine = if (zeta - 1.0).abs() < 1e-6 {
        1.0
    } else if zeta < 1.0 {
        zeta.acos() / (1.0 - zeta * zeta).sqrt()
    } else {
        zeta.acosh() / (zeta * zeta - 1.0).sqrt()
    };
    (-2.0 * zeta * angle_over_sine).exp()
}

fn ratio_for_restitution(e: f64) -> f64 {
    let (mut low, mut high) = (0.0, 5.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if restitution(middle) > e {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law(friction: f64, damping_ratio: f64) -> Law {
        Law {
            stiffness: 100.0,
            tangential_stiffness: 50.0,
            damping_ratio,
            friction,
            far: Far::default(),
        }
    }

    fn touch(velocity: Vector3) -> Touch {
        Touch {
            normal: Vector3::z(),
            overlap: 0.01,
            velocity,
            spin: Vector3::zeros(),
            mass: 1.0,
            share: 1.0,
            rub_share: 1.0,
            facing: None,
        }
    }

    #[test]
    fn the_damping_ratio_gives_the_restitution_asked_for() {
        for e in [0.05, 0.1353, 0.2, 0.5, 0.9, 0.999] {
            assert!((restitution(ratio_for_restitution(e)) - e).abs() < 1e-9);
        }
        assert!(ratio_for_restitution(1.0) < 1e-12);
    }

    #[test]
    fn friction_is_elastic_below_the_cone_and_sliding_on_it() {
        let law = law(0.3, 0.0);
        let mut spring = Vector3::zeros();
        let stick = law.respond(&touch(Vector3::x()), &mut spring, 1e-3);
        assert!((stick.force - Vector3::new(-0.05, 0.0, -1.0)).norm() < 1e-14);
        for _ in 0..100 {
            law.respond(&touch(Vector3::x()), &mut spring, 1e-3);
        }
        let slide = law.respond(&touch(Vector3::x()), &mut spring, 1e-3);
        assert!((slide.force - Vector3::new(-0.3, 0.0, -1.0)).norm() < 1e-14);
        assert!((slide.drag - Vector3::new(-0.3, 0.0, 0.0)).norm() < 1e-14);
        assert_eq!(slide.dissipated, 0.0);
    }

    #[test]
    fn a_parting_contact_does_not_pull() {
        let law = law(0.3, 1.0);
        let mut spring = Vector3::new(1e-3, 0.0, 0.0);
        let response = law.respond(&touch(-10.0 * Vector3::z()), &mut spring, 1e-3);
        assert_eq!(response.force.norm(), 0.0);
        assert_eq!(spring.norm(), 0.0);
    }

    #[test]
    fn the_spring_turns_with_the_normal_and_keeps_its_length() {
        let spring = Vector3::new(2.0, 0.0, 0.0);
        let tilted = Vector3::new(0.6, 0.0, 0.8);
        let turned = turned(&spring, &tilted, 0.0);
        assert!(turned.dot(&tilted).abs() < 1e-15);
        assert!((turned.norm() - 2.0).abs() < 1e-15);
        let quarter: Vector3 = super::turned(&spring, &Vector3::z(), std::f64::consts::FRAC_PI_2);
        assert!((quarter - Vector3::y() * 2.0).norm() < 1e-15);
    }
}
