//! Sampling and spreading across ranks give what one rank gives.

use super::{Outcome, ensure};
use fibreflow_coupling::{Coupling, FibreLoad, Kernel, SpreadReport};
use fibreflow_fibre::{Ambient, Reaction};
use fibreflow_mesh::{BoxElement, BoxMesh};
use fibreflow_mesh::{LocalMesh, distribute, geometry};
use fibreflow_parallel::Communicator;
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use std::sync::Arc;

type V3 = Vector3<f64>;

const POINTS: usize = 400;
const STEPS: usize = 5;

/// The transfer on one communicator, for the points that its rank owns.
struct Transfer {
    mesh: Arc<LocalMesh>,
    coupling: Coupling,
    velocity: Vec<[f64; 4]>,
    ids: Vec<usize>,
    ambient: Ambient,
    body_force: Vec<[f64; 4]>,
}

impl Transfer {
    fn new(
        communicator: &Communicator,
        element: BoxElement,
        kernel: Kernel,
        ids: Vec<usize>,
    ) -> Result<Self, Box<dyn std::error::Error>> {
        let cube = BoxMesh {
            cells: [6, 5, 6],
            periodic: [true, false, true],
            element,
            jitter: 0.2,
            seed: 3,
            ..BoxMesh::default()
        };
        let mesh = communicator.is_root().then(|| cube.build()).transpose()?;
        let mesh = Arc::new(distribute(communicator, mesh)?);
        let geometry = Arc::new(geometry::dual(&mesh)?);
        let no_slip = mesh.nodes[..mesh.owned()]
            .iter()
            .map(|x| x[1] == 0.0)
            .collect();
        let velocity = mesh.global_nodes.iter().map(|&i| {
            let a = i as f64;
            [(1.3 * a).sin(), (2.1 * a).cos(), (0.7 * a).sin(), 0.0]
        });
        Ok(Self {
            coupling: Coupling::with_kernel(mesh.clone(), geometry, no_slip, kernel)?,
            velocity: velocity.collect(),
            ids,
            ambient: Ambient::default(),
            body_force: vec![[0.0; 4]; mesh.total()],
            mesh,
        })
    }

    fn step(
        &mut self,
        points: &[V3],
        reaction: &Reaction,
    ) -> Result<SpreadReport, Box<dyn std::error::Error>> {
        let own: Vec<V3> = self.ids.iter().map(|&k| points[k]).collect();
        self.coupling
            .sample(&self.velocity, &own, &mut self.ambient)?;
        let reaction = Reaction {
            force: self.ids.iter().map(|&k| reaction.force[k]).collect(),
            torque: self.ids.iter().map(|&k| reaction.torque[k]).collect(),
        };
        self.body_force.fill([0.0; 4]);
        Ok(self.coupling.spread(&reaction, &mut self.body_force)?)
    }
}

/// Points that wander through walls, periodic and rank boundaries, some exactly on element faces: velocity, gradient,
/// body force, totals and wall force as on one rank, to 1e-12.
pub fn ranks_agree(communicator: &Communicator) -> Outcome {
    let (rank, size) = (communicator.rank(), communicator.size());
    let kinds = [
        BoxElement::Hexahedron,
        BoxElement::Tetrahedron,
        BoxElement::Mixed,
    ];
    let gaussian = Kernel::Gaussian { width: 0.2 };
    let gaussians = kinds.iter().map(|&element| (element, gaussian));
    for (element, kernel) in kinds
        .map(|e| (e, Kernel::Element))
        .into_iter()
        .chain(gaussians)
    {
        let mine = (0..POINTS).filter(|k| k % size == rank).collect();
        let all = (0..POINTS).collect();
        let mut shared = Transfer::new(communicator, element, kernel, mine)?;
        let mut alone = Transfer::new(&Communicator::single(), element, kernel, all)?;
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(11);
        let mut random = || V3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let mut points: Vec<V3> = (0..POINTS)
            .map(|k| match k % 8 {
                0 => alone.mesh.nodes[k / 2].into(),
                1 => {
                    0.5 * (V3::from(alone.mesh.nodes[k / 2])
                        + V3::from(alone.mesh.nodes[k / 2 + 1]))
                }
                _ => V3::repeat(0.5) + 0.5 * random(),
            })
            .collect();
        for _ in 0..STEPS {
            let reaction = Reaction {
                force: (0..POINTS).map(|_| random()).collect(),
                torque: (0..POINTS).map(|_| 0.1 * random()).collect(),
            };
            let expected = alone.step(&points, &reaction)?;
            let report = shared.step(&points, &reaction)?;
            compare_samples(&shared, &alone, element)?;
            compare_forces(&shared, &alone, element)?;
            compare_reports(&report, &expected, element)?;
            for (k, point) in points.iter_mut().enumerate() {
                let step = random();
                if k % 8 > 1 {
                    *point += Vector3::new(0.3, 0.02, 0.3).component_mul(&step);
                }
            }
        }
        ensure(alone.coupling.outside() > 0, || {
            "no point went through the wall".into()
        })?;
    }
    Ok(())
}

