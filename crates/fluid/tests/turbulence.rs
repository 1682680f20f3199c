//! F8 in small: linear forcing, its energy budget, spectra, the field to start from.

mod common;

use common::{conserved_energy, fluid_of, of, settings};
use fibreflow_fluid::initial::{Isotropic, random_solenoidal};
use fibreflow_fluid::{EnergySpectrum, Fluid, FluidError, FluidSettings, Forcing, Inertia};
use fibreflow_mesh::{BoxElement, BoxMesh, LocalMesh, geometry};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use std::sync::Arc;

fn forced(kind: (BoxElement, f64, u8), n: usize, forcing: Forcing) -> Fluid {
    let (element, jitter, order) = kind;
    let mesh = BoxMesh {
        periodic: [true; 3],
        ..of(element, [TAU; 3], [n; 3], jitter)
    };
    let settings = FluidSettings {
        forcing,
        ..settings(1.0, 0.05, 1e-9)
    };
    let mesh = mesh.build().expect("box");
    fluid_of(order, mesh, settings, |_| unreachable!("no patches"))
}

const KINDS: [(BoxElement, f64, u8); 3] = [
    (BoxElement::Hexahedron, 0.0, 2),
    (BoxElement::Hexahedron, 0.0, 4),
    (BoxElement::Tetrahedron, 0.2, 2),
];

/// ΔK = ∫ (power − ε) dt, with a drift that must not be forced.
#[test]
fn the_energy_budget_of_linear_forcing_closes() {
    for kind in KINDS {
        for energy in [None, Some(0.7)] {
            let mut fluid = forced(kind, 10, Forcing::Linear { rate: 0.5, energy });
            let eddies = random_solenoidal([TAU; 3], 2, 1.0, 4);
            let drifting = |x| {
                let [u, v, w] = eddies(x);
                [u + 0.5, v, w - 0.25]
            };
            fluid.set_velocity(drifting).expect("start");
            let drift = fluid.bulk_velocity();
            let start = fluid.turbulence();
            // Where mass is corrected, forces change the energy in the norm of that.
            let of_mean = 0.5 * drift.iter().map(|u| u * u).sum::<f64>();
            let kinetic = |fluid: &Fluid| conserved_energy(fluid) / fluid.volume() - of_mean;
            let energy_before = kinetic(&fluid);
            let (dt, steps) = (0.02, 60);
            let (mut gained, mut put_in, mut last) = (0.0, 0.0, start);
            for _ in 0..steps {
                fluid.advance(dt).expect("step");
                let now = fluid.turbulence();
                gained += 0.5 * dt * (now.power - now.dissipation + last.power - last.dissipation);
                put_in += 0.5 * dt * (now.power + last.power);
                last = now;
            }
            let missing = (kinetic(&fluid) - energy_before - gained) / put_in;
            println!("{kind:?}, {energy:?}: missing {missing:.2e} of the input");
            // What the projection takes on tetrahedra.
            let most = if kind.1 > 0.0 { 0.02 } else { 1e-4 };
            assert!(missing.abs() < most, "{missing}");
            if let Some(energy) = energy {
                assert!((last.power - energy).abs() < 1e-12, "{}", last.power);
            }
            let end = fluid.bulk_velocity();
            assert!(
                (0..3).all(|c| (end[c] - drift[c]).abs() < 1e-11),
                "{drift:?} {end:?}"
            );
        }
    }
}

/// The three stages see the force of their own velocity: u = exp(At) u₀ to third order where nothing else acts.
#[test]
fn linear_forcing_is_of_third_order_in_time() {
    let error = |steps: usize| {
        let rate = 1.0;
        let mut fluid = forced(KINDS[0], 8, Forcing::Linear { rate, energy: None });
        // Plane waves neither convect themselves nor make pressure; the scheme's own viscous rate is measured.
        fluid
            .set_velocity(|x| [x[1].sin(), 0.0, 0.0])
            .expect("start");
        let start = fluid.turbulence();
        let net = 2.0 * rate - start.dissipation / start.kinetic_energy;
        for _ in 0..steps {
            fluid.advance(1.0 / steps as f64).expect("step");
        }
        (fluid.turbulence().kinetic_energy / start.kinetic_energy / net.exp() - 1.0).abs()
    };
    let errors = [10, 20, 40].map(error);
    let order = common::order(&[10.0, 20.0, 40.0], &errors);
    println!("errors {errors:?}, order {order:.2}");
    assert!(order > 2.8 && errors[2] < 1e-5);
}

