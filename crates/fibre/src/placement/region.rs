//! Where fibres are put.

use super::PlacementError;
use super::error::check;
use crate::{PeriodicBox, Vector3};
use std::f64::consts::PI;

/// A convex part of space: a fibre lies in it when its nodes do. Ends at which the domain repeats are open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Region {
    /// A box with edges along the axes; with one closed direction a channel.
    Box {
        /// Lowest corner \[m\].
        origin: Vector3,
        /// Edges \[m\].
        size: Vector3,
    },
    /// A circular pipe along an axis.
    Pipe {
        /// Centre of the end with the lowest coordinate \[m\].
        start: Vector3,
        /// 0, 1, 2: along x, y, z.
        axis: usize,
        /// Inner radius \[m\].
        radius: f64,
        /// Length \[m\].
        length: f64,
    },
}

impl Region {
    /// Volume \[m³\].
    pub fn volume(&self) -> f64 {
        match self {
            Self::Box { size, .. } => size.product(),
            Self::Pipe { radius, length, .. } => PI * radius * radius * length,
        }
    }

    /// Lowest and highest corner of the box around it \[m\].
    pub(super) fn bounds(&self) -> [Vector3; 2] {
        match *self {
            Self::Box { origin, size } => [origin, origin + size],
            Self::Pipe {
                start,
                axis,
                radius,
                length,
            } => {
                let mut reach = Vector3::repeat(radius);
                reach[axis] = 0.0;
                let along = Vector3::ith(axis, length);
                [start - reach, start + reach + along]
            }
        }
    }

    pub(super) fn check(&self) -> Result<(), PlacementError> {
        let positive = |name, value: f64| check(value > 0.0, name, value, "a positive length in m");
        match *self {
            Self::Box { size, .. } => size
                .iter()
                .try_for_each(|edge| positive("size of the region", *edge)),
            Self::Pipe {
                axis,
                radius,
                length,
                ..
            } => {
                check(axis < 3, "axis of the pipe", axis as f64, "0, 1 or 2")?;
                positive("radius of the pipe", radius)?;
                positive("length of the pipe", length)
            }
        }
    }
}

/// The walls of a region.
#[derive(Clone, Copy, Debug)]
pub(super) struct Walls {
    /// Infinite where the region is open, and across a pipe.
    pub low: Vector3,
    pub high: Vector3,
    /// Axis, a point on the centre line and inner radius of a pipe.
    round: Option<(usize, Vector3, f64)>,
}

impl Walls {
    pub fn new(region: &Region, periodic: &PeriodicBox) -> Self {
        let [mut low, mut high] = region.bounds();
        for axis in 0..3 {
            let open = |period: f64| high[axis] - low[axis] >= period * (1.0 - 1e-9);
            if periodic.lengths[axis].is_some_and(open) {
                (low[axis], high[axis]) = (f64::NEG_INFINITY, f64::INFINITY);
            }
        }
        let mut round = None;
        if let Region::Pipe {
            start,
            axis,
            radius,
            ..
        } = *region
        {
            for across in (0..3).filter(|&a| a != axis) {
                (low[across], high[across]) = (f64::NEG_INFINITY, f64::INFINITY);
            }
            round = Some((axis, start, radius));
        }
        Self { low, high, round }
    }

    /// By how much a point has to move to be `clearance` away from all walls \[m\]; zero where it is.
    pub fn excess(&self, x: &Vector3, clearance: f64) -> Vector3 {
        let mut excess = Vector3::from_fn(|axis, _| {
            let below = self.low[axis] + clearance - x[axis];
            let above = x[axis] - (self.high[axis] - clearance);
            below.max(0.0) - above.max(0.0)
        });
        if let Some((axis, centre, radius)) = self.round {
            let mut out = x - centre;
            out[axis] = 0.0;
            let distance = out.norm();
            let beyond = distance - (radius - clearance);
            if beyond > 0.0 {
                excess -= out * (beyond / distance);
            }
        }
        excess
    }

    /// The point of a pipe's centre line beside `x`; in a box `x` itself.
    pub fn centred(&self, x: &Vector3) -> Vector3 {
        self.round.map_or(*x, |(axis, mut centre, _)| {
            centre[axis] = x[axis];
            centre
        })
    }
}
