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
use stokeslet::Stokeslets;

/// Variance of a Gaussian cut off at [`Kernel::REACH`] by that of the whole one.
const VARIANCE: f64 = 0.994_284;
/// Ages between bands: t_σ 2^k from here to there, t_σ = σ²/ν.
const EXPONENTS: [i32; 2] = [-7, 11];
/// Two bands have one force.
const FORCES: usize = (EXPONENTS[1] - EXPONENTS[0] + 2) as usize / 2;

/// Displacements that differ by less than this share of the width, or of the distance from an image, are one.
const NEAR: f64 = 0.03;

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
    bands: Vec<Band>,
    stokeslets: Stokeslets,
}

/// Velocity and its gradient.
type Flow = (Vector3<f64>, Matrix3<f64>);

/// What is left of forces of some ages: Gaussians of the younger width less those of the older.
#[derive(Clone, Copy, Debug)]
struct Band {
    /// Age that its displacement is taken at \[s\].
    middle: f64,
    /// Widths √2 √(σ² + ντ) at its ends \[m\]; the last band has no end.
    younger: f64,
    older: Option<f64>,
}

impl Band {
    /// Of a kernel of width σ \[m\] with σ²/ν = `time` \[s\].
    fn all(wake: Wake, sigma: f64, time: f64) -> Vec<Self> {
        let width = |age: f64| sigma * (2.0 * (1.0 + age / time)).sqrt();
        if wake == Wake::Steady {
            return vec![Self {
                middle: 0.0,
                younger: width(0.0),
                older: None,
            }];
        }
        let end = |band: usize| time * f64::from(band as i32 + EXPONENTS[0]).exp2();
        let band = |k: usize| {
            let last = k + 1 == 2 * FORCES;
            let (younger, older) = (if k == 0 { 0.0 } else { end(k - 1) }, end(k));
            Self {
                middle: match k {
                    0 => 0.5 * older,
                    _ if last => 2.0 * younger,
                    _ => (younger * older).sqrt(),
                },
                younger: width(younger),
                older: (!last).then(|| width(older)),
            }
        };
        (0..2 * FORCES).map(band).collect()
    }
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
        let width = kernel.width().ok_or(CouplingError::NoWidth)? * VARIANCE.sqrt();
        let time = width * width * density / viscosity;
        Ok(Self {
            width,
            viscosity,
            time,
            wake,
            walls,
            bands: Band::all(wake, width, time),
            stokeslets: Stokeslets::new(),
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
                sources
                    .iter()
                    .for_each(|source| self.influence(own, &place, source));
            }
        });
        for (p, (velocity, gradient)) in own.into_iter().enumerate() {
            ambient.velocity[p] -= velocity / self.viscosity;
            ambient.gradient[p] -= gradient / self.viscosity;
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

    /// Adds velocity and gradient at a place from a source, by unit viscosity; images change the velocity alone.
    fn influence(&self, (u, gradient): &mut Flow, place: &Vector3<f64>, source: &Source<'_>) {
        let force = |k: usize| {
            let three = &source.forces[3 * (k / 2)..3 * (k / 2) + 3];
            Vector3::new(three[0], three[1], three[2])
        };
        let r = place - source.position;
        let speed = source.drift.norm();
        let mut add = |age: f64, force: &Vector3<f64>, s: f64| {
            let r = r + age * source.drift;
            self.stokeslets.add((u, gradient), &r, force, s);
        };
        add(self.bands[0].middle, &force(0), self.bands[0].younger);
        for (k, pair) in self.bands.windows(2).enumerate() {
            let [before, after] = [&pair[0], &pair[1]];
            let s = after.younger;
            if speed * (after.middle - before.middle) > NEAR * s {
                add(before.middle, &-force(k), s);
                add(after.middle, &force(k + 1), s);
            } else if k % 2 == 1 {
                // One place will do, and within a pair of bands nothing changes there.
                let age = 0.5 * (before.middle + after.middle);
                add(age, &(force(k + 1) - force(k)), s);
            }
        }
        for wall in &self.walls {
            let mut first = 0;
            while first < self.bands.len() {
                let from = source.position - self.bands[first].middle * source.drift;
                // A thousandth of a width from the wall, where a force does nothing.
                let height = (wall.normal.dot(&from) - wall.offset).max(1e-3 * self.width);
                let image = place - from + 2.0 * height * wall.normal;
                let distance = image.norm();
                let mut sum = image::Sum::default();
                let one = |band: &&Band| {
                    let moved = speed * (band.middle - self.bands[first].middle);
                    moved <= NEAR * distance.max(band.younger)
                };
                let count = self.bands[first..].iter().take_while(one).count();
                for (k, band) in self.bands.iter().enumerate().skip(first).take(count) {
                    let force = force(k);
                    sum.add(&force, band.younger, distance);
                    if let Some(older) = band.older {
                        sum.add(&-force, older, distance);
                    }
                }
                *u += sum.velocity(&image, &wall.normal, height);
                first += count;
            }
        }
    }
}
