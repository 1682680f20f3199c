use super::*;
use crate::PeriodicBox;
use crate::contact::{NormalDamping, Wall};
use crate::shape::SEGMENT_BITS;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// One-segment fibres whose end nodes carry half the mass each.
#[derive(Clone, Default)]
struct Rods {
    ids: Vec<u64>,
    node: Vec<u32>,
    /// Start and end of each rod, as all that follow.
    position: Vec<Vector3>,
    velocity: Vec<Vector3>,
    angular_velocity: Vec<Vector3>,
    radius: Vec<f64>,
    mass: Vec<f64>,
}

impl Rods {
    fn push(&mut self, ends: [Vector3; 2], velocity: Vector3, radius: f64, mass: f64) {
        self.ids.push((self.ids.len() as u64) << SEGMENT_BITS);
        self.node.push(self.position.len() as u32);
        self.position.extend(ends);
        self.velocity.extend([velocity; 2]);
        self.angular_velocity.extend([Vector3::zeros(); 2]);
        self.radius.push(radius);
        self.mass.push(mass);
    }

    fn random(count: usize, edge: f64, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut vector = |scale: f64| Vector3::from_fn(|_, _| scale * rng.random_range(-1.0..1.0));
        let mut rods = Self::default();
        for i in 0..count {
            let start = vector(0.5 * edge);
            rods.push([start, start + vector(1.0)], vector(1.0), 0.2, 1.0);
            rods.velocity[2 * i + 1] += vector(1.0);
            let spin = vector(3.0);
            rods.angular_velocity[2 * i..].fill(spin);
        }
        rods
    }

    fn segments(&self) -> Segments<'_> {
        Segments {
            ids: &self.ids,
            stems: &self.ids,
            node: &self.node,
            radius: &self.radius,
            mass: &self.mass,
            position: &self.position,
            velocity: &self.velocity,
            angular_velocity: &self.angular_velocity,
        }
    }

    fn loads(&self, contacts: &mut ContactSystem, dt: f64) -> Vec<SegmentLoad> {
        contacts.update(&self.segments()).expect("update");
        contacts.forces(&self.segments(), dt);
        let load = |i: usize| contacts.load(i).copied().unwrap_or_default();
        (0..self.ids.len()).map(load).collect()
    }

    /// Symplectic Euler step of the end nodes, without rotation about the axis.
    fn step(&mut self, contacts: &mut ContactSystem, gravity: Vector3, dt: f64) {
        let loads = self.loads(contacts, dt);
        for (i, load) in loads.iter().enumerate() {
            let per_mass = 2.0 / self.mass[i];
            for (end, force) in [load.start_force, load.end_force].iter().enumerate() {
                self.velocity[2 * i + end] += (force * per_mass + gravity) * dt;
                let velocity = self.velocity[2 * i + end];
                self.position[2 * i + end] += velocity * dt;
            }
        }
    }

    fn momentum(&self) -> Vector3 {
        (0..self.ids.len())
            .map(|i| 0.5 * self.mass[i] * (self.velocity[2 * i] + self.velocity[2 * i + 1]))
            .sum()
    }
}

fn settings() -> ContactSettings {
    ContactSettings {
        damping: NormalDamping::Restitution(0.8),
        friction: 0.3,
        tangential_ratio: 0.5,
        ..ContactSettings::new(1e4, 0.1)
    }
}

fn contacts(settings: ContactSettings) -> ContactSystem {
    ContactSystem::new(settings, &Communicator::single()).expect("settings")
}

/// Two rods across each other, a small overlap, sliding.
fn cross() -> Rods {
    let mut rods = Rods::default();
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    rods.push([-x, x], 0.1 * y, 0.1, 1.0);
    rods.push([0.199 * z - y, 0.199 * z + y], 0.2 * x, 0.1, 1.0);
    rods
}

#[test]
fn force_and_torque_sum_to_nothing() {
    let rods = Rods::random(200, 3.0, 4);
    let mut contacts = contacts(settings());
    let loads = rods.loads(&mut contacts, 1e-4);
    let (mut force, mut torque, mut size) = (Vector3::zeros(), Vector3::zeros(), 0.0);
    for (i, load) in loads.iter().enumerate() {
        force += load.start_force + load.end_force;
        torque += rods.position[2 * i].cross(&load.start_force)
            + rods.position[2 * i + 1].cross(&load.end_force)
            + load.torque;
        size += load.start_force.norm() + load.end_force.norm();
    }
    assert!(contacts.statistics().contacts > 100);
    assert!(force.norm() < 1e-14 * size, "{}", force.norm() / size);
    assert!(torque.norm() < 1e-14 * size, "{}", torque.norm() / size);
}

