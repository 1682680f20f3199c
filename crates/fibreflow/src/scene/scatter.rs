//! Values at scattered points, and between them.

use nalgebra::{Matrix4, Vector4};

/// Neighbours that a value is made from.
const NEIGHBOURS: usize = 8;
/// Added to the fit of a gradient, by its trace, for directions in which the points do not differ.
const SINGLE: f64 = 1e-10;
/// A point this much nearer than the last of the neighbours is the place itself.
const SAME: f64 = 1e-7;

/// Velocities at points, in a balanced tree: the middle entry of a range parts it along an axis.
#[derive(Clone, Debug)]
pub struct Scatter {
    points: Vec<[f64; 3]>,
    values: Vec<[f64; 3]>,
    /// Points in the order of the tree.
    order: Vec<u32>,
    /// Axes along which points differ.
    axes: Vec<usize>,
    low: [f64; 3],
    high: [f64; 3],
}

impl Scatter {
    /// From points and a value for each; at least one.
    pub fn new(points: Vec<[f64; 3]>, values: Vec<[f64; 3]>) -> Self {
        let bound = |c: usize, start: f64, pick: fn(f64, f64) -> f64| {
            points.iter().map(|x| x[c]).fold(start, pick)
        };
        let low = [0, 1, 2].map(|c| bound(c, f64::INFINITY, f64::min));
        let high = [0, 1, 2].map(|c| bound(c, f64::NEG_INFINITY, f64::max));
        let axes: Vec<usize> = (0..3).filter(|&c| high[c] > low[c]).collect();
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        if !axes.is_empty() {
            part(&points, &axes, &mut order, 0);
        }
        Self {
            points,
            values,
            order,
            axes,
            low,
            high,
        }
    }

    /// Value at a place: of the point that is there, else of a linear function fitted to the nearest points, the nearer
    /// the stronger (moving least squares with weights 1/d⁴); exact for linear fields. Outside the bounds of all points
    /// it is that of the nearest place inside.
    pub fn at(&self, x: [f64; 3]) -> [f64; 3] {
        let x = [0, 1, 2].map(|c| x[c].clamp(self.low[c], self.high[c]));
        let mut found = Vec::with_capacity(NEIGHBOURS + 1);
        self.search(&self.order, 0, x, &mut found);
        let nearest = self.values[found[0].1 as usize];
        let reach = found[found.len() - 1].0;
        if found[0].0 <= SAME * SAME * reach {
            return nearest;
        }
        let (mut matrix, mut sums) = (Matrix4::zeros(), [Vector4::zeros(); 3]);
        for &(square, k) in &found {
            let (point, value) = (self.points[k as usize], self.values[k as usize]);
            let scaled = |c: usize| (point[c] - x[c]) / reach.sqrt();
            let basis = Vector4::new(1.0, scaled(0), scaled(1), scaled(2));
            let weight = (reach / square).powi(2);
            matrix += weight * basis * basis.transpose();
            for (sum, v) in sums.iter_mut().zip(value) {
                *sum += weight * v * basis;
            }
        }
        let trace = matrix.trace();
        (1..4).for_each(|c| matrix[(c, c)] += SINGLE * trace);
        match matrix.cholesky() {
            Some(factor) => sums.map(|sum| factor.solve(&sum)[0]),
            None => nearest,
        }
    }

    /// Squared distances and indices of the nearest points, ascending.
    fn search(&self, range: &[u32], depth: usize, x: [f64; 3], found: &mut Vec<(f64, u32)>) {
        let middle = range.len() / 2;
        let Some(&k) = range.get(middle) else {
            return;
        };
        let point = self.points[k as usize];
        let square = (0..3).map(|c| (point[c] - x[c]).powi(2)).sum();
        let place = found.partition_point(|f| f.0 <= square);
        found.insert(place, (square, k));
        found.truncate(NEIGHBOURS);
        let axis = self.axes.get(depth % self.axes.len().max(1));
        let beyond = axis.map_or(0.0, |&c| x[c] - point[c]);
        let (below, above) = (&range[..middle], &range[middle + 1..]);
        let (near, far) = if beyond < 0.0 {
            (below, above)
        } else {
            (above, below)
        };
        self.search(near, depth + 1, x, found);
        if found.len() < NEIGHBOURS || beyond * beyond <= found[found.len() - 1].0 {
            self.search(far, depth + 1, x, found);
        }
    }
}

