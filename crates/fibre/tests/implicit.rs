//! The implicit integrator: order, stability at any step, stiff and massless limits, momentum (validation rows B1, B4, B5).

use fibreflow_fibre::hydrodynamics::{
    AmbientFlow, DragModel, FluidProperties, TorqueModel, cox_aspect_ratio,
};
use fibreflow_fibre::{
    Equilibrium, Fibre, FibreSettings, FibreSystem, Hydrodynamics, ImplicitSettings, Integrator,
    Kinematics, Material, Matrix3, Support, Vector3,
};
use fibreflow_parallel::Communicator;
use std::f64::consts::PI;

/// EI = 1 and mass per length 1.
fn material(radius: f64) -> Material {
    let unit = Material::new(radius, 1.0, 0.3, 1.0);
    Material::new(radius, 1.0 / unit.second_moment(), 0.3, 1.0 / unit.area())
}

fn fixed(linear: bool) -> Integrator {
    Integrator::Implicit(ImplicitSettings {
        linear,
        tolerance: f64::INFINITY,
    })
}

fn settings(integrator: Integrator) -> FibreSettings {
    FibreSettings {
        integrator,
        ..FibreSettings::default()
    }
}

fn system(fibre: Fibre, settings: FibreSettings) -> FibreSystem {
    FibreSystem::new(Communicator::single(), settings, vec![fibre]).expect("valid fibre")
}

fn cantilever(segments: usize, radius: f64, integrator: Integrator) -> FibreSystem {
    let (start, end) = (Vector3::zeros(), Vector3::x());
    let mut fibre = Fibre::straight(3, material(radius), start, end, segments);
    fibre.supports = vec![Support::clamp(0)];
    system(fibre, settings(integrator))
}

fn tip(s: &FibreSystem) -> Vector3 {
    s.positions()[s.positions().len() - 1]
}

/// A bent, stretched, twisted fibre that springs and spins freely.
fn springing(integrator: Integrator) -> FibreSystem {
    let nodes = (0..=8)
        .map(|i| {
            let a = 0.2 * f64::from(i);
            Vector3::new(a.cos(), a.sin(), 0.1 * a)
        })
        .collect();
    let mut fibre = Fibre::new(1, material(0.1), nodes);
    fibre.equilibrium = Equilibrium::Straight;
    let mut s = system(fibre, settings(integrator));
    for (i, w) in s.angular_velocities_mut().iter_mut().enumerate() {
        *w = Vector3::new(2.0, (i as f64).cos(), -1.0);
    }
    for (i, v) in s.velocities_mut().iter_mut().enumerate() {
        *v = Vector3::new(0.3, 0.0, 0.2 * i as f64);
    }
    s
}

fn run(mut s: FibreSystem, time: f64, steps: usize) -> FibreSystem {
    for _ in 0..steps {
        s.advance_free(time / steps as f64).expect("finite");
    }
    s
}

fn distance(a: &FibreSystem, b: &FibreSystem) -> f64 {
    let pairs = a.positions().iter().zip(b.positions());
    pairs.map(|(x, y)| (x - y).norm()).fold(0.0, f64::max)
}

#[test]
fn both_variants_are_of_second_order() {
    let time = 0.05;
    let reference = run(springing(Integrator::Explicit), time, 20_000);
    for linear in [false, true] {
        let error = |steps| distance(&run(springing(fixed(linear)), time, steps), &reference);
        let errors = [200, 400, 800].map(error);
        println!("linear {linear}: {errors:?}");
        let order = 0.5 * (errors[0] / errors[2]).log2();
        assert!((1.9..2.6).contains(&order), "order {order}");
    }
}

