//! Rigid bodies of smooth profile inside the Stokes solve (NUMERICS section 6; after the smooth-profile method, L 2.5).
//!
//! A body k has the weights s_i = φ_k(x_i) V_i. What of the flow is not rigid in it is resisted, as in a porous medium of permeability ℓ²:
//!
//! ```text
//! V s u − ν V L u + V G p + Σ_k κ s_i (u_i − P_k u) = …,   κ = ν/ℓ²
//! ```
//!
//! where P_k u = V_k + Ω_k × (x − x_k) is the rigid motion nearest to u with these weights. κ s (1 − P_k) is symmetric and not negative, and
//! exchanges neither force nor torque with the flow: a free body moves with V_k, Ω_k. A force and torque on it enter as s_i (a + α × (x_i − x_k)),
//! the transpose of P_k; links make them depend on the motions themselves, as beams do over an implicit step. Of a body of given motion the whole of κ s (u − V − Ω × …) stays, and is the force that moves it.

use super::modes::{self, BodyModes};
use crate::{Fluid, FluidError};
use fibreflow_parallel::Communicator;
use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector3};
use std::sync::Arc;

/// Radius of gyration by ℓ beyond which the preconditioner sees bodies as porous media: below, that costs iterations.
const POROUS: f64 = 4.5;

/// How a body moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BodyMotion {
    /// With the flow, under a force \[N\] and a torque about its centre \[N·m\].
    Free {
        /// Force \[N\].
        force: [f64; 3],
        /// Torque about the centre \[N·m\].
        torque: [f64; 3],
    },
    /// As given, whatever force that takes.
    Given {
        /// Velocity of the centre \[m/s\].
        velocity: [f64; 3],
        /// Angular velocity \[rad/s\].
        spin: [f64; 3],
    },
}

/// Motion of a body, and what flow and capillarity do to it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodyState {
    /// Velocity of the centre \[m/s\].
    pub velocity: [f64; 3],
    /// Angular velocity \[rad/s\].
    pub spin: [f64; 3],
    /// Force of the fluid on it \[N\]: minus the force that it is under, or is moved by.
    pub force: [f64; 3],
    /// Torque of the fluid about its centre \[N·m\].
    pub torque: [f64; 3],
}

/// The part of a body that lies in the nodes of a rank.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyPart {
    /// Owned nodes.
    pub nodes: Vec<u32>,
    /// φ there.
    pub profile: Vec<f64>,
    /// From the centre to them \[m\].
    pub arms: Vec<[f64; 3]>,
}

impl BodyPart {
    /// Node, profile and arm.
    pub(super) fn entries(&self) -> impl Iterator<Item = ((&u32, &f64), &[f64; 3])> {
        self.nodes.iter().zip(&self.profile).zip(&self.arms)
    }
}

/// A force that grows with the motion of two bodies: over a step of Δt a beam of stiffness K between them resists with Δt K.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyLink {
    /// Which two.
    pub bodies: [usize; 2],
    /// Minus the force and torque on the first and on the second body, by the velocity and spin of the first and of the second
    /// \[N·s/m, N·s, N·m·s\].
    pub resistance: SMatrix<f64, 12, 12>,
}

/// What a body is over all ranks.
struct Moments {
    /// Σ s \[m³\].
    volume: f64,
    /// From the centre to the centroid x_k \[m\].
    shift: Vector3<f64>,
    /// Inverse of Σ s (|r|² − r rᵀ) about the centroid \[1/m⁵\].
    inverse: Matrix3<f64>,
}

/// Velocity and spin, or force and torque.
type Motion = SVector<f64, 6>;

pub(super) struct Bodies {
    /// κ \[1/s\].
    resistance: f64,
    density: f64,
    links: Vec<BodyLink>,
    /// Profiles times volumes.
    parts: Arc<Vec<BodyPart>>,
    motions: Vec<BodyMotion>,
    moments: Vec<Moments>,
    /// Σ s u and Σ s r × u of every body.
    sums: Vec<f64>,
    /// Directions in which bodies have an extent, and their mean radius of gyration \[m\].
    axes: Vec<usize>,
    scale: f64,
}

