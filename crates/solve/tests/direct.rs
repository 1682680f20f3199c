//! The direct solver against the pair matrix, multigrid and dense products, on every kind of tensor grid.

mod common;

use common::{norm, random};
use fibreflow_mesh::{
    BoxMesh, DualGeometry, Line, LinePair, LocalMesh, Mesh, Stretching, TensorGrid, geometry,
};
use fibreflow_parallel::Halo;
use fibreflow_solve::{
    Amg, AmgSettings, CgSettings, ConjugateGradients, Direct, NullSpace, PairMatrix,
};
use rand::seq::SliceRandom;
use rand::{SeedableRng, rngs::StdRng};

const U: Stretching = Stretching::Uniform;

fn case(cells: [usize; 3], periodic: [bool; 3], stretching: [Stretching; 3]) -> BoxMesh {
    BoxMesh {
        origin: [0.3, -1.0, 0.0],
        size: [1.5, 2.0, 0.8],
        cells,
        periodic,
        stretching,
        ..BoxMesh::default()
    }
}

/// Nodes in a random order.
fn shuffled(mut mesh: Mesh) -> Mesh {
    let mut name: Vec<u32> = (0..mesh.nodes.len() as u32).collect();
    name.shuffle(&mut StdRng::seed_from_u64(5));
    let nodes = mesh.nodes.clone();
    for (i, &k) in name.iter().enumerate() {
        mesh.nodes[k as usize] = nodes[i];
    }
    let rename = |n: &mut u32| *n = name[*n as usize];
    mesh.elements.nodes.iter_mut().for_each(rename);
    for face in &mut mesh.boundary {
        face.nodes
            .iter_mut()
            .take(face.vertices.into())
            .for_each(rename);
    }
    mesh
}

struct Problem {
    mesh: LocalMesh,
    dual: DualGeometry,
    grid: TensorGrid,
    lines: [Line; 3],
}

impl Problem {
    fn new(mesh: Mesh) -> Self {
        let mesh = LocalMesh::single(mesh);
        let dual = geometry::dual(&mesh).expect("dual");
        let grid = TensorGrid::detect(&mesh).expect("tensor grid");
        let lines = std::array::from_fn(|d| Line::second(&grid.coordinates[d], grid.periods[d]));
        Self {
            mesh,
            dual,
            grid,
            lines,
        }
    }

    /// Nodes on the ends that are fixed.
    fn marks(&self, ends: [[bool; 2]; 3]) -> Vec<bool> {
        let counts = self.grid.counts();
        let on = |at: &[u32; 3]| {
            (0..3).any(|d| {
                let (at, last) = (at[d] as usize, counts[d] - 1);
                ends[d][0] && at == 0 || ends[d][1] && at == last
            })
        };
        self.grid.indices.iter().map(on).collect()
    }

    fn matrix(&self, ends: [[bool; 2]; 3], shift: f64) -> PairMatrix {
        let shift: Vec<f64> = self.dual.volumes.iter().map(|v| shift * v).collect();
        PairMatrix::new(&self.mesh, &self.dual, &self.marks(ends), Some(&shift)).expect("matrix")
    }

    fn direct(&self, ends: [[bool; 2]; 3], shift: f64) -> Direct {
        let halo = &self.mesh.halo;
        Direct::new(halo, &self.grid, &self.lines, ends, shift).expect("direct")
    }
}

/// ‖b − A x‖ / ‖b‖.
fn residual(matrix: &PairMatrix, rhs: &[f64], x: &[f64]) -> f64 {
    let (mut x, mut y) = (x.to_vec(), vec![0.0; rhs.len()]);
    matrix.multiply(&mut x, &mut y);
    let rest: Vec<f64> = rhs.iter().zip(&y).map(|(b, y)| b - y).collect();
    norm(&rest) / norm(rhs)
}

fn without_mean(mut values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter_mut().for_each(|v| *v -= mean);
    values
}

