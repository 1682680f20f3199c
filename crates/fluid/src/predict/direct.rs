//! Direct solves of implicit diffusion on tensor-product meshes: along the stiff direction only, or of the whole operator.

use crate::FluidError;
use crate::boundary::Boundary;
use crate::poisson::DEAREST_DIRECT;
use fibreflow_mesh::{DualGeometry, Line, LocalMesh};
use fibreflow_parallel::Halo;
use fibreflow_solve::{Direct, Helmholtz, PairMatrix, SolveError};
use std::sync::Arc;

/// What is needed to solve directly; the solvers themselves are set up when they are wanted first.
pub(crate) struct DirectDiffusion {
    geometry: Arc<DualGeometry>,
    halo: Halo,
    /// Ends of the directions whose nodes have given velocities.
    ends: [[bool; 2]; 3],
    /// Bound of the spectrum of L along every axis \[1/m²\].
    pub rates: [f64; 3],
    /// The whole operator takes few enough operations.
    pub cheap: bool,
    lines: Option<Lines>,
    whole: Option<Box<Direct>>,
    /// c of the last solves.
    coefficient: f64,
}

/// Diffusion along one axis.
struct Lines {
    axis: usize,
    /// V L of pairs along the axis, times −1.
    matrix: PairMatrix,
    /// Its couplings to nodes of given velocity.
    lifting: PairMatrix,
    solver: Direct,
}

impl DirectDiffusion {
    /// None unless the mesh is a tensor product, the nodes of given velocity are whole sides and nothing else is
    /// constrained. Collective.
    pub fn new(
        mesh: &LocalMesh,
        geometry: &Arc<DualGeometry>,
        boundary: &Boundary,
    ) -> Option<Self> {
        let tensor = geometry.tensor.as_ref()?;
        let slips = boundary.constraints.len() != boundary.given.len();
        if mesh.halo.communicator().any(slips) {
            return None;
        }
        let ends = Direct::fixed_ends(&mesh.halo, &tensor.grid, &boundary.velocity_fixed)?;
        let operations = Direct::estimate(&tensor.lines, ends);
        Some(Self {
            cheap: operations <= DEAREST_DIRECT * mesh.total_nodes as f64,
            rates: tensor.lines.each_ref().map(bound),
            geometry: Arc::clone(geometry),
            halo: mesh.halo.clone(),
            ends,
            lines: None,
            whole: None,
            coefficient: f64::NAN,
        })
    }

    /// The axis along which diffusion is stiffest.
    pub fn axis(&self) -> usize {
        let stiffer = |&a: &usize, &b: &usize| self.rates[a].total_cmp(&self.rates[b]);
        (0..3).max_by(stiffer).unwrap_or(1)
    }

    /// Bound of the spectrum of L without the part along [`DirectDiffusion::axis`] \[1/m²\].
    pub fn rest(&self) -> f64 {
        let axis = self.axis();
        (0..3).filter(|&d| d != axis).map(|d| self.rates[d]).sum()
    }

    /// Sets up what a step needs: lines along `Some` axis, or the whole operator. Collective.
    pub fn prepare(&mut self, along: Option<usize>, fixed: &[bool]) -> Result<(), FluidError> {
        let failed = |source| FluidError::Solve {
            equation: "momentum",
            source,
        };
        match along {
            Some(axis) if self.lines.as_ref().is_none_or(|l| l.axis != axis) => {
                self.lines = Some(self.set_up_lines(axis, fixed).map_err(failed)?);
            }
            None if self.whole.is_none() => {
                self.whole = Some(Box::new(self.set_up_whole().map_err(failed)?));
            }
            _ => return Ok(()),
        }
        self.coefficient = f64::NAN;
        Ok(())
    }

