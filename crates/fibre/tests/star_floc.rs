//! The star floc of Switzer (2002, appendix D.4): two printed steps, digit by digit, and what must not reproduce them.

use fibreflow_fibre::contact::Repulsion;
use fibreflow_fibre::linked::{
    Joint, LinkedFibre, LinkedScheme, LinkedSettings, LinkedSystem, Touch,
};
use fibreflow_fibre::{Matrix3, PeriodicBox, Quaternion, Vector3};
use fibreflow_parallel::Communicator;
use std::f64::consts::{FRAC_PI_2, PI};

const SEGMENTS: usize = 7;
const HALF: f64 = 8.0;
const STEP: f64 = 1e-4;

/// Units: the radius, 1/γ̇, and a viscosity of one; these make a force and a torque of the paper (S 2.42).
const FORCE: f64 = 6.0 * PI * HALF;
const TORQUE: f64 = 8.0 * PI * HALF * HALF * HALF;

/// Lines of numbers of a reference table; empty cells are NaN.
fn table(name: &str) -> Vec<Vec<f64>> {
    let folder = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../cases/star-floc/reference"
    );
    let text = std::fs::read_to_string(format!("{folder}/{name}.csv")).expect(name);
    let number = |cell: &str| cell.parse().unwrap_or(f64::NAN);
    let lines = text.lines().skip(1);
    lines
        .map(|line| line.split(',').map(number).collect())
        .collect()
}

/// From the paper's Euler parameters, axis along the body's z, to frames with the axis along x; y is the same.
fn frame(q: &[f64]) -> Quaternion {
    let paper = nalgebra::Quaternion::new(q[0], q[1], q[2], q[3]);
    Quaternion::new_normalize(paper) * Quaternion::from_axis_angle(&Vector3::y_axis(), -FRAC_PI_2)
}

fn parameters(frame: &Quaternion) -> [f64; 4] {
    let q = frame * Quaternion::from_axis_angle(&Vector3::y_axis(), FRAC_PI_2);
    [q.w, q.i, q.j, q.k]
}

/// What a control leaves out.
#[derive(Clone, Copy, Default)]
struct Without {
    twist: bool,
    strain_torque: bool,
    friction: bool,
    repulsion: bool,
}

fn floc(without: Without, scheme: LinkedScheme) -> LinkedSystem {
    let (centres, frames) = (table("centers_of_mass_in"), table("euler_parameters_in"));
    let bending = 38.0 * TORQUE;
    let fibre = |m: usize| LinkedFibre {
        id: m as u64,
        radius: 1.0,
        half_length: HALF,
        centre: Vector3::from_column_slice(&centres[m][1..4]),
        frames: (0..SEGMENTS)
            .map(|i| frame(&frames[m * SEGMENTS + i][2..6]))
            .collect(),
        equilibrium: vec![Quaternion::identity(); SEGMENTS],
        bending: [bending; 2],
        twisting: if without.twist { 0.0 } else { 0.67 * bending },
        joint: Joint::Ball,
        weight: Vector3::zeros(),
    };
    let strength = if without.repulsion { 1e-12 } else { 150.0 };
    let settings = LinkedSettings {
        repulsion: Some(Repulsion {
            strength: strength * FORCE,
            decay: 1.0 / 20.0,
            attraction: 0.0,
            attraction_width: 1.0,
            range: 0.66,
            contact_gap: 0.33,
        }),
        // Without repulsion Coulomb's limit would take friction away too.
        friction: match (without.friction, without.repulsion) {
            (true, _) => [0.0; 2],
            (_, true) => [1e15; 2],
            _ => [20.0; 2],
        },
        periodic: PeriodicBox {
            origin: Vector3::repeat(-100.0),
            lengths: [Some(200.0); 3],
        },
        ..LinkedSettings::new(scheme, 1.0, 5.0)
    };
    LinkedSystem::new(
        &Communicator::single(),
        settings,
        (0..5).map(fibre).collect(),
    )
    .expect("a floc")
}

/// Largest differences from the print over both steps.
#[derive(Debug, Default)]
struct Differences {
    centres: f64,
    parameters: f64,
    contacts: f64,
    forces: f64,
}

impl Differences {
    fn within(&self) -> bool {
        self.centres < 1e-6 && self.parameters < 1e-6 && self.contacts < 1e-6 && self.forces < 5e-6
    }
}