#[test]
fn a_head_on_collision_keeps_momentum_and_has_the_restitution_set() {
    for restitution in [1.0, 0.7, 0.2] {
        let mut rods = Rods::default();
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        rods.push([-x, x], z, 0.1, 1.0);
        rods.push([0.3 * z - y, 0.3 * z + y], -2.0 * z, 0.1, 3.0);
        let before = rods.momentum();
        let mut contacts = contacts(ContactSettings {
            damping: NormalDamping::Restitution(restitution),
            ..settings()
        });
        let dt = 2e-3 * contacts.critical_step(&rods.segments());
        let mut touched = false;
        for _ in 0..60_000 {
            rods.step(&mut contacts, Vector3::zeros(), dt);
            touched |= contacts.statistics().contacts > 0;
        }
        let parting = rods.velocity[2].z - rods.velocity[0].z;
        assert!(touched && contacts.statistics().contacts == 0);
        assert!((rods.momentum() - before).norm() < 1e-12);
        assert!(
            (parting - 3.0 * restitution).abs() < 3e-3,
            "e = {} instead of {restitution}",
            parting / 3.0
        );
        let lost = 0.5 * 0.75 * 9.0 * (1.0 - restitution * restitution);
        let dissipated = contacts.statistics().dissipated_energy;
        assert!(
            (dissipated - lost).abs() < 1e-2 * (lost + 0.1),
            "{dissipated} {lost}"
        );
    }
}

/// Along its axis, a rod on an incline sticks up to tan α = μ and slides with g(sin α − μ cos α) above.
#[test]
fn a_rod_on_an_incline_sticks_below_the_friction_angle_and_slides_above() {
    let (friction, weight) = (0.3, 10.0);
    let slide = |slope: f64| {
        let angle = slope.atan();
        let mut rods = Rods::default();
        let sunk = weight * angle.cos() / 1e4;
        let height = (0.1 - sunk) * Vector3::z();
        rods.push(
            [height - Vector3::x(), height + Vector3::x()],
            Vector3::zeros(),
            0.1,
            1.0,
        );
        let mut contacts = contacts(ContactSettings {
            damping: NormalDamping::Ratio(1.0),
            walls: vec![Wall::plane(Vector3::zeros(), 2.0 * Vector3::z())],
            ..settings()
        });
        let gravity = weight * Vector3::new(angle.sin(), 0.0, -angle.cos());
        let dt = 0.05 * contacts.critical_step(&rods.segments());
        let steps = (1.0 / dt) as usize;
        for _ in 0..steps {
            rods.step(&mut contacts, gravity, dt);
        }
        let time = dt * steps as f64;
        (
            rods.velocity[0].x / time,
            weight * angle.sin() - friction * weight * angle.cos(),
        )
    };
    let (stick, _) = slide(0.99 * friction);
    assert!(stick.abs() < 1e-6, "{stick}");
    let (acceleration, _) = slide(1.01 * friction);
    assert!(acceleration > 0.01, "{acceleration}");
    let (acceleration, expected) = slide(2.0 * friction);
    assert!(
        (acceleration / expected - 1.0).abs() < 0.01,
        "{acceleration} {expected}"
    );
}