const FREE: [[bool; 2]; 3] = [[false; 2]; 3];

#[test]
fn every_combination_of_directions_is_exact() {
    let (tanh, ratio) = (Stretching::Tanh(2.0), Stretching::Geometric(1.3));
    let y_walls = [[false; 2], [true; 2], [false; 2]];
    let cases = [
        // Channel, duct, cavity, slab with an outlet, fully periodic, stretched periodic, odd and prime counts, thin.
        (case([12, 10, 8], [true, false, true], [U, tanh, U]), FREE),
        (
            case([12, 10, 8], [true, false, true], [U, tanh, U]),
            y_walls,
        ),
        (
            case([9, 10, 7], [true, false, false], [U, tanh, ratio]),
            FREE,
        ),
        (
            case([9, 10, 7], [true, false, false], [U, tanh, ratio]),
            y_walls,
        ),
        (case([6, 7, 9], [false; 3], [tanh, ratio, U]), FREE),
        (
            case([6, 7, 9], [false; 3], [tanh, ratio, U]),
            [[true; 2]; 3],
        ),
        (
            case([11, 6, 4], [false, false, true], [ratio, U, U]),
            [[false, true], [false; 2], [false; 2]],
        ),
        (
            case([11, 6, 4], [false, false, true], [ratio, U, U]),
            [[true, false], [false, true], [false; 2]],
        ),
        (case([8, 9, 10], [true; 3], [U; 3]), FREE),
        (case([8, 9, 10], [true; 3], [U, ratio, U]), FREE),
        (case([7, 13, 5], [true; 3], [ratio, tanh, U]), FREE),
        (case([16, 2, 1], [true; 3], [U; 3]), FREE),
        (case([16, 1, 12], [false, true, false], [tanh, U, U]), FREE),
        (case([1, 12, 16], [true, false, true], [U, tanh, U]), FREE),
        (
            case([12, 1, 1], [false, true, true], [tanh, U, U]),
            [[true, false], [false; 2], [false; 2]],
        ),
        (case([2, 2, 2], [false; 3], [U; 3]), [[true; 2]; 3]),
        (case([1, 1, 1], [false; 3], [U; 3]), FREE),
        (case([1, 1, 1], [true; 3], [U; 3]), FREE),
    ];
    for (case, ends) in cases {
        let mesh = case.build().expect("mesh");
        for mesh in [mesh.clone(), shuffled(mesh)] {
            let problem = Problem::new(mesh);
            for shift in [0.0, 3.0] {
                let matrix = problem.matrix(ends, shift);
                let mut direct = problem.direct(ends, shift);
                let mut rhs = random(matrix.owned(), 3);
                if matrix.is_singular() {
                    rhs = without_mean(rhs);
                }
                // Twice: nothing is left behind in the room.
                for _ in 0..2 {
                    let mut x = vec![7.0; rhs.len()];
                    direct.solve(&rhs, &mut x);
                    let rest = residual(&matrix, &rhs, &x);
                    let what = direct.describe();
                    if norm(&rhs) > 1e-14 {
                        assert!(rest < 2e-13, "{case:?} {ends:?} {shift}, {what}: {rest:e}");
                    }
                    if matrix.is_singular() {
                        assert!(x.iter().sum::<f64>().abs() < 1e-12 * norm(&x).max(1e-3));
                    }
                }
            }
        }
    }
}

#[test]
fn a_channel_takes_two_fourier_transforms_and_a_tridiagonal_solve() {
    let mesh = case(
        [6, 5, 4],
        [true, false, true],
        [U, Stretching::Tanh(2.0), U],
    );
    let direct = Problem::new(mesh.build().expect("mesh")).direct(FREE, 0.0);
    let periodic = if cfg!(feature = "fft") {
        "FFT"
    } else {
        "eigenvectors"
    };
    let expected = format!("x: {periodic}, y: tridiagonal, z: {periodic}");
    assert_eq!(direct.describe(), expected);
    let mesh = case([6, 5, 4], [false; 3], [U; 3]);
    let direct = Problem::new(mesh.build().expect("mesh")).direct(FREE, 0.0);
    assert_eq!(
        direct.describe(),
        "x: tridiagonal, y: eigenvectors, z: eigenvectors"
    );
}

