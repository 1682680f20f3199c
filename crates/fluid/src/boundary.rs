//! Boundary conditions, compiled from patches to nodes.

use crate::FluidError;
use crate::settings::{dot, length};
use fibreflow_mesh::{BoundaryNode, DualGeometry, LocalMesh};
use std::sync::Arc;

/// What holds on a patch. On nodes of several patches the order is
/// resting wall > moving wall > inlet > slip > outlet.
#[derive(Clone, Debug)]
pub enum BoundaryCondition {
    /// No slip on a wall of constant velocity \[m/s\].
    Wall {
        /// Velocity of the wall; zero for a wall at rest.
        velocity: [f64; 3],
    },
    /// No flow through, no shear stress: a symmetry plane.
    Slip,
    /// Given velocity.
    Inlet {
        /// Velocity over the patch.
        profile: InletProfile,
    },
    /// Given pressure, no viscous stress; what flows back in brings no kinetic energy.
    Outlet {
        /// Pressure \[Pa\].
        pressure: f64,
    },
}

impl BoundaryCondition {
    /// Wall at rest.
    pub const WALL: Self = Self::Wall { velocity: [0.0; 3] };

    /// Velocity that it prescribes at a point, if it does.
    fn velocity(&self, x: [f64; 3]) -> Option<[f64; 3]> {
        match self {
            Self::Wall { velocity } => Some(*velocity),
            Self::Inlet { profile } => Some(profile.velocity(x)),
            Self::Slip | Self::Outlet { .. } => None,
        }
    }

    /// Which condition decides on a node of several patches: the smallest.
    fn rank(&self) -> usize {
        match self {
            Self::Wall { velocity } if *velocity == [0.0; 3] => 0,
            Self::Wall { .. } => 1,
            Self::Inlet { .. } => 2,
            Self::Slip => 3,
            Self::Outlet { .. } => 4,
        }
    }
}

/// Velocity over an inlet.
#[derive(Clone)]
pub enum InletProfile {
    /// The same everywhere \[m/s\].
    Uniform([f64; 3]),
    /// As a function of position \[m\], in m/s.
    Function(Arc<dyn Fn([f64; 3]) -> [f64; 3] + Send + Sync>),
}

impl InletProfile {
    /// Plane Poiseuille profile 6 ū s(1 − s), s = (x_axis − low)/(high − low), of mean velocity ū \[m/s\].
    pub fn parabolic(mean: [f64; 3], axis: usize, low: f64, high: f64) -> Self {
        Self::Function(Arc::new(move |x| {
            let s = (x[axis] - low) / (high - low);
            mean.map(|m| 6.0 * m * s * (1.0 - s))
        }))
    }

    fn velocity(&self, x: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Uniform(velocity) => *velocity,
            Self::Function(function) => function(x),
        }
    }
}

impl std::fmt::Debug for InletProfile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Uniform(velocity) => write!(f, "Uniform({velocity:?})"),
            Self::Function(_) => f.write_str("Function"),
        }
    }
}

/// A node whose velocity is not free: increments are multiplied by `projector`, zero where the velocity is given.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Constraint {
    pub node: u32,
    pub projector: [[f64; 3]; 3],
}

impl Constraint {
    /// P v.
    pub fn admit(&self, v: [f64; 4]) -> [f64; 4] {
        let row = |r: [f64; 3]| r[0] * v[0] + r[1] * v[1] + r[2] * v[2];
        [
            row(self.projector[0]),
            row(self.projector[1]),
            row(self.projector[2]),
            0.0,
        ]
    }
}

/// Flux through the boundary of a node's volume \[m³/s\].
#[derive(Clone, Copy, Debug)]
pub(crate) enum Through {
    /// Given by the boundary velocity.
    Given(f64),
    /// Whatever closes continuity.
    Open,
}

