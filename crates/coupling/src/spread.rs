//! Spreading of forces and torques to the fluid: the exact adjoint of sampling.

use crate::CouplingError;
use crate::coupling::{Coupling, check_length};
use crate::rendezvous::vector;
use fibreflow_fibre::Reaction;
use fibreflow_mesh::jet::Lanes;
use fibreflow_parallel::Communicator;
use nalgebra::Vector3;

/// What one spread did, summed over ranks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpreadReport {
    /// Force that the fluid received, walls included \[N\].
    pub force: Vector3<f64>,
    /// Torque that the fluid received about the origin, taken at the points' own periodic images \[N·m\].
    pub torque: Vector3<f64>,
    /// Part of `force` that landed on no-slip nodes: the walls feel it, the fluid does not \[N\].
    pub on_walls: Vector3<f64>,
    /// Larger of the relative defects of force and torque against what the points gave: |ΔF|/Σ|F| and
    /// |ΔT|/Σ(|T| + h|F|) with h the size of an element.
    pub defect_relative: f64,
    /// Points held at the boundary because they were outside the domain.
    pub outside: usize,
}

impl Coupling {
    /// Adds the points' forces and torques to `body_force` \[N/m³\] (length total, owned entries are changed), where
    /// the last [`Coupling::sample`] found them. Collective. The exact adjoint of `sample`:
    ///
    /// f_i = w_i F + ½ T × ∇w_i, divided by the dual volume, so that ΣF, Σ(x × F + T) and the power F·u + T·½∇×u are
    /// kept to round-off.
    ///
    /// # Errors
    /// [`CouplingError::Length`] when the arrays do not fit the last sample or the mesh.
    pub fn spread(
        &mut self,
        reaction: &Reaction,
        body_force: &mut [[f64; 4]],
    ) -> Result<SpreadReport, CouplingError> {
        let points = self.points();
        check_length("reaction.force", reaction.force.len(), points)?;
        check_length("reaction.torque", reaction.torque.len(), points)?;
        check_length("body_force", body_force.len(), self.mesh.total())?;
        let communicator = self.communicator().clone();
        let mut sums = Sums::default();
        match self.gaussian.take() {
            None => self.spread_elements(reaction, &mut sums),
            Some(gaussian) => {
                sums.give_all(reaction, self.locator.scale());
                self.spread_gaussian(&gaussian, reaction, &mut sums);
                self.gaussian = Some(gaussian);
                sums.outside = self.outside() as f64;
            }
        }
        let (mut force, mut on_walls) = (Lanes::ZERO, Lanes::ZERO);
        let nodes = self.nodal.iter_mut().zip(&self.geometry.volumes);
        for (((total, volume), density), held) in nodes.zip(body_force).zip(&self.no_slip) {
            // The next spread starts from nothing.
            let total = Lanes::from(std::mem::take(total));
            force += total;
            *density = (Lanes::from(*density) + total * (1.0 / volume)).to_array();
            if *held {
                on_walls += total;
            }
        }
        (sums.force, sums.on_walls) = (vector(force), vector(on_walls));
        Ok(sums.report(&communicator))
    }
}

/// Sums of one spread on this rank.
#[derive(Default)]
pub(crate) struct Sums {
    force: Vector3<f64>,
    force_given: Vector3<f64>,
    pub torque: Vector3<f64>,
    pub torque_given: Vector3<f64>,
    pub torque_defect: Vector3<f64>,
    on_walls: Vector3<f64>,
    force_size: f64,
    torque_size: f64,
    pub outside: f64,
}

impl Sums {
    /// Adds what a point gives.
    #[inline(always)]
    pub fn give(&mut self, force: &Vector3<f64>, torque: &Vector3<f64>, scale: f64) {
        let size = force.norm();
        self.force_given += force;
        self.force_size += size;
        self.torque_size += torque.norm() + scale * size;
    }

    fn give_all(&mut self, reaction: &Reaction, scale: f64) {
        let points = reaction.force.iter().zip(&reaction.torque);
        points.for_each(|(force, torque)| self.give(force, torque, scale));
    }

    /// Adds what other points gave.
    pub fn add(&mut self, other: &Self) {
        self.force_given += other.force_given;
        self.torque_given += other.torque_given;
        self.force_size += other.force_size;
        self.torque_size += other.torque_size;
        self.outside += other.outside;
    }

    fn report(&self, communicator: &Communicator) -> SpreadReport {
        let vectors = [
            self.force,
            self.force_given,
            self.torque,
            self.torque_defect,
            self.on_walls,
            Vector3::new(self.force_size, self.torque_size, self.outside),
        ];
        let mut flat = vectors.map(<[f64; 3]>::from);
        communicator.sum_slice(flat.as_flattened_mut());
        let [force, force_given, torque, torque_defect, on_walls, sizes] = flat.map(Vector3::from);
        let relative = |defect: f64, size: f64| if size > 0.0 { defect / size } else { 0.0 };
        let of_force = relative((force - force_given).norm(), sizes.x);
        let of_torque = relative(torque_defect.norm(), sizes.y);
        SpreadReport {
            force,
            torque,
            on_walls,
            defect_relative: of_force.max(of_torque),
            outside: sizes.z as usize,
        }
    }
}
