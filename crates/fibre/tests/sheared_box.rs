//! Lees–Edwards: a box that is sheared along x as y grows.

use fibreflow_fibre::contact::{ContactSettings, ContactSystem, SegmentLoad, Segments, Wall};
use fibreflow_fibre::hydrodynamics::{AmbientFlow, DragModel, FluidProperties, TorqueModel};
use fibreflow_fibre::{
    Fibre, FibreSettings, FibreSystem, Hydrodynamics, Material, PeriodicBox, Vector3,
};
use fibreflow_parallel::Communicator;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const EDGE: f64 = 4.0;
const RATE: f64 = 0.7;

fn settings(rate: f64) -> ContactSettings {
    ContactSettings {
        friction: 0.4,
        shear_rate: rate,
        periodic: PeriodicBox {
            origin: Vector3::new(-0.3, 0.2, 0.0),
            lengths: [Some(EDGE); 3],
        },
        ..ContactSettings::new(1e3, 0.05)
    }
}

/// Rods of one segment each.
#[derive(Clone, Default)]
struct Rods {
    ids: Vec<u64>,
    /// Start and end of each rod.
    position: Vec<Vector3>,
    /// The same at both ends.
    velocity: Vec<Vector3>,
}

impl Rods {
    fn random(count: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut vector = |scale: f64| Vector3::from_fn(|_, _| scale * rng.random_range(-1.0..1.0));
        let mut rods = Self::default();
        for id in 0..count {
            let start = vector(0.5 * EDGE);
            rods.ids.push(id << 20);
            rods.position.extend([start, start + vector(0.8)]);
            rods.velocity.extend([vector(1.0); 2]);
        }
        rods
    }

    fn loads(&self, contacts: &mut ContactSystem, dt: f64) -> Vec<SegmentLoad> {
        let n = self.ids.len();
        let segments = Segments {
            ids: &self.ids,
            stems: &self.ids,
            node: &(0..n as u32).map(|i| 2 * i).collect::<Vec<_>>(),
            position: &self.position,
            velocity: &self.velocity,
            angular_velocity: &vec![Vector3::zeros(); 2 * n],
            radius: &vec![0.15; n],
            mass: &vec![1.0; n],
        };
        contacts.update(&segments).expect("update");
        contacts.forces(&segments, dt);
        let load = |i| contacts.load(i).copied().unwrap_or_default();
        (0..n).map(load).collect()
    }
}

fn sheared(rate: f64, strain: f64) -> ContactSystem {
    let mut contacts = ContactSystem::new(settings(rate), &Communicator::single()).expect("valid");
    if rate != 0.0 {
        contacts.set_time(strain / rate);
    }
    contacts
}

fn close(a: &[SegmentLoad], b: &[SegmentLoad], tolerance: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| {
        (a.start_force - b.start_force).norm() < tolerance
            && (a.end_force - b.end_force).norm() < tolerance
            && (a.torque - b.torque).norm() < tolerance
    })
}

/// Every rod is replaced by one of its images, of its own choice.
#[test]
fn images_of_rods_feel_the_same_forces() {
    for strain in [0.0, 0.13, 0.5, 1.77, -0.4] {
        let rods = Rods::random(150);
        let expected = rods.loads(&mut sheared(RATE, strain), 1e-3);
        assert!(
            expected
                .iter()
                .filter(|l| l.start_force.norm() > 0.1)
                .count()
                > 60
        );
        let mut moved = rods.clone();
        for i in 0..moved.ids.len() {
            let [k, layer, m] = [i % 3, i % 5, i % 7].map(|k| k as f64 - 2.0);
            let shift = Vector3::new(k + layer * strain, layer, m) * EDGE;
            for end in [2 * i, 2 * i + 1] {
                moved.position[end] += shift;
                moved.velocity[end].x += layer * EDGE * RATE;
            }
        }
        let found = moved.loads(&mut sheared(RATE, strain), 1e-3);
        assert!(close(&expected, &found, 1e-9), "strain {strain}");
        if strain != 0.0 {
            let unsheared = moved.loads(&mut sheared(0.0, 0.0), 1e-3);
            assert!(!close(&expected, &unsheared, 1e-3), "strain {strain}");
        }
    }
}

/// A whole number of periods ahead is where it was.
#[test]
fn a_sheared_box_repeats() {
    let mut rods = Rods::random(150);
    rods.velocity.fill(Vector3::zeros());
    let at = |strain: f64| rods.loads(&mut sheared(RATE, strain), 1e-3);
    assert!(close(&at(0.3), &at(5.3), 1e-9));
    assert!(!close(&at(0.3), &at(0.4), 1e-3));
}

