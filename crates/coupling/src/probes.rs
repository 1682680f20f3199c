//! The flow at fixed points: probes, lines, planes and coarser grids on any mesh.

use crate::locate::{Bent, Locator};
use fibreflow_mesh::{LocalMesh, shape};
use fibreflow_parallel::Communicator;
use nalgebra::Vector3;
use std::ops::Range;
use std::sync::Arc;

/// A point this close to an element, by the typical size of elements, counts as inside.
const NEAR: f64 = 1e-3;

/// Points where the flow is wanted, the same on every rank.
#[derive(Clone, Debug, PartialEq)]
pub enum PointSet {
    /// Single points \[m\]; rank 0 gets the values.
    List(Vec<[f64; 3]>),
    /// A regular grid, x fastest; every rank gets the values of some layers across the last direction with more than one
    /// point, neighbours share a layer.
    Grid {
        /// First point \[m\].
        origin: [f64; 3],
        /// Distances \[m\].
        spacing: [f64; 3],
        /// Points in each direction.
        counts: [usize; 3],
    },
}

impl PointSet {
    fn point(&self, index: usize) -> [f64; 3] {
        match self {
            Self::List(points) => points[index],
            Self::Grid {
                origin,
                spacing,
                counts,
            } => {
                let place = [
                    index % counts[0],
                    index / counts[0] % counts[1],
                    index / (counts[0] * counts[1]),
                ];
                std::array::from_fn(|c| origin[c] + spacing[c] * place[c] as f64)
            }
        }
    }

    /// Indices of the points between two corners.
    fn between(&self, low: [f64; 3], high: [f64; 3]) -> Vec<usize> {
        let inside = |x: [f64; 3]| (0..3).all(|c| low[c] <= x[c] && x[c] <= high[c]);
        match self {
            Self::List(points) => (0..points.len()).filter(|&i| inside(points[i])).collect(),
            Self::Grid {
                origin,
                spacing,
                counts,
            } => {
                // A point more on either side, for round-off.
                let along = |c: usize| {
                    let place = |x: f64| (x - origin[c]) / spacing[c];
                    let first = (place(low[c]) - 1.0).max(0.0) as usize;
                    first..((place(high[c]) + 2.0).max(0.0) as usize).min(counts[c])
                };
                let (x, y, z) = (along(0), along(1), along(2));
                let mut found = Vec::new();
                for k in z {
                    for j in y.clone() {
                        let row = x.clone().map(|i| i + counts[0] * (j + counts[1] * k));
                        found.extend(row.filter(|&index| inside(self.point(index))));
                    }
                }
                found
            }
        }
    }

    /// Points of a layer, and the layers that each rank writes: first and last, which it shares with the next.
    fn layers(&self, ranks: usize) -> (usize, Vec<Range<usize>>) {
        match self {
            Self::List(points) => {
                let mut layers = vec![0..0; ranks];
                layers[0] = 0..1;
                (points.len(), layers)
            }
            Self::Grid { counts, .. } => {
                let last = (0..3).rev().find(|&c| counts[c] > 1).unwrap_or(0);
                let layer = counts[..last].iter().product();
                let cells = counts[last] - 1;
                let writers = ranks.min(cells.max(1));
                let range = |r: usize| {
                    if r >= writers {
                        return 0..0;
                    }
                    cells * r / writers..cells * (r + 1) / writers + 1
                };
                (layer, (0..ranks).map(range).collect())
            }
        }
    }
}

/// The flow at a point; NaN where the point is outside the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointValue {
    /// u \[m/s\].
    pub velocity: [f64; 3],
    /// p/ρ \[m²/s²\].
    pub pressure: f64,
    /// ∂uᵢ/∂xⱼ of the element as gradient\[i\]\[j\] \[1/s\].
    pub gradient: [[f64; 3]; 3],
}

impl PointValue {
    const WORDS: usize = 13;

    fn words(&self) -> [f64; Self::WORDS] {
        let [ux, uy, uz] = self.gradient;
        let [u, v, w] = self.velocity;
        [
            u,
            v,
            w,
            self.pressure,
            ux[0],
            ux[1],
            ux[2],
            uy[0],
            uy[1],
            uy[2],
            uz[0],
            uz[1],
            uz[2],
        ]
    }

