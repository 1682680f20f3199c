//! Networks of linked fibres: walls, the piston that forms them and the grips that pull them apart (Switzer 2002, 2.11).

use fibreflow_fibre::contact::{Repulsion, Wall};
use fibreflow_fibre::linked::{
    Grips, Joint, LinkedFibre, LinkedScheme, LinkedSettings, LinkedSystem, Piston,
};
use fibreflow_fibre::{Fibre, Material, Matrix3, PeriodicBox, Vector3};
use fibreflow_parallel::Communicator;
use rand::{Rng, SeedableRng};
use std::f64::consts::PI;

const SCHEMES: [LinkedScheme; 2] = [LinkedScheme::Explicit, LinkedScheme::Implicit];
const HALF: f64 = 8.0;
/// 6πμℓ.
const STOKES: f64 = 6.0 * PI * HALF;

fn settings(scheme: LinkedScheme) -> LinkedSettings {
    LinkedSettings {
        repulsion: Some(Repulsion {
            strength: 150.0 * STOKES,
            decay: 0.05,
            attraction: 0.0,
            attraction_width: 1.0,
            range: 0.66,
            contact_gap: 0.33,
        }),
        friction: [2.0; 2],
        ..LinkedSettings::new(scheme, 1.0, 3.0)
    }
}

fn system(settings: LinkedSettings, fibres: Vec<LinkedFibre>) -> LinkedSystem {
    LinkedSystem::new(&Communicator::single(), settings, fibres).expect("fibres")
}

/// A fibre through nodes 16 radii apart, in its shape without load; joints of `stiffness` \[6πμℓ · b²\].
fn fibre(id: u64, nodes: Vec<Vector3>, stiffness: f64) -> LinkedFibre {
    let mut beam = Fibre::new(id, Material::new(1.0, 1.0, 0.49, 1.0), nodes);
    beam.material.youngs_modulus = 16.0 * stiffness * STOKES / beam.material.second_moment();
    beam.material.shear_modulus = beam.material.youngs_modulus / 2.98;
    LinkedFibre::new(&beam, Joint::Ball).expect("a fibre")
}

fn straight(id: u64, start: Vector3, along: Vector3, segments: usize) -> LinkedFibre {
    let node = |k: usize| start + along.normalize() * (16.0 * k as f64);
    fibre(id, (0..=segments).map(node).collect(), 40.0)
}

fn still(_: &Vector3, _: f64) -> (Vector3, Matrix3) {
    (Vector3::zeros(), Matrix3::zeros())
}

/// Floor at z = 0 and a piston above.
fn pressed(scheme: LinkedScheme, top: f64, mass: f64, weight: f64, travel: f64) -> LinkedSettings {
    let wall = |z: f64, sign: f64| Wall::plane(Vector3::z() * z, Vector3::z() * sign);
    LinkedSettings {
        walls: vec![wall(0.0, 1.0), wall(top, -1.0)],
        piston: Some(Piston {
            wall: 1,
            mass,
            weight,
            travel,
        }),
        ..settings(scheme)
    }
}

fn pulled(settings: LinkedSettings, planes: [f64; 2], speed: f64) -> LinkedSettings {
    let axis = Vector3::x();
    let grips = Grips {
        axis,
        planes,
        speed,
    };
    LinkedSettings {
        grips: Some(grips),
        ..settings
    }
}

/// Force of the fluid on all segments \[N\], and the sum of sizes.
fn drag(system: &LinkedSystem) -> (Vector3, f64) {
    (0..system.segments()).fold((Vector3::zeros(), 0.0), |(sum, size), s| {
        let [f, _] = system.drag(s, &still(&Vector3::zeros(), 0.0));
        (sum + f, size + f.norm())
    })
}