#[test]
fn friction_springs_survive_a_search_and_a_restart() {
    let mut rods = cross();
    let far = 5.0 * Vector3::z();
    rods.push([far, far + Vector3::x()], Vector3::zeros(), 0.1, 1.0);
    let mut contacts = contacts(settings());
    for _ in 0..3 {
        rods.loads(&mut contacts, 1e-6);
    }
    let records = contacts.records();
    assert_eq!(records.len(), 1);
    assert!((Vector3::from(records[0].spring) - Vector3::new(-6e-7, 3e-7, 0.0)).norm() < 1e-15);

    // A stranger moves by more than the skin.
    rods.position[4].z += 0.2;
    contacts.update(&rods.segments()).expect("update");
    assert_eq!(contacts.statistics().rebuilds, 2);
    assert_eq!(contacts.records(), records);

    let mut resumed = self::contacts(settings());
    resumed.restore_records(records.clone());
    assert_eq!(resumed.records(), records);
    let expected = rods.loads(&mut contacts, 1e-6);
    assert_eq!(rods.loads(&mut resumed, 1e-6), expected);
    assert_eq!(contacts.records(), resumed.records());

    // Apart: the spring is forgotten.
    rods.position[2].z += 1.0;
    rods.position[3].z += 1.0;
    rods.loads(&mut contacts, 1e-6);
    assert!(contacts.records().is_empty());
}

#[test]
fn wall_springs_survive_a_restart_too() {
    let mut rods = Rods::default();
    let height = 0.099 * Vector3::z();
    rods.push([height, height + Vector3::x()], Vector3::y(), 0.1, 1.0);
    let with_wall = ContactSettings {
        walls: vec![Wall::plane(Vector3::zeros(), Vector3::z())],
        ..settings()
    };
    let mut first = contacts(with_wall.clone());
    rods.loads(&mut first, 1e-6);
    assert_eq!(first.records().len(), 2);
    assert_eq!(first.statistics().wall_contacts, 2);
    let mut resumed = contacts(with_wall);
    resumed.restore_records(first.records());
    assert_eq!(rods.loads(&mut first, 1e-6), rods.loads(&mut resumed, 1e-6));
}

#[test]
fn a_contact_through_a_periodic_boundary_equals_one_inside() {
    let periodic = PeriodicBox {
        origin: Vector3::zeros(),
        lengths: [Some(6.0), None, Some(7.0)],
    };
    let inside = cross();
    let mut shifted = inside.clone();
    let period = Vector3::new(-12.0, 0.0, 21.0);
    shifted.position[2] += period;
    shifted.position[3] += period;
    let repeated = ContactSettings {
        periodic,
        ..settings()
    };
    let expected = inside.loads(&mut contacts(settings()), 1e-6);
    let found = shifted.loads(&mut contacts(repeated), 1e-6);
    for (x, y) in expected.iter().zip(&found) {
        assert!(x.start_force.norm() > 1.0);
        assert!((x.start_force - y.start_force).norm() < 1e-10);
        assert!((x.end_force - y.end_force).norm() < 1e-10);
        assert!((x.torque - y.torque).norm() < 1e-10);
    }
}

#[test]
fn loads_do_not_depend_on_the_thread_count() {
    let rods = Rods::random(400, 4.0, 9);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build()
            .expect("pool")
            .install(|| rods.loads(&mut contacts(settings()), 1e-4))
    };
    assert_eq!(run(1), run(3));
}

/// The step is a bound: at 0.9 of it an elastic contact keeps its energy, well above it blows up.
#[test]
fn the_critical_step_bounds_the_stable_steps() {
    let bounce = |factor: f64| {
        let mut rods = Rods::default();
        // A rod held by two walls, loaded at an end: the stiffest motion.
        let wall = |z: f64| Wall::plane(z * Vector3::z(), -z * Vector3::z());
        rods.push([Vector3::zeros(), Vector3::x()], Vector3::zeros(), 0.1, 1.0);
        rods.velocity[0].z = 1e-3;
        let mut contacts = contacts(ContactSettings {
            damping: NormalDamping::Ratio(0.0),
            friction: 0.0,
            walls: vec![wall(0.05), wall(-0.05)],
            ..settings()
        });
        let dt = factor * contacts.critical_step(&rods.segments());
        let mut fastest: f64 = 0.0;
        for _ in 0..2000 {
            rods.step(&mut contacts, Vector3::zeros(), dt);
            fastest = fastest.max(rods.velocity[0].z.abs());
        }
        fastest
    };
    assert!(bounce(0.9) < 1e-2);
    assert!(bounce(2.5) > 1e-2);
}

