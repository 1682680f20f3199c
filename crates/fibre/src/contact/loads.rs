//! Contact loads by segment; those of segments that nothing touches are neither written nor read.

use crate::contact::{SegmentLoad, Segments};
use fibreflow_parallel::block_sum;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Segments that one thread takes at least.
const GRAIN: usize = 2048;

/// What contacts do to a segment.
#[derive(Clone, Copy, Default)]
pub(super) struct Acting {
    pub load: SegmentLoad,
    /// The part of it whose work is lost.
    pub drag: SegmentLoad,
}

#[derive(Default)]
pub(super) struct Loads {
    touched: Vec<AtomicBool>,
    acting: Vec<Acting>,
}

impl Loads {
    pub fn new(segments: usize) -> Self {
        Self {
            touched: (0..segments).map(|_| AtomicBool::new(false)).collect(),
            acting: vec![Acting::default(); segments],
        }
    }

    pub fn count(&self) -> usize {
        self.acting.len()
    }

    pub fn clear(&mut self) {
        for touched in &mut self.touched {
            *touched.get_mut() = false;
        }
    }

    /// Says that a segment is touched; [`Loads::gather`] then asks for its load.
    pub fn mark(&self, segment: usize) {
        // Every thread writes the same value, and the loop's end orders it before any read.
        self.touched[segment].store(true, Ordering::Relaxed);
    }

    /// Sets the loads of the touched segments.
    pub fn gather(&mut self, sum: impl Fn(usize) -> Acting + Sync) {
        let touched = self.touched.par_chunks_mut(GRAIN);
        let blocks = touched.zip(self.acting.par_chunks_mut(GRAIN)).enumerate();
        blocks.for_each(|(block, (touched, acting))| {
            for (i, (touched, acting)) in touched.iter_mut().zip(acting).enumerate() {
                if *touched.get_mut() {
                    *acting = sum(block * GRAIN + i);
                }
            }
        });
    }

    /// What acts on a segment, to add to.
    pub fn at(&mut self, segment: usize) -> &mut Acting {
        let acting = &mut self.acting[segment];
        if !std::mem::replace(self.touched[segment].get_mut(), true) {
            *acting = Acting::default();
        }
        acting
    }

    /// What acts on a segment, `None` when nothing does, or before any forces.
    #[inline]
    pub fn get(&self, segment: usize) -> Option<&Acting> {
        let touched = self.touched.get(segment)?.load(Ordering::Relaxed);
        touched.then(|| &self.acting[segment])
    }

    /// Power of the drag on segments that move so \[W\].
    pub fn drag_power(&self, segments: &Segments<'_>) -> f64 {
        block_sum(self.count(), |range| {
            let each = |i: usize| {
                let [start, end] = segments.end_velocities(i);
                let acting = self.get(i);
                acting.map_or(0.0, |a| a.drag.power(&start, &end, &segments.spin(i)))
            };
            range.map(each).sum()
        })
    }
}