/// M dv/dt = W − ΣF (S 2.105): free fall; then with the resistance ζ of the fibre that it pushes, v → W/ζ (1 − exp(−ζt/M)); it stops where
/// it is told to; and at rest the weight goes through the fibres into the floor.
#[test]
fn the_piston_falls_pushes_and_rests() {
    for (scheme, step) in SCHEMES.into_iter().zip([5e-4, 2e-3]) {
        // Nothing in its way.
        let mut free = system(pressed(scheme, 100.0, 2.0, 6.0, 10.0), Vec::new());
        for _ in 0..(1.0 / step) as usize {
            free.advance(&still, step).expect("a step");
        }
        let [fallen, speed] = free.piston();
        assert!((speed - 3.0).abs() < 1e-9 && (fallen - 1.5).abs() < 2.0 * step);
        for _ in 0..(2.0 / step) as usize {
            free.advance(&still, step).expect("a step");
        }
        assert_eq!(free.piston(), [10.0, 0.0]);

        // One segment across its way, which it pushes from the start.
        let (mass, weight) = (20.0 * STOKES, 3.0 * STOKES);
        let lying = straight(0, Vector3::new(-8.0, 0.0, 50.0), Vector3::x(), 1);
        let resistance = {
            let mut probe = system(settings(scheme), vec![lying.clone()]);
            probe.advance(&still, step).expect("a step");
            let flow = (Vector3::z(), Matrix3::zeros());
            probe.drag(0, &flow)[0].z
        };
        // Where its push is what the fibre's inertialess start asks for: from no push on.
        let top = 50.0 + 1.0 + 0.66;
        let settings = pressed(scheme, top, mass, weight, 100.0);
        let mut pushing = system(settings, vec![lying]);
        for _ in 0..(20.0 / step) as usize {
            pushing.advance(&still, step).expect("a step");
        }
        let expected = weight / resistance * (1.0 - (-resistance * 20.0 / mass).exp());
        let [_, speed] = pushing.piston();
        println!("{scheme:?}: {speed} of {expected}");
        assert!((speed / expected - 1.0).abs() < 5e-3);
        let load = pushing.wall_loads();
        assert!((load[1] / (resistance * speed) - 1.0).abs() < 1e-2 && load[0] == 0.0);
        // The push of each end is that of its gap: in scheme B at the end of the step, in A at its start.
        let gap = top - pushing.piston()[0] - pushing.centre(0).z - 1.0;
        let late = gap + 0.05 * (0.5 * load[1] / (150.0 * STOKES)).ln();
        let allowed = match scheme {
            LinkedScheme::Explicit => 1.1 * speed * step,
            LinkedScheme::Implicit => 0.02 * speed * step,
        };
        assert!(late.abs() < allowed, "{scheme:?}: {late} of {allowed}");

        // Two crossed fibres between it and the floor.
        let fibres = vec![
            straight(0, Vector3::new(-8.0, 0.0, 1.29), Vector3::x(), 1),
            straight(1, Vector3::new(0.0, -8.0, 3.55), Vector3::y(), 1),
        ];
        let weight = STOKES;
        let mut resting = system(pressed(scheme, 4.85, 0.2 * STOKES, weight, 100.0), fibres);
        for _ in 0..(20.0 / step) as usize {
            resting.advance(&still, step).expect("a step");
        }
        let load = resting.wall_loads();
        let between = resting.solved_touches()[0].push;
        println!("{scheme:?}: {load:?}, {between} by {weight}");
        for force in [load[0], load[1], between] {
            assert!((force / weight - 1.0).abs() < 1e-3);
        }
    }
}

/// A straight fibre pulled along itself at one end feels the drag of all its segments there, and of fewer in every joint.
#[test]
fn the_grip_carries_the_drag_of_what_hangs_on_it() {
    let speed = 0.3;
    for (scheme, step) in SCHEMES.into_iter().zip([1e-4, 1e-2]) {
        let hanging = straight(0, Vector3::new(-76.0, 0.0, 0.0), Vector3::x(), 5);
        let mut system = system(
            pulled(settings(scheme), [-100.0, 0.0], speed),
            vec![hanging],
        );
        for _ in 0..20 {
            system.advance(&still, step).expect("a step");
        }
        let one = -system.drag(0, &still(&Vector3::zeros(), 0.0))[0].x;
        let [grip] = system.grips() else {
            panic!("one grip: {:?}", system.grips());
        };
        assert_eq!((grip.segment, grip.plane), (4, 1));
        assert!((grip.force / (5.0 * one) - 1.0).abs() < 1e-6, "{scheme:?}");
        for s in 1..5 {
            let carried = system.joint_force(s).x / one;
            assert!((carried - s as f64).abs() < 1e-5, "{scheme:?}: {carried}");
        }
        let moved = system.centre(0).x + 36.0 - speed * 20.0 * step;
        assert!(moved.abs() < 1e-6, "{scheme:?}: {moved}");
        assert!((system.tension() - 0.5 * grip.force).abs() < 1e-12 * grip.force);
    }
}