    fn from_words(n: &[f64; Self::WORDS]) -> Self {
        Self {
            velocity: [n[0], n[1], n[2]],
            pressure: n[3],
            gradient: [
                [n[4], n[5], n[6]],
                [n[7], n[8], n[9]],
                [n[10], n[11], n[12]],
            ],
        }
    }

    /// ∇ × u \[1/s\].
    pub fn vorticity(&self) -> [f64; 3] {
        let g = &self.gradient;
        [g[2][1] - g[1][2], g[0][2] - g[2][0], g[1][0] - g[0][1]]
    }

    /// Q = −½ ∂uᵢ/∂xⱼ ∂uⱼ/∂xᵢ, rotation beyond strain (Hunt, Wray & Moin 1988) \[1/s²\].
    pub fn q_criterion(&self) -> f64 {
        let g = &self.gradient;
        let product = |i: usize| (0..3).map(|j| g[i][j] * g[j][i]).sum::<f64>();
        -0.5 * (0..3).map(product).sum::<f64>()
    }
}

/// A set of points, found on the mesh once.
#[derive(Clone, Debug)]
pub struct Probes {
    mesh: Arc<LocalMesh>,
    /// Element and reference coordinates of the points that this rank evaluates, by the rank that gets them.
    held: Vec<Vec<(u32, [f64; 3])>>,
    /// Where values go that come from each rank, counted from the first of `mine`.
    arriving: Vec<Vec<u32>>,
    /// Indices of the points whose values this rank gets.
    mine: Range<usize>,
    /// First and last layer of every rank, see [`PointSet::Grid`].
    layers: Vec<Range<usize>>,
    /// Points outside the mesh.
    outside: usize,
}

impl Probes {
    /// Finds the points of several sets. Collective.
    pub fn new(mesh: &Arc<LocalMesh>, total_volume: f64, sets: &[PointSet]) -> Vec<Self> {
        if sets.is_empty() {
            return Vec::new();
        }
        let locator = Locator::new(Arc::clone(mesh), total_volume);
        sets.iter()
            .map(|set| Self::find(mesh, &locator, set))
            .collect()
    }

    fn find(mesh: &Arc<LocalMesh>, locator: &Locator, set: &PointSet) -> Self {
        let communicator = mesh.halo.communicator();
        let ranks = communicator.size();
        let (layer, layers) = set.layers(ranks);
        let bounds = locator.owned_bounds().inflated(NEAR * locator.scale());
        let mut bent = Bent::default();
        let mut candidates: Vec<Vec<[u64; 3]>> = vec![Vec::new(); ranks];
        let mut places: Vec<Vec<(u32, [f64; 3])>> = vec![Vec::new(); ranks];
        for index in set.between(bounds.low.into(), bounds.high.into()) {
            let x = Vector3::from(set.point(index));
            let Some(location) = locator.find(&x, None, &mut bent) else {
                continue;
            };
            if location.distance > NEAR * locator.scale() {
                continue;
            }
            let element = location.element;
            let global = mesh.global_elements[element as usize];
            let claim = [index as u64, location.distance.to_bits(), global];
            let at = index / layer;
            for (writer, layers) in layers.iter().enumerate() {
                if layers.contains(&at) {
                    candidates[writer].push(claim);
                    places[writer].push((element, location.reference));
                }
            }
        }
        let mine =
            layers[communicator.rank()].start * layer..layers[communicator.rank()].end * layer;
        let claims = communicator.exchange(candidates);
        let (accepted, arriving, outside) = choose(&claims, &mine, communicator);
        let accepted = communicator.exchange(accepted);
        let held = (places.into_iter().zip(&accepted))
            .map(|(places, accepted)| {
                let kept = places.into_iter().zip(accepted).filter(|(_, a)| **a == 1);
                kept.map(|(place, _)| place).collect()
            })
            .collect();
        Self {
            mesh: Arc::clone(mesh),
            held,
            arriving,
            mine,
            layers,
            outside,
        }
    }

