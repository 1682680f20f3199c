//! The free energy of L 28–30 by node, its derivatives, and its differences over a step.

use super::PhaseField;
use crate::Fluid;
use fibreflow_parallel::block_sums;

/// Where the free energy is \[J\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FreeEnergy {
    /// e ∫ ¼(1 − ψ²)².
    pub bulk: f64,
    /// e ∫ (3/2) φ² (ψ − ψ*)².
    pub solid: f64,
    /// e ∫ ½ ξ² |∇ψ|².
    pub gradient: f64,
}

impl FreeEnergy {
    /// F \[J\].
    pub fn total(&self) -> f64 {
        self.bulk + self.solid + self.gradient
    }
}

/// f_0 and f_1.
pub(super) fn bulk(psi: f64, [phi, wanted]: [f64; 2]) -> [f64; 2] {
    [
        0.25 * (1.0 - psi * psi).powi(2),
        1.5 * (phi * (psi - wanted)).powi(2),
    ]
}

/// ∂(f_0 + f_1)/∂ψ.
pub(super) fn slope(psi: f64, [phi, wanted]: [f64; 2]) -> f64 {
    psi * (psi * psi - 1.0) + 3.0 * phi * phi * (psi - wanted)
}

/// ∂f_1/∂φ.
pub(super) fn slope_of_solid(psi: f64, [phi, wanted]: [f64; 2]) -> f64 {
    3.0 * phi * (psi - wanted).powi(2)
}

/// g with g (b − a) ≥ f(b) − f(a) of the bulk, from ψ = a at the start of a step to b at its end; second order for `share` = 0.
///
/// The concave part −½ψ² is differenced exactly. Of the convex part a `share` is taken at b, which is never less than the
/// difference; the rest is differenced.
pub(super) fn difference(a: f64, b: f64, [phi, wanted]: [f64; 2], share: f64) -> f64 {
    let (mean, solid) = (0.5 * (a + b), 3.0 * phi * phi);
    let secant = 0.5 * (a * a + b * b) * mean + solid * (mean - wanted);
    let end = b * b * b + solid * (b - wanted);
    secant + share * (end - secant) - mean
}

impl PhaseField {
    /// F of the present ψ and φ. Collective.
    pub fn energy(&self, fluid: &Fluid) -> FreeEnergy {
        let volumes = fluid.operators.volumes();
        let laplacian = self.laplacian_of_psi(fluid);
        let (psi, solid) = (&self.psi, &self.solid);
        let mut sums = block_sums(volumes.len(), |range| {
            range.fold([0.0; 3], |s, i| {
                let [own, other] = bulk(psi[i], solid[i]);
                [
                    s[0] + volumes[i] * own,
                    s[1] + volumes[i] * other,
                    s[2] - psi[i] * laplacian[i],
                ]
            })
        });
        fluid.mesh.halo.communicator().sum_slice(&mut sums);
        let density = self.settings.energy_density();
        FreeEnergy {
            bulk: density * sums[0],
            solid: density * sums[1],
            gradient: 0.5 * density * self.settings.interface_width.powi(2) * sums[2],
        }
    }

    /// Σ_j w_ij (ψ_j − ψ_i) \[m\] by owned node. Collective.
    fn laplacian_of_psi(&self, fluid: &Fluid) -> Vec<f64> {
        let (mut psi, none) = (self.psi.clone(), fluid.operators.volumes());
        let mut out = vec![0.0; none.len()];
        let finish = |_: f64, sum: f64, _: [f64; 2], _: f64| sum;
        (fluid.operators).laplacian(&mut psi, [none, none], &mut out, finish);
        out
    }

    /// μ_ψ and μ_φ \[J/m³\] by owned node. Collective.
    pub fn chemical_potentials(&self, fluid: &Fluid) -> Vec<[f64; 2]> {
        let laplacian = self.laplacian_of_psi(fluid);
        let density = self.settings.energy_density();
        let width = self.settings.interface_width.powi(2);
        let inverse = fluid.operators.inverse_volumes();
        let at = |(i, inverse): (usize, &f64)| {
            let (psi, solid) = (self.psi[i], self.solid[i]);
            let bent = width * inverse * laplacian[i];
            [
                density * (slope(psi, solid) - bent),
                density * slope_of_solid(psi, solid),
            ]
        };
        inverse.iter().enumerate().map(at).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_the_energy() {
        for (psi, phi) in [(0.3, 0.8), (-0.9, 0.1), (1.1, 0.0)] {
            let (h, wanted) = (1e-6, 0.209);
            let f = |psi, phi| bulk(psi, [phi, wanted]).iter().sum::<f64>();
            let by_psi = (f(psi + h, phi) - f(psi - h, phi)) / (2.0 * h);
            let by_phi = (f(psi, phi + h) - f(psi, phi - h)) / (2.0 * h);
            assert!((slope(psi, [phi, wanted]) - by_psi).abs() < 1e-8);
            assert!((slope_of_solid(psi, [phi, wanted]) - by_phi).abs() < 1e-8);
        }
    }

    #[test]
    fn differences_never_promise_less_than_the_energy_loses() {
        let values: Vec<f64> = (-15..=15).map(|k| 0.1 * f64::from(k)).collect();
        for &a in &values {
            for &b in &values {
                for solid in [[0.0, 0.0], [0.7, 0.2], [1.0, -0.4]] {
                    let f = |psi| bulk(psi, solid).iter().sum::<f64>();
                    let gained = f(b) - f(a);
                    let exact = difference(a, b, solid, 0.0) * (b - a);
                    assert!((exact - gained).abs() < 1e-13);
                    assert!(difference(a, b, solid, 0.6) * (b - a) >= gained - 1e-13);
                }
            }
        }
    }
}
