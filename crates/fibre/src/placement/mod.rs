//! Random fibres that do not overlap: random sequential addition, then moves that remove what overlaps are left.
//!
//! Lengths and directions are drawn first and kept: a fibre that finds no free place is put down where it overlaps, and
//! [`relax`] moves and turns all fibres until none overlap, so that the distribution of directions is the one asked for
//! and not the one that is easy to place. The work grows linearly with the number of fibres, and the answer depends on
//! the settings only, not on ranks or threads.

mod cells;
mod centre_line;
mod crowd;
mod error;
mod orientation;
mod quantity;
mod region;
mod relax;

pub use centre_line::CentreLine;
pub use error::PlacementError;
pub use orientation::{Orbits, Orientation, orbit_constant};
pub use quantity::Quantity;
pub use region::Region;

use crate::{Matrix3, PeriodicBox, Quaternion, Vector3};
use crowd::{Body, Crowd, Turns};
use error::check;
use orientation::{Sampler, around, sequence};
use quantity::Draws;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use region::Walls;
use std::f64::consts::{PI, TAU};

/// Random places tried for a fibre; where none is free it is put down where it overlaps least.
const ATTEMPTS: usize = 20;

/// All fibres that have to keep clear of each other.
#[derive(Clone, Debug)]
pub struct Population {
    /// Directions in which space repeats.
    pub periodic: PeriodicBox,
    /// What is placed.
    pub groups: Vec<PlacementGroup>,
    /// Fibres that are there already and stay where they are.
    pub held: Vec<HeldFibre>,
}

/// A fibre that others keep clear of.
#[derive(Clone, Debug)]
pub struct HeldFibre {
    /// Its nodes \[m\].
    pub nodes: Vec<Vector3>,
    /// Its radius \[m\].
    pub radius: f64,
}

/// Fibres that are placed with one set of rules.
#[derive(Clone, Debug)]
pub struct PlacementGroup {
    /// How many fibres.
    pub amount: Amount,
    /// Length along the axis \[m\].
    pub length: Quantity,
    /// Radius \[m\].
    pub radius: f64,
    /// Form of the axis.
    pub centre_line: CentreLine,
    /// Segments of a fibre of mean length; others have segments of about the same length.
    pub segments: usize,
    /// Where they are.
    pub region: Region,
    /// Least distance between surfaces of fibres, and of fibres and walls \[m\]. Between groups it is the mean of theirs.
    pub gap: f64,
    /// Directions.
    pub orientation: Orientation,
    /// Seed of the random numbers: the same seed gives the same fibres.
    pub seed: u64,
}

/// How much is placed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amount {
    /// This many fibres.
    Count(usize),
    /// As many fibres as bring their cylinders πr²L nearest to this fraction of the region.
    VolumeFraction(f64),
}

/// One fibre as placed.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedFibre {
    /// Nodes \[m\]; their mean lies inside the periodic box, the nodes are not wrapped.
    pub nodes: Vec<Vector3>,
    /// Unit tangent in the middle.
    pub direction: Vector3,
    /// Length along the axis \[m\].
    pub length: f64,
}

/// A group as placed.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    /// The fibres, in the order in which they were drawn.
    pub fibres: Vec<PlacedFibre>,
    /// Fibres that were wanted.
    pub wanted: usize,
    /// Volume fraction of the region that was wanted and is reached.
    pub volume_fraction: [f64; 2],
    /// Largest difference of an entry of ⟨pp⟩, the mean over the fibres, from that of the distribution.
    pub orientation_error: f64,
    /// Steps that removed overlaps, of all groups together.
    pub steps: usize,
}

impl Placed {
    /// The error for a group that has to be complete.
    ///
    /// # Errors
    /// [`PlacementError::NoRoom`] when fibres are missing.
    pub fn complete(&self) -> Result<(), PlacementError> {
        if self.fibres.len() == self.wanted {
            return Ok(());
        }
        Err(PlacementError::NoRoom {
            placed: self.fibres.len(),
            wanted: self.wanted,
            volume_fraction: self.volume_fraction[1],
        })
    }
}

