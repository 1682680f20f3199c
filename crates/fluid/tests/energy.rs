//! F2: inviscid energy; momentum and impulse in a periodic box.

mod common;

use common::{conserved_energy, fluid_of, fluid_on, of, order, periodic, settings};
use fibreflow_fluid::{BoundaryCondition, Fluid, FluidSettings, Projections, initial};
use fibreflow_mesh::{BoxElement, BoxMesh};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

const MESHES: [(BoxElement, f64); 2] = [
    (BoxElement::Hexahedron, 0.0),
    (BoxElement::Tetrahedron, 0.2),
];

/// Element, jitter, order in space, projections.
type Kind = (BoxElement, f64, u8, Projections);

const KINDS: [Kind; 5] = [
    (BoxElement::Hexahedron, 0.0, 2, Projections::Once),
    (BoxElement::Hexahedron, 0.0, 2, Projections::EverySubStep),
    (BoxElement::Hexahedron, 0.0, 4, Projections::Once),
    (BoxElement::Hexahedron, 0.0, 4, Projections::EverySubStep),
    (BoxElement::Tetrahedron, 0.2, 2, Projections::Once),
];

fn eddies((element, jitter, order, projections): Kind, n: usize, tolerance: f64) -> Fluid {
    let mesh = BoxMesh {
        periodic: [true; 3],
        ..of(element, [TAU; 3], [n; 3], jitter)
    };
    let settings = FluidSettings {
        projections,
        ..settings(1.0, 0.0, tolerance)
    };
    let mesh = mesh.build().expect("box");
    let mut fluid = fluid_of(order, mesh, settings, |_| unreachable!("no patches"));
    fluid
        .set_velocity(initial::random_solenoidal([TAU; 3], 2, 1.0, 4))
        .expect("start");
    fluid
}

/// A turnover: the longest wave over the root mean square velocity 1.
const TURNOVER: f64 = TAU;

/// Steps of Courant number `cfl` at the start, so that halving it halves the step.
fn run(fluid: &mut Fluid, cfl: f64, time: f64) -> Vec<f64> {
    let steps = (time / fluid.suggest_dt(cfl, time)).ceil();
    (0..steps as usize)
        .map(|_| {
            fluid.advance(time / steps).expect("step");
            conserved_energy(fluid)
        })
        .collect()
}

/// uᵀC(F)u = Σ_i u_i·Σ_j ½(u_i + u_j) F_ij for the solver's own fluxes and a random u, against Σ |terms|.
#[test]
fn convection_is_skew_symmetric_for_projected_fluxes() {
    for kind in KINDS {
        let fluid = eddies(kind, 8, 1e-15);
        let (geometry, flux) = (fluid.geometry(), fluid.flux());
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let u: Vec<[f64; 3]> = (0..fluid.mesh().owned())
            .map(|_| std::array::from_fn(|_| random.random::<f64>() - 0.5))
            .collect();
        let (mut work, mut size) = (0.0, 0.0);
        for i in 0..u.len() {
            for e in geometry.row(i) {
                let v = u[geometry.columns[e] as usize];
                let product: f64 = (0..3).map(|c| 0.5 * u[i][c] * (u[i][c] + v[c])).sum();
                work += product * flux[e];
                size += (product * flux[e]).abs();
            }
        }
        println!(
            "{kind:?}: skew {:.1e}, divergence {:.1e}",
            work / size,
            fluid.divergence_max()
        );
        assert!(work.abs() < 1e-13 * size, "{:e}", work / size);
    }
}

#[test]
fn inviscid_energy_never_grows() {
    for kind in KINDS {
        let mut fluid = eddies(kind, 10, 1e-9);
        let start = conserved_energy(&fluid);
        let energies = run(&mut fluid, 0.5, 10.0 * TURNOVER);
        let highest = energies.iter().copied().fold(0.0, f64::max);
        let last = energies.last().expect("steps");
        println!(
            "{kind:?}: highest {:.6}, last {:.4}",
            highest / start,
            last / start
        );
        assert!(highest <= start * (1.0 + 1e-3));
    }
}

/// Walls at rest take no energy either; a share of Rhie–Chow flux, as driven walls need it, would double the loss.
#[test]
fn inviscid_energy_between_walls_at_rest_is_lost_no_faster() {
    let mesh = BoxMesh {
        periodic: [true, false, true],
        ..of(BoxElement::Hexahedron, [TAU; 3], [12; 3], 0.0)
    };
    let mut fluid = fluid_on(&mesh, settings(1.0, 0.0, 1e-9), |_| BoundaryCondition::WALL);
    let eddies = initial::random_solenoidal([TAU; 3], 2, 1.0, 4);
    fluid.set_velocity(eddies).expect("start");
    let start = fluid.kinetic_energy();
    let energies = run(&mut fluid, 0.5, 10.0 * TURNOVER);
    let highest = energies.iter().copied().fold(0.0, f64::max);
    let last = energies.last().expect("steps") / start;
    println!("walls: highest {:.6}, last {last:.4}", highest / start);
    assert!(highest <= start * (1.0 + 1e-3) && last > 0.98);
}

#[test]
fn inviscid_energy_change_falls_with_the_step_at_second_order() {
    // The mesh has to resolve the eddies for a turnover: tetrahedra need more nodes for it.
    for (kind, n) in KINDS.into_iter().zip([12, 12, 12, 12, 20]) {
        let cfl = [0.5, 0.25, 0.125];
        let loss = |&cfl: &f64| {
            let mut fluid = eddies(kind, n, 1e-8);
            let start = conserved_energy(&fluid);
            let energies = run(&mut fluid, cfl, TURNOVER);
            (1.0 - energies.last().expect("steps") / start).abs()
        };
        let found: Vec<f64> = cfl.iter().map(loss).collect();
        let fitted = -order(&cfl, &found);
        println!("{kind:?}: {found:?}, order {fitted:.2}");
        assert!(fitted >= 2.0, "{found:?}: {fitted}");
    }
}

#[test]
fn body_force_goes_into_momentum_exactly() {
    for (element, jitter) in MESHES {
        let mesh = BoxMesh {
            seed: 9,
            ..of(element, [1.0, 2.0, 1.5], [6, 5, 7], jitter)
        };
        let mut fluid = periodic(&mesh, 0.05, 1e-6);
        let start = initial::random_solenoidal([1.0, 2.0, 1.5], 2, 1.0, 4);
        fluid.set_velocity(start).expect("start");
        let nodes = fluid.mesh().nodes.clone();
        for (f, x) in fluid.body_force_mut().iter_mut().zip(&nodes) {
            *f = [
                (9.0 * x[0]).sin() + 0.4,
                (7.0 * x[1] + x[2]).cos(),
                2.0 * x[2],
                0.0,
            ];
        }
        let volumes = fluid.geometry().volumes.clone();
        let (before, dt) = (fluid.momentum(), 0.01);
        for _ in 0..20 {
            fluid.advance(dt).expect("step");
        }
        let after = fluid.momentum();
        for c in 0..3 {
            let forces = fluid.body_force().iter().zip(&volumes);
            let parts: Vec<f64> = forces.map(|(f, v)| f[c] * v * dt * 20.0).collect();
            let impulse: f64 = parts.iter().sum();
            let size: f64 = parts.iter().map(|p| p.abs()).sum();
            let defect = (after[c] - before[c] - impulse) / size;
            println!("{element:?} {c}: {defect:.1e}");
            assert!(defect.abs() < 1e-12, "component {c}: {defect:e}");
        }
    }
}
