//! Cahn–Hilliard: equilibrium profiles, surface tension, energy, conservation, order in time, capillary force (E1).

mod common;

use common::{fluid_on, of, order, settings};
use fibreflow_fluid::{BoundaryCondition, Fluid, Inertia, PhaseField, PhaseSettings, affinity};
use fibreflow_mesh::{BoxElement, BoxMesh};
use std::f64::consts::{PI, SQRT_2};

/// σ_AB at e = ξ = 1.
const TENSION: f64 = 0.942_809_041_582_063_4;

/// A closed box, one element thick and periodic along z, in a fluid of unit density and viscosity.
fn plane(cells: [usize; 2], length: f64, inertia: Inertia) -> Fluid {
    let h = length / cells[0] as f64;
    let size = [length, h * cells[1] as f64, h];
    let mesh = BoxMesh {
        periodic: [false, false, true],
        ..of(BoxElement::Hexahedron, size, [cells[0], cells[1], 1], 0.0)
    };
    let mut settings = settings(1.0, 1.0, 1e-9);
    settings.inertia = inertia;
    fluid_on(&mesh, settings, |_| BoundaryCondition::WALL)
}

/// e = 1 J/m³ and D = 1 m²/s.
fn unit(fluid: &Fluid, width: f64) -> PhaseField {
    let settings = PhaseSettings::new(TENSION * width, width, 1.0);
    PhaseField::new(fluid, settings).expect("field")
}

/// Without flow, in growing steps, until diffusion takes less than `power`.
fn settle(field: &mut PhaseField, fluid: &Fluid, power: f64) {
    for step in 0..1000 {
        let dt = field.suggest_dt(fluid, 0.01, f64::INFINITY);
        let report = field.advance(fluid, dt).expect("step");
        if step > 20 && report.dissipation < power {
            return;
        }
    }
    panic!("not settled");
}

/// Waves that fit nothing.
fn waves(x: [f64; 3]) -> f64 {
    let [x, y, z] = x.map(|x| 2.0 * PI * x);
    0.6 * (x + 0.3).sin() * (2.0 * y + 1.1).cos() + 0.4 * (3.0 * x - y + 2.0 * z).sin() + 0.1
}

#[test]
fn a_flat_interface_has_the_profile_and_the_tension_of_theory() {
    let errors = [1.5, 3.0, 6.0].map(|per_width| {
        let cells = (24.0 * per_width) as usize;
        let fluid = plane([cells, 1], 24.0, Inertia::Full);
        let mut field = unit(&fluid, 1.0);
        let sharp = |x: [f64; 3]| (2.0 * (x[0] - 12.0)).tanh();
        field.set(&fluid, sharp).expect("start");
        settle(&mut field, &fluid, 1e-14);
        let tension = field.energy(&fluid).total() * 24.0 / fluid.volume();
        let profile = |x: f64| ((x - 12.0) / SQRT_2).tanh();
        let nodes = fluid.mesh().nodes.iter().zip(field.order_parameter());
        let off = nodes.map(|(x, psi)| (psi - profile(x[0])).abs());
        let off = off.fold(0.0, f64::max);
        println!(
            "ξ = {per_width} Δ: σ/σ_AB = {}, ψ off by {off:.2e}",
            tension / TENSION
        );
        [(tension / TENSION - 1.0).abs(), off]
    });
    for kind in 0..2 {
        let errors = errors.map(|e| e[kind]);
        assert!(errors[1] < 0.01 && order(&[1.5, 3.0, 6.0], &errors) > 1.9);
    }
}