fn part(points: &[[f64; 3]], axes: &[usize], order: &mut [u32], depth: usize) {
    if order.len() < 2 {
        return;
    }
    let (axis, middle) = (axes[depth % axes.len()], order.len() / 2);
    let along = |k: &u32| points[*k as usize][axis];
    order.select_nth_unstable_by(middle, |a, b| along(a).total_cmp(&along(b)));
    let (below, rest) = order.split_at_mut(middle);
    part(points, axes, below, depth + 1);
    part(points, axes, &mut rest[1..], depth + 1);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a plane x = 2, at irregular places.
    fn plane(count: usize) -> Vec<[f64; 3]> {
        let fraction = |a: f64| a - a.floor();
        let place = |k: usize| {
            let k = k as f64;
            [2.0, fraction(0.754_877 * k), fraction(0.569_840 * k)]
        };
        (0..count).map(place).collect()
    }

    fn scatter(points: Vec<[f64; 3]>, value: impl Fn([f64; 3]) -> [f64; 3]) -> Scatter {
        let values = points.iter().map(|x| value(*x)).collect();
        Scatter::new(points, values)
    }

    #[test]
    fn the_nearest_points_are_found() {
        let points = plane(300);
        let scatter = scatter(points.clone(), |x| x);
        for x in [[2.0, 0.31, 0.77], [2.0, 0.0, 1.0], [1.5, 0.5, 0.5]] {
            let square = |p: &[f64; 3]| (0..3).map(|c| (p[c] - x[c]).powi(2)).sum::<f64>();
            let mut all: Vec<f64> = points.iter().map(square).collect();
            all.sort_by(f64::total_cmp);
            let mut found = Vec::new();
            scatter.search(&scatter.order, 0, x, &mut found);
            let squares: Vec<f64> = found.iter().map(|f| f.0).collect();
            assert_eq!(squares, all[..NEIGHBOURS]);
        }
    }

    #[test]
    fn linear_fields_are_exact_and_points_keep_their_value() {
        let linear = |x: [f64; 3]| [1.0 + 2.0 * x[1], x[2] - x[1], 3.0];
        let scatter = scatter(plane(100), linear);
        for x in [[2.0, 0.31, 0.77], [2.0, 0.5, 0.1], [2.0, 0.01, 0.5]] {
            let (found, wanted) = (scatter.at(x), linear(x));
            for c in 0..3 {
                assert!((found[c] - wanted[c]).abs() < 1e-8, "{found:?} {wanted:?}");
            }
        }
        for x in plane(100) {
            assert_eq!(scatter.at(x), linear(x));
        }
        // Outside: as at the nearest place of the bounds.
        assert_eq!(scatter.at([9.0, 0.31, 0.77]), scatter.at([2.0, 0.31, 0.77]));
    }

    #[test]
    fn the_error_falls_with_the_square_of_the_spacing() {
        let smooth = |x: [f64; 3]| [(3.0 * x[1]).sin() * (2.0 * x[2]).cos(), 0.0, 0.0];
        let worst = |count: usize| {
            let scatter = scatter(plane(count), smooth);
            let off = |k: usize| {
                let x = [2.0, 0.2 + 0.006 * k as f64, 0.75 - 0.005 * k as f64];
                (scatter.at(x)[0] - smooth(x)[0]).abs()
            };
            (0..100).map(off).fold(0.0, f64::max)
        };
        let [coarse, fine] = [200, 3200].map(worst);
        assert!(fine < coarse / 8.0 && fine < 5e-3, "{coarse} {fine}");
    }

    #[test]
    fn one_point_is_everywhere() {
        let scatter = scatter(vec![[0.0; 3]], |_| [1.0, 2.0, 3.0]);
        assert_eq!(scatter.at([5.0, 0.0, 1.0]), [1.0, 2.0, 3.0]);
    }
}