impl Bodies {
    /// Collective; every rank names the same bodies in the same order.
    fn new(
        [resistance, density]: [f64; 2],
        mut parts: Vec<BodyPart>,
        motions: Vec<BodyMotion>,
        links: Vec<BodyLink>,
        volumes: &[f64],
        communicator: &Communicator,
    ) -> Self {
        let mut sums = vec![0.0; 10 * parts.len()];
        for (part, sums) in parts.iter_mut().zip(sums.chunks_exact_mut(10)) {
            for ((&i, share), arm) in part.nodes.iter().zip(&mut part.profile).zip(&part.arms) {
                *share *= volumes[i as usize];
                let [x, y, z] = *arm;
                let terms = [1.0, x, y, z, x * x, y * y, z * z, x * y, x * z, y * z];
                sums.iter_mut()
                    .zip(terms)
                    .for_each(|(sum, t)| *sum += *share * t);
            }
        }
        communicator.sum_slice(&mut sums);
        let of_all: [f64; 10] =
            std::array::from_fn(|t| sums.chunks_exact(10).map(|sums| sums[t]).sum());
        let moments: Vec<Moments> = sums.chunks_exact(10).map(Moments::of).collect();
        for (part, moments) in parts.iter_mut().zip(&moments) {
            for arm in &mut part.arms {
                *arm = (Vector3::from(*arm) - moments.shift).into();
            }
        }
        Self {
            resistance,
            density,
            links,
            sums: vec![0.0; 6 * parts.len()],
            parts: Arc::new(parts),
            motions,
            moments,
            axes: (0..3).filter(|c| of_all[4 + c] > 0.0).collect(),
            scale: (of_all[4..7].iter().sum::<f64>() / of_all[0]).sqrt(),
        }
    }

    /// Directions in which bodies have an extent, and their mean radius of gyration \[m\].
    pub fn extent(&self) -> (Vec<usize>, f64) {
        (self.axes.clone(), self.scale)
    }

    /// Profiles times volumes.
    pub fn shared_parts(&self) -> Arc<Vec<BodyPart>> {
        Arc::clone(&self.parts)
    }

    /// Q of `modes`: what bodies and links resist by the moments Φᵀu. Collective.
    pub fn resistance_of_modes(
        &self,
        modes: &BodyModes,
        communicator: &Communicator,
    ) -> DMatrix<f64> {
        let (axes, count) = (&self.axes[..], modes.modes());
        let of_component = self.parts.len() * count;
        let mut resistance = DMatrix::zeros(axes.len() * of_component, axes.len() * of_component);
        let index = |k: usize, c: usize, m: usize| c * of_component + k * count + m;
        let motions: Vec<DMatrix<f64>> = (0..self.parts.len())
            .map(|k| self.motion_of_modes(k, count))
            .collect();
        let mut add = |[j, k]: [usize; 2], block: &DMatrix<f64>| {
            for (row, column) in
                (0..block.nrows()).flat_map(|r| (0..block.ncols()).map(move |c| (r, c)))
            {
                let at = |k: usize, entry: usize| index(k, entry / count, entry % count);
                resistance[(at(j, row), at(k, column))] += block[(row, column)];
            }
        };
        for (k, gram) in self.grams(modes, communicator).into_iter().enumerate() {
            let inverse = modes::inverse(gram);
            let mut own = DMatrix::<f64>::identity(axes.len(), axes.len()).kronecker(&inverse);
            if let BodyMotion::Free { .. } = self.motions[k] {
                let moments = &self.moments[k];
                let inertia = moments.inverse.try_inverse().unwrap_or_default();
                let mut mass = DMatrix::zeros(6, 6);
                mass.view_mut((0, 0), (3, 3)).fill_diagonal(moments.volume);
                mass.view_mut((3, 3), (3, 3)).copy_from(&inertia);
                // About the centroid translation and rotation do not mix.
                let about = moments.to_centroid() * &motions[k];
                own -= about.transpose() * mass * about;
            }
            add([k, k], &(self.resistance * own));
        }
        for link in &self.links {
            for (row, &j) in link.bodies.iter().enumerate() {
                for (column, &k) in link.bodies.iter().enumerate() {
                    let free = [j, k].map(|k| matches!(self.motions[k], BodyMotion::Free { .. }));
                    if free == [true; 2] {
                        let block = modes::block(&link.resistance, row, column);
                        let block = motions[j].transpose() * block * &motions[k];
                        add([j, k], &(block / self.density));
                    }
                }
            }
        }
        resistance
    }