fn run(without: Without) -> Differences {
    let mut system = floc(without, LinkedScheme::Explicit);
    // u = (z, 0, 0); without the rate of strain, the same velocity and vorticity.
    let gradient = Matrix3::new(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    let felt = if without.strain_torque {
        (gradient - gradient.transpose()) * 0.5
    } else {
        gradient
    };
    let flow = |x: &Vector3, _: f64| (gradient * x, felt);
    let mut d = Differences::default();
    let [centres, frames, forces, contacts] = [
        "center_mass_out",
        "euler_param_out",
        "inextensibility_forces_out",
        "contact_info_out",
    ]
    .map(table);
    let larger = |to: &mut f64, x: f64| *to = to.max(x.abs());
    for k in 1..=2 {
        system.advance(&flow, STEP).expect("a step");
        let now = |line: &&Vec<f64>| (line[0] - k as f64 * STEP).abs() < 1e-9;
        for line in centres.iter().filter(now) {
            let found = system.centre(line[1] as usize - 1);
            (0..3).for_each(|c| larger(&mut d.centres, found[c] - line[2 + c]));
        }
        let segment = |m: f64, i: f64| (m as usize - 1) * SEGMENTS + i as usize - 1;
        for line in frames.iter().filter(now) {
            let found = parameters(&system.frame(segment(line[1], line[2])));
            (0..4).for_each(|c| larger(&mut d.parameters, found[c] - line[3 + c]));
        }
        for line in forces.iter().filter(now) {
            let found = system.joint_force(segment(line[1], line[2])) / FORCE;
            (0..3).for_each(|c| larger(&mut d.forces, found[c] - line[3 + c]));
        }
        let mut rubbing: Vec<&Touch> = system.touches().iter().filter(|t| t.rubs).collect();
        for line in contacts.iter().filter(now) {
            let mut pair = [segment(line[1], line[2]), segment(line[3], line[4])];
            let (mut s, g) = ([line[7], line[8]], line[9]);
            if pair[0] > pair[1] {
                pair.reverse();
                s.reverse();
            }
            let at = rubbing
                .iter()
                .position(|t| t.segments.map(|s| s as usize) == pair);
            match at.map(|at| rubbing.remove(at)) {
                Some(t) => {
                    (0..2).for_each(|c| larger(&mut d.contacts, t.along[c] - s[c]));
                    larger(&mut d.contacts, t.distance - g);
                }
                None => d.contacts = f64::INFINITY,
            }
        }
        if !rubbing.is_empty() {
            d.contacts = f64::INFINITY;
        }
    }
    d
}

#[test]
fn the_printed_steps_are_reproduced() {
    let d = run(Without::default());
    println!("{d:?}");
    assert!(d.within(), "{d:?}");
}

#[test]
fn nothing_less_reproduces_them() {
    let all = Without::default();
    for (name, without) in [
        ("twist", Without { twist: true, ..all }),
        (
            "Y^H",
            Without {
                strain_torque: true,
                ..all
            },
        ),
        (
            "friction",
            Without {
                friction: true,
                ..all
            },
        ),
        (
            "repulsion",
            Without {
                repulsion: true,
                ..all
            },
        ),
    ] {
        let d = run(without);
        println!("without {name}: {d:?}");
        assert!(!d.within() && d.forces > 0.1, "without {name}: {d:?}");
    }
}

/// Both schemes move the floc alike, the explicit one with an error of first order from its lagged joint forces; an implicit step a hundred
/// times as long is nearer to their limit.
#[test]
fn the_implicit_scheme_agrees() {
    let flow = |x: &Vector3, _: f64| {
        let gradient = Matrix3::new(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        (gradient * x, gradient)
    };
    let run = |scheme: LinkedScheme, step: f64| {
        let mut system = floc(Without::default(), scheme);
        let start = system.nodes().to_vec();
        for _ in 0..(0.1 / step).round() as usize {
            system.advance(&flow, step).expect("a step");
        }
        let moved = system.nodes().iter().zip(start).map(|(b, a)| b - a);
        (moved.collect::<Vec<_>>(), system.statistics())
    };
    let apart = |a: &[Vector3], b: &[Vector3]| {
        let squares = |x: f64, v: Vector3| x + v.norm_squared();
        let difference = a.iter().zip(b).map(|(a, b)| a - b).fold(0.0, squares);
        (difference / a.iter().copied().fold(0.0, squares)).sqrt()
    };
    let (reference, b) = run(LinkedScheme::Implicit, 1e-3);
    let [coarse, fine] = [1e-4, 5e-5].map(|step| {
        let (moved, a) = run(LinkedScheme::Explicit, step);
        assert_eq!(a.contacts, b.contacts);
        assert!((b.elastic_energy / a.elastic_energy - 1.0).abs() < 0.01);
        apart(&reference, &moved)
    });
    let long = apart(&reference, &run(LinkedScheme::Implicit, 1e-2).0);
    println!(
        "explicit apart by {coarse:.2e}, {fine:.2e}, a long implicit step by {long:.2e} of the way"
    );
    assert!(coarse < 0.015 && (0.4..0.6).contains(&(fine / coarse)));
    assert!(long < 0.5 * fine);
}
