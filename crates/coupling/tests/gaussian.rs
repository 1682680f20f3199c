//! The Gaussian kernel: linear fields exact, spreading the exact adjoint, and what it does no matter of the mesh.

use fibreflow_coupling::{Coupling, CouplingError, Kernel};
use fibreflow_fibre::{Ambient, Reaction};
use fibreflow_mesh::{BoxElement, BoxMesh, Stretching};
use fibreflow_mesh::{DualGeometry, LocalMesh, distribute, geometry};
use fibreflow_parallel::Communicator;
use nalgebra::{Matrix3, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

type V3 = Vector3<f64>;

const KINDS: [BoxElement; 4] = [
    BoxElement::Hexahedron,
    BoxElement::Prism,
    BoxElement::Tetrahedron,
    BoxElement::Mixed,
];
const SIZE: [f64; 3] = [1.0, 0.9, 1.2];
const WIDTH: f64 = 0.15;

struct Case {
    mesh: Arc<LocalMesh>,
    geometry: Arc<DualGeometry>,
    coupling: Coupling,
    rng: ChaCha8Rng,
}

impl Case {
    fn new(element: BoxElement, periodic: [bool; 3], cells: [usize; 3]) -> Self {
        Self::with_width(element, periodic, cells, WIDTH).expect("coupling")
    }

    fn with_width(
        element: BoxElement,
        periodic: [bool; 3],
        cells: [usize; 3],
        width: f64,
    ) -> Result<Self, CouplingError> {
        let mesh = BoxMesh {
            size: SIZE,
            cells,
            stretching: [
                Stretching::Uniform,
                Stretching::Tanh(1.2),
                Stretching::Uniform,
            ],
            periodic,
            element,
            jitter: 0.2,
            seed: 5,
            ..BoxMesh::default()
        };
        let mesh = mesh.build().expect("box mesh");
        let mesh = Arc::new(distribute(&Communicator::single(), Some(mesh)).expect("one rank"));
        let geometry = Arc::new(geometry::dual(&mesh).expect("geometry"));
        let (free, kernel) = (vec![false; mesh.owned()], Kernel::Gaussian { width });
        Ok(Self {
            coupling: Coupling::with_kernel(mesh.clone(), geometry.clone(), free, kernel)?,
            mesh,
            geometry,
            rng: ChaCha8Rng::seed_from_u64(17),
        })
    }

    fn random(&mut self) -> V3 {
        Vector3::from_fn(|_, _| self.rng.random_range(-1.0..1.0))
    }

    /// Points in `copies` boxes around the box.
    fn points(&mut self, n: usize, copies: [f64; 3]) -> Vec<V3> {
        let mut point = || {
            Vector3::from_fn(|k, _| SIZE[k] * (0.5 + copies[k] * (self.rng.random::<f64>() - 0.5)))
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

    fn field(&self, f: impl Fn(V3) -> V3) -> Vec<[f64; 4]> {
        let values = self.mesh.nodes.iter().map(|x| f((*x).into()));
        values.map(|u| [u.x, u.y, u.z, 0.0]).collect()
    }
}

fn vector(v: &[f64; 4]) -> V3 {
    Vector3::new(v[0], v[1], v[2])
}

#[test]
fn a_linear_field_is_sampled_exactly_at_walls_too() {
    let gradient = Matrix3::new(0.3, -1.2, 0.5, 0.7, 0.1, -0.4, 2.0, 0.9, -0.8);
    let offset = Vector3::new(0.2, -0.1, 0.4);
    for element in KINDS {
        let mut case = Case::new(element, [false; 3], [9, 8, 10]);
        let velocity = case.field(|x| offset + gradient * x);
        let mut points = case.points(200, [1.0; 3]);
        points.push(V3::zeros());
        let ambient = case.sample(&velocity, &points);
        for (k, x) in points.iter().enumerate() {
            let error = (ambient.velocity[k] - offset - gradient * x).norm();
            assert!(error < 1e-12, "{element:?} at {x}: {error}");
            let error = (ambient.gradient[k] - gradient).norm();
            assert!(error < 1e-11, "{element:?} gradient at {x}: {error}");
        }
    }
}

/// Force, torque and power, with points in many images of the box and, where there are walls, beyond them.
#[test]
fn spreading_is_the_adjoint_and_loses_nothing() {
    for element in KINDS {
        for periodic in [[false; 3], [true, false, true], [true; 3]] {
            let mut case = Case::new(element, periodic, [9, 8, 10]);
            let points = case.points(100, periodic.map(|p| if p { 5.0 } else { 1.1 }));
            let mut velocity = case.field(|_| V3::zeros());
            for u in &mut velocity {
                let random = case.random();
                *u = [random.x, random.y, random.z, 0.0];
            }
            let ambient = case.sample(&velocity, &points);
            assert_eq!(case.coupling.outside() > 0, periodic != [true; 3]);
            let reaction = Reaction {
                force: (0..100).map(|_| case.random()).collect(),
                torque: (0..100).map(|_| 0.1 * case.random()).collect(),
            };
            let mut body_force = vec![[0.0; 4]; case.mesh.total()];
            let report = case.coupling.spread(&reaction, &mut body_force);
            let report = report.expect("spread");
            assert!(report.defect_relative < 1e-12, "{}", report.defect_relative);

            let nodes = || {
                let volumes = case.geometry.volumes.iter();
                body_force.iter().zip(volumes).map(|(f, v)| *v * vector(f))
            };
            let given: V3 = reaction.force.iter().sum();
            let received: V3 = nodes().sum();
            assert!((received - given).norm() < 1e-12 * 100.0);
            assert!((report.force - given).norm() < 1e-12 * 100.0);
            let power: f64 = (0..100)
                .map(|k| {
                    let spin = fibreflow_fibre::hydrodynamics::spin(&ambient.gradient[k]);
                    reaction.force[k].dot(&ambient.velocity[k]) + reaction.torque[k].dot(&spin)
                })
                .sum();
            let by_nodes: f64 = nodes().zip(&velocity).map(|(f, u)| f.dot(&vector(u))).sum();
            assert!((power - by_nodes).abs() < 1e-12 * 100.0, "{element:?}");
            if periodic == [false; 3] {
                // Those beyond walls push at the walls, so only the report knows their places.
                let arms = case.mesh.nodes.iter().map(|x| V3::from(*x));
                let received: V3 = arms.zip(nodes()).map(|(x, f)| x.cross(&f)).sum();
                assert!((received - report.torque).norm() < 1e-12 * 100.0);
            } else {
                let moments = points
                    .iter()
                    .zip(reaction.force.iter().zip(&reaction.torque));
                let given: V3 = moments.map(|(x, (f, t))| x.cross(f) + t).sum();
                let defect = (report.torque - given).norm();
                assert!(periodic != [true; 3] || defect < 1e-12 * 300.0, "{defect}");
            }
        }
    }
}

/// A wave loses exp(−½k²σ²), and a force of 1 N has the density of the Gaussian at every node, on any mesh.
#[test]
fn what_a_point_sees_and_does_is_that_of_a_gaussian() {
    let k = TAU / SIZE[0];
    let loss = (-0.5 * (k * WIDTH).powi(2)).exp();
    for element in KINDS {
        for cells in [[12, 12, 14], [18, 17, 20]] {
            let mut case = Case::new(element, [true; 3], cells);
            let velocity = case.field(|x| V3::new(0.0, (k * x.x).sin(), 0.0));
            let points = case.points(50, [3.0; 3]);
            let ambient = case.sample(&velocity, &points);
            let mut worst = 0.0_f64;
            for (at, x) in points.iter().enumerate() {
                let (value, slope) = (loss * (k * x.x).sin(), loss * k * (k * x.x).cos());
                worst = worst.max((ambient.velocity[at].y - value).abs());
                worst = worst.max((ambient.gradient[at][(1, 0)] - slope).abs() / k);
            }
            let at = V3::new(0.51, 0.42, 0.63);
            case.sample(&velocity, &[at]);
            let reaction = Reaction {
                force: vec![V3::x()],
                torque: vec![V3::zeros()],
            };
            let mut body_force = vec![[0.0; 4]; case.mesh.total()];
            case.coupling
                .spread(&reaction, &mut body_force)
                .expect("spread");
            let peak = (2.0 * PI * WIDTH * WIDTH).powf(-1.5);
            let mut off = 0.0_f64;
            for (x, f) in case.mesh.nodes.iter().zip(&body_force) {
                let square = (V3::from(*x) - at).norm_squared() / (WIDTH * WIDTH);
                if square < 9.0 {
                    off = off.max((f[0] / peak - (-0.5 * square).exp()).abs());
                }
            }
            println!("{element:?} {cells:?}: sample {worst:.1e}, density {off:.1e} of the peak");
            assert!(worst < 2e-2 && off < 5e-2, "{element:?} {cells:?}");
        }
    }
}

#[test]
fn widths_that_cannot_be_are_refused() {
    let refused = |width| Case::with_width(BoxElement::Hexahedron, [true; 3], [6; 3], width).err();
    for width in [0.0, -1.0, 0.23, f64::NAN] {
        let error = refused(width);
        assert!(
            matches!(error, Some(CouplingError::Width { .. })),
            "{width}: {error:?}"
        );
    }
    let mut case =
        Case::with_width(BoxElement::Hexahedron, [false; 3], [6; 3], 0.01).expect("set-up");
    let velocity = case.field(|_| V3::zeros());
    let points = [V3::new(0.25, 0.4, 0.5)];
    let error = case
        .coupling
        .sample(&velocity, &points, &mut Ambient::default());
    assert!(
        matches!(error, Err(CouplingError::Unresolved { .. })),
        "{error:?}"
    );
}