#[test]
fn pairs_over_the_sheared_face_feel_the_relative_velocity() {
    let rods = Rods {
        ids: vec![0, 1 << 20],
        position: [0.21, 4.1]
            .into_iter()
            .flat_map(|y| [0.0, 1.0].map(|x| Vector3::new(x, y, 0.0)))
            .collect(),
        velocity: vec![Vector3::zeros(); 4],
    };
    let dt = 1e-6;
    // Upright: the image of the second rod is 0.11 below the first, and stays behind with −γ̇L.
    let load = rods.loads(&mut sheared(RATE, 0.0), dt)[0];
    let force = load.start_force + load.end_force;
    let (spring, mass) = (2.0 / 7.0 * 1e3, 0.5);
    let slip = RATE * EDGE;
    let damping = 2.0 * 0.1 * f64::sqrt(spring * mass);
    assert!(force.y > 100.0);
    let expected = -(damping + spring * dt) * slip;
    assert!(
        (force.x / expected - 1.0).abs() < 1e-9,
        "{force} {expected}"
    );
    let still = rods.loads(&mut sheared(0.0, 0.0), dt)[0];
    assert_eq!((still.start_force + still.end_force).x, 0.0);
}

/// Fibres that move with a sheared flow do not come nearer to their images: the search is repeated with the strain, not
/// with the displacement.
#[test]
fn a_suspension_in_shear_crosses_the_box() {
    let material = Material::new(0.05, 1e4, 0.3, 10.0);
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let fibres = (0..120)
        .map(|id| {
            let mut place = || rng.random_range(0.0..EDGE);
            let start = Vector3::new(place(), place(), place());
            let along = Vector3::new(place() - 2.0, place() - 2.0, place() - 2.0).normalize();
            Fibre::straight(id, material, start, start + along, 3)
        })
        .collect();
    let settings = FibreSettings {
        hydrodynamics: Some(Hydrodynamics {
            fluid: FluidProperties {
                density: 10.0,
                viscosity: 10.0,
            },
            drag: DragModel::default(),
            torque: TorqueModel::default(),
            point_spacing: f64::INFINITY,
        }),
        contacts: Some(settings(RATE)),
        ..FibreSettings::default()
    };
    let mut s = FibreSystem::new(Communicator::single(), settings, fibres).expect("valid");
    let flow = AmbientFlow::Shear { rate: RATE };
    let (mut most, mut deepest) = (0, 0.0_f64);
    for _ in 0..300 {
        s.advance_in_flow(&flow, 1e-2).expect("finite");
        let now = s.contacts().expect("on").statistics();
        most = most.max(now.contacts);
        deepest = deepest.max(now.max_overlap);
    }
    let contacts = s.contacts().expect("on");
    assert!((contacts.time() - 3.0).abs() < 1e-9);
    let statistics = contacts.statistics();
    assert!(most > 5 && deepest < 0.05, "{most} {deepest}");
    let travelled = s.velocities().iter().map(|v| v.norm()).fold(0.0, f64::max) * 3.0;
    // Twice the travel over the skin would be needed without following the shear.
    let naive = 2.0 * travelled / 0.05;
    assert!(
        (statistics.rebuilds as f64) < 0.8 * naive,
        "{} {naive}",
        statistics.rebuilds
    );
}

#[test]
fn a_sheared_box_must_repeat_along_y() {
    let mut open = settings(RATE);
    open.periodic.lengths[1] = None;
    open.walls = vec![Wall::plane(Vector3::zeros(), Vector3::y())];
    let error = ContactSystem::new(open, &Communicator::single())
        .err()
        .expect("refused");
    assert!(error.to_string().contains("shear_rate"), "{error}");
}

/// The strain of the box and the way of a wall are part of the state.
#[test]
fn a_resumed_run_in_a_sheared_box_is_bitwise_the_same() {
    let system = |fibres: Vec<Fibre>| {
        let mut contacts = settings(RATE);
        contacts.periodic.lengths[2] = None;
        contacts.walls = vec![Wall {
            velocity: Vector3::new(0.0, 0.0, 0.3),
            ..Wall::plane(Vector3::zeros(), Vector3::z())
        }];
        let settings = FibreSettings {
            gravity: Vector3::new(0.0, 0.0, -5.0),
            contacts: Some(contacts),
            ..FibreSettings::default()
        };
        FibreSystem::new(Communicator::single(), settings, fibres).expect("valid")
    };
    let material = Material::new(0.1, 1e5, 0.3, 10.0);
    let fibre = |id: u64| {
        let start = Vector3::new(0.3 * id as f64, 0.9 * id as f64, 0.12 + 0.11 * id as f64);
        let along = Vector3::new((id as f64).cos(), (id as f64).sin(), 0.0);
        Fibre::straight(id, material, start, start + along, 2)
    };
    let mut whole = system((0..12).map(fibre).collect());
    let run = |s: &mut FibreSystem| (0..40).for_each(|_| s.advance_free(1e-2).expect("finite"));
    run(&mut whole);
    let saved = whole.state();
    run(&mut whole);
    assert!(whole.contacts().expect("on").statistics().wall_contacts > 0);
    let mut resumed = system(Vec::new());
    resumed.restore(saved.clone()).expect("own record");
    run(&mut resumed);
    assert_eq!(resumed.state(), whole.state());
    // Without the strain it would not be.
    let mut forgetful = system(Vec::new());
    let mut upright = saved;
    upright
        .scalars
        .retain(|(name, _)| name != "fibre.contact_time");
    forgetful.restore(upright).expect("valid");
    run(&mut forgetful);
    assert_ne!(forgetful.positions(), whole.positions());
}