/// Straight between both planes: it does not give, and the pull is the same in all joints.
#[test]
fn a_taut_fibre_does_not_stretch() {
    for (scheme, step) in SCHEMES.into_iter().zip([1e-4, 1e-2]) {
        let taut = straight(0, Vector3::new(-40.0, 1.0, 2.0), Vector3::x(), 5);
        let mut system = system(pulled(settings(scheme), [-35.0, 35.0], 0.1), vec![taut]);
        for _ in 0..10 {
            system.advance(&still, step).expect("a step");
        }
        let tension = system.tension();
        let speeds = (0..5).map(|s| system.motion(s)[0].norm());
        let fastest = speeds.fold(0.0, f64::max);
        println!("{scheme:?}: {tension:e}, {fastest:e}");
        // The implicit scheme finds forces to 1e-4 of each.
        let loose = match scheme {
            LinkedScheme::Explicit => 1e-6,
            LinkedScheme::Implicit => 1e-3,
        };
        assert!(tension > 1e3 * STOKES && fastest * STOKES < loose * tension);
        let [low, high] = system.grips() else {
            panic!("two grips");
        };
        assert!((low.force + high.force).abs() < loose * tension);
        for s in 1..5 {
            let pull = system.joint_force(s).x;
            assert!((pull / tension - 1.0).abs() < loose, "{scheme:?}: {pull}");
        }
        let ends = system.nodes()[5] - system.nodes()[0];
        assert!((ends.norm() - 80.0).abs() < 1e-8);
    }
}

/// A bent pair of segments pulled open slowly: the pull by its lever is the torque of the joint, T a sin(θ/2) = κ(θ₀ − θ) with the
/// distance a from grip to joint.
#[test]
fn a_bent_fibre_opens_by_its_stiffness() {
    let (half_angle, lever, speed): (f64, f64, f64) = (0.5, 12.0, 1e-3);
    for (scheme, step) in SCHEMES.into_iter().zip([2e-3, 0.25]) {
        let leg = Vector3::new(half_angle.cos(), half_angle.sin(), 0.0) * 16.0;
        let nodes = vec![
            Vector3::new(-leg.x, -leg.y, 0.0),
            Vector3::zeros(),
            Vector3::new(leg.x, -leg.y, 0.0),
        ];
        let place = lever * half_angle.cos();
        let bent = fibre(0, nodes, 40.0);
        let stiffness = bent.bending[0];
        let mut system = system(pulled(settings(scheme), [-place, place], speed), vec![bent]);
        let time = 250.0;
        for _ in 0..(time / step) as usize {
            system.advance(&still, step).expect("a step");
        }
        let now = ((place + speed * time) / lever).acos();
        let expected = stiffness * 2.0 * (half_angle - now) / (lever * now.sin());
        let tension = system.tension();
        println!("{scheme:?}: {tension} by {expected}");
        assert!((tension / expected - 1.0).abs() < 1e-2);
    }
}

/// A fibre that lies across a stiff yoke under the piston and is pulled off it: the pull is μN, N being the weight.
#[test]
fn fibres_held_by_friction_slip_at_its_limit() {
    for (scheme, step) in SCHEMES.into_iter().zip([2e-4, 2e-3]) {
        let corner = |x: f64, y: f64| Vector3::new(x, y, 1.29);
        let yoke = vec![
            corner(-16.0, -8.0),
            corner(0.0, -8.0),
            corner(0.0, 8.0),
            corner(-16.0, 8.0),
        ];
        let fibres = vec![
            fibre(0, yoke, 400.0),
            straight(1, Vector3::new(-8.0, 0.0, 3.55), Vector3::x(), 1),
        ];
        let weight = STOKES;
        let settings = pressed(scheme, 4.85, 0.5 * STOKES, weight, 100.0);
        let mut system = system(pulled(settings, [-10.0, 7.0], 0.02), fibres);
        assert_eq!(system.grips().len(), 3);
        let run = |system: &mut LinkedSystem, time: f64| {
            (0..(time / step) as usize).for_each(|_| {
                system.advance(&still, step).expect("a step");
            });
        };
        run(&mut system, 10.0);
        let [touch] = system.solved_touches() else {
            panic!("one contact: {:?}", system.solved_touches());
        };
        let expected = 2.0 * weight;
        let tension = system.tension();
        println!("{scheme:?}: {tension} by {expected}");
        assert!(touch.slides && (tension / expected - 1.0).abs() < 1e-2);
    }
}

