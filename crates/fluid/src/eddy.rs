//! Eddy viscosity of the motion that a mesh does not resolve, from the velocity gradient at a node.
//!
//! | model | ν_t/(C Δ)², Δ = V^⅓ | in pure shear | in solid rotation | at a wall |
//! |---|---|---|---|---|
//! | Smagorinsky (1963) | \|S\| = √(2S:S) | γ̇ | 0 | finite |
//! | WALE (Nicoud & Ducros 1999) | (T:T)^(3/2)/((S:S)^(5/2) + (T:T)^(5/4)), T the traceless symmetric part of g² | 0 | (2/3)^¼ Ω | y³ |
//! | σ (Nicoud et al. 2011) | σ₃(σ₁ − σ₂)(σ₂ − σ₃)/σ₁², σ the singular values of g | 0 | 0 | y³ |

use crate::operators::{Operators, Stress};
use crate::rows::nothing;
use crate::{BoundaryCondition, Fluid, FluidSettings};
use fibreflow_mesh::{DualGeometry, LocalMesh};
use fibreflow_parallel::block_sums;

/// How ν_t follows from the velocity gradient.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EddyModel {
    /// Smagorinsky (1963).
    Smagorinsky,
    /// Wall-adapting local eddy viscosity (Nicoud & Ducros 1999).
    Wale,
    /// From singular values (Nicoud, Toda, Cabrit, Bose & Lee 2011).
    Sigma,
}

/// A model of the stress of unresolved motion, 2ν_t S.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EddyViscosity {
    /// Which model.
    pub model: EddyModel,
    /// C.
    pub constant: f64,
}

impl EddyViscosity {
    /// ν_t \[m²/s\] for g\[d\]\[c\] = ∂_d u_c \[1/s\] (c < 3) and a dual volume \[m³\].
    pub fn at(&self, g: &[[f64; 4]; 3], volume: f64) -> f64 {
        let rate = match self.model {
            EddyModel::Smagorinsky => (2.0 * strain(g)).sqrt(),
            EddyModel::Wale => wale(g),
            EddyModel::Sigma => sigma(g),
        };
        let length = self.constant * volume.cbrt();
        length * length * rate
    }
}

/// What a flow with a model needs.
pub(crate) struct Eddy {
    pub model: EddyViscosity,
    /// Owned nodes on walls: nothing unresolved moves there.
    walls: Vec<u32>,
    /// Total.
    stress: Vec<Stress>,
    /// Bound of the spectrum of ∇·(ν_t ∇) \[1/s\].
    pub rate: f64,
}

impl Eddy {
    pub fn new(model: EddyViscosity, mesh: &LocalMesh, walls: Vec<u32>) -> Self {
        Self {
            model,
            walls,
            stress: vec![[[0.0; 4]; 3]; mesh.total()],
            rate: 0.0,
        }
    }

    /// V ∇·(2ν_t S) of a valid velocity, handed to `finish(i, ·, a_i, b_i)`. Collective.
    pub fn apply<A: Send, B: Send>(
        &mut self,
        operators: &Operators,
        u: &[[f64; 4]],
        out: (&mut [A], &mut [B]),
        finish: impl Fn(usize, [f64; 4], &mut A, &mut B) + Sync,
    ) {
        let (model, stress) = (self.model, &mut self.stress);
        let (volumes, inverse) = (operators.volumes(), operators.inverse_volumes());
        operators.velocity_gradient(u, &mut stress[..volumes.len()], |i, g, stress| {
            let g = g.map(|row| row.map(|v| inverse[i] * v));
            let viscosity = model.at(&g, volumes[i]);
            for (d, row) in stress.iter_mut().enumerate() {
                *row = std::array::from_fn(|c| if c < 3 { viscosity * g[c][d] } else { 0.0 });
            }
            stress[0][3] = viscosity;
        });
        for &i in &self.walls {
            stress[i as usize] = [[0.0; 4]; 3];
        }
        let local = operators.stress_divergence(u, stress, out, finish);
        self.rate = operators.communicator().max(local);
    }
}

impl Fluid {
    /// ν_t \[m²/s\] at the owned nodes for the present velocity; none without a model.
    pub fn eddy_viscosity(&self) -> Option<Vec<f64>> {
        let eddy = self.eddy.as_ref()?;
        Some(self.eddy_viscosity_of(&eddy.model, &self.velocity))
    }

