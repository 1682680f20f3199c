//! Fourth order on smooth lines: diagonal-norm summation by parts with second-order ends.
//!
//! In the computational coordinate ξ (node number) the first derivative is that of Kreiss & Scherer (1974; the 4-2 operator
//! of Strand 1994) and the second the compact one of Mattsson & Nordström (2004). Applied to the mapping x(ξ):
//!
//! - H_i = Σ_b Q_ib x_b instead of H°_i, so that the gradient of x is one;
//! - w_ab = w°_ab (b − a)/(x_b − x_a), so that L x = 0 away from the ends. Divided differences of a smooth function are a
//!   smooth function of the place of the pair, and the moments of w° that make it fourth order apply to them as well.
//!
//! The energy Σ w (φ_b − φ_a)² is at least that of the two-point weights in the inner part, whatever the stretching: by
//! Cauchy–Schwarz a pair over two spacings takes at most 1/6 of each, and an inner spacing is in two of them, of 4/3.
//!
//! Where neighbouring spacings jump the mapping has no derivative: segments end there and are joined at the node by adding
//! norms and pairs, which keeps all sums and symmetries. Segments of fewer than eight nodes are of second order.

use super::{Line, LinePair};

/// Neighbouring spacings of a smooth mesh differ by less than this ratio.
const SMOOTH: f64 = 1.5;

/// Fewest nodes of a segment with two ends, and of a smooth periodic line.
const FEWEST: usize = 8;

/// (a, distance, Q, w°) of the pairs that differ from the inner ones, from an end of a segment.
const END: [(usize, u32, f64, f64); 9] = [
    (0, 1, 59.0 / 96.0, 59.0 / 48.0),
    (0, 2, -1.0 / 12.0, -1.0 / 12.0),
    (0, 3, -1.0 / 32.0, -1.0 / 48.0),
    (1, 1, 59.0 / 96.0, 59.0 / 48.0),
    (1, 2, 0.0, 0.0),
    (2, 1, 59.0 / 96.0, 59.0 / 48.0),
    (2, 2, -1.0 / 12.0, -1.0 / 12.0),
    (3, 1, 2.0 / 3.0, 4.0 / 3.0),
    (3, 2, -1.0 / 12.0, -1.0 / 12.0),
];

/// (Q, w°) of an inner pair at distance 1 and 2.
const INNER: [(f64, f64); 2] = [(2.0 / 3.0, 4.0 / 3.0), (-1.0 / 12.0, -1.0 / 12.0)];

impl Line {
    /// Fourth order where the mesh is smooth, second where it is not and for lines of fewer than eight nodes; third order
    /// near ends, in the maximum norm of a solution. Arguments as for [`Line::second`].
    pub fn fourth(coordinates: &[f64], period: Option<f64>) -> Self {
        let n = coordinates.len();
        if n < FEWEST {
            return Self::second(coordinates, period);
        }
        let at = |i: usize| coordinates[i % n] + (i / n) as f64 * period.unwrap_or(0.0);
        let jumps = |i: usize| {
            let (before, after) = (at(i) - at(i - 1), at(i + 1) - at(i));
            before.max(after) > SMOOTH * before.min(after)
        };
        let mut joints: Vec<usize> = match period {
            Some(_) => (0..n).filter(|i| jumps(i + n)).collect(),
            None => (0..n - 1).filter(|&i| i == 0 || jumps(i)).collect(),
        };
        let mut line = Self {
            periodic: period.is_some(),
            norm: vec![0.0; n],
            pairs: Vec::with_capacity(2 * n),
        };
        match joints.first() {
            None => {
                for a in 0..n {
                    for (distance, (q, w)) in (1..).zip(INNER) {
                        line.add(at, a, distance, q, w);
                    }
                }
            }
            Some(first) => {
                joints.push(period.map_or(n - 1, |_| first + n));
                for ends in joints.windows(2) {
                    line.add_segment(at, ends[0], ends[1]);
                }
            }
        }
        line.pairs.sort_by_key(|pair| (pair.a, pair.distance));
        line
    }

    /// Nodes `first` to `last`, both included.
    fn add_segment(&mut self, at: impl Fn(usize) -> f64 + Copy, first: usize, last: usize) {
        let spacings = last - first;
        if spacings + 1 < FEWEST {
            (first..last).for_each(|a| self.add(at, a, 1, 0.5, 1.0));
            return;
        }
        for &(a, distance, q, w) in END.iter().filter(|pair| pair.2 != 0.0) {
            self.add(at, first + a, distance, q, w);
            let mirrored = spacings - a - distance as usize;
            // On short segments the two ends share pairs in the middle, with the same weights.
            if !in_end(mirrored, distance) {
                self.add(at, first + mirrored, distance, q, w);
            }
        }
        for a in 0..spacings {
            for (distance, (q, w)) in (1..).zip(INNER) {
                let inside = a + distance as usize <= spacings;
                if inside && !in_end(a, distance) && !in_end_mirrored(spacings, a, distance) {
                    self.add(at, first + a, distance, q, w);
                }
            }
        }
    }

    fn add(&mut self, at: impl Fn(usize) -> f64, a: usize, distance: u32, q: f64, w: f64) {
        let n = self.norm.len();
        let b = a + distance as usize;
        let length = at(b) - at(a);
        self.norm[a % n] += q * length;
        self.norm[b % n] += q * length;
        self.pairs.push(LinePair {
            a: (a % n) as u32,
            distance,
            skew: 2.0 * q,
            stiffness: w * f64::from(distance) / length,
        });
    }
}

fn in_end(a: usize, distance: u32) -> bool {
    END.iter().any(|pair| (pair.0, pair.1) == (a, distance))
}

fn in_end_mirrored(spacings: usize, a: usize, distance: u32) -> bool {
    in_end(spacings - a - distance as usize, distance)
}

#[cfg(test)]
mod tests;