    /// Σ s p pᵀ of every body. Collective.
    fn grams(&self, modes: &BodyModes, communicator: &Communicator) -> Vec<DMatrix<f64>> {
        let count = modes.modes();
        let mut sums = vec![0.0; count * count * self.parts.len()];
        for (part, sums) in self.parts.iter().zip(sums.chunks_exact_mut(count * count)) {
            for ((_, share), arm) in part.entries() {
                for m in 0..count {
                    let weight = share * modes.mode(m, arm);
                    (0..count).for_each(|n| sums[m * count + n] += weight * modes.mode(n, arm));
                }
            }
        }
        communicator.sum_slice(&mut sums);
        let gram = |sums: &[f64]| DMatrix::from_row_slice(count, count, sums);
        sums.chunks_exact(count * count).map(gram).collect()
    }

    /// Velocity of the centre and spin of a body by its moments, component after component.
    fn motion_of_modes(&self, k: usize, count: usize) -> DMatrix<f64> {
        let moments = &self.moments[k];
        let mut motion = DMatrix::zeros(6, self.axes.len() * count);
        for (c, &axis) in self.axes.iter().enumerate() {
            let unit = Vector3::ith(axis, 1.0);
            let mut put = |m: usize, mean: Vector3<f64>, spin: Vector3<f64>| {
                let velocity = mean - spin.cross(&moments.shift);
                let column = stacked(velocity.into(), spin.into());
                motion.column_mut(c * count + m).copy_from(&column);
            };
            put(0, unit / moments.volume, Vector3::zeros());
            for (m, &along) in self.axes.iter().enumerate() {
                let turning = self.scale * Vector3::ith(along, 1.0).cross(&unit);
                put(1 + m, Vector3::zeros(), moments.inverse * turning);
            }
        }
        motion
    }

    /// √(Σ κφ) by owned node.
    fn roots(&self, volumes: &[f64]) -> Vec<f64> {
        let mut roots = vec![0.0; volumes.len()];
        for part in self.parts.iter() {
            for ((&i, share), _) in part.entries() {
                roots[i as usize] += self.resistance * share / volumes[i as usize];
            }
        }
        roots.iter_mut().for_each(|r| *r = r.sqrt());
        roots
    }

    /// Adds what the bodies resist the flow with: κ s (u − P u) of free ones and κ s u of those of given motion, and links. Collective.
    pub fn resist(&mut self, u: &[[f64; 4]], out: &mut [[f64; 4]], communicator: &Communicator) {
        self.project(u, communicator);
        let moving = |k: usize| match self.motions[k] {
            BodyMotion::Free { .. } => self.motion(k),
            BodyMotion::Given { .. } => Motion::zeros(),
        };
        let motions: Vec<Motion> = (0..self.parts.len()).map(moving).collect();
        let mut loads = vec![Motion::zeros(); motions.len()];
        self.add_links(&motions, &mut loads);
        for (k, (part, load)) in self.parts.iter().zip(&loads).enumerate() {
            let (velocity, spin) = match self.motions[k] {
                BodyMotion::Free { .. } => {
                    let (velocity, spin) = self.mean(k);
                    let (linear, angular) = self.moments[k].accelerations(load, self.density);
                    let rate = self.resistance;
                    (velocity + linear / rate, spin + angular / rate)
                }
                BodyMotion::Given { .. } => (Vector3::zeros(), Vector3::zeros()),
            };
            for ((&i, share), arm) in part.entries() {
                let rigid = velocity + spin.cross(&Vector3::from(*arm));
                let (u, out) = (u[i as usize], &mut out[i as usize]);
                let weight = self.resistance * share;
                (0..3).for_each(|c| out[c] += weight * (u[c] - rigid[c]));
            }
        }
    }

