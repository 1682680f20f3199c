//! Fibres in contact, spread over ranks and changing owner, move as on one rank.

use super::{Outcome, ensure};
use fibreflow_fibre::contact::{ContactSettings, NormalDamping, Wall};
use fibreflow_fibre::hydrodynamics::{AmbientFlow, DragModel, FluidProperties, TorqueModel};
use fibreflow_fibre::{
    Fibre, FibreSettings, FibreSystem, Hydrodynamics, ImplicitSettings, Integrator, Material,
    PeriodicBox, Vector3,
};
use fibreflow_parallel::Communicator;

const FIBRES: u64 = 24;

fn settings() -> FibreSettings {
    FibreSettings {
        gravity: Vector3::new(0.0, 0.0, -40.0),
        hydrodynamics: Some(Hydrodynamics {
            fluid: FluidProperties {
                density: 1.0,
                viscosity: 0.1,
            },
            drag: DragModel::default(),
            torque: TorqueModel::default(),
            point_spacing: f64::INFINITY,
        }),
        contacts: Some(ContactSettings {
            damping: NormalDamping::Ratio(0.3),
            friction: 0.5,
            tangential_ratio: 0.5,
            walls: vec![Wall::plane(Vector3::zeros(), Vector3::z())],
            periodic: PeriodicBox {
                origin: Vector3::zeros(),
                lengths: [Some(1.0), Some(1.0), None],
            },
            ..ContactSettings::new(1e3, 0.02)
        }),
        ..FibreSettings::default()
    }
}

/// A heap of crossed fibres in a periodic box on a floor.
fn heap(mine: impl Fn(u64) -> bool) -> Vec<Fibre> {
    let material = Material::new(0.02, 1e6, 0.3, 500.0);
    let fibre = |i: u64| {
        let a = 0.9 * i as f64;
        let place = Vector3::new(0.37 * i as f64, 0.21 * i as f64, 0.03 + 0.02 * i as f64);
        let half = Vector3::new(a.cos(), a.sin(), 0.0) * 0.2;
        Fibre::straight(i, material, place - half, place + half, 4)
    };
    (0..FIBRES).filter(|&i| mine(i)).map(fibre).collect()
}

/// A rank's share before and after a change of owner.
fn owner(id: u64, round: u64, ranks: usize) -> u32 {
    ((id + round * (id % 3)) % ranks as u64) as u32
}

/// Positions, velocities and friction are bitwise those of one rank, though fibres change owner every few steps.
pub fn migration_changes_nothing(communicator: &Communicator) -> Outcome {
    let ranks = communicator.size();
    let rank = communicator.rank() as u32;
    let flow = AmbientFlow::Shear { rate: 3.0 };
    let mine = heap(|id| owner(id, 0, ranks) == rank);
    let mut shared = FibreSystem::new(communicator.clone(), settings(), mine)?;
    let mut alone = FibreSystem::new(Communicator::single(), settings(), heap(|_| true))?;
    let mut contacts = 0;
    for round in 1..6 {
        for _ in 0..20 {
            shared.advance_in_flow(&flow, 2e-3)?;
            alone.advance_in_flow(&flow, 2e-3)?;
        }
        contacts = contacts.max(alone.contacts().map_or(0, |c| c.statistics().contacts));
        let target = |f| owner(shared.id(f), round, ranks);
        let owners: Vec<u32> = (0..shared.fibres()).map(target).collect();
        shared.migrate(&owners)?;
    }
    ensure(contacts > 3, || format!("only {contacts} contacts"))?;
    // One step more, so that migrated springs are in use.
    shared.advance_in_flow(&flow, 2e-3)?;
    alone.advance_in_flow(&flow, 2e-3)?;
    let all = communicator.sum_count(shared.fibres());
    ensure(all == FIBRES as usize, || format!("{all} fibres are left"))?;
    let (state, reference) = (shared.state(), alone.state());
    // Sums of energies over ranks are alike to round-off.
    let pairs = state.scalars.iter().zip(&reference.scalars);
    let alike = pairs.into_iter().all(|((name, value), (other, expected))| {
        name == other && (value - expected).abs() <= 1e-12 * expected.abs()
    });
    ensure(
        alike && state.scalars.len() == reference.scalars.len(),
        || format!("{:?} and {:?}", state.scalars, reference.scalars),
    )?;
    for record in &state.records {
        let same = reference.records[record.id as usize] == *record;
        ensure(same, || format!("fibre {} differs", record.id))?;
    }
    Ok(())
}

/// A thousand sub-steps in contact, without a flow, are bitwise those of one rank.
pub fn long_contact(communicator: &Communicator) -> Outcome {
    let (ranks, rank) = (communicator.size() as u64, communicator.rank() as u64);
    let dry = FibreSettings {
        hydrodynamics: None,
        ..settings()
    };
    let mine = heap(|id| id % ranks == rank);
    let mut shared = FibreSystem::new(communicator.clone(), dry.clone(), mine)?;
    let mut alone = FibreSystem::new(Communicator::single(), dry, heap(|_| true))?;
    let (mut substeps, mut contacts) = (0, 0);
    while substeps < 1000 {
        shared.advance_free(2e-3)?;
        alone.advance_free(2e-3)?;
        substeps += alone.substeps();
        contacts = contacts.max(alone.contacts().map_or(0, |c| c.statistics().contacts));
    }
    ensure(contacts > 10, || format!("only {contacts} contacts"))?;
    let reference = alone.state();
    for record in &shared.state().records {
        let same = reference.records[record.id as usize] == *record;
        ensure(same, || format!("fibre {} differs", record.id))?;
    }
    Ok(())
}

/// Implicit steps of fibres in contact, with changes of owner, are those of one rank up to the tolerance of the solver.
pub fn implicit_contact(communicator: &Communicator) -> Outcome {
    let ranks = communicator.size();
    let rank = communicator.rank() as u32;
    let implicit = FibreSettings {
        integrator: Integrator::Implicit(ImplicitSettings::default()),
        ..settings()
    };
    let flow = AmbientFlow::Shear { rate: 3.0 };
    let mine = heap(|id| owner(id, 0, ranks) == rank);
    let mut shared = FibreSystem::new(communicator.clone(), implicit.clone(), mine)?;
    let mut alone = FibreSystem::new(Communicator::single(), implicit, heap(|_| true))?;
    let mut contacts = 0;
    for round in 1..4 {
        for _ in 0..10 {
            shared.advance_in_flow(&flow, 1e-2)?;
            alone.advance_in_flow(&flow, 1e-2)?;
        }
        contacts = contacts.max(alone.contacts().map_or(0, |c| c.statistics().contacts));
        let target = |f| owner(shared.id(f), round, ranks);
        let owners: Vec<u32> = (0..shared.fibres()).map(target).collect();
        shared.migrate(&owners)?;
    }
    ensure(contacts > 3, || format!("only {contacts} contacts"))?;
    for f in 0..shared.fibres() {
        let id = shared.id(f);
        let other = alone.find(id).ok_or("a fibre is missing")?;
        let gap = (shared.centre(f) - alone.centre(other)).norm();
        ensure(gap < 1e-9, || format!("fibre {id} is {gap:e} off"))?;
    }
    Ok(())
}
