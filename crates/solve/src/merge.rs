//! A matrix whose unknowns are groups of rows.

use crate::amg::transfer::Names;
use crate::{PairMatrix, SolveError};
use fibreflow_parallel::Halo;

/// Group of a row that belongs to none.
pub(crate) const NONE: u32 = u32::MAX;

/// WᵀAW, W one on the rows of a group and zero elsewhere.
pub(crate) struct Merged {
    pub(crate) matrix: PairMatrix,
    /// Group of owned and halo rows, in the numbering of the matrix.
    pub(crate) groups: Vec<u32>,
}

impl Merged {
    /// From the group of every owned row, of `count`. Collective.
    pub(crate) fn new(fine: &PairMatrix, groups: &[u32], count: usize) -> Result<Self, SolveError> {
        let halo = fine.halo();
        let rank = halo.communicator().rank() as u32;
        let mut named: Vec<[u32; 2]> = groups.iter().map(|&g| [rank, g]).collect();
        named.resize(halo.total(), [0, NONE]);
        halo.update(&mut named);
        let mut names = Names::new(rank, count);
        let local = |name: [u32; 2]| match name {
            [_, NONE] => NONE,
            name => names.local(name),
        };
        let groups: Vec<u32> = named.into_iter().map(local).collect();

        let (mut couplings, mut shifts) = (vec![Vec::new(); count], vec![0.0; count]);
        let owned = groups.iter().take(fine.owned()).enumerate();
        for (i, &group) in owned.filter(|(_, g)| **g != NONE) {
            let (sums, shift) = (&mut couplings[group as usize], &mut shifts[group as usize]);
            *shift += fine.shift()[i];
            for (j, w) in fine.row(i) {
                match groups[j] {
                    NONE => *shift += w,
                    other if other == group => {}
                    other => add(sums, other, w),
                }
            }
        }
        let halo = Halo::new(halo.communicator(), count, names.foreign());
        let row = |g: usize| couplings[g].iter().copied();
        let fixed = vec![false; halo.total()];
        let matrix = PairMatrix::from_rows(&halo, row, &fixed, Some(&shifts))?;
        Ok(Self { matrix, groups })
    }
}

/// Adds to the sum of a group: few groups touch.
fn add(sums: &mut Vec<(u32, f64)>, group: u32, weight: f64) {
    match sums.iter_mut().find(|e| e.0 == group) {
        Some(entry) => entry.1 += weight,
        None => sums.push((group, weight)),
    }
}
