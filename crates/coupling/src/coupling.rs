//! Sampling of the flow at fibre points and its adjoint, spreading of their forces and torques.

use crate::CouplingError;
use crate::locate::{Location, Locator};
use crate::rendezvous::{Query, Rendezvous, Reply, UNKNOWN};
use bytemuck::Zeroable;
use fibreflow_fibre::Ambient;
use fibreflow_mesh::{DualGeometry, LocalMesh, shape};
use fibreflow_parallel::Communicator;
use nalgebra::{Matrix3, Vector3};
use std::sync::Arc;

/// Couples points that any rank owns to the fluid nodes of all ranks, with element shape functions (K 3.63–3.66).
///
/// Points may lie anywhere in periodic directions (unwrapped). A point outside the domain is held at the nearest
/// place of its boundary and counted.
pub struct Coupling {
    pub(crate) mesh: Arc<LocalMesh>,
    pub(crate) geometry: Arc<DualGeometry>,
    pub(crate) locator: Locator,
    pub(crate) rendezvous: Rendezvous,
    pub(crate) no_slip: Vec<bool>,
    /// Force by node \[N\], length `mesh.total()`.
    pub(crate) nodal: Vec<[f64; 4]>,
}

impl Coupling {
    /// `no_slip` marks the owned nodes whose velocity is given: force that lands there is wall force. Collective.
    ///
    /// # Errors
    /// [`CouplingError::Length`] when `no_slip` does not have one entry for each owned node.
    pub fn new(
        mesh: Arc<LocalMesh>,
        geometry: Arc<DualGeometry>,
        no_slip: Vec<bool>,
    ) -> Result<Self, CouplingError> {
        check_length("no_slip", no_slip.len(), mesh.owned())?;
        let locator = Locator::new(mesh.clone(), geometry.total_volume);
        let rendezvous = Rendezvous::new(
            mesh.halo.communicator(),
            locator.lattice().clone(),
            locator.owned_bounds(),
            locator.scale(),
        );
        Ok(Self {
            nodal: vec![[0.0; 4]; mesh.total()],
            mesh,
            geometry,
            locator,
            rendezvous,
            no_slip,
        })
    }

    /// Velocity and its gradient at `points` \[m\], from nodal `velocity` \[m/s\] with valid halo. Collective.
    ///
    /// u = Σ N_i u_i, ∂u_a/∂x_b = Σ u_i,a ∂N_i/∂x_b with the shape functions of the element around the point.
    ///
    /// # Errors
    /// [`CouplingError::NotFinite`] for a point at no finite position ([`CouplingError::OtherRank`] on the other
    /// ranks), [`CouplingError::Length`] for a velocity of the wrong length.
    pub fn sample(
        &mut self,
        velocity: &[[f64; 4]],
        points: &[Vector3<f64>],
        ambient: &mut Ambient,
    ) -> Result<(), CouplingError> {
        check_length("velocity", velocity.len(), self.mesh.total())?;
        let (mesh, locator) = (&self.mesh, &self.locator);
        let answer = |query: &Query| {
            let hint = (query.element != UNKNOWN).then_some((query.element, query.shift));
            match locator.find(&query.position.into(), hint) {
                Some(location) => interpolate(mesh, locator, velocity, &location),
                None => nothing_here(),
            }
        };
        let replies = self.rendezvous.place(points, answer)?;
        ambient.velocity.clear();
        ambient.gradient.clear();
        for reply in &replies {
            ambient.velocity.push(reply.velocity.into());
            let g = &reply.gradient;
            ambient.gradient.push(Matrix3::from_fn(|i, j| g[i][j]));
        }
        Ok(())
    }

    /// Forgets where points were: to be called when the list of points changed, as by migration. Without it answers
    /// are the same but slower.
    pub fn forget(&mut self) {
        self.rendezvous.placements.clear();
    }

    /// Points of this rank that the last sample found outside the domain.
    pub fn outside(&self) -> usize {
        let limit = 1e-6 * self.locator.scale();
        let places = self.rendezvous.placements.iter();
        places.filter(|p| p.distance > limit).count()
    }

    /// Rank that holds the element around each point of this rank, from the last sample.
    pub fn hosts(&self) -> impl ExactSizeIterator<Item = u32> + '_ {
        self.rendezvous.placements.iter().map(|p| p.rank)
    }

    pub(crate) fn communicator(&self) -> &Communicator {
        self.mesh.halo.communicator()
    }
}

fn interpolate(
    mesh: &LocalMesh,
    locator: &Locator,
    velocity: &[[f64; 4]],
    location: &Location,
) -> Reply {
    let element = location.element as usize;
    let kind = mesh.elements.kinds[element];
    let weights = shape::physical(kind, &locator.coordinates(element), location.reference);
    let mut u = [0.0; 3];
    let mut gradient = [[0.0; 3]; 3];
    for (v, &node) in mesh.elements.nodes(element).iter().enumerate() {
        let nodal = velocity[node as usize];
        for i in 0..3 {
            u[i] += weights.n[v] * nodal[i];
            for j in 0..3 {
                gradient[i][j] += nodal[i] * weights.gradient[v][j];
            }
        }
    }
    Reply {
        velocity: u,
        gradient,
        reference: location.reference,
        distance: location.distance,
        global_element: mesh.global_elements[element],
        shift: location.shift,
        element: location.element,
        certain: location.certain.into(),
    }
}

/// The answer of a rank without elements: any other is better.
fn nothing_here() -> Reply {
    Reply {
        distance: f64::INFINITY,
        global_element: u64::MAX,
        element: UNKNOWN,
        ..Reply::zeroed()
    }
}

pub(crate) fn check_length(
    what: &'static str,
    found: usize,
    expected: usize,
) -> Result<(), CouplingError> {
    if found == expected {
        return Ok(());
    }
    Err(CouplingError::Length {
        what,
        found,
        expected,
    })
}
