//! One communicator type: MPI under `mpirun`, a single rank without.

use crate::Portable;
use std::sync::Arc;

#[cfg(feature = "mpi")]
use mpi::traits::{Communicator as _, *};

/// Errors of start-up; a failing MPI call later aborts inside MPI itself.
#[derive(Debug, thiserror::Error)]
pub enum ParallelError {
    /// MPI could not be initialised, or was initialised twice.
    #[error("MPI could not be initialised (was it initialised twice in one process?)")]
    Initialise,
    /// The partitioner refused the graph.
    #[error("graph partitioning into {parts} parts failed: {reason}")]
    Partition {
        /// Number of parts asked for.
        parts: usize,
        /// What the partitioner said.
        reason: String,
    },
}

/// The group of ranks that work on one problem. Cheap to clone.
#[derive(Clone)]
pub struct Communicator {
    inner: Arc<Inner>,
}

enum Inner {
    Single,
    #[cfg(feature = "mpi")]
    Mpi(World),
}

#[cfg(feature = "mpi")]
struct World {
    communicator: mpi::topology::SimpleCommunicator,
    // Dropped last: finalises MPI.
    _universe: Option<mpi::environment::Universe>,
}

// SAFETY: MPI is initialised with Threading::Serialized or better and all calls of this program are made from the
// thread that drives the time loop, one at a time; rayon workers only ever read `rank` and `size`-like constants.
#[cfg(feature = "mpi")]
unsafe impl Send for World {}
// SAFETY: as above.
#[cfg(feature = "mpi")]
unsafe impl Sync for World {}

impl std::fmt::Debug for Communicator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Communicator({}/{})", self.rank(), self.size())
    }
}

impl Communicator {
    /// One rank, no MPI.
    pub fn single() -> Self {
        Self {
            inner: Arc::new(Inner::Single),
        }
    }

    /// All ranks of the job. One rank when built without `mpi`.
    ///
    /// # Errors
    /// [`ParallelError::Initialise`] when MPI cannot start.
    pub fn world() -> Result<Self, ParallelError> {
        #[cfg(feature = "mpi")]
        {
            let (universe, _threading) = mpi::initialize_with_threading(mpi::Threading::Serialized)
                .ok_or(ParallelError::Initialise)?;
            let communicator = universe.world();
            let world = World {
                communicator,
                _universe: Some(universe),
            };
            Ok(Self {
                inner: Arc::new(Inner::Mpi(world)),
            })
        }
        #[cfg(not(feature = "mpi"))]
        Ok(Self::single())
    }

    /// This rank, from 0.
    pub fn rank(&self) -> usize {
        match &*self.inner {
            Inner::Single => 0,
            #[cfg(feature = "mpi")]
            Inner::Mpi(world) => world.communicator.rank() as usize,
        }
    }

    /// Number of ranks.
    pub fn size(&self) -> usize {
        match &*self.inner {
            Inner::Single => 1,
            #[cfg(feature = "mpi")]
            Inner::Mpi(world) => world.communicator.size() as usize,
        }
    }

    /// Rank 0: prints and writes what is written once.
    pub fn is_root(&self) -> bool {
        self.rank() == 0
    }

    /// Waits for every rank.
    pub fn barrier(&self) {
        #[cfg(feature = "mpi")]
        if let Inner::Mpi(world) = &*self.inner {
            world.communicator.barrier();
        }
    }

    /// Stops every rank at once with an exit code; for errors that only one rank sees.
    pub fn abort(&self, code: i32) -> ! {
        #[cfg(feature = "mpi")]
        if let Inner::Mpi(world) = &*self.inner
            && self.size() > 1
        {
            world.communicator.abort(code);
        }
        std::process::exit(code)
    }

    /// Sum over ranks.
    pub fn sum(&self, value: f64) -> f64 {
        let mut values = [value];
        self.sum_slice(&mut values);
        values[0]
    }

    /// Element-wise sum over ranks, in place.
    pub fn sum_slice(&self, values: &mut [f64]) {
        self.all_reduce(values, Reduction::Sum);
    }

    /// Element-wise largest over ranks, in place; none may be NaN.
    pub fn max_slice(&self, values: &mut [f64]) {
        self.all_reduce(values, Reduction::Max);
    }

    /// Largest over ranks; a NaN on any rank gives NaN.
    pub fn max(&self, value: f64) -> f64 {
        let mut values = [
            if value.is_nan() {
                f64::NEG_INFINITY
            } else {
                value
            },
            f64::from(u8::from(value.is_nan())),
        ];
        self.all_reduce(&mut values, Reduction::Max);
        if values[1] > 0.0 { f64::NAN } else { values[0] }
    }

