//! Linked rigid fibres: conservation, exact limits, restart, threads.

use fibreflow_fibre::contact::Repulsion;
use fibreflow_fibre::hydrodynamics::AmbientFlow;
use fibreflow_fibre::linked::{Joint, LinkedFibre, LinkedScheme, LinkedSettings, LinkedSystem};
use fibreflow_fibre::{Fibre, Material, Matrix3, PeriodicBox, Vector3};
use fibreflow_parallel::Communicator;
use rand::{Rng, SeedableRng};
use std::f64::consts::PI;

const SCHEMES: [LinkedScheme; 2] = [LinkedScheme::Explicit, LinkedScheme::Implicit];

fn settings() -> LinkedSettings {
    by(LinkedScheme::Explicit)
}

fn by(scheme: LinkedScheme) -> LinkedSettings {
    let force = 150.0 * 6.0 * PI * 8.0;
    LinkedSettings {
        repulsion: Some(Repulsion {
            strength: force,
            decay: 0.05,
            attraction: 0.06 * force,
            attraction_width: 0.17,
            range: 0.66,
            contact_gap: 0.33,
        }),
        friction: [2.0, 1.0],
        ..LinkedSettings::new(scheme, 1.0, 3.0)
    }
}

fn system(settings: LinkedSettings, fibres: Vec<LinkedFibre>) -> LinkedSystem {
    LinkedSystem::new(&Communicator::single(), settings, fibres).expect("fibres")
}

/// Bent fibres of five segments in a cube so small that they touch, every second one with pins.
fn crowd(count: usize, edge: f64, seed: u64) -> Vec<LinkedFibre> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut vector = move || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
    let mut fibre = |k: usize| {
        let (across, along) = (vector(), vector().normalize());
        let normal = along.cross(&across).normalize();
        let mut nodes = vec![vector() * (0.5 * edge)];
        for i in 0..5 {
            let angle = 0.25 * i as f64;
            let step = along * angle.cos() + normal.cross(&along) * angle.sin();
            nodes.push(nodes[i] + step * 16.0);
        }
        let mut beam = Fibre::new(k as u64, Material::new(1.0, 1.0, 0.49, 1.0), nodes);
        beam.material.youngs_modulus =
            16.0 * 38.0 * 8.0 * PI * 512.0 / beam.material.second_moment();
        beam.material.shear_modulus = beam.material.youngs_modulus / 2.98;
        beam.equilibrium = fibreflow_fibre::Equilibrium::Straight;
        // A wide section, so that the stiffnesses of the joints differ.
        beam.material.bending_ratio = if k.is_multiple_of(3) { 0.5 } else { 1.0 };
        beam.section_axis = across;
        let pins = k.is_multiple_of(2);
        let joint = if pins { Joint::Pin } else { Joint::Ball };
        LinkedFibre::new(&beam, joint).expect("a fibre")
    };
    (0..count).map(&mut fibre).collect()
}

fn shear(x: &Vector3, _: f64) -> (Vector3, Matrix3) {
    AmbientFlow::Shear { rate: 1.0 }.at(x)
}

/// What joints, pins and contacts do sums up to nothing: neither does what the flow does.
#[test]
fn no_net_force_or_torque() {
    for (scheme, step) in SCHEMES.into_iter().zip([2e-5, 1e-3]) {
        let mut system = system(by(scheme), crowd(24, 60.0, 5));
        let (mut rubbing, mut sliding, mut worst) = (0, 0, 0.0_f64);
        for _ in 0..20 {
            system.advance(&shear, step).expect("a step");
            let (mut force, mut torque) = (Vector3::zeros(), Vector3::zeros());
            let (mut forces, mut torques) = (0.0, 0.0);
            for s in 0..system.segments() {
                let [centre, _] = system.felt(s);
                let [f, t] = system.drag(s, &shear(&centre, 0.0));
                force += f;
                torque += centre.cross(&f) + t;
                forces += f.norm();
                torques += centre.norm() * f.norm() + t.norm();
            }
            worst = worst
                .max(force.norm() / forces)
                .max(torque.norm() / torques);
            for touch in system
                .solved_touches()
                .iter()
                .filter(|t| t.friction.norm() > 0.0)
            {
                let normal = match scheme {
                    LinkedScheme::Explicit => touch.push.abs(),
                    LinkedScheme::Implicit => touch.repulsion,
                };
                let limit = normal * if touch.slides { 1.0 } else { 2.0 };
                let size = touch.friction.norm();
                assert!(size <= limit * (1.0 + 1e-9));
                assert!(touch.friction.dot(&touch.normal).abs() < 1e-12 * size.max(1.0));
                rubbing += 1;
                sliding += usize::from(touch.slides);
            }
        }
        println!("{scheme:?}: {rubbing} contacts, {sliding} of them sliding, net {worst:.1e}");
        assert!(worst < 1e-12, "{scheme:?}: {worst}");
        assert!(sliding > 10 && rubbing > sliding + 10);
    }
}

