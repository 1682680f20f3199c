//! A step of creeping flow that is solved with one body force after another: affine, symmetric, and the last one counts.

mod common;

use common::{fluid_on, of, settings};
use fibreflow_fluid::{
    BoundaryCondition, CreepingStep, Fluid, FluidError, Inertia, Signal, VelocityProfile,
};
use fibreflow_mesh::{BoxElement, BoxMesh};
use std::sync::Arc;

/// A gap with a wall that starts to move: something flows without forces too.
fn gap(element: BoxElement, inertia: Inertia) -> Fluid {
    let mesh = BoxMesh {
        periodic: [true, false, true],
        ..of(element, [1.0, 0.8, 0.6], [8, 8, 6], 0.1)
    };
    let mut settings = settings(1.3, 0.7, 1e-10);
    settings.inertia = inertia;
    fluid_on(&mesh, settings, |name| match name {
        "y_max" => BoundaryCondition::MovingWall {
            profile: VelocityProfile::Uniform([0.02, 0.0, 0.0])
                .scaled(Signal::Function(Arc::new(|t| 1.0 - (-t).exp()))),
        },
        _ => BoundaryCondition::WALL,
    })
}

/// A force near a point \[N/m³\], and another direction elsewhere.
fn force(x: [f64; 3], centre: [f64; 3], direction: [f64; 3]) -> [f64; 4] {
    let square: f64 = (0..3).map(|c| (x[c] - centre[c]).powi(2)).sum();
    let size = (-square / 0.03).exp();
    [
        size * direction[0],
        size * direction[1],
        size * direction[2],
        0.0,
    ]
}

/// Two forces that share nothing.
fn forces(fluid: &Fluid) -> [Vec<[f64; 4]>; 2] {
    let field = |centre, direction| {
        let nodes = fluid.mesh().nodes.iter();
        nodes.map(|x| force(*x, centre, direction)).collect()
    };
    [
        field([0.3, 0.3, 0.2], [1.0, 0.5, -0.3]),
        field([0.6, 0.5, 0.4], [-0.2, 1.0, 0.8]),
    ]
}

fn solved(step: &mut CreepingStep<'_>, force: impl Fn(usize) -> [f64; 4]) -> Vec<[f64; 4]> {
    let field = step.body_force_mut().iter_mut().enumerate();
    field.for_each(|(i, f)| *f = force(i));
    step.solve().expect("solve");
    step.velocity().to_vec()
}

#[test]
fn the_answer_to_forces_is_linear_and_symmetric() {
    for element in [BoxElement::Hexahedron, BoxElement::Tetrahedron] {
        for (inertia, dt) in [(Inertia::Linear, 0.05), (Inertia::Steady, 1.0)] {
            let mut fluid = gap(element, inertia);
            fluid.advance(dt).expect("step");
            let [f, g] = forces(&fluid);
            let volumes = fluid.geometry().volumes.clone();
            let mut step = fluid.begin_step(dt).expect("step");
            let none = solved(&mut step, |_| [0.0; 4]);
            let [u, v] = [&f, &g].map(|f| solved(&mut step, |i| f[i]));
            let sum = |i: usize| [0, 1, 2, 3].map(|c| 2.0 * f[i][c] - 3.0 * g[i][c]);
            let both = solved(&mut step, sum);
            let work = |f: &[[f64; 4]], u: &[[f64; 4]]| -> f64 {
                let at =
                    |i: usize| -> f64 { (0..3).map(|c| f[i][c] * (u[i][c] - none[i][c])).sum() };
                volumes.iter().enumerate().map(|(i, v)| v * at(i)).sum()
            };
            let (own, across, back) = (work(&f, &u), work(&f, &v), work(&g, &u));
            let largest = none.iter().flatten().fold(0.0_f64, |m, u| m.max(u.abs()));
            let expected = |i: usize, c: usize| {
                none[i][c] + 2.0 * (u[i][c] - none[i][c]) - 3.0 * (v[i][c] - none[i][c])
            };
            let off = (0..volumes.len()).flat_map(|i| (0..3).map(move |c| (i, c)));
            let off = off.map(|(i, c)| (both[i][c] - expected(i, c)).abs());
            let off = off.fold(0.0, f64::max) / largest;
            println!(
                "{element:?}, {inertia:?}: f·Rf {own:.3e}, f·Rg {across:.6e}, differs by {:.1e}; not linear by {off:.1e}",
                (across - back).abs() / own
            );
            assert!(own > 0.0 && across.abs() > 1e-3 * own);
            assert!((across - back).abs() < 1e-8 * own);
            assert!(largest > 1e-3 && off < 1e-7);
        }
    }
}

/// Whatever was tried before, the last force is that of the step.
#[test]
fn only_the_last_solve_counts() {
    for inertia in [Inertia::Linear, Inertia::Steady] {
        let mut once = gap(BoxElement::Prism, inertia);
        let mut often = gap(BoxElement::Prism, inertia);
        let [f, g] = forces(&once);
        for dt in [0.05, 0.03] {
            once.body_force_mut().copy_from_slice(&f);
            let report = once.advance(dt).expect("step");
            let mut step = often.begin_step(dt).expect("step");
            solved(&mut step, |i| g[i]);
            solved(&mut step, |i| [0, 1, 2, 3].map(|c| 1.001 * f[i][c]));
            step.body_force_mut().copy_from_slice(&f);
            let warm = step.solve().expect("solve");
            step.finish().expect("finish");
            println!(
                "{inertia:?}: {} iterations, warm {warm}",
                report.poisson_iterations
            );
            assert!(warm < report.poisson_iterations);
        }
        assert_eq!((often.steps(), often.time()), (2, once.time()));
        let pairs = once.velocity().iter().zip(often.velocity());
        let largest = once
            .velocity()
            .iter()
            .flatten()
            .fold(0.0_f64, |m, u| m.max(u.abs()));
        let off = pairs.flat_map(|(a, b)| (0..3).map(move |c| (a[c] - b[c]).abs()));
        let off = off.fold(0.0, f64::max) / largest;
        assert!(off < 1e-7, "{inertia:?}: {off:e}");
        assert!(often.divergence_max() < 1e-6 * largest / 0.1);
        for (a, b) in once
            .patch_loads([0.0; 3])
            .iter()
            .zip(often.patch_loads([0.0; 3]))
        {
            let (a, b) = (a.force(), b.force());
            assert!((a[0] - b[0]).abs() < 1e-7 * a[0].abs(), "{a:?} {b:?}");
        }
    }
}

#[test]
fn a_step_that_is_not_solved_is_solved_at_its_end() {
    let mut plain = gap(BoxElement::Hexahedron, Inertia::Linear);
    let mut begun = gap(BoxElement::Hexahedron, Inertia::Linear);
    plain.advance(0.1).expect("step");
    let step = begun.begin_step(0.1).expect("step");
    step.finish().expect("finish");
    assert!(plain.state() == begun.state());
}

#[test]
fn a_flow_with_convection_has_no_linear_answer() {
    let mut fluid = gap(BoxElement::Hexahedron, Inertia::Full);
    assert!(matches!(fluid.begin_step(0.1), Err(FluidError::Convection)));
}
