//! Who runs where: communicator, halo exchange, reductions, partition.
//!
//! Every other crate talks to [`Communicator`] and [`Halo`]; nothing else names MPI. Without the cargo feature
//! `mpi`, or when a program is started without `mpirun`, there is one rank and every call is a copy or a no-op.

mod communicator;
mod halo;
mod partition;
mod reduce;

pub use communicator::{Communicator, ParallelError};
pub use halo::Halo;
pub use partition::{Graph, partition};
pub use reduce::{block_max, block_sum, block_sums};

/// Plain data that may travel between ranks as bytes.
pub trait Portable: bytemuck::Pod + Send + Sync {}
impl<T: bytemuck::Pod + Send + Sync> Portable for T {}
