//! Steps taken again from the same state, and short cuts of rigid fibres: the same answers as the long way.

use fibreflow_fibre::contact::{ContactSettings, NormalDamping};
use fibreflow_fibre::hydrodynamics::{
    DragModel, FluidProperties, SlenderConstants, TorqueModel, spin,
};
use fibreflow_fibre::{
    Ambient, Fibre, FibreSettings, FibreSystem, Hydrodynamics, Kinematics, Material, Matrix3,
    Points, Saved, Vector3,
};
use fibreflow_parallel::Communicator;

const GRADIENT: Matrix3 = Matrix3::new(0.3, -1.2, 0.5, 0.7, 0.1, -0.4, 0.9, 0.2, -0.4);

fn system(constants: SlenderConstants, fibres: &[[Vector3; 2]], touch: bool) -> FibreSystem {
    let contacts = touch.then(|| ContactSettings {
        damping: NormalDamping::Ratio(0.3),
        friction: 0.4,
        tangential_ratio: 0.5,
        ..ContactSettings::new(20.0, 0.05)
    });
    let settings = FibreSettings {
        contacts,
        hydrodynamics: Some(Hydrodynamics {
            drag: DragModel::SlenderBody(constants),
            torque: TorqueModel::Jeffery(constants),
            fluid: FluidProperties {
                density: 1.0,
                viscosity: 1.0,
            },
            point_spacing: f64::INFINITY,
        }),
        ..FibreSettings::default()
    };
    let fibre = |(id, [start, end]): (usize, &[Vector3; 2])| {
        let material = Material::new(0.05, 1e6, 0.3, 50.0);
        let mut fibre = Fibre::straight(id as u64, material, *start, *end, 5);
        fibre.kinematics = Kinematics::Rigid;
        fibre
    };
    let fibres = fibres.iter().enumerate().map(fibre).collect();
    FibreSystem::new(Communicator::single(), settings, fibres).expect("valid")
}

/// A flow that is curved along the fibre and changes in the step.
fn ambient(s: &FibreSystem) -> Ambient {
    let mut points = Points::default();
    s.points(&mut points);
    let bend = |x: &Vector3| Vector3::new(x.y * x.y, -x.x * x.z, 0.5 * x.x * x.x);
    let at = points.position.iter();
    Ambient {
        velocity: at.clone().map(|x| GRADIENT * x + bend(x)).collect(),
        gradient: at.clone().map(|x| GRADIENT * (1.0 + 0.3 * x.x)).collect(),
        change: at.map(|x| Vector3::new(0.1, 0.2 * x.x, -0.1)).collect(),
        ..Ambient::default()
    }
}

const ALONE: [[Vector3; 2]; 1] = [[Vector3::new(-0.4, 0.1, 0.2), Vector3::new(0.5, 0.3, -0.1)]];

/// Two points stand for all; a flow that gives way by nothing makes every point count.
#[test]
fn gathered_points_act_as_all_points() {
    for constants in [SlenderConstants::Batchelor, SlenderConstants::Split] {
        let mut short = system(constants, &ALONE, false);
        let mut long = system(constants, &ALONE, false);
        assert!(spin(&GRADIENT).norm() > 0.5);
        for _ in 0..10 {
            let given = ambient(&short);
            let all = Ambient {
                yielding: vec![0.0; given.velocity.len()],
                ..given.clone()
            };
            let a = short.advance(&given, 0.1).expect("finite").clone();
            let b = long.advance(&all, 0.1).expect("finite").clone();
            let size: f64 = a.force.iter().map(Vector3::norm).sum();
            for (a, b) in a.force.iter().zip(&b.force) {
                assert!((a - b).norm() < 1e-10 * size);
            }
            let turn: f64 = a.torque.iter().map(Vector3::norm).sum();
            for (a, b) in a.torque.iter().zip(&b.torque) {
                assert!((a - b).norm() < 1e-10 * turn);
            }
        }
        for (a, b) in short.positions().iter().zip(long.positions()) {
            assert!((a - b).norm() < 1e-10);
        }
    }
}

/// With friction springs in a contact that lasts.
#[test]
fn a_step_taken_again_is_the_same_step() {
    let across = [
        [Vector3::new(-0.5, 0.0, 0.0), Vector3::new(0.5, 0.0, 0.0)],
        [
            Vector3::new(0.1, -0.5, 0.098),
            Vector3::new(0.1, 0.5, 0.098),
        ],
    ];
    let mut s = system(SlenderConstants::Batchelor, &across, true);
    let pressed = |s: &FibreSystem| {
        let mut given = ambient(s);
        let half = given.velocity.len() / 2;
        for (p, u) in given.velocity.iter_mut().enumerate() {
            u.z += if p < half { 0.2 } else { -0.2 };
        }
        given
    };
    let mut saved = Saved::default();
    let mut springs = 0;
    for _ in 0..10 {
        let given = pressed(&s);
        s.save(&mut saved);
        let other = Ambient {
            velocity: given.velocity.iter().map(|u| u * 1.1).collect(),
            ..given.clone()
        };
        let first = s.advance(&given, 0.02).expect("finite").clone();
        let after = s.positions().to_vec();
        s.go_back(&saved);
        s.advance(&other, 0.02).expect("finite");
        assert_ne!(after, s.positions());
        s.go_back(&saved);
        let again = s.advance(&given, 0.02).expect("finite").clone();
        assert_eq!((first, after), (again, s.positions().to_vec()));
        let contacts = s.contacts().expect("on");
        springs += contacts.records().len();
        assert!(contacts.statistics().contacts > 0);
    }
    assert!(springs > 0);
}
