//! A lattice of nodes with two-point weights, stretched at will.
#![allow(dead_code, reason = "every test file uses a part of this")]

use fibreflow_parallel::{Communicator, Halo};
use fibreflow_solve::{PairMatrix, SolveError};
use rand::{Rng, SeedableRng};

/// Node coordinates along the three axes \[m\].
pub struct Lattice {
    pub axes: [Vec<f64>; 3],
}

impl Lattice {
    pub fn uniform(n: usize) -> Self {
        let axis: Vec<f64> = (0..=n).map(|i| i as f64 / n as f64).collect();
        Self {
            axes: [axis.clone(), axis.clone(), axis],
        }
    }

    /// Spacing grows by a constant ratio along y, over a factor of `span` from first to last cell.
    pub fn geometric(n: usize, span: f64) -> Self {
        let mut lattice = Self::uniform(n);
        let ratio = span.powf(1.0 / (n - 1) as f64);
        let spacing: Vec<f64> = (0..n).map(|i| ratio.powi(i as i32)).collect();
        let length: f64 = spacing.iter().sum();
        let mut y = vec![0.0];
        spacing
            .iter()
            .for_each(|h| y.push(y[y.len() - 1] + h / length));
        lattice.axes[1] = y;
        lattice
    }

    pub fn counts(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.axes[a].len())
    }

    pub fn len(&self) -> usize {
        self.counts().iter().product()
    }

    pub fn indices(&self, node: usize) -> [usize; 3] {
        let n = self.counts();
        [node % n[0], node / n[0] % n[1], node / (n[0] * n[1])]
    }

    pub fn point(&self, node: usize) -> [f64; 3] {
        let at = self.indices(node);
        std::array::from_fn(|a| self.axes[a][at[a]])
    }

    fn width(&self, axis: usize, i: usize) -> f64 {
        let x = &self.axes[axis];
        0.5 * (x[(i + 1).min(x.len() - 1)] - x[i.saturating_sub(1)])
    }

    pub fn volume(&self, node: usize) -> f64 {
        let at = self.indices(node);
        (0..3).map(|a| self.width(a, at[a])).product()
    }

    pub fn on_boundary(&self, node: usize) -> bool {
        let (at, n) = (self.indices(node), self.counts());
        (0..3).any(|a| at[a] == 0 || at[a] + 1 == n[a])
    }

    pub fn row(&self, node: usize) -> Vec<(u32, f64)> {
        let (at, n) = (self.indices(node), self.counts());
        let strides = [1, n[0], n[0] * n[1]];
        let mut row = Vec::new();
        for a in 0..3 {
            let area: f64 = (0..3)
                .filter(|&b| b != a)
                .map(|b| self.width(b, at[b]))
                .product();
            let x = &self.axes[a];
            if at[a] > 0 {
                let w = area / (x[at[a]] - x[at[a] - 1]);
                row.push(((node - strides[a]) as u32, w));
            }
            if at[a] + 1 < n[a] {
                let w = area / (x[at[a] + 1] - x[at[a]]);
                row.push(((node + strides[a]) as u32, w));
            }
        }
        row
    }

    pub fn halo(&self) -> Halo {
        Halo::none(&Communicator::single(), self.len())
    }

    pub fn matrix(&self, fixed: &[bool]) -> Result<PairMatrix, SolveError> {
        PairMatrix::from_rows(&self.halo(), |i| self.row(i).into_iter(), fixed, None)
    }

    pub fn dirichlet(&self) -> PairMatrix {
        let fixed: Vec<bool> = (0..self.len()).map(|i| self.on_boundary(i)).collect();
        self.matrix(&fixed).expect("matrix")
    }

    pub fn neumann(&self) -> PairMatrix {
        self.matrix(&vec![false; self.len()]).expect("matrix")
    }
}

pub fn random(n: usize, seed: u64) -> Vec<f64> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    (0..n).map(|_| rng.random_range(-1.0..1.0)).collect()
}