#[test]
fn the_cost_is_known_before_anything_is_set_up() {
    let ends = [[false; 2], [true, false], [false; 2]];
    for periodic in [[true, false, true], [true, false, false], [false; 3]] {
        let mesh = case([64, 40, 32], periodic, [U; 3]);
        let problem = Problem::new(mesh.build().expect("mesh"));
        let estimate = Direct::estimate(&problem.lines, ends);
        let found = problem.direct(ends, 0.0).operations();
        assert!(
            (estimate / found - 1.0).abs() < 0.1,
            "{periodic:?}: {estimate} {found}"
        );
    }
}

#[test]
fn constants_are_taken_out_of_a_singular_problem() {
    for stretching in [[U, U, U], [U, Stretching::Tanh(1.0), Stretching::Tanh(1.0)]] {
        let mesh = case([6, 8, 6], [true, false, true], stretching);
        let problem = Problem::new(mesh.build().expect("mesh"));
        let matrix = problem.matrix(FREE, 0.0);
        let rhs: Vec<f64> = random(matrix.owned(), 9).iter().map(|v| v + 5.0).collect();
        let mut x = vec![0.0; rhs.len()];
        problem.direct(FREE, 0.0).solve(&rhs, &mut x);
        let rest = residual(&matrix, &without_mean(rhs), &x);
        assert!(rest < 1e-13, "{stretching:?}: {rest:e}");
        assert!(x.iter().sum::<f64>().abs() < 1e-12 * norm(&x));
    }
}

/// VALIDATION F9: the same answer as multigrid with conjugate gradients, to 1e-10.
#[test]
fn the_answer_is_that_of_multigrid() {
    for periodic in [[true, false, true], [false; 3], [true; 3]] {
        let mesh = case([16; 3], periodic, [U; 3]).build().expect("mesh");
        let problem = Problem::new(shuffled(mesh));
        let matrix = problem.matrix(FREE, 0.0);
        let rhs = without_mean(random(matrix.owned(), 4));
        let mut x = vec![0.0; rhs.len()];
        problem.direct(FREE, 0.0).solve(&rhs, &mut x);
        let by_multigrid = multigrid(&matrix, &rhs, 1e-13);
        let difference: Vec<f64> = x.iter().zip(&by_multigrid).map(|(a, b)| a - b).collect();
        let error = norm(&difference) / norm(&x);
        assert!(error < 1e-10, "{periodic:?}: {error:e}");
    }
}