/// One step of any length brings the tip to the elastica: the static limit is exact, not approached.
#[test]
fn huge_steps_find_the_static_shape() {
    for (segments, limit) in [(8, 1.5e-3), (16, 4e-4)] {
        let mut s = cantilever(segments, 0.002, fixed(false));
        s.add_load(3, segments, Vector3::y() * 5.0, Vector3::zeros())
            .expect("tip");
        for _ in 0..40 {
            s.advance_free(1e3).expect("finite");
        }
        // Inextensible elastica at PL²/EI = 5 (elliptic integrals; Bisshopp & Drucker 1945); EI/EA = 1e-6.
        let reference = Vector3::new(0.612_37, 0.713_79, 0.0);
        let error = (tip(&s) - reference).norm();
        println!(
            "{segments}: {:?}, {error:.2e}, energy {:?}",
            tip(&s),
            s.energy()
        );
        assert!(error < limit);
        assert!(s.energy().kinetic < 1e-12);
    }
}

#[test]
fn no_step_is_too_large_for_a_linear_beam() {
    for ratio in [1e1, 1e3, 1e5, 1e7] {
        let mut s = cantilever(8, 0.02, fixed(false));
        for (i, v) in s.velocities_mut().iter_mut().enumerate() {
            *v = Vector3::new((3.0 * i as f64).sin(), (2.3 * i as f64).cos(), 0.3) * 1e-6;
        }
        s.velocities_mut()[0] = Vector3::zeros();
        let mut last = s.energy().total();
        let step = ratio * s.critical_step();
        for k in 0..50 {
            s.advance_free(step).expect("finite");
            let energy = s.energy().total();
            assert!(
                energy <= last * (1.0 + 1e-6) + 1e-30,
                "{ratio} {k}: {energy} {last}"
            );
            last = energy;
        }
    }
}

/// A fibre of a hundred times the bending stiffness and a million times the step in a flow: Jeffery's period.
fn half_period(stiffness: f64, density: f64, step: f64) -> f64 {
    let (rate, r_p) = (1.0, 20.0);
    let radius = 0.5 / r_p;
    let viscosity = 1.0;
    let mut material = Material::new(radius, stiffness, 0.3, density);
    material.retardation = 0.0;
    let fibre = Fibre::straight(1, material, -Vector3::y() * 0.5, Vector3::y() * 0.5, 8);
    let mut s = system(
        fibre,
        FibreSettings {
            hydrodynamics: Some(hydrodynamics(
                1e-3,
                viscosity,
                DragModel::SlenderBody(Default::default()),
            )),
            ..settings(fixed(false))
        },
    );
    let mut time = 0.0;
    let mut last = s.end_to_end(0).x;
    // From y through x to −y: half an orbit.
    loop {
        s.advance_in_flow(&AmbientFlow::Shear { rate }, step)
            .expect("finite");
        time += step;
        let d = s.end_to_end(0);
        if d.y < 0.0 && d.x * last <= 0.0 || time > 1e3 {
            let r = cox_aspect_ratio(r_p);
            let exact = PI * (r + 1.0 / r) / rate;
            let fraction = d.x / (d.x - last);
            return (time - fraction * step) / exact;
        }
        last = d.x;
    }
}

fn hydrodynamics(density: f64, viscosity: f64, drag: DragModel) -> Hydrodynamics {
    Hydrodynamics {
        fluid: FluidProperties { density, viscosity },
        drag,
        torque: TorqueModel::default(),
        point_spacing: f64::INFINITY,
    }
}

#[test]
fn stiff_and_massless_fibres_keep_jefferys_period() {
    for (stiffness, density) in [(1e6, 1e-3), (1e12, 1e-3), (1e6, 1e-14), (1e9, 1.0)] {
        let ratio = half_period(stiffness, density, 0.05);
        println!("E {stiffness:e}, density {density:e}: {ratio}");
        assert!((ratio - 1.0).abs() < 2e-3);
    }
}