/// The sides of a joint move together, to round-off.
#[test]
fn joints_hold() {
    for (scheme, step) in SCHEMES.into_iter().zip([2e-5, 1e-3]) {
        let mut system = system(by(scheme), crowd(6, 60.0, 8));
        for _ in 0..50 {
            system.advance(&shear, step).expect("a step");
            let (mut parting, mut fastest) = (0.0_f64, 0.0_f64);
            for s in (0..system.segments() - 1).filter(|s| !(s + 1).is_multiple_of(5)) {
                let side = |s: usize, sign: f64| {
                    let [v, w] = system.motion(s);
                    v + w.cross(&(system.felt(s)[1] * (8.0 * sign)))
                };
                fastest = fastest.max(system.motion(s)[0].norm());
                parting = parting.max((side(s, 1.0) - side(s + 1, -1.0)).norm());
            }
            assert!(
                parting < 1e-11 * fastest,
                "{scheme:?}: {parting} of {fastest}"
            );
        }
        let figures = system.statistics();
        println!("{scheme:?}: {figures:?}");
        assert!(
            figures.pin_drift < 1e-12 && figures.overlaps < 4,
            "{figures:?}"
        );
    }
}

/// Ball joints and pins of fibres in shear that touch, after a strain: largest distance of the two sides of a joint, by the segment, and of
/// pins from their planes.
fn drift(scheme: LinkedScheme, step: f64, strain: f64) -> [f64; 2] {
    let mut fibres = crowd(12, 160.0, 8);
    for fibre in &mut fibres {
        fibre.bending = fibre.bending.map(|k| 0.02 * k);
        fibre.twisting *= 0.02;
    }
    let mut settings = in_box(scheme);
    settings.periodic.lengths = [Some(180.0); 3];
    let mut system = system(settings, fibres);
    let (mut parted, mut strayed) = (0.0_f64, 0.0_f64);
    let steps = (strain / step).round() as usize;
    for k in 1..=steps {
        system.advance(&shear, step).expect("a step");
        strayed = strayed.max(system.statistics().pin_drift);
        if k % 100 == 0 || k == steps {
            let nodes = system.nodes();
            for s in 0..system.segments() {
                let node = s + s / 5;
                let along = system.frame(s) * Vector3::x() * 16.0;
                parted = parted.max((nodes[node + 1] - nodes[node] - along).norm() / 16.0);
            }
        }
    }
    println!("{scheme:?}, strain {strain}: joints {parted:.1e}, pins {strayed:.1e}");
    [parted, strayed]
}

/// A strain of 1000 is in docs/numerics.md.
#[test]
fn joints_and_pins_do_not_drift() {
    let strain = std::env::var("STRAIN").map_or(10.0, |s| s.parse().expect("a strain"));
    for (scheme, step, strain) in [
        (LinkedScheme::Explicit, 2e-4, 0.1 * strain),
        (LinkedScheme::Implicit, 2e-2, strain),
    ] {
        let [parted, strayed] = drift(scheme, step, strain);
        assert!(
            parted < 1e-8 && strayed < 1e-8,
            "{scheme:?}: {parted} {strayed}"
        );
    }
}

/// Jeffery (1922): tan φ = r tan(γ̇t/(r + 1/r)) from the gradient's direction on, r = 0.7 ℓ/b.
#[test]
fn a_single_segment_follows_its_orbit() {
    let nodes = vec![Vector3::new(0.0, -10.0, 0.0), Vector3::new(0.0, 10.0, 0.0)];
    let beam = Fibre::new(0, Material::new(1.0, 1.0, 0.3, 1.0), nodes);
    let fibre = LinkedFibre::new(&beam, Joint::Ball).expect("a fibre");
    for scheme in SCHEMES {
        let mut errors = [4e-3, 2e-3].map(|step: f64| {
            let mut system = system(by(scheme), vec![fibre.clone()]);
            let ratio: f64 = 7.0;
            let steps = (6.0 / step).round() as usize;
            for _ in 0..steps {
                system.advance(&shear, step).expect("a step");
            }
            let axis = system.nodes()[1] - system.nodes()[0];
            let found = axis.x.atan2(axis.y);
            let angle = 6.0 / (ratio + 1.0 / ratio);
            (found - (ratio * angle.tan()).atan()).abs()
        });
        println!("{scheme:?}: {errors:?}");
        assert!(errors[1] < 1e-5);
        errors[1] /= errors[0];
        assert!((0.2..0.3).contains(&errors[1]), "second order: {errors:?}");
    }
}

