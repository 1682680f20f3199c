//! Whether a step takes diffusion explicitly, implicitly, or implicitly along one direction only.

use crate::{Diffusion, Fluid, Mass};

/// Interval [−2.51, 0] of the stability region of three-stage Runge–Kutta of third order.
const REAL_LIMIT: f64 = 2.51;
/// Interval [−1.73 i, 1.73 i].
const IMAGINARY_LIMIT: f64 = 1.73;
/// By what the correction of lumped mass, I + A + A², lengthens the spectrum of diffusion: the mass is not negative, A ≤ 1.
const DIFFUSION_GAIN: f64 = 3.0;
/// The same of convection. The shortest waves hardly move: not 3 but max sin θ (1 + A + A²), A = (1 − cos θ)/3, is 1.549 on uniform
/// hexahedra and prisms, 1.541 on tetrahedra (seven drifts), less where jitter lifts the bound of the lumped spectrum.
const CONVECTION_GAIN: f64 = 1.57;

/// How a step advanced diffusion, and the numbers that decided it.
///
/// Convection is skew-symmetric and diffusion symmetric, so eigenvalues times Δt lie in the rectangle
/// [−viscous number, 0] × [−Courant number, Courant number] i. The ellipse with half axes 2.51 and 1.73 lies in the
/// stability region of the explicit scheme: diffusion is explicit when the rectangle lies in the ellipse. Corrected mass
/// stretches its sides by 3 and 1.57.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DiffusionChoice {
    /// True where it was implicit.
    pub implicit: bool,
    /// Implicit along this axis only (0, 1, 2), explicit along the others.
    pub along: Option<usize>,
    /// Implicit by direct solves, not by conjugate gradients.
    pub direct: bool,
    /// Δt ν max Σ_j (w_ij + |w_ij|)/V_i: bounds the spectrum of Δt ν L.
    pub viscous_number: f64,
    /// The same of what is explicit: of the other two directions where diffusion is implicit along one.
    pub explicit_number: f64,
    /// The same of the eddy viscosity of the sub-step before, which is always explicit.
    pub eddy_number: f64,
    /// Δt max ½ Σ_j |F_ij|/V_i of the last projected fluxes.
    pub courant_number: f64,
    /// Lumped mass was corrected, see [`Mass`]: not where that would be unstable.
    pub corrected_mass: bool,
    /// Chosen by the settings, not by the numbers.
    pub forced: bool,
}

impl DiffusionChoice {
    /// True when the explicit scheme is stable at these numbers.
    pub fn allows_explicit(&self) -> bool {
        self.allows(self.viscous_number)
    }

    /// The same with another viscous number.
    fn allows(&self, viscous_number: f64) -> bool {
        let square = |x: f64| x * x;
        let [diffusion, convection] = if self.corrected_mass {
            [DIFFUSION_GAIN, CONVECTION_GAIN]
        } else {
            [1.0; 2]
        };
        square(diffusion * (viscous_number + self.eddy_number) / REAL_LIMIT)
            + square(convection * self.courant_number / IMAGINARY_LIMIT)
            <= 1.0
    }
}

impl std::fmt::Display for DiffusionChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let how = match (self.implicit, self.along) {
            (true, Some(axis)) => {
                ["implicit along x", "implicit along y", "implicit along z"][axis]
            }
            (true, None) if self.direct => "implicit, solved directly",
            (true, None) => "implicit",
            (false, _) => "explicit",
        };
        let why = match (self.forced, self.allows_explicit()) {
            (true, _) => "as set",
            (false, true) => "inside the stability limit of explicit diffusion",
            (false, false) => "outside the stability limit of explicit diffusion",
        };
        write!(
            f,
            "diffusion {how}: viscous number {:.3} ({:.3} explicit){}, Courant number {:.3}, {why}{}",
            self.viscous_number,
            self.explicit_number,
            if self.eddy_number > 0.0 {
                format!(", {:.3} of eddies", self.eddy_number)
            } else {
                String::new()
            },
            self.courant_number,
            if self.corrected_mass {
                ", mass corrected"
            } else {
                ""
            }
        )
    }
}

impl Fluid {
    /// The same on every rank: both numbers are largest values over all nodes.
    pub(crate) fn choose_diffusion(&self, dt: f64) -> DiffusionChoice {
        let viscous_number = dt * self.viscous_rate;
        let mut choice = DiffusionChoice {
            viscous_number,
            explicit_number: viscous_number,
            eddy_number: dt * self.eddy_rate(),
            courant_number: dt * self.flux_rate,
            corrected_mass: self.settings.mass == Mass::Corrected
                && !self.operators.geometry.orthogonal
                && CONVECTION_GAIN * dt * self.flux_rate <= IMAGINARY_LIMIT,
            forced: self.settings.diffusion != Diffusion::Auto,
            ..DiffusionChoice::default()
        };
        choice.corrected_mass &= self.eddy.is_none() || choice.allows(0.0);
        if self.settings.diffusion == Diffusion::Explicit {
            choice.corrected_mass &= choice.allows_explicit();
        }
        let implicit = match self.settings.diffusion {
            Diffusion::Auto => !choice.allows_explicit(),
            Diffusion::Explicit => false,
            Diffusion::Implicit => true,
        };
        // Without viscosity there is nothing to solve for.
        if !implicit || self.viscous_rate == 0.0 {
            return choice;
        }
        (choice.implicit, choice.explicit_number) = (true, 0.0);
        if let Some(direct) = &self.momentum.direct {
            let rest = dt * self.settings.kinematic_viscosity() * direct.rest();
            if !choice.forced && choice.allows(rest) {
                (choice.along, choice.explicit_number) = (Some(direct.axis()), rest);
            }
            choice.direct = choice.along.is_some() || direct.cheap;
        }
        choice
    }

    /// ν max Σ_j (w_ij + |w_ij|)/V_i \[1/s\] over all nodes: twice the largest ν Σ w/V where no weight is negative.
    /// Collective.
    pub(crate) fn find_viscous_rate(&self) -> f64 {
        let sums = self.operators.weight_sums(|w| w + w.abs());
        let rates = sums.iter().zip(self.operators.inverse_volumes());
        let largest = rates.fold(0.0, |m, (sum, inverse)| f64::max(m, sum * inverse));
        let nu = self.settings.kinematic_viscosity();
        nu * self.mesh.halo.communicator().max(largest)
    }

    /// Longest step that the explicit scheme allows with the present fluxes and eddies, and explicit diffusion of `rate` \[1/s\] \[s\].
    pub(crate) fn longest_explicit_step(&self, rate: f64) -> f64 {
        let (real, imaginary) = (
            (rate + self.eddy_rate()) / REAL_LIMIT,
            self.flux_rate / IMAGINARY_LIMIT,
        );
        real.hypot(imaginary).recip()
    }

    /// Bound of the spectrum of the eddy viscosity \[1/s\].
    fn eddy_rate(&self) -> f64 {
        self.eddy.as_ref().map_or(0.0, |eddy| eddy.rate)
    }
}