/// Boundary conditions by node of this rank, ascending.
#[derive(Clone, Debug)]
pub(crate) struct Boundary {
    /// Owned nodes whose velocity is fixed or confined to a plane or line.
    pub constraints: Vec<Constraint>,
    /// Velocity of fixed owned nodes \[m/s\].
    pub given: Vec<(u32, [f64; 3])>,
    /// Owned nodes with flow through the boundary.
    pub through: Vec<(u32, Through)>,
    /// Owned outlet nodes and their pressure \[Pa\].
    pub outlets: Vec<(u32, f64)>,
    /// Total length: nodes of given velocity.
    pub velocity_fixed: Vec<bool>,
    /// Total length: nodes of given pressure.
    pub pressure_fixed: Vec<bool>,
    /// No constraint on any rank.
    pub unconstrained: bool,
    /// Σ |u| |area| over the owned nodes of given velocity \[m³/s\]: the scale of what could flow through.
    reach: f64,
}

impl Boundary {
    pub fn new(
        mesh: &LocalMesh,
        geometry: &DualGeometry,
        conditions: &[BoundaryCondition],
    ) -> Result<Self, FluidError> {
        if conditions.len() != mesh.patches.len() {
            return Err(FluidError::Patches {
                found: conditions.len(),
                expected: mesh.patches.len(),
            });
        }
        let mut boundary = Self {
            constraints: Vec::new(),
            given: Vec::new(),
            through: Vec::new(),
            outlets: Vec::new(),
            velocity_fixed: vec![false; mesh.total()],
            pressure_fixed: vec![false; mesh.total()],
            unconstrained: true,
            reach: 0.0,
        };
        for shares in geometry.boundary.chunk_by(|a, b| a.node == b.node) {
            boundary.add_node(mesh, shares, conditions);
        }
        boundary.spread_marks(mesh);
        boundary.check_outlets(mesh, geometry, conditions)?;
        boundary.balance(mesh)?;
        let communicator = mesh.halo.communicator();
        boundary.unconstrained = !communicator.any(!boundary.constraints.is_empty());
        Ok(boundary)
    }

    fn add_node(
        &mut self,
        mesh: &LocalMesh,
        shares: &[BoundaryNode],
        conditions: &[BoundaryCondition],
    ) {
        let node = shares[0].node;
        let x = mesh.nodes[node as usize];
        let condition = |share: &BoundaryNode| &conditions[share.patch as usize];
        let Some(first) = shares.iter().min_by_key(|s| condition(s).rank()) else {
            return;
        };
        if let Some(velocity) = condition(first).velocity(x) {
            self.given.push((node, velocity));
            self.velocity_fixed[node as usize] = true;
            self.constraints.push(Constraint {
                node,
                projector: [[0.0; 3]; 3],
            });
            // Only patches that prescribe the same velocity let it through.
            let agrees = |s: &&BoundaryNode| condition(s).velocity(x) == Some(velocity);
            let fluxes = shares.iter().filter(agrees).map(|s| dot(velocity, s.area));
            let flux: f64 = fluxes.sum();
            if flux != 0.0 {
                self.through.push((node, Through::Given(flux)));
            }
            self.reach += shares
                .iter()
                .map(|s| length(velocity) * length(s.area))
                .sum::<f64>();
            return;
        }
        if let Some(projector) =
            slip_projector(shares, |s| matches!(condition(s), BoundaryCondition::Slip))
        {
            self.constraints.push(Constraint { node, projector });
        }
        // An outlet beside a slip plane still lets flow out through its own share.
        let pressure = shares.iter().find_map(|s| match condition(s) {
            BoundaryCondition::Outlet { pressure } => Some(*pressure),
            _ => None,
        });
        if let Some(pressure) = pressure {
            self.outlets.push((node, pressure));
            self.pressure_fixed[node as usize] = true;
            self.through.push((node, Through::Open));
        }
    }

    /// Marks of halo nodes from their owners.
    fn spread_marks(&mut self, mesh: &LocalMesh) {
        let pairs = self.velocity_fixed.iter().zip(&self.pressure_fixed);
        let mut marks: Vec<u8> = pairs
            .map(|(&v, &p)| u8::from(v) | u8::from(p) << 1)
            .collect();
        mesh.halo.update(&mut marks);
        for (i, mark) in marks.into_iter().enumerate() {
            self.velocity_fixed[i] = mark & 1 != 0;
            self.pressure_fixed[i] = mark & 2 != 0;
        }
    }

