//! Change of owner: whole fibres travel between ranks.

use crate::{FibreError, FibreRecord, FibreSystem};

impl FibreSystem {
    /// Hands every fibre to a rank: `destination[f]` is the new owner of local fibre f. Local order stays that of the
    /// ids; friction springs follow at the next step, and [`FibreSystem::state`] before it would miss them. Collective.
    ///
    /// # Errors
    /// [`FibreError::Owners`] when the list does not fit, the same on every rank.
    pub fn migrate(&mut self, destination: &[u32]) -> Result<(), FibreError> {
        let ranks = self.communicator.size();
        let fits =
            destination.len() == self.fibres() && destination.iter().all(|&r| (r as usize) < ranks);
        if self.communicator.any(!fits) {
            return Err(FibreError::Owners {
                fibres: self.fibres(),
                given: destination.len(),
            });
        }
        let rank = self.communicator.rank();
        let leaves = destination.iter().any(|&r| r as usize != rank);
        if !self.communicator.any(leaves) {
            return Ok(());
        }
        // [id, number of words, words …] for each fibre.
        let mut messages = vec![Vec::new(); ranks];
        for (f, &owner) in destination.iter().enumerate() {
            let record = self.record(f, &[]);
            let message = &mut messages[owner as usize];
            message.extend([record.id, record.words.len() as u64]);
            message.extend(record.words);
        }
        let mut records = Vec::new();
        for message in self.communicator.exchange(messages) {
            let mut rest = &message[..];
            while let [id, length, tail @ ..] = rest {
                let (words, next) = tail.split_at(*length as usize);
                records.push(FibreRecord {
                    id: *id,
                    words: words.to_vec(),
                });
                rest = next;
            }
        }
        self.rebuild(records)
    }
}