/// Fibres piled on each other under a piston and between grips, periodic along y.
fn network(scheme: LinkedScheme) -> LinkedSystem {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let mut number = move || rng.random_range(-1.0..1.0_f64);
    let mut bent = |k: u64| {
        let angle = PI * number();
        let along = Vector3::new(angle.cos(), angle.sin(), 0.0);
        let across = Vector3::z().cross(&along);
        let start = Vector3::new(40.0 * number(), 40.0 * number(), 1.28 + 2.25 * k as f64);
        let mut nodes = vec![start - along * 40.0];
        for i in 0..5 {
            let angle = 0.2 * (f64::from(i) - 2.0);
            nodes.push(nodes[i as usize] + (along * angle.cos() + across * angle.sin()) * 16.0);
        }
        fibre(k, nodes, 40.0)
    };
    let fibres = (0..40).map(&mut bent).collect();
    let mut settings = pressed(scheme, 2.55 + 2.25 * 39.0, 1e3, 2e3, 0.5);
    settings.friction = [2.0, 1.0];
    settings.periodic = PeriodicBox {
        origin: Vector3::zeros(),
        lengths: [None, Some(80.0), None],
    };
    system(pulled(settings, [-45.0, 45.0], 1.0), fibres)
}

/// Grips, walls and fluid together do nothing that is not seen: the forces on all fibres sum up to nothing, and the gripped points move as
/// the planes do.
#[test]
fn forces_of_grips_walls_and_fluid_balance() {
    for (scheme, step, loose) in [
        (SCHEMES[0], 1e-4, 1e-6),
        // What friction is found to.
        (SCHEMES[1], 1e-2, 2e-3),
    ] {
        let mut system = network(scheme);
        let (mut worst, mut contacts) = (0.0_f64, 0);
        for _ in 0..20 {
            system.advance(&still, step).expect("a step");
            let (mut force, mut size) = drag(&system);
            for grip in system.grips() {
                force.x += grip.force;
                size += grip.force.abs();
            }
            let [floor, top] = system.wall_loads()[..] else {
                panic!("two walls");
            };
            force.z += floor - top;
            size += floor + top;
            worst = worst.max(force.norm() / size);
            contacts = contacts.max(system.solved_touches().iter().filter(|t| t.rubs).count());
            for grip in system.grips() {
                let s = grip.segment as usize;
                let [v, w] = system.motion(s);
                let axis = system.felt(s)[1];
                let slip = (v + w.cross(&(axis * grip.along))).x;
                let wanted = if grip.plane == 0 { -1.0 } else { 1.0 };
                assert!((slip - wanted).abs() < loose, "{scheme:?}: {slip}");
            }
        }
        let grips = system.grips().len();
        println!("{scheme:?}: {grips} grips, {contacts} contacts, net {worst:.1e}");
        assert!(worst < 1e-12 && grips > 10 && contacts > 10);
        assert!(system.piston()[0] > 0.0 && system.wall_loads().iter().all(|f| *f > 0.0));
    }
}

fn words(system: &LinkedSystem) -> Vec<u64> {
    let state = system.state();
    let scalars = state.scalars.iter().map(|(_, x)| x.to_bits());
    let records = state.records.iter().flat_map(|r| r.words.iter().copied());
    records.chain(scalars).collect()
}

#[test]
fn restarts_and_threads_do_not_change_the_bits() {
    for (scheme, step) in SCHEMES.into_iter().zip([1e-4, 1e-2]) {
        let run = |threads: usize, parts: bool| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads").install(|| {
                let mut system = network(scheme);
                for n in 0..20 {
                    if parts && n == 10 {
                        let state = system.state();
                        system = network(scheme);
                        system.restore(state).expect("a state");
                    }
                    system.advance(&still, step).expect("a step");
                }
                words(&system)
            })
        };
        let whole = run(1, false);
        assert!(whole == run(2, false), "threads, {scheme:?}");
        assert!(whole == run(1, true), "restart, {scheme:?}");
    }
}
