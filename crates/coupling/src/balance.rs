//! Which rank should own each fibre: the one that holds its middle, unless that one has too many.

use crate::Coupling;
use bytemuck::{Pod, Zeroable};
use fibreflow_parallel::Communicator;

/// A rank may hold this many times the mean load.
const OVERLOAD: f64 = 1.2;

/// What the balance needs to know of one fibre of this rank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FibreLoad {
    /// Global id of the fibre.
    pub id: u64,
    /// What it costs, in segments.
    pub load: f64,
    /// Index of the hydrodynamic point nearest the middle of the fibre, on this rank.
    pub middle_point: usize,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Candidate {
    id: u64,
    load: f64,
}

impl Coupling {
    /// Rank that should own each fibre of this rank. Collective; needs a sample of the current points.
    ///
    /// A fibre goes to the rank that holds the element around its middle. Ranks that would then hold more than 1.2
    /// times the mean load hand their fibres of largest global id to ranks below the mean. The answer
    /// depends on positions, loads and ids only, not on who owns the fibres now.
    pub fn points_owner(&self, fibres: &[FibreLoad]) -> Vec<u32> {
        let hosts: Vec<u32> = self.hosts().collect();
        let home: Vec<u32> = fibres.iter().map(|f| hosts[f.middle_point]).collect();
        balanced(self.communicator(), fibres, home)
    }
}

fn balanced(communicator: &Communicator, fibres: &[FibreLoad], home: Vec<u32>) -> Vec<u32> {
    let ranks = communicator.size();
    let mut loads = vec![0.0; ranks];
    for (fibre, &rank) in fibres.iter().zip(&home) {
        loads[rank as usize] += fibre.load;
    }
    communicator.sum_slice(&mut loads);
    let transfers = transfers(&loads);
    if transfers.is_empty() {
        return home;
    }
    // The home rank sees all its fibres, decides, and answers in the order of the questions.
    let mut outgoing = vec![Vec::new(); ranks];
    for (fibre, &rank) in fibres.iter().zip(&home) {
        outgoing[rank as usize].push(Candidate {
            id: fibre.id,
            load: fibre.load,
        });
    }
    let asked = communicator.exchange(outgoing);
    let answers = decide(communicator.rank() as u32, &asked, transfers);
    let answered: Vec<Vec<u32>> = communicator.exchange(answers);
    let mut next = vec![0; ranks];
    let mut answer = |rank: u32| {
        next[rank as usize] += 1;
        answered[rank as usize][next[rank as usize] - 1]
    };
    home.into_iter().map(&mut answer).collect()
}

/// Load to move: (from, to, how many), from overloaded ranks to ranks below the mean, in rank order.
fn transfers(loads: &[f64]) -> Vec<(u32, u32, f64)> {
    let mean = loads.iter().sum::<f64>() / loads.len() as f64;
    let mut room: Vec<f64> = loads.iter().map(|load| (mean - load).max(0.0)).collect();
    let mut transfers = Vec::new();
    for (from, &load) in loads.iter().enumerate() {
        if load <= OVERLOAD * mean {
            continue;
        }
        let mut surplus = load - mean;
        for (to, room) in room.iter_mut().enumerate() {
            let moved = surplus.min(*room);
            if moved > 0.0 {
                transfers.push((from as u32, to as u32, moved));
                *room -= moved;
                surplus -= moved;
            }
        }
    }
    transfers
}

/// New owners of the fibres whose home is `rank`, in the order in which they were asked for.
fn decide(rank: u32, asked: &[Vec<Candidate>], transfers: Vec<(u32, u32, f64)>) -> Vec<Vec<u32>> {
    let mut answers: Vec<Vec<u32>> = asked.iter().map(|list| vec![rank; list.len()]).collect();
    let mut places: Vec<(u64, usize, usize)> = Vec::new();
    for (from, list) in asked.iter().enumerate() {
        places.extend(list.iter().enumerate().map(|(k, c)| (c.id, from, k)));
    }
    places.sort_unstable_by_key(|place| std::cmp::Reverse(place.0));
    let mut places = places.into_iter().peekable();
    for (_, to, mut amount) in transfers.into_iter().filter(|t| t.0 == rank) {
        // A fibre is moved when at least half of it is asked for.
        while let Some(&(_, from, k)) = places.peek()
            && asked[from][k].load <= 2.0 * amount
        {
            answers[from][k] = to;
            amount -= asked[from][k].load;
            places.next();
        }
    }
    answers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn balanced_loads_are_left_alone() {
        assert!(transfers(&[100.0, 110.0, 90.0]).is_empty());
        assert!(transfers(&[7.0]).is_empty());
    }

    #[test]
    fn an_overloaded_rank_hands_out_its_largest_ids() {
        let loads = [400.0, 0.0, 80.0, 0.0];
        let moves = transfers(&loads);
        let moved: f64 = moves.iter().map(|m| m.2).sum();
        assert_eq!((moves.len(), moved), (3, 280.0));
        // 40 fibres of ten segments, asked for by two ranks in no order of ids.
        let list = |first: u64| {
            (0..20).map(move |k| Candidate {
                id: first + (k * 7) % 20,
                load: 10.0,
            })
        };
        let asked = vec![list(20).collect(), list(0).collect(), vec![], vec![]];
        let answers = decide(0, &asked, moves);
        let mut after = [0.0; 4];
        for (list, owners) in asked.iter().zip(&answers) {
            for (c, &owner) in list.iter().zip(owners) {
                after[owner as usize] += c.load;
                assert_eq!(
                    owner == 0,
                    c.id < 12,
                    "fibre {} stays with the lowest ids",
                    c.id
                );
            }
        }
        assert_eq!(after, [120.0, 120.0, 40.0, 120.0]);
    }

    #[test]
    fn a_single_long_fibre_stays_where_it_is() {
        let moves = transfers(&[50.0, 0.0, 0.0, 0.0]);
        let asked = vec![vec![Candidate { id: 3, load: 50.0 }]];
        assert_eq!(decide(0, &asked, moves), vec![vec![0]]);
    }
}
