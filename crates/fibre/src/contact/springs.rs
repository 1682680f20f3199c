//! Friction springs that outlive a search for pairs, a change of owner and a restart.

use crate::Vector3;
use crate::contact::grid::mix;
use bytemuck::{Pod, Zeroable};
use fibreflow_parallel::Communicator;
use rayon::prelude::*;

/// Tangential spring of one contact: what a checkpoint keeps of it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct FrictionRecord {
    /// Global id of the first segment.
    pub a: u64,
    /// Global id of the second segment (above `a`), or bit 63 and 2 × wall + end.
    pub b: u64,
    /// Spring vector \[m\], as a sees it.
    pub spring: [f64; 3],
}

impl FrictionRecord {
    fn key(&self) -> [u64; 2] {
        [self.a, self.b]
    }
}

/// Springs of the `wanted` contacts, zero where there was none. Collective when `moved`.
///
/// `known` are the springs this rank has computed itself. When segments changed owner (`moved`, the same on every
/// rank), what is not known here is asked from the rank that the contact hashes to, where every rank has left the
/// springs it had `published`.
pub(super) fn carry(
    communicator: &Communicator,
    mut known: Vec<FrictionRecord>,
    published: &[FrictionRecord],
    wanted: &[[u64; 2]],
    moved: bool,
) -> Vec<Vector3> {
    known.sort_unstable_by_key(FrictionRecord::key);
    if moved {
        let foreign = fetch(communicator, &known, published, wanted);
        known.extend(foreign);
        known.sort_unstable_by_key(FrictionRecord::key);
    }
    let spring = |key: &[u64; 2]| find(&known, key).map_or(Vector3::zeros(), |r| r.spring.into());
    wanted.par_iter().map(spring).collect()
}

fn find<'a>(sorted: &'a [FrictionRecord], key: &[u64; 2]) -> Option<&'a FrictionRecord> {
    let place = sorted.binary_search_by_key(key, FrictionRecord::key).ok()?;
    Some(&sorted[place])
}

fn fetch(
    communicator: &Communicator,
    known: &[FrictionRecord],
    published: &[FrictionRecord],
    wanted: &[[u64; 2]],
) -> Vec<FrictionRecord> {
    let ranks = communicator.size();
    let home = |key: &[u64; 2]| (mix(mix(key[0]) ^ key[1]) % ranks as u64) as usize;
    let mut left = vec![Vec::new(); ranks];
    for record in published {
        left[home(&record.key())].push(*record);
    }
    let mut kept: Vec<FrictionRecord> = communicator.exchange(left).into_iter().flatten().collect();
    kept.sort_unstable_by_key(FrictionRecord::key);
    let mut questions = vec![Vec::new(); ranks];
    for key in wanted {
        if find(known, key).is_none() {
            questions[home(key)].push(*key);
        }
    }
    let asked = communicator.exchange(questions);
    let answer = |keys: &Vec<[u64; 2]>| {
        let found = keys.iter().filter_map(|key| find(&kept, key).copied());
        found.collect::<Vec<_>>()
    };
    let answers = communicator.exchange(asked.iter().map(answer).collect());
    answers.into_iter().flatten().collect()
}
