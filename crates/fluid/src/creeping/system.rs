//! The stabilised Stokes operator on (u, p), four numbers a node.

use super::bodies::Bodies;
use crate::FluidError;
use crate::boundary::{Boundary, Through};
use crate::operators::Operators;
use crate::rows::{self, nothing};
use crate::settings::length;
use fibreflow_mesh::{DualGeometry, LocalMesh};
use fibreflow_parallel::block_sums;
use fibreflow_solve::{PairMatrix, SolveError};

/// c of T = c h²/ν. The Schur complement of a uniform grid then lies between ½ and 3/2 of the mass matrix over ν: with
/// less, chequerboards along one axis converge last; with more, those along all three.
const STABILISATION: f64 = 0.125;

/// Part of s in 1/T. Without it the stabilisation would dwarf what the pressure does to the velocity in a short step; the
/// pressure would then need ten times the iterations at Δt = 0.01 h²/ν.
const LIMITED: f64 = 0.5;

pub(super) struct System {
    /// −V L on all nodes, and the same with weights τ_ij w_ij.
    laplacian: PairMatrix,
    stabiliser: PairMatrix,
    /// s that T belongs to \[1/s\].
    fitted: f64,
    /// Diagonal of T by node \[s\], total.
    tau: Vec<[f64; 4]>,
    pub viscosity: f64,
    /// Rigid bodies, if there are any.
    pub bodies: Option<Bodies>,
    /// Σ_j |S_ij| by owned node \[m²\].
    areas: Vec<f64>,
    /// Total: p, and u + T G p.
    pressure: Vec<f64>,
    carried: Vec<[f64; 4]>,
    /// Owned: V G p, Σ τ_ij w_ij (p_i − p_j).
    gradient: Vec<[f64; 4]>,
    stabilised: Vec<f64>,
    /// Total: zeros.
    zero: Vec<f64>,
}

/// The data of a linear solve besides boundary values.
#[derive(Clone, Copy)]
pub(super) struct Data<'a> {
    /// s \[1/s\].
    pub rate: f64,
    /// V (f/ρ + s u°) by owned node \[m⁴/s²\].
    pub source: &'a [[f64; 4]],
    /// Boundary fluxes are those of the boundary condition, or else zero.
    pub given: bool,
}

impl System {
    pub fn new(
        mesh: &LocalMesh,
        operators: &Operators,
        viscosity: f64,
    ) -> Result<Self, FluidError> {
        let failed = |source| FluidError::Solve {
            equation: "Stokes",
            source,
        };
        let geometry = &operators.geometry;
        let (owned, total) = (mesh.owned(), mesh.total());
        let free = vec![false; total];
        let area = |i: usize| {
            let faces = geometry.faces[geometry.row(i)].iter();
            faces.map(|s| length([s[0], s[1], s[2]])).sum()
        };
        Ok(Self {
            laplacian: PairMatrix::new(mesh, geometry, &free, None).map_err(failed)?,
            stabiliser: PairMatrix::new(mesh, geometry, &free, None).map_err(failed)?,
            fitted: f64::NAN,
            tau: vec![[0.0; 4]; total],
            viscosity,
            bodies: None,
            areas: (0..owned).map(area).collect(),
            pressure: vec![0.0; total],
            carried: vec![[0.0; 4]; total],
            gradient: vec![[0.0; 4]; owned],
            stabilised: vec![0.0; owned],
            zero: vec![0.0; total],
        })
    }

    /// Fits T to a rate. Collective.
    pub fn prepare(
        &mut self,
        mesh: &LocalMesh,
        operators: &Operators,
        rate: f64,
    ) -> Result<(), SolveError> {
        if rate == self.fitted {
            return Ok(());
        }
        let geometry = &operators.geometry;
        let owned = mesh.owned();
        times(geometry, (rate, self.viscosity), &mut self.tau[..owned]);
        mesh.halo.update(&mut self.tau);
        let rows = |i: usize| {
            let (entries, tau) = (geometry.row(i), &self.tau);
            let pairs = geometry.columns[entries.clone()].iter();
            let couple =
                move |(&j, s): (&u32, &[f64; 4])| (j, s[3] * along(&tau[i], &tau[j as usize], s));
            pairs.zip(&geometry.faces[entries]).map(couple)
        };
        let free = vec![false; mesh.total()];
        self.stabiliser = PairMatrix::from_rows(&mesh.halo, rows, &free, None)?;
        self.fitted = rate;
        Ok(())
    }

