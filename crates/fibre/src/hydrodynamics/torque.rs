//! Torque per length of a fibre beside the moment of its drag: spin and strain of the flow over the thickness.

use super::spheroid::SpheroidRatio;
use super::{FluidProperties, Section, SlenderConstants};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

/// Spin about the axis, K 4.27.
const SPIN_AXIAL: f64 = 3.10;
/// Spin across the axis, K 4.27.
const SPIN_NORMAL: f64 = 0.35;
/// Strain, K 4.28.
const STRAIN: f64 = 3.07;

/// Which law gives the torque per length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TorqueModel {
    /// No torque.
    None,
    /// K 4.27, 4.28: C_r∥ = 3.10, C_r⊥ = 0.35, C_s = 3.07.
    Kunhappan,
    /// C_r as K; C_s chosen so that a straight rigid fibre with this slender-body drag turns with Jeffery's period at
    /// Cox's equivalent aspect ratio.
    Jeffery(SlenderConstants),
    /// Every segment as a prolate spheroid (K 4.12), less the moment about its middle of the drag that
    /// [`super::DragModel::ProlateSpheroid`] distributes over it: together they are the spheroid's torque.
    ProlateSpheroid(SpheroidRatio),
}

impl Default for TorqueModel {
    /// Jeffery with Batchelor's constants, which [`super::DragModel::Auto`] uses too.
    fn default() -> Self {
        Self::Jeffery(SlenderConstants::Batchelor)
    }
}

/// Torque per length \[N\]: T = R(Ω − ω) + strain, with Ω = ½∇×u, ω the fibre's angular velocity and
/// R = resistance_axial tt + resistance_normal (I − tt).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueLaw {
    /// About the axis \[N·s\].
    pub resistance_axial: f64,
    /// Across the axis \[N·s\].
    pub resistance_normal: f64,
    /// Coefficient of −t × (E·t) \[N·s\].
    strain: f64,
    /// Torque of the strain rate \[N\].
    pub strain_torque: Vector3<f64>,
}

impl TorqueLaw {
    /// The law of the same section at another tangent and gradient.
    pub(crate) fn at(&self, tangent: &Vector3<f64>, gradient: &Matrix3<f64>) -> Self {
        let strain_rate = 0.5 * (gradient + gradient.transpose());
        Self {
            strain_torque: -self.strain * tangent.cross(&(strain_rate * tangent)),
            ..*self
        }
    }

    /// Torque per length \[N\] on a fibre turning at `angular_velocity` \[rad/s\] in fluid with ∇u = `gradient`.
    pub fn torque(
        &self,
        tangent: &Vector3<f64>,
        gradient: &Matrix3<f64>,
        angular_velocity: &Vector3<f64>,
    ) -> Vector3<f64> {
        let relative = spin(gradient) - angular_velocity;
        self.resistance_normal * relative
            + (self.resistance_axial - self.resistance_normal) * tangent.dot(&relative) * tangent
            + self.strain_torque
    }

    /// Derivative of [`TorqueLaw::torque`] by the tangent, for changes across it \[N\].
    pub fn by_tangent(
        &self,
        tangent: &Vector3<f64>,
        gradient: &Matrix3<f64>,
        angular_velocity: &Vector3<f64>,
    ) -> Matrix3<f64> {
        let relative = spin(gradient) - angular_velocity;
        let strain_rate = 0.5 * (gradient + gradient.transpose());
        let turned =
            Matrix3::from_diagonal_element(tangent.dot(&relative)) + tangent * relative.transpose();
        let strained =
            tangent.cross_matrix() * strain_rate - (strain_rate * tangent).cross_matrix();
        turned * (self.resistance_axial - self.resistance_normal) - strained * self.strain
    }
}

/// Ω = ½ ∇×u for gradient\[i\]\[j\] = ∂u_i/∂x_j.
pub fn spin(gradient: &Matrix3<f64>) -> Vector3<f64> {
    0.5 * Vector3::new(
        gradient[(2, 1)] - gradient[(1, 2)],
        gradient[(0, 2)] - gradient[(2, 0)],
        gradient[(1, 0)] - gradient[(0, 1)],
    )
}

