//! Scheme B where contacts are hard: overlapped starts, high friction at rest and sliding, stiff and limp fibres, fibres in one place.

use fibreflow_fibre::contact::Repulsion;
use fibreflow_fibre::hydrodynamics::AmbientFlow;
use fibreflow_fibre::linked::{Joint, LinkedFibre, LinkedScheme, LinkedSettings, LinkedSystem};
use fibreflow_fibre::{Fibre, Material, Matrix3, PeriodicBox, Vector3};
use fibreflow_parallel::Communicator;
use rand::{Rng, SeedableRng};
use std::f64::consts::PI;

/// Half-length of a segment, by its radius.
const HALF: f64 = 5.0;

/// A fibre of five segments of radius 1 with a stiffness S^eff at unit rate and viscosity.
fn fibre(id: u64, nodes: Vec<Vector3>, stiffness: f64) -> LinkedFibre {
    let mut beam = Fibre::new(id, Material::new(1.0, 1.0, 0.49, 1.0), nodes);
    let bending = stiffness * (10.0 * HALF).powi(4);
    beam.material.youngs_modulus = bending / beam.material.second_moment();
    beam.material.shear_modulus = beam.material.youngs_modulus / 2.98;
    LinkedFibre::new(&beam, Joint::Ball).expect("a fibre")
}

fn straight(id: u64, middle: Vector3, along: Vector3, stiffness: f64) -> LinkedFibre {
    let step = along.normalize() * (2.0 * HALF);
    let nodes = (0..6).map(|k| middle + step * (k as f64 - 2.5));
    fibre(id, nodes.collect(), stiffness)
}

/// Bent fibres anywhere in a cube.
fn crowd(count: u64, edge: f64, stiffness: f64) -> Vec<LinkedFibre> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let mut vector = move || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
    let mut one = |id: u64| {
        let (across, along) = (vector(), vector().normalize());
        let side = along.cross(&across).normalize().cross(&along);
        let mut nodes = vec![vector() * (0.5 * edge)];
        for k in 0..5 {
            let angle = 0.25 * k as f64;
            nodes.push(nodes[k] + (along * angle.cos() + side * angle.sin()) * (2.0 * HALF));
        }
        fibre(id, nodes, stiffness)
    };
    (0..count).map(&mut one).collect()
}

fn system(fibres: Vec<LinkedFibre>, friction: [f64; 2], edge: f64) -> LinkedSystem {
    let settings = LinkedSettings {
        repulsion: Some(Repulsion {
            strength: 150.0 * 6.0 * PI * HALF,
            decay: 0.05,
            attraction: 0.0,
            attraction_width: 1.0,
            range: 0.66,
            contact_gap: 0.33,
        }),
        friction,
        periodic: PeriodicBox {
            origin: Vector3::zeros(),
            lengths: [Some(edge); 3],
        },
        shear_rate: 1.0,
        ..LinkedSettings::new(LinkedScheme::Implicit, 1.0, 3.0)
    };
    LinkedSystem::new(&Communicator::single(), settings, fibres).expect("fibres")
}

fn shear(x: &Vector3, _: f64) -> (Vector3, Matrix3) {
    AmbientFlow::Shear { rate: 1.0 }.at(x)
}

/// Advances; all forces are finite, none adds up, and friction is within its cones. Returns how many contacts slid.
fn advance(system: &mut LinkedSystem, steps: usize, friction: [f64; 2]) -> usize {
    let mut sliding = 0;
    for _ in 0..steps {
        system.advance(&shear, 1e-2).expect("a step");
        let (mut force, mut size) = (Vector3::zeros(), 0.0);
        for s in 0..system.segments() {
            let [f, _] = system.drag(s, &shear(&system.felt(s)[0], 0.0));
            (force, size) = (force + f, size + f.norm());
        }
        assert!(force.norm() < 1e-11 * size, "{force} of {size}");
        for t in system.solved_touches() {
            let limit = friction[usize::from(t.slides)] * t.repulsion;
            assert!(t.friction.norm() <= limit * (1.0 + 1e-9), "{t:?}");
            sliding += usize::from(t.slides);
        }
    }
    sliding
}

/// Sweeps with exact cones alone drive the forces of these contacts beyond all bounds.
#[test]
fn overlaps_come_apart_with_kinetic_friction() {
    for (friction, edge) in [([20.0, 10.0], 45.0), ([1.0, 0.5], 60.0)] {
        let mut system = system(crowd(20, edge, 0.05), friction, edge);
        let before = system.statistics();
        let sliding = advance(&mut system, 5, friction);
        let after = system.statistics();
        println!("{friction:?}: {before:?}, {sliding} slid, {after:?}");
        assert!(before.overlaps > 5 && before.max_overlap > 1.0 && sliding > 10);
        assert!(after.max_overlap < 0.1);
    }
}

/// Three fibres in one place; twelve across one segment; any stiffness and friction.
#[test]
fn fibres_in_one_place_come_apart() {
    let same =
        |stiffness| (0..3).map(move |k| straight(k, Vector3::zeros(), Vector3::x(), stiffness));
    let across = |stiffness| {
        (0..13).map(move |k| {
            let (x, angle) = (HALF * (k as f64 - 6.5) / 6.5, 0.3 * k as f64);
            let out = Vector3::new(0.0, angle.sin(), angle.cos());
            match k {
                0 => straight(k, Vector3::zeros(), Vector3::x(), stiffness),
                _ => straight(
                    k,
                    out * 1.5 + Vector3::x() * x,
                    out.cross(&Vector3::x()),
                    stiffness,
                ),
            }
        })
    };
    for stiffness in [0.01, 1e3] {
        for friction in [[0.0; 2], [20.0, 0.0], [1e3, 0.0]] {
            let scenes: [Vec<LinkedFibre>; 2] =
                [same(stiffness).collect(), across(stiffness).collect()];
            for fibres in scenes {
                let count = fibres.len();
                let mut system = system(fibres, friction, 200.0);
                let before = system.statistics();
                advance(&mut system, 3, friction);
                let after = system.statistics();
                println!(
                    "S {stiffness}, μ {friction:?}, {count} fibres: overlap {:.2} to {:.2}, sub-steps {}, sweeps {}",
                    before.max_overlap, after.max_overlap, after.steps, after.sweeps
                );
                assert!(after.max_overlap < 0.9 * before.max_overlap);
            }
        }
    }
}
