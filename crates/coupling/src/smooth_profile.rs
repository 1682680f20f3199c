//! Beads as smooth profiles on the nodes of the fluid (L 2.3): evaluated near them only.

use fibreflow_fluid::BodyPart;
use fibreflow_mesh::{LocalMesh, Periods};
use fibreflow_parallel::Halo;

/// φ of a bead by the distance from its centre (L 25).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// r_b \[m\].
    pub radius: f64,
    /// ξ \[m\].
    pub width: f64,
    /// ξ_c \[m\]: farther than this from its edge a bead is 1 or 0.
    pub cutoff: f64,
}

impl Profile {
    /// φ at a distance \[m\].
    pub fn at(&self, distance: f64) -> f64 {
        let inside = self.radius - distance;
        if inside > self.cutoff {
            1.0
        } else if inside < -self.cutoff {
            0.0
        } else {
            0.5 + 0.5 * (inside / (std::f64::consts::SQRT_2 * self.width)).tanh()
        }
    }

    /// ∂φ/∂(distance) \[1/m\], without the jumps at the cut-off.
    pub fn slope(&self, distance: f64) -> f64 {
        let inside = self.radius - distance;
        if inside.abs() > self.cutoff {
            return 0.0;
        }
        let scale = std::f64::consts::SQRT_2 * self.width;
        let cosh = (inside / scale).cosh();
        -0.5 / (scale * cosh * cosh)
    }

    /// Beyond this φ is zero \[m\].
    pub fn reach(&self) -> f64 {
        self.radius + self.cutoff
    }
}

/// Finds the nodes of a rank that are near to beads.
pub struct BeadNodes {
    profile: Profile,
    /// Direction in which the mesh is one element thick: beads are discs of that depth.
    flat: Option<usize>,
    /// Translations of the periodic lattice by −1, 0, 1 in every direction.
    shifts: Vec<[f64; 3]>,
    /// Positions of the owned nodes, sorted by bin.
    nodes: Vec<u32>,
    positions: Vec<[f64; 3]>,
    offsets: Vec<u32>,
    low: [f64; 3],
    size: f64,
    counts: [usize; 3],
}

impl BeadNodes {
    /// Of the owned nodes of a mesh. Collective.
    pub fn new(mesh: &LocalMesh, profile: Profile) -> Self {
        let owned = &mesh.nodes[..mesh.owned()];
        let bound = |c: usize, start: f64, pick: fn(f64, f64) -> f64| {
            owned.iter().map(|x| x[c]).fold(start, pick)
        };
        let low = [0, 1, 2].map(|c| bound(c, f64::INFINITY, f64::min));
        let high = [0, 1, 2].map(|c| bound(c, f64::NEG_INFINITY, f64::max));
        let communicator = mesh.halo.communicator();
        let flat = (0..3).find(|&c| communicator.min(low[c]) == communicator.max(high[c]));
        let size = 0.5 * profile.reach();
        let count = |c: usize| {
            if owned.is_empty() {
                1
            } else {
                1 + ((high[c] - low[c]) / size) as usize
            }
        };
        let mut found = Self {
            profile,
            flat,
            shifts: shifts(&mesh.periods, flat),
            nodes: Vec::new(),
            positions: Vec::new(),
            offsets: Vec::new(),
            low,
            size,
            counts: [0, 1, 2].map(count),
        };
        let mut keyed: Vec<(usize, u32)> = (owned.iter().enumerate())
            .map(|(i, x)| (found.bin([0, 1, 2].map(|c| found.place(x[c], c))), i as u32))
            .collect();
        keyed.sort_unstable();
        let bins: usize = found.counts.iter().product();
        found.offsets = vec![0; bins + 1];
        keyed
            .iter()
            .for_each(|&(bin, _)| found.offsets[bin + 1] += 1);
        (0..bins).for_each(|b| found.offsets[b + 1] += found.offsets[b]);
        found.nodes = keyed.iter().map(|&(_, i)| i).collect();
        found.positions = keyed.iter().map(|&(_, i)| owned[i as usize]).collect();
        found
    }