/// L fig. 4: A | solid | B with ψ_0 = 0.3 against the boundary-value problem on a line of its own.
#[test]
fn a_solid_between_two_fluids_takes_its_own_value() {
    let (psi_0, half) = (0.3, 8.0);
    let phi = |x: f64| {
        let inside = (half - (x - 24.0).abs()) / SQRT_2;
        0.5 + 0.5 * inside.tanh()
    };
    let mut errors = Vec::new();
    for per_width in [3.0, 6.0] {
        let cells = (48.0 * per_width) as usize;
        let fluid = plane([cells, 1], 48.0, Inertia::Full);
        let mut field = unit(&fluid, 1.0);
        field
            .set(&fluid, |x| {
                let phi = phi(x[0]);
                (1.0 - phi) * (24.0 - x[0]).signum() + phi * psi_0
            })
            .expect("start");
        let nodes = fluid.mesh().nodes.clone();
        for (solid, x) in field.solid_mut().iter_mut().zip(&nodes) {
            *solid = [phi(x[0]), affinity(psi_0)];
        }
        settle(&mut field, &fluid, 1e-18);
        let potentials = field.chemical_potentials(&fluid);
        let level = potentials[0][0];
        assert!(potentials.iter().all(|mu| (mu[0] - level).abs() < 1e-6));
        let exact = bent_line(48.0, 14401, level, |x| [phi(x), affinity(psi_0)]);
        let psi = field.order_parameter();
        let at = |x: f64| exact[(x * 300.0).round() as usize];
        let off = nodes.iter().zip(psi).map(|(x, psi)| (psi - at(x[0])).abs());
        let off = off.fold(0.0, f64::max);
        let middle = nodes
            .iter()
            .zip(psi)
            .find(|(x, _)| (x[0] - 24.0).abs() < 1e-9);
        let inside = *middle.expect("a node in the middle").1;
        println!("ξ = {per_width} Δ: ψ off by {off:.2e}, inside the solid {inside:.5}");
        assert!((inside - psi_0).abs() < 0.02);
        errors.push(off);
    }
    assert!(errors[0] < 0.01 && errors[0] / errors[1] > 3.5);
}

/// f'(ψ) − ψ'' = μ on 0…length by Newton's method, from the profile without μ.
fn bent_line(length: f64, points: usize, level: f64, solid: impl Fn(f64) -> [f64; 2]) -> Vec<f64> {
    let h = length / (points - 1) as f64;
    let mut psi: Vec<f64> = (0..points)
        .map(|i| ((0.5 * length - i as f64 * h) / SQRT_2).tanh())
        .collect();
    for _ in 0..60 {
        let (mut upper, mut step) = (vec![0.0; points], vec![0.0; points]);
        for i in 0..points {
            let [phi, wanted] = solid(i as f64 * h);
            let own = psi[i];
            let before = psi[if i == 0 { 1 } else { i - 1 }];
            let after = psi[if i + 1 == points { i - 1 } else { i + 1 }];
            let residual = own * (own * own - 1.0) + 3.0 * phi * phi * (own - wanted)
                - (before + after - 2.0 * own) / (h * h)
                - level;
            let diagonal = 3.0 * own * own - 1.0 + 3.0 * phi * phi + 2.0 / (h * h);
            let weight = 1.0 / (h * h);
            let low = if i == 0 {
                0.0
            } else if i + 1 == points {
                -2.0 * weight
            } else {
                -weight
            };
            let high = if i == 0 { -2.0 * weight } else { -weight };
            let (last, carried) = if i == 0 {
                (0.0, 0.0)
            } else {
                (upper[i - 1], step[i - 1])
            };
            let pivot = diagonal - low * last;
            upper[i] = high / pivot;
            step[i] = (-residual - low * carried) / pivot;
        }
        for i in (0..points - 1).rev() {
            step[i] -= upper[i] * step[i + 1];
        }
        psi.iter_mut().zip(&step).for_each(|(psi, d)| *psi += d);
    }
    psi
}

