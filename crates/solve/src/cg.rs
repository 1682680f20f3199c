//! Preconditioned conjugate gradients, flexible where the preconditioner is not linear.

use crate::vectors::{BLOCK, Partials, blocks, dot, scale_and_add};
use crate::{LinearOperator, Preconditioner, SolveError, Value};
use fibreflow_parallel::Communicator;
use rayon::prelude::*;

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CgSettings {
    /// Residual norm relative to the norm of the right-hand side.
    pub relative_tolerance: f64,
    /// Residual norm; the larger of the two targets counts.
    pub absolute_tolerance: f64,
    /// Iterations after which the solve fails.
    pub max_iterations: usize,
}

impl Default for CgSettings {
    fn default() -> Self {
        Self {
            relative_tolerance: 1e-8,
            absolute_tolerance: 0.0,
            max_iterations: 1000,
        }
    }
}

/// What the operator maps to zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NullSpace {
    /// Nothing.
    None,
    /// Constants (component by component): their part of the right-hand side is dropped, the answer has mean zero.
    Constant,
}

/// How a solve went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveReport {
    /// Iterations done.
    pub iterations: usize,
    /// Residual norm of the initial guess.
    pub initial_residual: f64,
    /// Residual norm at the end (of the recurrence).
    pub final_residual: f64,
    /// Norm of the right-hand side, without its null-space part.
    pub rhs_norm: f64,
}

/// Conjugate gradients with the room it needs, kept between solves.
///
/// A vector field is one Krylov space over all components. Sums run over fixed blocks and then over ranks, so that the
/// iterates do not depend on the number of threads.
#[derive(Clone, Debug, Default)]
pub struct ConjugateGradients<T> {
    /// r = b − A x, owned.
    residual: Vec<T>,
    /// z = M⁻¹ r, owned.
    preconditioned: Vec<T>,
    /// p, total.
    direction: Vec<T>,
    /// q = A p, owned.
    image: Vec<T>,
    partials: Partials<2>,
}

impl<T: Value> ConjugateGradients<T> {
    /// Without room yet: the first solve allocates.
    pub fn new() -> Self {
        Self {
            residual: Vec::new(),
            preconditioned: Vec::new(),
            direction: Vec::new(),
            image: Vec::new(),
            partials: Partials::default(),
        }
    }

    /// Solves A x = b from the initial guess in `x`.
    ///
    /// `rhs` has owned length or longer; `x` has total length, and its halo entries are up to date on return. The pad
    /// lane of vector fields must be zero in both. A zero right-hand side gives x = 0. Collective; every rank gets the
    /// same report or error.
    ///
    /// # Errors
    /// Every way not to reach the tolerance, see [`SolveError`]; `x` then holds the last iterate.
    pub fn solve(
        &mut self,
        operator: &(impl LinearOperator<T> + ?Sized),
        preconditioner: &mut (impl Preconditioner<T> + ?Sized),
        rhs: &[T],
        x: &mut [T],
        settings: &CgSettings,
        null_space: NullSpace,
    ) -> Result<SolveReport, SolveError> {
        let halo = operator.halo();
        let (owned, communicator) = (halo.owned(), halo.communicator().clone());
        self.resize(owned, halo.total());
        let (rhs_norm, initial_residual) =
            self.start(operator, &rhs[..owned], x, null_space, &communicator)?;
        let target = settings
            .absolute_tolerance
            .max(settings.relative_tolerance * rhs_norm);
        let mut report = SolveReport {
            iterations: 0,
            initial_residual,
            final_residual: initial_residual,
            rhs_norm,
        };
        if rhs_norm == 0.0 {
            x.fill(T::ZERO);
            report.final_residual = 0.0;
            return Ok(report);
        }
        if initial_residual > target && preconditioner.improve(&self.residual, &mut x[..owned]) {
            (_, report.final_residual) =
                self.start(operator, &rhs[..owned], x, null_space, &communicator)?;
        }
        let flexible = preconditioner.is_variable();
        // r·z of the iteration before, and its step length.
        let (mut rho, mut alpha) = (1.0, 0.0);
        while report.final_residual > target {
            let iteration = report.iterations;
            if iteration == settings.max_iterations {
                return Err(SolveError::NotConverged {
                    iterations: iteration,
                    residual: report.final_residual,
                    target,
                    initial_residual,
                });
            }
            preconditioner.normalise(report.final_residual);
            preconditioner.apply(&self.residual, &mut self.preconditioned);
            let [rz, zq] = self.preconditioned_products(&communicator);
            positive("the preconditioner", rz, iteration + 1)?;
            // Polak–Ribière: z·(r − r_old) = −α z·q, free of an old residual.
            let beta = match (iteration, flexible) {
                (0, _) => 0.0,
                (_, true) => -alpha * zq / rho,
                (_, false) => rz / rho,
            };
            rho = rz;
            scale_and_add(
                flat_mut(&mut self.direction[..owned]),
                beta,
                flat(&self.preconditioned),
            );
            operator.apply(&mut self.direction, &mut self.image);
            let curvature = self.curvature(&communicator);
            positive("the operator", curvature, iteration + 1)?;
            // In the flexible form p·r differs from r·z only by round-off, as every p is conjugate to the one before.
            alpha = rho / curvature;
            report.final_residual = self.step(&mut x[..owned], alpha, &communicator);
            report.iterations += 1;
        }
        if null_space == NullSpace::Constant {
            let mean = self.mean(&x[..owned], &communicator);
            x[..owned].iter_mut().for_each(|v| *v = v.plus(-1.0, mean));
        }
        halo.update(x);
        Ok(report)
    }