fn compare_samples(shared: &Transfer, alone: &Transfer, element: BoxElement) -> Outcome {
    for (local, &k) in shared.ids.iter().enumerate() {
        let du = (shared.ambient.velocity[local] - alone.ambient.velocity[k]).norm();
        let dg = (shared.ambient.gradient[local] - alone.ambient.gradient[k]).norm();
        ensure(du < 1e-12 && dg < 1e-11, || {
            format!("{element:?}, point {k}: velocity differs by {du:e}, gradient by {dg:e}")
        })?;
    }
    Ok(())
}

fn compare_forces(shared: &Transfer, alone: &Transfer, element: BoxElement) -> Outcome {
    let largest = alone
        .body_force
        .iter()
        .flatten()
        .fold(0.0, |m: f64, f| m.max(f.abs()));
    for (i, found) in shared.body_force[..shared.mesh.owned()].iter().enumerate() {
        let node = shared.mesh.global_nodes[i];
        for (a, b) in found.iter().zip(&alone.body_force[node as usize]) {
            ensure((a - b).abs() < 1e-12 * largest, || {
                format!("{element:?}, node {node}: body force {a} instead of {b}")
            })?;
        }
    }
    Ok(())
}

fn compare_reports(found: &SpreadReport, expected: &SpreadReport, element: BoxElement) -> Outcome {
    let size = POINTS as f64;
    let close = |a: &V3, b: &V3, scale: f64| (a - b).norm() < 1e-12 * scale * size;
    let agree = close(&found.force, &expected.force, 1.0)
        && close(&found.torque, &expected.torque, 3.0)
        && close(&found.on_walls, &expected.on_walls, 1.0)
        && found.outside == expected.outside
        && found.defect_relative < 1e-12;
    ensure(agree, || {
        format!("{element:?}: {found:?} instead of {expected:?}")
    })
}

/// All fibres gathered in one corner: they are handed out so that no rank has more than 1.2 times the mean, and the
/// owners do not depend on who asks.
pub fn crowded_fibres_are_handed_out(communicator: &Communicator) -> Outcome {
    const FIBRES: usize = 60;
    let size = communicator.size();
    let mut owners = Vec::new();
    for shift in 0..2 {
        let mine: Vec<usize> = (0..FIBRES)
            .filter(|k| (k + shift) % size == communicator.rank())
            .collect();
        let kernel = Kernel::Element;
        let mut transfer = Transfer::new(communicator, BoxElement::Hexahedron, kernel, mine)?;
        let points: Vec<V3> = (0..POINTS)
            .map(|k| Vector3::new(0.1 + 0.001 * k as f64, 0.3, 0.2))
            .collect();
        let none = Reaction {
            force: vec![V3::zeros(); POINTS],
            torque: vec![V3::zeros(); POINTS],
        };
        transfer.step(&points, &none)?;
        let loads: Vec<FibreLoad> = (transfer.ids.iter().enumerate())
            .map(|(middle_point, &k)| FibreLoad {
                id: k as u64,
                load: 10.0,
                middle_point,
            })
            .collect();
        let new = transfer.coupling.points_owner(&loads);
        let pairs: Vec<[u64; 2]> = loads
            .iter()
            .zip(new)
            .map(|(f, r)| [f.id, r.into()])
            .collect();
        let mut all = communicator.all_gather(&pairs).concat();
        all.sort_unstable();
        let most = (0..size as u64)
            .map(|r| all.iter().filter(|p| p[1] == r).count())
            .max();
        let allowed = 1.2 * FIBRES as f64 / size as f64;
        ensure(most.is_some_and(|n| n as f64 <= allowed), || {
            format!("a rank gets {most:?} of {FIBRES}")
        })?;
        owners.push(all);
    }
    ensure(owners[0] == owners[1], || {
        "owners depend on who asks".into()
    })
}
