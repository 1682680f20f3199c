//! Sampling is exact for linear fields, spreading is its exact adjoint, and no point is ever lost.

use fibreflow_coupling::{Coupling, CouplingError, Kernel, SpreadReport};
use fibreflow_fibre::{Ambient, Points, Reaction};
use fibreflow_mesh::{BoxElement, BoxMesh, Stretching};
use fibreflow_mesh::{DualGeometry, LocalMesh, distribute, geometry};
use fibreflow_parallel::Communicator;
use nalgebra::{Matrix3, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

type V3 = Vector3<f64>;

const KINDS: [BoxElement; 5] = [
    BoxElement::Hexahedron,
    BoxElement::Prism,
    BoxElement::Tetrahedron,
    BoxElement::PyramidHexahedron,
    BoxElement::Mixed,
];
const SIZE: [f64; 3] = [1.0, 0.8, 1.3];
const ORIGIN: [f64; 3] = [-0.3, 0.2, 0.1];

struct Case {
    mesh: Arc<LocalMesh>,
    geometry: Arc<DualGeometry>,
    coupling: Coupling,
    rng: ChaCha8Rng,
}

impl Case {
    fn new(element: BoxElement, cells: [usize; 3], periodic: [bool; 3], jitter: f64) -> Self {
        Self::sheared(element, cells, periodic, jitter, 0.0)
    }

    /// With x moved by `shear` × z: the lattice is then not rectangular.
    fn sheared(
        element: BoxElement,
        cells: [usize; 3],
        periodic: [bool; 3],
        jitter: f64,
        shear: f64,
    ) -> Self {
        let [x, y, z] = cells;
        // All four kinds need five cells along x.
        let x = if element == BoxElement::Mixed {
            x.max(5)
        } else {
            x
        };
        let mesh = BoxMesh {
            origin: ORIGIN,
            size: SIZE,
            cells: [x, y, z],
            stretching: [
                Stretching::Uniform,
                Stretching::Tanh(1.5),
                Stretching::Uniform,
            ],
            periodic,
            element,
            jitter,
            seed: 5,
        };
        let mut mesh = mesh.build().expect("box mesh");
        let vectors = &mut mesh.periods.vectors;
        for x in mesh.nodes.iter_mut().chain(vectors) {
            x[0] += shear * x[2];
        }
        let mesh = Arc::new(distribute(&Communicator::single(), Some(mesh)).expect("one rank"));
        let geometry = Arc::new(geometry::dual(&mesh).expect("geometry"));
        let coupling = Self::couple(&mesh, &geometry, vec![false; mesh.owned()]);
        Self {
            mesh,
            geometry,
            coupling,
            rng: ChaCha8Rng::seed_from_u64(17),
        }
    }

    fn couple(mesh: &Arc<LocalMesh>, geometry: &Arc<DualGeometry>, no_slip: Vec<bool>) -> Coupling {
        Coupling::new(mesh.clone(), geometry.clone(), no_slip).expect("coupling")
    }

    /// With points in pairs that sample and push in their middle.
    fn in_pairs(mut self) -> Self {
        let (mesh, geometry) = (self.mesh.clone(), self.geometry.clone());
        let free = vec![false; self.mesh.owned()];
        self.coupling =
            Coupling::with_kernel(mesh, geometry, free, Kernel::Middle).expect("coupling");
        self
    }

    /// Pairs of points less than `apart` from each other, their middles as [`Case::points`].
    fn pairs(&mut self, n: usize, copies: [f64; 3], apart: f64) -> Vec<V3> {
        let middles = self.points(n, copies);
        let around = |x: V3| {
            let arm = 0.5 * apart * self.random() / 3.0_f64.sqrt();
            [x - arm, x + arm]
        };
        middles.into_iter().flat_map(around).collect()
    }

    /// Anew, without knowledge of where points were.
    fn fresh(&self) -> Coupling {
        Self::couple(&self.mesh, &self.geometry, vec![false; self.mesh.owned()])
    }

    fn random(&mut self) -> V3 {
        Vector3::from_fn(|_, _| self.rng.random_range(-1.0..1.0))
    }

    /// Points in `copies` boxes around the box, in the directions where it is periodic.
    fn points(&mut self, n: usize, copies: [f64; 3]) -> Vec<V3> {
        let mut point = || {
            let fraction = |k: usize, x: f64| 0.5 + copies[k].max(1.0) * (x - 0.5);
            Vector3::from_fn(|k, _| ORIGIN[k] + SIZE[k] * fraction(k, self.rng.random()))
        };
        (0..n).map(|_| point()).collect()
    }

    fn sample(&mut self, velocity: &[[f64; 4]], points: &[V3]) -> Ambient {
        let mut ambient = Ambient::default();
        self.coupling
            .sample(velocity, points, &mut ambient)
            .expect("sample");
        ambient
    }

    fn reaction(&mut self, n: usize) -> Reaction {
        Reaction {
            force: (0..n).map(|_| self.random()).collect(),
            torque: (0..n).map(|_| 0.1 * self.random()).collect(),
        }
    }

    fn spread(&mut self, reaction: &Reaction) -> (SpreadReport, Vec<[f64; 4]>) {
        let mut body_force = vec![[0.0; 4]; self.mesh.total()];
        let report = self
            .coupling
            .spread(reaction, &mut body_force)
            .expect("spread");
        (report, body_force)
    }

    fn field(&self, f: impl Fn(V3) -> V3) -> Vec<[f64; 4]> {
        let value = |x: &[f64; 3]| f((*x).into());
        let values = self.mesh.nodes.iter().map(value);
        values.map(|u| [u.x, u.y, u.z, 0.0]).collect()
    }
}

fn vector(v: &[f64; 4]) -> V3 {
    Vector3::new(v[0], v[1], v[2])
}

#[test]
fn a_linear_field_is_sampled_exactly_on_every_element() {
    let gradient = Matrix3::new(0.3, -1.2, 0.5, 0.7, 0.1, -0.4, 2.0, 0.9, -0.8);
    let offset = Vector3::new(0.2, -0.1, 0.4);
    for element in KINDS {
        let mut case = Case::new(element, [4, 5, 3], [false; 3], 0.2);
        let velocity = case.field(|x| offset + gradient * x);
        let points = case.points(500, [1.0; 3]);
        let ambient = case.sample(&velocity, &points);
        assert_eq!(case.coupling.outside(), 0);
        for (k, x) in points.iter().enumerate() {
            let error = (ambient.velocity[k] - offset - gradient * x).norm();
            assert!(error < 1e-12, "{element:?} at {x}: {error}");
            let error = (ambient.gradient_at(k) - gradient).norm();
            assert!(error < 1e-12, "{element:?} gradient at {x}: {error}");
        }
    }
}

/// A flow that is linear in space, on the way of the points too.
#[test]
fn pairs_sample_a_linear_field_as_single_points_do() {
    let gradient = Matrix3::new(0.3, -1.2, 0.5, 0.7, 0.1, -0.4, 2.0, 0.9, -0.8);
    let (offset, growth) = (Vector3::new(0.2, -0.1, 0.4), Vector3::new(1.0, 0.3, -2.0));
    for element in KINDS {
        let mut single = Case::new(element, [4, 5, 3], [false; 3], 0.2);
        let mut paired = Case::new(element, [4, 5, 3], [false; 3], 0.2).in_pairs();
        let velocity = single.field(|x| offset + gradient * x);
        let slope = single.field(|_| growth);
        let mut points = Points {
            position: paired.pairs(250, [1.0; 3], 0.1),
            ..Points::default()
        };
        let middle = V3::from(ORIGIN) + 0.5 * V3::from(SIZE);
        // None outside.
        (points.position.iter_mut()).for_each(|x| *x = middle + 0.8 * (*x - middle));
        points.velocity = (0..500).map(|_| single.random()).collect();
        let [mut one, mut two] = [Ambient::default(), Ambient::default()];
        for (case, ambient) in [(&mut single, &mut one), (&mut paired, &mut two)] {
            (case.coupling)
                .sample_met(&velocity, Some(&slope), &points, 0.3, true, ambient)
                .expect("sample");
        }
        for k in 0..500 {
            let vectors = [
                one.velocity[k] - two.velocity[k],
                one.change[k] - two.change[k],
                one.travel[k] - two.travel[k],
            ];
            let error = vectors.map(|v| v.norm()).into_iter().fold(0.0, f64::max);
            let error = error.max((one.gradient_at(k) - two.gradient_at(k)).norm());
            assert!(error < 1e-12, "{element:?}, point {k}: {error}");
        }
    }
}

/// What pairs of points give arrives as force and torque, and does the work at the nodes that it does at the points.
#[test]
fn pairs_push_whole_and_by_the_adjoint() {
    for element in KINDS {
        for periodic in [[false; 3], [true, false, true], [true; 3]] {
            let mut case = Case::new(element, [4, 5, 3], periodic, 0.2).in_pairs();
            let copies = periodic.map(|p| if p { 5.0 } else { 1.0 });
            let points = case.pairs(150, copies, 0.1);
            let mut velocity = case.field(|_| V3::zeros());
            for u in &mut velocity {
                let random = case.random();
                *u = [random.x, random.y, random.z, 0.0];
            }
            let ambient = case.sample(&velocity, &points);
            let reaction = case.reaction(points.len());
            let (report, body_force) = case.spread(&reaction);
            let given: V3 = reaction.force.iter().sum();
            let size: f64 = reaction.force.iter().map(V3::norm).sum();
            assert!((report.force - given).norm() < 1e-12 * size);
            assert!(report.defect_relative < 1e-13, "{}", report.defect_relative);
            let (mut torque, mut power, mut work) = (V3::zeros(), 0.0, 0.0);
            for (k, x) in points.iter().enumerate() {
                let (f, t) = (&reaction.force[k], &reaction.torque[k]);
                torque += x.cross(f) + t;
                let spin = fibreflow_fibre::hydrodynamics::spin(ambient.gradient_at(k));
                power += f.dot(&ambient.velocity[k]) + t.dot(&spin);
                work += f.norm() * ambient.velocity[k].norm();
            }
            let defect = (report.torque - torque).norm();
            assert!(
                defect < 1e-11 * size,
                "{element:?} {periodic:?}: torque {defect}"
            );
            let nodes = velocity.iter().zip(&body_force).zip(&case.geometry.volumes);
            let by_nodes: f64 = nodes.map(|((u, f), v)| v * vector(f).dot(&vector(u))).sum();
            assert!(
                (power - by_nodes).abs() < 1e-13 * work,
                "{element:?} {periodic:?}: {power} {by_nodes}"
            );
            let response = case.coupling.response(&points).expect("response");
            let unit = Reaction {
                force: vec![V3::x(); points.len()],
                torque: vec![V3::zeros(); points.len()],
            };
            let (_, common) = case.spread(&unit);
            let seen = case.sample(&common, &points).velocity;
            for (pair, seen) in response.chunks(2).zip(seen.chunks(2)) {
                let middle = 0.5 * (seen[0].x + seen[1].x);
                assert_eq!(pair[0], pair[1]);
                assert!((pair[0] - middle).abs() < 1e-12 * middle);
            }
        }
    }
    let mut case = Case::new(BoxElement::Hexahedron, [4, 5, 3], [true; 3], 0.0).in_pairs();
    let (still, odd) = (case.field(|_| V3::zeros()), case.points(3, [1.0; 3]));
    let error = case.coupling.sample(&still, &odd, &mut Ambient::default());
    assert!(
        matches!(error, Err(CouplingError::Length { found: 3, .. })),
        "{error:?}"
    );
}

/// Periodic in x and z, linear in y: the same values in every image.
#[test]
fn images_of_a_point_see_the_same_flow() {
    let slope = Vector3::new(1.0, -2.0, 0.5);
    for element in KINDS {
        for cells in [[4, 5, 3], [2, 3, 1], [1, 2, 2]] {
            let mut case = Case::sheared(element, cells, [true, false, true], 0.2, 0.7);
            let velocity = case.field(|x| x.y * slope);
            let points = case.points(200, [7.0, 1.0, 7.0]);
            let ambient = case.sample(&velocity, &points);
            assert_eq!(case.coupling.outside(), 0, "{element:?} {cells:?}");
            let expected = slope * V3::y().transpose();
            for (k, x) in points.iter().enumerate() {
                let error = (ambient.velocity[k] - x.y * slope).norm();
                assert!(error < 1e-12, "{element:?} {cells:?} at {x}: {error}");
                let error = (ambient.gradient_at(k) - expected).norm();
                assert!(
                    error < 1e-12,
                    "{element:?} {cells:?} gradient at {x}: {error}"
                );
            }
        }
    }
}

#[test]
fn force_and_torque_arrive_whole() {
    for element in KINDS {
        for periodic in [[false; 3], [true, false, true], [true; 3]] {
            let mut case = Case::new(element, [4, 5, 3], periodic, 0.2);
            let points = case.points(300, periodic.map(|p| if p { 5.0 } else { 1.0 }));
            let velocity = case.field(|_| V3::zeros());
            case.sample(&velocity, &points);
            let reaction = case.reaction(points.len());
            let (report, body_force) = case.spread(&reaction);

            let given: V3 = reaction.force.iter().sum();
            let size: f64 = reaction.force.iter().map(V3::norm).sum();
            let volumes = case.geometry.volumes.iter();
            let received: V3 = body_force
                .iter()
                .zip(volumes)
                .map(|(f, v)| *v * vector(f))
                .sum();
            assert!(
                (received - given).norm() < 1e-12 * size,
                "{element:?} {periodic:?}"
            );
            assert!((report.force - given).norm() < 1e-12 * size);
            assert!(report.defect_relative < 1e-13, "{}", report.defect_relative);

            let pairs = || {
                points
                    .iter()
                    .zip(reaction.force.iter().zip(&reaction.torque))
            };
            let given: V3 = pairs().map(|(x, (f, t))| x.cross(f) + t).sum();
            let size: f64 = pairs()
                .map(|(x, (f, t))| x.norm() * f.norm() + t.norm())
                .sum();
            let defect = (report.torque - given).norm() / size;
            assert!(
                defect < 1e-12,
                "{element:?} {periodic:?}: torque defect {defect}"
            );
            if periodic == [false; 3] {
                let nodes = case
                    .mesh
                    .nodes
                    .iter()
                    .zip(&body_force)
                    .zip(&case.geometry.volumes);
                let moment = |((x, f), v): ((&[f64; 3], &[f64; 4]), &f64)| {
                    V3::from(*x).cross(&(*v * vector(f)))
                };
                let received: V3 = nodes.map(moment).sum();
                assert!(
                    (received - given).norm() < 1e-12 * size,
                    "{element:?} by nodes"
                );
            }
        }
    }
}

/// Σ F·u(x) + T·½∇×u(x) over points = Σ V_i f_i·u_i over nodes, for any nodal velocity.
#[test]
fn spreading_is_the_adjoint_of_sampling() {
    for element in KINDS {
        let mut case = Case::new(element, [3, 4, 3], [true, false, true], 0.2);
        let points = case.points(200, [3.0, 1.0, 3.0]);
        let mut velocity = case.field(|_| V3::zeros());
        for u in &mut velocity {
            let random = case.random();
            *u = [random.x, random.y, random.z, 0.0];
        }
        let ambient = case.sample(&velocity, &points);
        let reaction = case.reaction(points.len());
        let (_, body_force) = case.spread(&reaction);
        let (mut by_points, mut size) = (0.0, 0.0);
        for k in 0..points.len() {
            let spin = fibreflow_fibre::hydrodynamics::spin(ambient.gradient_at(k));
            let power = reaction.force[k].dot(&ambient.velocity[k]) + reaction.torque[k].dot(&spin);
            by_points += power;
            size += power.abs();
        }
        let nodes = velocity.iter().zip(&body_force).zip(&case.geometry.volumes);
        let by_nodes: f64 = nodes.map(|((u, f), v)| v * vector(f).dot(&vector(u))).sum();
        let defect = (by_points - by_nodes).abs() / size;
        assert!(defect < 1e-13, "{element:?}: {defect}");
    }
}

/// The same force on every point, as a velocity that the points see: nodes that are held give way to nothing.
#[test]
fn the_response_is_what_the_points_see_of_a_common_force() {
    for element in KINDS {
        let mut case = Case::new(element, [3, 4, 3], [true, false, true], 0.2);
        let held: Vec<bool> = (0..case.mesh.owned()).map(|i| i % 5 == 0).collect();
        case.coupling = Case::couple(&case.mesh, &case.geometry, held.clone());
        let points = case.points(200, [3.0, 1.0, 3.0]);
        let still = case.field(|_| V3::zeros());
        case.sample(&still, &points);
        let found = case.coupling.response(&points).expect("response");
        let (_, mut velocity) = case.spread(&Reaction {
            force: vec![V3::x(); points.len()],
            torque: vec![V3::zeros(); points.len()],
        });
        for (u, held) in velocity.iter_mut().zip(&held) {
            u[0] *= f64::from(u8::from(!held));
        }
        let seen = case.sample(&velocity, &points);
        for (found, expected) in found.iter().zip(&seen.velocity) {
            let error = (found - expected.x).abs();
            assert!(error < 1e-12 * expected.x, "{element:?}: {found}");
        }
    }
}

/// 1000 steps of up to two elements through all periodic boundaries; the walk must agree bitwise with a fresh search.
#[test]
fn wandering_points_are_never_lost() {
    for element in KINDS {
        let mut case = Case::new(element, [4, 3, 2], [true; 3], 0.2);
        let mut points = case.points(20, [1.0; 3]);
        let phase = |x: &V3, k: usize| std::f64::consts::TAU * (x[k] - ORIGIN[k]) / SIZE[k];
        let velocity = case.field(|x| Vector3::from_fn(|k, _| phase(&x, k).sin()));
        for step in 0..1000 {
            for point in &mut points {
                let far = if case.rng.random_bool(0.01) { 3.0 } else { 0.4 };
                *point += far * case.random();
            }
            let ambient = case.sample(&velocity, &points);
            assert_eq!(case.coupling.outside(), 0, "{element:?} step {step}");
            if step % 50 == 0 {
                let mut again = Ambient::default();
                case.fresh()
                    .sample(&velocity, &points, &mut again)
                    .expect("sample");
                assert_eq!(again, ambient, "{element:?} step {step}");
            }
        }
        let far = points.iter().map(|p| p.norm()).fold(0.0, f64::max);
        assert!(far > 5.0, "the points should have left the box: {far}");
    }
}

/// On faces, edges and vertices the gradient jumps: the answer must not depend on where a point came from.
#[test]
fn points_on_faces_have_one_answer() {
    for element in KINDS {
        let mut case = Case::new(element, [4, 4, 4], [true, false, true], 0.0);
        let velocity: Vec<[f64; 4]> = (0..case.mesh.total())
            .map(|i| {
                [
                    (i as f64).sin(),
                    (3.0 * i as f64).cos(),
                    (7.0 * i as f64).sin(),
                    0.0,
                ]
            })
            .collect();
        let step = Vector3::from_fn(|k, _| SIZE[k] / 8.0);
        let corner = V3::from(ORIGIN);
        let mut targets = Vec::new();
        for i in 0..9 {
            for k in 0..9 {
                targets
                    .push(corner + Vector3::new(f64::from(i) * step.x, 0.0, f64::from(k) * step.z));
                targets.push(
                    corner
                        + Vector3::new(f64::from(i) * step.x, 4.0 * step.y, f64::from(k) * step.z),
                );
            }
        }
        let direct = case.sample(&velocity, &targets);
        for _ in 0..5 {
            let mut from = targets.clone();
            for point in &mut from {
                let away = case.random();
                *point += Vector3::new(0.3 * away.x, (0.1 * away.y).abs(), 0.3 * away.z);
            }
            case.sample(&velocity, &from);
            assert_eq!(case.sample(&velocity, &targets), direct, "{element:?}");
        }
    }
}

#[test]
fn points_behind_a_wall_are_held_at_it_and_counted() {
    for element in KINDS {
        let mut case = Case::new(element, [4, 5, 3], [true, false, true], 0.1);
        let velocity = case.field(|x| Vector3::new(x.y, 0.0, 0.0));
        let (low, high) = (ORIGIN[1], ORIGIN[1] + SIZE[1]);
        let points = [
            Vector3::new(0.11, low - 0.01, 0.4),
            Vector3::new(4.31, high + 0.02, -3.2),
            Vector3::new(0.2, 0.5, 0.6),
        ];
        let ambient = case.sample(&velocity, &points);
        for (u, expected) in ambient.velocity.iter().zip([low, high, 0.5]) {
            assert!(
                (u - Vector3::new(expected, 0.0, 0.0)).norm() < 1e-12,
                "{element:?} {u}"
            );
        }
        let reaction = case.reaction(3);
        let (report, _) = case.spread(&reaction);
        assert_eq!((case.coupling.outside(), report.outside), (2, 2));
        assert!((report.force - reaction.force.iter().sum::<V3>()).norm() < 1e-13);
    }
}

#[test]
fn force_on_no_slip_nodes_is_booked_as_wall_force() {
    let mut case = Case::new(BoxElement::Hexahedron, [3, 4, 3], [true, false, true], 0.0);
    let on_wall = |x: &[f64; 3]| (x[1] - ORIGIN[1]).abs() < 1e-12;
    let no_slip: Vec<bool> = case.mesh.nodes.iter().map(on_wall).collect();
    case.coupling = Case::couple(&case.mesh, &case.geometry, no_slip.clone());
    let velocity = case.field(|_| V3::zeros());
    // The first layer ends at the second node of the stretched direction.
    let mut heights: Vec<f64> = case.mesh.nodes.iter().map(|x| x[1]).collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    let y = heights[0] + 0.25 * (heights[1] - heights[0]);
    case.sample(&velocity, &[Vector3::new(0.1, y, 0.5)]);
    let force = Vector3::new(1.0, 2.0, 3.0);
    let reaction = Reaction {
        force: vec![force],
        torque: vec![V3::zeros()],
    };
    let (report, body_force) = case.spread(&reaction);
    assert!(
        (report.on_walls - 0.75 * force).norm() < 1e-12,
        "{}",
        report.on_walls
    );
    assert!((report.force - force).norm() < 1e-12);
    let nodes = body_force.iter().zip(&case.geometry.volumes).zip(&no_slip);
    let in_fluid: V3 = nodes
        .map(|((f, v), &wall)| if wall { V3::zeros() } else { *v * vector(f) })
        .sum();
    assert!((in_fluid - 0.25 * force).norm() < 1e-12);
}

#[test]
fn a_point_that_is_not_finite_is_named() {
    let mut case = Case::new(BoxElement::Tetrahedron, [2, 2, 2], [true; 3], 0.0);
    let velocity = case.field(|_| V3::zeros());
    let points = [V3::zeros(), Vector3::new(0.0, f64::NAN, 1.0)];
    let error = case
        .coupling
        .sample(&velocity, &points, &mut Ambient::default());
    assert!(
        matches!(
            error,
            Err(CouplingError::NotFinite {
                point: 1,
                rank: 0,
                ..
            })
        ),
        "{error:?}"
    );
    let error = case
        .coupling
        .sample(&velocity[1..], &points, &mut Ambient::default());
    assert!(
        matches!(error, Err(CouplingError::Length { .. })),
        "{error:?}"
    );
}
