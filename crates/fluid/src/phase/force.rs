//! Capillary force and pressure.

use super::PhaseField;
use super::free_energy::bulk;
use crate::{Fluid, rows};

impl PhaseField {
    /// Adds −ψ∇μ_ψ \[N/m³\] (L 33) to a force field of total length, at owned nodes. Collective.
    ///
    /// V_i f_i = −½ Σ_j ½(ψ_i + ψ_j)(μ_j − μ_i) S_ij: minus the transpose of the advection of ψ.
    pub fn add_force(&mut self, fluid: &Fluid, force: &mut [[f64; 4]]) {
        self.pack(fluid);
        let (geometry, packed) = (fluid.geometry(), &self.packed);
        let inverse = fluid.operators.inverse_volumes();
        rows::each(&mut force[..inverse.len()], |i, force| {
            let range = geometry.row(i);
            let own = packed[i];
            let mut sum = [0.0; 3];
            let faces = &geometry.faces[range.clone()];
            for (&j, s) in geometry.columns[range].iter().zip(faces) {
                let other = packed[j as usize];
                let carried = (own[0] + other[0]) * (other[1] - own[1]);
                (0..3).for_each(|c| sum[c] += carried * s[c]);
            }
            (0..3).for_each(|c| force[c] -= 0.25 * inverse[i] * sum[c]);
        });
    }

    /// What the capillary force holds of a pressure, ψμ_ψ + φμ_φ − ef \[Pa\], by owned node: with the pressure of the fluid it is
    /// the mechanical one, which jumps by σ × curvature across an interface. Collective.
    pub fn capillary_pressure(&self, fluid: &Fluid) -> Vec<f64> {
        let potentials = self.chemical_potentials(fluid);
        let density = self.settings.energy_density();
        let half_width = 0.5 * self.square_width();
        let inverse = fluid.operators.inverse_volumes();
        let mut squares = vec![0.0; inverse.len()];
        let mut none = rows::nothing(inverse.len());
        let finish = |i: usize, _: f64, g: [f64; 4], out: &mut f64, (): &mut ()| {
            *out = (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) * inverse[i] * inverse[i];
        };
        let mut psi = self.psi.clone();
        (fluid.operators).gradient(&mut psi, (&mut squares, &mut none), finish);
        let at = |(i, (square, [mu, other])): (usize, (f64, [f64; 2]))| {
            let (psi, solid) = (self.psi[i], self.solid[i]);
            let stored = bulk(psi, solid).iter().sum::<f64>() + half_width * square;
            psi * mu + solid[0] * other - density * stored
        };
        let nodes = squares.into_iter().zip(potentials);
        nodes.enumerate().map(at).collect()
    }

    /// (ψ, μ_ψ, ·, ·) into `packed`, halo included.
    fn pack(&mut self, fluid: &Fluid) {
        let potentials = self.chemical_potentials(fluid);
        for (i, [mu, _]) in potentials.into_iter().enumerate() {
            self.packed[i] = [self.psi[i], mu, 0.0, 0.0];
        }
        fluid.mesh.halo.update(&mut self.packed);
    }
}
