//! Beads in two fluids, alone or joined by beams to fibres (L 2): smooth profiles that are rigid in a creeping flow.
//!
//! The capillary force on a bead is minus the derivative of the free energy by its place, ∫ μ_φ ∇φ_k dV: L's −φ∇μ_φ as a whole.
//!
//! A step: profiles at the present places; the free energy sees them as the solid, the Stokes solve as rigid bodies; beams pull with
//! F(X + Δt V) ≈ F(X) − Δt K V inside that solve, so that their stiffness does not limit the step; then the beads move with the flow.
//! In a mesh that is one element thick a bead is a disc of that depth, and its beam has the stiffness of a round rod all the same.

use crate::circle::radius_of_circle;
use crate::smooth_profile::{BeadNodes, Profile, fill};
use fibreflow_fibre::beam::{Pose, Segment};
use fibreflow_fibre::{Matrix3, Quaternion, Vector3};
use fibreflow_fluid::FluidError;
use fibreflow_fluid::{BodyLink, BodyMotion, BodyPart, Fluid, PhaseField, affinity};
use nalgebra::SMatrix;

/// ℓ/ξ at which a bead has the drag of a sharp one of radius r_b, by powers of ξ/r_b (`examples/bead_drag.rs`): discs, 0.08 < ξ/r_b < 0.5,
/// and spheres, 0.16 < ξ/r_b < 0.6.
const SCREENING_OF_DISCS: [f64; 3] = [0.97, -0.95, 0.75];
const SCREENING_OF_SPHERES: [f64; 3] = [0.954, -0.422, 0.414];

/// What all beads share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeadSettings {
    /// φ of a bead.
    pub profile: Profile,
    /// ℓ \[m\], over which a flow that is not rigid dies out inside; none: that at which drag is right.
    pub screening: Option<f64>,
}

impl BeadSettings {
    /// With the ℓ at which drag is right.
    pub fn new(profile: Profile) -> Self {
        Self {
            profile,
            screening: None,
        }
    }

    /// ℓ of discs or spheres \[m\].
    fn screening(&self, discs: bool) -> f64 {
        let Profile { radius, width, .. } = self.profile;
        let [a, b, c] = if discs {
            SCREENING_OF_DISCS
        } else {
            SCREENING_OF_SPHERES
        };
        let ratio = width / radius;
        let recommended = width * (a + ratio * (b + ratio * c));
        self.screening.unwrap_or(recommended)
    }
}

/// Beads in a row, each in touch with the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain {
    /// Centre of the first bead \[m\].
    pub start: [f64; 3],
    /// From the first to the last; any length.
    pub direction: [f64; 3],
    /// Beads.
    pub count: usize,
    /// ψ_0 (L 31).
    pub psi_0: f64,
    /// Young's modulus of the beams between them \[Pa\]; zero: loose.
    pub youngs_modulus: f64,
    /// They stay where they are.
    pub fixed: bool,
}

/// Motion of a bead, and its load.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bead {
    /// Centre \[m\].
    pub position: Vector3,
    /// Frame; x is the tangent of a chain.
    pub orientation: Quaternion,
    /// \[m/s\]
    pub velocity: Vector3,
    /// \[rad/s\]
    pub spin: Vector3,
    /// Force of the fluids on it \[N\].
    pub force: Vector3,
    /// Torque of the fluids on it \[N·m\].
    pub torque: Vector3,
}

/// All beads, the same on every rank.
pub struct Beads {
    settings: BeadSettings,
    /// ℓ \[m\].
    screening: f64,
    nodes: BeadNodes,
    beads: Vec<Bead>,
    /// ψ_0 and ψ* by bead, and which stay where they are.
    inside: Vec<f64>,
    wanted: Vec<f64>,
    fixed: Vec<bool>,
    /// Beams from a bead to the next.
    beams: Vec<(usize, Segment)>,
    /// First bead of every chain, and the end.
    offsets: Vec<usize>,
    parts: Vec<BodyPart>,
    /// Capillary force on every bead in the step \[N\].
    capillary: Vec<f64>,
}

/// Beads whose circle is the radius of a chain.
const FITTED: usize = 6;

/// Numbers of a bead in a checkpoint.
pub const RECORD: usize = 13;

