//! Which segments are near each other, and what presses them apart.

use crate::Vector3;
use crate::contact::broad::search;
use crate::contact::images::Images;
use crate::contact::travel::Travel;
use crate::contact::{ContactError, Repulsion, Segments, closest_points};
use crate::linked::settings::LinkedSettings;
use crate::linked::system::Segment;
use fibreflow_parallel::Communicator;
use rayon::prelude::*;

/// Two segments within range of each other. `a` is the one of the lower id.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// Indices of the segments, those of the first fibre first.
    pub segments: [u32; 2],
    /// Place of the closest points along the segments, from their centres \[m\] (S 2.11–2.12).
    pub along: [f64; 2],
    /// −1 or 1 where that is the first or the last end of a segment, else 0.
    pub ends: [i8; 2],
    /// Distance of the axes there \[m\].
    pub distance: f64,
    /// Gap between the surfaces \[m\].
    pub gap: f64,
    /// Unit vector from a to b.
    pub normal: Vector3,
    /// Force by which they repel each other \[N\]; negative for attraction.
    pub push: f64,
    /// The part of it that is repulsion, where the step solves for it (scheme B) \[N\].
    pub repulsion: f64,
    /// Whether they rub.
    pub rubs: bool,
    /// Friction on a \[N\]; b feels the opposite.
    pub friction: Vector3,
    /// Coulomb's limit was exceeded.
    pub slides: bool,
    /// From the segments' centres to the middle of the gap \[m\] (S 2.2).
    pub arms: [Vector3; 2],
    /// Of the image of b that is next to a: what to take off the position of b \[m\].
    pub shift: Vector3,
    /// Velocity of the image of b that is next to a, by that of b itself \[m/s\].
    pub image_velocity: Vector3,
}

impl Touch {
    /// Force on a \[N\].
    pub fn force(&self) -> Vector3 {
        self.friction - self.normal * self.push
    }
}

/// Gap by decay length below which repulsion no longer grows: the floor of the star floc's run.
pub(super) const DEEPEST: f64 = -3.0;

/// The list of neighbours and what it is made from.
pub(super) struct Neighbours {
    communicator: Communicator,
    ids: Vec<u64>,
    node: Vec<u32>,
    radius: Vec<f64>,
    /// Nodes of all fibres.
    pub position: Vec<Vector3>,
    candidates: Vec<[u32; 2]>,
    travel: Travel,
    /// Strain of the box at the search; None before the first.
    built: Option<f64>,
    /// Searches so far.
    pub searches: usize,
}

impl Neighbours {
    pub fn new(communicator: Communicator) -> Self {
        Self {
            communicator,
            ids: Vec::new(),
            node: Vec::new(),
            radius: Vec::new(),
            position: Vec::new(),
            candidates: Vec::new(),
            travel: Travel::default(),
            built: None,
            searches: 0,
        }
    }

    pub fn communicator(&self) -> &Communicator {
        &self.communicator
    }

    /// Forgets all segments.
    pub fn clear(&mut self) {
        self.ids.clear();
        self.node.clear();
        self.radius.clear();
        self.position.clear();
        self.built = None;
    }

    /// Global id of a segment.
    pub fn id(&self, segment: usize) -> u64 {
        self.ids[segment]
    }

    /// Index of a segment.
    pub fn find(&self, id: u64) -> Option<u32> {
        self.ids.binary_search(&id).ok().map(|k| k as u32)
    }

    /// A segment with the first of its nodes.
    pub fn push(&mut self, id: u64, node: u32, radius: f64) {
        self.ids.push(id);
        self.node.push(node);
        self.radius.push(radius);
    }

    /// Lists all pairs within `range` of each other, and some more, after the nodes have moved in a box sheared by `strain`.
    fn update(
        &mut self,
        images: &Images,
        strain: f64,
        range: f64,
        skin: f64,
    ) -> Result<(), ContactError> {
        let half = 0.5 * skin;
        if let Some(at) = self.built {
            let step = self.travel.step(&self.position, strain - at);
            if step.longest() < f64::INFINITY {
                self.travel.add(&step);
                if !self.travel.pairs.due(half) {
                    return Ok(());
                }
                let distance = self.travel.distance(&self.travel.moved(&self.position));
                if distance < half {
                    self.travel.pairs.measured(distance);
                    return Ok(());
                }
            }
        }
        let segments = Segments {
            ids: &self.ids,
            stems: &self.ids,
            node: &self.node,
            radius: &self.radius,
            mass: &[],
            position: &self.position,
            velocity: &[],
            angular_velocity: &[],
        };
        let found = search(&self.communicator, &segments, images, range + skin)?;
        self.candidates.clear();
        self.candidates
            .extend(found.pairs.iter().map(|pair| pair.index));
        self.travel = Travel::new(&self.position, found.reach);
        self.built = Some(strain);
        self.searches += 1;
        Ok(())
    }

