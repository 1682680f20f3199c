//! The flow that a fibre has made itself, and what the flow would be without it.
//!
//! A drag law wants the velocity u_∞ of the flow undisturbed by the fibre; the mesh has u = u_∞ + u_self. With the Gaussian
//! kernel u_self does not depend on the mesh that resolves it: forces F_q that act on the fluid at the points q of one
//! fibre are spread over σ, diffuse, and are sampled over σ again,
//!
//! ```text
//! u_self(x_p, t) = Σ_q (1/μ) ∫ −∂S(r_pq + W_q τ; s)/∂τ F_q(t − τ) dτ,   s² = 2σ² + 2ντ
//! ```
//!
//! where S is the Stokeslet of a Gaussian (`stokeslet`) and W the velocity of the point against the fluid, as the
//! disturbance stays behind (the regularised transient Stokeslet of arXiv 2405.08188 in the frame of Oseen's equations).
//! In steady creeping flow the integral is S(r; √2 σ) F. Else the age τ is cut into bands of constant force and
//! displacement, in which it is the difference of two S: the steady value comes out whatever the bands are. Forces of the
//! past come from a chain of lags, F_m' = (F_(m−1) − F_m)/(T_m − T_(m−1)), three numbers a point and band, carried with the fibre.
//!
//! All points of a fibre take part: laws for slender bodies hold the fibre's own long-range flow in their logarithm. What
//! other fibres and periodic images do stays; images in plane walls (`image`) are taken away with the rest. The torques' own flow is left in: it is O(d² l/σ³) of the spin.

mod image;
mod stokeslet;

use crate::{CouplingError, Kernel};
use fibreflow_fibre::{Ambient, Points, Reaction};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// Variance of a Gaussian cut off at [`Kernel::REACH`] by that of the whole one.
const VARIANCE: f64 = 0.994_284;
/// Ages between bands: t_σ 2^k from here to there, t_σ = σ²/ν.
const EXPONENTS: [i32; 2] = [-7, 11];
/// Two bands have one force.
const FORCES: usize = (EXPONENTS[1] - EXPONENTS[0] + 2) as usize / 2;

/// What becomes of a disturbance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wake {
    /// It is there at once: no inertia.
    Steady,
    /// It diffuses from where it was made: inertia without convection.
    Diffusing,
    /// It diffuses, carried along by the flow.
    Carried,
}

/// A plane wall that does not move along its normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneWall {
    /// Unit normal into the fluid.
    pub normal: Vector3<f64>,
    /// normal·x on the wall \[m\].
    pub offset: f64,
}

/// Takes the fibres' own disturbance out of what they sample.
#[derive(Clone, Debug)]
pub struct Undisturbed {
    /// σ of the kernel, as it is cut off \[m\].
    width: f64,
    viscosity: f64,
    /// σ²/ν \[s\]
    time: f64,
    wake: Wake,
    walls: Vec<PlaneWall>,
}

/// A force that acts on the fluid at one place, with its past.
struct Source<'a> {
    position: Vector3<f64>,
    /// Of the point against its disturbance \[m/s\].
    drift: Vector3<f64>,
    /// Force by band pair, youngest first, flat.
    forces: &'a [f64],
}

impl Undisturbed {
    /// For a kernel and a fluid of dynamic `viscosity` \[Pa·s\] and `density` \[kg/m³\]. `walls` are those whose images count.
    ///
    /// # Errors
    /// [`CouplingError::NoWidth`] for a kernel whose disturbance depends on the mesh.
    pub fn new(
        kernel: Kernel,
        viscosity: f64,
        density: f64,
        wake: Wake,
        walls: Vec<PlaneWall>,
    ) -> Result<Self, CouplingError> {
        let width = kernel.width().ok_or(CouplingError::NoWidth)?;
        Ok(Self {
            width: width * VARIANCE.sqrt(),
            viscosity,
            time: width * width * VARIANCE * density / viscosity,
            wake,
            walls,
        })
    }

    /// Numbers that each point carries from step to step.
    pub fn carried(&self) -> usize {
        match self.wake {
            Wake::Steady => 3,
            Wake::Diffusing | Wake::Carried => 3 + 3 * FORCES,
        }
    }

    /// What points carry after a step of `dt` \[s\] in which they pushed the fluid with `reaction` in the undisturbed
    /// flow `ambient`.
    pub fn remember(
        &self,
        carried: &mut [f64],
        points: &Points,
        ambient: &Ambient,
        reaction: &Reaction,
        dt: f64,
    ) {
        let entries = carried.par_chunks_exact_mut(self.carried());
        entries
            .with_min_len(256)
            .enumerate()
            .for_each(|(p, entry)| {
                let force = reaction.force[p];
                if self.wake == Wake::Steady {
                    entry.copy_from_slice(force.as_slice());
                    return;
                }
                let carried_along = match self.wake {
                    Wake::Carried => ambient.velocity_at(p, 0.5),
                    Wake::Diffusing | Wake::Steady => Vector3::zeros(),
                };
                let (drift, forces) = entry.split_at_mut(3);
                drift.copy_from_slice((points.velocity[p] - carried_along).as_slice());
                let (mut younger, mut age) = (force, 0.0);
                for (m, older) in forces.chunks_exact_mut(3).enumerate() {
                    let next = self.middle(m);
                    let share = dt / (next - age + dt);
                    for c in 0..3 {
                        older[c] += share * (younger[c] - older[c]);
                    }
                    younger = Vector3::new(older[0], older[1], older[2]);
                    age = next;
                }
            });
    }