impl Beads {
    /// At rest, on the mesh of a fluid. Collective.
    pub fn new(fluid: &Fluid, settings: BeadSettings, chains: &[Chain]) -> Self {
        let nodes = BeadNodes::new(fluid.mesh(), settings.profile);
        let mut beads = Self {
            screening: settings.screening(nodes.flat().is_some()),
            nodes,
            settings,
            beads: Vec::new(),
            inside: Vec::new(),
            wanted: Vec::new(),
            fixed: Vec::new(),
            beams: Vec::new(),
            offsets: vec![0],
            parts: Vec::new(),
            capillary: Vec::new(),
        };
        let radius = settings.profile.radius;
        for chain in chains {
            let along = Vector3::from(chain.direction).normalize();
            let orientation =
                Quaternion::rotation_between(&Vector3::x(), &along).unwrap_or_else(|| {
                    Quaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::PI)
                });
            for k in 0..chain.count {
                if k > 0 && chain.youngs_modulus > 0.0 {
                    let beam = beam(radius, chain.youngs_modulus);
                    beads.beams.push((beads.beads.len() - 1, beam));
                }
                beads.beads.push(Bead {
                    position: Vector3::from(chain.start) + along * (2.0 * radius * k as f64),
                    orientation,
                    ..Bead::default()
                });
                beads.inside.push(chain.psi_0);
                beads.wanted.push(affinity(chain.psi_0));
                beads.fixed.push(chain.fixed);
            }
            beads.offsets.push(beads.beads.len());
        }
        beads
    }

    /// What all beads share.
    pub fn settings(&self) -> &BeadSettings {
        &self.settings
    }

    /// ℓ \[m\], over which a flow that is not rigid dies out inside.
    pub fn screening(&self) -> f64 {
        self.screening
    }

    /// The beads, chain after chain.
    pub fn beads(&self) -> &[Bead] {
        &self.beads
    }

    /// First bead of every chain, and the end.
    pub fn offsets(&self) -> &[usize] {
        &self.offsets
    }

    /// Profiles at the present places, as the solid of the order parameter too, if there is one. Collective.
    pub fn place(&mut self, fluid: &Fluid, field: Option<&mut PhaseField>) {
        let centres: Vec<[f64; 3]> = self.beads.iter().map(|b| b.position.into()).collect();
        self.parts = self.nodes.parts(&centres);
        if let Some(field) = field {
            fill(
                &self.parts,
                &self.wanted,
                &fluid.mesh().halo,
                field.solid_mut(),
            );
        }
    }

    /// Blends ψ_0 into ψ where beads are placed: a start near to equilibrium. Collective.
    ///
    /// # Errors
    /// None with a field that is finite.
    pub fn wet(&self, fluid: &Fluid, field: &mut PhaseField) -> Result<(), FluidError> {
        let mut psi = field.order_parameter().to_vec();
        for (part, inside) in self.parts.iter().zip(&self.inside) {
            for (&i, phi) in part.nodes.iter().zip(&part.profile) {
                psi[i as usize] += phi * (inside - field.order_parameter()[i as usize]);
            }
        }
        field.set_values(fluid, &psi)
    }

    /// Capillary force on every bead as placed \[N\]. Collective.
    pub fn capillary(&self, fluid: &Fluid, field: &PhaseField) -> Vec<Vector3> {
        let forces = self.capillary_forces(fluid, field);
        forces
            .chunks_exact(3)
            .map(Vector3::from_column_slice)
            .collect()
    }

    /// Hands the beads, as placed or, without a second fluid, at mid-step, to the flow of a step of `dt` \[s\]. Collective.
    ///
    /// # Errors
    /// A flow with convection, a bead outside the mesh.
    pub fn hold(
        &mut self,
        fluid: &mut Fluid,
        field: Option<&PhaseField>,
        dt: f64,
    ) -> Result<(), FluidError> {
        let (mut loads, links) = self.pulls(dt);
        self.capillary = field.map_or_else(Vec::new, |field| self.capillary_forces(fluid, field));
        for (load, force) in loads.iter_mut().zip(self.capillary.chunks_exact(3)) {
            (0..3).for_each(|c| load[0][c] += force[c]);
        }
        let motion = |(fixed, [force, torque]): (&bool, [[f64; 3]; 2])| {
            if *fixed {
                BodyMotion::Given {
                    velocity: [0.0; 3],
                    spin: [0.0; 3],
                }
            } else {
                BodyMotion::Free { force, torque }
            }
        };
        let motions = self.fixed.iter().zip(loads).map(motion).collect();
        let mut parts = std::mem::take(&mut self.parts);
        if field.is_none() {
            // Where they will be in the middle of the step: of second order where beams do not relax.
            let middle = |b: &Bead| (b.position + 0.5 * dt * b.velocity).into();
            let centres: Vec<[f64; 3]> = self.beads.iter().map(middle).collect();
            parts = self.nodes.parts(&centres);
        }
        fluid.set_bodies(self.screening, parts, motions, links)
    }

    /// Takes the motions of the flow just solved, and moves on by `dt` \[s\]. Collective.
    pub fn follow(&mut self, fluid: &mut Fluid, dt: f64) {
        let states = fluid.body_states();
        let places: Vec<Vector3> = self.beads.iter().map(|b| b.position).collect();
        for (k, (bead, state)) in self.beads.iter_mut().zip(states).enumerate() {
            bead.velocity = state.velocity.into();
            bead.spin = state.spin.into();
            bead.force = state.force.into();
            bead.torque = state.torque.into();
            if let Some(capillary) = self.capillary.get(3 * k..3 * k + 3) {
                bead.force += Vector3::from_column_slice(capillary);
            }
            bead.position += dt * bead.velocity;
            bead.orientation = Quaternion::from_scaled_axis(dt * bead.spin) * bead.orientation;
        }
        self.keep_strains(&places, dt);
    }

    /// Turns the beams that began a step at `places` on arcs, and stretches them as the linear solve had it: on tangents a chain that only
    /// turns would be stretched by ½(ωΔt)², and stiff beams answer that with forces far above those of the flow. Centroids stay.
    fn keep_strains(&mut self, places: &[Vector3], dt: f64) {
        let mut first = 0;
        while first < self.beams.len() {
            let start = self.beams[first].0;
            let follows = |(k, beam): (usize, &(usize, Segment))| beam.0 == start + k;
            let joined = self.beams[first..].iter().enumerate();
            let count = joined.take_while(|beam| follows(*beam)).count();
            let chain = start..=start + count;
            let sum = |beads: &[Bead]| -> Vector3 { beads.iter().map(|b| b.position).sum() };
            let before = sum(&self.beads[chain.clone()]);
            for k in start..start + count {
                let span = places[k + 1] - places[k];
                let change = dt * (self.beads[k + 1].velocity - self.beads[k].velocity);
                let by_square = 1.0 / span.norm_squared();
                let turned = Quaternion::from_scaled_axis(span.cross(&change) * by_square) * span;
                let stretched = turned * (1.0 + span.dot(&change) * by_square);
                self.beads[k + 1].position = self.beads[k].position + stretched;
            }
            let beads = &mut self.beads[chain];
            let shift = (before - sum(beads)) / beads.len() as f64;
            beads.iter_mut().for_each(|b| b.position += shift);
            first += count;
        }
    }

    /// Energy of the beams \[J\].
    pub fn elastic_energy(&self) -> f64 {
        let of = |(k, segment): &(usize, Segment)| {
            segment.energy(self.pose(*k), self.pose(k + 1)).total()
        };
        self.beams.iter().map(of).sum()
    }

    /// Radius of every chain \[m\]: that of the circle through its six beads in the middle (L appendix C), or all where there are fewer.
    pub fn radii(&self) -> Vec<f64> {
        let of = |ends: &[usize]| {
            let spare = (ends[1] - ends[0]).saturating_sub(FITTED);
            let first = ends[0] + spare / 2;
            let fitted = &self.beads[first..ends[1] - spare.div_ceil(2)];
            radius_of_circle(&fitted.iter().map(|b| b.position).collect::<Vec<_>>())
        };
        self.offsets.windows(2).map(of).collect()
    }

    /// Part of the beads of every chain, as placed, that fluid A touches: ψ > ½ somewhere at most 2ξ from their edge. Collective.
    pub fn wetted(&self, fluid: &Fluid, field: &PhaseField) -> Vec<f64> {
        let Profile { radius, width, .. } = self.settings.profile;
        let psi = field.order_parameter();
        let touched = |part: &BodyPart| {
            part.nodes.iter().zip(&part.arms).any(|(&i, arm)| {
                let distance = Vector3::from(*arm).norm();
                (radius..=radius + 2.0 * width).contains(&distance) && psi[i as usize] > 0.5
            })
        };
        let mut found: Vec<f64> = self.parts.iter().map(|p| f64::from(touched(p))).collect();
        fluid.mesh().halo.communicator().sum_slice(&mut found);
        let of = |ends: &[usize]| {
            let beads = &found[ends[0]..ends[1]];
            beads.iter().filter(|ranks| **ranks > 0.0).count() as f64 / beads.len().max(1) as f64
        };
        self.offsets.windows(2).map(of).collect()
    }

    /// Largest part of r_b that a bead moves in a step of 1 s \[1/s\].
    pub fn rate(&self) -> f64 {
        let speed = self.beads.iter().map(|b| b.velocity.norm());
        speed.fold(0.0, f64::max) / self.settings.profile.radius
    }

    fn pose(&self, k: usize) -> Pose<'_> {
        Pose {
            position: &self.beads[k].position,
            orientation: &self.beads[k].orientation,
        }
    }

    /// −∂F/∂X of every bead as placed: with f_1 = (3/2) (Σ φ_k (ψ − ψ*_k))² it is e Σ V 3φ(ψ − ψ*)(ψ − ψ*_k) ∇φ_k. None turns: φ_k is
    /// round. Collective.
    fn capillary_forces(&self, fluid: &Fluid, field: &PhaseField) -> Vec<f64> {
        let (psi, solid) = (field.order_parameter(), field.solid());
        let volumes = &fluid.geometry().volumes;
        let density = field.settings().energy_density();
        let mut forces = vec![0.0; 3 * self.parts.len()];
        let beads = self.parts.iter().zip(&self.wanted);
        for ((part, wanted), force) in beads.zip(forces.chunks_exact_mut(3)) {
            for (&i, arm) in part.nodes.iter().zip(&part.arms) {
                let i = i as usize;
                let distance = Vector3::from(*arm).norm();
                if distance == 0.0 {
                    continue;
                }
                let ([phi, asked], psi) = (solid[i], psi[i]);
                let potential = 3.0 * density * phi * (psi - asked) * (psi - wanted);
                let slope = self.settings.profile.slope(distance) / distance;
                let share = volumes[i] * potential * slope;
                (0..3).for_each(|c| force[c] += share * arm[c]);
            }
        }
        fluid.mesh().halo.communicator().sum_slice(&mut forces);
        forces
    }

    /// Force and torque of the beams on every bead, and Δt K of every beam.
    fn pulls(&self, dt: f64) -> (Vec<[[f64; 3]; 2]>, Vec<BodyLink>) {
        let mut loads = vec![[[0.0; 3]; 2]; self.beads.len()];
        let mut links = Vec::with_capacity(self.beams.len());
        for (k, segment) in &self.beams {
            let (force, stiffness) = segment.elastic_stiffness(self.pose(*k), self.pose(k + 1));
            let mut add = |bead: usize, f: Vector3, t: Vector3| {
                for c in 0..3 {
                    loads[bead][0][c] += f[c];
                    loads[bead][1][c] += t[c];
                }
            };
            add(*k, -force.force, force.start_torque);
            add(k + 1, force.force, force.end_torque);
            // Gradient of the energy by (x_a, θ_a, x_b, θ_b); the span is x_b − x_a.
            let s = &stiffness;
            let (ad, bd) = (s.da.transpose(), s.db.transpose());
            let blocks: [[Matrix3; 4]; 4] = [
                [s.dd, -s.da, -s.dd, -s.db],
                [-ad, s.aa, ad, s.ab],
                [-s.dd, s.da, s.dd, s.db],
                [-bd, s.ab.transpose(), bd, s.bb],
            ];
            let mut resistance = SMatrix::<f64, 12, 12>::zeros();
            for (i, row) in blocks.iter().enumerate() {
                for (j, block) in row.iter().enumerate() {
                    let mut place = resistance.fixed_view_mut::<3, 3>(3 * i, 3 * j);
                    place.copy_from(&(block * dt));
                }
            }
            links.push(BodyLink {
                bodies: [*k, k + 1],
                resistance,
            });
        }
        (loads, links)
    }

    /// [`RECORD`] numbers a bead, for a checkpoint.
    pub fn state(&self) -> Vec<f64> {
        let record = |b: &Bead| {
            let mut record = [0.0; RECORD];
            record[..3].copy_from_slice(b.position.as_slice());
            record[3..7].copy_from_slice(b.orientation.coords.as_slice());
            record[7..10].copy_from_slice(b.velocity.as_slice());
            record[10..].copy_from_slice(b.spin.as_slice());
            record
        };
        self.beads.iter().flat_map(record).collect()
    }

    /// Goes on from a stored state; numbers that are missing leave their beads as they are.
    pub fn restore(&mut self, state: &[f64]) {
        let vector = |v: &[f64]| Vector3::new(v[0], v[1], v[2]);
        for (bead, record) in self.beads.iter_mut().zip(state.chunks_exact(RECORD)) {
            bead.position = vector(&record[..3]);
            let [i, j, k, w] = [record[3], record[4], record[5], record[6]];
            bead.orientation = Quaternion::new_unchecked(nalgebra::Quaternion::new(w, i, j, k));
            bead.velocity = vector(&record[7..10]);
            bead.spin = vector(&record[10..]);
        }
    }
}

/// The beam of L 11–24 between two beads in touch: a round rod of radius r_b and length 2r_b.
fn beam(radius: f64, youngs_modulus: f64) -> Segment {
    use std::f64::consts::PI;
    let length = 2.0 * radius;
    let bending = youngs_modulus * PI * radius.powi(4) / 4.0 / length;
    Segment {
        rest_length: length,
        axial: youngs_modulus * PI * radius * radius / length,
        radius,
        bending,
        mutual: bending,
        flatness: 0.0,
        // G = E/2: Poisson's number of zero, as axial and bending stiffness have it.
        torsion: bending,
        retardation: 0.0,
        start_frame: Quaternion::identity(),
        end_frame: Quaternion::identity(),
    }
}