pub fn norm(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// P1-Galerkin weights on a unit cube of n³ cells, six tetrahedra each, interior nodes moved by `jitter` spacings.
///
/// Some weights are negative (obtuse dihedral angles). `squash` shrinks the y axis afterwards.
pub struct Tetrahedra {
    pub points: Vec<[f64; 3]>,
    rows: Vec<Vec<(u32, f64)>>,
    boundary: Vec<bool>,
}

impl Tetrahedra {
    pub fn new(n: usize, jitter: f64, squash: f64) -> Self {
        let lattice = Lattice::uniform(n);
        let moves = random(3 * lattice.len(), 17);
        let boundary: Vec<bool> = (0..lattice.len()).map(|i| lattice.on_boundary(i)).collect();
        let point = |i: usize| -> [f64; 3] {
            let x = lattice.point(i);
            let free = if boundary[i] { 0.0 } else { jitter / n as f64 };
            let x: [f64; 3] = std::array::from_fn(|a| x[a] + free * moves[3 * i + a]);
            [x[0], squash * x[1], x[2]]
        };
        let points: Vec<[f64; 3]> = (0..lattice.len()).map(point).collect();
        Self::from_points(&lattice, points, boundary)
    }

    /// A tetrahedron at every 27th node flattened to a hundredth of its height, where no other turns over.
    pub fn with_slivers(n: usize, jitter: f64) -> Self {
        let Self {
            mut points,
            boundary,
            ..
        } = Self::new(n, jitter, 1.0);
        let lattice = Lattice::uniform(n);
        let tetrahedra = tetrahedra(&lattice);
        let mut around = vec![Vec::new(); points.len()];
        for (t, nodes) in tetrahedra.iter().enumerate() {
            nodes.iter().for_each(|&i| around[i].push(t));
        }
        let mut stays = boundary.clone();
        for node in (13..points.len()).step_by(27) {
            let near = around[node].iter().flat_map(|&t| tetrahedra[t]);
            if near.clone().any(|i| stays[i]) {
                continue;
            }
            let flat = tetrahedra[around[node][node % around[node].len()]];
            let [a, b, c] = *flat.iter().filter(|&&i| i != node).collect::<Vec<_>>() else {
                unreachable!("four nodes")
            };
            let normal = cross(minus(points[*b], points[*a]), minus(points[*c], points[*a]));
            let before = points[node];
            let height = dot(normal, minus(before, points[*a])) / dot(normal, normal);
            points[node] = std::array::from_fn(|k| before[k] - 0.99 * height * normal[k]);
            let volume = |&t: &usize| {
                let [a, b, c, d] = tetrahedra[t].map(|i| points[i]);
                dot(cross(minus(b, a), minus(c, a)), minus(d, a))
            };
            if around[node]
                .iter()
                .any(|t| volume(t) * orientation(*t) <= 0.0)
            {
                points[node] = before;
            } else {
                stays[node] = true;
            }
        }
        Self::from_points(&lattice, points, boundary)
    }

    fn from_points(lattice: &Lattice, points: Vec<[f64; 3]>, boundary: Vec<bool>) -> Self {
        let mut edges = Vec::new();
        for nodes in tetrahedra(lattice) {
            stiffness(nodes, &points, &mut edges);
        }
        edges.sort_by_key(|&(i, j, _)| (i, j));
        let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); points.len()];
        for (i, j, w) in edges {
            match rows[i].last_mut() {
                Some(entry) if entry.0 == j as u32 => entry.1 += w,
                _ => rows[i].push((j as u32, w)),
            }
        }
        Self {
            points,
            rows,
            boundary,
        }
    }

    pub fn matrix(&self, dirichlet: bool) -> PairMatrix {
        let fixed: Vec<bool> = self.boundary.iter().map(|&b| b && dirichlet).collect();
        let halo = Halo::none(&Communicator::single(), self.points.len());
        PairMatrix::from_rows(&halo, |i| self.rows[i].iter().copied(), &fixed, None)
            .expect("matrix")
    }

    pub fn negative_weights(&self) -> usize {
        let weights = self.rows.iter().flatten();
        weights.filter(|(_, w)| *w < -1e-12).count()
    }
}

const PATHS: [[usize; 3]; 6] = [
    [0, 1, 2],
    [0, 2, 1],
    [1, 0, 2],
    [1, 2, 0],
    [2, 0, 1],
    [2, 1, 0],
];

/// Six a cell around its diagonal, in the order of `PATHS`.
fn tetrahedra(lattice: &Lattice) -> Vec<[usize; 4]> {
    let n = lattice.counts()[0] - 1;
    let strides = [1, n + 1, (n + 1) * (n + 1)];
    let cells = (0..lattice.len()).filter(|&i| lattice.indices(i).iter().all(|&a| a < n));
    cells
        .flat_map(|cell| {
            PATHS.map(|[a, b, c]| {
                let first = cell + strides[a];
                let second = first + strides[b];
                [cell, first, second, second + strides[c]]
            })
        })
        .collect()
}

/// Sign of the volume of a tetrahedron: that of its path as a permutation.
fn orientation(tetrahedron: usize) -> f64 {
    [1.0, -1.0, -1.0, 1.0, 1.0, -1.0][tetrahedron % 6]
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

/// −∫∇N_i·∇N_j over one tetrahedron, both directions of every edge.
fn stiffness(nodes: [usize; 4], points: &[[f64; 3]], edges: &mut Vec<(usize, usize, f64)>) {
    let x = nodes.map(|i| points[i]);
    // ∇N_i = face normal / (6 V), all with the same sign.
    let normal = |i: usize| {
        let [a, b, c] = match i {
            0 => [1, 2, 3],
            1 => [0, 3, 2],
            2 => [0, 1, 3],
            _ => [0, 2, 1],
        };
        cross(minus(x[b], x[a]), minus(x[c], x[a]))
    };
    let volume = dot(minus(x[0], x[1]), normal(0)).abs() / 6.0;
    for i in 0..4 {
        for j in (0..4).filter(|&j| j != i) {
            let w = -dot(normal(i), normal(j)) / (36.0 * volume);
            edges.push((nodes[i], nodes[j], w));
        }
    }
}