    fn ends(&self, segment: u32) -> [Vector3; 2] {
        let node = self.node[segment as usize] as usize;
        [self.position[node], self.position[node + 1]]
    }

    /// All pairs in range, and those farther apart by less than `more`, with their repulsion, in the order of the segments; friction is zero.
    ///
    /// # Errors
    /// A periodic box that is too short, positions that are not finite.
    pub fn touches(
        &mut self,
        segments: &[Segment],
        settings: &LinkedSettings,
        strain: f64,
        more: f64,
        out: &mut Vec<Touch>,
    ) -> Result<(), ContactError> {
        out.clear();
        let Some(law) = settings.repulsion else {
            return Ok(());
        };
        let images = Images::new(&settings.periodic, settings.shear_rate, strain);
        self.update(&images, strain, law.range + more, settings.skin)?;
        let limit = law.range + more;
        let pairs = self.candidates.par_iter().with_min_len(256);
        out.par_extend(pairs.filter_map(|&pair| self.touch(pair, segments, &law, &images, limit)));
        at_joints(out, segments);
        Ok(())
    }

    fn touch(
        &self,
        pair: [u32; 2],
        segments: &[Segment],
        law: &Repulsion,
        images: &Images,
        limit: f64,
    ) -> Option<Touch> {
        let [first, mut second] = pair.map(|s| self.ends(s));
        let image = images.beside(&first, &second);
        second.iter_mut().for_each(|x| *x -= image.shift);
        let radii = pair.map(|s| self.radius[s as usize]);
        let points = closest_points(&first, &second);
        let gap = points.distance - radii[0] - radii[1];
        if gap >= limit {
            return None;
        }
        let axes = pair.map(|s| segments[s as usize].axis);
        let normal = if points.distance > 0.0 {
            points.separation / points.distance
        } else {
            let crossed = axes[0].cross(&axes[1]).try_normalize(0.0);
            crossed.unwrap_or_else(|| across(&axes[0]))
        };
        let place = [(points.s, first), (points.t, second)];
        let along = place.map(|(s, ends)| (s - 0.5) * (ends[1] - ends[0]).norm());
        let arm =
            |k: usize, sign: f64| axes[k] * along[k] + normal * (sign * (radii[k] + 0.5 * gap));
        Some(Touch {
            segments: pair,
            along,
            ends: [points.s, points.t].map(|s| i8::from(s >= 1.0) - i8::from(s <= 0.0)),
            distance: points.distance,
            gap,
            normal,
            push: if gap < law.range {
                law.bare(gap.max(DEEPEST * law.decay))
            } else {
                0.0
            },
            repulsion: 0.0,
            rubs: gap < law.contact_gap,
            friction: Vector3::zeros(),
            slides: false,
            arms: [arm(0, 1.0), arm(1, -1.0)],
            shift: image.shift,
            image_velocity: image.velocity,
        })
    }
}

/// A body that touches a joint touches the ends of two segments in one place: the second one is dropped (S 2.4).
fn at_joints(touches: &mut Vec<Touch>, segments: &[Segment]) {
    let dropped = |t: &Touch| {
        (0..2).any(|k| {
            let s = t.segments[k];
            if t.ends[k] != -1 || segments[s as usize].first {
                return false;
            }
            let mut pair = t.segments;
            pair[k] = s - 1;
            let found = touches.binary_search_by_key(&pair, |t| t.segments);
            found.is_ok_and(|at| touches[at].ends[k] == 1)
        })
    };
    if touches.iter().any(dropped) {
        let keep: Vec<bool> = touches.iter().map(|t| !dropped(t)).collect();
        let mut flags = keep.into_iter();
        touches.retain(|_| flags.next().unwrap_or(true));
    }
}

/// Some unit vector across `p`.
pub(super) fn across(p: &Vector3) -> Vector3 {
    let axis = Vector3::ith(p.iamin(), 1.0);
    p.cross(&axis).normalize()
}
