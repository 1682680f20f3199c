//! Sampling and spreading across ranks give what one rank gives.

use super::{Outcome, ensure};
use fibreflow_coupling::{Coupling, FibreLoad, Kernel, SpreadReport};
use fibreflow_fibre::hydrodynamics::{DragModel, FluidProperties, TorqueModel};
use fibreflow_fibre::{
    Ambient, Fibre, FibreSettings, FibreSystem, Hydrodynamics, Material, Points, Reaction,
};
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
    let kernels = [Kernel::Element, Kernel::Middle, gaussian];
    let pairs = kernels.map(|kernel| kinds.map(|element| (element, kernel)));
    for (element, kernel) in pairs.into_iter().flatten() {
        // Both points of a pair.
        let mine = (0..POINTS).filter(|k| k / 2 % size == rank).collect();
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
        if kernel == Kernel::Middle {
            // Close together, so that middles go through the wall too.
            for pair in points.chunks_mut(2) {
                pair[1] = pair[0] + 0.05 * random();
            }
        }
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
        let dg = (shared.ambient.gradient_at(local) - alone.ambient.gradient_at(k)).norm();
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

/// A tenth of what `examples/crossings.rs` does by itself.
pub fn no_segment_is_lost_in_crossings(communicator: &Communicator) -> Outcome {
    crossings(communicator, 110, 1e5)
}

/// Straight flights of fibres through periodic and rank boundaries, in every direction, handed to the rank that holds their middle after
/// every one: that many segments change rank or period, none is lost, and all end where they should. Collective.
///
/// # Errors
/// A lost segment, a fibre elsewhere, too few crossings.
pub fn crossings(communicator: &Communicator, flights: usize, wanted: f64) -> Outcome {
    const FIBRES: u64 = 150;
    const SEGMENTS: usize = 8;
    let cube = BoxMesh {
        cells: [4; 3],
        periodic: [true; 3],
        element: BoxElement::Tetrahedron,
        ..BoxMesh::default()
    };
    let mesh = communicator.is_root().then(|| cube.build()).transpose()?;
    let mesh = Arc::new(distribute(communicator, mesh)?);
    let geometry = Arc::new(geometry::dual(&mesh)?);
    let no_slip = vec![false; mesh.owned()];
    let velocity = vec![[0.0; 4]; mesh.total()];
    let mut coupling = Coupling::with_kernel(mesh, geometry, no_slip, Kernel::Element)?;
    let (size, rank) = (communicator.size() as u64, communicator.rank() as u64);
    let own = (0..FIBRES).filter(|id| id % size == rank);
    let settings = FibreSettings {
        hydrodynamics: Some(Hydrodynamics {
            fluid: FluidProperties {
                density: 1.0,
                viscosity: 1.0,
            },
            drag: DragModel::None,
            torque: TorqueModel::None,
            point_spacing: f64::INFINITY,
        }),
        ..FibreSettings::default()
    };
    let flight = |id: u64| {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(id);
        let mut random = || V3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let (middle, half) = (V3::repeat(0.5) + 0.5 * random(), 0.2 * random().normalize());
        (middle, half, 0.9 * random())
    };
    let fibre = |id: u64| {
        let (middle, half, _) = flight(id);
        // So soft that a flight is one sub-step.
        let material = Material::new(0.01, 1e-12, 0.3, 1.0);
        Fibre::straight(id, material, middle - half, middle + half, SEGMENTS)
    };
    let mut fibres = FibreSystem::new(communicator.clone(), settings, own.map(fibre).collect())?;
    let nodes = fibres.offsets().to_vec();
    for f in 0..fibres.fibres() {
        let (_, _, velocity) = flight(fibres.id(f));
        fibres.velocities_mut()[nodes[f]..nodes[f + 1]].fill(velocity);
    }
    let (mut points, mut ambient) = (Points::default(), Ambient::default());
    let mut crossings = 0.0;
    let mut known = std::collections::HashMap::new();
    for step in 0..flights {
        fibres.advance_free(1.0)?;
        fibres.points(&mut points);
        coupling.sample(&velocity, &points.position, &mut ambient)?;
        // Where every segment is now: the rank that holds its first point, and its period.
        let hosts: Vec<u32> = coupling.hosts().collect();
        let mut moved = Vec::new();
        for f in 0..fibres.fibres() {
            for s in 0..SEGMENTS {
                let p = 2 * (f * SEGMENTS + s);
                let period = points.position[p].map(|x| x.floor() as i64);
                moved.push((fibres.id(f) * SEGMENTS as u64 + s as u64, hosts[p], period));
            }
        }
        let tells: Vec<[i64; 5]> = moved
            .iter()
            .map(|&(id, host, at)| [id as i64, host.into(), at.x, at.y, at.z])
            .collect();
        for [id, host, x, y, z] in communicator.all_gather(&tells).concat() {
            let old = known.insert(id, (host, [x, y, z]));
            crossings += f64::from(u8::from(old.is_some_and(|old| old != (host, [x, y, z]))));
        }
        let load = |f: usize| FibreLoad {
            id: fibres.id(f),
            load: SEGMENTS as f64,
            middle_point: f * 2 * SEGMENTS + SEGMENTS,
        };
        let loads: Vec<FibreLoad> = (0..fibres.fibres()).map(load).collect();
        let owners = coupling.points_owner(&loads);
        fibres.migrate(&owners)?;
        coupling.forget();
        let count = communicator.sum(fibres.segments() as f64);
        ensure(count == (FIBRES as usize * SEGMENTS) as f64, || {
            format!("{count} segments after flight {step}")
        })?;
    }
    for f in 0..fibres.fibres() {
        let (middle, _, velocity) = flight(fibres.id(f));
        let missed = (fibres.centre(f) - middle - velocity * flights as f64).norm();
        ensure(missed < 1e-9, || {
            format!("fibre {} missed its goal by {missed:e}", fibres.id(f))
        })?;
    }
    ensure(crossings >= wanted, || {
        format!("only {crossings} crossings")
    })
}