/// A clamped fibre of 24 µm and aspect ratio `r_p` in water that flows across it and back in `period`; the deflection of
/// its tip by its length at the end of every step of 1e-4 s over five periods.
fn history(youngs_modulus: f64, r_p: f64, integrator: Integrator, parts: usize) -> Vec<f64> {
    let (step, period) = (1e-4, 20.0 * 1e-4);
    let (diameter, segments) = (24e-6, 32);
    let length = r_p * diameter;
    let mut material = Material::new(0.5 * diameter, youngs_modulus, 0.3, 1300.0);
    // Added mass of a cylinder: that of the displaced water.
    material.density += 1000.0;
    let mut fibre = Fibre::straight(
        1,
        material,
        Vector3::zeros(),
        Vector3::x() * length,
        segments,
    );
    fibre.supports = vec![Support::clamp(0)];
    let mut s = system(
        fibre,
        FibreSettings {
            hydrodynamics: Some(hydrodynamics(1000.0, 1e-3, DragModel::default())),
            ..settings(integrator)
        },
    );
    let part = step / parts as f64;
    let mut deflections = Vec::new();
    for k in 0..100 * parts {
        let flow = |_: &Vector3, moment: f64| {
            let phase = 2.0 * PI * (k as f64 + moment) * part / period;
            (Vector3::y() * 0.05 * phase.sin(), Matrix3::zeros())
        };
        s.advance_in(&flow, part).expect("finite");
        if (k + 1) % parts == 0 {
            deflections.push(tip(&s).y / length);
        }
    }
    deflections
}

fn relative(a: &[f64], b: &[f64]) -> f64 {
    let square = |v: f64| v * v;
    let difference: f64 = a.iter().zip(b).map(|(x, y)| square(x - y)).sum();
    (difference / b.iter().map(|y| square(*y)).sum::<f64>()).sqrt()
}

/// B4: steps three to four orders above the explicit critical one, error over the history of a ringing fibre.
#[test]
fn a_stiff_fibre_follows_an_oscillating_flow_at_the_step_of_the_flow() {
    for youngs_modulus in [20e9, 100e9] {
        for r_p in [50.0, 200.0] {
            let converged = history(youngs_modulus, r_p, fixed(false), 64);
            let ways = [
                fixed(true),
                fixed(false),
                Integrator::Implicit(ImplicitSettings::default()),
            ];
            let errors =
                ways.map(|way| relative(&history(youngs_modulus, r_p, way, 1), &converged));
            let largest = converged.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
            println!("E {youngs_modulus:e}, r_p {r_p}: {errors:?}, deflection {largest:.1e} L");
            assert!(errors[0] < 2.5e-2 && errors[1] < 2.5e-2 && errors[2] < 1e-2);
        }
    }
}

/// B4: a bent clamped fibre relaxes in a viscous liquid at the rate of its slowest mode.
#[test]
fn a_bent_fibre_relaxes_at_its_rate_in_steps_of_a_tenth_of_it() {
    let (r_p, diameter, segments, viscosity) = (50.0, 24e-6, 32, 1.0);
    let length = r_p * diameter;
    let material = Material::new(0.5 * diameter, 20e9, 0.3, 1300.0);
    let mut fibre = Fibre::straight(
        1,
        material,
        Vector3::zeros(),
        Vector3::x() * length,
        segments,
    );
    fibre.supports = vec![Support::clamp(0)];
    let slender = fibreflow_fibre::hydrodynamics::SlenderConstants::Batchelor;
    let zeta = slender.resistance(r_p, viscosity).normal;
    // ζ ẏ = −EI y'''' for the clamped beam's first mode, k L = 1.8751; EI y'''' = k⁴ EI y.
    let rate =
        1.875_104_068_711_961_f64.powi(4) * material.bending_stiffness() / length.powi(4) / zeta;
    let mut s = system(
        fibre,
        FibreSettings {
            hydrodynamics: Some(hydrodynamics(
                1000.0,
                viscosity,
                DragModel::SlenderBody(slender),
            )),
            ..settings(fixed(false))
        },
    );
    s.add_load(1, segments, Vector3::y() * 1e-8, Vector3::zeros())
        .expect("tip");
    let still = AmbientFlow::Uniform(Vector3::zeros());
    for _ in 0..50 {
        s.advance_in_flow(&still, 10.0 / rate).expect("finite");
    }
    s.add_load(1, segments, -Vector3::y() * 1e-8, Vector3::zeros())
        .expect("tip");
    let step = 0.1 / rate;
    // Higher modes go first; they are faster by 39 and more.
    for _ in 0..5 {
        s.advance_in_flow(&still, step).expect("finite");
    }
    let before = tip(&s).y;
    for _ in 0..20 {
        s.advance_in_flow(&still, step).expect("finite");
    }
    let measured = (before / tip(&s).y).ln() / (20.0 * step);
    println!(
        "rate {measured:e}, exact {rate:e}, ratio {}",
        measured / rate
    );
    assert!((measured / rate - 1.0).abs() < 0.02);
}