fn still(_: &Vector3, _: f64) -> (Vector3, Matrix3) {
    (Vector3::zeros(), Matrix3::zeros())
}

fn bent(stiffer: f64) -> LinkedFibre {
    let mut fibre = crowd(1, 10.0, 1).remove(0);
    fibre.joint = Joint::Ball;
    fibre.bending = fibre.bending.map(|k| k * stiffer);
    fibre.twisting *= stiffer;
    fibre
}

/// A bent fibre straightens; what its joints lose, the fluid takes.
#[test]
fn elastic_energy_goes_into_the_fluid() {
    let mut system = system(settings(), vec![bent(1.0)]);
    let first = system.statistics().elastic_energy;
    let (mut work, mut last) = (0.0, 0.0);
    for step in 0..400 {
        system.advance(&still, 1e-4).expect("a step");
        let mut power = 0.0;
        for s in 0..system.segments() {
            let [f, t] = system.drag(s, &still(&Vector3::zeros(), 0.0));
            let [v, w] = system.motion(s);
            power += f.dot(&v) + t.dot(&w);
        }
        // Adams and Bashforth's weights, as the motion has them.
        work += 1e-4
            * if step == 0 {
                power
            } else {
                1.5 * power - 0.5 * last
            };
        last = power;
    }
    let left = system.statistics().elastic_energy;
    println!("{first} to {left}, {work} taken");
    assert!(left < 0.5 * first);
    assert!(
        (first - left + work).abs() < 1e-3 * first,
        "{}",
        first - left + work
    );
}

/// Both schemes relax alike, the implicit one with first order; and two thousand times stiffer, at a step a thousand times beyond
/// what explicit ones bear, energy falls in every step.
#[test]
fn a_stiff_fibre_relaxes_at_any_step() {
    let energy = |scheme: LinkedScheme, step: f64| {
        let mut system = system(by(scheme), vec![bent(1.0)]);
        (0..(0.02 / step).round() as usize)
            .for_each(|_| system.advance(&still, step).expect("a step"));
        system.statistics().elastic_energy
    };
    let exact = energy(LinkedScheme::Explicit, 5e-5);
    let [coarse, fine] =
        [2e-3, 1e-3].map(|step| energy(LinkedScheme::Implicit, step) / exact - 1.0);
    println!("energy off by {coarse:.2e}, {fine:.2e}");
    assert!(fine.abs() < 0.1 && (0.35..0.65).contains(&(fine / coarse)));

    let mut stiff = system(by(LinkedScheme::Implicit), vec![bent(2000.0)]);
    let mut last = stiff.statistics().elastic_energy;
    let first = last;
    for _ in 0..50 {
        stiff.advance(&still, 1e-3).expect("a step");
        let now = stiff.statistics().elastic_energy;
        assert!(now <= last, "{now} after {last}");
        last = now;
    }
    println!("stiff: {first:.3e} to {last:.3e}");
    assert!(last < 1e-6 * first);
}

fn words(system: &LinkedSystem) -> Vec<u64> {
    let records = system.state().records.into_iter();
    records.flat_map(|r| r.words).collect()
}

fn in_box(scheme: LinkedScheme) -> LinkedSettings {
    LinkedSettings {
        periodic: PeriodicBox {
            origin: Vector3::zeros(),
            lengths: [Some(120.0); 3],
        },
        shear_rate: 1.0,
        ..by(scheme)
    }
}

/// In a sheared box, with contacts across its faces.
#[test]
fn a_restored_system_goes_on_bit_by_bit() {
    for (scheme, step) in SCHEMES.into_iter().zip([2e-5, 5e-4]) {
        let run = |system: &mut LinkedSystem, steps: usize| {
            for _ in 0..steps {
                system.advance(&shear, step).expect("a step");
            }
        };
        let mut whole = system(in_box(scheme), crowd(40, 120.0, 2));
        run(&mut whole, 30);
        let state = whole.state();
        run(&mut whole, 30);
        let mut resumed = system(in_box(scheme), crowd(3, 120.0, 4));
        resumed.restore(state).expect("a state");
        run(&mut resumed, 30);
        assert!(words(&whole) == words(&resumed), "{scheme:?}");
        assert!(!whole.solved_touches().is_empty());
    }
}

