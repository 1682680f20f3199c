//! Structure and stress of a suspension of linked fibres: flocs, pair distribution, particle stress.

use super::groups::root;
use super::joints::Strain;
use super::settings::LinkedScheme;
use super::system::LinkedSystem;
use super::touch::Touch;
use crate::contact::broad::search;
use crate::contact::images::Images;
use crate::contact::{ContactError, Segments};
use crate::shape::SEGMENT_BITS;
use crate::{FlowFormula, Matrix3, Shear, Vector3};
use std::f64::consts::PI;

/// What contacts carried in the last step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactLoads {
    /// Contacts that rub.
    pub contacts: usize,
    /// Mean normal force of one \[N\].
    pub normal: f64,
    /// Mean friction of one \[N\].
    pub friction: f64,
    /// Share of them that slides.
    pub sliding: f64,
}

impl LinkedSystem {
    /// Flocs: for each fibre the lowest index of the fibres that it is joined to by contacts that rub.
    pub fn flocs(&self) -> Vec<u32> {
        let mut parent: Vec<u32> = (0..self.fibres() as u32).collect();
        for touch in self.touches.iter().filter(|t| t.rubs) {
            let [a, b] = touch.segments.map(|s| self.segments[s as usize].chain);
            let (a, b) = (root(&mut parent, a), root(&mut parent, b));
            parent[a.max(b) as usize] = a.min(b);
        }
        (0..self.fibres() as u32)
            .map(|f| root(&mut parent, f))
            .collect()
    }

    /// Flocs of two fibres and more, and the share of all fibres that the largest one holds.
    pub fn floc_sizes(&self) -> (usize, f64) {
        let mut sizes = vec![0_usize; self.fibres()];
        self.flocs().iter().for_each(|&f| sizes[f as usize] += 1);
        let flocs = sizes.iter().filter(|&&n| n > 1).count();
        let largest = sizes.iter().copied().max().unwrap_or(0);
        (flocs, largest as f64 / self.fibres().max(1) as f64)
    }

    /// The fibres of the largest floc, with their middles in one piece about the origin \[m\]: periodic images are followed from contact to
    /// contact.
    pub fn largest_floc(&self) -> Vec<(usize, Vector3)> {
        let labels = self.flocs();
        let mut sizes = vec![0_usize; labels.len()];
        labels.iter().for_each(|&f| sizes[f as usize] += 1);
        let Some(first) = (0..sizes.len()).rev().max_by_key(|&f| sizes[f]) else {
            return Vec::new();
        };
        let mut links = vec![Vec::new(); labels.len()];
        for touch in self.touches.iter().filter(|t| t.rubs) {
            let [a, b] = touch
                .segments
                .map(|s| self.segments[s as usize].chain as usize);
            links[a].push((b, -touch.shift));
            links[b].push((a, touch.shift));
        }
        let mut moved = vec![None; labels.len()];
        moved[first] = Some(Vector3::zeros());
        let mut members = vec![(first, Vector3::zeros())];
        let mut next = 0;
        while let Some(&(fibre, shift)) = members.get(next) {
            for &(other, more) in &links[fibre] {
                if moved[other].is_none() {
                    moved[other] = Some(shift + more);
                    members.push((other, shift + more));
                }
            }
            next += 1;
        }
        for (fibre, x) in &mut members {
            *x += self.chains[*fibre].centre;
        }
        let middle = members.iter().map(|(_, x)| x).sum::<Vector3>() / members.len() as f64;
        members.iter_mut().for_each(|(_, x)| *x -= middle);
        members.sort_by_key(|(fibre, _)| *fibre);
        members
    }

    /// All fibres, with their middles moved by whole periods into the periodic box \[m\].
    pub fn in_box(&self) -> Vec<(usize, Vector3)> {
        let wrap = |x: &Vector3| self.settings.periodic.wrap(x);
        let middles = self.chains.iter().map(|c| wrap(&c.centre));
        middles.enumerate().collect()
    }