/// Places all groups at once. Groups for which there is no room come back with fewer fibres than wanted.
///
/// # Errors
/// [`PlacementError`] when a setting is unusable.
pub fn place(population: &Population) -> Result<Vec<Placed>, PlacementError> {
    let groups = &population.groups;
    groups.iter().try_for_each(PlacementGroup::check)?;
    let samplers = groups.iter().map(|g| Sampler::new(&g.orientation));
    let samplers = samplers.collect::<Result<Vec<_>, _>>()?;
    let mut randoms: Vec<ChaCha8Rng> = (0..).zip(groups).map(|(k, g)| g.random(k)).collect();
    let lengths = groups.iter().zip(&mut randoms);
    let lengths: Vec<Vec<f64>> = lengths.map(|(g, random)| g.lengths(random)).collect();

    let regions: Vec<Region> = groups.iter().map(|g| g.region).collect();
    let shells = groups.iter().map(|g| g.radius + 0.5 * g.gap);
    let held = population.held.iter().map(|fibre| fibre.radius);
    let shell = shells.chain(held).fold(0.0, f64::max);
    let count = lengths.iter().map(Vec::len).sum();
    let mut crowd = Crowd::new(&population.periodic, &regions, shell, count)?;
    for fibre in &population.held {
        crowd.add(fibre.body(), 1, |_| {});
    }
    let walls = |g: &PlacementGroup| Walls::new(&g.region, &population.periodic);
    for (k, group) in groups.iter().enumerate() {
        let shift = [0; 3].map(|_| randoms[k].random::<f64>());
        for (n, &length) in lengths[k].iter().enumerate() {
            let direction = samplers[k].direction(sequence(n, shift));
            let body = group.body(k, walls(group), &samplers[k], direction, length);
            crowd.add(body, ATTEMPTS, |body| group.put(body, &mut randoms[k]));
        }
    }
    let steps = relax::relax(&mut crowd, |crowd, index| {
        let k = crowd.bodies[index].group;
        crowd.put(index, ATTEMPTS, |body| groups[k].put(body, &mut randoms[k]));
    });

    let mut bodies = crowd.bodies.drain(population.held.len()..);
    let placed = groups.iter().zip(&samplers).zip(lengths);
    Ok(placed
        .map(|((group, sampler), lengths)| {
            let own = bodies.by_ref().take(lengths.len()).zip(&lengths);
            let fibres = own
                .filter(|(body, _)| !body.gone)
                .map(|(body, &length)| group.settled(&body, length, &population.periodic))
                .collect();
            group.report(fibres, &lengths, sampler, steps)
        })
        .collect())
}

impl PlacementGroup {
    /// # Errors
    /// [`PlacementError`] when a setting is unusable.
    pub fn check(&self) -> Result<(), PlacementError> {
        self.length.check("length")?;
        self.region.check()?;
        let (radius, gap) = (self.radius, self.gap);
        check(radius > 0.0, "radius", radius, "a positive length in m")?;
        check(gap >= 0.0, "gap", gap, "zero or a length in m")?;
        let segments = self.segments as f64;
        check(segments >= 1.0, "segments", segments, "at least 1")?;
        if let Amount::VolumeFraction(fraction) = self.amount {
            let valid = (0.0..1.0).contains(&fraction);
            check(valid, "volume fraction", fraction, "between 0 and 1")?;
        }
        self.centre_line.check()?;
        Sampler::new(&self.orientation).map(|_| ())
    }

    /// Groups with one seed do not draw the same places.
    fn random(&self, stream: u64) -> ChaCha8Rng {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(stream);
        random
    }

    /// Volume fraction of fibres of this total length.
    fn fraction(&self, length: f64) -> f64 {
        PI * self.radius * self.radius * length / self.region.volume()
    }

    /// Lengths of all fibres \[m\].
    fn lengths(&self, random: &mut ChaCha8Rng) -> Vec<f64> {
        let mut draws = Draws::new(&self.length);
        match self.amount {
            Amount::Count(count) => (0..count).map(|_| draws.next(random)).collect(),
            Amount::VolumeFraction(fraction) => {
                let (mut lengths, mut total) = (Vec::new(), 0.0);
                loop {
                    let next = draws.next(random);
                    // The last fibre is added when it brings the sum nearer.
                    if self.fraction(total + 0.5 * next) > fraction {
                        return lengths;
                    }
                    lengths.push(next);
                    total += next;
                }
            }
        }
    }

    /// Nodes of the fibre's form, the fewest that will do.
    fn outline(&self, length: f64) -> Vec<Vector3> {
        match self.centre_line {
            CentreLine::Straight => self.centre_line.nodes(length, 1),
            _ => self.nodes(length),
        }
    }

    /// All nodes of a fibre of this length in its own frame.
    fn nodes(&self, length: f64) -> Vec<Vector3> {
        self.centre_line.nodes(length, self.segments_of(length))
    }

