//! A straight fibre held at 45° in a shear flow is compressed; above a load it buckles (validation row C3).

use fibreflow_fibre::hydrodynamics::{
    BUCKLING_FLEXIBILITY, DragModel, FluidProperties, SlenderConstants, TorqueModel,
};
use fibreflow_fibre::{
    Equilibrium, Fibre, FibreSettings, FibreSystem, Hydrodynamics, ImplicitSettings, Integrator,
    Material, Matrix3, Vector3,
};
use fibreflow_parallel::Communicator;

const R_P: f64 = 100.0;

/// Growth rate by γ̇ of a symmetric bend of a fibre along the compressing axis of a shear flow whose turning is taken off, with
/// ζ⊥ = 2ζ∥ and ζ⊥γ̇L⁴/EI = `load`. Length, rate and viscosity are 1.
fn growth(load: f64, segments: usize) -> f64 {
    let drag = SlenderConstants::Kunhappan;
    let radius = 0.5 / R_P;
    let bending = drag.resistance(R_P, 1.0).normal / load;
    let modulus = bending / Material::new(radius, 1.0, 0.3, 1.0).second_moment();
    let nodes = (0..=segments).map(|i| {
        let x = i as f64 / segments as f64 - 0.5;
        Vector3::new(x, 1e-4 * (x * x - 1.0 / 12.0), 0.0)
    });
    let mut fibre = Fibre::new(
        0,
        Material::new(radius, modulus, 0.3, 1e-3),
        nodes.collect(),
    );
    fibre.equilibrium = Equilibrium::Straight;
    let settings = FibreSettings {
        hydrodynamics: Some(Hydrodynamics {
            fluid: FluidProperties {
                density: 1e-3,
                viscosity: 1.0,
            },
            drag: DragModel::SlenderBody(drag),
            torque: TorqueModel::None,
            point_spacing: f64::INFINITY,
        }),
        integrator: Integrator::Implicit(ImplicitSettings::default()),
        ..FibreSettings::default()
    };
    let mut s = FibreSystem::new(Communicator::single(), settings, vec![fibre]).expect("valid");
    let gradient = Matrix3::from_diagonal(&Vector3::new(-0.5, 0.5, 0.0));
    let mut energy = || {
        for _ in 0..50 {
            s.advance_in(&|x, _| (gradient * x, gradient), 0.01)
                .expect("an answer");
        }
        s.energy().elastic.bending
    };
    // Faster modes die out in the first half unit of strain.
    let (first, last) = (energy(), energy());
    (last / first).ln()
}

/// The load at which the rate changes sign: 306.4 by the linear equation of the flexure, solved with Legendre polynomials; twice
/// the 153.2 of Becker & Shelley (2001), whose rate is that of the compression, γ̇/2.
#[test]
fn a_compressed_fibre_buckles_at_becker_and_shelleys_load() {
    for segments in [8, 16, 32] {
        let loads = [0.95, 1.05].map(|part| part * BUCKLING_FLEXIBILITY);
        let rates = loads.map(|load| growth(load, segments));
        let part = rates[0] / (rates[0] - rates[1]);
        let critical = loads[0] + part * (loads[1] - loads[0]);
        println!("{segments} segments: rates {rates:?}, zero at {critical:.1}");
        assert!(rates[0] < 0.0 && rates[1] > 0.0);
        assert!((critical / 306.4 - 1.0).abs() < 0.02);
    }
}

/// The rates themselves against those of the linear equation.
#[test]
fn bends_grow_and_decay_at_the_rates_of_the_linear_equation() {
    for (load, expected) in [(153.2, -1.6318), (250.0, -0.3679), (400.0, 0.3810)] {
        let found = growth(load, 32);
        println!("load {load}: rate {found:.4}, linear equation {expected}");
        assert!((found - expected).abs() < 0.03 * expected.abs().max(0.5));
    }
}