    /// Pair distribution g(r) of the fibres' middles in a box that repeats along all axes, in bins of equal width up to `range` \[m\],
    /// at most half the shortest edge: pairs by those of as many points at random. Zero in a box that does not repeat.
    ///
    /// # Errors
    /// A range beyond half an edge, middles that are not finite.
    pub fn pair_distribution(&self, range: f64, bins: usize) -> Result<Vec<f64>, ContactError> {
        let mut counts = vec![0.0; bins];
        let edges = self.settings.periodic.lengths;
        let [Some(x), Some(y), Some(z)] = edges else {
            return Ok(counts);
        };
        // Each middle is a segment without length, so thick that two touch at the range.
        let ids: Vec<u64> = self.chains.iter().map(|c| c.id << SEGMENT_BITS).collect();
        let position: Vec<Vector3> = self.chains.iter().flat_map(|c| [c.centre; 2]).collect();
        let node: Vec<u32> = (0..ids.len() as u32).map(|f| 2 * f).collect();
        let radius = vec![0.5 * range; ids.len()];
        let segments = Segments {
            ids: &ids,
            stems: &ids,
            node: &node,
            radius: &radius,
            mass: &[],
            position: &position,
            velocity: &[],
            angular_velocity: &[],
        };
        let strain = self.settings.shear_rate * self.time;
        let images = Images::new(&self.settings.periodic, self.settings.shear_rate, strain);
        for pair in search(self.neighbours.communicator(), &segments, &images, 0.0)?.pairs {
            let distance = pair.gap + range;
            let bin = (distance / range * bins as f64) as usize;
            if let Some(count) = counts.get_mut(bin) {
                *count += 1.0;
            }
        }
        let n = ids.len() as f64;
        let density = 0.5 * n * n / (x * y * z);
        let width = range / bins as f64;
        let shell = |k: usize| 4.0 / 3.0 * PI * width.powi(3) * ((k + 1).pow(3) - k.pow(3)) as f64;
        Ok(counts
            .iter()
            .enumerate()
            .map(|(k, c)| c / (density * shell(k)))
            .collect())
    }

    /// Particle stress of the last step, summed over the fibres \[Pa·m³\], without trace: the moment of slender-body drag about the
    /// middles of fibres (S 2.101–2.104), and that of contacts between fibres.
    pub fn particle_stress(&self, flow: FlowFormula<'_>) -> [Matrix3; 2] {
        let mut drag = Matrix3::zeros();
        let mut middles = Vec::with_capacity(self.fibres());
        for f in 0..self.fibres() {
            let chain = &self.chains[f];
            let segments = &self.segments[self.offsets[f]..self.offsets[f + 1]];
            let middle =
                segments.iter().map(|s| s.felt[0]).sum::<Vector3>() / segments.len() as f64;
            middles.push(middle);
            let half = chain.half_length;
            let zeta = 4.0 * PI * self.settings.viscosity / (2.0 * half / chain.radius).ln();
            for s in segments {
                let [centre, axis] = s.felt;
                let (velocity, gradient) = flow(&centre, 0.0);
                let across = |v: Vector3| (v - axis * (0.5 * axis.dot(&v))) * zeta;
                let force = across(velocity - s.velocity) * (2.0 * half);
                let moment = across(gradient * axis - s.spin.cross(&axis)) * (half.powi(3) / 1.5);
                drag += (centre - middle) * force.transpose() + axis * moment.transpose();
            }
        }
        // Images have moved since the start of the step, at which contacts were found.
        let since = match self.settings.scheme {
            LinkedScheme::Explicit => 0.0,
            LinkedScheme::Implicit => 0.5 * self.last_step,
        };
        let mut contact = Matrix3::zeros();
        for touch in &self.solved {
            let [a, b] = touch
                .segments
                .map(|s| middles[self.segments[s as usize].chain as usize]);
            let apart = a - b + touch.shift - touch.image_velocity * since;
            contact -= apart * touch.force().transpose();
        }
        [drag, contact].map(|m| {
            let even = (m + m.transpose()) * 0.5;
            even - Matrix3::identity() * (even.trace() / 3.0)
        })
    }

    /// What contacts carried in the last step; all zero without contacts.
    pub fn contact_loads(&self) -> ContactLoads {
        let mut loads = ContactLoads::default();
        // In a long step of scheme B a pair can begin to rub after its start.
        let rubs = |t: &&Touch| t.rubs || t.friction != Vector3::zeros();
        for touch in self.solved.iter().filter(rubs) {
            loads.contacts += 1;
            loads.normal += touch.push.max(0.0);
            loads.friction += touch.friction.norm();
            loads.sliding += f64::from(u8::from(touch.slides));
        }
        let count = loads.contacts.max(1) as f64;
        for sum in [&mut loads.normal, &mut loads.friction, &mut loads.sliding] {
            *sum /= count;
        }
        loads
    }

    /// ⟨(p·flow)²(p·gradient)²⟩ over the segments: the viscosity of slender rods by it is S 5.12.
    pub fn alignment(&self, shear: &Shear) -> f64 {
        let of = |p: &Vector3| (p.dot(&shear.flow) * p.dot(&shear.gradient)).powi(2);
        let sum: f64 = self.segments.iter().map(|s| of(&s.axis)).sum();
        sum / self.segments.len().max(1) as f64
    }

    /// Mean angle by which joints are bent from their shape without load \[rad\]; zero without joints.
    pub fn mean_bending(&self) -> f64 {
        let pairs = self.segments.windows(2).filter(|pair| !pair[1].first);
        let (count, sum) = pairs.fold((0, 0.0), |(count, sum), pair| {
            let bend = Strain::of(&pair[0], &pair[1]).bend.norm();
            (count + 1, sum + bend)
        });
        sum / f64::from(count.max(1))
    }
}