    fn check_outlets(
        &self,
        mesh: &LocalMesh,
        geometry: &DualGeometry,
        conditions: &[BoundaryCondition],
    ) -> Result<(), FluidError> {
        for (patch, condition) in conditions.iter().enumerate() {
            if !matches!(condition, BoundaryCondition::Outlet { .. }) {
                continue;
            }
            let mut nodes = geometry
                .boundary
                .iter()
                .filter(|s| s.patch as usize == patch);
            let own = nodes.any(|s| self.pressure_fixed[s.node as usize]);
            if !mesh.halo.communicator().any(own) {
                return Err(FluidError::EmptyOutlet {
                    patch: mesh.patches[patch].clone(),
                });
            }
        }
        Ok(())
    }

    /// Without an outlet the given fluxes must sum to zero, or the pressure equation has no answer: quadrature error
    /// is taken from all of them in proportion; more than that is refused.
    fn balance(&mut self, mesh: &LocalMesh) -> Result<(), FluidError> {
        let communicator = mesh.halo.communicator();
        if communicator.any(!self.outlets.is_empty()) {
            return Ok(());
        }
        // Twice: the second pass takes out the round-off of the first.
        for _ in 0..2 {
            let mut sums = [0.0, 0.0, self.reach];
            for (_, through) in &self.through {
                if let Through::Given(flux) = through {
                    sums[0] += flux;
                    sums[1] += flux.abs();
                }
            }
            communicator.sum_slice(&mut sums);
            let [net, total, reach] = sums;
            if net.abs() > 0.02 * reach {
                return Err(FluidError::UnbalancedFlux { net, total: reach });
            }
            for (_, through) in &mut self.through {
                if let Through::Given(flux) = through {
                    *flux -= net * (flux.abs() / total);
                }
            }
        }
        Ok(())
    }
}

/// I − Σ n nᵀ over the distinct normals of a node's slip patches; None without any.
///
/// Normals within 20° of the plane spanned so far count as the same surface, curved.
fn slip_projector(
    shares: &[BoundaryNode],
    is_slip: impl Fn(&BoundaryNode) -> bool,
) -> Option<[[f64; 3]; 3]> {
    const SAME_SURFACE: f64 = 0.34;
    let mut projector = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut normals = 0;
    for share in shares.iter().filter(|s| is_slip(s)) {
        let size = length(share.area);
        if size == 0.0 {
            continue;
        }
        let normal = share.area.map(|a| a / size);
        let rest = projector.map(|row| dot(row, normal));
        let left = length(rest);
        if left < SAME_SURFACE {
            continue;
        }
        let direction = rest.map(|r| r / left);
        for (row, a) in projector.iter_mut().zip(direction) {
            row.iter_mut().zip(direction).for_each(|(p, b)| *p -= a * b);
        }
        normals += 1;
    }
    (normals > 0).then_some(projector)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share(area: [f64; 3]) -> BoundaryNode {
        BoundaryNode {
            node: 0,
            patch: 0,
            area,
        }
    }

    #[test]
    fn slip_corner_leaves_the_edge_direction() {
        let shares = [share([0.0, -2.0, 0.0]), share([0.0, 0.0, 3.0])];
        let projector = slip_projector(&shares, |_| true).expect("two normals");
        let constraint = Constraint { node: 0, projector };
        assert_eq!(constraint.admit([1.0, 2.0, 3.0, 0.0]), [1.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn nearly_parallel_shares_are_one_surface() {
        let shares = [share([0.0, -2.0, 0.0]), share([0.2, -2.0, 0.0])];
        let projector = slip_projector(&shares, |_| true).expect("one normal");
        let constraint = Constraint { node: 0, projector };
        assert_eq!(constraint.admit([1.0, 2.0, 3.0, 0.0]), [1.0, 0.0, 3.0, 0.0]);
    }

    #[test]
    fn without_slip_patches_nothing_is_projected() {
        assert!(slip_projector(&[share([1.0, 0.0, 0.0])], |_| false).is_none());
    }
}
