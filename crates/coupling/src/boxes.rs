//! Axis-aligned boxes and a uniform grid of bins over them.

use nalgebra::Vector3;

/// An axis-aligned box \[m\]; empty when `low > high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub low: Vector3<f64>,
    pub high: Vector3<f64>,
}

impl Bounds {
    pub fn empty() -> Self {
        Self {
            low: Vector3::repeat(f64::INFINITY),
            high: Vector3::repeat(f64::NEG_INFINITY),
        }
    }

    pub fn around<'a>(points: impl IntoIterator<Item = &'a [f64; 3]>) -> Self {
        let mut bounds = Self::empty();
        points.into_iter().for_each(|&p| bounds.include(p.into()));
        bounds
    }

    pub fn include(&mut self, point: Vector3<f64>) {
        self.low = self.low.inf(&point);
        self.high = self.high.sup(&point);
    }

    pub fn merge(&mut self, other: &Self) {
        self.low = self.low.inf(&other.low);
        self.high = self.high.sup(&other.high);
    }

    pub fn inflated(&self, by: f64) -> Self {
        Self {
            low: self.low.add_scalar(-by),
            high: self.high.add_scalar(by),
        }
    }

    pub fn contains(&self, point: &Vector3<f64>) -> bool {
        (0..3).all(|k| self.low[k] <= point[k] && point[k] <= self.high[k])
    }

    /// Distance \[m\] from a point to the box, 0 inside; infinite from an empty box.
    pub fn distance(&self, point: &Vector3<f64>) -> f64 {
        let outside = |k: usize| {
            (self.low[k] - point[k])
                .max(point[k] - self.high[k])
                .max(0.0)
        };
        Vector3::new(outside(0), outside(1), outside(2)).norm()
    }

    pub fn centre(&self) -> Vector3<f64> {
        0.5 * (self.low + self.high)
    }
}

/// Items listed by the bins that their boxes touch, in ascending order in every bin.
#[derive(Debug)]
pub(crate) struct Bins {
    bounds: Bounds,
    counts: [usize; 3],
    widths: Vector3<f64>,
    offsets: Vec<u32>,
    items: Vec<u32>,
}

impl Bins {
    /// About one bin an item, cubic where the extents allow it.
    pub fn new(boxes: &[Bounds]) -> Self {
        Self::at_least(boxes, 0.0)
    }

    /// Bins that are not narrower than `least` \[m\].
    pub fn at_least(boxes: &[Bounds], least: f64) -> Self {
        let mut bounds = Bounds::empty();
        boxes.iter().for_each(|b| bounds.merge(b));
        if boxes.is_empty() {
            bounds = Bounds::around(&[[0.0; 3]]);
        }
        let extent = bounds.high - bounds.low;
        let smallest = extent.max() * 1e-6 + f64::MIN_POSITIVE;
        let volume: f64 = extent.iter().map(|e| e.max(smallest)).product();
        let width = (volume / boxes.len().max(1) as f64).cbrt().max(least);
        let counts: [usize; 3] =
            std::array::from_fn(|k| ((extent[k] / width).ceil() as usize).clamp(1, 1 << 16));
        let widths = Vector3::from_fn(|k, _| extent[k].max(smallest) / counts[k] as f64);
        let mut bins = Self {
            bounds,
            counts,
            widths,
            offsets: vec![0; counts.iter().product::<usize>() + 1],
            items: Vec::new(),
        };
        for b in boxes {
            bins.covered(b, |bin, offsets, _| offsets[bin + 1] += 1);
        }
        for k in 1..bins.offsets.len() {
            bins.offsets[k] += bins.offsets[k - 1];
        }
        bins.items = vec![0; bins.offsets.last().map_or(0, |&n| n as usize)];
        let mut next = bins.offsets.clone();
        for (item, b) in boxes.iter().enumerate() {
            bins.covered(b, |bin, _, items| {
                items[next[bin] as usize] = item as u32;
                next[bin] += 1;
            });
        }
        bins
    }

    fn covered(&mut self, b: &Bounds, mut visit: impl FnMut(usize, &mut [u32], &mut [u32])) {
        let (low, high) = (self.cell(&b.low), self.cell(&b.high));
        for k in low[2]..=high[2] {
            for j in low[1]..=high[1] {
                for i in low[0]..=high[0] {
                    let bin = i + self.counts[0] * (j + self.counts[1] * k);
                    visit(bin, &mut self.offsets, &mut self.items);
                }
            }
        }
    }

