//! Our share of `scripts/bench/fibre`: one clamped fibre by one integrator. Prints `seconds,substeps`, their values, then
//! `time,deflection,energy` lines, all in SI units.
//!
//! - `beams cantilever INTEGRATOR SEGMENTS LOAD`: tip load PL²/EI; kinetic relaxation when explicit, else two steps of a
//!   thousand periods; one line `x,y,0` by the length
//! - `beams vibration INTEGRATOR SEGMENTS STEP DURATION`: first mode, started in the middle of its swing
//! - `beams flexure INTEGRATOR SEGMENTS STEP SAMPLE DURATION MODULUS RATIO`: oscillating cross flow
//!
//! INTEGRATOR: `explicit`, `implicit` (one sub-step a step) or a tolerance for the implicit one; `twist-free` and
//! `twist-free:TOLERANCE` the same with positions alone.
//!
//! Scenes and references are those of `scripts/bench/fibre_scenes.py`.

use fibreflow_fibre::hydrodynamics::{DragModel, FluidProperties, SlenderConstants, TorqueModel};
use fibreflow_fibre::{
    Fibre, FibreError, FibreSettings, FibreSystem, FlowFormula, Hydrodynamics, ImplicitSettings,
    Integrator, Kinematics, Material, Matrix3, Support, Vector3,
};
use fibreflow_parallel::Communicator;
use std::error::Error;
use std::f64::consts::PI;
use std::time::Instant;

const FLOW_SPEED: f64 = 0.05;
const FLOW_PERIOD: f64 = 2e-3;
const ROOT: f64 = 1.875_104_068_711_961;

/// A fibre under test, the clock and the work done.
struct Trial {
    system: FibreSystem,
    length: f64,
    seconds: f64,
    substeps: usize,
    history: Vec<[f64; 3]>,
}

impl Trial {
    fn new(
        length: f64,
        material: Material,
        segments: usize,
        settings: FibreSettings,
        kinematics: Kinematics,
    ) -> Result<Self, FibreError> {
        let end = Vector3::x() * length;
        let mut fibre = Fibre::straight(0, material, Vector3::zeros(), end, segments);
        fibre.supports = vec![Support::clamp(0)];
        fibre.kinematics = kinematics;
        Ok(Self {
            system: FibreSystem::new(Communicator::single(), settings, vec![fibre])?,
            length,
            seconds: 0.0,
            substeps: 0,
            history: Vec::new(),
        })
    }

    fn soft(
        segments: usize,
        settings: FibreSettings,
        kinematics: Kinematics,
    ) -> Result<Self, FibreError> {
        Self::new(
            1e-2,
            Material::new(1.25e-4, 1e8, 0.3, 1000.0),
            segments,
            settings,
            kinematics,
        )
    }

    /// Advances and counts.
    fn advance(&mut self, flow: Option<FlowFormula>, step: f64) -> Result<(), FibreError> {
        let start = Instant::now();
        match flow {
            Some(flow) => self.system.advance_in(flow, step).map(|_| ())?,
            None => self.system.advance_free(step)?,
        }
        self.seconds += start.elapsed().as_secs_f64();
        self.substeps += self.system.substeps();
        Ok(())
    }

    fn tip(&self) -> Vector3 {
        self.system.positions()[self.system.positions().len() - 1]
    }

    fn record(&mut self, time: f64) {
        let energy = self.system.energy().total();
        self.history.push([time, self.tip().y, energy]);
    }
}

fn cantilever(trial: &mut Trial, load: f64, implicit: bool) -> Result<(), Box<dyn Error>> {
    let bending = trial.system.material(0).bending_stiffness();
    let force = Vector3::y() * (load * bending / trial.length.powi(2));
    let tip = trial.system.positions().len() - 1;
    trial.system.add_load(0, tip, force, Vector3::zeros())?;
    if implicit {
        for _ in 0..2 {
            trial.advance(None, 10.0)?;
        }
    } else {
        relax(trial)?;
    }
    let at = trial.tip() / trial.length;
    trial.history.push([at.x, at.y, 0.0]);
    Ok(())
}

/// All motion is stopped whenever the kinetic energy has passed a maximum.
fn relax(trial: &mut Trial) -> Result<(), Box<dyn Error>> {
    let step = 5.0 * trial.system.critical_step();
    let (mut last, mut peak) = (0.0, 0.0_f64);
    loop {
        trial.advance(None, step)?;
        let kinetic = trial.system.energy().kinetic;
        if kinetic >= last {
            last = kinetic;
            continue;
        }
        trial.system.velocities_mut().fill(Vector3::zeros());
        trial.system.angular_velocities_mut().fill(Vector3::zeros());
        peak = peak.max(last);
        if last < 1e-20 * peak {
            return Ok(());
        }
        last = 0.0;
    }
}

