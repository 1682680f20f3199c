//! Fourier modes of vector fields on periodic boxes of uniform spacings, dealt out over the ranks as in a direct solve.

use super::banded::LANES;
use super::fourier::{ComplexLines, Scratch};
use super::{Direct, spectrum};
use crate::SolveError;
use fibreflow_mesh::{Line, TensorGrid};
use fibreflow_parallel::Halo;

/// The transform û(k) = N⁻¹ Σ u exp(−ik·x) of three components.
pub struct Waves {
    planes: Direct,
    lines: ComplexLines,
    /// One line, complex numbers interleaved.
    line: Vec<f64>,
    /// Σ_c |û_c|² along a line.
    squares: Vec<f64>,
    scratch: Scratch,
}

impl Waves {
    /// None unless all three directions are periodic and uniform, or without the feature `fft`. Collective.
    ///
    /// # Errors
    /// [`SolveError::Length`] when the lines do not fit the grid.
    pub fn new(
        halo: &Halo,
        grid: &TensorGrid,
        lines: &[Line; 3],
    ) -> Result<Option<Self>, SolveError> {
        if lines.iter().any(|line| spectrum::fourier(line).is_none()) {
            return Ok(None);
        }
        // Any equation will do: only its planes are transformed.
        let planes = Direct::new(halo, grid, lines, [[false; 2]; 3], 1.0)?;
        let count = planes.banded.size();
        Ok(ComplexLines::new(count).map(|lines| Self {
            planes,
            line: vec![0.0; 2 * count],
            squares: vec![0.0; count],
            scratch: vec![Default::default(); lines.scratch()],
            lines,
        }))
    }

    /// Calls `visit(n, ½ Σ_c |û_c|²)` for the modes of this rank, n the number of waves along each direction; conjugate pairs
    /// come once with the energy of both. Sums over all ranks and modes are ½⟨|u|²⟩. Collective.
    pub fn energies(&mut self, field: &[[f64; 4]], mut visit: impl FnMut([i32; 3], f64)) {
        let planes = &mut self.planes;
        let field: &[f64] = bytemuck::cast_slice(&field[..planes.owned]);
        let mut work = planes.vector.take().unwrap_or_else(|| planes.work(3));
        match (&planes.slabs, work.slab.take()) {
            (Some(slabs), Some(mut room)) => {
                slabs.gather(&planes.shares, &mut room, field, [4, 3]);
                planes.to_modes(&mut work, &room.values, 3, &[0.0; 3]);
                work.slab = Some(room);
            }
            _ => planes.to_modes(&mut work, field, 4, &[0.0; 3]),
        }
        let count = planes.banded.size();
        let modes = &mut work.modes;
        work.transposition
            .bring_to_modes(&planes.shares, count, modes);
        let [n_a, n_b] = planes.transform.counts;
        let scale = planes.transform.scale / planes.coefficient * (n_a * n_b * count) as f64;
        let parts = planes.parts(3);
        let blocks = modes.chunks_exact(count * parts * LANES);
        for (block, first) in blocks.zip(planes.shares.own_blocks()) {
            for lane in 0..LANES {
                let (a, b) = ((first * LANES + lane) / n_b, (first * LANES + lane) % n_b);
                if a > n_a / 2 {
                    continue;
                }
                self.squares.fill(0.0);
                for component in 0..3 {
                    let (line, _) = self.line.as_chunks_mut::<2>();
                    for (plane, value) in line.iter_mut().enumerate() {
                        let part = plane * parts + 2 * component;
                        *value = [part, part + 1].map(|p| block[p * LANES + lane]);
                    }
                    self.lines.forward(&mut self.line, &mut self.scratch);
                    let values = self.line.as_chunks::<2>().0.iter();
                    for (square, [re, im]) in self.squares.iter_mut().zip(values) {
                        *square += re * re + im * im;
                    }
                }
                let alone = a == 0 || 2 * a == n_a;
                let share = if alone { 0.5 } else { 1.0 } / (scale * scale);
                for (plane, square) in self.squares.iter().enumerate() {
                    let mut waves = [0; 3];
                    let counts = [a as i32, folded(b, n_b), folded(plane, count)];
                    for (axis, n) in planes.axes.into_iter().zip(counts) {
                        waves[axis] = n;
                    }
                    visit(waves, share * square);
                }
            }
        }
        planes.vector = Some(work);
    }
}

/// −n/2 < k ≤ n/2 for the index of a mode.
fn folded(index: usize, n: usize) -> i32 {
    if 2 * index > n {
        index as i32 - n as i32
    } else {
        index as i32
    }
}
