use super::*;
use crate::contact::{ContactSettings, ContactSystem, NormalDamping, SegmentLoad};
use fibreflow_parallel::Communicator;

/// One segment.
struct Rod {
    ends: [Vector3; 2],
    velocity: Vector3,
}

impl Rod {
    fn load(&self, contacts: &mut ContactSystem, dt: f64) -> SegmentLoad {
        let segments = Segments {
            ids: &[0],
            stems: &[0],
            node: &[0],
            position: &self.ends,
            velocity: &[self.velocity; 2],
            angular_velocity: &[Vector3::zeros(); 2],
            radius: &[0.1],
            mass: &[1.0],
        };
        contacts.update(&segments).expect("update");
        contacts.forces(&segments, dt);
        contacts.load(0).copied().unwrap_or_default()
    }
}

fn system(walls: Vec<Wall>, friction: f64) -> ContactSystem {
    let settings = ContactSettings {
        damping: NormalDamping::Ratio(0.0),
        friction,
        walls,
        ..ContactSettings::new(1e3, 0.05)
    };
    ContactSystem::new(settings, &Communicator::single()).expect("settings")
}

fn floor(cells: usize) -> Vec<[Vector3; 3]> {
    let at = |i: usize, j: usize| Vector3::new(i as f64, j as f64, 0.0) * (8.0 / cells as f64);
    let cell = |k: usize| {
        let (i, j) = (k % cells, k / cells);
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    (0..cells * cells).flat_map(cell).collect()
}

#[test]
fn a_floor_of_facets_is_a_plane() {
    let plane = Wall::plane(Vector3::zeros(), Vector3::z());
    for cells in [1, 7, 40] {
        let mut exact = system(vec![plane.clone()], 0.4);
        let mut facets = system(vec![Wall::facets(floor(cells))], 0.4);
        let velocity = Vector3::new(1.0, 0.37, 0.0);
        let start = [Vector3::new(1.3, 2.1, 0.095), Vector3::new(2.6, 2.9, 0.09)];
        let dt = 1e-3;
        for k in 0..3000 {
            let moved = velocity * (dt * f64::from(k));
            let rod = Rod {
                ends: start.map(|x| x + moved),
                velocity,
            };
            let (a, b) = (rod.load(&mut exact, dt), rod.load(&mut facets, dt));
            assert!(
                (a.start_force - b.start_force).norm() < 1e-9,
                "{cells} {k}: {a:?} {b:?}"
            );
            assert!((a.end_force - b.end_force).norm() < 1e-9);
            assert!((a.torque - b.torque).norm() < 1e-9);
        }
        assert!(exact.records().iter().any(|r| r.spring != [0.0; 3]));
    }
}

/// A polygon of many sides in place of a round pipe.
#[test]
fn a_pipe_of_facets_is_nearly_a_pipe() {
    let radius = 2.0;
    let sides = 400;
    let at = |k: usize, z: f64| {
        let angle = std::f64::consts::TAU * k as f64 / sides as f64;
        Vector3::new(radius * angle.cos(), radius * angle.sin(), z)
    };
    let side = |k: usize| {
        let [a, b] = [at(k, 0.0), at(k + 1, 0.0)];
        let [c, d] = [at(k + 1, 6.0), at(k, 6.0)];
        // The normal points to the axis.
        [[a, c, b], [a, d, c]]
    };
    let mut facets = system(vec![Wall::facets((0..sides).flat_map(side).collect())], 0.0);
    let mut round = system(
        vec![Wall::pipe(Vector3::zeros(), -3.0 * Vector3::z(), radius)],
        0.0,
    );
    for k in 0..50 {
        let angle = 0.13 * f64::from(k);
        let out = Vector3::new(angle.cos(), angle.sin(), 0.0);
        let ends = [
            1.91 * out + 2.0 * Vector3::z(),
            1.93 * out + 3.1 * Vector3::z(),
        ];
        let rod = Rod {
            ends,
            velocity: Vector3::zeros(),
        };
        let (a, b) = (rod.load(&mut round, 1e-3), rod.load(&mut facets, 1e-3));
        // Half the stiffness at each end, overlaps of 0.01 and 0.03.
        assert!(
            (a.start_force + 5.0 * out).norm() < 1e-9 && (a.end_force + 15.0 * out).norm() < 1e-9
        );
        assert!((a.start_force - b.start_force).norm() < 0.1);
        assert!((a.end_force - b.end_force).norm() < 0.2);
    }
}

#[test]
fn a_moving_wall_pushes_drags_and_works() {
    let pushing = Wall {
        velocity: Vector3::new(0.5, 0.0, 1.0),
        ..Wall::plane(Vector3::new(0.0, 0.0, -1.0), Vector3::z())
    };
    let mut contacts = system(vec![pushing], 0.3);
    let rod = Rod {
        ends: [Vector3::zeros(), Vector3::x()],
        velocity: Vector3::zeros(),
    };
    let dt = 1e-4;
    assert_eq!(rod.load(&mut contacts, dt), SegmentLoad::default());
    // After 0.92 the overlap is 0.02.
    contacts.set_time(0.92);
    let load = rod.load(&mut contacts, dt);
    let force = load.start_force + load.end_force;
    assert!((force.z - 20.0).abs() < 1e-9);
    // The friction spring has just begun to load, along the wall's motion.
    let expected = 2.0 / 7.0 * 1e3 * 0.5 * dt;
    assert!((force.x - expected).abs() < 1e-9, "{force}");
    let work = contacts.statistics().wall_work;
    assert!(
        (work - (20.0 + 0.5 * expected) * dt).abs() < 1e-12,
        "{work}"
    );
    assert!((contacts.wall_forces()[0] + force).norm() < 1e-12);
}

/// A surface that slides or turns drags, works, and stays where it is.
#[test]
fn a_surface_that_moves_in_itself_drags() {
    let turning = SurfaceMotion::Turning {
        point: Vector3::new(0.5, -2.0, 7.0),
        spin: 0.25 * Vector3::z(),
    };
    for motion in [SurfaceMotion::Sliding(-0.5 * Vector3::x()), turning] {
        let floor = Wall {
            motion,
            ..Wall::plane(Vector3::zeros(), Vector3::z())
        };
        let mut contacts = system(vec![floor], 0.3);
        contacts.set_time(100.0);
        let rod = Rod {
            ends: [Vector3::new(0.5, 0.0, 0.09), Vector3::new(0.5, 0.0, 0.09)],
            velocity: Vector3::zeros(),
        };
        let dt = 1e-4;
        let load = rod.load(&mut contacts, dt);
        let force = load.start_force + load.end_force;
        let expected = -2.0 / 7.0 * 1e3 * 0.5 * dt;
        assert!((force.x - expected).abs() < 1e-9, "{force}");
        assert!((force.z - 10.0).abs() < 1e-9);
        assert!((contacts.statistics().wall_work + 0.5 * expected * dt).abs() < 1e-15);
    }
}

#[test]
fn friction_on_facets_survives_a_restart() {
    let mut first = system(vec![Wall::facets(floor(20))], 0.4);
    let velocity = Vector3::new(0.1, 0.2, 0.0);
    let start = [Vector3::new(1.3, 2.1, 0.09), Vector3::new(2.6, 2.9, 0.09)];
    let dt = 1e-2;
    let mut second = None;
    for k in 0..400 {
        let moved = velocity * (dt * f64::from(k));
        let rod = Rod {
            ends: start.map(|x| x + moved),
            velocity,
        };
        let load = rod.load(&mut first, dt);
        if let Some(second) = &mut second {
            assert_eq!(load, rod.load(second, dt), "{k}");
        }
        if k == 150 {
            let mut resumed = system(vec![Wall::facets(floor(20))], 0.4);
            resumed.restore_records(first.records());
            second = Some(resumed);
        }
    }
}

#[test]
fn walls_are_checked() {
    let refused = |wall: Wall| {
        let mut settings = ContactSettings::new(1e3, 0.05);
        settings.walls = vec![wall];
        settings.periodic.lengths[0] = Some(5.0);
        let error = ContactSystem::new(settings, &Communicator::single()).err();
        error.expect("refused").to_string()
    };
    let zero = Vector3::zeros();
    assert!(refused(Wall::pipe(zero, zero, 1.0)).contains("axis has no direction"));
    assert!(refused(Wall::pipe(zero, Vector3::y(), 1.0)).contains("across its axis is periodic"));
    assert!(refused(Wall::pipe(zero, Vector3::x(), -1.0)).contains("radius"));
    assert!(refused(Wall::facets(Vec::new())).contains("no facets"));
    let moving = Wall {
        velocity: Vector3::repeat(f64::NAN),
        ..Wall::plane(zero, Vector3::y())
    };
    assert!(refused(moving).contains("velocity"));
}