/// Cox's equivalent aspect ratio of a cylinder, r_e = 1.24 r_p/√(ln r_p) (Cox 1971, J. Fluid Mech. 45:625; K 6.8).
pub fn cox_aspect_ratio(aspect_ratio: f64) -> f64 {
    1.24 * aspect_ratio / aspect_ratio.ln().sqrt()
}

impl TorqueModel {
    /// Whether a fibre of one thickness has the same law all along.
    pub(crate) fn uniform(self) -> bool {
        !matches!(self, Self::ProlateSpheroid(_))
    }

    /// The law at a point with unit tangent `tangent` and gradient\[i\]\[j\] = ∂u_i/∂x_j \[1/s\].
    ///
    /// T_s = −C_s μ d² t × (E·t): K 4.28 with its sign turned, so that a fibre aligned with a shear flow feels
    /// −(C_r⊥ + C_s)/2 μ d² γ̇ and tumbles. For spheroids it is +8πμa³ Y^H t × (E·t), with which they turn as Jeffery says.
    pub fn torque(
        &self,
        tangent: &Vector3<f64>,
        gradient: &Matrix3<f64>,
        section: &Section,
        fluid: &FluidProperties,
    ) -> TorqueLaw {
        let (resistance_axial, resistance_normal, strain) = self.coefficients(section, fluid);
        let section = TorqueLaw {
            resistance_axial,
            resistance_normal,
            strain,
            strain_torque: Vector3::zeros(),
        };
        section.at(tangent, gradient)
    }

    /// Resistances to spin about and across the axis and the coefficient of −t × (E·t), by length \[N·s\].
    fn coefficients(&self, section: &Section, fluid: &FluidProperties) -> (f64, f64, f64) {
        let mu = fluid.viscosity;
        if let Self::ProlateSpheroid(ratio) = self {
            let functions = ratio.functions(section);
            let [_, drag] = ratio.drag(section, mu);
            let length = section.segment_length;
            // 8πμa³/l and the moment of a uniform drag coefficient, both by length.
            let (unit, moment) = (PI * mu * length * length, drag * length * length / 12.0);
            return (
                unit * functions.spin[0],
                unit * functions.spin[1] - moment,
                moment - unit * functions.strain,
            );
        }
        let unit = match self {
            Self::None => 0.0,
            _ => mu * section.diameter * section.diameter,
        };
        let strain = self.strain_coefficient(section.aspect_ratio());
        (SPIN_AXIAL * unit, SPIN_NORMAL * unit, strain * unit)
    }

