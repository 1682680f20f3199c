//! Convective outlets: ∂u/∂t + U_c ∂u/∂n = 0 on their nodes (K p. 49), corrected so that what comes in leaves.
//!
//! ∂u/∂n = Σ_j c_j (u_b − u_j) is n·Gu, the conserving gradient on the inner side: its weights are those with which the
//! fluxes between nodes carry u to the outlet, so that the outlet takes kinetic energy and gives none (weights by distance
//! alone blew up in the corners of tetrahedra). U_c is the mean speed through the patch, and held below what the step can
//! bear. No flow comes back: the normal velocity is cut off at zero before the correction.

use super::{Boundary, BoundaryCondition, GivenFlux, Through, slip_projector};
use crate::settings::{cross, dot, length};
use fibreflow_mesh::{BoundaryNode, DualGeometry, LocalMesh};

/// Largest U_c Σc Δt; the Runge–Kutta scheme bears 2.5.
const STABLE: f64 = 1.2;
/// Share of the flow that must leave already for the correction to be a factor; otherwise it is the same speed everywhere.
const SHARE: f64 = 0.5;
/// Added to the diagonal of the fit by its trace, for directions without neighbours.
const SINGLE: f64 = 1e-10;

/// A node of a convective outlet.
#[derive(Clone, Debug)]
pub(super) struct OutflowNode {
    /// Where in [`Boundary::given`] and in [`Boundary::through`].
    given: usize,
    through: usize,
    /// Which of the convective patches.
    patch: usize,
    area: [f64; 3],
    normal: [f64; 3],
    /// Takes out what slip planes forbid.
    projector: Option<[[f64; 3]; 3]>,
    /// (j, c_j).
    stencil: Vec<(u32, f64)>,
    /// −U_c ∂u/∂n of the newest sub-step \[m/s²\].
    rate: [f64; 3],
}

/// A convective patch.
#[derive(Clone, Debug)]
pub(super) struct OutflowPatch {
    pub index: u16,
    /// U_c \[m/s\], given or found.
    given_speed: Option<f64>,
    speed: f64,
}

impl Boundary {
    pub(super) fn list_outflow_patches(&mut self) {
        for (index, condition) in self.conditions.iter().enumerate() {
            if let BoundaryCondition::ConvectiveOutlet { speed } = condition {
                self.outflow_patches.push(OutflowPatch {
                    index: index as u16,
                    given_speed: *speed,
                    speed: speed.unwrap_or(0.0),
                });
                self.outflow_sums.extend([0.0; 2]);
            }
        }
    }

    /// Adds a node that `patch` decides on; velocity comes with the initial field.
    pub(super) fn add_outflow(
        &mut self,
        geometry: &DualGeometry,
        patch: u16,
        shares: &[BoundaryNode],
    ) {
        let node = shares[0].node;
        let Some(own) = shares.iter().find(|s| s.patch == patch) else {
            return;
        };
        let size = length(own.area);
        let normal = own.area.map(|a| a / size.max(f64::MIN_POSITIVE));
        let is_slip =
            |s: &BoundaryNode| matches!(self.conditions[s.patch as usize], BoundaryCondition::Slip);
        let projector = slip_projector(shares, is_slip);
        let patches = &self.outflow_patches;
        let position = patches.iter().position(|p| p.index == patch);
        self.velocity_fixed[node as usize] = true;
        self.constraints.push(super::Constraint {
            node,
            projector: [[0.0; 3]; 3],
        });
        self.spans.push(shares.iter().map(|s| length(s.area)).sum());
        self.given.push((node, [0.0; 3]));
        self.through
            .push((node, Through::Given(GivenFlux::default())));
        self.outflow.push(OutflowNode {
            given: self.given.len() - 1,
            through: self.through.len() - 1,
            patch: position.unwrap_or(0),
            area: own.area,
            normal,
            projector,
            stencil: stencil(geometry, node, normal, shares.len() == 1),
            rate: [0.0; 3],
        });
    }

    /// Marks (total length) of nodes whose velocity is given beforehand and does not follow from the flow. Collective.
    pub fn prescribed(&self, mesh: &LocalMesh) -> Vec<bool> {
        let mut marks: Vec<u8> = self.velocity_fixed.iter().map(|&f| u8::from(f)).collect();
        for node in &self.outflow {
            marks[self.given[node.given].0 as usize] = 0;
        }
        mesh.halo.update(&mut marks);
        marks.into_iter().map(|mark| mark > 0).collect()
    }

    /// This rank has a node of the patch that is a convective outlet.
    pub(super) fn has_outflow(&self, patch: usize) -> bool {
        let index = |node: &OutflowNode| self.outflow_patches[node.patch].index;
        self.outflow.iter().any(|n| index(n) as usize == patch)
    }

    /// Velocities of the outlets from a field, as at the start.
    pub(super) fn start_outflow(&mut self, velocity: &[[f64; 4]]) {
        for node in &self.outflow {
            let given = &mut self.given[node.given];
            let [x, y, z, _] = velocity[given.0 as usize];
            given.1 = node.admitted([x, y, z]);
        }
        self.correct_outflow();
    }

    /// Mean speed through every convective patch, from the flow at the end of the last step. Collective.
    pub(super) fn find_speeds(&mut self) {
        if self.outflow_patches.is_empty() {
            return;
        }
        let sums = &mut self.outflow_sums;
        sums.fill(0.0);
        for node in &self.outflow {
            if let Through::Given(flux) = self.through[node.through].1 {
                sums[2 * node.patch] += flux.end;
                sums[2 * node.patch + 1] += length(node.area);
            }
        }
        self.communicator.sum_slice(sums);
        for (patch, sums) in self.outflow_patches.iter_mut().zip(sums.chunks(2)) {
            let mean = (sums[0] / sums[1].max(f64::MIN_POSITIVE)).max(0.0);
            patch.speed = patch.given_speed.unwrap_or(mean);
        }
    }

