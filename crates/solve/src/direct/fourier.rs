//! Fourier transforms of many lines at a time.

use num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

/// Room for a transform.
pub(super) type Scratch = Vec<Complex<f64>>;

/// Real lines of n values to n/2 + 1 complex ones and back; numbers interleaved.
pub(super) struct RealLines {
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
}

impl RealLines {
    pub fn new(n: usize) -> Option<Self> {
        let mut planner = RealFftPlanner::new();
        Some(Self {
            forward: planner.plan_fft_forward(n),
            inverse: planner.plan_fft_inverse(n),
        })
    }

    pub fn scratch(&self) -> usize {
        let scratch = self.forward.get_scratch_len();
        scratch.max(self.inverse.get_scratch_len())
    }

    /// Destroys `values`.
    pub fn forward(&self, values: &mut [f64], modes: &mut [f64], scratch: &mut Scratch) {
        let modes: &mut [Complex<f64>] = bytemuck::cast_slice_mut(modes);
        let lines = values.chunks_exact_mut(self.forward.len());
        for (line, modes) in lines.zip(modes.chunks_exact_mut(self.forward.complex_len())) {
            let done = self.forward.process_with_scratch(line, modes, scratch);
            debug_assert!(done.is_ok());
        }
    }

    /// Without the factor 1/n; destroys `modes`.
    pub fn inverse(&self, modes: &mut [f64], values: &mut [f64], scratch: &mut Scratch) {
        let modes: &mut [Complex<f64>] = bytemuck::cast_slice_mut(modes);
        let n = self.inverse.len();
        let lines = values.chunks_exact_mut(n);
        for (line, modes) in lines.zip(modes.chunks_exact_mut(n / 2 + 1)) {
            // Round-off in what is zero for real values.
            modes[0].im = 0.0;
            if n.is_multiple_of(2) {
                modes[n / 2].im = 0.0;
            }
            let done = self.inverse.process_with_scratch(modes, line, scratch);
            debug_assert!(done.is_ok());
        }
    }
}

/// Complex lines, in place; numbers interleaved.
pub(super) struct ComplexLines {
    forward: Arc<dyn Fft<f64>>,
    inverse: Arc<dyn Fft<f64>>,
}

impl ComplexLines {
    pub fn new(n: usize) -> Option<Self> {
        let mut planner = FftPlanner::new();
        Some(Self {
            forward: planner.plan_fft_forward(n),
            inverse: planner.plan_fft_inverse(n),
        })
    }

    pub fn scratch(&self) -> usize {
        let scratch = self.forward.get_inplace_scratch_len();
        scratch.max(self.inverse.get_inplace_scratch_len())
    }

    pub fn forward(&self, lines: &mut [f64], scratch: &mut Scratch) {
        Self::run(&*self.forward, lines, scratch);
    }

    /// Without the factor 1/n.
    pub fn inverse(&self, lines: &mut [f64], scratch: &mut Scratch) {
        Self::run(&*self.inverse, lines, scratch);
    }

    fn run(transform: &dyn Fft<f64>, lines: &mut [f64], scratch: &mut Scratch) {
        if transform.len() > 1 {
            transform.process_with_scratch(bytemuck::cast_slice_mut(lines), scratch);
        }
    }
}
