//! Records of any length keyed by a global id, and how they find their owner.

use fibreflow_parallel::Communicator;

/// Lists of 64-bit words, each with an id; compressed storage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Records {
    ids: Vec<u64>,
    offsets: Vec<u64>,
    words: Vec<u64>,
}

impl Default for Records {
    fn default() -> Self {
        Self {
            ids: Vec::new(),
            offsets: vec![0],
            words: Vec::new(),
        }
    }
}

impl Records {
    /// From stored parts; None when they do not fit together.
    pub fn from_parts(ids: Vec<u64>, offsets: Vec<u64>, words: Vec<u64>) -> Option<Self> {
        let fits = offsets.len() == ids.len() + 1
            && offsets.first() == Some(&0)
            && offsets.last() == Some(&(words.len() as u64))
            && offsets.is_sorted();
        fits.then_some(Self {
            ids,
            offsets,
            words,
        })
    }

    /// Ids, starts (one more than ids), words.
    pub fn parts(&self) -> (&[u64], &[u64], &[u64]) {
        (&self.ids, &self.offsets, &self.words)
    }

    /// Number of records.
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// True without records.
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    /// Adds a record.
    pub fn push(&mut self, id: u64, words: impl IntoIterator<Item = u64>) {
        self.ids.push(id);
        self.words.extend(words);
        self.offsets.push(self.words.len() as u64);
    }

    /// All records in order.
    pub fn iter(&self) -> impl Iterator<Item = (u64, &[u64])> {
        (0..self.len()).map(|k| (self.ids[k], self.words(k)))
    }

    /// Adds all records of another list.
    pub fn extend(&mut self, other: &Self) {
        for (id, words) in other.iter() {
            self.push(id, words.iter().copied());
        }
    }

    /// Puts the records in the order of their ids.
    pub fn sort(&mut self) {
        let sorted = self.order().into_iter();
        let mut result = Self::default();
        sorted.for_each(|k| result.push(self.ids[k], self.words(k).iter().copied()));
        *self = result;
    }

    fn words(&self, k: usize) -> &[u64] {
        &self.words[self.offsets[k] as usize..self.offsets[k + 1] as usize]
    }

    fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.len()).collect();
        order.sort_by_key(|&k| self.ids[k]);
        order
    }

    /// The records with the `wanted` ids, in that order, from whichever ranks hold them; None when one is nowhere.
    /// Collective.
    ///
    /// Records and requests meet on rank `id % ranks`, so no rank ever holds more than its share.
    pub fn redistribute(&self, wanted: &[u64], communicator: &Communicator) -> Option<Self> {
        let ranks = communicator.size();
        let home = |id: u64| (id % ranks as u64) as usize;
        let mut sent = vec![Vec::new(); ranks];
        for (id, words) in self.iter() {
            append(&mut sent[home(id)], id, words);
        }
        let mut directory = Self::default();
        for message in communicator.exchange(sent) {
            directory.read(&message);
        }
        directory.sort();

        let mut requests = vec![Vec::new(); ranks];
        wanted.iter().for_each(|&id| requests[home(id)].push(id));
        let mut answers = vec![Vec::new(); ranks];
        for (answer, ids) in answers.iter_mut().zip(communicator.exchange(requests)) {
            for id in ids {
                if let Ok(k) = directory.ids.binary_search(&id) {
                    append(answer, id, directory.words(k));
                }
            }
        }
        let mut received = Self::default();
        for message in communicator.exchange(answers) {
            received.read(&message);
        }
        received.sort();
        let mut result = Self::default();
        for &id in wanted {
            let k = received.ids.binary_search(&id).ok()?;
            result.push(id, received.words(k).iter().copied());
        }
        Some(result)
    }

    fn read(&mut self, message: &[u64]) {
        let mut rest = message;
        while let [id, length, tail @ ..] = rest {
            let (words, next) = tail.split_at(*length as usize);
            self.push(*id, words.iter().copied());
            rest = next;
        }
    }
}

fn append(message: &mut Vec<u64>, id: u64, words: &[u64]) {
    message.extend([id, words.len() as u64]);
    message.extend_from_slice(words);
}