    /// One sub-step of the outlets, of weights γ Δt and ζ Δt, from a velocity whose halo is valid. Collective.
    pub fn convect_outflow(&mut self, velocity: &[[f64; 4]], dt: f64, [gamma, zeta]: [f64; 2]) {
        if self.outflow_patches.is_empty() {
            return;
        }
        for node in &mut self.outflow {
            let (i, given) = &mut self.given[node.given];
            let own = velocity[*i as usize];
            let total: f64 = node.stencil.iter().map(|(_, c)| c.abs()).sum();
            let limit = STABLE / (total * dt).max(f64::MIN_POSITIVE);
            let speed = self.outflow_patches[node.patch].speed.min(limit);
            let mut rate = [0.0; 3];
            for &(j, c) in &node.stencil {
                let other = velocity[j as usize];
                (0..3).for_each(|k| rate[k] -= speed * c * (own[k] - other[k]));
            }
            let old = std::mem::replace(&mut node.rate, rate);
            let moved = [0, 1, 2].map(|k| given[k] + dt * (gamma * rate[k] + zeta * old[k]));
            let admitted = node.admitted(moved);
            let shift = &mut self.shift[node.given];
            (0..3).for_each(|k| shift[k] = admitted[k] - given[k]);
            *given = admitted;
        }
        self.correct_outflow();
    }

    /// Makes what leaves through the convective outlets what comes in elsewhere, unless a pressure outlet does. Collective.
    pub(super) fn correct_outflow(&mut self) {
        if self.outflow_patches.is_empty() {
            return;
        }
        let mut sums = [0.0; 3];
        for (_, through) in &self.through {
            if let Through::Given(flux) = through {
                sums[0] -= flux.end;
            }
        }
        for node in &self.outflow {
            if let Through::Given(flux) = &mut self.through[node.through].1 {
                sums[0] += flux.end;
            }
            sums[1] += dot(self.given[node.given].1, node.area);
            sums[2] += length(node.area);
        }
        self.communicator.sum_slice(&mut sums);
        let [wanted, found, area] = sums;
        let scaled = found > SHARE * wanted && found > 0.0;
        for node in &self.outflow {
            let velocity = &mut self.given[node.given].1;
            let change = if self.open {
                0.0
            } else if scaled {
                (wanted / found - 1.0) * dot(*velocity, node.normal)
            } else {
                (wanted - found) / area
            };
            for k in 0..3 {
                velocity[k] += change * node.normal[k];
                self.shift[node.given][k] += change * node.normal[k];
            }
            if let Through::Given(flux) = &mut self.through[node.through].1 {
                flux.end = dot(*velocity, node.area);
            }
        }
    }

    /// Velocities of the outlets from a stored field.
    pub(super) fn restore_outflow(&mut self, velocity: &[[f64; 4]]) {
        for node in &self.outflow {
            let (i, given) = &mut self.given[node.given];
            let [x, y, z, _] = velocity[*i as usize];
            *given = [x, y, z];
        }
    }
}

impl OutflowNode {
    /// Along slip planes, and not inwards.
    fn admitted(&self, velocity: [f64; 3]) -> [f64; 3] {
        let velocity = match self.projector {
            Some(projector) => projector.map(|row| dot(row, velocity)),
            None => velocity,
        };
        let inwards = dot(velocity, self.normal).min(0.0);
        [0, 1, 2].map(|k| velocity[k] - inwards * self.normal[k])
    }
}

/// (j, c_j = −½ n·S_bj/V), and on nodes of the outlet alone the smallest change of it that makes it exact for linear u:
/// −e·M⁻¹ d_j/|d_j|² with e = Σ c_j d_j + n and M = Σ d_j d_jᵀ/|d_j|².
fn stencil(geometry: &DualGeometry, node: u32, normal: [f64; 3], alone: bool) -> Vec<(u32, f64)> {
    let row = geometry.row(node as usize);
    let scale = -0.5 / geometry.volumes[node as usize];
    let columns = &geometry.columns[row.clone()];
    let (faces, distances) = (&geometry.faces[row.clone()], &geometry.displacements[row]);
    let weight = |s: &[f64; 4]| scale * (s[0] * normal[0] + s[1] * normal[1] + s[2] * normal[2]);
    let (mut error, mut matrix) = (normal, [[0.0; 3]; 3]);
    for (s, d) in faces.iter().zip(distances) {
        (0..3).for_each(|k| error[k] += weight(s) * d[k]);
        for (row, a) in matrix.iter_mut().zip(d) {
            (0..3).for_each(|k| row[k] += a * d[k] / dot(*d, *d));
        }
    }
    let trace = matrix[0][0] + matrix[1][1] + matrix[2][2];
    (0..3).for_each(|k| matrix[k][k] += SINGLE * trace);
    let [p, q, r] = matrix;
    let cofactors = [cross(q, r), cross(r, p), cross(p, q)];
    let determinant = dot(p, cofactors[0]);
    // M is symmetric.
    let slope = cofactors.map(|c| dot(c, error) / determinant);
    let change = |d: &[f64; 3]| {
        if alone {
            -dot(slope, *d) / dot(*d, *d)
        } else {
            0.0
        }
    };
    let entries = columns.iter().zip(faces.iter().zip(distances));
    entries
        .map(|(&j, (s, d))| (j, weight(s) + change(d)))
        .collect()
}