    fn resize(&mut self, owned: usize, total: usize) {
        for field in [
            &mut self.residual,
            &mut self.preconditioned,
            &mut self.image,
        ] {
            field.resize(owned, T::ZERO);
            // Read before it is written, with weight zero: must be finite.
            field.fill(T::ZERO);
        }
        self.direction.resize(total, T::ZERO);
        self.direction.fill(T::ZERO);
    }

    /// r = b − A x; norms of b and r.
    fn start(
        &mut self,
        operator: &(impl LinearOperator<T> + ?Sized),
        rhs: &[T],
        x: &mut [T],
        null_space: NullSpace,
        communicator: &Communicator,
    ) -> Result<(f64, f64), SolveError> {
        let mean = match null_space {
            NullSpace::None => T::ZERO,
            NullSpace::Constant => self.mean(rhs, communicator),
        };
        operator.apply(x, &mut self.image);
        self.residual
            .par_chunks_mut(BLOCK)
            .zip(rhs.par_chunks(BLOCK))
            .for_each(|(r, b)| {
                r.iter_mut()
                    .zip(b)
                    .for_each(|(r, b)| *r = b.plus(-1.0, mean));
            });
        let square = |(a, b): (&[f64], &[f64])| [dot(a, b), 0.0];
        let right = flat(&self.residual);
        let [rhs_square, ..] = self.partials.sum(blocks(right, right).map(square));
        let difference = |(r, q): (&mut [f64], &[f64])| {
            r.iter_mut().zip(q).for_each(|(r, q)| *r -= q);
            [dot(r, r), 0.0]
        };
        let residual = flat_mut(&mut self.residual).par_chunks_mut(BLOCK);
        let image = flat(&self.image).par_chunks(BLOCK);
        let [square, ..] = self.partials.sum(residual.zip(image).map(difference));
        let mut squares = [rhs_square, square];
        communicator.sum_slice(&mut squares);
        if squares.iter().all(|s| s.is_finite()) {
            Ok((squares[0].sqrt(), squares[1].sqrt()))
        } else {
            Err(SolveError::NotFinite { iteration: 0 })
        }
    }

    /// r·z and z·q.
    fn preconditioned_products(&mut self, communicator: &Communicator) -> [f64; 2] {
        let (r, z, q) = (
            flat(&self.residual),
            flat(&self.preconditioned),
            flat(&self.image),
        );
        let parts = blocks(r, z)
            .zip(q.par_chunks(BLOCK))
            .map(|((r, z), q)| [dot(r, z), dot(z, q)]);
        let mut products = self.partials.sum(parts);
        communicator.sum_slice(&mut products);
        products
    }

    /// p·q.
    fn curvature(&mut self, communicator: &Communicator) -> f64 {
        let direction = flat(&self.direction[..self.image.len()]);
        let parts = blocks(direction, flat(&self.image)).map(|(p, q)| [dot(p, q), 0.0]);
        communicator.sum(self.partials.sum(parts)[0])
    }

    /// x += α p, r −= α q; norm of r.
    fn step(&mut self, x: &mut [T], alpha: f64, communicator: &Communicator) -> f64 {
        let direction = flat(&self.direction[..self.image.len()]);
        let parts = flat_mut(x)
            .par_chunks_mut(BLOCK)
            .zip(flat_mut(&mut self.residual).par_chunks_mut(BLOCK))
            .zip(blocks(direction, flat(&self.image)))
            .map(|((x, r), (p, q))| {
                x.iter_mut().zip(p).for_each(|(x, p)| *x += alpha * p);
                r.iter_mut().zip(q).for_each(|(r, q)| *r -= alpha * q);
                [dot(r, r), 0.0]
            });
        communicator.sum(self.partials.sum(parts)[0]).sqrt()
    }

    /// Mean of a field over the nodes of all ranks.
    fn mean(&mut self, field: &[T], communicator: &Communicator) -> T {
        let mut mean = T::ZERO;
        let lanes: &mut [f64] = bytemuck::cast_slice_mut(std::slice::from_mut(&mut mean));
        let values = flat(field);
        for (lane, mean) in lanes.iter_mut().enumerate() {
            let parts = values.par_chunks(BLOCK).map(|block| {
                let lane = block.iter().skip(lane).step_by(T::WIDTH);
                [lane.sum(), 0.0]
            });
            let mut sums = [self.partials.sum(parts)[0], field.len() as f64];
            communicator.sum_slice(&mut sums);
            *mean = sums[0] / sums[1].max(1.0);
        }
        mean
    }
}

fn positive(which: &'static str, value: f64, iteration: usize) -> Result<(), SolveError> {
    if !value.is_finite() {
        return Err(SolveError::NotFinite { iteration });
    }
    if value <= 0.0 {
        return Err(SolveError::Indefinite {
            which,
            value,
            iteration,
        });
    }
    Ok(())
}

fn flat<T: Value>(field: &[T]) -> &[f64] {
    bytemuck::cast_slice(field)
}

fn flat_mut<T: Value>(field: &mut [T]) -> &mut [f64] {
    bytemuck::cast_slice_mut(field)
}
