//! What can go wrong in a solve. Every rank sees the same error.

/// A linear solve that gave no usable answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// The residual did not fall below the target in the iterations allowed.
    #[error(
        "conjugate gradients did not converge in {iterations} iterations: residual {residual:.3e}, \
         target {target:.3e}, residual of the initial guess {initial_residual:.3e}"
    )]
    NotConverged {
        /// Iterations done.
        iterations: usize,
        /// Norm of the residual reached.
        residual: f64,
        /// Norm that was asked for.
        target: f64,
        /// Norm of the residual at the start.
        initial_residual: f64,
    },
    /// A NaN or infinity in the right-hand side, the initial guess or the iterates.
    #[error(
        "non-finite number in conjugate gradients at iteration {iteration} (0: right-hand side or initial guess)"
    )]
    NotFinite {
        /// Iteration; 0 means the data that came in.
        iteration: usize,
    },
    /// The operator or the preconditioner is not positive definite.
    #[error(
        "{which} is not positive definite: quadratic form {value:.3e} at iteration {iteration}"
    )]
    Indefinite {
        /// "the operator" or "the preconditioner".
        which: &'static str,
        /// The quadratic form that should have been positive.
        value: f64,
        /// Iteration.
        iteration: usize,
    },
    /// A field or row structure of the wrong length was given.
    #[error("{what} has length {found}, expected {expected}")]
    Length {
        /// The argument.
        what: &'static str,
        /// Its length.
        found: usize,
        /// What it should be.
        expected: usize,
    },
    /// The eigenvectors of a direction of a tensor-product mesh could not be computed.
    #[error(
        "the eigenvectors of a direction of {unknowns} nodes could not be computed: are its coordinates finite?"
    )]
    Eigenvectors {
        /// Free nodes of the direction.
        unknowns: usize,
    },
    /// The last level of the multigrid hierarchy could not be factored.
    #[error(
        "the coarsest multigrid level of {unknowns} unknowns cannot be solved: is the mesh in several pieces, or cut \
         into too many ranks?"
    )]
    Coarsest {
        /// Unknowns of that level.
        unknowns: usize,
    },
}