/// The fluid receives what the fibre took, to round-off, whatever Newton's tolerance.
#[test]
fn a_free_fibre_and_the_fluid_exchange_momentum_exactly() {
    for (linear, stiffness) in [(false, 1e9), (true, 1e9), (false, 1e3)] {
        let material = Material::new(1e-2, stiffness, 0.3, 3.0);
        let nodes = (0..=10)
            .map(|i| Vector3::new(0.1 * f64::from(i), (0.3 * f64::from(i)).sin() * 0.1, 0.0));
        let mut s = system(
            Fibre::new(1, material, nodes.collect()),
            FibreSettings {
                gravity: Vector3::z() * -9.0,
                hydrodynamics: Some(hydrodynamics(1.0, 0.01, DragModel::default())),
                ..settings(fixed(linear))
            },
        );
        let flow = AmbientFlow::Shear { rate: 3.0 };
        let (mut impulses, mut sum) = (Vector3::zeros(), 0.0);
        let before = s.momentum();
        for _ in 0..100 {
            let reaction = s.advance_in_flow(&flow, 0.05).expect("finite");
            let force: Vector3 = reaction.force.iter().sum();
            sum += reaction.force.iter().map(|f| f.norm()).sum::<f64>() * 0.05;
            impulses += (force - s.applied_force()) * 0.05;
        }
        let gap = (s.momentum() - before + impulses).norm() / sum;
        println!("linear {linear}, E {stiffness:e}: {gap:e}");
        assert!(gap < 1e-13);
    }
}

/// B5: a fibre compressed between a clamp and a guided tip buckles at π²EI/L² of its effective length.
#[test]
fn a_compressed_fibre_buckles_at_eulers_load() {
    let segments = 32;
    // Clamped and free: a quarter of π².
    let critical = 0.25 * PI * PI;
    let deflected = |load: f64| {
        let mut s = cantilever(segments, 0.005, fixed(false));
        s.add_load(
            3,
            segments,
            Vector3::new(-load * critical, 1e-6, 0.0),
            Vector3::zeros(),
        )
        .expect("tip");
        for _ in 0..200 {
            s.advance_free(10.0).expect("finite");
        }
        tip(&s).y
    };
    let (below, above) = (deflected(0.99), deflected(1.01));
    println!("tip at 0.99: {below:e}, at 1.01: {above:e}");
    assert!(below.abs() < 1e-3 && above.abs() > 0.1);
}

#[test]
fn step_control_takes_more_steps_for_a_smaller_tolerance() {
    let error = |tolerance: f64| {
        let integrator = Integrator::Implicit(ImplicitSettings {
            linear: false,
            tolerance,
        });
        let mut s = springing(integrator);
        s.advance_free(0.05).expect("finite");
        let n = s.substeps();
        (
            n,
            distance(&s, &run(springing(Integrator::Explicit), 0.05, 5000)),
        )
    };
    let (coarse, fine) = (error(1e-3), error(1e-6));
    println!("{coarse:?} {fine:?}");
    assert!(fine.0 > 4 * coarse.0 && fine.1 < 0.1 * coarse.1);
}

