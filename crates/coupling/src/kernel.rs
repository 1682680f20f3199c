//! How far a point reaches into the flow.

use crate::CouplingError;

/// Which nodes a point samples and pushes, with which weights w_i.
///
/// Whatever the kernel, Σ w_i = 1 and Σ w_i (x_i − x) = 0, so that linear fields are sampled exactly, and forces are spread
/// by the transpose of sampling, so that force, torque and power are kept. A kernel is one more variant here and one
/// more module beside `element` and `gaussian` with the same two passes, sample and spread: a body that is resolved by
/// the mesh (smooth profile, direct forcing) would reach the nodes that it covers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Kernel {
    /// The shape functions of the element around the point (K 3.63–3.66): one element wide, whatever that is.
    #[default]
    Element,
    /// Those of the element around the middle of points 2k and 2k + 1, the two Gauss points of a segment or of a part of it, which
    /// sample its velocity and gradient and push with their moment: cheaper by a fifth, and the same where the flow is linear
    /// along the segment.
    Middle,
    /// A Gaussian of this standard deviation σ \[m\], whatever the mesh: w_i = V_i g(|x_i − x|) (a + b·(x_i − x)) on the
    /// nodes within [`Kernel::REACH`] σ, the linear factor such that both sums hold (reproducing kernel of first order,
    /// Liu, Jun & Zhang 1995). At walls it is cut off by what nodes there are.
    Gaussian {
        /// σ \[m\].
        width: f64,
    },
}

impl Kernel {
    /// Cut-off of the Gaussian in units of its width: 0.1 % of it lie beyond, and its variance is 0.6 % less.
    pub const REACH: f64 = 4.0;

    /// Width of the Gaussian \[m\]; None of one element.
    pub fn width(&self) -> Option<f64> {
        match *self {
            Self::Element | Self::Middle => None,
            Self::Gaussian { width } => Some(width),
        }
    }

    pub(crate) fn check(&self, period: f64) -> Result<(), CouplingError> {
        let Self::Gaussian { width } = *self else {
            return Ok(());
        };
        let reach = Self::REACH * width;
        if width > 0.0 && reach <= period * (1.0 - 1e-6) {
            return Ok(());
        }
        Err(CouplingError::Width {
            width,
            reach,
            period,
        })
    }
}
