//! Linear algebra the fluid needs: pair matrix, conjugate gradients, algebraic multigrid, deflation, direct solver.
//!
//! Fields are slices over the nodes of a rank, owned entries first. "Total" length includes the halo entries;
//! operators bring the halo entries of what they read up to date themselves. All sums run over fixed blocks, so that
//! results are bitwise the same for any number of threads.

mod amg;
mod cg;
mod deflation;
mod direct;
mod error;
mod gather;
mod helmholtz;
mod matrix;
mod merge;
mod operator;
mod past;
mod value;
mod vectors;

pub use amg::{Amg, AmgSettings};
pub use cg::{CgSettings, ConjugateGradients, NullSpace, SolveReport};
pub use deflation::{Deflation, DeflationSettings};
pub use direct::{Direct, Waves};
pub use error::SolveError;
pub use helmholtz::Helmholtz;
pub use matrix::PairMatrix;
pub use operator::{Jacobi, LinearOperator, Preconditioner};
pub use past::PastSolutions;
pub use value::Value;