#[test]
fn the_energy_falls_in_steps_of_any_length_and_nothing_is_lost() {
    for (element, jitter) in [
        (BoxElement::Hexahedron, 0.0),
        (BoxElement::Hexahedron, 0.2),
        (BoxElement::Tetrahedron, 0.2),
    ] {
        for relaxations in [0.05, 1.0, 8.0] {
            let mesh = BoxMesh {
                periodic: [true, false, true],
                ..of(element, [1.0; 3], [10, 10, 10], jitter)
            };
            let fluid = fluid_on(&mesh, settings(1.0, 1.0, 1e-9), |_| BoundaryCondition::WALL);
            let mut field = unit(&fluid, 0.12);
            field.set(&fluid, waves).expect("start");
            let nodes = fluid.mesh().nodes.clone();
            for (solid, x) in field.solid_mut().iter_mut().zip(&nodes) {
                let distance = (x[0] - 0.5).hypot(x[1] - 0.5);
                *solid = [0.5 + 0.5 * ((0.2 - distance) / 0.17).tanh(), affinity(-0.2)];
            }
            let amount = field.integral(&fluid);
            let mut energy = field.energy(&fluid).total();
            let (start, mut iterations) = (energy, 0);
            let dt = relaxations * 0.12 * 0.12;
            for _ in 0..30 {
                let report = field.advance(&fluid, dt).expect("step");
                iterations += report.iterations;
                let now = field.energy(&fluid).total();
                let (lost, diffused) = (energy - now, dt * report.dissipation);
                // The residual of the solver is 1e-9 of what changes ψ.
                assert!(
                    lost >= diffused * (1.0 - 1e-6) - 1e-13 * start,
                    "{element:?}, {relaxations}: lost {lost:e} of {diffused:e}"
                );
                energy = now;
            }
            let drift = (field.integral(&fluid) - amount).abs();
            println!(
                "{element:?}, Δt = {relaxations} ξ²/D: F {start:.4} → {energy:.4}, ∫ψ off by {drift:.1e}, {:.1} iterations a step",
                f64::from(iterations as u32) / 30.0
            );
            assert!(drift < 1e-14);
        }
    }
}

#[test]
fn the_integral_stays_over_many_steps() {
    let fluid = plane([12, 12], 1.0, Inertia::Full);
    let mut field = unit(&fluid, 0.2);
    field.set(&fluid, waves).expect("start");
    let amount = field.integral(&fluid);
    for _ in 0..10_000 {
        field.advance(&fluid, 0.004).expect("step");
    }
    let drift = (field.integral(&fluid) / amount - 1.0).abs();
    println!("∫ψ = {amount:.3e} m³ off by {drift:.1e} after 10⁴ steps");
    assert!(drift < 1e-12);
}

#[test]
fn time_is_of_second_order_with_advection() {
    let mesh = BoxMesh {
        periodic: [true; 3],
        ..of(
            BoxElement::Hexahedron,
            [1.0, 1.0, 1.0 / 16.0],
            [16, 16, 1],
            0.0,
        )
    };
    let mut fluid = fluid_on(&mesh, settings(1.0, 1.0, 1e-12), |_| {
        BoundaryCondition::WALL
    });
    fluid
        .set_velocity(|[x, y, _]| {
            let [x, y] = [x, y].map(|x| 2.0 * PI * x);
            [3.0 + 2.0 * x.sin() * y.cos(), -2.0 * x.cos() * y.sin(), 0.0]
        })
        .expect("velocity");
    let run = |steps: usize| {
        let mut field = unit(&fluid, 0.15);
        field.set(&fluid, waves).expect("start");
        for _ in 0..steps {
            field.advance(&fluid, 0.02 / steps as f64).expect("step");
        }
        field.order_parameter().to_vec()
    };
    let fine = run(640);
    let errors = [20, 40, 80].map(|steps| {
        let pairs = run(steps)
            .into_iter()
            .zip(&fine)
            .map(|(a, b)| (a - b).powi(2));
        (pairs.sum::<f64>() / fine.len() as f64).sqrt()
    });
    println!(
        "errors {errors:?}, order {:.3}",
        order(&[20.0, 40.0, 80.0], &errors)
    );
    assert!(order(&[20.0, 40.0, 80.0], &errors) > 1.85);
}