#[test]
fn settings_are_checked() {
    let refused = |change: &dyn Fn(&mut ContactSettings)| {
        let mut wrong = settings();
        change(&mut wrong);
        ContactSystem::new(wrong, &Communicator::single())
            .err()
            .expect("refused")
            .to_string()
    };
    assert!(refused(&|s| s.normal_stiffness = -1.0).contains("normal_stiffness is -1"));
    assert!(refused(&|s| s.friction = f64::NAN).contains("friction"));
    assert!(refused(&|s| s.skin = 0.0).contains("skin"));
    assert!(refused(&|s| s.damping = NormalDamping::Restitution(1.2)).contains("restitution"));
    let wall = |normal| Wall::plane(Vector3::zeros(), normal);
    assert!(refused(&|s| s.walls = vec![wall(Vector3::zeros())]).contains("wall 0"));
    assert!(
        refused(&|s| {
            s.walls = vec![wall(Vector3::z()), wall(Vector3::x())];
            s.periodic.lengths[0] = Some(4.0);
        })
        .contains("wall 1: its normal points along a periodic direction")
    );
}

#[test]
fn a_common_stream_needs_no_search_but_walls_are_met() {
    let stream = Vector3::new(1.0, 0.0, 0.0);
    let mut rods = cross();
    rods.velocity.fill(stream);
    let settings = || ContactSettings {
        walls: vec![Wall::plane(Vector3::new(5.0, 0.0, 0.0), -Vector3::x())],
        ..settings()
    };
    // A hundred skins of way, alone and towards a wall.
    for (walls, searches) in [(Vec::new(), 1..=1), (settings().walls, 100..=220)] {
        let mut rods = rods.clone();
        let settings = ContactSettings {
            walls,
            ..settings()
        };
        let mut contacts = contacts(settings.clone());
        for _ in 0..1000 {
            rods.position.iter_mut().for_each(|x| *x += 0.01 * stream);
            contacts.update(&rods.segments()).expect("update");
            // The first rod's ends at x = ±1 before the wall or behind it.
            if rods.position[1].x > 4.95 && rods.position[1].x < 5.0 && !settings.walls.is_empty() {
                contacts.forces(&rods.segments(), 1e-6);
                assert!(contacts.statistics().wall_contacts > 0);
            }
        }
        let found = contacts.statistics().rebuilds;
        assert!(searches.contains(&found), "{found}");
    }
}

/// The list of the first search holds only as long as its own skin allows, not the wider one of the next.
#[test]
fn a_skin_that_grows_is_not_yet_that_of_the_list() {
    let mut rods = cross();
    let apart = 0.122;
    rods.position[2..]
        .iter_mut()
        .for_each(|x| x.z += 0.001 + apart);
    let settings = ContactSettings {
        skin_grows: true,
        ..settings()
    };
    let mut contacts = contacts(settings);
    for step in 0..40 {
        contacts.update(&rods.segments()).expect("update");
        contacts.forces(&rods.segments(), 1e-6);
        let gap = apart - 0.004 * f64::from(step);
        let touching = contacts.statistics().contacts;
        assert_eq!(touching, usize::from(gap < 0.0), "{gap}");
        rods.position[..2].iter_mut().for_each(|x| x.z += 0.002);
        rods.position[2..].iter_mut().for_each(|x| x.z -= 0.002);
    }
}

#[test]
fn a_skin_that_grows_changes_no_load() {
    let mut rods = Rods::random(200, 6.0, 9);
    rods.velocity
        .iter_mut()
        .for_each(|v| *v += Vector3::new(100.0, -20.0, 3.0));
    let run = |skin_grows: bool| {
        let settings = ContactSettings {
            skin_grows,
            periodic: PeriodicBox {
                lengths: [Some(9.0), None, Some(9.0)],
                ..PeriodicBox::unbounded()
            },
            walls: vec![Wall::plane(Vector3::new(0.0, -4.0, 0.0), Vector3::y())],
            ..settings()
        };
        let (mut rods, mut contacts) = (rods.clone(), contacts(settings));
        for _ in 0..300 {
            rods.step(&mut contacts, Vector3::zeros(), 2e-4);
        }
        (rods.position, contacts.statistics())
    };
    let ((fixed, before), (grown, after)) = (run(false), run(true));
    assert!(before.contacts > 0 && before.wall_contacts > 0);
    assert_eq!(fixed, grown);
    assert!(
        3 * after.rebuilds < 2 * before.rebuilds,
        "{} {}",
        after.rebuilds,
        before.rebuilds
    );
}