    /// Smallest over ranks; a NaN on any rank gives NaN.
    pub fn min(&self, value: f64) -> f64 {
        -self.max(-value)
    }

    /// Sum of counts over ranks (exact up to 2⁵³).
    pub fn sum_count(&self, value: usize) -> usize {
        self.sum(value as f64) as usize
    }

    /// True on every rank when true on any.
    pub fn any(&self, value: bool) -> bool {
        self.max(f64::from(u8::from(value))) > 0.0
    }

    fn all_reduce(&self, values: &mut [f64], operation: Reduction) {
        match &*self.inner {
            Inner::Single => {
                let _ = (values, operation);
            }
            #[cfg(feature = "mpi")]
            Inner::Mpi(world) => {
                if self.size() == 1 {
                    return;
                }
                let operation = match operation {
                    Reduction::Sum => mpi::collective::SystemOperation::sum(),
                    Reduction::Max => mpi::collective::SystemOperation::max(),
                };
                const CHUNK: usize = 16;
                let mut sent = [0.0; CHUNK];
                for part in values.chunks_mut(CHUNK) {
                    let sent = &mut sent[..part.len()];
                    sent.copy_from_slice(part);
                    world.communicator.all_reduce_into(&*sent, part, operation);
                }
            }
        }
    }

    /// Bytes of `root` on every rank; the argument of other ranks is ignored.
    pub fn broadcast(&self, root: usize, bytes: Vec<u8>) -> Vec<u8> {
        match &*self.inner {
            Inner::Single => {
                debug_assert_eq!(root, 0);
                bytes
            }
            #[cfg(feature = "mpi")]
            Inner::Mpi(world) => {
                let process = world.communicator.process_at_rank(root as i32);
                let mut length = bytes.len() as u64;
                process.broadcast_into(&mut length);
                let mut buffer = if self.rank() == root {
                    bytes
                } else {
                    vec![0; length as usize]
                };
                for part in buffer.chunks_mut(World::CHUNK) {
                    process.broadcast_into(part);
                }
                buffer
            }
        }
    }

    /// Sends bytes to another rank, which calls [`Communicator::receive`]. For set-up; may block until received.
    ///
    /// # Panics
    /// Panics when `to` is this rank.
    pub fn send(&self, to: usize, bytes: &[u8]) {
        assert_ne!(to, self.rank(), "a rank does not send to itself");
        #[cfg(feature = "mpi")]
        if let Inner::Mpi(world) = &*self.inner {
            let process = world.communicator.process_at_rank(to as i32);
            process.send_with_tag(&(bytes.len() as u64), World::BYTES_TAG);
            for part in bytes.chunks(World::CHUNK) {
                process.send_with_tag(part, World::BYTES_TAG);
            }
        }
        #[cfg(not(feature = "mpi"))]
        let _ = bytes;
    }

    /// Bytes that rank `from` sends with [`Communicator::send`].
    ///
    /// # Panics
    /// Panics when `from` is this rank.
    pub fn receive(&self, from: usize) -> Vec<u8> {
        assert_ne!(from, self.rank(), "a rank does not send to itself");
        #[cfg(feature = "mpi")]
        if let Inner::Mpi(world) = &*self.inner {
            let process = world.communicator.process_at_rank(from as i32);
            let (length, _) = process.receive_with_tag::<u64>(World::BYTES_TAG);
            let mut bytes = vec![0; length as usize];
            for part in bytes.chunks_mut(World::CHUNK) {
                process.receive_into_with_tag(part, World::BYTES_TAG);
            }
            return bytes;
        }
        Vec::new()
    }

    /// The slices of all ranks, in rank order, on every rank. For a few numbers a rank only.
    pub fn all_gather<T: Portable>(&self, values: &[T]) -> Vec<Vec<T>> {
        self.exchange(vec![values.to_vec(); self.size()])
    }

    /// All-to-all: `outgoing[r]` goes to rank r; the result holds what came from each rank. Collective.
    ///
    /// Messages of length zero are not sent, so the cost follows the number of real neighbours, apart from one
    /// all-to-all of counts.
    ///
    /// # Panics
    /// Panics when `outgoing.len()` is not the number of ranks.
    pub fn exchange<T: Portable>(&self, outgoing: Vec<Vec<T>>) -> Vec<Vec<T>> {
        assert_eq!(outgoing.len(), self.size(), "one message for each rank");
        match &*self.inner {
            Inner::Single => outgoing,
            #[cfg(feature = "mpi")]
            Inner::Mpi(world) => world.exchange(self.rank(), outgoing),
        }
    }