/// First mode of a clamped-free beam and its slope.
fn mode(x: f64) -> [f64; 2] {
    let k = ROOT;
    let s = (k.cosh() + k.cos()) / (k.sinh() + k.sin());
    let (c, h) = (
        (k * x).cosh() - (k * x).cos(),
        (k * x).sinh() - (k * x).sin(),
    );
    [c - s * h, k * ((k * x).sinh() + (k * x).sin() - s * c)]
}

fn vibration(trial: &mut Trial, step: f64, duration: f64) -> Result<(), Box<dyn Error>> {
    let material = *trial.system.material(0);
    let line_density = material.density * material.area();
    let length = trial.length;
    let frequency =
        ROOT * ROOT * (material.bending_stiffness() / (line_density * length.powi(4))).sqrt();
    let peak = 0.01 * frequency / mode(1.0)[0];
    let segments = trial.system.segments();
    for i in 1..=segments {
        let [value, slope] = mode(i as f64 / segments as f64);
        trial.system.velocities_mut()[i].y = peak * length * value;
        trial.system.angular_velocities_mut()[i].z = peak * slope;
    }
    for k in 1..=(duration / step).round() as usize {
        trial.advance(None, step)?;
        trial.record(k as f64 * step);
    }
    Ok(())
}

fn water() -> Hydrodynamics {
    Hydrodynamics {
        fluid: FluidProperties {
            density: 1000.0,
            viscosity: 1e-3,
        },
        drag: DragModel::SlenderBody(SlenderConstants::Batchelor),
        torque: TorqueModel::default(),
        point_spacing: f64::INFINITY,
    }
}

fn flexure(trial: &mut Trial, step: f64, sample: f64, duration: f64) -> Result<(), Box<dyn Error>> {
    let every = (sample / step).round() as usize;
    for k in 1..=(duration / step).round() as usize {
        let flow = |_: &Vector3, moment: f64| {
            let phase = 2.0 * PI * ((k - 1) as f64 + moment) * step / FLOW_PERIOD;
            (Vector3::y() * (FLOW_SPEED * phase.sin()), Matrix3::zeros())
        };
        trial.advance(Some(&flow), step)?;
        if k % every == 0 {
            trial.record(k as f64 * step);
        }
    }
    Ok(())
}

fn integrator(word: &str) -> Result<Integrator, Box<dyn Error>> {
    let tolerance = match word {
        "explicit" => return Ok(Integrator::Explicit),
        "implicit" | "twist-free" => f64::INFINITY,
        number => number.trim_start_matches("twist-free:").parse()?,
    };
    Ok(Integrator::Implicit(ImplicitSettings {
        linear: false,
        tolerance,
    }))
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [scene, way, segments, numbers @ ..] = &words[..] else {
        return Err("usage: beams SCENE INTEGRATOR SEGMENTS NUMBERS".into());
    };
    let mut settings = FibreSettings {
        integrator: integrator(way)?,
        ..FibreSettings::default()
    };
    let kinematics = match way.starts_with("twist-free") {
        true => Kinematics::TwistFree,
        false => Kinematics::Full,
    };
    let segments = segments.parse()?;
    let numbers: Vec<f64> = numbers
        .iter()
        .map(|w| w.parse())
        .collect::<Result<_, _>>()?;
    let trial = match (scene.as_str(), &numbers[..]) {
        ("cantilever", &[load]) => {
            let mut trial = Trial::soft(segments, settings, kinematics)?;
            cantilever(&mut trial, load, way != "explicit")?;
            trial
        }
        ("vibration", &[step, duration]) => {
            let mut trial = Trial::soft(segments, settings, kinematics)?;
            vibration(&mut trial, step, duration)?;
            trial
        }
        ("flexure", &[step, sample, duration, modulus, ratio]) => {
            // 1300 kg/m³, and the displaced water as added mass.
            let material = Material::new(12e-6, modulus, 0.3, 2300.0);
            settings.hydrodynamics = Some(water());
            let mut trial = Trial::new(24e-6 * ratio, material, segments, settings, kinematics)?;
            flexure(&mut trial, step, sample, duration)?;
            trial
        }
        _ => return Err("unknown scene, or not its numbers".into()),
    };
    println!("seconds,substeps\n{},{}", trial.seconds, trial.substeps);
    for [time, deflection, energy] in trial.history {
        println!("{time},{deflection},{energy}");
    }
    Ok(())
}