    /// Adds what moves the bodies, by density, to the right-hand side \[m⁴/s²\].
    pub fn push(&self, source: &mut [[f64; 4]]) {
        let mut loads = vec![Motion::zeros(); self.parts.len()];
        let given: Vec<Motion> = self.motions.iter().map(BodyMotion::given).collect();
        self.add_links(&given, &mut loads);
        for (k, part) in self.parts.iter().enumerate() {
            let moments = &self.moments[k];
            let (linear, angular) = match self.motions[k] {
                BodyMotion::Free { force, torque } => {
                    let load = loads[k] + stacked(force, torque);
                    moments.accelerations(&load, self.density)
                }
                BodyMotion::Given { velocity, spin } => {
                    let spin = Vector3::from(spin);
                    let velocity = Vector3::from(velocity) + spin.cross(&moments.shift);
                    (self.resistance * velocity, self.resistance * spin)
                }
            };
            for ((&i, share), arm) in part.entries() {
                let push = linear + angular.cross(&Vector3::from(*arm));
                let source = &mut source[i as usize];
                (0..3).for_each(|c| source[c] += share * push[c]);
            }
        }
    }

    /// Adds the forces and torques of links at given motions.
    fn add_links(&self, motions: &[Motion], loads: &mut [Motion]) {
        for link in &self.links {
            let [a, b] = link.bodies;
            let mut both = SVector::<f64, 12>::zeros();
            both.fixed_rows_mut::<6>(0).copy_from(&motions[a]);
            both.fixed_rows_mut::<6>(6).copy_from(&motions[b]);
            let load = link.resistance * both;
            loads[a] -= load.fixed_rows::<6>(0);
            loads[b] -= load.fixed_rows::<6>(6);
        }
    }

    /// Motions in a flow, and the forces on the bodies. Collective.
    fn states(&mut self, u: &[[f64; 4]], communicator: &Communicator) -> Vec<BodyState> {
        self.project(u, communicator);
        let now = |k: usize| match self.motions[k] {
            BodyMotion::Free { .. } => self.motion(k),
            BodyMotion::Given { velocity, spin } => stacked(velocity, spin),
        };
        let motions: Vec<Motion> = (0..self.parts.len()).map(now).collect();
        let mut loads = vec![Motion::zeros(); motions.len()];
        self.add_links(&motions, &mut loads);
        let of = |k: usize| {
            let moments = &self.moments[k];
            let force = match self.motions[k] {
                BodyMotion::Free { force, torque } => -(loads[k] + stacked(force, torque)),
                BodyMotion::Given { velocity, spin } => {
                    let (mean, turning) = self.mean(k);
                    let spin = Vector3::from(spin);
                    let centroid = Vector3::from(velocity) + spin.cross(&moments.shift);
                    let scale = self.density * self.resistance;
                    let force = scale * moments.volume * (mean - centroid);
                    let inertia = moments.inverse.try_inverse().unwrap_or_default();
                    let torque = scale * (inertia * (turning - spin));
                    stacked(force.into(), (torque + moments.shift.cross(&force)).into())
                }
            };
            let part = |v: &Motion, first: usize| [v[first], v[first + 1], v[first + 2]];
            BodyState {
                velocity: part(&motions[k], 0),
                spin: part(&motions[k], 3),
                force: part(&force, 0),
                torque: part(&force, 3),
            }
        };
        (0..self.parts.len()).map(of).collect()
    }

    /// Σ s u and Σ s r × u. Collective.
    fn project(&mut self, u: &[[f64; 4]], communicator: &Communicator) {
        for (part, sums) in self.parts.iter().zip(self.sums.chunks_exact_mut(6)) {
            let (mut linear, mut angular) = (Vector3::zeros(), Vector3::zeros());
            for ((&i, &share), arm) in part.entries() {
                let [x, y, z, _] = u[i as usize];
                let momentum = share * Vector3::new(x, y, z);
                linear += momentum;
                angular += Vector3::from(*arm).cross(&momentum);
            }
            sums[..3].copy_from_slice(linear.as_slice());
            sums[3..].copy_from_slice(angular.as_slice());
        }
        communicator.sum_slice(&mut self.sums);
    }

    /// V_k and Ω_k of the sums.
    fn mean(&self, k: usize) -> (Vector3<f64>, Vector3<f64>) {
        let (sums, moments) = (&self.sums[6 * k..][..6], &self.moments[k]);
        let linear = Vector3::from_column_slice(&sums[..3]) / moments.volume;
        let angular = moments.inverse * Vector3::from_column_slice(&sums[3..]);
        (linear, angular)
    }

    /// The velocity of the centre and the spin.
    fn motion(&self, k: usize) -> Motion {
        let (mean, spin) = self.mean(k);
        let velocity = mean - spin.cross(&self.moments[k].shift);
        stacked(velocity.into(), spin.into())
    }
}