    /// The same for any model and velocities of owned and halo nodes, zero on walls.
    pub fn eddy_viscosity_of(&self, model: &EddyViscosity, velocity: &[[f64; 4]]) -> Vec<f64> {
        let (volumes, inverse) = (self.operators.volumes(), self.operators.inverse_volumes());
        let mut values = vec![0.0; volumes.len()];
        self.operators
            .velocity_gradient(velocity, &mut values, |i, g, value| {
                let g = g.map(|row| row.map(|v| inverse[i] * v));
                *value = model.at(&g, volumes[i]);
            });
        for &i in &self.walls() {
            values[i as usize] = 0.0;
        }
        values
    }

    /// Owned nodes on walls.
    pub(crate) fn walls(&self) -> Vec<u32> {
        walls(&self.operators.geometry, &self.settings)
    }

    /// −⟨u·∇·(2ν_t S)⟩ \[m²/s³\] and ⟨ν_t⟩ \[m²/s\] of the present velocity; zero without a model. Collective.
    pub(crate) fn eddy_dissipation(&self) -> [f64; 2] {
        let Some(eddy) = &self.eddy else {
            return [0.0; 2];
        };
        let (u, volumes) = (&self.velocity, self.operators.volumes());
        let mut eddy = Eddy::new(eddy.model, &self.mesh, eddy.walls.clone());
        let mut work = vec![0.0; volumes.len()];
        let mut none = nothing(work.len());
        let out = (&mut work[..], &mut none[..]);
        eddy.apply(&self.operators, u, out, |i, force, work, ()| {
            *work = -(0..3).map(|c| u[i][c] * force[c]).sum::<f64>();
        });
        let stress = &eddy.stress;
        let mut sums = block_sums(volumes.len(), |range| {
            range.fold([0.0; 2], |[work_sum, sum], i| {
                [work_sum + work[i], sum + volumes[i] * stress[i][0][3]]
            })
        });
        self.mesh.halo.communicator().sum_slice(&mut sums);
        sums.map(|s| s / self.operators.geometry.total_volume)
    }
}

/// Owned nodes on walls, ascending.
pub(crate) fn walls(geometry: &DualGeometry, settings: &FluidSettings) -> Vec<u32> {
    let wall = |patch: u32| {
        matches!(
            settings.boundary[patch as usize],
            BoundaryCondition::Wall { .. } | BoundaryCondition::MovingWall { .. }
        )
    };
    let shares = geometry.boundary.iter().filter(|s| wall(s.patch.into()));
    let mut nodes: Vec<u32> = shares.map(|share| share.node).collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes
}

/// S:S.
fn strain(g: &[[f64; 4]; 3]) -> f64 {
    let mixed = |a: usize, b: usize| 0.5 * (g[a][b] + g[b][a]).powi(2);
    g[0][0].powi(2) + g[1][1].powi(2) + g[2][2].powi(2) + mixed(0, 1) + mixed(0, 2) + mixed(1, 2)
}

fn wale(g: &[[f64; 4]; 3]) -> f64 {
    let product = |a: usize, b: usize| (0..3).map(|c| g[a][c] * g[c][b]).sum::<f64>();
    let third = (product(0, 0) + product(1, 1) + product(2, 2)) / 3.0;
    let mixed = |a: usize, b: usize| 0.5 * (product(a, b) + product(b, a)).powi(2);
    let own = |a: usize| (product(a, a) - third).powi(2);
    let turned = own(0) + own(1) + own(2) + mixed(0, 1) + mixed(0, 2) + mixed(1, 2);
    // Powers by roots, which cost less.
    let (strain, root) = (strain(g), turned.sqrt());
    let below = strain * strain * strain.sqrt() + turned * root.sqrt();
    if below > 0.0 {
        turned * root / below
    } else {
        0.0
    }
}

