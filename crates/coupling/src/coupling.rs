//! Sampling of the flow at fibre points and its adjoint, spreading of their forces and torques.

use crate::gaussian::Gaussian;
use crate::locate::Locator;
use crate::rendezvous::{Motion, Rendezvous};
use crate::{CouplingError, Kernel};
use fibreflow_fibre::{Ambient, Points};
use fibreflow_mesh::{DualGeometry, LocalMesh};
use fibreflow_parallel::Communicator;
use nalgebra::Vector3;
use std::sync::Arc;

/// Couples points that any rank owns to the fluid nodes of all ranks, by the weights of a [`Kernel`].
///
/// Points may lie anywhere in periodic directions (unwrapped). A point outside the domain is held at the nearest
/// place of its boundary and counted.
pub struct Coupling {
    pub(crate) mesh: Arc<LocalMesh>,
    pub(crate) geometry: Arc<DualGeometry>,
    pub(crate) locator: Locator,
    pub(crate) rendezvous: Rendezvous,
    /// None where the kernel is one element.
    pub(crate) gaussian: Option<Gaussian>,
    /// Points in pairs share a place.
    pub(crate) paired: bool,
    pub(crate) no_slip: Vec<bool>,
    /// Force by node \[N\], length `mesh.total()`.
    pub(crate) nodal: Vec<[f64; 4]>,
}

/// What is sampled, by node with valid halo.
pub(crate) struct Fields<'a> {
    /// \[m/s\]
    pub velocity: &'a [[f64; 4]],
    /// Change of the velocity in a step \[m/s\].
    pub change: Option<&'a [[f64; 4]]>,
}

impl Coupling {
    /// With the kernel [`Kernel::Element`]. `no_slip` marks the owned nodes whose velocity is given: force that lands
    /// there is wall force. Collective.
    ///
    /// # Errors
    /// [`CouplingError::Length`] when `no_slip` does not have one entry for each owned node.
    pub fn new(
        mesh: Arc<LocalMesh>,
        geometry: Arc<DualGeometry>,
        no_slip: Vec<bool>,
    ) -> Result<Self, CouplingError> {
        Self::with_kernel(mesh, geometry, no_slip, Kernel::Element)
    }