/// A rigid fibre is the limit of a stiff one, at a fraction of its cost; spun freely it keeps its angular momentum.
#[test]
fn a_rigid_fibre_is_the_limit_of_a_stiff_one() {
    let build = |rigid: bool, stiffness: f64| {
        let nodes = (0..=8).map(|i| {
            let a = 0.15 * f64::from(i);
            Vector3::new(a.cos(), a.sin(), 0.05 * a)
        });
        let mut fibre = Fibre::new(
            1,
            Material::new(0.02, stiffness, 0.3, 50.0),
            nodes.collect(),
        );
        fibre.kinematics = if rigid {
            Kinematics::Rigid
        } else {
            Kinematics::Full
        };
        let hydrodynamics = hydrodynamics(1.0, 0.1, DragModel::default());
        system(
            fibre,
            FibreSettings {
                gravity: Vector3::z() * -1.0,
                hydrodynamics: Some(hydrodynamics),
                ..settings(fixed(false))
            },
        )
    };
    let flow = AmbientFlow::Shear { rate: 2.0 };
    let run = |mut s: FibreSystem, steps: usize| {
        let (mut gap, before) = (Vector3::zeros(), s.momentum());
        let h = 2.0 / steps as f64;
        for _ in 0..steps {
            let reaction = s.advance_in_flow(&flow, h).expect("finite");
            gap += reaction.force.iter().sum::<Vector3>() * h;
            gap -= s.applied_force() * h;
        }
        let gap = (s.momentum() - before + gap).norm() / s.momentum().norm();
        assert!(gap < 1e-12, "{gap}");
        s
    };
    let reference = run(build(true, 1.0), 1600);
    let errors = [25, 50, 100].map(|n| distance(&run(build(true, 1.0), n), &reference));
    // Stiff curved fibres lose an order: velocities along the stiff directions are of first order.
    let stiff = [100, 400].map(|n| distance(&run(build(false, 1e9), n), &reference));
    println!("rigid: {errors:?}, stiff: {stiff:?}");
    let order = 0.5 * (errors[0] / errors[2]).log2();
    assert!(errors[2] < 1e-4 && order > 1.8, "order {order}");
    assert!(stiff[0] < 2e-3 && stiff[1] < 0.4 * stiff[0]);
}

#[test]
fn a_rigid_fibre_spins_as_a_free_top() {
    let nodes = [
        Vector3::zeros(),
        Vector3::x(),
        Vector3::new(1.6, 0.8, 0.0),
        Vector3::new(1.6, 0.8, 1.0),
    ];
    let mut fibre = Fibre::new(1, material(0.05), nodes.to_vec());
    fibre.kinematics = Kinematics::Rigid;
    let mut s = system(fibre, settings(fixed(false)));
    let w = Vector3::new(1.0, 0.3, -0.5);
    s.angular_velocities_mut().fill(w);
    let centre = s.centre(0);
    for i in 0..4 {
        let arm = s.positions()[i] - centre;
        s.velocities_mut()[i] = w.cross(&arm);
    }
    let (l, e) = (s.angular_momentum(), s.energy().total());
    let error = |steps: usize, mut s: FibreSystem| {
        for _ in 0..steps {
            s.advance_free(5.0 / steps as f64).expect("finite");
        }
        let ends = s.end_to_end(0).norm() - (nodes[3] - nodes[0]).norm();
        assert!(ends.abs() < 1e-12);
        (
            (s.angular_momentum() - l).norm() / l.norm(),
            (s.energy().total() / e - 1.0).abs(),
        )
    };
    let again = |n| {
        let mut t = system(
            Fibre {
                kinematics: Kinematics::Rigid,
                ..Fibre::new(1, material(0.05), nodes.to_vec())
            },
            settings(fixed(false)),
        );
        t.velocities_mut().copy_from_slice(s.velocities());
        t.angular_velocities_mut()
            .copy_from_slice(s.angular_velocities());
        error(n, t)
    };
    let (coarse, fine) = (again(100), again(200));
    println!("angular momentum, energy: {coarse:?} {fine:?}");
    assert!(fine.0 < 1e-11 && fine.1 < 1e-4 && coarse.1 > 3.0 * fine.1);
}

#[test]
fn a_rigid_fibre_cannot_be_held() {
    let mut fibre = Fibre::straight(1, material(0.05), Vector3::zeros(), Vector3::x(), 2);
    fibre.kinematics = Kinematics::Rigid;
    fibre.supports = vec![Support::clamp(0)];
    let result = FibreSystem::new(
        Communicator::single(),
        FibreSettings::default(),
        vec![fibre],
    );
    assert!(matches!(
        result.err(),
        Some(fibreflow_fibre::FibreError::RigidSupport { fibre: 1 })
    ));
}