    fn set_up_lines(&self, axis: usize, fixed: &[bool]) -> Result<Lines, SolveError> {
        let geometry = &*self.geometry;
        let Some(tensor) = &geometry.tensor else {
            return Err(no_tensor());
        };
        let rows = |i: usize| {
            let entries = geometry.row(i);
            let faces = geometry.faces[entries.clone()].iter();
            let pairs = geometry.columns[entries].iter().zip(faces);
            pairs
                .filter(move |(_, s)| s[axis] != 0.0)
                .map(|(&j, s)| (j, s[3]))
        };
        let none = vec![false; fixed.len()];
        let to_fixed = |i: usize| rows(i).filter(|&(j, _)| fixed[j as usize]);
        Ok(Lines {
            axis,
            matrix: PairMatrix::from_rows(&self.halo, rows, &none, None)?,
            lifting: PairMatrix::from_rows(&self.halo, to_fixed, fixed, None)?,
            solver: Direct::along(
                axis,
                &self.halo,
                &tensor.grid,
                &tensor.lines,
                self.ends,
                1.0,
            )?,
        })
    }

    fn set_up_whole(&self) -> Result<Direct, SolveError> {
        let Some(tensor) = &self.geometry.tensor else {
            return Err(no_tensor());
        };
        Direct::new(&self.halo, &tensor.grid, &tensor.lines, self.ends, 1.0)
    }

    /// −V L u along the axis of the lines into `out`.
    pub fn multiply(&self, u: &mut [[f64; 4]], out: &mut [[f64; 4]]) {
        if let Some(lines) = &self.lines {
            lines.matrix.multiply(u, out);
        }
    }

    /// V L u along the axis of the lines in one row; `u` is valid.
    pub fn row(&self, u: &[[f64; 4]], i: usize) -> [f64; 4] {
        let mut sum = [0.0; 4];
        let Some(axis) = self.lines.as_ref().map(|lines| lines.axis) else {
            return sum;
        };
        let range = self.geometry.row(i);
        let faces = &self.geometry.faces[range.clone()];
        for (&j, s) in self.geometry.columns[range].iter().zip(faces) {
            if s[axis] != 0.0 {
                (0..4).for_each(|c| sum[c] += s[3] * (u[j as usize][c] - u[i][c]));
            }
        }
        sum
    }

    /// Brings `values` at nodes of given velocity into the right-hand side of a solve along lines.
    pub fn lift(&self, values: &[[f64; 4]], mass: &[f64], coefficient: f64, rhs: &mut [[f64; 4]]) {
        if let Some(lines) = &self.lines {
            let helmholtz = Helmholtz {
                matrix: &lines.lifting,
                mass,
                coefficient,
            };
            helmholtz.lift(values, rhs);
        }
    }

    /// x of (V − c V L) x = rhs on owned nodes, L along lines or the whole; x is valid afterwards.
    ///
    /// # Errors
    /// When it was not prepared.
    pub fn solve(
        &mut self,
        lines: bool,
        coefficient: f64,
        rhs: &[[f64; 4]],
        x: &mut [[f64; 4]],
    ) -> Result<(), SolveError> {
        let solver = match (&mut self.lines, &mut self.whole) {
            (Some(along), _) if lines => &mut along.solver,
            (_, Some(whole)) => &mut **whole,
            _ => return Err(no_tensor()),
        };
        if self.coefficient != coefficient {
            solver.set(1.0, coefficient);
            self.coefficient = coefficient;
        }
        solver.solve_vectors(rhs, x);
        self.halo.update(x);
        Ok(())
    }
}

/// Geometry with lines is asked for before.
fn no_tensor() -> SolveError {
    SolveError::Length {
        what: "lines of the mesh",
        found: 0,
        expected: 3,
    }
}

/// Gershgorin bound of H⁻¹K \[1/m²\].
fn bound(line: &Line) -> f64 {
    let mut sums = vec![0.0; line.len()];
    for pair in line.pairs.iter().filter(|p| p.a as usize != line.other(p)) {
        let size = pair.stiffness + pair.stiffness.abs();
        sums[pair.a as usize] += size;
        sums[line.other(pair)] += size;
    }
    let rates = sums.iter().zip(&line.norm).map(|(sum, h)| sum / h);
    rates.fold(0.0, f64::max)
}