    /// As [`Coupling::new`], with any kernel. Collective.
    ///
    /// # Errors
    /// As [`Coupling::new`]; [`CouplingError::Width`].
    pub fn with_kernel(
        mesh: Arc<LocalMesh>,
        geometry: Arc<DualGeometry>,
        no_slip: Vec<bool>,
        kernel: Kernel,
    ) -> Result<Self, CouplingError> {
        check_length("no_slip", no_slip.len(), mesh.owned())?;
        let locator = Locator::new(mesh.clone(), geometry.total_volume);
        let rendezvous = Rendezvous::new(
            mesh.halo.communicator(),
            locator.lattice().clone(),
            locator.owned_bounds(),
            locator.scale(),
        );
        kernel.check(locator.lattice().reach())?;
        let gaussian = kernel
            .width()
            .map(|width| Gaussian::new(&mesh, &geometry, locator.lattice().clone(), width));
        Ok(Self {
            gaussian,
            paired: kernel == Kernel::Middle,
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
    /// u = Σ w_i u_i, ∂u_a/∂x_b = Σ u_i,a ∂w_i/∂x_b with the weights of the kernel.
    ///
    /// # Errors
    /// [`CouplingError::NotFinite`] for a point at no finite position and [`CouplingError::Unresolved`] for one with too
    /// few nodes ([`CouplingError::OtherRank`] on the other ranks), [`CouplingError::Length`] for a velocity of the wrong
    /// length.
    pub fn sample(
        &mut self,
        velocity: &[[f64; 4]],
        points: &[Vector3<f64>],
        ambient: &mut Ambient,
    ) -> Result<(), CouplingError> {
        let change = None;
        self.sample_fields(&Fields { velocity, change }, points, ambient)
    }

    /// As [`Coupling::sample`], and the `change` of the velocity \[m/s\] at the points into [`Ambient::change`].
    /// Collective.
    ///
    /// # Errors
    /// As [`Coupling::sample`].
    pub fn sample_changing(
        &mut self,
        velocity: &[[f64; 4]],
        change: &[[f64; 4]],
        points: &[Vector3<f64>],
        ambient: &mut Ambient,
    ) -> Result<(), CouplingError> {
        check_length("change", change.len(), self.mesh.total())?;
        let change = Some(change);
        self.sample_fields(&Fields { velocity, change }, points, ambient)
    }

    /// What `points` in the middle of a step of `dt` \[s\] meet of a flow that changes by `slope` \[m/s²\], as
    /// [`Ambient::met`] says, into [`Ambient::velocity`] at its end and [`Ambient::change`]; into [`Ambient::travel`] where
    /// `travels`. Collective.
    ///
    /// # Errors
    /// As [`Coupling::sample`].
    pub fn sample_met(
        &mut self,
        velocity: &[[f64; 4]],
        slope: Option<&[[f64; 4]]>,
        points: &Points,
        dt: f64,
        travels: bool,
        ambient: &mut Ambient,
    ) -> Result<(), CouplingError> {
        let fields = Fields {
            velocity,
            change: slope,
        };
        check_length("velocity", velocity.len(), self.mesh.total())?;
        check_length("slope", slope.unwrap_or(velocity).len(), self.mesh.total())?;
        let (positions, speeds) = (&points.position, &points.velocity);
        check_length("points.velocity", speeds.len(), positions.len())?;
        if self.gaussian.is_none() {
            let motion = Some(Motion {
                speeds,
                dt,
                travels,
            });
            return self.sample_elements(&fields, positions, motion, ambient);
        }
        self.sample_fields(&fields, positions, ambient)?;
        ambient.meet(speeds, dt);
        Ok(())
    }

    fn sample_fields(
        &mut self,
        fields: &Fields<'_>,
        points: &[Vector3<f64>],
        ambient: &mut Ambient,
    ) -> Result<(), CouplingError> {
        check_length("velocity", fields.velocity.len(), self.mesh.total())?;
        match self.gaussian.take() {
            None => self.sample_elements(fields, points, None, ambient),
            Some(mut gaussian) => {
                let sampled = self.sample_gaussian(&mut gaussian, fields, points, ambient);
                self.gaussian = Some(gaussian);
                sampled
            }
        }
    }

    /// Forgets where points were: to be called when the list of points changed, as by migration. Without it answers
    /// are the same but slower.
    pub fn forget(&mut self) {
        self.rendezvous.placements.clear();
    }

    /// Points of this rank that the last sample found outside the domain.
    pub fn outside(&self) -> usize {
        let limit = self.beyond();
        let points = 0..self.points();
        points
            .filter(|&p| self.rendezvous.distance(self.place(p)) > limit)
            .count()
    }

    /// Distance from the domain beyond which points are outside \[m\].
    pub(crate) fn beyond(&self) -> f64 {
        1e-6 * self.locator.scale()
    }

    /// Typical size of an element \[m\].
    pub fn spacing(&self) -> f64 {
        self.locator.scale()
    }

    /// Rank that holds the element around each point of this rank, from the last sample.
    pub fn hosts(&self) -> impl ExactSizeIterator<Item = u32> + '_ {
        (0..self.points()).map(|p| self.rendezvous.placements[self.place(p)].rank)
    }

    /// Points of the last sample.
    pub(crate) fn points(&self) -> usize {
        self.rendezvous.placements.len() * self.sharing()
    }

    /// Place of a point.
    fn place(&self, point: usize) -> usize {
        point / self.sharing()
    }

    /// Points that share a place.
    fn sharing(&self) -> usize {
        if self.paired { 2 } else { 1 }
    }

    pub(crate) fn communicator(&self) -> &Communicator {
        self.mesh.halo.communicator()
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