    /// Age that the force of a pair of bands has \[s\].
    fn middle(&self, pair: usize) -> f64 {
        self.time * f64::from(2 * pair as i32 + EXPONENTS[0]).exp2()
    }

    /// Subtracts the fibres' own disturbance from velocity and gradient of `ambient`. `fibres` lists the first point of
    /// each fibre and, last, the number of points; `carried` is what the points carry now.
    ///
    /// The work is that of all pairs of points of a fibre: n² times 20 evaluations of a Stokeslet (1 in steady flow).
    pub fn correct(
        &self,
        fibres: &[usize],
        points: &Points,
        carried: &[f64],
        ambient: &mut Ambient,
    ) {
        let words = self.carried();
        let mut own = vec![(Vector3::zeros(), Matrix3::zeros()); points.position.len()];
        let mut rest = &mut own[..];
        let mut pieces = Vec::with_capacity(fibres.len());
        for range in fibres.windows(2) {
            let (piece, others) = rest.split_at_mut(range[1] - range[0]);
            pieces.push((range[0], piece));
            rest = others;
        }
        pieces.into_par_iter().for_each(|(first, piece)| {
            let sources: Vec<Source<'_>> = (first..first + piece.len())
                .map(|q| self.source(points.position[q], &carried[q * words..(q + 1) * words]))
                .collect();
            for (p, own) in piece.iter_mut().enumerate() {
                let place = points.position[first + p];
                for source in &sources {
                    let (velocity, gradient) = self.influence(&place, source);
                    own.0 += velocity;
                    own.1 += gradient;
                }
            }
        });
        for (p, (velocity, gradient)) in own.into_iter().enumerate() {
            ambient.velocity[p] -= velocity;
            ambient.gradient[p] -= gradient;
        }
    }

    /// Σ_q G(r_pq) over the points q of the fibre of p \[1/m³\], G the Gaussian of width √2 σ: the part of
    /// [`crate::Coupling::response`] that a fibre has in its own.
    pub fn own_response(&self, fibres: &[usize], points: &Points) -> Vec<f64> {
        let variance = 2.0 * self.width * self.width;
        let peak = (2.0 * std::f64::consts::PI * variance).powf(-1.5);
        let position = &points.position;
        let own = |range: &[usize]| -> Vec<f64> {
            let at = |p: usize| {
                let others = (range[0]..range[1]).map(|q| position[q] - position[p]);
                others
                    .map(|r| peak * (-0.5 * r.norm_squared() / variance).exp())
                    .sum()
            };
            (range[0]..range[1]).map(at).collect()
        };
        let pieces: Vec<Vec<f64>> = fibres.par_windows(2).map(own).collect();
        pieces.concat()
    }

    fn source<'a>(&self, position: Vector3<f64>, entry: &'a [f64]) -> Source<'a> {
        let (drift, forces) = match self.wake {
            Wake::Steady => (Vector3::zeros(), entry),
            Wake::Diffusing | Wake::Carried => {
                (Vector3::from_column_slice(&entry[..3]), &entry[3..])
            }
        };
        Source {
            position,
            drift,
            forces,
        }
    }

    /// Velocity and gradient at a place from a source.
    fn influence(&self, place: &Vector3<f64>, source: &Source<'_>) -> (Vector3<f64>, Matrix3<f64>) {
        let force =
            |pair: usize| Vector3::from_column_slice(&source.forces[3 * pair..3 * pair + 3]);
        let width = |age: f64| self.width * (2.0 * (1.0 + age / self.time)).sqrt();
        if self.wake == Wake::Steady {
            let (u, g) = self.through(place, &source.position, &force(0), width(0.0));
            return (u / self.viscosity, g / self.viscosity);
        }
        let (mut u, mut g) = (Vector3::zeros(), Matrix3::zeros());
        let mut younger = 0.0;
        for band in 0..2 * FORCES {
            let older = self.time * f64::from(band as i32 + EXPONENTS[0]).exp2();
            let last = band + 1 == 2 * FORCES;
            let middle = match band {
                0 => 0.5 * older,
                _ if last => 2.0 * younger,
                _ => (younger * older).sqrt(),
            };
            let force = force(band / 2);
            let from = source.position - middle * source.drift;
            let (du, dg) = self.through(place, &from, &force, width(younger));
            u += du;
            g += dg;
            if !last {
                let (du, dg) = self.through(place, &from, &force, width(older));
                u -= du;
                g -= dg;
            }
            younger = older;
        }
        (u / self.viscosity, g / self.viscosity)
    }

    /// Velocity and gradient from a Gaussian of width `s`, by unit viscosity. Images change the velocity alone.
    fn through(
        &self,
        place: &Vector3<f64>,
        from: &Vector3<f64>,
        force: &Vector3<f64>,
        s: f64,
    ) -> (Vector3<f64>, Matrix3<f64>) {
        let r = place - from;
        let (mut u, gradient) = stokeslet::flow(&r, force, s);
        for wall in &self.walls {
            let height = (wall.normal.dot(from) - wall.offset).max(0.0);
            u += image::velocity(&r, force, s, &wall.normal, height);
        }
        (u, gradient)
    }
}
