//! k-way partition of a node graph.

use crate::ParallelError;

/// An undirected graph in compressed rows; both directions of an edge are stored, no self-edges.
pub struct Graph<'a> {
    /// Row starts, length nodes + 1.
    pub offsets: &'a [u32],
    /// Neighbours.
    pub columns: &'a [u32],
    /// Cost of cutting every entry of `columns`, from 1, the same in both directions.
    pub weights: &'a [u32],
    /// Node coordinates \[m\], for the geometric fallback.
    pub coordinates: &'a [[f64; 3]],
}

/// Part of every node, `0..parts`.
///
/// METIS k-way when built with `mpi`; recursive coordinate bisection otherwise.
///
/// # Errors
/// [`ParallelError::Partition`] when METIS refuses the graph.
pub fn partition(graph: &Graph<'_>, parts: usize) -> Result<Vec<u32>, ParallelError> {
    let nodes = graph.coordinates.len();
    if parts <= 1 {
        return Ok(vec![0; nodes]);
    }
    #[cfg(feature = "mpi")]
    return kway(graph, parts);
    #[cfg(not(feature = "mpi"))]
    Ok(bisect(graph.coordinates, parts))
}

#[cfg(feature = "mpi")]
fn kway(graph: &Graph<'_>, parts: usize) -> Result<Vec<u32>, ParallelError> {
    let nodes = graph.coordinates.len();
    // Fewer nodes than METIS handles well: cut by coordinates.
    if nodes < 16 * parts {
        return Ok(bisect(graph.coordinates, parts));
    }
    let failed = |reason: String| ParallelError::Partition { parts, reason };
    let offsets: Vec<metis::Idx> = graph.offsets.iter().map(|&x| x as metis::Idx).collect();
    let columns: Vec<metis::Idx> = graph.columns.iter().map(|&x| x as metis::Idx).collect();
    let weights: Vec<metis::Idx> = graph.weights.iter().map(|&x| x as metis::Idx).collect();
    let mut part = vec![0 as metis::Idx; nodes];
    metis::Graph::new(1, parts as metis::Idx, &offsets, &columns)
        .map_err(|e| failed(e.to_string()))?
        .set_adjwgt(&weights)
        .set_option(metis::option::Seed(1))
        .part_kway(&mut part)
        .map_err(|e| failed(e.to_string()))?;
    Ok(part.into_iter().map(|p| p as u32).collect())
}

/// Recursive coordinate bisection along the longest extent; ties broken by index, so it is repeatable.
fn bisect(coordinates: &[[f64; 3]], parts: usize) -> Vec<u32> {
    let mut part = vec![0; coordinates.len()];
    let mut indices: Vec<u32> = (0..coordinates.len() as u32).collect();
    split(coordinates, &mut indices, 0, parts, &mut part);
    part
}

fn split(
    coordinates: &[[f64; 3]],
    indices: &mut [u32],
    first: usize,
    parts: usize,
    part: &mut [u32],
) {
    if parts == 1 || indices.is_empty() {
        indices
            .iter()
            .for_each(|&i| part[i as usize] = first as u32);
        return;
    }
    let extent = |axis: usize| {
        let values = indices.iter().map(|&i| coordinates[i as usize][axis]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(x), h.max(x))
        });
        high - low
    };
    let axis = (0..3)
        .max_by(|&a, &b| extent(a).total_cmp(&extent(b)))
        .unwrap_or(0);
    let left_parts = parts / 2;
    let middle = indices.len() * left_parts / parts;
    let key = |i: u32| coordinates[i as usize][axis];
    if middle < indices.len() {
        indices.select_nth_unstable_by(middle, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
    }
    let (left, right) = indices.split_at_mut(middle);
    split(coordinates, left, first, left_parts, part);
    split(
        coordinates,
        right,
        first + left_parts,
        parts - left_parts,
        part,
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A 12³ lattice graph.
    fn lattice() -> (Vec<u32>, Vec<u32>, Vec<[f64; 3]>) {
        let n = 12usize;
        let id = |i: usize, j: usize, k: usize| (i + n * (j + n * k)) as u32;
        let (mut offsets, mut columns, mut coordinates) = (vec![0], Vec::new(), Vec::new());
        for k in 0..n {
            for j in 0..n {
                for i in 0..n {
                    coordinates.push([i as f64, j as f64, k as f64]);
                    for (a, x) in [i, j, k].into_iter().enumerate() {
                        let mut at = [i, j, k];
                        if x > 0 {
                            at[a] = x - 1;
                            columns.push(id(at[0], at[1], at[2]));
                        }
                        if x + 1 < n {
                            at[a] = x + 1;
                            columns.push(id(at[0], at[1], at[2]));
                        }
                    }
                    offsets.push(columns.len() as u32);
                }
            }
        }
        (offsets, columns, coordinates)
    }

    fn check_balance(part: &[u32], parts: usize) {
        for p in 0..parts as u32 {
            let count = part.iter().filter(|&&q| q == p).count();
            let fair = part.len() as f64 / parts as f64;
            assert!(
                (count as f64 - fair).abs() < 0.06 * fair,
                "part {p} holds {count}, fair is {fair}"
            );
        }
    }

    #[test]
    fn parts_are_balanced() {
        let (offsets, columns, coordinates) = lattice();
        let graph = Graph {
            offsets: &offsets,
            columns: &columns,
            weights: &vec![1; columns.len()],
            coordinates: &coordinates,
        };
        for parts in [2, 3, 4] {
            check_balance(&partition(&graph, parts).expect("partition"), parts);
            check_balance(&bisect(&coordinates, parts), parts);
        }
    }
}
