//! A run, saved and resumed, goes on bitwise; a damaged record is refused.

use fibreflow_fibre::contact::{ContactSettings, NormalDamping, Wall};
use fibreflow_fibre::hydrodynamics::{AmbientFlow, DragModel, FluidProperties, TorqueModel};
use fibreflow_fibre::{
    Equilibrium, Fibre, FibreError, FibreSettings, FibreState, FibreSystem, Hydrodynamics,
    Material, Support, Vector3,
};
use fibreflow_parallel::Communicator;

fn settings() -> FibreSettings {
    FibreSettings {
        gravity: Vector3::new(0.0, 0.0, -5.0),
        hydrodynamics: Some(Hydrodynamics {
            fluid: FluidProperties {
                density: 1.0,
                viscosity: 0.1,
            },
            drag: DragModel::default(),
            torque: TorqueModel::default(),
            point_spacing: 0.1,
        }),
        contacts: Some(ContactSettings {
            damping: NormalDamping::Ratio(0.3),
            friction: 0.5,
            tangential_ratio: 0.5,
            walls: vec![Wall::plane(Vector3::zeros(), Vector3::z())],
            ..ContactSettings::new(1e3, 0.02)
        }),
        ..FibreSettings::default()
    }
}

/// A heap: crossed fibres, one of them held, one naturally curved.
fn heap() -> FibreSystem {
    let material = Material::new(0.02, 1e6, 0.3, 500.0);
    let fibres = (0..6)
        .map(|i| {
            let a = 0.9 * i as f64;
            let centre = Vector3::new(0.0, 0.0, 0.03 + 0.045 * i as f64);
            let half = Vector3::new(a.cos(), a.sin(), 0.0) * 0.4;
            let mut fibre = Fibre::straight(3 * i, material, centre - half, centre + half, 6);
            if i == 2 {
                fibre.supports = vec![Support::clamp(0)];
            }
            if i == 4 {
                let bent = |k: usize| Vector3::new(0.1 * k as f64, 0.01 * (k * k) as f64, 0.0);
                fibre.equilibrium = Equilibrium::Shape((0..=6).map(bent).collect());
            }
            fibre
        })
        .collect();
    let mut s = FibreSystem::new(Communicator::single(), settings(), fibres).expect("valid");
    s.add_load(
        6,
        6,
        Vector3::new(0.0, 0.2, 0.0),
        Vector3::new(0.01, 0.0, 0.0),
    )
    .expect("tip");
    s
}

fn empty() -> FibreSystem {
    FibreSystem::new(Communicator::single(), settings(), Vec::new()).expect("valid")
}

fn run(s: &mut FibreSystem, steps: usize) {
    let flow = AmbientFlow::Shear { rate: 3.0 };
    for _ in 0..steps {
        s.advance_in_flow(&flow, 2e-3).expect("finite");
    }
}

#[test]
fn a_resumed_run_is_bitwise_the_same() {
    let mut whole = heap();
    run(&mut whole, 60);
    let saved = whole.state();
    let friction: usize = saved.records.iter().map(|r| r.words.len()).sum();
    run(&mut whole, 40);
    assert!(whole.contacts().expect("on").statistics().contacts > 0);

    let mut resumed = empty();
    resumed.restore(saved.clone()).expect("own record");
    assert_eq!(resumed.state(), saved);
    run(&mut resumed, 40);
    assert_eq!(resumed.state(), whole.state());
    assert_eq!(resumed.positions(), whole.positions());

    // Without the friction springs in flight it would not be: the test sees them.
    let mut forgetful = empty();
    let mut stripped = saved;
    let nodes = 7;
    for record in &mut stripped.records {
        record.words.truncate(20 + 20 * nodes + 10 * (nodes - 1));
    }
    let left: usize = stripped.records.iter().map(|r| r.words.len()).sum();
    assert!(left < friction);
    forgetful.restore(stripped).expect("valid");
    run(&mut forgetful, 40);
    assert_ne!(forgetful.positions(), whole.positions());
}

#[test]
fn a_damaged_record_is_refused() {
    let saved = heap().state();
    let damage = |change: &dyn Fn(&mut FibreState)| {
        let mut state = saved.clone();
        change(&mut state);
        let mut s = empty();
        let result = s.restore(state);
        assert_eq!(s.fibres(), if result.is_ok() { 6 } else { 0 });
        result
    };
    assert!(damage(&|_| ()).is_ok());
    let short = damage(&|s| s.records[1].words.truncate(50));
    assert!(matches!(short, Err(FibreError::Record { fibre: 3, .. })));
    let huge = damage(&|s| s.records[1].words[0] = u64::MAX);
    assert!(matches!(huge, Err(FibreError::Record { fibre: 3, .. })));
    let modulus = damage(&|s| s.records[0].words[11] = 0);
    assert!(matches!(
        modulus,
        Err(FibreError::Material { fibre: 0, .. })
    ));
    let twice = damage(&|s| s.records[1].id = 0);
    assert!(matches!(twice, Err(FibreError::DuplicateId { fibre: 0 })));
}

#[test]
fn owners_must_be_ranks() {
    let mut s = heap();
    assert!(matches!(s.migrate(&[0]), Err(FibreError::Owners { .. })));
    assert!(matches!(s.migrate(&[1; 6]), Err(FibreError::Owners { .. })));
    assert!(s.migrate(&[0; 6]).is_ok());
}