impl BodyMotion {
    /// Velocity and spin where they are given, else zero.
    fn given(&self) -> Motion {
        match *self {
            Self::Free { .. } => Motion::zeros(),
            Self::Given { velocity, spin } => stacked(velocity, spin),
        }
    }
}

fn stacked(first: [f64; 3], second: [f64; 3]) -> Motion {
    let ([a, b, c], [d, e, f]) = (first, second);
    Motion::new(a, b, c, d, e, f)
}

impl Moments {
    /// From Σ s (1, x, y, z, xx, yy, zz, xy, xz, yz).
    fn of(sums: &[f64]) -> Self {
        let volume = sums[0];
        let shift = Vector3::from_column_slice(&sums[1..4]) / volume;
        let [xx, yy, zz, xy, xz, yz] = std::array::from_fn(|k| sums[4 + k]);
        let about_centre = Matrix3::new(yy + zz, -xy, -xz, -xy, xx + zz, -yz, -xz, -yz, xx + yy);
        let steiner = Matrix3::identity() * shift.norm_squared() - shift * shift.transpose();
        let inertia = about_centre - volume * steiner;
        Self {
            volume,
            shift,
            inverse: inertia.try_inverse().unwrap_or_default(),
        }
    }

    /// Velocity of the centroid and spin by velocity of the centre and spin.
    fn to_centroid(&self) -> DMatrix<f64> {
        let mut matrix = DMatrix::identity(6, 6);
        let turned = -self.shift.cross_matrix();
        matrix.view_mut((0, 3), (3, 3)).copy_from(&turned);
        matrix
    }

    /// a and α of the centroid by a force and a torque about the centre.
    fn accelerations(&self, load: &Motion, density: f64) -> (Vector3<f64>, Vector3<f64>) {
        let force: Vector3<f64> = load.fixed_rows::<3>(0) / density;
        let torque = load.fixed_rows::<3>(3) / density - self.shift.cross(&force);
        (force / self.volume, self.inverse * torque)
    }
}

impl Fluid {
    /// Bodies of the next steps of a flow without convection, in place of those before; `length` is ℓ \[m\], and every rank names the same
    /// bodies in the same order, with the part of each that it holds. Collective.
    ///
    /// # Errors
    /// A flow with convection; ℓ that is not positive; a body that no node lies in.
    pub fn set_bodies(
        &mut self,
        length: f64,
        parts: Vec<BodyPart>,
        motions: Vec<BodyMotion>,
        links: Vec<BodyLink>,
    ) -> Result<(), FluidError> {
        let Some(creeping) = &mut self.creeping else {
            return Err(FluidError::Convection);
        };
        let setting = |name, value, expected| FluidError::Setting {
            name,
            value,
            expected,
        };
        if !(length > 0.0 && length.is_finite()) {
            return Err(setting("screening length", length, "positive and finite"));
        }
        let communicator = self.mesh.halo.communicator();
        let resistance = self.settings.kinematic_viscosity() / (length * length);
        let volumes = self.operators.volumes();
        let scales = [resistance, self.settings.density];
        let bodies = Bodies::new(scales, parts, motions, links, volumes, communicator);
        let empty = (bodies.moments.iter()).find(|m| m.volume.is_nan() || m.volume <= 0.0);
        if let Some(empty) = empty {
            return Err(setting(
                "volume of a body",
                empty.volume,
                "that of a few nodes",
            ));
        }
        let some = !bodies.parts.is_empty();
        creeping.preconditioner.resistance = if some && bodies.scale > POROUS * length {
            bodies.roots(volumes)
        } else {
            Vec::new()
        };
        creeping.preconditioner.modes.fit(&bodies, communicator);
        creeping.system.bodies = some.then_some(bodies);
        Ok(())
    }

    /// How the bodies move in the present flow, and the forces of the last step on them, in the order in which they were given. Collective.
    pub fn body_states(&mut self) -> Vec<BodyState> {
        let communicator = self.mesh.halo.communicator();
        let bodies = (self.creeping.as_mut()).and_then(|c| c.system.bodies.as_mut());
        bodies.map_or_else(Vec::new, |bodies| {
            bodies.states(&self.velocity, communicator)
        })
    }
}