#[test]
fn threads_do_not_change_the_bits() {
    for (scheme, step) in SCHEMES.into_iter().zip([1e-6, 1e-4]) {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads").install(|| {
                let mut system = system(in_box(scheme), crowd(110, 120.0, 6));
                for _ in 0..10 {
                    system.advance(&shear, step).expect("a step");
                }
                words(&system)
            })
        };
        assert!(run(1) == run(2), "{scheme:?}");
    }
}

/// Shifting all fibres by whole periods of the sheared box, each by its own, changes nothing but their place.
#[test]
fn images_in_a_sheared_box_are_alike() {
    let fibres = crowd(40, 120.0, 2);
    let mut moved = fibres.clone();
    for (k, fibre) in moved.iter_mut().enumerate() {
        let periods = Vector3::new((k % 3) as f64 - 1.0, (k % 2) as f64, -((k % 4) as f64));
        fibre.centre += periods * 120.0;
    }
    for (scheme, step) in SCHEMES.into_iter().zip([2e-5, 5e-4]) {
        let [a, b] = [&fibres, &moved].map(|fibres| {
            let mut system = system(in_box(scheme), fibres.clone());
            for _ in 0..50 {
                system.advance(&shear, step).expect("a step");
            }
            system
        });
        assert_eq!(a.touches().len(), b.touches().len());
        let turned = (0..a.segments()).map(|s| a.frame(s).angle_to(&b.frame(s)));
        let largest = turned.fold(0.0, f64::max);
        println!("{scheme:?}: {largest:.1e}");
        assert!(largest < 1e-5, "{scheme:?}: {largest}");
        assert!(
            a.solved_touches()
                .iter()
                .any(|t| t.image_velocity != Vector3::zeros())
        );
    }
}

/// g(r) beside all pairs and images; flocs beside a walk over the contacts.
#[test]
fn pairs_and_flocs_are_counted() {
    let mut system = system(in_box(LinkedScheme::Implicit), crowd(60, 120.0, 3));
    for _ in 0..20 {
        system.advance(&shear, 1e-2).expect("a step");
    }
    let (range, bins, edge) = (50.0, 5, 120.0);
    let found = system
        .pair_distribution(range, bins)
        .expect("a distribution");
    let mut counts = vec![0.0; bins];
    let ahead = edge * system.time();
    for a in 0..60 {
        for b in 0..a {
            let mut least = f64::INFINITY;
            for k in 0..125 {
                let [x, y, z] = [k % 5 - 2, k / 5 % 5 - 2, k / 25 - 2].map(f64::from);
                let image = Vector3::new(x * edge + y * ahead, y * edge, z * edge);
                least = least.min((system.centre(a) - system.centre(b) + image).norm());
            }
            if least < range {
                counts[(least / range * bins as f64) as usize] += 1.0;
            }
        }
    }
    for (k, count) in counts.iter().enumerate() {
        let shell = 4.0 / 3.0 * PI * 1e3 * ((k + 1).pow(3) - k.pow(3)) as f64;
        let expected = count / (0.5 * 3600.0 / edge.powi(3) * shell);
        assert!(
            (found[k] - expected).abs() < 1e-9 * (1.0 + expected),
            "{k}: {found:?} {counts:?}"
        );
    }

    let labels = system.flocs();
    let of = |segment: u32| {
        (0..60)
            .find(|f| system.offsets()[f + 1] > segment as usize)
            .expect("a fibre")
    };
    let mut joined: Vec<usize> = (0..60).collect();
    let pairs = || {
        system
            .touches()
            .iter()
            .filter(|t| t.rubs)
            .map(|t| t.segments.map(of))
    };
    for _ in 0..60 {
        for [a, b] in pairs() {
            let least = joined[a].min(joined[b]);
            (joined[a], joined[b]) = (least, least);
        }
    }
    assert!(labels.iter().zip(&joined).all(|(a, b)| *a as usize == *b));
    let (flocs, largest) = system.floc_sizes();
    assert!(flocs > 0 && largest > 1.5 / 60.0, "{flocs} {largest}");
}