#[test]
fn the_force_does_the_work_that_advection_stores() {
    for (element, jitter) in [(BoxElement::Hexahedron, 0.0), (BoxElement::Prism, 0.2)] {
        let mesh = BoxMesh {
            periodic: [true; 3],
            ..of(element, [1.0; 3], [9, 9, 9], jitter)
        };
        let fluid = fluid_on(&mesh, settings(1.0, 1.0, 1e-9), |_| BoundaryCondition::WALL);
        let mut field = unit(&fluid, 0.15);
        field.set(&fluid, waves).expect("start");
        let mut force = vec![[0.0; 4]; fluid.mesh().total()];
        field.add_force(&fluid, &mut force);
        let mu = field.chemical_potentials(&fluid);
        let (geometry, psi) = (fluid.geometry(), field.order_parameter());
        let u = |i: usize| {
            let [x, y, z] = fluid.mesh().nodes[i];
            [waves([y, x, z]), waves([z, x, y]), waves([x, z, y])]
        };
        let (mut work, mut stored, mut size) = (0.0, 0.0, 0.0);
        for i in 0..geometry.volumes.len() {
            let own = u(i);
            work += (0..3)
                .map(|c| geometry.volumes[i] * force[i][c] * own[c])
                .sum::<f64>();
            for e in geometry.row(i) {
                let (j, s) = (geometry.columns[e] as usize, geometry.faces[e]);
                let other = u(j);
                let flux: f64 = (0..3).map(|c| 0.5 * (own[c] + other[c]) * s[c]).sum();
                let carried = 0.5 * (psi[i] + psi[j]) * flux;
                stored -= mu[i][0] * carried;
                size += (mu[i][0] * carried).abs();
            }
        }
        println!("{element:?}: work {work:.6}, stored {stored:.6}");
        assert!((work + stored).abs() < 1e-13 * size && work.abs() > 1e-4 * size);
    }
}

/// A drop in creeping flow: its pressure, and what flows at rest.
#[test]
fn a_drop_has_the_pressure_of_laplace_and_hardly_flows() {
    let (width, cells) = (2.0, 64);
    let length = f64::from(cells as u32);
    let mut fluid = plane([cells, cells], length, Inertia::Steady);
    let mut field = unit(&fluid, width);
    let radius = 0.35 * length;
    let out = |x: [f64; 3]| (x[0] - 0.5 * length).hypot(x[1] - 0.5 * length);
    field
        .set(&fluid, |x| ((radius - out(x)) / (SQRT_2 * width)).tanh())
        .expect("start");
    let mut fastest = 0.0;
    for step in 0..100 {
        let dt = 4.0;
        field.advance(&fluid, dt).expect("order parameter");
        fluid.body_force_mut().fill([0.0; 4]);
        let mut force = vec![[0.0; 4]; fluid.mesh().total()];
        field.add_force(&fluid, &mut force);
        fluid.body_force_mut().copy_from_slice(&force);
        fluid.advance(dt).expect("flow");
        let speed = |u: &[f64; 4]| u[0].hypot(u[1]);
        fastest = fluid.velocity().iter().map(speed).fold(0.0, f64::max);
        if step % 20 == 0 {
            println!("step {step}: fastest {fastest:.2e}");
        }
    }
    let capillary = field.capillary_pressure(&fluid);
    let nodes = &fluid.mesh().nodes;
    let nearest = |x: f64| {
        let distance = |i: &usize| (nodes[*i][0] - x).hypot(nodes[*i][1] - x);
        let found = (0..nodes.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        found.expect("nodes")
    };
    let pressure = |i: usize| fluid.pressure()[i] + capillary[i];
    let (inside, outside) = (nearest(0.5 * length), nearest(0.0));
    let psi = field.order_parameter();
    // The drop whose sharp edge holds as much as the diffuse one.
    let share =
        (field.integral(&fluid) / fluid.volume() - psi[outside]) / (psi[inside] - psi[outside]);
    let found = (share * length * length / PI).sqrt();
    let laplace = (pressure(inside) - pressure(outside)) * found / (TENSION * width);
    println!(
        "R = {found:.3}, Δp R/σ = {laplace:.5}, fastest {fastest:.2e} of σ/μ = {:.2}",
        TENSION * width
    );
    assert!((laplace - 1.0).abs() < 0.005);
    // Nothing drives a flow where μ is uniform.
    assert!(fastest < 1e-5 * TENSION * width);
}

#[test]
fn settings_out_of_range_are_refused() {
    let fluid = plane([4, 4], 1.0, Inertia::Full);
    for (tension, width, diffusivity) in [(0.0, 1.0, 1.0), (1.0, f64::NAN, 1.0), (1.0, 1.0, -1.0)] {
        let settings = PhaseSettings::new(tension, width, diffusivity);
        assert!(PhaseField::new(&fluid, settings).is_err());
    }
    let mut field = unit(&fluid, 0.2);
    assert!(field.advance(&fluid, 0.0).is_err());
    assert!(field.set(&fluid, |_| f64::NAN).is_err());
}
