//! Orbits of straight fibres in simple shear, and the torque on them: `cases/shear-jeffery/validate.py` runs this.
//!
//! ```text
//! orbits table R_P SEGMENTS MODEL KINEMATICS     period by Jeffery's, drift of the orbit constant, over ten orbits
//! orbits trace R_P SEGMENTS MODEL                φ, θ against strain for ten orbits, CSV
//! orbits torque R_P SEGMENTS MODEL               torque of a held fibre at ten angles, CSV
//! ```
//!
//! MODEL: batchelor, split, ends, kunhappan (drag, with Jeffery's torque), k-torque (Kunhappan's torque), cox, bretherton (spheroids).
//! KINEMATICS: rigid, or flexible (ζ⊥γ̇L⁴/EI = 10).

use fibreflow_fibre::hydrodynamics::{
    AmbientFlow, DragModel, FluidProperties, SlenderConstants, SpheroidRatio, TorqueModel,
    cox_aspect_ratio,
};
use fibreflow_fibre::{
    Fibre, FibreSettings, FibreSystem, Hydrodynamics, ImplicitSettings, Integrator, Kinematics,
    Material, Points, Support, Vector3,
};
use fibreflow_parallel::Communicator;
use std::f64::consts::PI;
use std::process::exit;

const ORBITS: usize = 10;
const FLOW: AmbientFlow = AmbientFlow::Shear { rate: 1.0 };
/// γ̇Δt.
const STEP: f64 = 0.1;

fn laws(model: &str) -> Option<(DragModel, TorqueModel)> {
    let slender = |c| (DragModel::SlenderBody(c), TorqueModel::Jeffery(c));
    let spheroid = |r| {
        (
            DragModel::ProlateSpheroid(r),
            TorqueModel::ProlateSpheroid(r),
        )
    };
    Some(match model {
        "batchelor" => slender(SlenderConstants::Batchelor),
        "split" => slender(SlenderConstants::Split),
        "ends" => slender(SlenderConstants::Ends),
        "kunhappan" => slender(SlenderConstants::Kunhappan),
        "k-torque" => (
            DragModel::SlenderBody(SlenderConstants::Batchelor),
            TorqueModel::Kunhappan,
        ),
        "cox" => spheroid(SpheroidRatio::Cox),
        "bretherton" => spheroid(SpheroidRatio::Bretherton),
        _ => return None,
    })
}

/// One fibre of diameter 1 in a liquid of viscosity 1, next to no inertia.
fn system(
    (drag, torque): (DragModel, TorqueModel),
    axis: Vector3,
    segments: usize,
    rigid: bool,
    held: bool,
) -> FibreSystem {
    let r_p = axis.norm();
    let zeta = SlenderConstants::Batchelor.resistance(r_p, 1.0).normal;
    let section = Material::new(0.5, 1.0, 0.3, 1.0).second_moment();
    let modulus = zeta * r_p.powi(4) / 10.0 / section;
    let material = Material::new(0.5, modulus, 0.3, 1e-3);
    let mut fibre = Fibre::straight(0, material, axis * -0.5, axis * 0.5, segments);
    if rigid {
        fibre.kinematics = Kinematics::Rigid;
    }
    if held {
        fibre.supports = (0..=segments).map(Support::clamp).collect();
    }
    let settings = FibreSettings {
        hydrodynamics: Some(Hydrodynamics {
            fluid: FluidProperties {
                density: 1e-3,
                viscosity: 1.0,
            },
            drag,
            torque,
            point_spacing: f64::INFINITY,
        }),
        integrator: Integrator::Implicit(ImplicitSettings::default()),
        ..FibreSettings::default()
    };
    FibreSystem::new(Communicator::single(), settings, vec![fibre]).expect("a valid fibre")
}

/// Calls `see(strain, direction)` after each step, through ten of Jeffery's orbits at most twice over, until it says stop.
fn follow(mut s: FibreSystem, r_p: f64, mut see: impl FnMut(f64, Vector3) -> bool) {
    let r = cox_aspect_ratio(r_p);
    let end = 2.0 * (ORBITS as f64 + 1.0) * 2.0 * PI * (r + 1.0 / r);
    let mut strain = 0.0;
    while strain < end {
        s.advance_in_flow(&FLOW, STEP).expect("an answer");
        strain += STEP;
        if !see(strain, s.end_to_end(0).normalize()) {
            return;
        }
    }
}

