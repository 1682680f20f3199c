//! Stands in for Fourier transforms in a build without the feature `fft`: every direction takes eigenvectors.

/// Room for a transform.
pub(super) type Scratch = Vec<f64>;

/// There are none.
pub(super) enum RealLines {}

/// There are none.
pub(super) enum ComplexLines {}

impl RealLines {
    pub fn new(_n: usize) -> Option<Self> {
        None
    }
    pub fn scratch(&self) -> usize {
        match *self {}
    }
    pub fn forward(&self, _values: &mut [f64], _modes: &mut [f64], _scratch: &mut Scratch) {
        match *self {}
    }
    pub fn inverse(&self, _modes: &mut [f64], _values: &mut [f64], _scratch: &mut Scratch) {
        match *self {}
    }
}

impl ComplexLines {
    pub fn new(_n: usize) -> Option<Self> {
        None
    }
    pub fn scratch(&self) -> usize {
        match *self {}
    }
    pub fn forward(&self, _lines: &mut [f64], _scratch: &mut Scratch) {
        match *self {}
    }
    pub fn inverse(&self, _lines: &mut [f64], _scratch: &mut Scratch) {
        match *self {}
    }
}