    /// Square roots of the weights of the residual norm: one over the diagonals of both equations, so that it is near
    /// the dissipation that a residual stands for.
    pub fn weigh(&self, operators: &Operators, rate: f64, weights: &mut [[f64; 4]]) {
        let volumes = operators.volumes();
        let (viscous, stabilised) = (self.laplacian.diagonal(), self.stabiliser.diagonal());
        let nu = self.viscosity;
        rows::each(weights, |i, weight| {
            let momentum = (rate * volumes[i] + nu * viscous[i]).sqrt().recip();
            *weight = [momentum, momentum, momentum, stabilised[i].sqrt().recip()];
        });
    }

    /// `out` = V s u − ν V L u + V G p and Σ_j F_ij, of all nodes. The halo of `x` is brought up to date.
    fn multiply(
        &mut self,
        operators: &Operators,
        rate: f64,
        x: &mut [[f64; 4]],
        out: &mut [[f64; 4]],
    ) {
        self.laplacian.multiply(x, out);
        self.carry(operators, x);
        self.stabiliser
            .multiply(&mut self.pressure, &mut self.stabilised);
        let (field, nu, volumes) = (&*x, self.viscosity, operators.volumes());
        let (gradient, stabilised) = (&self.gradient, &self.stabilised);
        let mut none = nothing(volumes.len());
        operators.divergence(
            &mut self.carried,
            (out, &mut none),
            |i, divergence, out, ()| {
                let mass = rate * volumes[i];
                for c in 0..3 {
                    out[c] = mass * field[i][c] + nu * out[c] + gradient[i][c];
                }
                out[3] = divergence + stabilised[i];
            },
        );
        if let Some(bodies) = &mut self.bodies {
            bodies.resist(x, out, operators.communicator());
        }
    }

    /// The operator on corrections that keep to their constraints.
    pub fn apply(
        &mut self,
        operators: &Operators,
        boundary: &Boundary,
        rate: f64,
        x: &mut [[f64; 4]],
        out: &mut [[f64; 4]],
    ) {
        self.multiply(operators, rate, x, out);
        confine(boundary, out);
    }

    /// What the equations leave: source minus operator, constraints not heeded; of continuity minus Σ F − F_b.
    pub fn whole_residual(
        &mut self,
        operators: &Operators,
        boundary: &Boundary,
        data: Data<'_>,
        x: &mut [[f64; 4]],
        out: &mut [[f64; 4]],
    ) {
        self.multiply(operators, data.rate, x, out);
        rows::each(out, |i, out| {
            (0..3).for_each(|c| out[c] = data.source[i][c] - out[c]);
            out[3] = -out[3];
        });
        for &(i, through) in &boundary.through {
            match through {
                Through::Given(flux) if data.given => out[i as usize][3] -= flux.end,
                _ => {}
            }
        }
    }

    /// [`System::whole_residual`] as far as the unknowns can take it away.
    pub fn residual(
        &mut self,
        operators: &Operators,
        boundary: &Boundary,
        data: Data<'_>,
        x: &mut [[f64; 4]],
        out: &mut [[f64; 4]],
    ) {
        self.whole_residual(operators, boundary, data, x, out);
        confine(boundary, out);
    }

    /// Σ of squares over this rank: momentum, divergence, Σ|S||u| (what flows), terms of the momentum equation.
    pub fn sizes(&self, data: Data<'_>, x: &[[f64; 4]], residual: &[[f64; 4]]) -> [f64; 4] {
        let (areas, viscous, nu) = (&self.areas, self.laplacian.diagonal(), self.viscosity);
        let square = |v: [f64; 4]| v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
        block_sums(residual.len(), |range| {
            range.fold([0.0; 4], |s, i| {
                let (r, speed) = (residual[i], square(x[i]));
                let term = (nu * viscous[i]).powi(2) * speed + square(data.source[i]);
                [
                    s[0] + square(r),
                    s[1] + r[3] * r[3],
                    s[2] + areas[i] * areas[i] * speed,
                    s[3] + term,
                ]
            })
        })
    }