/// 60° from the vorticity axis and 0.3 rad from the gradient.
fn start(r_p: f64) -> Vector3 {
    let (theta, phi) = (PI / 3.0, 0.3_f64);
    Vector3::new(
        theta.sin() * phi.sin(),
        theta.sin() * phi.cos(),
        theta.cos(),
    ) * r_p
}

fn table(r_p: f64, segments: usize, model: &str, laws: (DragModel, TorqueModel), kind: &str) {
    let s = system(laws, start(r_p), segments, kind == "rigid", false);
    let r = cox_aspect_ratio(r_p);
    let constant = |p: Vector3| (p.x * p.x + p.y * p.y * r * r).sqrt() / (r * p.z);
    let (mut crossings, mut last) = (Vec::new(), start(r_p));
    let (mut first, mut drift) = (None, 0.0_f64);
    follow(s, r_p, |strain, p| {
        // Through the gradient direction, where it turns fastest: half an orbit each.
        if last.x * last.y <= 0.0 && p.x * p.y > 0.0 && p.y.abs() > p.x.abs() {
            let (a, b) = (last.x / last.y, p.x / p.y);
            crossings.push(strain - STEP * b / (b - a));
        }
        last = p;
        let first = *first.get_or_insert(constant(p));
        drift = drift.max((constant(p) / first - 1.0).abs());
        crossings.len() <= 2 * ORBITS
    });
    let orbits = (crossings.len() as f64 - 1.0) / 2.0;
    let period = match crossings[..] {
        [first, .., last] => (last - first) / orbits,
        _ => f64::NAN,
    };
    let ratio = period / (2.0 * PI * (r + 1.0 / r));
    println!("{model},{r_p},{segments},{kind},{orbits},{ratio:.6},{drift:.3e}");
}

fn trace(r_p: f64, segments: usize, laws: (DragModel, TorqueModel)) {
    let s = system(laws, start(r_p), segments, true, false);
    let r = cox_aspect_ratio(r_p);
    let end = ORBITS as f64 * 2.0 * PI * (r + 1.0 / r);
    println!("strain,phi,theta,phi_jeffery,theta_jeffery");
    let p0 = start(1.0);
    let phase = (p0.x / (r * p0.y)).atan();
    let constant = (p0.x * p0.x + p0.y * p0.y * r * r).sqrt() / (r * p0.z);
    let mut count = 0;
    follow(s, r_p, |strain, p| {
        let turn = strain / (r + 1.0 / r) + phase;
        let phi = (r * turn.sin()).atan2(turn.cos());
        let theta = (constant * r / (r * phi.cos()).hypot(phi.sin())).atan();
        if count % 5 == 0 {
            let own = [p.x.atan2(p.y), p.x.hypot(p.y).atan2(p.z)];
            println!(
                "{strain:.2},{:.6},{:.6},{phi:.6},{theta:.6}",
                own[0], own[1]
            );
        }
        count += 1;
        strain < end
    });
}

fn torque(r_p: f64, segments: usize, laws: (DragModel, TorqueModel)) {
    println!("angle,torque");
    for k in 0..10 {
        // From the flow direction.
        let angle = f64::from(k) * PI / 18.0;
        let axis = Vector3::new(angle.cos(), angle.sin(), 0.0) * r_p;
        let mut s = system(laws, axis, segments, false, true);
        let mut points = Points::default();
        s.points(&mut points);
        let reaction = s.advance_in_flow(&FLOW, 1e-3).expect("an answer");
        let pairs = points.position.iter().zip(&reaction.force);
        let sum: Vector3 = pairs.map(|(x, f)| x.cross(f)).sum::<Vector3>()
            + reaction.torque.iter().sum::<Vector3>();
        println!("{},{:.9e}", 10 * k, sum.z / r_p.powi(3));
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let parsed = match &arguments[..] {
        [what, ratio, segments, model, rest @ ..] => ratio
            .parse::<f64>()
            .ok()
            .zip(segments.parse::<usize>().ok())
            .zip(laws(model))
            .map(|((r_p, n), laws)| (what.as_str(), r_p, n, model.as_str(), laws, rest)),
        _ => None,
    };
    match parsed {
        Some(("table", r_p, n, model, laws, [kind])) => table(r_p, n, model, laws, kind),
        Some(("trace", r_p, n, _, laws, [])) => trace(r_p, n, laws),
        Some(("torque", r_p, n, _, laws, [])) => torque(r_p, n, laws),
        _ => {
            eprintln!(
                "usage: orbits table R_P SEGMENTS MODEL rigid|flexible | trace R_P SEGMENTS MODEL | torque R_P SEGMENTS MODEL"
            );
            exit(2);
        }
    }
}
