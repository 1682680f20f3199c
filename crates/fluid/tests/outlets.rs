//! Outlets: flow that leaves by pressure or carried out, also where it would come back.

mod common;

use common::{errors, fluid_on, of, patch, settings};
use fibreflow_fluid::{BoundaryCondition, Fluid, Signal, VelocityProfile, initial};
use fibreflow_mesh::{BoxElement, BoxMesh};

const PRESSURE: BoundaryCondition = BoundaryCondition::Outlet {
    pressure: Signal::Constant(0.0),
};
const CONVECTIVE: BoundaryCondition = BoundaryCondition::ConvectiveOutlet { speed: None };

/// Between x = 0 and 4, y = ±1, one period thick.
fn channel(
    element: BoxElement,
    cells: [usize; 3],
    viscosity: f64,
    condition: impl Fn(&str) -> BoundaryCondition,
) -> Fluid {
    let mesh = BoxMesh {
        origin: [0.0, -1.0, 0.0],
        periodic: [false, false, true],
        ..of(element, [4.0, 2.0, 0.25], cells, 0.0)
    };
    fluid_on(&mesh, settings(1.0, viscosity, 1e-10), condition)
}

fn parabola() -> VelocityProfile {
    VelocityProfile::parabolic([1.0, 0.0, 0.0], 1, -1.0, 1.0)
}

#[test]
fn poiseuille_flow_leaves_a_convective_outlet_as_it_came() {
    let wrong = |element, n: usize| {
        let mut fluid = channel(element, [16 * n, 12 * n, 1], 0.2, |name| match name {
            "x_min" => BoundaryCondition::Inlet {
                profile: parabola(),
            },
            "x_max" => CONVECTIVE,
            _ => BoundaryCondition::WALL,
        });
        for _ in 0..200 * n {
            fluid.advance(0.05 / n as f64).expect("step");
        }
        let [inflow, outflow] =
            ["x_min", "x_max"].map(|name| fluid.patch_flux(patch(&fluid, name)));
        assert!((inflow + outflow).abs() < 1e-12 * outflow);
        assert!(fluid.divergence_max() < 1e-7);
        errors(&fluid, initial::poiseuille([1.0, 0.0, 0.0], 1, -1.0, 1.0))
    };
    let [_, largest] = wrong(BoxElement::Hexahedron, 1);
    assert!(largest < 1e-4, "{largest}");
    // The corners of simplices carry an error of first order, at an inlet and a pressure outlet as well.
    let [coarse, fine] = [1, 2].map(|n| wrong(BoxElement::Tetrahedron, n)[0]);
    println!("outlet: hexahedra {largest:.1e}, tetrahedra {coarse:.2e} {fine:.2e}");
    assert!(fine < 0.4 * coarse && fine < 0.015, "{coarse} {fine}");
}

/// A vortex on a stream: u = 1 + Γ-like swirl of radius 0.3 that starts at x = 2.5.
fn vortex(strength: f64) -> impl Fn([f64; 3]) -> [f64; 3] {
    move |x| {
        let (a, b) = ((x[0] - 2.5) / 0.3, x[1] / 0.3);
        let swirl = strength * (0.5 * (1.0 - a * a - b * b)).exp();
        [1.0 - swirl * b, swirl * a, 0.0]
    }
}

/// Energy of what differs from the stream, by volume; and the largest speed on the way.
fn leaving(element: BoxElement, outlet: &BoundaryCondition, strength: f64) -> [f64; 3] {
    let mut fluid = channel(element, [48, 24, 1], 1e-3, |name| match name {
        "x_min" => BoundaryCondition::Inlet {
            profile: VelocityProfile::Uniform([1.0, 0.0, 0.0]),
        },
        "x_max" => outlet.clone(),
        _ => BoundaryCondition::Slip,
    });
    fluid.set_velocity(vortex(strength)).expect("start");
    let stream = |_| [1.0, 0.0, 0.0];
    let [start, _] = errors(&fluid, stream);
    let (mut time, mut fastest) = (0.0, 0.0f64);
    while time < 4.0 {
        let dt = fluid.suggest_dt(0.8, 0.1);
        fluid.advance(dt).expect("step");
        time += dt;
        let speeds = fluid.velocity().iter().map(|u| u[0].hypot(u[1]));
        fastest = speeds.fold(fastest, f64::max);
    }
    let [end, _] = errors(&fluid, stream);
    [start, end, fastest]
}

#[test]
fn a_vortex_leaves() {
    for element in [BoxElement::Hexahedron, BoxElement::Prism] {
        for outlet in [CONVECTIVE, PRESSURE] {
            let [start, end, fastest] = leaving(element, &outlet, 0.5);
            println!("{element:?} {outlet:?}: {start:.3e} -> {end:.3e}, fastest {fastest:.2}");
            assert!(end < 0.1 * start, "{start} {end}");
            assert!(fastest < 1.7, "{fastest}");
        }
    }
}

/// A vortex stronger than the stream that carries it: part of the outlet has flow into the domain.
#[test]
fn strong_backflow_stays_bounded() {
    for outlet in [CONVECTIVE, PRESSURE] {
        let [start, end, fastest] = leaving(BoxElement::Hexahedron, &outlet, 3.0);
        println!("{outlet:?}: {start:.3e} -> {end:.3e}, fastest {fastest:.2}");
        assert!(
            end < 0.5 * start && fastest < 6.0,
            "{start} {end} {fastest}"
        );
    }
}

/// From rest to full flow in no time, at Courant number 1.
#[test]
fn an_impulsive_start_is_survived() {
    for element in [BoxElement::Hexahedron, BoxElement::Tetrahedron] {
        for outlet in [CONVECTIVE, PRESSURE] {
            let mut fluid = channel(element, [32, 16, 1], 1e-3, |name| match name {
                "x_min" => BoundaryCondition::Inlet {
                    profile: VelocityProfile::Uniform([1.0, 0.0, 0.0]),
                },
                "x_max" => outlet.clone(),
                _ => BoundaryCondition::WALL,
            });
            for _ in 0..150 {
                let dt = fluid.suggest_dt(1.0, 0.1);
                fluid.advance(dt).expect("step");
            }
            let speeds = fluid.velocity().iter().map(|u| u[0].hypot(u[1]));
            let fastest = speeds.fold(0.0, f64::max);
            println!("{element:?} {outlet:?}: fastest {fastest:.3}");
            assert!(fastest < 2.5, "{fastest}");
        }
    }
}

#[test]
fn a_restart_with_a_convective_outlet_is_bitwise() {
    let make = || {
        let pulse = Signal::Function(std::sync::Arc::new(|t| 1.0 + 0.5 * (3.0 * t).sin()));
        channel(BoxElement::Prism, [12, 8, 2], 0.01, |name| match name {
            "x_min" => BoundaryCondition::Inlet {
                profile: parabola().scaled(pulse.clone()),
            },
            "x_max" => CONVECTIVE,
            _ => BoundaryCondition::WALL,
        })
    };
    let advance = |fluid: &mut Fluid, steps: usize| {
        for _ in 0..steps {
            let dt = fluid.suggest_dt(0.5, 0.02);
            fluid.advance(dt).expect("step");
        }
    };
    let mut whole = make();
    advance(&mut whole, 7);
    for split in [1, 4] {
        let mut first = make();
        advance(&mut first, split);
        let mut second = make();
        second.restore(first.state()).expect("restore");
        advance(&mut second, 7 - split);
        assert!(second.state() == whole.state(), "split after {split}");
    }
}