fn multigrid(matrix: &PairMatrix, rhs: &[f64], tolerance: f64) -> Vec<f64> {
    let mut amg = Amg::new(matrix, AmgSettings::default()).expect("hierarchy");
    let mut x = vec![0.0; rhs.len()];
    let settings = CgSettings {
        relative_tolerance: tolerance,
        ..CgSettings::default()
    };
    ConjugateGradients::new()
        .solve(
            matrix,
            &mut amg,
            rhs,
            &mut x,
            &settings,
            NullSpace::Constant,
        )
        .expect("converged");
    x
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// VALIDATION F9: spacings of 1 to 1000, both residuals at most 1e-12, energy norms equal to 1e-6. With the stretched
/// direction banded the first solve does it; with a second one solved by eigenvectors, conjugate gradients polish it.
#[test]
fn spacings_of_one_to_a_thousand_are_solved_to_round_off() {
    let ratio = Stretching::Geometric(1000f64.powf(1.0 / 23.0));
    for (stretching, periodic, polish) in [
        ([U, ratio, U], [true, false, true], false),
        ([ratio, ratio, U], [false, false, true], true),
    ] {
        let mesh = case([24; 3], periodic, stretching).build().expect("mesh");
        let problem = Problem::new(mesh);
        let matrix = problem.matrix(FREE, 0.0);
        let rhs = without_mean(random(matrix.owned(), 4));
        let mut direct = problem.direct(FREE, 0.0);
        let mut x = vec![0.0; rhs.len()];
        direct.solve(&rhs, &mut x);
        if polish {
            let settings = CgSettings {
                relative_tolerance: 5e-13,
                max_iterations: 3,
                ..CgSettings::default()
            };
            let mut solver = ConjugateGradients::new();
            let null_space = NullSpace::Constant;
            let report = solver.solve(&matrix, &mut direct, &rhs, &mut x, &settings, null_space);
            assert!(report.expect("converged").iterations <= 2);
        }
        let y = multigrid(&matrix, &rhs, 5e-13);
        let residuals = [residual(&matrix, &rhs, &x), residual(&matrix, &rhs, &y)];
        assert!(residuals.iter().all(|r| *r <= 1e-12), "{residuals:?}");
        let energies = [dot(&rhs, &x), dot(&rhs, &y)];
        let difference = energies[0] / energies[1] - 1.0;
        assert!(difference.abs() < 1e-6, "{energies:?}");
    }
}

#[test]
fn three_components_are_three_solves() {
    let tanh = Stretching::Tanh(2.0);
    for (periodic, ends) in [
        ([true, false, true], [[false; 2], [true; 2], [false; 2]]),
        (
            [false, false, false],
            [[false, true], [false; 2], [true; 2]],
        ),
        ([true, false, true], FREE),
        ([false; 3], FREE),
    ] {
        let mesh = case([6, 8, 7], periodic, [U, tanh, U])
            .build()
            .expect("mesh");
        for mesh in [mesh.clone(), shuffled(mesh)] {
            let problem = Problem::new(mesh);
            let mut direct = problem.direct(ends, 0.0);
            let n = problem.mesh.owned();
            let components = [1, 2, 3].map(|seed| random(n, seed));
            let rhs: Vec<[f64; 4]> = (0..n)
                .map(|i| [components[0][i], components[1][i], components[2][i], 9.0])
                .collect();
            let mut together = vec![[5.0; 4]; n];
            direct.solve_vectors(&rhs, &mut together);
            for (c, rhs) in components.iter().enumerate() {
                let mut alone = vec![0.0; n];
                direct.solve(rhs, &mut alone);
                let worst = (0..n).map(|i| (together[i][c] - alone[i]).abs());
                let worst = worst.fold(0.0, f64::max);
                assert!(
                    worst <= 1e-14 * norm(&alone),
                    "{periodic:?}, {c}: {worst:e}"
                );
            }
            assert!(together.iter().all(|v| v[3] == 0.0));
        }
    }
}

#[test]
fn new_coefficients_are_those_of_an_implicit_step() {
    let mesh = case(
        [6, 9, 5],
        [true, false, true],
        [U, Stretching::Tanh(2.0), U],
    );
    let problem = Problem::new(mesh.build().expect("mesh"));
    let ends = [[false; 2], [true; 2], [false; 2]];
    let mut direct = problem.direct(ends, 1.0);
    direct.set(2.0, 0.03);
    // (2 V + 0.03 A) x = b on free rows is 0.03 (A + 2/0.03 V).
    let matrix = problem.matrix(ends, 2.0 / 0.03);
    let marks = problem.marks(ends);
    let rhs = random(matrix.owned(), 8);
    let mut x = vec![0.0; rhs.len()];
    direct.solve(&rhs, &mut x);
    let scaled: Vec<f64> = rhs
        .iter()
        .zip(&marks)
        .map(|(b, &fixed)| if fixed { *b } else { b / 0.03 })
        .collect();
    let rest = residual(&matrix, &scaled, &x);
    assert!(rest < 1e-13, "{rest:e}");
}

/// A line with pairs at distances 1 to 3 of random positive weights (the same all over when `uniform`).
fn wide_line(n: usize, periodic: bool, uniform: bool, seed: u64) -> Line {
    let weights = random(4 * n, seed);
    let draw = |k: usize| {
        if uniform {
            weights[k % 4].abs() + 0.2
        } else {
            weights[k].abs() + 0.2
        }
    };
    let mut pairs = Vec::new();
    for a in 0..n {
        for distance in 1..=3 {
            if periodic || a + distance < n {
                pairs.push(LinePair {
                    a: a as u32,
                    distance: distance as u32,
                    skew: 1.0,
                    stiffness: draw(4 * a + distance),
                });
            }
        }
    }
    Line {
        periodic,
        norm: (0..n).map(|a| draw(4 * a)).collect(),
        pairs,
    }
}

fn apply(lines: &[Line; 3], ends: [[bool; 2]; 3], shift: f64, x: &[f64]) -> Vec<f64> {
    let n = lines.each_ref().map(Line::len);
    let strides = [1, n[0], n[0] * n[1]];
    let at = |i: usize| [i % n[0], i / n[0] % n[1], i / (n[0] * n[1])];
    let fixed = |i: usize| {
        let at = at(i);
        (0..3).any(|d| ends[d][0] && at[d] == 0 || ends[d][1] && at[d] + 1 == n[d])
    };
    let mut y = vec![0.0; x.len()];
    for i in 0..x.len() {
        let (here, h) = (at(i), |d: usize, k: usize| lines[d].norm[k]);
        y[i] += shift * (0..3).map(|d| h(d, here[d])).product::<f64>() * x[i];
        for d in 0..3 {
            let across: f64 = (0..3).filter(|&e| e != d).map(|e| h(e, here[e])).product();
            for pair in lines[d].pairs.iter().filter(|p| p.a as usize == here[d]) {
                let j = i - here[d] * strides[d] + lines[d].other(pair) * strides[d];
                let value = |k: usize| if fixed(k) { 0.0 } else { x[k] };
                let flow = across * pair.stiffness * (value(i) - value(j));
                y[i] += flow;
                y[j] -= flow;
            }
        }
    }
    (0..x.len())
        .map(|i| if fixed(i) { x[i] } else { y[i] })
        .collect()
}

/// Fourth-order lines have pairs at distances up to three.
#[test]
fn lines_with_wide_pairs_are_solved() {
    let walls = [[false; 2], [true; 2], [false; 2]];
    for (counts, periodic, uniform, ends) in [
        ([8, 9, 10], [true, false, true], [true, false, true], FREE),
        ([8, 9, 10], [true, false, true], [true, false, true], walls),
        ([9, 12, 7], [true, true, true], [true, false, true], FREE),
        ([9, 12, 7], [true, true, true], [true, true, true], FREE),
        (
            [9, 12, 7],
            [false, true, false],
            [false, false, true],
            [[true, false], [false; 2], [false; 2]],
        ),
        // As many nodes as pairs reach, or fewer.
        ([8, 4, 3], [true, true, true], [true, false, false], FREE),
        ([2, 1, 9], [true, true, false], [false, true, false], FREE),
    ] {
        let lines: [Line; 3] =
            std::array::from_fn(|d| wide_line(counts[d], periodic[d], uniform[d], d as u64 + 1));
        let n: usize = counts.iter().product();
        let grid = TensorGrid {
            coordinates: counts.map(|n| (0..n).map(|i| i as f64).collect()),
            periods: std::array::from_fn(|d| periodic[d].then_some(counts[d] as f64)),
            indices: (0..n)
                .map(|i| {
                    [
                        i % counts[0],
                        i / counts[0] % counts[1],
                        i / (counts[0] * counts[1]),
                    ]
                })
                .map(|at| at.map(|k| k as u32))
                .collect(),
        };
        let halo = Halo::none(&fibreflow_parallel::Communicator::single(), n);
        for shift in [0.0, 0.7] {
            let mut direct = Direct::new(&halo, &grid, &lines, ends, shift).expect("direct");
            let mut rhs = random(n, 12);
            if shift == 0.0 && ends == FREE {
                rhs = without_mean(rhs);
            }
            let mut x = vec![0.0; n];
            direct.solve(&rhs, &mut x);
            let y = apply(&lines, ends, shift, &x);
            let rest: Vec<f64> = rhs.iter().zip(&y).map(|(b, y)| b - y).collect();
            let rest = norm(&rest) / norm(&rhs);
            assert!(
                rest < 1e-12,
                "{counts:?} {periodic:?} {ends:?} {shift}: {rest:e}"
            );
        }
        // One direction alone, and three right-hand sides at a time.
        for axis in 0..3 {
            let mut direct = Direct::along(axis, &halo, &grid, &lines, ends, 0.7).expect("lines");
            let mut alone = lines.clone();
            for line in (0..3).filter(|&d| d != axis) {
                alone[line].pairs.iter_mut().for_each(|p| p.stiffness = 0.0);
            }
            let parts: [Vec<f64>; 3] = std::array::from_fn(|c| random(n, 20 + c as u64));
            let rhs: Vec<[f64; 4]> = (0..n)
                .map(|i| [parts[0][i], parts[1][i], parts[2][i], 0.0])
                .collect();
            let mut x = vec![[0.0; 4]; n];
            for coefficient in [0.3, 1.0] {
                direct.set(0.7 * coefficient, coefficient);
                direct.solve_vectors(&rhs, &mut x);
                for (c, part) in parts.iter().enumerate() {
                    let x: Vec<f64> = x.iter().map(|x| x[c]).collect();
                    let y = apply(&alone, ends, 0.7, &x);
                    let free = part.iter().zip(&y).zip(&x);
                    let rest: Vec<f64> = free
                        .map(|((b, y), x)| b - y * if x == y { 1.0 } else { coefficient })
                        .collect();
                    let rest = norm(&rest) / norm(part);
                    assert!(rest < 1e-12, "{counts:?} {ends:?} axis {axis}: {rest:e}");
                }
            }
        }
    }
}

#[test]
fn fixed_nodes_must_be_whole_faces() {
    let mesh = case([5, 4, 3], [false, false, true], [U; 3])
        .build()
        .expect("mesh");
    let problem = Problem::new(shuffled(mesh));
    let halo = &problem.mesh.halo;
    let find = |marks: &[bool]| Direct::fixed_ends(halo, &problem.grid, marks);
    for ends in [
        FREE,
        [[false, true], [false; 2], [false; 2]],
        [[true; 2], [true, false], [false; 2]],
    ] {
        assert_eq!(find(&problem.marks(ends)), Some(ends));
    }
    let mut marks = problem.marks([[false, true], [false; 2], [false; 2]]);
    let inner = problem
        .grid
        .indices
        .iter()
        .position(|at| at[0] == 2)
        .expect("inner node");
    marks[inner] = true;
    assert_eq!(find(&marks), None);
    marks[inner] = false;
    let outlet = marks.iter().position(|&fixed| fixed).expect("outlet node");
    marks[outlet] = false;
    assert_eq!(find(&marks), None);
}

#[test]
fn results_do_not_depend_on_the_thread_count() {
    let mesh = case(
        [20, 24, 18],
        [true, false, true],
        [U, Stretching::Tanh(2.0), U],
    );
    let problem = Problem::new(mesh.build().expect("mesh"));
    let rhs = random(problem.mesh.owned(), 8);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("pool").install(|| {
            let mut x = vec![0.0; rhs.len()];
            problem.direct(FREE, 0.0).solve(&rhs, &mut x);
            x.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
        })
    };
    assert_eq!(with(1), with(3));
}