#[test]
fn linear_forcing_needs_a_periodic_box_and_convection() {
    let forcing = Forcing::Linear {
        rate: 1.0,
        energy: None,
    };
    for (periodic, inertia) in [
        ([true, false, true], Inertia::Full),
        ([true; 3], Inertia::Linear),
    ] {
        let mesh = BoxMesh {
            periodic,
            ..of(BoxElement::Hexahedron, [1.0; 3], [4; 3], 0.0)
        };
        let local = Arc::new(LocalMesh::single(mesh.build().expect("box")));
        let dual = Arc::new(geometry::dual(&local).expect("dual"));
        let walls = local
            .patches
            .iter()
            .map(|_| fibreflow_fluid::BoundaryCondition::WALL);
        let settings = FluidSettings {
            boundary: walls.collect(),
            forcing,
            inertia,
            ..FluidSettings::new(1.0, 1.0)
        };
        let refused = Fluid::new(local, dual, settings).err();
        assert_eq!(refused, Some(FluidError::NotPeriodic));
    }
}

/// Parseval, on boxes that are not cubes and with odd numbers of nodes; one wave in its shell.
#[test]
fn the_spectrum_holds_all_energy() {
    for (cells, order) in [([12, 10, 9], 2), ([8, 9, 12], 4)] {
        let size = [TAU, 0.5 * TAU, 0.5 * TAU];
        let mesh = BoxMesh {
            periodic: [true; 3],
            ..of(BoxElement::Hexahedron, size, cells, 0.0)
        };
        let mut fluid = fluid_of(
            order,
            mesh.build().expect("box"),
            settings(1.0, 0.01, 1e-9),
            |_| unreachable!("no patches"),
        );
        let mut spectrum = EnergySpectrum::new(&fluid)
            .expect("transform")
            .expect("a box");
        // Noise has the shortest waves too, whose conjugates are themselves.
        let noise = |x: [f64; 3]| {
            let seed = (x.iter()).fold(0u64, |s, x| s.rotate_left(21) ^ x.to_bits());
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            [(); 3].map(|()| random.random::<f64>() - 0.2)
        };
        fluid.set_velocity(noise).expect("start");
        let sum: f64 = spectrum.of(&fluid).iter().sum();
        let wanted = fluid.turbulence().kinetic_energy;
        assert!((sum / wanted - 1.0).abs() < 1e-12, "{sum} {wanted}");
        // k = (3, 2, 0): shell 4 of width 1 as |k| = 3.606.
        fluid
            .set_velocity(|x| [0.0, 0.0, (3.0 * x[0] + 2.0 * x[1] + 0.3).cos()])
            .expect("start");
        let energies = spectrum.of(&fluid);
        assert!((energies[3] - 0.25).abs() < 1e-12, "{energies:?}");
        assert!(energies.iter().sum::<f64>() - energies[3] < 1e-12);
    }
}

/// Energy and spectrum as asked for, but for the shells of a finite box and what the projection takes.
#[test]
fn the_isotropic_field_has_its_spectrum() {
    let n = 24;
    let mut fluid = forced(KINDS[1], n, Forcing::default());
    let field = Isotropic {
        origin: [0.0; 3],
        size: [TAU; 3],
        intensity: 0.8,
        wavelength: TAU / 3.0,
        seed: 1,
    };
    fluid.set_velocity(field.field()).expect("start");
    let budget = fluid.turbulence();
    println!("u' {}, skewness {}", budget.fluctuation(), budget.skewness);
    assert!((budget.fluctuation() / 0.8 - 1.0).abs() < 5e-3);
    assert!(budget.skewness.abs() < 0.15);
    let mut spectrum = EnergySpectrum::new(&fluid)
        .expect("transform")
        .expect("a box");
    let wave_numbers: Vec<f64> = spectrum.wave_numbers().collect();
    let energies = spectrum.of(&fluid);
    // E/k² on the waves of every shell.
    let mut wanted = vec![0.0; energies.len()];
    for (l, m, n) in (0..19 * 19 * 19).map(|k| (k % 19 - 9, k / 19 % 19 - 9, k / 361 - 9)) {
        let square = f64::from(l * l + m * m + n * n);
        let shell = square.sqrt().round() as usize;
        if shell > 0 && square <= 81.0 {
            wanted[shell - 1] += square * (-2.0 * square / 9.0).exp();
        }
    }
    let all: f64 = wanted.iter().sum();
    for (k, energy) in wave_numbers.iter().zip(energies).take(6) {
        let wanted = 1.5 * 0.64 * wanted[*k as usize - 1] / all;
        println!("k = {k}: E = {energy:.4e}, wanted {wanted:.4e}");
        assert!((energy / wanted - 1.0).abs() < 0.01);
    }
}