    /// C_s. Jeffery: (2A + C_r⊥(1 − r_e²))/(1 + r_e²), A = ζ⊥L²/(12 μ d²) with the ζ⊥ of rotation, from
    /// equating the angular velocity of the aligned fibre, −γ̇/(1 + r_e²), with that of drag moment, spin and strain together.
    fn strain_coefficient(self, aspect_ratio: f64) -> f64 {
        let constants = match self {
            Self::None | Self::ProlateSpheroid(_) => return 0.0,
            Self::Kunhappan => return STRAIN,
            Self::Jeffery(constants) => constants,
        };
        let moment = constants.rotation(aspect_ratio, 1.0) * aspect_ratio.powi(2) / 12.0;
        let r2 = cox_aspect_ratio(aspect_ratio).powi(2);
        (2.0 * moment + SPIN_NORMAL * (1.0 - r2)) / (1.0 + r2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLUID: FluidProperties = FluidProperties {
        density: 1000.0,
        viscosity: 0.02,
    };

    fn section(aspect_ratio: f64) -> Section {
        Section::middle(2e-5, 2e-5 * aspect_ratio)
    }

    /// u_x = γ̇ y.
    fn shear(rate: f64) -> Matrix3<f64> {
        let mut g = Matrix3::zeros();
        g[(0, 1)] = rate;
        g
    }

    #[test]
    fn an_aligned_fibre_in_shear_is_turned_over() {
        let (rate, s) = (30.0, section(50.0));
        let t = Vector3::x();
        let law = TorqueModel::Kunhappan.torque(&t, &shear(rate), &s, &FLUID);
        let torque = law.torque(&t, &shear(rate), &Vector3::zeros());
        let unit = FLUID.viscosity * s.diameter.powi(2) * rate;
        let expected = -(0.35 + 3.07) / 2.0 * unit;
        assert!((torque - Vector3::new(0.0, 0.0, expected)).norm() < 1e-12 * unit);
        assert!((torque.z / unit + 1.71).abs() < 1e-12);
    }

    #[test]
    fn spin_about_the_axis_and_no_torque_in_rigid_rotation() {
        let omega = Vector3::new(1.0, -2.0, 3.0);
        let gradient = omega.cross_matrix();
        assert!((spin(&gradient) - omega).norm() < 1e-14);
        let t = Vector3::new(2.0, 1.0, -2.0) / 3.0;
        let law = TorqueModel::default().torque(&t, &gradient, &section(20.0), &FLUID);
        assert!(law.torque(&t, &gradient, &omega).norm() < 1e-20);
        let about_axis = law.torque(&t, &Matrix3::zeros(), &(-t));
        let unit = FLUID.viscosity * 4e-10;
        assert!((about_axis - 3.10 * unit * t).norm() < 1e-12 * unit);
    }

    #[test]
    fn strain_coefficient_that_gives_jefferys_period() {
        for (r_p, expected) in [
            (10.0, 0.63),
            (20.0, 0.70),
            (50.0, 0.76),
            (100.0, 0.79),
            (200.0, 0.82),
        ] {
            let c = TorqueModel::default().strain_coefficient(r_p);
            assert!((c - expected).abs() < 0.0051, "r_p {r_p}: {c}");
        }
    }

    /// Drag moment, spin and strain integrated over a straight rigid fibre give Jeffery's φ̇ at every angle in the plane.
    #[test]
    fn a_rigid_fibre_turns_as_jeffery_says() {
        let (rate, r_p) = (5.0, 30.0);
        let s = section(r_p);
        for constants in [
            SlenderConstants::Batchelor,
            SlenderConstants::Kunhappan,
            SlenderConstants::Split,
        ] {
            let zeta = constants.rotation(r_p, FLUID.viscosity);
            let moment = zeta * s.fibre_length.powi(2) / 12.0;
            let r2 = cox_aspect_ratio(r_p).powi(2);
            for k in 0..12 {
                let angle = 0.3 * f64::from(k);
                let t = Vector3::new(angle.cos(), angle.sin(), 0.0);
                let model = TorqueModel::Jeffery(constants);
                let law = model.torque(&t, &shear(rate), &s, &FLUID);
                let drive = moment * t.cross(&(shear(rate) * t)).z
                    + law.torque(&t, &shear(rate), &Vector3::zeros()).z;
                let turned = drive / (moment + law.resistance_normal);
                let jeffery = -rate * (r2 * angle.sin().powi(2) + angle.cos().powi(2)) / (r2 + 1.0);
                assert!(
                    (turned - jeffery).abs() < 1e-12 * rate,
                    "{angle}: {turned} {jeffery}"
                );
            }
        }
    }

    const ALL: [TorqueModel; 6] = [
        TorqueModel::None,
        TorqueModel::Kunhappan,
        TorqueModel::Jeffery(SlenderConstants::Batchelor),
        TorqueModel::Jeffery(SlenderConstants::Split),
        TorqueModel::ProlateSpheroid(SpheroidRatio::Cox),
        TorqueModel::ProlateSpheroid(SpheroidRatio::Bretherton),
    ];

    /// By the fibre's spin, by the flow's gradient and by the tangent. The torque is linear in the first two, so that
    /// differences of any size are exact: −R by spin; ½R ε − strain part by gradient.
    #[test]
    fn torque_has_the_derivatives_it_should() {
        let t = Vector3::new(0.48, -0.6, 0.64);
        let gradient = Matrix3::new(0.3, -1.2, 0.5, 0.7, 0.1, -0.4, 0.9, 0.2, -0.4);
        let omega = Vector3::new(0.5, -0.8, 1.1);
        for model in ALL {
            let section = Section {
                segment_length: 1e-4,
                ..section(50.0)
            };
            let at = |t: &Vector3<f64>, g: &Matrix3<f64>, w: &Vector3<f64>| {
                model.torque(t, g, &section, &FLUID).torque(t, g, w)
            };
            let law = model.torque(&t, &gradient, &section, &FLUID);
            let size = law.resistance_axial + law.resistance_normal;
            assert!(law.resistance_axial >= 0.0 && law.resistance_normal >= 0.0);
            for j in 0..3 {
                let e = Vector3::ith(j, 1.0);
                let by_spin = at(&t, &gradient, &(omega + e)) - at(&t, &gradient, &omega);
                let expected = -(e * law.resistance_normal
                    + t * (t[j] * (law.resistance_axial - law.resistance_normal)));
                assert!(
                    (by_spin - expected).norm() <= 1e-12 * size,
                    "{model:?}: by spin"
                );
                for i in 0..3 {
                    let mut changed = gradient;
                    changed[(i, j)] += 1.0;
                    let by_gradient = at(&t, &changed, &omega) - at(&t, &gradient, &omega);
                    // ∂Ω/∂G_ij = ½ e_j × e_i, ∂(E t)/∂G_ij = ½ (t_j e_i + t_i e_j).
                    let f = Vector3::ith(i, 1.0);
                    let turned = e.cross(&f) * 0.5;
                    let strained = (f * t[j] + e * t[i]) * 0.5;
                    let expected = turned * law.resistance_normal
                        + t * (t.dot(&turned) * (law.resistance_axial - law.resistance_normal))
                        - t.cross(&strained) * law.strain;
                    assert!(
                        (by_gradient - expected).norm() <= 1e-12 * size,
                        "{model:?}: by gradient {i} {j}"
                    );
                }
            }
            let by_tangent = law.by_tangent(&t, &gradient, &omega);
            let across = t.cross(&Vector3::new(0.2, 0.9, 0.3)).normalize();
            for side in [across, t.cross(&across)] {
                let h = 1e-5;
                let turned = |a: f64| at(&(t * a.cos() + side * a.sin()), &gradient, &omega);
                let error = (turned(h) - turned(-h)) / (2.0 * h) - by_tangent * side;
                assert!(error.norm() <= 1e-8 * size, "{model:?}: by tangent");
            }
        }
    }

    /// A fibre of one segment has the spheroid's whole torque: with its drag's moment it turns as Jeffery says.
    #[test]
    fn a_single_spheroid_turns_at_its_own_ratio() {
        let (rate, s) = (5.0, section(20.0));
        let ratio = 0.7 * 20.0_f64;
        let model = TorqueModel::ProlateSpheroid(SpheroidRatio::Bretherton);
        let drag = super::super::DragModel::ProlateSpheroid(SpheroidRatio::Bretherton);
        let zeta = drag
            .resistance(&Vector3::x(), &Vector3::zeros(), &s, &FLUID)
            .normal;
        let moment = zeta * s.fibre_length.powi(2) / 12.0;
        for k in 0..12 {
            let angle = 0.3 * f64::from(k);
            let t = Vector3::new(angle.cos(), angle.sin(), 0.0);
            let law = model.torque(&t, &shear(rate), &s, &FLUID);
            let drive = moment * t.cross(&(shear(rate) * t)).z
                + law.torque(&t, &shear(rate), &Vector3::zeros()).z;
            let turned = drive / (moment + law.resistance_normal);
            let r2 = ratio * ratio;
            let jeffery = -rate * (r2 * angle.sin().powi(2) + angle.cos().powi(2)) / (r2 + 1.0);
            assert!(
                (turned - jeffery).abs() < 1e-12 * rate,
                "{angle}: {turned} {jeffery}"
            );
        }
    }
}