    /// Cell of a point, clamped to the grid.
    fn cell(&self, point: &Vector3<f64>) -> [usize; 3] {
        std::array::from_fn(|k| {
            let x = (point[k] - self.bounds.low[k]) / self.widths[k];
            (x.max(0.0) as usize).min(self.counts[k] - 1)
        })
    }

    fn items(&self, cell: [usize; 3]) -> &[u32] {
        let bin = cell[0] + self.counts[0] * (cell[1] + self.counts[1] * cell[2]);
        &self.items[self.offsets[bin] as usize..self.offsets[bin + 1] as usize]
    }

    /// Items whose boxes may contain the point.
    pub fn at(&self, point: &Vector3<f64>) -> &[u32] {
        self.items(self.cell(point))
    }

    /// Visits every item listed in the bins that a box touches; once when the items are points.
    pub fn within(&self, b: &Bounds, mut visit: impl FnMut(u32)) {
        let (low, high) = (self.cell(&b.low), self.cell(&b.high));
        for k in low[2]..=high[2] {
            for j in low[1]..=high[1] {
                for i in low[0]..=high[0] {
                    self.items([i, j, k]).iter().for_each(|&item| visit(item));
                }
            }
        }
    }

    /// Visits items in rings of bins outwards from the point; `visit` returns the distance beyond which nothing
    /// interests it any more.
    pub fn outwards(&self, point: &Vector3<f64>, mut visit: impl FnMut(u32) -> f64) {
        let centre = self.cell(point).map(|c| c as isize);
        let wide = |k: usize| {
            if self.counts[k] > 1 {
                self.widths[k]
            } else {
                f64::INFINITY
            }
        };
        let width = wide(0).min(wide(1)).min(wide(2));
        let mut reach = f64::INFINITY;
        for ring in 0..=self.counts.iter().max().map_or(0, |&c| c as isize) {
            // A bin of this ring is at least ring − 1 widths away.
            if ring > 0 && (ring - 1) as f64 * width > reach {
                break;
            }
            self.ring(centre, ring, |item| reach = visit(item));
        }
    }

    fn ring(&self, centre: [isize; 3], ring: isize, mut visit: impl FnMut(u32)) {
        let span = |k: usize| {
            (centre[k] - ring).max(0)..=(centre[k] + ring).min(self.counts[k] as isize - 1)
        };
        for k in span(2) {
            for j in span(1) {
                let inner = (k - centre[2]).abs() < ring && (j - centre[1]).abs() < ring;
                let step = if inner { (2 * ring).max(1) as usize } else { 1 };
                let row = if inner {
                    (centre[0] - ring..=centre[0] + ring).step_by(step)
                } else {
                    (*span(0).start()..=*span(0).end()).step_by(step)
                };
                for i in row.filter(|i| (0..self.counts[0] as isize).contains(i)) {
                    let cell = [i as usize, j as usize, k as usize];
                    self.items(cell).iter().for_each(|&item| visit(item));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    fn random_boxes(n: usize) -> Vec<Bounds> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut corner = || {
            [
                rng.random_range(0.0..4.0),
                rng.random(),
                rng.random_range(0.0..0.1),
            ]
        };
        (0..n)
            .map(|_| {
                let c: [f64; 3] = corner();
                Bounds::around([&c]).inflated(0.02)
            })
            .collect()
    }

    #[test]
    fn every_box_is_found_from_each_point_in_it() {
        let boxes = random_boxes(300);
        let bins = Bins::new(&boxes);
        for (k, b) in boxes.iter().enumerate() {
            for point in [b.low, b.high, b.centre()] {
                assert!(bins.at(&point).contains(&(k as u32)));
            }
        }
    }

    #[test]
    fn the_outward_search_finds_the_nearest_as_brute_force_does() {
        let boxes = random_boxes(300);
        let bins = Bins::new(&boxes);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        for _ in 0..200 {
            let p = Vector3::from_fn(|_, _| rng.random_range(-2.0..5.0));
            let brute = boxes
                .iter()
                .map(|b| b.distance(&p))
                .fold(f64::INFINITY, f64::min);
            let mut best = f64::INFINITY;
            bins.outwards(&p, |item| {
                best = boxes[item as usize].distance(&p).min(best);
                best
            });
            assert_eq!(best, brute);
        }
    }
}