    /// Segments of a fibre of this length.
    fn segments_of(&self, length: f64) -> usize {
        if let CentreLine::Nodes(nodes) = &self.centre_line {
            return nodes.len() - 1;
        }
        let share = length / self.length.mean();
        ((self.segments as f64 * share).round() as usize).max(1)
    }

    /// A fibre that has no place yet.
    fn body(
        &self,
        group: usize,
        walls: Walls,
        sampler: &Sampler,
        drawn: Vector3,
        length: f64,
    ) -> Body {
        Body {
            turns: match sampler {
                Sampler::Aligned(_) => Turns::Never,
                Sampler::InPlane(normal) => Turns::About(*normal),
                _ => Turns::Free,
            },
            nodes: self.outline(length),
            shell: self.radius + 0.5 * self.gap,
            clearance: self.radius + self.gap,
            walls: Some(walls),
            drawn,
            group,
            ..Body::default()
        }
    }

    /// Puts a fibre at a random place, along the direction that was drawn for it and turned at random about it.
    fn put(&self, body: &mut Body, random: &mut ChaCha8Rng) {
        let normal = match body.turns {
            Turns::About(normal) => normal,
            _ => around(&body.drawn, TAU * random.random::<f64>()),
        };
        body.rotation = frame(&body.drawn, &normal);
        body.centre = self.spot(body, random);
    }

    /// A random centre at which the fibre, turned as it is, lies between the walls; half-way where it is too long.
    fn spot(&self, body: &Body, random: &mut ChaCha8Rng) -> Vector3 {
        let Some(walls) = body.walls else {
            return body.centre;
        };
        let [mut low, mut high] = self.region.bounds();
        let arms = body.nodes.iter().map(|x| body.rotation * x);
        let arms: Vec<Vector3> = arms.collect();
        for axis in 0..3 {
            if walls.low[axis].is_finite() {
                let below = arms.iter().map(|x| x[axis]).fold(0.0, f64::min);
                let above = arms.iter().map(|x| x[axis]).fold(0.0, f64::max);
                low[axis] += body.clearance - below;
                high[axis] -= body.clearance + above;
            }
            if low[axis] > high[axis] {
                low[axis] = 0.5 * (low[axis] + high[axis]);
                high[axis] = low[axis];
            }
        }
        let arms = &arms;
        let mut draw = || {
            let along = |axis, _| low[axis] + (high[axis] - low[axis]) * random.random::<f64>();
            Vector3::from_fn(along)
        };
        let free = |centre: &Vector3| {
            let excess = |x| walls.excess(&(centre + x), body.clearance);
            arms.iter().all(|x| excess(x) == Vector3::zeros())
        };
        let found = (0..ATTEMPTS).map(|_| draw()).find(free);
        found.unwrap_or_else(|| walls.centred(&draw()))
    }

    fn settled(&self, body: &Body, length: f64, periodic: &PeriodicBox) -> PlacedFibre {
        let shift = periodic.wrap(&body.centre) - body.centre;
        let nodes = self.nodes(length);
        PlacedFibre {
            nodes: nodes.iter().map(|x| body.at(x) + shift).collect(),
            direction: body.rotation * Vector3::x(),
            length,
        }
    }

    fn report(
        &self,
        fibres: Vec<PlacedFibre>,
        lengths: &[f64],
        sampler: &Sampler,
        steps: usize,
    ) -> Placed {
        let square = |f: &PlacedFibre| f.direction * f.direction.transpose();
        let moments = fibres.iter().map(square).sum::<Matrix3>() / fibres.len().max(1) as f64;
        let reached = fibres.iter().map(|f| f.length).fold(0.0, |sum, l| sum + l);
        Placed {
            wanted: lengths.len(),
            volume_fraction: [lengths.iter().sum(), reached].map(|l| self.fraction(l)),
            orientation_error: if fibres.is_empty() {
                0.0
            } else {
                (moments - sampler.target()).amax()
            },
            fibres,
            steps,
        }
    }
}

impl HeldFibre {
    fn body(&self) -> Body {
        Body {
            turns: Turns::Held,
            nodes: self.nodes.clone(),
            shell: self.radius,
            ..Body::default()
        }
    }
}

/// The rotation that takes x to `direction` and z to `normal`.
fn frame(direction: &Vector3, normal: &Vector3) -> Quaternion {
    let side = normal.cross(direction);
    let axes = Matrix3::from_columns(&[*direction, side, *normal]);
    Quaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(axes))
}

#[cfg(test)]
mod tests;