    /// Direction along which a bead is a disc as deep as the mesh, if there is one.
    pub fn flat(&self) -> Option<usize> {
        self.flat
    }

    /// The parts of beads at `centres` \[m\] that lie in the nodes of this rank.
    pub fn parts(&self, centres: &[[f64; 3]]) -> Vec<BodyPart> {
        centres.iter().map(|centre| self.part(*centre)).collect()
    }

    fn part(&self, centre: [f64; 3]) -> BodyPart {
        let (mut part, reach) = (BodyPart::default(), self.profile.reach());
        for shift in &self.shifts {
            let centre: [f64; 3] = std::array::from_fn(|c| centre[c] + shift[c]);
            let range = |c: usize| {
                if self.flat == Some(c) {
                    return 0..self.counts[c];
                }
                let last = (centre[c] + reach - self.low[c]) / self.size;
                let first = (centre[c] - reach - self.low[c]) / self.size;
                if last < 0.0 || first >= self.counts[c] as f64 {
                    return 0..0;
                }
                first.max(0.0) as usize..self.counts[c].min(last as usize + 1)
            };
            let [x, y, z] = [range(0), range(1), range(2)];
            for k in z {
                for j in y.clone() {
                    for i in x.clone() {
                        self.collect(self.bin([i, j, k]), centre, &mut part);
                    }
                }
            }
        }
        part
    }

    fn collect(&self, bin: usize, centre: [f64; 3], part: &mut BodyPart) {
        let range = self.offsets[bin] as usize..self.offsets[bin + 1] as usize;
        for (&node, x) in self.nodes[range.clone()].iter().zip(&self.positions[range]) {
            let mut arm: [f64; 3] = std::array::from_fn(|c| x[c] - centre[c]);
            if let Some(flat) = self.flat {
                arm[flat] = 0.0;
            }
            let distance = arm.iter().map(|a| a * a).sum::<f64>().sqrt();
            let phi = self.profile.at(distance);
            if phi > 0.0 {
                part.nodes.push(node);
                part.profile.push(phi);
                part.arms.push(arm);
            }
        }
    }

    /// Along one direction, clamped to the bins.
    fn place(&self, x: f64, c: usize) -> usize {
        (((x - self.low[c]) / self.size) as usize).min(self.counts[c] - 1)
    }

    fn bin(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.counts[0] * (j + self.counts[1] * k)
    }
}

/// φ = Σ φ_i (L 26) and the ψ* that it asks for, by node of total length; `wanted` has ψ* of every bead. Collective.
pub fn fill(parts: &[BodyPart], wanted: &[f64], halo: &Halo, solid: &mut [[f64; 2]]) {
    solid.fill([0.0; 2]);
    for (part, wanted) in parts.iter().zip(wanted) {
        for (&i, phi) in part.nodes.iter().zip(&part.profile) {
            let solid = &mut solid[i as usize];
            solid[0] += phi;
            solid[1] += phi * wanted;
        }
    }
    for solid in solid.iter_mut().filter(|solid| solid[0] > 0.0) {
        solid[1] /= solid[0];
    }
    halo.update(solid);
}

fn shifts(periods: &Periods, flat: Option<usize>) -> Vec<[f64; 3]> {
    let mut shifts = vec![[0.0; 3]];
    for vector in &periods.vectors {
        let across = flat.is_some_and(|c| vector[c] != 0.0);
        if across || vector.iter().all(|v| *v == 0.0) {
            continue;
        }
        let moved = |sign: f64| {
            let add = move |s: &[f64; 3]| std::array::from_fn(|c| s[c] + sign * vector[c]);
            shifts.iter().map(add).collect::<Vec<[f64; 3]>>()
        };
        let (less, more) = (moved(-1.0), moved(1.0));
        shifts.extend(less);
        shifts.extend(more);
    }
    shifts
}