    /// Pair fluxes of a solution, and max ½ Σ_j |F_ij|/V_i over the owned rows \[1/s\].
    pub fn fluxes(&mut self, operators: &Operators, x: &mut [[f64; 4]], flux: &mut [f64]) -> f64 {
        self.carry(operators, x);
        let (tau, halo) = (&self.tau, self.laplacian.halo());
        halo.update(&mut self.carried);
        let rows = operators.volumes().len();
        let out = (&mut nothing(rows)[..], &mut nothing(rows)[..]);
        operators.correct(
            (&self.carried, [0.0; 3]),
            &self.zero,
            flux,
            out,
            |_, _, _, _, (), ()| {},
        );
        let coefficient = |i: usize, j: usize, s: &[f64; 4]| along(&tau[i], &tau[j], s);
        operators.subtract_pair_gradient(&self.pressure, coefficient, flux)
    }

    /// p with its halo, V G p, and u + T G p on owned nodes.
    fn carry(&mut self, operators: &Operators, x: &[[f64; 4]]) {
        let (tau, carried, gradient) = (&self.tau, &mut self.carried, &mut self.gradient);
        rows::each(&mut self.pressure, |i, p| *p = x[i][3]);
        let inverse = operators.inverse_volumes();
        let finish = |i: usize, _: f64, sum: [f64; 4], out: &mut [f64; 4], w: &mut [f64; 4]| {
            *out = sum;
            *w = x[i];
            (0..3).for_each(|c| w[c] += tau[i][c] * inverse[i] * sum[c]);
        };
        operators.gradient(
            &mut self.pressure,
            (gradient, &mut carried[..inverse.len()]),
            finish,
        );
    }
}

/// Takes out what constraints forbid, and continuity where the pressure is given.
fn confine(boundary: &Boundary, out: &mut [[f64; 4]]) {
    for constraint in &boundary.constraints {
        let out = &mut out[constraint.node as usize];
        let [x, y, z, _] = constraint.admit(*out);
        *out = [x, y, z, out[3]];
    }
    for &(i, _) in &boundary.outlets {
        out[i as usize][3] = 0.0;
    }
}

/// τ_ij = n·½(T_i + T_j)·n of a pair with area vector S along n: the same number seen from either side.
fn along(a: &[f64; 4], b: &[f64; 4], s: &[f64; 4]) -> f64 {
    let squares = [s[0] * s[0], s[1] * s[1], s[2] * s[2]];
    let mean = |c: usize| 0.5 * (a[c] + b[c]) * squares[c];
    let total = squares[0] + squares[1] + squares[2];
    if total > 0.0 {
        (mean(0) + mean(1) + mean(2)) / total
    } else {
        0.0
    }
}

/// T of the owned nodes: 1/(ν/(c h²) + s/2), with h² along each axis the mean square distance to the neighbours on
/// orthogonal hexahedra, otherwise 6 V/Σw (both are the square of the spacing on a uniform grid).
fn times(geometry: &DualGeometry, (rate, viscosity): (f64, f64), out: &mut [[f64; 4]]) {
    let time = |square: f64| {
        if square > 0.0 {
            (viscosity / (STABILISATION * square) + LIMITED * rate).recip()
        } else {
            0.0
        }
    };
    rows::each(out, |i, out| {
        let entries = geometry.row(i);
        let faces = &geometry.faces[entries.clone()];
        if !geometry.orthogonal {
            let sum: f64 = faces.iter().map(|s| s[3]).sum();
            let t = time(6.0 * geometry.volumes[i] / sum);
            *out = [t, t, t, 0.0];
            return;
        }
        let (mut moment, mut weight) = ([0.0; 4], [0.0; 4]);
        for (s, d) in faces.iter().zip(&geometry.displacements[entries]) {
            for c in 0..3 {
                let w = (s[c] * d[c]).abs();
                moment[c] += w * d[c] * d[c];
                weight[c] += w;
            }
        }
        *out = std::array::from_fn(|c| {
            if weight[c] > 0.0 {
                time(moment[c] / weight[c])
            } else {
                0.0
            }
        });
    });
}