    /// Points outside the mesh, on all ranks; those of shared layers count twice.
    pub fn outside(&self) -> usize {
        self.outside
    }

    /// Indices of the points whose values this rank gets.
    pub fn mine(&self) -> &Range<usize> {
        &self.mine
    }

    /// First layer and end of the layers of every rank.
    pub fn layers(&self) -> &[Range<usize>] {
        &self.layers
    }

    /// The flow at the points of this rank, from velocity \[m/s\] and pressure \[m²/s²\] at owned and halo nodes. Collective.
    pub fn sample(&self, velocity: &[[f64; 4]], pressure: &[f64]) -> Vec<PointValue> {
        let value = |&(element, reference): &(u32, [f64; 3])| {
            self.value(element as usize, reference, velocity, pressure)
        };
        let outgoing = (self.held.iter())
            .map(|held| held.iter().map(value).collect())
            .collect();
        let incoming: Vec<Vec<[f64; PointValue::WORDS]>> =
            self.mesh.halo.communicator().exchange(outgoing);
        let nothing = PointValue::from_words(&[f64::NAN; PointValue::WORDS]);
        let mut values = vec![nothing; self.mine.len()];
        for (places, words) in self.arriving.iter().zip(&incoming) {
            for (&place, words) in places.iter().zip(words) {
                values[place as usize] = PointValue::from_words(words);
            }
        }
        values
    }

    fn value(
        &self,
        element: usize,
        reference: [f64; 3],
        velocity: &[[f64; 4]],
        pressure: &[f64],
    ) -> [f64; PointValue::WORDS] {
        let mesh = &self.mesh;
        let kind = mesh.elements.kinds[element];
        let coordinates = (mesh.elements).coordinates(element, &mesh.nodes, &mesh.periods);
        let weights = shape::physical(kind, &coordinates, reference);
        let mut value = PointValue {
            velocity: [0.0; 3],
            pressure: 0.0,
            gradient: [[0.0; 3]; 3],
        };
        for (a, &node) in mesh.elements.nodes(element).iter().enumerate() {
            let (u, n) = (velocity[node as usize], weights.n[a]);
            value.pressure += n * pressure[node as usize];
            for i in 0..3 {
                value.velocity[i] += n * u[i];
                (0..3).for_each(|j| value.gradient[i][j] += weights.gradient[a][j] * u[i]);
            }
        }
        value.words()
    }
}

/// Of the claims on every point of `mine` the nearest, then the element with the smallest index: marks for the claimants
/// (1: accepted), where accepted values go, and how many points nobody claims on all ranks. Collective.
fn choose(
    claims: &[Vec<[u64; 3]>],
    mine: &Range<usize>,
    communicator: &Communicator,
) -> (Vec<Vec<u8>>, Vec<Vec<u32>>, usize) {
    const NOBODY: (f64, u64, usize) = (f64::INFINITY, u64::MAX, usize::MAX);
    let mut best = vec![NOBODY; mine.len()];
    let key = |rank: usize, claim: &[u64; 3]| (f64::from_bits(claim[1]), claim[2], rank);
    let less = |a: (f64, u64, usize), b: (f64, u64, usize)| {
        a.0.total_cmp(&b.0)
            .then((a.1, a.2).cmp(&(b.1, b.2)))
            .is_lt()
    };
    for (rank, claims) in claims.iter().enumerate() {
        for claim in claims {
            let best = &mut best[claim[0] as usize - mine.start];
            if less(key(rank, claim), *best) {
                *best = key(rank, claim);
            }
        }
    }
    let mut accepted = Vec::with_capacity(claims.len());
    let mut arriving = Vec::with_capacity(claims.len());
    for (rank, claims) in claims.iter().enumerate() {
        let wins = |claim: &[u64; 3]| best[claim[0] as usize - mine.start] == key(rank, claim);
        accepted.push(claims.iter().map(|c| u8::from(wins(c))).collect());
        let won = claims.iter().filter(|c| wins(c));
        arriving.push(won.map(|c| (c[0] as usize - mine.start) as u32).collect());
    }
    let unclaimed = best.iter().filter(|b| **b == NOBODY).count();
    (accepted, arriving, communicator.sum_count(unclaimed))
}