    /// Non-blocking exchange with known partners and known lengths, overlapped with `work`.
    ///
    /// `outgoing` and `incoming` list (rank, buffer); both sides must agree on the lengths.
    pub fn exchange_known<T: Portable>(
        &self,
        outgoing: &[(usize, Vec<T>)],
        incoming: &mut [(usize, Vec<T>)],
        work: impl FnOnce(),
    ) {
        match &*self.inner {
            Inner::Single => {
                debug_assert!(outgoing.is_empty() && incoming.is_empty());
                work();
            }
            #[cfg(feature = "mpi")]
            Inner::Mpi(world) => world.exchange_known(outgoing, incoming, work),
        }
    }
}

#[derive(Clone, Copy)]
enum Reduction {
    Sum,
    Max,
}

#[cfg(feature = "mpi")]
impl World {
    const TAG: i32 = 17;
    const KNOWN_TAG: i32 = 18;
    const BYTES_TAG: i32 = 19;
    /// Bytes per message: MPI counts are 32-bit.
    const CHUNK: usize = 1 << 30;

    fn exchange<T: Portable>(&self, rank: usize, mut outgoing: Vec<Vec<T>>) -> Vec<Vec<T>> {
        let size = outgoing.len();
        let sent: Vec<u64> = outgoing.iter().map(|m| m.len() as u64).collect();
        let mut received = vec![0u64; size];
        self.communicator
            .all_to_all_into(&sent[..], &mut received[..]);
        let mut incoming: Vec<Vec<T>> = received
            .iter()
            .map(|&n| vec![T::zeroed(); n as usize])
            .collect();
        incoming[rank] = std::mem::take(&mut outgoing[rank]);
        let partner = |r: usize, n: u64| r != rank && n > 0;
        let requests = (0..size)
            .map(|r| usize::from(partner(r, sent[r])) + usize::from(partner(r, received[r])))
            .sum();
        mpi::request::multiple_scope(requests, |scope, collection| {
            for (r, buffer) in incoming.iter_mut().enumerate() {
                if partner(r, received[r]) {
                    let process = self.communicator.process_at_rank(r as i32);
                    let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut buffer[..]);
                    collection.add(process.immediate_receive_into_with_tag(
                        scope,
                        bytes,
                        Self::TAG,
                    ));
                }
            }
            for (r, buffer) in outgoing.iter().enumerate() {
                if partner(r, sent[r]) {
                    let process = self.communicator.process_at_rank(r as i32);
                    let bytes: &[u8] = bytemuck::cast_slice(&buffer[..]);
                    collection.add(process.immediate_send_with_tag(scope, bytes, Self::TAG));
                }
            }
            while collection.incomplete() > 0 {
                collection.wait_any();
            }
        });
        incoming
    }

    fn exchange_known<T: Portable>(
        &self,
        outgoing: &[(usize, Vec<T>)],
        incoming: &mut [(usize, Vec<T>)],
        work: impl FnOnce(),
    ) {
        mpi::request::multiple_scope(outgoing.len() + incoming.len(), |scope, collection| {
            for (r, buffer) in incoming.iter_mut() {
                let process = self.communicator.process_at_rank(*r as i32);
                let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut buffer[..]);
                collection.add(process.immediate_receive_into_with_tag(
                    scope,
                    bytes,
                    Self::KNOWN_TAG,
                ));
            }
            for (r, buffer) in outgoing {
                let process = self.communicator.process_at_rank(*r as i32);
                let bytes: &[u8] = bytemuck::cast_slice(&buffer[..]);
                collection.add(process.immediate_send_with_tag(scope, bytes, Self::KNOWN_TAG));
            }
            work();
            while collection.incomplete() > 0 {
                collection.wait_any();
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_rank_talks_to_itself() {
        let c = Communicator::single();
        assert_eq!((c.rank(), c.size()), (0, 1));
        assert_eq!(c.sum(2.5), 2.5);
        assert_eq!(c.exchange(vec![vec![1u32, 2]]), vec![vec![1, 2]]);
        assert_eq!(c.all_gather(&[7u64]), vec![vec![7]]);
        assert!(c.max(f64::NAN).is_nan());
    }
}