/// Squares of singular values are roots of λ³ − aλ² + bλ − d² with a = |g|², b = |cof g|², d = det g. The largest by the
/// cosine; the others from their sum and product, so that they are exactly zero with the cofactors.
fn sigma(g: &[[f64; 4]; 3]) -> f64 {
    let minor = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        g[a][c] * g[b][d] - g[a][d] * g[b][c]
    };
    let square = |value: &dyn Fn(usize, usize) -> f64| {
        (0..9).map(|k| value(k / 3, k % 3).powi(2)).sum::<f64>()
    };
    let (a, b) = (square(&|i, j| g[i][j]), square(&minor));
    let d = (0..3).map(|j| g[0][j] * minor(0, j)).sum::<f64>();
    if a == 0.0 {
        return 0.0;
    }
    let spread = (a * a - 3.0 * b).max(0.0).sqrt();
    let largest = if spread > 0.0 {
        let cosine = (a * (a * a - 4.5 * b) + 13.5 * d * d) / spread.powi(3);
        (a + 2.0 * spread * (cosine.clamp(-1.0, 1.0).acos() / 3.0).cos()) / 3.0
    } else {
        a / 3.0
    };
    let product = d * d / largest;
    let sum = ((b - product) / largest).max(0.0);
    let middle = 0.5 * (sum + (sum * sum - 4.0 * product).max(0.0).sqrt());
    let (first, second) = (largest.sqrt(), middle.min(largest).sqrt());
    let third = if second > 0.0 {
        (d.abs() / (first * second)).min(second)
    } else {
        0.0
    };
    third * (first - second) * (second - third) / largest
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODELS: [EddyModel; 3] = [EddyModel::Smagorinsky, EddyModel::Wale, EddyModel::Sigma];

    fn rate(model: EddyModel, rows: [[f64; 3]; 3]) -> f64 {
        let g = rows.map(|[x, y, z]| [x, y, z, f64::NAN]);
        EddyViscosity {
            model,
            constant: 2.0,
        }
        .at(&g, 8.0)
            / 16.0
    }

    /// q g qᵀ, q a rotation about z followed by one that takes x, y, z to y, z, x.
    fn turned(g: [[f64; 3]; 3], angle: f64) -> [[f64; 3]; 3] {
        let (s, c) = angle.sin_cos();
        let q = [[s, c, 0.0], [0.0, 0.0, 1.0], [c, -s, 0.0]];
        let times = |a: [[f64; 3]; 3], b: [[f64; 3]; 3]| {
            [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum::<f64>()))
        };
        let transposed = [0, 1, 2].map(|i| [0, 1, 2].map(|j| q[j][i]));
        times(times(q, g), transposed)
    }

    #[test]
    fn exact_limits() {
        let shear = [[0.0; 3], [3.0, 0.0, 0.0], [0.0; 3]];
        assert_eq!(MODELS.map(|m| rate(m, shear)), [3.0, 0.0, 0.0]);
        let rotation = [[0.0, 2.0, 0.0], [-2.0, 0.0, 0.0], [0.0; 3]];
        let [smagorinsky, wale, sigma] = MODELS.map(|m| rate(m, rotation));
        assert_eq!([smagorinsky, sigma], [0.0; 2]);
        assert!((wale - 2.0 * (2.0_f64 / 3.0).powf(0.25)).abs() < 1e-14);
        // Nicoud et al. (2011), table 1: axisymmetric strain gives no σ, nor do two dimensions.
        let strained = [[2.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
        assert!((rate(EddyModel::Smagorinsky, strained) - 12.0_f64.sqrt()).abs() < 1e-14);
        assert!(rate(EddyModel::Sigma, strained).abs() < 1e-7);
        let plane = [[1.0, 0.7, 0.0], [-0.3, -1.0, 0.0], [0.0; 3]];
        assert_eq!(rate(EddyModel::Sigma, plane), 0.0);
        // Diagonal gradients are their own singular values.
        let diagonal = [[3.0, 0.0, 0.0], [0.0, -2.0, 0.0], [0.0, 0.0, 1.0]];
        assert!((rate(EddyModel::Sigma, diagonal) - 1.0 / 9.0).abs() < 1e-14);
        assert_eq!(MODELS.map(|m| rate(m, [[0.0; 3]; 3])), [0.0; 3]);
    }

    #[test]
    fn the_frame_does_not_matter() {
        let g = [[0.3, -1.2, 0.5], [0.8, 0.4, -0.6], [-0.2, 1.1, -0.7]];
        for model in MODELS {
            let whole = rate(model, g);
            let other = rate(model, turned(g, 0.7));
            assert!(
                whole > 0.0 && (other / whole - 1.0).abs() < 1e-12,
                "{model:?}"
            );
        }
    }

    /// The flow next to a wall: u = y(1 + x + z), v = −0.8y², w = y(0.5 + 0.6z), at x = z = 0.
    #[test]
    fn at_a_wall_it_falls_with_the_cube_of_the_distance() {
        let near = |y: f64| [[y, 0.0, 0.0], [1.0, -1.6 * y, 0.5], [y, 0.0, 0.6 * y]];
        for model in [EddyModel::Wale, EddyModel::Sigma] {
            let ratio = rate(model, near(1e-3)) / rate(model, near(0.5e-3));
            assert!((ratio / 8.0 - 1.0).abs() < 0.01, "{model:?}: {ratio}");
        }
        assert!(rate(EddyModel::Smagorinsky, near(1e-3)) > 1.0);
    }
}
