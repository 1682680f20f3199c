//! One layer of foreign entries kept up to date by packed, non-blocking messages.

use crate::{Communicator, Portable};

/// Which owned entries other ranks need, and which local entries are theirs.
///
/// A field has `owned` entries first, then the halo entries, `owned..total`.
#[derive(Clone, Debug)]
pub struct Halo {
    communicator: Communicator,
    owned: usize,
    total: usize,
    neighbours: Vec<Neighbour>,
}

#[derive(Clone, Debug)]
struct Neighbour {
    rank: usize,
    /// Owned local entries that the neighbour holds in its halo.
    send: Vec<u32>,
    /// Local halo entries that the neighbour owns, in the order in which it sends.
    receive: Vec<u32>,
}

impl Halo {
    /// No neighbours: every entry is owned.
    pub fn none(communicator: &Communicator, owned: usize) -> Self {
        Self {
            communicator: communicator.clone(),
            owned,
            total: owned,
            neighbours: Vec::new(),
        }
    }

    /// From the halo entries' owners and their local index on the owner. Collective.
    ///
    /// `owners[k] = (rank, index on that rank)` belongs to local entry `owned + k`.
    pub fn new(communicator: &Communicator, owned: usize, owners: &[(u32, u32)]) -> Self {
        let size = communicator.size();
        let mut wanted = vec![Vec::new(); size];
        let mut receive = vec![Vec::new(); size];
        for (k, &(rank, index)) in owners.iter().enumerate() {
            wanted[rank as usize].push(index);
            receive[rank as usize].push((owned + k) as u32);
        }
        let asked = communicator.exchange(wanted);
        let neighbours = asked
            .into_iter()
            .zip(receive)
            .enumerate()
            .filter(|(_, (send, receive))| !send.is_empty() || !receive.is_empty())
            .map(|(rank, (send, receive))| Neighbour {
                rank,
                send,
                receive,
            })
            .collect();
        Self {
            communicator: communicator.clone(),
            owned,
            total: owned + owners.len(),
            neighbours,
        }
    }

    /// The ranks that this halo spans.
    pub fn communicator(&self) -> &Communicator {
        &self.communicator
    }

    /// Entries this rank owns.
    pub fn owned(&self) -> usize {
        self.owned
    }

    /// Owned and halo entries.
    pub fn total(&self) -> usize {
        self.total
    }

    /// Entries sent in one update, over all neighbours.
    pub fn sent_entries(&self) -> usize {
        self.neighbours.iter().map(|n| n.send.len()).sum()
    }

    /// Copies owners' values into the halo entries of `field` (length `total`). Collective.
    pub fn update<T: Portable>(&self, field: &mut [T]) {
        self.update_while(field, |_| ());
    }

    /// As [`Halo::update`], doing `work` on the field while messages travel; halo entries are stale inside `work`.
    pub fn update_while<T: Portable>(&self, field: &mut [T], work: impl FnOnce(&[T])) {
        debug_assert_eq!(field.len(), self.total);
        if self.neighbours.is_empty() {
            return work(field);
        }
        let outgoing = self.packed(|n| (&n.send, &n.receive), field);
        let mut incoming = self.room(|n| n.receive.len());
        let reader: &[T] = field;
        self.communicator
            .exchange_known(&outgoing, &mut incoming, || work(reader));
        for (_, values, receive) in self.received(&incoming, |n| &n.receive) {
            receive
                .iter()
                .zip(values)
                .for_each(|(&i, &v)| field[i as usize] = v);
        }
    }

    /// Adds what was put into halo entries to their owners and clears the halo: the adjoint of [`Halo::update`].
    ///
    /// Contributions are added in rank order. Collective.
    pub fn accumulate<const N: usize>(&self, field: &mut [[f64; N]]) {
        debug_assert_eq!(field.len(), self.total);
        if self.neighbours.is_empty() {
            return;
        }
        let outgoing = self.packed(|n| (&n.receive, &n.send), field);
        let mut incoming = self.room(|n| n.send.len());
        self.communicator
            .exchange_known(&outgoing, &mut incoming, || ());
        for (_, values, send) in self.received(&incoming, |n| &n.send) {
            for (&i, value) in send.iter().zip(values) {
                field[i as usize]
                    .iter_mut()
                    .zip(value)
                    .for_each(|(f, v)| *f += v);
            }
        }
        field[self.owned..].fill([0.0; N]);
    }

    fn packed<T: Portable>(
        &self,
        lists: impl Fn(&Neighbour) -> (&Vec<u32>, &Vec<u32>),
        field: &[T],
    ) -> Vec<(usize, Vec<T>)> {
        let pack = |n: &Neighbour| {
            (
                n.rank,
                lists(n).0.iter().map(|&i| field[i as usize]).collect(),
            )
        };
        self.neighbours
            .iter()
            .filter(|n| !lists(n).0.is_empty())
            .map(pack)
            .collect()
    }

    fn room<T: Portable>(&self, length: impl Fn(&Neighbour) -> usize) -> Vec<(usize, Vec<T>)> {
        let with = self.neighbours.iter().filter(|n| length(n) > 0);
        with.map(|n| (n.rank, vec![T::zeroed(); length(n)]))
            .collect()
    }

    fn received<'a, T>(
        &'a self,
        incoming: &'a [(usize, Vec<T>)],
        list: impl Fn(&'a Neighbour) -> &'a Vec<u32> + 'a,
    ) -> impl Iterator<Item = (usize, &'a Vec<T>, &'a Vec<u32>)> {
        let lists = self.neighbours.iter().map(list).filter(|l| !l.is_empty());
        incoming
            .iter()
            .zip(lists)
            .map(|((rank, values), list)| (*rank, values, list))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_neighbours_means_no_change() {
        let halo = Halo::none(&Communicator::single(), 3);
        let mut field = [1.0, 2.0, 3.0];
        let mut seen = 0.0;
        halo.update_while(&mut field, |f| seen = f.iter().sum());
        assert_eq!(seen, 6.0);
        let mut vectors = [[1.0; 4]; 3];
        halo.accumulate(&mut vectors);
        assert_eq!(vectors, [[1.0; 4]; 3]);
    }
}
